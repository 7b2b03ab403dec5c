//! The upper level: instances in the world, and the queries that the rest of the crate asks.

use std::sync::Arc;

use dapple_scene::glam::{Affine3A, Mat3, Vec3};
use dapple_scene::{Aabb, Pose, PosedInstance, Scene};
use rayon::prelude::*;

use super::alpha::{AlphaMaterials, MeshAlpha};
use super::build::build;
use super::mesh::{MeshBvh, NearFar};
use super::packet::{PACKET, Packet, SINGLE, reach};
use super::tree::{Child, Tree, WIDTH};
use super::triangle::MeshRay;
use super::{BlockedMask, Hit, MAX_DIRECTIONS, Ray};

/// Up to so many instances nearby are all asked about all rays.
const FEW_INSTANCES: usize = 4;

/// World boxes grow by this part of the numbers they were computed from: more than the rounding of the transform.
const BOX_MARGIN: f32 = 1.0 / (1 << 20) as f32;

/// Answers ray queries on a scene in one pose.
///
/// Instances that do not cast ([`dapple_scene::Instance::casts`]), and those whose transform cannot be inverted in
/// `f32` (scale 0), are not hit. Where a material has alpha (`Mask`, or `Blend` with cutoff 0.5), texels below the
/// cutoff let rays through.
#[derive(Clone)]
pub struct Tracer {
    alpha: AlphaMaterials,
    mesh_alpha: Vec<Arc<MeshAlpha>>,
    /// Trees of meshes with rigid instances, parallel to the scene's meshes.
    rigid: Vec<Option<Arc<MeshBvh>>>,
    /// Parallel to the scene's instances; `None` for those that cannot be hit.
    instances: Vec<Option<PlacedBvh>>,
    /// Parallel to the scene's instances.
    movers: Vec<bool>,
    still: Top,
    moving: Top,
}

/// Which instances a query asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blockers {
    /// All of them.
    All,
    /// Those that are not movers ([`Tracer::set_movers`]).
    Still,
    /// Movers alone.
    Movers,
}

/// A tree over instances, and what it was built from.
#[derive(Clone, Default)]
struct Top {
    indices: Vec<u32>,
    boxes: Vec<Aabb>,
    /// `tree.order` holds instance indices.
    tree: Tree,
}

impl Top {
    /// Builds the tree if the boxes are not those that it was built from.
    fn update(&mut self, (indices, boxes): (Vec<u32>, Vec<Aabb>)) {
        if self.indices == indices && self.boxes == boxes {
            return;
        }
        self.tree = build(&boxes);
        for index in &mut self.tree.order {
            *index = indices[*index as usize];
        }
        (self.indices, self.boxes) = (indices, boxes);
    }
}

/// A mesh's tree where it stands.
#[derive(Clone)]
struct PlacedBvh {
    bvh: Arc<MeshBvh>,
    deformed: bool,
    placement: Placement,
    bounds_world: Aabb,
}

/// World to mesh: the difference to the translation is taken first, in the world, so that an instance far from the
/// origin loses no more digits than its positions already have.
#[derive(Clone, Copy)]
struct Placement {
    mesh_from_world: Mat3,
    translation_world: Vec3,
}

impl Placement {
    fn new(posed: &PosedInstance) -> Option<Placement> {
        let world_from_mesh = Mat3::from(posed.world_from_mesh.matrix3);
        let translation_world = Vec3::from(posed.world_from_mesh.translation);
        if !(world_from_mesh.is_finite() && translation_world.is_finite()) {
            return None;
        }
        let mesh_from_world = inverse(&world_from_mesh)?;
        Some(Placement { mesh_from_world, translation_world })
    }

    #[inline]
    fn position(&self, position_world: Vec3) -> Vec3 {
        self.mesh_from_world * (position_world - self.translation_world)
    }

    #[inline]
    fn direction(&self, direction_world: Vec3) -> Vec3 {
        self.mesh_from_world * direction_world
    }

    fn ray(&self, ray: &Ray) -> Option<MeshRay> {
        MeshRay::new(self.position(ray.origin_world), self.direction(ray.direction_world), ray.t_max)
    }
}

