//! Shadow maps, drawn by the G-buffer's rasteriser.

use dapple_scene::{Aabb, LightKind, Pose, Scene};
use glam::{Affine3A, DMat4, Mat3, Vec3};
use rayon::prelude::*;

use super::ShadeParams;
use super::light::{ActiveLight, active_lights};
use crate::gbuffer::{AlphaTest, Sink, Triangle, View, draw};
use crate::projection;

/// A spot light wider than this (radians from its axis) gets the six maps of a point light.
const WIDEST_SPOT: f32 = 1.2;
/// Taps of a filter reach this many texels over the border of a face, so that faces overlap by as much.
const BORDER_TEXELS: f32 = 3.0;
/// How far a receiver is moved along its normal, in texels: a little always, more where light grazes.
const NORMAL_OFFSET_TEXELS: (f32, f32) = (0.05, 0.75);
/// Slack of the comparison: texels, and a share of the distance that covers rounding.
const SLACK: (f32, f32) = (0.02, 1e-5);
/// The receiver's plane may rise by so many texels at a tap.
const STEEPEST_TEXELS: f32 = 16.0;

/// The filter's constants, for comparing them with the shader's.
#[cfg(all(test, feature = "gpu"))]
pub(crate) const SHADOW_FILTER: ((f32, f32), f32) = (NORMAL_OFFSET_TEXELS, STEEPEST_TEXELS);

/// Distances from the lights of a scene in one pose. Made by [`render_shadow_maps`].
#[derive(Clone, Debug, Default)]
pub struct ShadowMaps {
    /// Parallel to the active lights; no faces where nothing throws a shadow.
    faces: Vec<Vec<Face>>,
}

/// One square map.
#[derive(Clone, Debug)]
pub(crate) struct Face {
    pub(crate) view_from_world: Affine3A,
    /// Half the extent in x and y: metres, or tangents of the half angles in a perspective.
    pub(crate) extent: [f32; 2],
    pub(crate) perspective: bool,
    pub(crate) resolution: u32,
    /// Distance along the view axis (metres) of what is nearest to the light, infinite where there is nothing.
    distances: Vec<f32>,
}

/// Draws the shadow maps of the lights that shine in a pose. Instances that do not cast are left out; surfaces cast
/// from both sides; alpha masks let light through.
///
/// A pose of another scene gives no maps, hence no shadows.
pub fn render_shadow_maps(scene: &Scene, pose: &Pose, params: &ShadeParams) -> ShadowMaps {
    let lights = active_lights(scene, pose, params);
    if crate::gbuffer::check_scene(scene, pose).is_err() || !lights.iter().any(|l| l.throws_shadow) {
        return ShadowMaps { faces: lights.iter().map(|_| Vec::new()).collect() };
    }
    let casters = caster_positions(scene, pose);
    let diagonal = Aabb::from_points(casters.iter().copied()).diagonal();
    let faces = lights.iter().map(|light| {
        faces_of(light, params.shadow_resolution, diagonal, |view_from_world| {
            Aabb::from_points(casters.iter().map(|&p| view_from_world.transform_point3(p)))
        })
    });
    let mut faces: Vec<Vec<(Face, Lens)>> = faces.collect();
    for (face, lens) in faces.iter_mut().flatten() {
        face.render(scene, pose, lens);
    }
    ShadowMaps { faces: faces.into_iter().map(|f| f.into_iter().map(|(face, _)| face).collect()).collect() }
}

/// The maps that a light needs, still empty: none if it throws no shadow. `diagonal_m` is that of the box around all
/// casters in the world; `bounds_of` gives the box around them in the space of the map it is given.
pub(crate) fn faces_of(
    light: &ActiveLight,
    resolution: u32,
    diagonal_m: f32,
    bounds_of: impl FnOnce(&Affine3A) -> Aabb,
) -> Vec<(Face, Lens)> {
    if !(light.throws_shadow && diagonal_m > 0.0 && diagonal_m.is_finite()) {
        return Vec::new();
    }
    let resolution = resolution.clamp(16, 8192);
    // Reverse z keeps its precision when the near plane is near.
    let near = (1e-3 * diagonal_m).clamp(1e-4, 0.02);
    match light.kind {
        LightKind::Directional => directional_face(light, bounds_of, resolution).into_iter().collect(),
        LightKind::Spot { outer_cone_angle, .. } if outer_cone_angle <= WIDEST_SPOT => {
            let tangent = libm::tanf(outer_cone_angle.max(1e-3));
            vec![perspective_face(light, light.direction_world, tangent, near, resolution)]
        }
        LightKind::Spot { .. } | LightKind::Point => {
            let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
            let resolution = (resolution / 2).max(16);
            axes.map(|axis| perspective_face(light, axis, 1.0, near, resolution)).into()
        }
    }
}

