//! Lays a chart flat: turned to its least box, with a grid of texels whose first and last centres lie on the box.

use glam::{DVec2, DVec3};

use super::grow::{Frame, Grown};
use super::set::TEXEL_FRACTION;
use super::surface::Surface;

/// A side shorter than this, in texels, gets one texel.
const ONE_TEXEL: f64 = 0.35;

/// Directions of the box that are tried: the longest edges of the outline.
const MOST_DIRECTIONS: usize = 64;

/// A chart laid flat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Flat {
    /// First axis along x, second along y, third the chart's normal.
    pub(super) frame: Frame,
    /// Frame coordinates of the centre of the first texel.
    pub(super) low: DVec2,
    /// Distance of texels along x and y in rest space.
    pub(super) step: DVec2,
    /// Texels along x and y.
    pub(super) size: [u16; 2],
}

impl Flat {
    /// One texel at one place.
    pub(super) fn single(place: DVec3, texel: f64) -> Flat {
        let frame = Frame { origin: place, axes: [DVec3::X, DVec3::NEG_Z, DVec3::Y] };
        Flat { frame, low: DVec2::ZERO, step: DVec2::splat(texel), size: [1, 1] }
    }

    /// Where a place of the chart lies, in texels; 0 is the centre of the first.
    pub(super) fn texel_of(&self, place: DVec3) -> DVec2 {
        let p = (self.frame.project(place).truncate() - self.low) / self.step;
        let last = DVec2::new(f64::from(self.size[0] - 1), f64::from(self.size[1] - 1));
        // One texel: everything lies at its centre.
        p.clamp(DVec2::ZERO, last)
    }

    /// The same in steps of 1 / [`TEXEL_FRACTION`] texel, from the border of the first texel: what a [`ChartUv`] counts.
    ///
    /// [`ChartUv`]: super::ChartUv
    pub(super) fn snapped_texel_of(&self, place: DVec3) -> [u16; 2] {
        let at = (self.texel_of(place) + 0.5) * f64::from(TEXEL_FRACTION);
        [at.x.round() as u16, at.y.round() as u16]
    }

    /// The place over a texel on the plane through `corner` with normal `normal` (which faces the chart).
    pub(super) fn place_over(&self, texel: [u16; 2], corner: DVec3, normal: DVec3) -> DVec3 {
        let [u_axis, v_axis, n_axis] = self.frame.axes;
        let u = self.low.x + f64::from(texel[0]) * self.step.x;
        let v = self.low.y + f64::from(texel[1]) * self.step.y;
        let corner = self.frame.project(corner);
        let slope =
            ((u - corner.x) * u_axis.dot(normal) + (v - corner.y) * v_axis.dot(normal)) / n_axis.dot(normal);
        self.frame.origin + u_axis * u + v_axis * v + n_axis * (corner.z - slope)
    }
}

/// Lays a chart flat.
pub(super) fn flatten(surface: &Surface, chart: &Grown, max_side: u16) -> Flat {
    let mut outline: Vec<DVec2> = chart
        .triangles
        .iter()
        .flat_map(|&t| surface.corner_places(t as usize))
        .map(|p| chart.frame.project(p).truncate())
        .collect();
    drop_inner(&mut outline);
    convex_hull(&mut outline);
    let mut best: Option<(u32, f64, Flat)> = None;
    for direction in directions(&outline) {
        let across = direction.perp();
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for p in &outline {
            let turned = DVec2::new(p.dot(direction), p.dot(across));
            low = low.min(turned);
            high = high.max(turned);
        }
        let extent = high - low;
        let (Some(width), Some(height)) =
            (texels(extent.x / chart.texel, max_side), texels(extent.y / chart.texel, max_side))
        else {
            continue;
        };
        let (count, area) = (u32::from(width) * u32::from(height), extent.x * extent.y);
        if best.as_ref().is_some_and(|b| (b.0, b.1) <= (count, area)) {
            continue;
        }
        let [x, y, normal] = chart.frame.axes;
        let (u_axis, v_axis) = (x * direction.x + y * direction.y, x * across.x + y * across.y);
        let (step_x, low_x) = grid(low.x, extent.x, width, chart.texel);
        let (step_y, low_y) = grid(low.y, extent.y, height, chart.texel);
        // Lying is packed better than standing.
        let flat = if width >= height {
            Flat {
                frame: Frame { origin: chart.frame.origin, axes: [u_axis, v_axis, normal] },
                low: DVec2::new(low_x, low_y),
                step: DVec2::new(step_x, step_y),
                size: [width, height],
            }
        } else {
            let high_x = low_x + step_x * f64::from(width - 1);
            Flat {
                frame: Frame { origin: chart.frame.origin, axes: [v_axis, -u_axis, normal] },
                low: DVec2::new(low_y, -high_x),
                step: DVec2::new(step_y, step_x),
                size: [height, width],
            }
        };
        best = Some((count, area, flat));
    }
    match best {
        Some((_, _, flat)) => flat,
        // Not reached: growth keeps to the longest side in the frame it grew in, and that is among the directions.
        None => Flat::single(chart.frame.origin, chart.texel),
    }
}

