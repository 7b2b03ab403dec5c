//! The upper level: instances in the world.

use std::sync::Arc;

use dapple_scene::glam::Affine3A;
use dapple_scene::{Aabb, Pose, PosedInstance, Scene};
use fearless_simd::Level;
use rayon::prelude::*;

use super::Vectors;
use super::alpha::{AlphaMaterials, BackFaces, MeshAlpha};
use super::build::{TOP_LEAVES, build};
use super::mesh::MeshBvh;
use super::placement::{Placement, bounds_world};
use super::tree::Tree;

/// Answers ray queries on a scene in one pose.
///
/// Instances that do not cast ([`dapple_scene::Instance::casts`]) or are not there ([`PosedInstance::is_there`]), and those whose transform cannot be inverted in
/// `f32` (scale 0, or a million times smaller than another), are not hit. Where a material has alpha (`Mask`, or `Blend` with cutoff 0.5), texels below the
/// cutoff let rays through.
#[derive(Clone)]
pub struct Tracer {
    /// The widest vectors of this machine, until others are chosen.
    pub(super) level: Level,
    back_faces: BackFaces,
    pub(super) alpha: Arc<AlphaMaterials>,
    mesh_alpha: Vec<Arc<MeshAlpha>>,
    /// Trees of meshes with rigid instances, parallel to the scene's meshes.
    rigid: Vec<Option<Arc<MeshBvh>>>,
    /// Parallel to the scene's instances; `None` for those that cannot be hit.
    pub(super) instances: Vec<Option<PlacedBvh>>,
    /// Parallel to the scene's instances.
    movers: Vec<bool>,
    pub(super) still: Top,
    pub(super) moving: Top,
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
#[derive(Clone)]
pub(super) struct Top {
    indices: Vec<u32>,
    boxes: Vec<Aabb>,
    /// `tree.order` holds instance indices, each in a leaf of its own.
    pub(super) tree: Tree,
    pub(super) bounds: Aabb,
}

impl Default for Top {
    fn default() -> Top {
        Top { indices: Vec::new(), boxes: Vec::new(), tree: Tree::default(), bounds: Aabb::EMPTY }
    }
}

impl Top {
    /// Builds the tree if the boxes are not those that it was built from.
    fn update(&mut self, (indices, boxes): (Vec<u32>, Vec<Aabb>)) {
        if self.indices == indices && self.boxes == boxes {
            return;
        }
        self.tree = build(&boxes, &TOP_LEAVES);
        self.bounds = self.tree.bounds();
        for index in &mut self.tree.order {
            *index = indices[*index as usize];
        }
        (self.indices, self.boxes) = (indices, boxes);
    }
}

/// A mesh's tree where it stands.
#[derive(Clone)]
pub(super) struct PlacedBvh {
    pub(super) bvh: Arc<MeshBvh>,
    deformed: bool,
    pub(super) placement: Placement,
    bounds_world: Aabb,
}

impl Tracer {
    /// Builds all trees, in parallel in the caller's rayon pool.
    pub fn new(scene: &Scene, pose: &Pose) -> Tracer {
        Tracer::with_back_faces(scene, pose, BackFaces::Block)
    }

    /// As [`Tracer::new`], saying what rays do at backs.
    pub fn with_back_faces(scene: &Scene, pose: &Pose, back_faces: BackFaces) -> Tracer {
        let alpha = Arc::new(AlphaMaterials::new(scene));
        let mesh_alpha =
            scene.meshes.iter().map(|m| Arc::new(MeshAlpha::new(scene, m, &alpha, back_faces))).collect();
        let mut tracer = Tracer {
            level: Level::new(),
            back_faces,
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
            let level = self.level;
            *self = Tracer::with_back_faces(scene, pose, self.back_faces);
            self.level = level;
        } else {
            self.place(scene, pose);
        }
    }

    fn place(&mut self, scene: &Scene, pose: &Pose) {
        let posed_caster = |i: usize| {
            let instance = &scene.instances[i];
            let posed = pose.instances.get(i)?;
            let mesh = scene.meshes.get(instance.mesh as usize)?;
            (instance.casts && posed.is_there() && !mesh.triangles.is_empty()).then_some((
                instance.mesh as usize,
                mesh,
                posed,
            ))
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
            let bounds_world = bounds_world(&bvh, posed, &placement);
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
                let bounds_world = bounds_world(&bvh, &posed, &placement);
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
    /// after [`Tracer::new`]. It survives [`Tracer::update`] (to the same scene), and changes no answer but those of
    /// [`Tracer::occlusion_by`].
    pub fn set_movers(&mut self, movers: &[bool]) {
        let given = movers.iter().copied().chain(std::iter::repeat(false));
        self.movers = given.take(self.instances.len()).collect();
        self.build_top();
    }

    /// Bytes of all trees and the triangles in them, each counted once however many instances share it.
    pub fn bytes(&self) -> usize {
        let rigid = self.rigid.iter().flatten().map(|bvh| bvh.bytes());
        let deformed = self.instances.iter().flatten().filter(|p| p.deformed).map(|p| p.bvh.bytes());
        rigid.chain(deformed).sum::<usize>() + self.still.tree.bytes() + self.moving.tree.bytes()
    }

    /// Uses these vectors from now on. All give the same answers.
    pub fn set_vectors(&mut self, vectors: Vectors) {
        self.level = vectors.0;
    }

    /// Which instances count as movers, parallel to the scene's instances.
    pub fn movers(&self) -> &[bool] {
        &self.movers
    }
}

#[cfg(test)]
impl Tracer {
    /// The triangles of each instance in leaf order.
    pub(super) fn leaf_orders(&self) -> Vec<Vec<u32>> {
        let placed = self.instances.iter().flatten();
        placed.map(|p| p.bvh.triangles.ids().to_vec()).collect()
    }
}
