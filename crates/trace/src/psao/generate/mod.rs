//! Point generation ([Neff2023] sec. 3.1): uniform by area, thinned to half, anchored to triangles.
//!
//! Takes a scene at time 0, a tracer of it and [`GenerateParams`]; returns [`GeneratedPoints`]: the layout that both
//! ends hold and, for the server alone, each point's [`Anchor`].

mod anchor;
mod density;
mod eliminate;
mod layer;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use dapple_scene::{Pose, Scene};
use dapple_store::points::morton_code;
use dapple_store::points::{LayoutError, MAX_COORDINATE, MAX_POINTS, PackedNormal, PointLayout, PointSet};
use glam::Vec3;
use rayon::prelude::*;

pub use anchor::Anchor;
pub(crate) use anchor::{PosedPoint, pose_anchor, rest_axes};
use density::{Field, MOST_DENSE, Pilots};
use eliminate::{Candidate, eliminate, maximum_radius};
pub use layer::PointLayer;

use crate::inside::mostly_backs;
use crate::rtao::Site;
use crate::sampling::{fixed_pattern, hash, orthonormal_basis};
use crate::{Ray, Tracer, offset_origin};

/// How densely points are laid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GenerateParams {
    /// Points spawned a square metre of rest-space surface; half are kept ([Neff2023]'s N). Default 512.
    pub points_per_m2: f32,
    /// Most points kept, at most [`MAX_POINTS`]. Default 4 million.
    pub max_points: u32,
    /// A point is dropped as lying inside geometry when more than this share of its rays first hit a back face. Default 0.5.
    pub inside_fraction: f32,
    /// Rays of that test, 1 … 256; 0 keeps every point. Default 64.
    pub inside_rays: u32,
    /// Seed of the random places.
    pub seed: u32,
    /// How far density follows the gradient of visibility at time 0, at the same number of points: 0 (default) uniform … 1 from
    /// half of the mean density to twice.
    pub adaptive: f32,
    /// Length in metres of the rays that find the gradient; should be that of [`UpdateParams`](super::update::UpdateParams).
    /// Default 0.6. Means nothing where `adaptive` is 0.
    pub radius_m: f32,
}

impl Default for GenerateParams {
    fn default() -> Self {
        GenerateParams {
            points_per_m2: 512.0,
            max_points: 4_000_000,
            inside_fraction: 0.5,
            inside_rays: 64,
            seed: 0,
            adaptive: 0.0,
            radius_m: 0.6,
        }
    }
}

/// After so many rays of the inside test, a share of back faces that is this far from the limit decides.
const SETTLED: [(usize, f64); 3] = [(8, 0.5), (16, 0.25), (32, 0.15)];

/// What generation gives.
#[derive(Clone, Debug)]
pub struct GeneratedPoints {
    /// What both ends hold.
    pub layout: Arc<PointLayout>,
    /// Where each point sits on its mesh, in the order of the layout. Stays on the server.
    pub anchors: Vec<Anchor>,
    /// Points that were dropped because they lie inside geometry.
    pub dropped_inside: u32,
}

impl GeneratedPoints {
    /// Where the points are in the world at a pose, in the order of the layout, as sites to trace: keys are the points' own for
    /// ever. `None` where a posed triangle has no normal.
    pub fn sites_world(&self, scene: &Scene, pose: &Pose) -> Vec<Option<Site>> {
        sites_world(&self.layout, &self.anchors, scene, pose)
    }
}

/// [`GeneratedPoints::sites_world`] of a layout and the anchors of its points.
pub fn sites_world(
    layout: &PointLayout,
    anchors: &[Anchor],
    scene: &Scene,
    pose: &Pose,
) -> Vec<Option<Site>> {
    let mut sites = Vec::with_capacity(anchors.len());
    for set in layout.sets() {
        let first = set.first as usize;
        let anchors = anchors[first..first + set.len()].par_iter();
        sites.par_extend(anchors.map(|anchor| anchor.site_world(scene, pose, set.instance)));
    }
    sites
}

/// Why no points could be laid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GenerateError {
    /// The density is not a positive finite number.
    #[error("points per m² is {0}, must be positive and finite")]
    BadDensity(f32),
    /// How far density follows the gradient is not in 0 … 1.
    #[error("adaptive is {0}, must be 0 (uniform density) to 1")]
    BadAdaptive(f32),
    /// The scene's surface times the density is too much.
    #[error(
        "{points_per_m2} points per m² on {area_m2:.0} m² of surface would give {points} points, at most {limit} are \
         allowed; lower the density (--points), or, if the file is not in metres, use --radius auto"
    )]
    TooManyPoints {
        /// The density asked for.
        points_per_m2: f32,
        /// Surface of all receiving instances, both sides of double-sided ones.
        area_m2: f64,
        /// How many that is.
        points: u64,
        /// How many are allowed.
        limit: u32,
    },
    /// The layout was refused.
    #[error(transparent)]
    Layout(#[from] LayoutError),
}