/// The inverse, computed in `f64`; `None` if there is none that `f32` can hold.
fn inverse(m: &Mat3) -> Option<Mat3> {
    let [x, y, z] = m.to_cols_array_2d().map(|column| column.map(f64::from));
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let rows = [cross(y, z), cross(z, x), cross(x, y)];
    let determinant = x[0] * rows[0][0] + x[1] * rows[0][1] + x[2] * rows[0][2];
    let inverse =
        Mat3::from_cols_array_2d(&rows.map(|row| row.map(|e| (e / determinant) as f32))).transpose();
    inverse.is_finite().then_some(inverse)
}

/// Around the transformed boxes of the root's children, clamped to finite numbers. Empty if there is nothing.
fn bounds_world(bvh: &MeshBvh, posed: &PosedInstance) -> Aabb {
    let Some(root) = bvh.tree.nodes.first() else { return Aabb::EMPTY };
    let map = &posed.world_from_mesh;
    let linear = Mat3::from(map.matrix3);
    let absolute = Mat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
    let mut bounds = Aabb::EMPTY;
    for slot in 0..WIDTH {
        let b = root.child_bounds(slot);
        if b.is_empty() {
            continue;
        }
        let size = absolute * b.min.abs().max(b.max.abs()) + Vec3::from(map.translation).abs();
        let b = b.transformed(map);
        let margin = size * BOX_MARGIN;
        bounds = bounds.union(Aabb { min: b.min - margin, max: b.max + margin });
    }
    if bounds.is_empty() || bounds.min.is_nan() || bounds.max.is_nan() {
        return Aabb::EMPTY;
    }
    let limit = Vec3::splat(f32::MAX);
    Aabb { min: bounds.min.clamp(-limit, limit), max: bounds.max.clamp(-limit, limit) }
}

impl Tracer {
    /// Builds all trees, in parallel in the caller's rayon pool.
    pub fn new(scene: &Scene, pose: &Pose) -> Tracer {
        let alpha = AlphaMaterials::new(scene);
        let mesh_alpha = scene.meshes.iter().map(|m| Arc::new(MeshAlpha::new(scene, m, &alpha))).collect();
        let mut tracer = Tracer {
            alpha,
            mesh_alpha,
            rigid: vec![None; scene.meshes.len()],
            instances: vec![None; scene.instances.len()],
            movers: vec![false; scene.instances.len()],
            still: Top::default(),
            moving: Top::default(),
        };
        tracer.place(scene, pose);
        tracer
    }

    /// Follows the scene to another pose. `scene` is the one the tracer was made for.
    ///
    /// Rigid instances cost a box each. Deformed ones are refitted, and built anew once the expected cost of a ray
    /// has grown by half since they were built. Results are the same as those of a new tracer.
    pub fn update(&mut self, scene: &Scene, pose: &Pose) {
        if self.rigid.len() != scene.meshes.len() || self.instances.len() != scene.instances.len() {
            *self = Tracer::new(scene, pose);
        } else {
            self.place(scene, pose);
        }
    }

    fn place(&mut self, scene: &Scene, pose: &Pose) {
        let posed_caster = |i: usize| {
            let instance = &scene.instances[i];
            let posed = pose.instances.get(i)?;
            let mesh = scene.meshes.get(instance.mesh as usize)?;
            (instance.casts && !mesh.triangles.is_empty()).then_some((instance.mesh as usize, mesh, posed))
        };
        let mut wanted = vec![false; scene.meshes.len()];
        for (mesh, _, posed) in (0..scene.instances.len()).filter_map(posed_caster) {
            wanted[mesh] |= posed.deformed.is_none();
        }
        let mesh_alpha = &self.mesh_alpha;
        self.rigid.par_iter_mut().enumerate().for_each(|(i, bvh)| {
            if wanted[i] && bvh.is_none() {
                let mesh = &scene.meshes[i];
                *bvh = Some(Arc::new(MeshBvh::new(mesh, &mesh.positions, Arc::clone(&mesh_alpha[i]))));
            }
        });

        let rigid = &self.rigid;
        self.instances.par_iter_mut().enumerate().for_each(|(i, placed)| {
            let before = placed.take();
            let Some((mesh_index, mesh, posed)) = posed_caster(i) else { return };
            let bvh = match (&posed.deformed, before) {
                (None, _) => rigid[mesh_index].clone(),
                (Some(deformed), Some(PlacedBvh { mut bvh, deformed: true, .. })) => {
                    Arc::make_mut(&mut bvh).update(mesh, &deformed.positions);
                    Some(bvh)
                }
                (Some(deformed), _) => {
                    let alpha = Arc::clone(&mesh_alpha[mesh_index]);
                    Some(Arc::new(MeshBvh::new(mesh, &deformed.positions, alpha)))
                }
            };
            let (Some(bvh), Some(placement)) = (bvh, Placement::new(posed)) else { return };
            let bounds_world = bounds_world(&bvh, posed);
            let deformed = posed.deformed.is_some();
            *placed = Some(PlacedBvh { bvh, deformed, placement, bounds_world });
        });

        self.build_top();
    }

