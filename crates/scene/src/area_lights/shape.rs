//! Shapes of lights, and places chosen on them.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::figure::piece_corners;
use super::{AreaLight, emitted};
use crate::{Pose, Scene, texture};

/// What an emitting mesh stands for, when light is computed (`extras.light` of its node). Cameras see the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum EmitterShape {
    /// Its own triangles, as they are.
    #[default]
    Triangles,
    /// The smallest ball about the centre of its box that holds its vertices, and which it is inscribed in.
    Sphere,
    /// A flat disc about the centre of its box, as wide as its farthest vertex; it shines where its first triangle faces.
    Disc,
    /// A flat rectangle along two axes of its box in mesh space; it shines where its first triangle faces.
    Rectangle,
}

impl EmitterShape {
    /// All of them, with the names that `extras.light` has for them.
    pub const NAMES: [(&'static str, EmitterShape); 4] = [
        ("triangles", EmitterShape::Triangles),
        ("sphere", EmitterShape::Sphere),
        ("disc", EmitterShape::Disc),
        ("rectangle", EmitterShape::Rectangle),
    ];
}

/// A light's surface in the world.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Shape {
    /// Nothing: it is not there, or has no area.
    Nothing,
    Sphere {
        center: Vec3,
        radius: f32,
    },
    Disc {
        center: Vec3,
        /// Unit.
        normal: Vec3,
        radius: f32,
    },
    Rectangle {
        center: Vec3,
        /// From the centre to the middles of two sides, at right angles.
        half: [Vec3; 2],
        /// Unit.
        normal: Vec3,
    },
    Triangles(Triangles),
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Triangles {
    /// World.
    pub(super) corners: Vec<[Vec3; 3]>,
    /// Running sums of area × mean luminance.
    pub(super) weight: Vec<f32>,
    area: f32,
    /// Material, and both sets of texture coordinates of each corner, where emission is textured.
    pub(super) textured: Vec<Option<(u32, [[Vec2; 2]; 3])>>,
    /// Radiance where it is not.
    pub(super) plain: Vec<Vec3>,
    ball: (Vec3, f32),
}

/// A place on a shape, seen from elsewhere.
pub(super) struct Place {
    pub(super) direction: Vec3,
    pub(super) distance: f32,
    /// By solid angle.
    pub(super) density: f32,
    pub(super) normal: Vec3,
    pub(super) emission: Emission,
}

/// What a place on a light emits.
#[derive(Clone, Copy)]
pub(super) enum Emission {
    /// As its light does in the mean.
    Mean,
    /// This.
    Constant(Vec3),
    /// What the material has there.
    Textured(u32, [Vec2; 2]),
}

impl AreaLight {
    pub(super) fn of(scene: &Scene, pose: &Pose, instance: u32) -> AreaLight {
        let index = instance as usize;
        let placed = &scene.instances[index];
        let mesh = &scene.meshes[placed.mesh as usize];
        let first =
            mesh.parts.iter().find(|p| emitted(scene, p.material) != Vec3::ZERO && p.triangle_count > 0);
        let material = first.map_or(0, |p| p.material);
        let two_sided = scene.materials[material as usize].double_sided;
        let there = pose.instances[index].is_there();
        let analytic = |shape: Shape| (shape, mean_emission(scene, index, material));
        let (shape, radiance) = match placed.emitter {
            _ if !there => (Shape::Nothing, Vec3::ZERO),
            EmitterShape::Triangles => triangles(scene, pose, index),
            EmitterShape::Sphere => analytic(ball(scene, pose, index)),
            EmitterShape::Disc => analytic(flat(scene, pose, index, first, true)),
            EmitterShape::Rectangle => analytic(flat(scene, pose, index, first, false)),
        };
        let area = shape.area();
        let (shape, area) =
            if area > 0.0 && area.is_finite() { (shape, area) } else { (Shape::Nothing, 0.0) };
        let brightness = super::luminance(radiance).max(0.0);
        AreaLight { instance, shape, radiance, brightness, area, two_sided }
    }
}

/// Mean emission of a material over the triangles of an instance at rest.
fn mean_emission(scene: &Scene, instance: usize, material: u32) -> Vec3 {
    let emitter = &scene.materials[material as usize];
    if emitter.emissive_texture.is_none() {
        return emitter.emissive_factor;
    }
    let mesh = &scene.meshes[scene.instances[instance].mesh as usize];
    let (mut sum, mut weight) = (Vec3::ZERO, 0.0);
    for part in mesh.parts.iter().filter(|p| p.material == material) {
        for t in part.first_triangle..part.first_triangle + part.triangle_count {
            let [a, b, c] = mesh.triangles[t as usize].map(|v| mesh.positions[v as usize]);
            let area = 0.5 * (b - a).cross(c - a).length();
            sum += mean_over(|at| texture::emission(scene, emitter, &[mesh.uv(0, t, at), mesh.uv(1, t, at)]))
                * area;
            weight += area;
        }
    }
    if weight > 0.0 { sum / weight } else { Vec3::ZERO }
}

/// Mean over 256 places of a triangle.
fn mean_over(value: impl Fn([f32; 2]) -> Vec3) -> Vec3 {
    const SIDE: u32 = 16;
    let mut sum = Vec3::ZERO;
    for i in 0..SIDE {
        for j in 0..SIDE {
            let place = [i, j].map(|k| (k as f32 + 0.5) / SIDE as f32);
            let [p, q] = fold(place);
            sum += value([p, q]);
        }
    }
    sum / (SIDE * SIDE) as f32
}

/// The unit square onto the weights of two corners of a triangle, area by area.
fn fold(u: [f32; 2]) -> [f32; 2] {
    let r = u[0].max(0.0).sqrt();
    [r * (1.0 - u[1]), r * u[1]]
}

fn ball(scene: &Scene, pose: &Pose, instance: usize) -> Shape {
    let bounds = scene.instance_bounds_world(pose, instance);
    if bounds.is_empty() {
        return Shape::Nothing;
    }
    let center = bounds.center();
    let map = pose.instances[instance].world_from_mesh;
    let vertices = scene.vertex_positions(pose, instance).iter();
    let radius =
        vertices.map(|v| map.transform_point3(*v).distance_squared(center)).fold(0.0, f32::max).sqrt();
    Shape::Sphere { center, radius }
}

fn flat(scene: &Scene, pose: &Pose, instance: usize, part: Option<&crate::Part>, round: bool) -> Shape {
    let map = pose.instances[instance].world_from_mesh;
    let vertices = scene.vertex_positions(pose, instance);
    let mesh = &scene.meshes[scene.instances[instance].mesh as usize];
    let Some(part) = part else { return Shape::Nothing };
    let [a, b, c] = mesh.triangles[part.first_triangle as usize].map(|v| vertices[v as usize]);
    let bounds = crate::Aabb::from_points(vertices.iter().copied());
    let (center, extent) = (bounds.center(), bounds.max - bounds.min);
    let world = |v: Vec3| map.transform_vector3(v);
    let mirror = if glam::Mat3::from(map.matrix3).determinant() < 0.0 { -1.0 } else { 1.0 };
    let Some(normal) = (world(b - a).cross(world(c - a)) * mirror).try_normalize() else {
        return Shape::Nothing;
    };
    let center_world = map.transform_point3(center);
    if round {
        let radius = vertices.iter().map(|v| world(*v - center).length_squared()).fold(0.0, f32::max).sqrt();
        return Shape::Disc { center: center_world, normal, radius };
    }
    // The thinnest axis of the box is the one that it does not extend along.
    let thin = (0..3).min_by(|&i, &j| extent[i].total_cmp(&extent[j])).unwrap_or(2);
    let axes = [0, 1, 2].map(|i| [Vec3::X, Vec3::Y, Vec3::Z][i] * (0.5 * extent[i]));
    let half = [world(axes[(thin + 1) % 3]), world(axes[(thin + 2) % 3])];
    Shape::Rectangle { center: center_world, half, normal }
}

fn triangles(scene: &Scene, pose: &Pose, instance: usize) -> (Shape, Vec3) {
    let mesh = &scene.meshes[scene.instances[instance].mesh as usize];
    let map = pose.instances[instance].world_from_mesh;
    let vertices = scene.vertex_positions(pose, instance);
    let mut found = Triangles {
        corners: Vec::new(),
        weight: Vec::new(),
        area: 0.0,
        textured: Vec::new(),
        plain: Vec::new(),
        ball: (Vec3::ZERO, 0.0),
    };
    let (mut sum, mut radiance, mut bounds) = (0.0f32, Vec3::ZERO, crate::Aabb::EMPTY);
    let mirrored = glam::Mat3::from(map.matrix3).determinant() < 0.0;
    for part in mesh.parts.iter().filter(|p| emitted(scene, p.material) != Vec3::ZERO) {
        let material = &scene.materials[part.material as usize];
        for t in part.first_triangle..part.first_triangle + part.triangle_count {
            let indices = mesh.triangles[t as usize];
            let mut corners = indices.map(|v| map.transform_point3(vertices[v as usize]));
            let mut uvs =
                [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|at| [mesh.uv(0, t, at), mesh.uv(1, t, at)]);
            if mirrored {
                corners.swap(1, 2);
                uvs.swap(1, 2);
            }
            let [a, b, c] = corners;
            let area = 0.5 * (b - a).cross(c - a).length();
            let mean = match material.emissive_texture {
                Some(_) => mean_over(|[p, q]| texture::emission(scene, material, &blend(&uvs, p, q))),
                None => material.emissive_factor,
            };
            if !(area > 0.0 && area.is_finite()) {
                continue;
            }
            // A texel between the places looked at may shine: nothing that can is left out.
            let floor = if material.emissive_texture.is_some() {
                1e-3 * material.emissive_factor
            } else {
                Vec3::ZERO
            };
            sum += area * super::luminance(mean.max(floor)).max(0.0);
            radiance += mean * area;
            found.area += area;
            found.weight.push(sum);
            found.textured.push(material.emissive_texture.as_ref().map(|_| (part.material, uvs)));
            found.plain.push(material.emissive_factor);
            found.corners.push(corners);
            bounds = corners.iter().fold(bounds, |b, p| b.with_point(*p));
        }
    }
    if found.area <= 0.0 || sum <= 0.0 {
        return (Shape::Nothing, Vec3::ZERO);
    }
    let center = bounds.center();
    let far = found.corners.iter().flatten().map(|p| p.distance_squared(center)).fold(0.0, f32::max);
    found.ball = (center, far.sqrt());
    let mean = radiance / found.area;
    (Shape::Triangles(found), mean)
}

fn blend(uvs: &[[Vec2; 2]; 3], p: f32, q: f32) -> [Vec2; 2] {
    [0, 1].map(|set| uvs[0][set] * (1.0 - p - q) + uvs[1][set] * p + uvs[2][set] * q)
}

impl Triangles {
    /// Area × mean luminance of one.
    pub(super) fn own_weight(&self, triangle: usize) -> f32 {
        let before = if triangle == 0 { 0.0 } else { self.weight[triangle - 1] };
        self.weight[triangle] - before
    }

