//! A light as a figure: what a client that sends no rays shades with, the same from everywhere.

use std::f32::consts::PI;

use glam::Vec3;

use super::shape::{Shape, Triangles};
use super::{AreaLights, luminance};

/// What one light looks like at a moment, with nothing in the way.
#[derive(Clone, Debug, PartialEq)]
pub struct LightFigure {
    /// Its form, world.
    pub form: LightForm,
    /// Mean radiance over its surface, W/(m² sr), RGB.
    pub radiance: Vec3,
    /// Whether it shines from both sides of its surface; spheres do not.
    pub two_sided: bool,
}

/// The form of a light, metres, world.
#[derive(Clone, Debug, PartialEq)]
pub enum LightForm {
    /// Shines outwards.
    Sphere {
        /// Its centre.
        center: Vec3,
        /// > 0.
        radius: f32,
    },
    /// Flat and round.
    Disc {
        /// Its centre.
        center: Vec3,
        /// Unit, of the side that shines.
        normal: Vec3,
        /// > 0.
        radius: f32,
    },
    /// Flat, with four corners around its middle (two may be one).
    Quad {
        /// In order.
        corners: [Vec3; 4],
        /// Unit, of the side that shines.
        normal: Vec3,
    },
    /// Few triangles, at least one.
    Triangles(Vec<LightTriangle>),
    /// Anything else: places that stand for pieces of its surface, at least one.
    Places(Vec<LightPlace>),
}

/// A triangle that shines evenly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightTriangle {
    /// Metres, world; counter-clockwise from the side that shines.
    pub corners: [Vec3; 3],
    /// W/(m² sr), RGB.
    pub radiance: Vec3,
}

/// A place that stands for a piece of a light's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPlace {
    /// Metres, world.
    pub position_world: Vec3,
    /// Unit, of the side that shines.
    pub normal_world: Vec3,
    /// Of the piece, m².
    pub area_m2: f32,
    /// Mean over the piece, W/(m² sr), RGB.
    pub radiance: Vec3,
}

impl AreaLights<'_> {
    /// The form of a light. One of up to `triangles` triangles (≥ 1) that is none of the simple forms is told by its triangles, cut into more where
    /// they are textured; one of more by so many places. `None` for the environment, for what is not there, and for what is dark or has no area.
    ///
    /// Triangles and places are the same at every moment relative to the light, so nothing flickers. Places are taken by power.
    pub fn figure(&self, light: usize, triangles: usize, places: usize) -> Option<LightFigure> {
        let l = self.lights.get(light)?;
        let figure = |form| Some(LightFigure { form, radiance: l.radiance, two_sided: l.two_sided });
        if !(luminance(l.radiance) > 0.0 && l.radiance.is_finite()) {
            return None;
        }
        match &l.shape {
            Shape::Nothing => None,
            Shape::Sphere { center, radius } => {
                let form = LightForm::Sphere { center: *center, radius: *radius };
                Some(LightFigure { form, radiance: l.radiance, two_sided: false })
            }
            Shape::Disc { center, normal, radius } => {
                figure(LightForm::Disc { center: *center, normal: *normal, radius: *radius })
            }
            Shape::Rectangle { center, half: [u, v], normal } => {
                let corners = [*center - *u - *v, *center + *u - *v, *center + *u + *v, *center - *u + *v];
                figure(LightForm::Quad { corners, normal: *normal })
            }
            Shape::Triangles(of) => figure(match quad_of(of) {
                Some((corners, normal)) => LightForm::Quad { corners, normal },
                None if of.corners.len() <= triangles.max(1) => {
                    LightForm::Triangles(self.triangles_of(of, triangles.max(1)))
                }
                None => LightForm::Places(self.places_of(of, places.max(1))),
            }),
        }
        .filter(|figure| match &figure.form {
            LightForm::Triangles(triangles) => !triangles.is_empty(),
            LightForm::Places(places) => !places.is_empty(),
            _ => true,
        })
    }

    /// The triangles that shine, or like pieces of them, at most so many.
    fn triangles_of(&self, triangles: &Triangles, most: usize) -> Vec<LightTriangle> {
        let count = triangles.corners.len();
        let is_textured = triangles.textured.iter().any(Option::is_some);
        let side =
            if is_textured { (1..).take_while(|side| side * side * count <= most).last() } else { None };
        let side = side.unwrap_or(1);
        let pieces = (0..count).flat_map(|i| (0..side * side).map(move |piece| (i, piece)));
        let triangle = |(i, piece): (usize, usize)| {
            let radiance = triangles.mean_emission(self.scene, i, side, piece);
            let corners = subtriangle(triangles.corners[i], side, piece);
            (luminance(radiance) > 0.0 && radiance.is_finite()).then_some(LightTriangle { corners, radiance })
        };
        pieces.filter_map(triangle).collect()
    }

    /// Places on triangles, at most so many.
    fn places_of(&self, triangles: &Triangles, most: usize) -> Vec<LightPlace> {
        let Some(&total) = triangles.weight.last() else { return Vec::new() };
        let count = triangles.corners.len();
        let place = |pick: usize| {
            let at = (pick as f32 + 0.5) / most as f32 * total;
            let i = triangles.weight.partition_point(|sum| *sum <= at).min(count - 1);
            let radiance = triangles.mean_emission(self.scene, i, 1, 0);
            // So much of the light's surface shines as this triangle does.
            let factor = total / (most as f32 * triangles.own_weight(i));
            LightPlace::of(triangles.corners[i], factor, radiance)
        };
        (0..most).filter_map(place).collect()
    }
}