    /// The same instances without those that `keeps` refuses.
    pub(crate) fn only(&self, keeps: impl Fn(usize) -> bool) -> Tracer {
        let mut tracer = self.clone();
        for (index, placed) in tracer.instances.iter_mut().enumerate() {
            if !keeps(index) {
                *placed = None;
            }
        }
        tracer.build_top();
        tracer
    }

    /// One instance alone, at rest: its rest space takes the world's place.
    pub(crate) fn resting(&self, scene: &Scene, instance: usize) -> Tracer {
        let mut tracer = self.clone();
        tracer.instances.fill(None);
        let placed = &scene.instances[instance];
        let mesh_index = placed.mesh as usize;
        let mesh = &scene.meshes[mesh_index];
        if placed.casts && !mesh.triangles.is_empty() {
            let alpha = &self.mesh_alpha[mesh_index];
            let bvh = self.rigid[mesh_index]
                .clone()
                .unwrap_or_else(|| Arc::new(MeshBvh::new(mesh, &mesh.positions, Arc::clone(alpha))));
            let posed =
                PosedInstance { world_from_mesh: Affine3A::from_mat3(placed.rest_from_mesh), deformed: None };
            tracer.instances[instance] = Placement::new(&posed).map(|placement| {
                let bounds_world = bounds_world(&bvh, &posed);
                PlacedBvh { bvh, deformed: false, placement, bounds_world }
            });
        }
        tracer.build_top();
        tracer
    }

    /// Those of the upper trees whose boxes changed: while only movers move that is theirs alone.
    fn build_top(&mut self) {
        let boxes_of = |movers: bool| {
            (0_u32..)
                .zip(self.instances.iter().zip(&self.movers))
                .filter(|(_, (_, moves))| **moves == movers)
                .filter_map(|(i, (placed, _))| placed.as_ref().map(|p| (i, p.bounds_world)))
                .filter(|(_, bounds)| !bounds.is_empty())
                .unzip()
        };
        let (still, moving) = (boxes_of(false), boxes_of(true));
        self.still.update(still);
        self.moving.update(moving);
    }

    /// Says which instances count as movers (parallel to the scene's instances; what is missing is still). None do
    /// after [`Tracer::new`]. It survives [`Tracer::update`], and changes no answer but those of
    /// [`Tracer::occlusion_by`].
    pub fn set_movers(&mut self, movers: &[bool]) {
        let given = movers.iter().copied().chain(std::iter::repeat(false));
        self.movers = given.take(self.instances.len()).collect();
        self.build_top();
    }

    /// Which instances count as movers, parallel to the scene's instances.
    pub fn movers(&self) -> &[bool] {
        &self.movers
    }

    /// As [`Tracer::occlusion`], asking only `blockers`, and only about directions whose bit is set in `open`: those
    /// of them that are blocked.
    pub fn occlusion_by(
        &self,
        blockers: Blockers,
        origin_world: Vec3,
        directions_world: &[Vec3],
        t_max: f32,
        open: &BlockedMask,
    ) -> BlockedMask {
        let through = |top: &Top, open: &BlockedMask| {
            self.blocked_through(&top.tree, origin_world, directions_world, t_max, open)
        };
        match blockers {
            Blockers::Still => through(&self.still, open),
            Blockers::Movers => through(&self.moving, open),
            Blockers::All => {
                let mut blocked = through(&self.still, open);
                let mut rest = *open;
                rest.iter_mut().zip(&blocked).for_each(|(rest, blocked)| *rest &= !blocked);
                let by_movers = through(&self.moving, &rest);
                blocked.iter_mut().zip(by_movers).for_each(|(all, more)| *all |= more);
                blocked
            }
        }
    }

