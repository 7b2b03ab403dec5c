//! What arrives of one light at one place with nothing in the way: irradiance by its form, and the cone that it comes from.
//!
//! The twin of `arrival.wgsl`; equations in `README.md`.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI};

use dapple_scene::area_lights::{LightFigure, LightForm, LightPlace, LightTriangle, luminance};
use glam::Vec3;

/// Light of one light at one place, as a cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// On the surface, W/m², RGB.
    pub irradiance: Vec3,
    /// Unit axis of the cone, world.
    pub direction: Vec3,
    /// Cosine of the angle between axis and rim, −1 … 1.
    pub cos_angle: f32,
}

/// Radii of a flat light away from which it is a point.
const FAR_RADII: f32 = 20.0;
/// Radii over the plane of a flat light up to which a place is in it.
const IN_PLANE_RADII: f32 = 1e-6;
/// Sine of a cone's angle up to which what is above the horizon of it is that of a disc.
const NARROW_SINE: f32 = 0.2;

/// `ball` holds the figure.
pub(super) fn arrive(
    figure: &LightFigure,
    ball: (Vec3, f32),
    position: Vec3,
    normal: Vec3,
) -> Option<Arrival> {
    let vector = match &figure.form {
        LightForm::Sphere { center, radius } => sphere(*center - position, *radius)?,
        LightForm::Disc { center, normal, radius } => {
            let (height, side) = side_of(*normal, position - *center, figure.two_sided, *radius)?;
            disc(position - *center, height, *normal * side, *radius)
        }
        LightForm::Quad { corners, normal } => {
            let (height, side) = side_of(*normal, position - corners[0], figure.two_sided, ball.1)?;
            quad(corners, ball, position, height, *normal * side)
        }
        LightForm::Triangles(triangles) => {
            return from_triangles(triangles, ball.1, figure.two_sided, position, normal);
        }
        LightForm::Places(places) => return from_places(places, figure.two_sided, position, normal),
    };
    // The cone of the light's own radiance that has this vector: |m| = π L sin².
    let length = vector.length();
    let sin2 = (length * FRAC_1_PI).min(1.0);
    let axis = vector.try_normalize()?;
    let cosine = normal.dot(axis);
    let form_factor = above_horizon(cosine, sin2);
    if form_factor <= 0.0 {
        return None;
    }
    let (direction, sin2) = raised(axis, normal, cosine, sin2);
    Some(Arrival {
        irradiance: figure.radiance * (PI * form_factor),
        direction,
        cos_angle: (1.0 - sin2).max(0.0).sqrt(),
    })
}

/// Height of a place over the side of a flat light that shines on it, and which that is; `None` behind it or in its plane.
fn side_of(normal: Vec3, from_light: Vec3, two_sided: bool, radius: f32) -> Option<(f32, f32)> {
    let height = normal.dot(from_light);
    let (height, side) = if height < 0.0 && two_sided { (-height, -1.0) } else { (height, 1.0) };
    (height > IN_PLANE_RADII * radius).then_some((height, side))
}

// The vectors of forms are ∫ ω dω over what a light fills of all directions.

fn sphere(offset: Vec3, radius: f32) -> Option<Vec3> {
    let distance2 = offset.length_squared();
    let r2 = radius * radius;
    // Nothing is seen from inside.
    if distance2 <= r2 * 1.000_001 {
        return None;
    }
    Some(offset * (PI * r2 / (distance2 * distance2.sqrt())))
}

fn disc(from_center: Vec3, height: f32, normal: Vec3, radius: f32) -> Vec3 {
    let across = from_center - normal * height;
    let aside = across.length();
    let (h2, r2) = (height * height, radius * radius);
    let [near, far] = [aside - radius, aside + radius];
    // Product of the distances to the nearest and the farthest place of the rim.
    let rim = ((near * near + h2) * (far * far + h2)).sqrt();
    let q = h2 + aside * aside;
    let facing = if q > r2 { 2.0 * r2 * h2 / (rim * (rim + q - r2)) } else { 0.5 * (1.0 + (r2 - q) / rim) };
    let inwards = 2.0 * height * r2 / (rim * (q + r2 + rim));
    (normal * facing + across * inwards) * -PI
}