/// Finds quickly whether [`generate_points`] would refuse the parameters on this scene.
///
/// # Errors
/// The density is no number above 0, or would give too many points.
pub fn check_density(scene: &Scene, params: &GenerateParams) -> Result<(), GenerateError> {
    let density = params.points_per_m2;
    if !(0.0..=1.0).contains(&params.adaptive) {
        return Err(GenerateError::BadAdaptive(params.adaptive));
    }
    let area_m2: f64 = measure(scene, density)?.iter().map(|(area, _)| area).sum();
    let limit = params.max_points.min(MAX_POINTS);
    let points = (0.5 * area_m2 * f64::from(density)) as u64;
    if points > u64::from(limit) {
        return Err(GenerateError::TooManyPoints { points_per_m2: density, area_m2, points, limit });
    }
    Ok(())
}

/// Surface of each instance, and how long it is.
fn measure(scene: &Scene, density: f32) -> Result<Vec<(f64, f32)>, GenerateError> {
    if !(density.is_finite() && density > 0.0) {
        return Err(GenerateError::BadDensity(density));
    }
    let measure = |i| {
        let area = SurfaceArea::measure(scene, i);
        (area.total, area.extent_m())
    };
    Ok((0..scene.instances.len()).into_par_iter().map(measure).collect())
}

/// Lays points on all instances that receive visibility.
///
/// `pose` must be the scene at time 0 and `tracer` built for it. Runs in the caller's rayon pool; the result does not
/// depend on the number of threads. `progress` is called with the number of instances done.
pub fn generate_points(
    scene: &Scene,
    pose: &Pose,
    tracer: &Tracer,
    params: &GenerateParams,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<GeneratedPoints, GenerateError> {
    check_density(scene, params)?;
    let layer = PointLayer::new(scene, params)?;
    let field = (params.adaptive > 0.0).then(|| {
        let areas: Vec<SurfaceArea> =
            (0..scene.instances.len()).into_par_iter().map(|i| SurfaceArea::measure(scene, i)).collect();
        Field::new(&Ground { scene, pose, tracer, areas: &areas, sides: layer.sides() }, params)
    });
    let done = std::sync::atomic::AtomicUsize::new(0);
    let laid: Vec<LaidInstance> = (0..scene.instances.len())
        .into_par_iter()
        .map(|instance| {
            let pilots = field.as_ref().and_then(|field| field.pilots(instance));
            let laid = layer.lay_one(scene, pose, tracer, instance, pilots);
            progress(1 + done.fetch_add(1, std::sync::atomic::Ordering::Relaxed));
            laid
        })
        .collect();
    layer.join(laid)
}

/// What points are laid on.
struct Ground<'a> {
    scene: &'a Scene,
    pose: &'a Pose,
    tracer: &'a Tracer,
    areas: &'a [SurfaceArea],
    sides: &'a Sides,
}

/// Rest-space area of an instance's triangles, as a running sum.
struct SurfaceArea {
    /// Sum up to and including each triangle; double-sided ones count twice.
    cumulative: Vec<f64>,
    total: f64,
    /// Around the triangles that count.
    min_rest: Vec3,
    max_rest: Vec3,
}

impl SurfaceArea {
    fn measure(scene: &Scene, instance: usize) -> SurfaceArea {
        let placed = &scene.instances[instance];
        let mut all = SurfaceArea {
            cumulative: Vec::new(),
            total: 0.0,
            min_rest: Vec3::INFINITY,
            max_rest: -Vec3::INFINITY,
        };
        if !placed.receives {
            return all;
        }
        let mesh = &scene.meshes[placed.mesh as usize];
        all.cumulative.reserve_exact(mesh.triangles.len());
        for part in &mesh.parts {
            let sides = if scene.materials[part.material as usize].double_sided { 2.0 } else { 1.0 };
            let range = part.first_triangle as usize..(part.first_triangle + part.triangle_count) as usize;
            for triangle in &mesh.triangles[range] {
                let [a, b, c] = triangle.map(|v| placed.rest_from_mesh * mesh.positions[v as usize]);
                let area = 0.5 * f64::from((b - a).cross(c - a).length());
                // A triangle too large for f32 has no usable place in rest space.
                if area.is_finite() {
                    all.total += sides * area;
                    if area > 0.0 {
                        all.min_rest = all.min_rest.min(a).min(b).min(c);
                        all.max_rest = all.max_rest.max(a).max(b).max(c);
                    }
                }
                all.cumulative.push(all.total);
            }
        }
        all
    }