/// Posed vertices of everything that casts.
fn caster_positions(scene: &Scene, pose: &Pose) -> Vec<Vec3> {
    let mut positions = Vec::new();
    for (instance, posed) in scene.instances.iter().zip(&pose.instances) {
        if !(instance.casts && posed.is_there()) {
            continue;
        }
        let mesh = &scene.meshes[instance.mesh as usize];
        let vertices = posed.deformed.as_ref().map_or(&mesh.positions, |d| &d.positions);
        let world = vertices.iter().map(|&p| posed.world_from_mesh.transform_point3(p));
        positions.extend(world.filter(|p| p.is_finite()));
    }
    positions
}

/// How reverse-z depths of a face become distances.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Lens {
    Perspective { near: f32 },
    Orthographic { near: f32, far: f32 },
}

impl Lens {
    /// Clip space from the view of a face with the given half extents.
    pub(crate) fn clip_from_view(&self, extent: [f32; 2]) -> DMat4 {
        let [x, y] = extent.map(f64::from);
        match *self {
            Lens::Perspective { near } => projection::perspective(1.0 / x, 1.0 / y, f64::from(near)),
            Lens::Orthographic { near, far } => {
                projection::orthographic(x, y, f64::from(near), f64::from(far))
            }
        }
    }
}

/// A rotation that looks along `forward` (view −Z).
fn world_from_view(forward: Vec3, origin: Vec3) -> Affine3A {
    let right = forward.any_orthonormal_vector();
    let linear = Mat3::from_cols(right, right.cross(forward), -forward);
    Affine3A::from_mat3_translation(linear, origin)
}

fn perspective_face(
    light: &ActiveLight,
    forward: Vec3,
    tangent: f32,
    near: f32,
    resolution: u32,
) -> (Face, Lens) {
    let extent = tangent / (1.0 - 2.0 * BORDER_TEXELS / resolution as f32);
    let view_from_world = world_from_view(forward, light.position_world).inverse();
    let face =
        Face { view_from_world, extent: [extent; 2], perspective: true, resolution, distances: Vec::new() };
    (face, Lens::Perspective { near })
}

/// A box around the casters along the light.
fn directional_face(
    light: &ActiveLight,
    bounds_of: impl FnOnce(&Affine3A) -> Aabb,
    resolution: u32,
) -> Option<(Face, Lens)> {
    let turned = world_from_view(light.direction_world, Vec3::ZERO);
    let view_from_world = turned.inverse();
    let bounds = bounds_of(&view_from_world);
    if bounds.is_empty() {
        return None;
    }
    let center = bounds.center();
    let origin = turned.transform_point3(Vec3::new(center.x, center.y, bounds.max.z));
    let half = 0.5 * (bounds.max - bounds.min);
    let margin = 1e-3 * bounds.diagonal() + 1e-6;
    let border = 1.0 / (1.0 - 2.0 * BORDER_TEXELS / resolution as f32);
    let face = Face {
        view_from_world: world_from_view(light.direction_world, origin).inverse(),
        extent: [(half.x + margin) * border, (half.y + margin) * border],
        perspective: false,
        resolution,
        distances: Vec::new(),
    };
    Some((face, Lens::Orthographic { near: -margin, far: 2.0 * half.z + margin }))
}

/// Keeps the greatest reverse-z depth.
struct DepthSink<'a> {
    scene: &'a Scene,
    pose: &'a Pose,
    view: &'a View,
}

impl<'a> Sink for DepthSink<'a> {
    type Pixel = f32;
    type State = Option<AlphaTest<'a>>;

    fn begin(&self, triangle: &Triangle) -> Self::State {
        AlphaTest::new(self.view, self.scene, self.pose, triangle)
    }

    fn sample(&self, test: &Self::State, _: &Triangle, at: [u32; 2], depth: f32, pixel: &mut f32) {
        if depth > *pixel && test.as_ref().is_none_or(|test| test.passes(self.view.ndc(at))) {
            *pixel = depth;
        }
    }
}