    /// Which of `directions_world` (unit length, the first [`MAX_DIRECTIONS`]) are blocked within `t_max` metres of
    /// `origin_world`, as [`Tracer::occluded`] would answer one by one.
    pub fn occlusion(&self, origin_world: Vec3, directions_world: &[Vec3], t_max: f32) -> BlockedMask {
        let all = [u64::MAX; MAX_DIRECTIONS / PACKET];
        self.occlusion_by(Blockers::All, origin_world, directions_world, t_max, &all)
    }

    fn blocked_through(
        &self,
        top: &Tree,
        origin_world: Vec3,
        directions_world: &[Vec3],
        t_max: f32,
        open: &BlockedMask,
    ) -> BlockedMask {
        let directions_world = &directions_world[..directions_world.len().min(MAX_DIRECTIONS)];
        let mut blocked = BlockedMask::default();
        if top.nodes.is_empty() || !origin_world.is_finite() || t_max.is_nan() || t_max <= 0.0 {
            return blocked;
        }
        let near = self.few_instances_near(top, origin_world, directions_world, t_max);
        if near.as_ref().is_some_and(Vec::is_empty) {
            return blocked;
        }
        let mut packets = (Packet::new(), Packet::new());
        let words = blocked.iter_mut().zip(directions_world.chunks(PACKET)).zip(open);
        for ((word, directions), open) in words {
            let open = open & (u64::MAX >> (PACKET - directions.len()));
            if open == 0 {
                continue;
            }
            *word = match &near {
                Some(near) => {
                    self.blocked_by_few(origin_world, directions, t_max, near, open, &mut packets.0)
                }
                None => self.blocked_by_many(top, origin_world, directions, t_max, open, &mut packets),
            };
        }
        blocked
    }

    /// Sends all open rays through each instance.
    fn blocked_by_few(
        &self,
        origin_world: Vec3,
        directions_world: &[Vec3],
        t_max: f32,
        near: &[(f32, &PlacedBvh)],
        all: u64,
        packet: &mut Packet,
    ) -> u64 {
        let mut blocked = 0;
        let mut directions_mesh = [Vec3::ZERO; PACKET];
        for (_, placed) in near {
            let open = all & !blocked;
            if open == 0 {
                break;
            }
            for (mesh, world) in directions_mesh.iter_mut().zip(directions_world) {
                *mesh = placed.placement.direction(*world);
            }
            let origin = placed.placement.position(origin_world);
            packet.fill(origin, &directions_mesh[..directions_world.len()], open, t_max);
            blocked |= packet.trace(&placed.bvh, &self.alpha);
        }
        blocked
    }

    /// Finds out first which rays may touch which instance's box.
    fn blocked_by_many(
        &self,
        top: &Tree,
        origin_world: Vec3,
        directions_world: &[Vec3],
        t_max: f32,
        open: u64,
        (world, mesh): &mut (Packet, Packet),
    ) -> u64 {
        world.fill(origin_world, directions_world, open, t_max);
        let bounds_of = |i: u32| self.instances[i as usize].as_ref().map_or(Aabb::EMPTY, |p| p.bounds_world);
        let mut met: Vec<(f32, &PlacedBvh, u64)> = Vec::new();
        world.primitives_through(top, bounds_of, |instance, rays| {
            if let Some(placed) = &self.instances[instance as usize] {
                met.push((placed.bounds_world.distance_squared(origin_world), placed, rays));
            }
        });
        met.sort_by(|a, b| a.0.total_cmp(&b.0));

        // From here on rays go by their lane in the world's packet.
        let mut blocked = 0;
        let mut directions_mesh = [Vec3::ZERO; PACKET];
        for (_, placed, rays) in met {
            let mut rays = rays & !blocked;
            if rays == 0 {
                continue;
            }
            let placement = &placed.placement;
            let origin = placement.position(origin_world);
            let direction = |lane: usize| placement.direction(Vec3::from_array(world.directions()[lane]));
            if rays.count_ones() > SINGLE {
                for (lane, mesh) in directions_mesh.iter_mut().enumerate() {
                    *mesh = direction(lane);
                }
                mesh.fill(origin, &directions_mesh, rays, t_max);
                blocked |= mesh.trace(&placed.bvh, &self.alpha);
                continue;
            }
            while rays != 0 {
                let lane = rays.trailing_zeros() as usize;
                rays &= rays - 1;
                let ray = MeshRay::new(origin, direction(lane), t_max);
                if ray.is_some_and(|r| placed.bvh.any_hit(0, &r, &self.alpha)) {
                    blocked |= 1 << lane;
                }
            }
        }
        world.sources(blocked)
    }