    /// Mean radiance of one of the `side²` like pieces of a triangle.
    pub(super) fn mean_emission(&self, scene: &Scene, triangle: usize, side: usize, piece: usize) -> Vec3 {
        let Some((material, uvs)) = &self.textured[triangle] else { return self.plain[triangle] };
        let [a, b, c] = piece_corners(side, piece).map(Vec2::from);
        mean_over(|[p, q]| {
            let at = a + (b - a) * p + (c - a) * q;
            texture::emission(scene, &scene.materials[*material as usize], &blend(uvs, at.x, at.y))
        })
    }
}

impl Shape {
    /// Square metres, of one side.
    pub(super) fn area(&self) -> f32 {
        match self {
            Shape::Nothing => 0.0,
            Shape::Sphere { radius, .. } => 4.0 * PI * radius * radius,
            Shape::Disc { radius, .. } => PI * radius * radius,
            Shape::Rectangle { half: [u, v], .. } => 4.0 * u.cross(*v).length(),
            Shape::Triangles(t) => t.area,
        }
    }

    /// Centre and radius of a ball that holds it.
    pub(super) fn ball(&self) -> (Vec3, f32) {
        match self {
            Shape::Nothing => (Vec3::ZERO, 0.0),
            Shape::Sphere { center, radius } | Shape::Disc { center, radius, .. } => (*center, *radius),
            Shape::Rectangle { center, half: [u, v], .. } => {
                (*center, (*u + *v).length().max((*u - *v).length()))
            }
            Shape::Triangles(t) => t.ball,
        }
    }