impl Face {
    fn render(&mut self, scene: &Scene, pose: &Pose, lens: &Lens) {
        let clip_from_view = lens.clip_from_view(self.extent);
        let clip_from_world = clip_from_view * DMat4::from(projection::widen(&self.view_from_world));
        let view = View { clip_from_world, columns: self.resolution, rows: self.resolution };
        let mut depths = vec![0.0f32; self.resolution as usize * self.resolution as usize];
        let sink = DepthSink { scene, pose, view: &view };
        draw(&view, scene, pose, false, |i| scene.instances[i].casts, &sink, &mut depths);
        depths.par_iter_mut().with_min_len(4096).for_each(|depth| {
            *depth = match *lens {
                _ if *depth <= 0.0 => f32::INFINITY,
                Lens::Perspective { near } => near / *depth,
                Lens::Orthographic { near, far } => far - *depth * (far - near),
            }
        });
        self.distances = depths;
    }

    /// Fraction of 3 × 3 texels about a receiver at which the light sees the receiver's plane.
    fn lit_fraction(&self, position_world: Vec3, normal_world: Vec3, to_light_world: Vec3) -> f32 {
        let resolution = self.resolution as f32;
        let distance = -self.view_from_world.transform_point3(position_world).z;
        let scale = if self.perspective { distance.max(0.0) } else { 1.0 };
        let texel = 2.0 * self.extent[0].max(self.extent[1]) * scale / resolution;
        let cosine = normal_world.dot(to_light_world).clamp(0.0, 1.0);
        let sine = (1.0 - cosine * cosine).sqrt();
        let offset = texel * (NORMAL_OFFSET_TEXELS.0 + NORMAL_OFFSET_TEXELS.1 * sine);
        let position = self.view_from_world.transform_point3(position_world + normal_world * offset);
        let normal = self.view_from_world.transform_vector3(normal_world);
        let distance = -position.z;
        if self.perspective && distance <= 0.0 {
            return 1.0;
        }
        // Picture coordinates, texels.
        let scale = if self.perspective { distance } else { 1.0 };
        let column = ((0.5 + 0.5 * position.x / (self.extent[0] * scale)) * resolution).floor();
        let row = ((0.5 - 0.5 * position.y / (self.extent[1] * scale)) * resolution).floor();
        let slack = SLACK.0 * texel + SLACK.1 * distance.abs();
        let steepest = STEEPEST_TEXELS * texel;
        let mut lit = 0u32;
        for dy in [-1.0, 0.0, 1.0] {
            for dx in [-1.0, 0.0, 1.0] {
                let (c, r) = (column + dx, row + dy);
                if !(0.0..resolution).contains(&c) || !(0.0..resolution).contains(&r) {
                    lit += 1;
                    continue;
                }
                let x = (2.0 * (c + 0.5) / resolution - 1.0) * self.extent[0];
                let y = (1.0 - 2.0 * (r + 0.5) / resolution) * self.extent[1];
                // Distance of the receiver's plane along the tap's ray.
                let plane = if self.perspective {
                    normal.dot(position) / normal.dot(Vec3::new(x, y, -1.0))
                } else {
                    distance + (normal.x * (x - position.x) + normal.y * (y - position.y)) / normal.z
                };
                let plane = if plane.is_finite() {
                    plane.clamp(distance - steepest, distance + steepest)
                } else {
                    distance
                };
                let nearest = self.distances[r as usize * self.resolution as usize + c as usize];
                lit += u32::from(plane <= nearest + slack);
            }
        }
        lit as f32 / 9.0
    }
}

impl ShadowMaps {
    /// Fraction 0 … 1 of a light that reaches a surface; `normal_world` is the geometric one, on the light's side.
    pub(super) fn lit_fraction(
        &self,
        light: usize,
        position_world: Vec3,
        normal_world: Vec3,
        to_light_world: Vec3,
    ) -> f32 {
        let faces = self.faces.get(light).map_or(&[][..], Vec::as_slice);
        let face = match faces {
            [] => return 1.0,
            [face] => face,
            // The order in which the six faces were made: +X, −X, +Y, −Y, +Z, −Z of the direction from the light.
            _ => {
                let d = -to_light_world;
                let a = d.abs();
                let axis = if a.x >= a.y && a.x >= a.z {
                    0
                } else if a.y >= a.z {
                    1
                } else {
                    2
                };
                &faces[2 * axis + usize::from(d[axis] < 0.0)]
            }
        };
        face.lit_fraction(position_world, normal_world, to_light_world)
    }
}