    /// Longest edge of the box around it.
    fn extent_m(&self) -> f32 {
        if self.total > 0.0 { (self.max_rest - self.min_rest).max_element() } else { 0.0 }
    }
}

/// What the inside test knows of each instance.
#[derive(Clone, Debug)]
struct Sides {
    /// The animation moves or bends it.
    moving: Vec<bool>,
    /// Some of its surface is single-sided, so that its back is an inside.
    single: Vec<bool>,
    /// Whether any instance stands still and has such surface.
    any_still: bool,
}

impl Sides {
    fn new(scene: &Scene) -> Sides {
        let moving = scene.moving_instances();
        let is_single = |part: &dapple_scene::Part| !scene.materials[part.material as usize].double_sided;
        let mesh_is_single: Vec<bool> = scene.meshes.iter().map(|m| m.parts.iter().any(is_single)).collect();
        let single: Vec<bool> = scene.instances.iter().map(|i| mesh_is_single[i.mesh as usize]).collect();
        let any_still = moving.iter().zip(&single).any(|(moving, single)| !moving && *single);
        Sides { moving, single, any_still }
    }
}

struct LaidPoint {
    anchor: Anchor,
    position_rest: Vec3,
    normal_rest: Vec3,
}

struct LaidInstance {
    instance: usize,
    points: Vec<LaidPoint>,
    dropped: u32,
}

fn lay_instance(
    scene: &Scene,
    instance: usize,
    area: &SurfaceArea,
    density: f32,
    r_max: f32,
    seed: u32,
    pilots: Option<&Pilots>,
) -> LaidInstance {
    let mut points = Vec::new();
    if area.total > 0.0 {
        let (spawned, scales) = match pilots {
            None => (spawn(scene, instance, area, density, seed, |_| true), None),
            Some(pilots) => {
                // As dense as it is anywhere; of each place the share that its density asks for.
                let mut share = density::Share::new(pilots);
                let spawned = spawn(scene, instance, area, density * MOST_DENSE, seed, |p| share.takes(p));
                (spawned, Some(share.into_scales()))
            }
        };
        let scale = |i: usize| scales.as_ref().map_or(1.0, |scales| scales[i]);
        let candidates: Vec<Candidate> = spawned
            .iter()
            .enumerate()
            .map(|(i, p)| Candidate { position: p.position_rest, normal: p.normal_rest, scale: scale(i) })
            .collect();
        let kept = eliminate(&candidates, spawned.len().div_ceil(2), r_max);
        let mut stays = vec![false; spawned.len()];
        for &i in &kept {
            stays[i as usize] = true;
        }
        points = spawned.into_iter().zip(stays).filter_map(|(p, stays)| stays.then_some(p)).collect();
    }
    LaidInstance { instance, points, dropped: 0 }
}

/// Random places, uniform by area: one in each of equal strata of the running area. Those that `takes` refuses are left out.
fn spawn(
    scene: &Scene,
    instance: usize,
    area: &SurfaceArea,
    density: f32,
    seed: u32,
    mut takes: impl FnMut(&LaidPoint) -> bool,
) -> Vec<LaidPoint> {
    let placed = &scene.instances[instance];
    let mesh = &scene.meshes[placed.mesh as usize];
    // Even the smallest thing gets a point, or it would have no visibility at all.
    let count = (area.total * f64::from(density)).ceil().max(2.0) as u32;
    let stream = u64::from(seed) << 32 | instance as u64;
    let unit = |i: u32, dimension: u32| f64::from(hash(stream, u64::from(i), dimension)) / 4_294_967_296.0;
    let mut spawned = Vec::new();
    let mut triangle = 0usize;
    for i in 0..count {
        let at = (f64::from(i) + unit(i, 0)) / f64::from(count) * area.total;
        while triangle + 1 < area.cumulative.len() && area.cumulative[triangle] <= at {
            triangle += 1;
        }
        // Uniform in the triangle by folding the unit square over its diagonal.
        let (mut u, mut v) = (unit(i, 1) as f32, unit(i, 2) as f32);
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let material = mesh.material_of(triangle as u32);
        let back = scene.materials[material as usize].double_sided && unit(i, 3) < 0.5;
        let anchor = Anchor::new(triangle as u32, [u, v], back);
        if scene.is_hole(mesh, triangle as u32, anchor.barycentrics()) {
            continue;
        }
        let corners = mesh.triangles[triangle].map(|v| placed.rest_from_mesh * mesh.positions[v as usize]);
        let Some(point) = pose_anchor(&anchor, corners, placed.rest_from_mesh.determinant() < 0.0) else {
            continue;
        };
        let point = LaidPoint { anchor, position_rest: point.position, normal_rest: point.normal };
        if takes(&point) {
            spawned.push(point);
        }
    }
    spawned
}