    /// Distance along a ray (unit direction) to where it first meets the side that shines.
    pub(super) fn hit(&self, from: Vec3, direction: Vec3, two_sided: bool) -> Option<f32> {
        let in_front = |t: f32| (t > 0.0 && t.is_finite()).then_some(t);
        let plane = |center: Vec3, normal: Vec3| {
            let cosine = -normal.dot(direction);
            if cosine > 0.0 || two_sided { in_front(-normal.dot(center - from) / cosine) } else { None }
        };
        match self {
            Shape::Nothing => None,
            Shape::Sphere { center, radius } => {
                let offset = *center - from;
                let (along, r2) = (offset.dot(direction), radius * radius);
                let aside2 = (offset - direction * along).length_squared();
                (offset.length_squared() > r2 && aside2 <= r2)
                    .then(|| along - (r2 - aside2).sqrt())
                    .and_then(in_front)
            }
            Shape::Disc { center, normal, radius } => plane(*center, *normal)
                .filter(|t| (from + direction * *t).distance_squared(*center) <= radius * radius),
            Shape::Rectangle { center, half: [u, v], normal } => plane(*center, *normal).filter(|t| {
                let at = from + direction * *t - *center;
                at.dot(*u).abs() <= u.length_squared() && at.dot(*v).abs() <= v.length_squared()
            }),
            Shape::Triangles(triangles) => {
                let (center, radius) = triangles.ball;
                let offset = center - from;
                let along = offset.dot(direction);
                if (offset - direction * along).length_squared() > radius * radius {
                    return None;
                }
                let hits = triangles.corners.iter().filter_map(|[a, b, c]| {
                    let (e1, e2) = (*b - *a, *c - *a);
                    let p = direction.cross(e2);
                    let det = e1.dot(p);
                    if det == 0.0 || (det < 0.0 && !two_sided) {
                        return None;
                    }
                    let s = from - *a;
                    let u = s.dot(p) / det;
                    let q = s.cross(e1);
                    let v = direction.dot(q) / det;
                    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| e2.dot(q) / det).and_then(in_front)
                });
                hits.reduce(f32::min)
            }
        }
    }

