//! Which texels a bilinear read inside a triangle can touch.

use glam::DVec2;

/// Visits every texel (centre of texel *i* at coordinate *i*) that lies less than `reach` texels, along x and along y,
/// from some place of the triangle: for 1, exactly those a bilinear read inside it gives weight. `visit` gets the texel's x, y and
/// the place of the triangle closest to its centre. Triangles may be of any winding, or flat.
///
/// Rows ascend, and within a row x ascends. Returns early, with false, when `visit` returns false.
pub(super) fn touched(
    triangle: [DVec2; 3],
    reach: f64,
    mut visit: impl FnMut(i32, i32, DVec2) -> bool,
) -> bool {
    let low = triangle[0].min(triangle[1]).min(triangle[2]);
    let high = triangle[0].max(triangle[1]).max(triangle[2]);
    let doubled = (triangle[1] - triangle[0]).perp_dot(triangle[2] - triangle[0]);
    let sign = if doubled < 0.0 { -1.0 } else { 1.0 };
    let (first_row, last_row) = open_range(low.y - reach, high.y + reach);
    for row in first_row..=last_row {
        let Some((left, right)) = span(triangle, f64::from(row) - reach, f64::from(row) + reach) else {
            continue;
        };
        let (first, last) = open_range(left - reach, right + reach);
        for column in first..=last {
            let centre = DVec2::new(f64::from(column), f64::from(row));
            let closest = if doubled != 0.0 && contains(triangle, sign, centre) {
                centre
            } else {
                closest_on_border(triangle, centre)
            };
            if !visit(column, row, closest) {
                return false;
            }
        }
    }
    true
}

/// First and last integer strictly between the two.
fn open_range(low: f64, high: f64) -> (i32, i32) {
    (low.floor() as i32 + 1, high.ceil() as i32 - 1)
}

/// Range of x of the part of the triangle with y between `bottom` and `top`.
fn span(triangle: [DVec2; 3], bottom: f64, top: f64) -> Option<(f64, f64)> {
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut add = |x: f64| {
        left = left.min(x);
        right = right.max(x);
    };
    for k in 0..3 {
        let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
        if a.y >= bottom && a.y <= top {
            add(a.x);
        }
        for level in [bottom, top] {
            if (a.y < level) != (b.y < level) {
                let t = ((level - a.y) / (b.y - a.y)).clamp(0.0, 1.0);
                add(a.x + t * (b.x - a.x));
            }
        }
    }
    (left <= right).then_some((left, right))
}

fn contains(triangle: [DVec2; 3], sign: f64, p: DVec2) -> bool {
    (0..3).all(|k| sign * (triangle[(k + 1) % 3] - triangle[k]).perp_dot(p - triangle[k]) >= 0.0)
}

fn closest_on_border(triangle: [DVec2; 3], p: DVec2) -> DVec2 {
    let mut best = (f64::INFINITY, triangle[0]);
    for k in 0..3 {
        let (a, edge) = (triangle[k], triangle[(k + 1) % 3] - triangle[k]);
        let length_squared = edge.length_squared();
        let t = if length_squared > 0.0 { ((p - a).dot(edge) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
        let closest = a + edge * t;
        let distance_squared = closest.distance_squared(p);
        if distance_squared < best.0 {
            best = (distance_squared, closest);
        }
    }
    best.1
}