impl LightPlace {
    /// The middle of a triangle, for so many of its kind.
    fn of([a, b, c]: [Vec3; 3], factor: f32, radiance: Vec3) -> Option<LightPlace> {
        let cross = (b - a).cross(c - a);
        let area_m2 = 0.5 * cross.length() * factor;
        let normal_world = cross.try_normalize()?;
        let shines =
            luminance(radiance) > 0.0 && radiance.is_finite() && area_m2 > 0.0 && area_m2.is_finite();
        shines.then_some(LightPlace { position_world: (a + b + c) / 3.0, normal_world, area_m2, radiance })
    }
}

impl LightForm {
    /// Centre and radius, metres, of a ball that holds it.
    pub fn ball(&self) -> (Vec3, f32) {
        let around = |points: &mut dyn Iterator<Item = Vec3>| {
            let points: Vec<Vec3> = points.collect();
            let center = crate::Aabb::from_points(points.iter().copied()).center();
            (center, points.iter().map(|p| p.distance_squared(center)).fold(0.0, f32::max).sqrt())
        };
        match self {
            LightForm::Sphere { center, radius } | LightForm::Disc { center, radius, .. } => {
                (*center, *radius)
            }
            LightForm::Quad { corners, .. } => around(&mut corners.iter().copied()),
            LightForm::Triangles(triangles) => around(&mut triangles.iter().flat_map(|t| t.corners)),
            LightForm::Places(places) => {
                let (center, radius) = around(&mut places.iter().map(|place| place.position_world));
                let widest = places.iter().map(|place| place.area_m2).fold(0.0, f32::max);
                (center, radius + (widest / PI).sqrt())
            }
        }
    }
}

/// One of the `side²` like pieces of a triangle.
fn subtriangle([a, b, c]: [Vec3; 3], side: usize, piece: usize) -> [Vec3; 3] {
    let [p, q, r] = piece_corners(side, piece).map(|[s, t]| a + (b - a) * s + (c - a) * t);
    [p, q, r]
}

/// Its corners by the weights of the second and third corner of the whole.
pub(super) fn piece_corners(side: usize, piece: usize) -> [[f32; 2]; 3] {
    // Row `y` has side − y upright pieces and one fewer upside down.
    let (mut y, mut left) = (0, piece);
    while left >= 2 * (side - y) - 1 {
        left -= 2 * (side - y) - 1;
        y += 1;
    }
    let (x, is_turned) = (left / 2, left % 2 == 1);
    let at = |x: usize, y: usize| [x as f32 / side as f32, y as f32 / side as f32];
    match is_turned {
        false => [at(x, y), at(x + 1, y), at(x, y + 1)],
        true => [at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)],
    }
}