    pub(super) fn sample(&self, from: Vec3, two_sided: bool, u: [f32; 3]) -> Option<Place> {
        match self {
            Shape::Sphere { center, radius } => sample_sphere(*center, *radius, from, [u[1], u[2]]),
            _ => self.on_area(u)?.seen_from(from, two_sided),
        }
    }

    /// A place by area, wherever it is looked at from; `None` of balls, which are chosen from by what is seen of them.
    #[inline(always)]
    pub(super) fn on_area(&self, u: [f32; 3]) -> Option<Spot> {
        match self {
            Shape::Nothing | Shape::Sphere { .. } => None,
            Shape::Disc { center, normal, radius } => {
                let (sin, cos) = sin_cos_turns(u[2]);
                let r = radius * u[1].max(0.0).sqrt();
                let [tangent, bitangent] = basis(*normal);
                let position = *center + (tangent * cos + bitangent * sin) * r;
                Some(Spot { position, normal: *normal, area: PI * radius * radius, emission: Emission::Mean })
            }
            Shape::Rectangle { center, half: [a, b], normal } => {
                let position = *center + *a * (2.0 * u[1] - 1.0) + *b * (2.0 * u[2] - 1.0);
                let area = 4.0 * a.cross(*b).length();
                Some(Spot { position, normal: *normal, area, emission: Emission::Mean })
            }
            Shape::Triangles(t) => {
                let total = *t.weight.last()?;
                let i = t.weight.partition_point(|sum| *sum <= u[0] * total).min(t.weight.len() - 1);
                let [a, b, c] = t.corners[i];
                let cross = (b - a).cross(c - a);
                let [p, q] = fold([u[1], u[2]]);
                let emission = match &t.textured[i] {
                    Some((material, uvs)) => Emission::Textured(*material, blend(uvs, p, q)),
                    None => Emission::Constant(t.plain[i]),
                };
                Some(Spot {
                    position: a + (b - a) * p + (c - a) * q,
                    normal: cross.try_normalize()?,
                    // As if the whole light had this triangle's density.
                    area: 0.5 * cross.length() * total / t.own_weight(i),
                    emission,
                })
            }
        }
    }