fn quad(corners: &[Vec3; 4], ball: (Vec3, f32), position: Vec3, height: f32, normal: Vec3) -> Vec3 {
    let offset = ball.0 - position;
    let distance2 = offset.length_squared();
    if distance2 > FAR_RADII * FAR_RADII * ball.1 * ball.1 {
        let area = 0.5 * (corners[2] - corners[0]).cross(corners[3] - corners[1]).length();
        return offset * (area * height / (distance2 * distance2));
    }
    let [a, b, c, d] = corners.map(|corner| Corner::of(corner - position));
    // Corners may turn either way.
    let vector = (edge(&a, &b) + edge(&b, &c) + edge(&c, &d) + edge(&d, &a)) * 0.5;
    if vector.dot(normal) > 0.0 { -vector } else { vector }
}

/// A corner of a form, from where it is looked at.
struct Corner {
    offset: Vec3,
    length: f32,
}

impl Corner {
    #[inline]
    fn of(offset: Vec3) -> Corner {
        Corner { offset, length: offset.length() }
    }
}

/// The angle between two corners, about the axis that they turn about.
#[inline]
fn edge(a: &Corner, b: &Corner) -> Vec3 {
    let both = (a.length * b.length).max(1e-30);
    let cosine = (a.offset.dot(b.offset) / both).clamp(-1.0, 1.0);
    // The edge itself, not the other corner: so that far corners do not cancel.
    a.offset.cross(b.offset - a.offset) * (angle_over_sine(cosine) / both)
}

/// Angle / sine by the cosine. acos x = √(1 − x) P(x) for 0 ≤ x ≤ 1 ([Abramowitz1964] 4.4.46, to 4 × 10⁻⁸), so that nothing cancels where both go to nothing.
#[inline]
fn angle_over_sine(cosine: f32) -> f32 {
    let x = cosine.abs();
    let p =
        [0.006_670_09, -0.017_088_126, 0.030_891_88, -0.050_174_305, 0.088_978_99, -0.214_598_8, FRAC_PI_2]
            .into_iter()
            .fold(-0.001_262_491_1, |p, a| p * x + a);
    let near = p / (1.0 + x).sqrt();
    if cosine >= 0.0 { near } else { PI / ((1.0 - x) * (1.0 + x)).max(1e-8).sqrt() - near }
}

/// Form factor of what lies above the horizon of a cone whose axis has that cosine and whose angle has that squared sine.
fn above_horizon(cosine: f32, sin2: f32) -> f32 {
    let sine = sin2.sqrt();
    if cosine >= sine {
        return cosine * sin2;
    }
    if cosine <= -sine {
        return 0.0;
    }
    if sine < NARROW_SINE {
        let q = cosine / sine;
        let root = (1.0 - q * q).max(0.0).sqrt();
        return sin2 * sine * FRAC_1_PI * (q * libm::acosf(-q) + root * (2.0 + q * q) * (1.0 / 3.0));
    }
    let cos_angle = (1.0 - sin2).max(0.0).sqrt();
    let level = (1.0 - cosine * cosine).max(1e-12).sqrt();
    // Turn about the axis at which the rim meets the horizon.
    let cos_turn = (-cos_angle * cosine / (sine * level)).clamp(-1.0, 1.0);
    let across = level * (1.0 - cos_turn * cos_turn).max(0.0).sqrt();
    let rim = sin2 * cosine * libm::acosf(cos_turn) - sine * cos_angle * across;
    FRAC_1_PI * (rim + libm::atan2f(sine * across, cos_angle)).max(0.0)
}

/// Axis and squared sine of the cone that is left above the horizon: as high as what is left in the mean, and as large as both extents of it.
fn raised(axis: Vec3, normal: Vec3, cosine: f32, sin2: f32) -> (Vec3, f32) {
    let sine = sin2.sqrt();
    if cosine >= sine {
        return (axis, sin2);
    }
    let half_height = 0.5 * (cosine + sine).max(0.0);
    ((axis + normal * (half_height - cosine)).normalize_or(normal), sine * half_height)
}

/// Sum of what comes from parts of a light, each of which is a small cone.
struct Gathered<'a> {
    normal: &'a Vec3,
    irradiance: Vec3,
    vector: Vec3,
    fluence: f32,
    /// Irradiance of unit radiance.
    form_factor: f32,
}