/// Texels along a side of the given length in texels.
fn texels(length: f64, max_side: u16) -> Option<u16> {
    if length < ONE_TEXEL {
        return Some(1);
    }
    // A hair over a whole number is rounding, not another texel.
    let count = (length - 1e-4).ceil().max(1.0) + 1.0;
    (count <= f64::from(max_side)).then_some(count as u16)
}

/// Distance of texels, and where the first lies.
fn grid(low: f64, extent: f64, count: u16, texel: f64) -> (f64, f64) {
    if count == 1 { (texel, low + 0.5 * extent) } else { (extent / f64::from(count - 1), low) }
}

/// Unit directions a box is tried along: that of the frame first, then edges of the outline, longest first.
fn directions(outline: &[DVec2]) -> Vec<DVec2> {
    let mut edges: Vec<DVec2> =
        (0..outline.len()).map(|i| outline[(i + 1) % outline.len()] - outline[i]).collect();
    edges.sort_by(|a, b| b.length_squared().total_cmp(&a.length_squared()));
    edges.truncate(MOST_DIRECTIONS);
    let units = edges.into_iter().map(|e| e / e.length()).filter(|d| d.is_finite());
    std::iter::once(DVec2::X).chain(units).collect()
}

/// Drops what lies inside the octagon of the outermost points: sorting few is faster than sorting all.
fn drop_inner(points: &mut Vec<DVec2>) {
    if points.len() < 64 {
        return;
    }
    let slants = [
        (1.0, 0.0),
        (1.0, 1.0),
        (0.0, 1.0),
        (-1.0, 1.0),
        (-1.0, 0.0),
        (-1.0, -1.0),
        (0.0, -1.0),
        (1.0, -1.0),
    ]
    .map(|(x, y)| DVec2::new(x, y));
    let mut octagon = [points[0]; 8];
    for &p in points.iter() {
        for (corner, slant) in octagon.iter_mut().zip(slants) {
            if p.dot(slant) > corner.dot(slant) {
                *corner = p;
            }
        }
    }
    let edges: [(DVec2, DVec2); 8] = std::array::from_fn(|i| (octagon[i], octagon[(i + 1) % 8] - octagon[i]));
    points.retain(|&p| edges.iter().any(|&(a, edge)| edge != DVec2::ZERO && edge.perp_dot(p - a) <= 0.0));
}

/// Keeps the corners of the convex hull, counter-clockwise.
fn convex_hull(points: &mut Vec<DVec2>) {
    // Adding zero makes -0 the same as +0 for the order, too.
    points.iter_mut().for_each(|p| *p += DVec2::ZERO);
    points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return;
    }
    let mut hull: Vec<DVec2> = Vec::with_capacity(64);
    let half = |hull: &mut Vec<DVec2>, start: usize, p: DVec2| {
        while hull.len() >= start + 2 {
            let (a, b) = (hull[hull.len() - 2], hull[hull.len() - 1]);
            if (b - a).perp_dot(p - a) > 0.0 {
                break;
            }
            hull.pop();
        }
        hull.push(p);
    };
    for &p in points.iter() {
        half(&mut hull, 0, p);
    }
    let start = hull.len() - 1;
    for &p in points.iter().rev().skip(1) {
        half(&mut hull, start, p);
    }
    hull.pop();
    *points = hull;
}