    /// A place for all that may stand in a ball: for everyone in it, all that can be seen of the shape has a density. `None` where that would be of
    /// little use: the ball holds places on both sides of what shines from both, or is near a sphere for its size.
    /// Whether there is one goes by the first of `u` alone: who then chooses for themselves may move the others.
    pub(super) fn spot(&self, (from, spread): (Vec3, f32), two_sided: bool, u: [f32; 3]) -> Option<Spot> {
        let Shape::Sphere { center, radius } = self else {
            let spot = self.on_area(u)?;
            let height = spot.normal.dot(from - spot.position);
            if !two_sided {
                return Some(spot);
            }
            let normal = if height < 0.0 { -spot.normal } else { spot.normal };
            return (height.abs() > spread).then_some(Spot { normal, ..spot });
        };
        let offset = from - *center;
        let distance = offset.length();
        // Written so that it is false of what is no number.
        let is_far = spread <= NEAR_SPHERE * (distance - radius);
        if !is_far || radius <= &0.0 {
            return None;
        }
        // As the middle of the ball would choose, and now and then anywhere on the cap that somebody in the ball sees: by the angle at the centre of the
        // sphere, that of the farthest, and as much as they stand aside.
        let (cos_seen, sin_aside) = (radius / (distance + spread), spread / distance);
        let [sin_seen, cos_aside] = [cos_seen, sin_aside].map(|x| (1.0 - x * x).max(0.0).sqrt());
        let height = 1.0 - (cos_seen * cos_aside - sin_seen * sin_aside);
        let anywhere = (2.0 * sin_aside).max(LEAST_ANYWHERE);
        let normal = if u[1] < anywhere {
            let below = height * u[1] / anywhere;
            around(offset / distance, below, u[2])
        } else {
            let rest = (u[1] - anywhere) / (1.0 - anywhere);
            sample_sphere(*center, *radius, from, [rest, u[2]])?.normal
        };
        let position = *center + normal * *radius;
        let to_middle = from - position;
        let distance2 = to_middle.length_squared();
        // Uniform by solid angle from there, as an area has it.
        let facing = normal.dot(to_middle).max(0.0) / (distance2 * distance2.sqrt());
        let by_middle = facing / (TAU * cap_height(radius * radius / (distance * distance)));
        let by_cap = 1.0 / (TAU * radius * radius * height);
        let area = 1.0 / (by_middle * (1.0 - anywhere) + by_cap * anywhere);
        Some(Spot { position, normal, area, emission: Emission::Mean })
    }
}