impl Gathered<'_> {
    fn new(normal: &Vec3) -> Gathered<'_> {
        Gathered { normal, irradiance: Vec3::ZERO, vector: Vec3::ZERO, fluence: 0.0, form_factor: 0.0 }
    }

    /// A part whose axis has that cosine; by the squared sine of its cone's angle.
    fn add(&mut self, axis: Vec3, cosine: f32, sin2: f32, radiance: Vec3) {
        let form_factor = above_horizon(cosine, sin2);
        if form_factor <= 0.0 {
            return;
        }
        self.irradiance += radiance * (PI * form_factor);
        self.form_factor += form_factor;
        // A part at the horizon is there by what is above.
        let sine = sin2.sqrt();
        let above = if cosine < sine { 0.5 * (cosine + sine) / sine } else { 1.0 };
        let share = luminance(radiance) * above * sin2;
        self.vector += raised(axis, *self.normal, cosine, sin2).0 * share;
        // Solid angle over π, without cancellation where it is small.
        self.fluence += share * 2.0 / (1.0 + (1.0 - sin2).max(0.0).sqrt());
    }

    fn arrival(self) -> Option<Arrival> {
        let direction = self.vector.try_normalize()?;
        let cos_angle = (2.0 * self.vector.length() / self.fluence - 1.0).clamp(-1.0, 1.0);
        // Parts that overlap are no more than light from all sides.
        let irradiance = self.irradiance / self.form_factor.max(1.0);
        (irradiance != Vec3::ZERO).then_some(Arrival { irradiance, direction, cos_angle })
    }
}

fn from_triangles(
    triangles: &[LightTriangle],
    radius: f32,
    two_sided: bool,
    position: Vec3,
    normal: Vec3,
) -> Option<Arrival> {
    let mut gathered = Gathered::new(&normal);
    for triangle in triangles {
        let [a, b, c] = triangle.corners.map(|corner| corner - position);
        let cross = (b - a).cross(c - a);
        let facing = -cross.dot(a);
        let is_seen = facing > 0.0 || two_sided;
        if !is_seen || facing.abs() <= IN_PLANE_RADII * radius * cross.length() {
            continue;
        }
        let [a, b, c] = [a, b, c].map(Corner::of);
        // Seen from the front, corners turn against the view.
        let vector = (edge(&a, &b) + edge(&b, &c) + edge(&c, &a)) * if facing > 0.0 { -0.5 } else { 0.5 };
        let length = vector.length();
        let Some(axis) = vector.try_normalize() else { continue };
        gathered.add(axis, normal.dot(axis), (length * FRAC_1_PI).min(1.0), triangle.radiance);
    }
    gathered.arrival()
}

fn from_places(places: &[LightPlace], two_sided: bool, position: Vec3, normal: Vec3) -> Option<Arrival> {
    let mut gathered = Gathered::new(&normal);
    for place in places {
        let offset = place.position_world - position;
        let distance2 = offset.length_squared();
        let Some(axis) = offset.try_normalize() else { continue };
        let facing = -place.normal_world.dot(axis);
        let facing = if two_sided { facing.abs() } else { facing };
        if facing <= 0.0 {
            continue;
        }
        // Over π as `sin2` is: area × cosine / distance², but never more than all that a plane can fill.
        let own = place.area_m2 * FRAC_1_PI;
        let sin2 = own * facing / (distance2 * distance2 + own * own).sqrt();
        gathered.add(axis, normal.dot(axis), sin2, place.radiance);
    }
    gathered.arrival()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angle_over_sine_is_that() {
        for i in -9990..10_000 {
            let cosine = f64::from(i) / 10_000.0;
            let exact = cosine.acos() / (1.0 - cosine * cosine).sqrt();
            let found = f64::from(angle_over_sine(cosine as f32));
            assert!((found / exact - 1.0).abs() < 1e-4, "{cosine}: {found}, exactly {exact}");
        }
        assert!((angle_over_sine(1.0) - 1.0).abs() < 1e-6);
        assert!(angle_over_sine(-1.0).is_finite());
    }
}