    /// Instances whose box the rays may touch, nearest first; `None` if they are more than [`FEW_INSTANCES`].
    fn few_instances_near(
        &self,
        top: &Tree,
        origin: Vec3,
        directions: &[Vec3],
        t_max: f32,
    ) -> Option<Vec<(f32, &PlacedBvh)>> {
        let (lo, hi) = reach(directions.iter().copied(), t_max);
        let (min, max) = (origin + lo, origin + hi);
        let reach_squared = t_max * t_max * 1.000_01;
        let mut near = Vec::with_capacity(FEW_INSTANCES);
        let mut stack = Vec::with_capacity(16);
        if !top.nodes.is_empty() {
            stack.push(0);
        }
        while let Some(index) = stack.pop() {
            let node = &top.nodes[index as usize];
            let mut slots = node.touching(min, max);
            while slots != 0 {
                let slot = slots.trailing_zeros() as usize;
                slots &= slots - 1;
                match node.child(slot) {
                    Child::Inner(child) => stack.push(child),
                    Child::Leaf(range) => {
                        let indices = top.order[range].iter();
                        for placed in indices.filter_map(|&i| self.instances[i as usize].as_ref()) {
                            let distance_squared = placed.bounds_world.distance_squared(origin);
                            if distance_squared > reach_squared {
                                continue;
                            }
                            if near.len() == FEW_INSTANCES {
                                return None;
                            }
                            near.push((distance_squared, placed));
                        }
                    }
                    Child::Empty => {}
                }
            }
        }
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        Some(near)
    }

    /// Whether anything blocks the ray.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut blocked = false;
        self.visit_instances(ray, |placed, _| {
            blocked = placed.placement.ray(ray).is_some_and(|r| placed.bvh.any_hit(0, &r, &self.alpha));
            if blocked { None } else { Some(ray.t_max) }
        });
        blocked
    }

    /// The nearest thing that the ray meets; of equally near ones that of the lowest instance, then triangle.
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        self.visit_instances(ray, |placed, instance| {
            let t_best = best.map_or(ray.t_max, |b| b.t);
            let found =
                placed.placement.ray(ray).and_then(|r| placed.bvh.closest_hit(&r, t_best, &self.alpha));
            if let Some((triangle, hit)) = found
                && best.is_none_or(|b| hit.t < b.t || instance < b.instance)
            {
                let barycentrics = Vec3::from_array(hit.weights);
                best = Some(Hit { t: hit.t, instance, triangle, barycentrics, back_face: hit.back_face });
            }
            Some(best.map_or(ray.t_max, |b| b.t))
        });
        best
    }

    /// Calls `visit` for instances whose box the ray may touch; it returns how far the ray still goes, or `None` to
    /// end.
    fn visit_instances<'a>(&'a self, ray: &Ray, mut visit: impl FnMut(&'a PlacedBvh, u32) -> Option<f32>) {
        let Some(world) = MeshRay::new(ray.origin_world, ray.direction_world, ray.t_max) else { return };
        let planes = NearFar::new(&world);
        let mut t_max = ray.t_max;
        let mut stack = Vec::new();
        for top in [&self.still.tree, &self.moving.tree] {
            if !top.nodes.is_empty() {
                stack.push(0);
            }
            while let Some(index) = stack.pop() {
                let node = &top.nodes[index as usize];
                let mut slots = planes.hits(node, &world, t_max);
                while slots != 0 {
                    let slot = slots.trailing_zeros() as usize;
                    slots &= slots - 1;
                    match node.child(slot) {
                        Child::Inner(child) => stack.push(child),
                        Child::Leaf(range) => {
                            for &instance in &top.order[range] {
                                let Some(placed) = &self.instances[instance as usize] else { continue };
                                match visit(placed, instance) {
                                    Some(t) => t_max = t,
                                    None => return,
                                }
                            }
                        }
                        Child::Empty => {}
                    }
                }
            }
        }
    }
}

#[cfg(test)]
impl Tracer {
    /// The triangles of each instance in leaf order.
    pub(super) fn leaf_orders(&self) -> Vec<Vec<u32>> {
        let placed = self.instances.iter().flatten();
        placed.map(|p| p.bvh.triangles.iter().map(|t| t.id).collect()).collect()
    }
}