/// The four corners of a light of one triangle, or of two that lie in a plane and share a side, and shine evenly.
fn quad_of(triangles: &Triangles) -> Option<([Vec3; 4], Vec3)> {
    let is_even = triangles.textured.iter().all(Option::is_none);
    let is_alike = triangles.plain.iter().all(|radiance| *radiance == triangles.plain[0]);
    let normal_of = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a).try_normalize();
    if !is_even || !is_alike {
        return None;
    }
    match triangles.corners[..] {
        [[a, b, c]] => Some(([a, b, c, c], normal_of([a, b, c])?)),
        [first, second] => {
            let normal = normal_of(first)?;
            if normal.dot(normal_of(second)?) < 1.0 - 1e-5 {
                return None;
            }
            // The corner of the second that is not the first's goes between the two that both have.
            let apex = second.into_iter().find(|p| !first.contains(p))?;
            let shared = second.iter().filter(|p| first.contains(p)).count();
            let lone = first.iter().position(|p| !second.contains(p))?;
            let [a, b, c] = [0, 1, 2].map(|k| first[(lone + k) % 3]);
            let is_flat = (apex - b).dot(normal).abs() <= 1e-5 * (apex - b).length();
            (shared == 2 && is_flat).then_some(([a, b, apex, c], normal))
        }
        _ => None,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use super::*;
    use crate::area_lights::tests::{Stage, octahedron, square};
    use crate::{EmitterShape, Mesh};
    use glam::Affine3A;

    const RADIANCE: Vec3 = Vec3::new(2.0, 1.0, 0.5);

    fn figure(mesh: Mesh, emitter: EmitterShape, triangles: usize, places: usize) -> LightForm {
        let mut stage = Stage::new();
        stage.add(mesh, emitter, RADIANCE, Affine3A::from_scale(Vec3::splat(2.0)));
        let scene = stage.scene();
        let lights = AreaLights::new(scene, &scene.pose(0.0));
        let figure = lights.figure(0, triangles, places).unwrap();
        assert_eq!((figure.radiance, figure.two_sided), (RADIANCE, false));
        let (center, radius) = figure.form.ball();
        let (around, most) = lights.bounds(0).unwrap();
        assert!(center.distance(around) <= most && radius <= 2.0 * most, "{center} {radius}");
        assert!(lights.figure(1, triangles, places).is_none());
        figure.form
    }

    #[test]
    fn few_triangles_are_told_as_they_are_and_many_by_places_of_the_same_power() {
        let LightForm::Triangles(all) = figure(octahedron(), EmitterShape::Triangles, 8, 5) else { panic!() };
        assert_eq!(all.len(), 8);
        let area = |[a, b, c]: [Vec3; 3]| 0.5 * (b - a).cross(c - a).length();
        let exact: f32 = all.iter().map(|t| area(t.corners)).sum();
        let LightForm::Places(places) = figure(octahedron(), EmitterShape::Triangles, 7, 5) else { panic!() };
        assert_eq!(places.len(), 5);
        let found: f32 = places.iter().map(|place| place.area_m2).sum();
        assert!((found - exact).abs() < 1e-4, "{found} {exact}");
        assert!(
            places.iter().all(|place| place.normal_world.dot(place.position_world) > 0.0),
            "they face outwards"
        );
    }

    #[test]
    fn a_triangle_and_two_that_make_a_quadrangle_have_corners() {
        let LightForm::Quad { corners, normal } = figure(square(), EmitterShape::Triangles, 8, 8) else {
            panic!()
        };
        assert_eq!(normal, Vec3::Z);
        let across = (corners[2] - corners[0]).cross(corners[3] - corners[1]);
        assert!((0.5 * across.length() - 16.0).abs() < 1e-4, "{corners:?}");
        let one = Mesh { triangles: vec![[0, 1, 2]], ..square() };
        let LightForm::Quad { corners, .. } = figure(one, EmitterShape::Triangles, 8, 8) else { panic!() };
        assert_eq!(corners[2], corners[3]);
        // A roof is no plane.
        let mut bent = square();
        bent.positions[3].z = 0.5;
        assert!(
            matches!(figure(bent, EmitterShape::Triangles, 8, 8), LightForm::Triangles(all) if all.len() == 2)
        );
        let LightForm::Quad { normal, .. } = figure(square(), EmitterShape::Rectangle, 8, 8) else {
            panic!()
        };
        assert_eq!(normal, Vec3::Z);
    }

    #[test]
    fn pieces_of_a_triangle_fill_it() {
        for side in 1..6 {
            let pieces = (0..side * side).map(|piece| piece_corners(side, piece));
            let area = |[a, b, c]: [[f32; 2]; 3]| {
                0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
            };
            let each = 0.5 / (side * side) as f32;
            let mut middle = [0.0; 2];
            for piece in pieces {
                assert!((area(piece) - each).abs() < 1e-5, "{side}: {piece:?}");
                assert!(piece.iter().all(|[s, t]| *s >= 0.0 && *t >= 0.0 && s + t <= 1.000_01), "{piece:?}");
                piece
                    .iter()
                    .for_each(|at| (0..2).for_each(|k| middle[k] += at[k] / (3 * side * side) as f32));
            }
            assert!(
                (middle[0] - 1.0 / 3.0).abs() < 1e-5 && (middle[1] - 1.0 / 3.0).abs() < 1e-5,
                "{middle:?}"
            );
        }
    }
}