/// Size of a group of places against their distance from a sphere up to which they share places on it.
const NEAR_SPHERE: f32 = 0.25;
/// Least part of the places on it that are chosen evenly.
const LEAST_ANYWHERE: f32 = 0.02;

/// A place on a shape, chosen by area.
pub(super) struct Spot {
    pub(super) position: Vec3,
    /// Unit, on the side that shines.
    pub(super) normal: Vec3,
    /// One over its density, m².
    pub(super) area: f32,
    pub(super) emission: Emission,
}

impl Spot {
    #[inline(always)]
    fn seen_from(self, from: Vec3, two_sided: bool) -> Option<Place> {
        let Spot { position, normal, area, emission } = self;
        let (direction, distance, density, side) = look(position, normal, area, two_sided, from)?;
        Some(Place { direction, distance, density, normal: normal * side, emission })
    }
}

/// Direction to a place from elsewhere, distance, density by solid angle, and on which side of it that is (±1); `None` where its back is seen.
#[inline(always)]
pub(super) fn look(
    at: Vec3,
    normal: Vec3,
    area: f32,
    two_sided: bool,
    from: Vec3,
) -> Option<(Vec3, f32, f32, f32)> {
    let offset = at - from;
    let distance2 = offset.length_squared();
    let distance = distance2.sqrt();
    let direction = offset / distance;
    let facing = -normal.dot(direction);
    let (cosine, side) = if facing < 0.0 && two_sided { (-facing, -1.0) } else { (facing, 1.0) };
    let density = distance2 / (cosine * area);
    (cosine > 0.0 && density.is_finite() && density > 0.0).then_some((direction, distance, density, side))
}

/// Uniform in the cone that a ball fills ([Shirley1996]); nothing from inside.
#[inline(always)]
fn sample_sphere(center: Vec3, radius: f32, from: Vec3, u: [f32; 2]) -> Option<Place> {
    let offset = center - from;
    let distance2 = offset.length_squared();
    let r2 = radius * radius;
    if distance2 <= r2 * 1.000_001 {
        return None;
    }
    let distance = distance2.sqrt();
    let axis = offset / distance;
    let sin2 = r2 / distance2;
    let height = cap_height(sin2);
    let below = height * u[0];
    let cos = 1.0 - below;
    let sin = (below * (2.0 - below)).max(0.0).sqrt();
    let direction = around(axis, below, u[1]);
    // The nearer of the two places where the ray meets the ball.
    let along = distance * cos;
    let inside = (r2 - distance2 * sin * sin).max(0.0).sqrt();
    let hit = along - inside;
    let normal = (from + direction * hit - center).try_normalize()?;
    Some(Place { direction, distance: hit, density: 1.0 / (TAU * height), normal, emission: Emission::Mean })
}

/// 1 − cos of an angle by its squared sine, without cancellation where it is small.
#[inline(always)]
fn cap_height(sin2: f32) -> f32 {
    sin2 / (1.0 + (1.0 - sin2).max(0.0).sqrt())
}

/// The unit vector whose angle to an axis has 1 − cos = `below`, turned about it.
#[inline(always)]
fn around(axis: Vec3, below: f32, turns: f32) -> Vec3 {
    let (cos, sin) = (1.0 - below, (below * (2.0 - below)).max(0.0).sqrt());
    let (s, c) = sin_cos_turns(turns);
    let [tangent, bitangent] = basis(axis);
    ((tangent * c + bitangent * s) * sin + axis * cos).normalize()
}

/// Two unit vectors at right angles to a unit vector and each other ([Duff2017]).
fn basis(n: Vec3) -> [Vec3; 2] {
    let sign = if n.z < 0.0 { -1.0 } else { 1.0 };
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    [Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y)]
}

fn sin_cos_turns(turns: f32) -> (f32, f32) {
    libm::sincosf(turns * TAU)
}