impl LaidInstance {
    /// Drops points that lie inside.
    fn drop_inside(
        &mut self,
        scene: &Scene,
        pose: &Pose,
        tracer: &Tracer,
        sides: &Sides,
        params: &GenerateParams,
    ) {
        let Some(inside) = self.find_inside(scene, pose, tracer, sides, params) else { return };
        let before = self.points.len();
        let mut inside = inside.into_iter();
        self.points.retain(|_| !inside.next().unwrap_or(false));
        self.dropped = (before - self.points.len()) as u32;
    }

    /// Which points lie inside geometry that never moves against them; `None`: none of them.
    ///
    /// Their visibility is dark whatever happens and would bleed into visible surfaces near them. For a point that
    /// stands still that is all still geometry, for one that moves its own instance. A double-sided
    /// surface has no inside.
    fn find_inside(
        &self,
        scene: &Scene,
        pose: &Pose,
        tracer: &Tracer,
        sides: &Sides,
        params: &GenerateParams,
    ) -> Option<Vec<bool>> {
        let rays = params.inside_rays.min(256);
        let instance = self.instance;
        // What is not there yet lies inside of nothing.
        if rays == 0 || !pose.instances[instance].is_there() {
            return None;
        }
        // Of which instances a back face means "inside" for these points.
        let counts = |other: usize| match sides.moving[instance] {
            true => other == instance && sides.single[other],
            false => !sides.moving[other] && sides.single[other],
        };
        if !(counts(instance) || sides.any_still && !sides.moving[instance]) {
            return None;
        }
        let is_back = |origin_world: Vec3, direction_world: Vec3| {
            let hit = tracer.closest_hit(&Ray { origin_world, direction_world, t_max: f32::MAX });
            hit.is_some_and(|hit| {
                hit.back_face && counts(hit.instance as usize) && {
                    let mesh = &scene.meshes[scene.instances[hit.instance as usize].mesh as usize];
                    !scene.materials[mesh.material_of(hit.triangle) as usize].double_sided
                }
            })
        };
        let is_inside = |directions: &mut Vec<Vec3>, point: &LaidPoint| {
            let Some(posed) = point.anchor.pose(scene, pose, instance) else { return false };
            let origin_world = offset_origin(posed.position, posed.normal);
            let (tangent, bitangent) = orthonormal_basis(posed.normal);
            fixed_pattern(rays, point.anchor.site(instance as u32), directions);
            let limit = f64::from(params.inside_fraction);
            mostly_backs(directions, &SETTLED, limit, |d| {
                is_back(origin_world, tangent * d.x + bitangent * d.y + posed.normal * d.z)
            })
        };
        Some(self.points.par_iter().map_init(Vec::new, is_inside).collect())
    }

    fn bounds(&self) -> (Vec3, Vec3) {
        let positions = || self.points.iter().map(|p| p.position_rest);
        (positions().fold(Vec3::INFINITY, Vec3::min), positions().fold(Vec3::NEG_INFINITY, Vec3::max))
    }

    fn into_set(self, instance: u32, quantum_m: f32, anchors: &mut Vec<Anchor>) -> PointSet {
        let (origin_rest, _) = self.bounds();
        let mut keyed: Vec<(u64, PackedNormal, Anchor, [u32; 3])> = self
            .points
            .iter()
            .map(|p| {
                let steps = (p.position_rest - origin_rest) / quantum_m;
                let position = steps.to_array().map(|c| (c.round() as u32).min(MAX_COORDINATE));
                (morton_code(position), PackedNormal::pack(p.normal_rest), p.anchor, position)
            })
            .collect();
        keyed.sort_by_key(|&(code, normal, _, _)| (code, normal));
        anchors.extend(keyed.iter().map(|k| k.2));
        PointSet {
            instance,
            first: 0,
            origin_rest,
            positions: keyed.iter().map(|k| k.3).collect(),
            normals: keyed.iter().map(|k| k.1).collect(),
        }
    }
}
