//! Lays the points of one instance at a time: those that it has when all are laid together, to the bit.

use std::sync::Arc;

use dapple_scene::{Pose, Scene};
use dapple_store::points::{MAX_COORDINATE, PointLayout};

use super::density::Pilots;
use super::{
    GenerateError, GenerateParams, GeneratedPoints, LaidInstance, Sides, SurfaceArea, lay_instance,
    maximum_radius, measure,
};
use crate::Tracer;

/// What all instances have in common: lengths of the layout, and how much surface each has.
///
/// What it lays depends on the scene, the parameters and the instance alone, so sets that were laid at different times fit each other. So
/// density is uniform: what follows the gradient of visibility ([`GenerateParams::adaptive`]) is weighed over all instances together.
#[derive(Clone, Debug)]
pub struct PointLayer {
    params: GenerateParams,
    quantum_m: f32,
    spacing_m: f32,
    r_max: f32,
    /// Parallel to the scene's instances; both sides of double-sided surface.
    areas_m2: Vec<f64>,
    sides: Sides,
}

impl PointLayer {
    /// Measures the scene. How many points all instances would have together is not limited here; the instances that are laid
    /// in one go are, by [`GenerateParams::max_points`].
    ///
    /// # Errors
    /// The density is no number above 0.
    pub fn new(scene: &Scene, params: &GenerateParams) -> Result<PointLayer, GenerateError> {
        let density = params.points_per_m2;
        let measured = measure(scene, density)?;
        let r_max = maximum_radius(1.0, 0.5 * f64::from(density)) as f32;
        let spacing_m = 2.0 * r_max;
        // 32 steps a spacing keep the rounding (1 mm at N = 512) far below the kernels' width; coarser only for huge instances.
        let extent = measured.iter().map(|(_, extent)| *extent).fold(0.0, f32::max);
        let quantum_m = (spacing_m / 32.0).max(extent / (MAX_COORDINATE - 1) as f32);
        let areas_m2 = measured.into_iter().map(|(area, _)| area).collect();
        Ok(PointLayer { params: *params, quantum_m, spacing_m, r_max, areas_m2, sides: Sides::new(scene) })
    }

    /// Most points that an instance can have; 0 if it receives no visibility. Fewer where points lie inside geometry.
    pub fn most_points(&self, instance: usize) -> u64 {
        match self.areas_m2.get(instance) {
            Some(area) if *area > 0.0 => self.spawned(*area).div_ceil(2),
            _ => 0,
        }
    }

    /// Spawned on so much surface; half of them are kept.
    fn spawned(&self, area_m2: f64) -> u64 {
        (area_m2 * f64::from(self.params.points_per_m2)).ceil().max(2.0) as u64
    }

    /// A layout of no points: what comes later fits it.
    pub fn empty(&self) -> Result<GeneratedPoints, GenerateError> {
        self.join(Vec::new())
    }

    /// Lays the points of some instances (ascending; what does not exist has none). `pose` and `tracer` are those of time 0, as for
    /// [`generate_points`](super::generate_points). In parallel in the caller's rayon pool, one thread an instance.
    ///
    /// # Errors
    /// They may be more than [`GenerateParams::max_points`] together.
    pub fn lay(
        &self,
        scene: &Scene,
        pose: &Pose,
        tracer: &Tracer,
        instances: &[u32],
    ) -> Result<GeneratedPoints, GenerateError> {
        use rayon::prelude::*;
        let there = || instances.iter().map(|i| *i as usize).filter(|i| *i < self.areas_m2.len());
        let points: u64 = there().map(|instance| self.most_points(instance)).sum();
        if points > u64::from(self.params.max_points) {
            let area_m2 = there().map(|instance| self.areas_m2[instance]).sum();
            let (points_per_m2, limit) = (self.params.points_per_m2, self.params.max_points);
            return Err(GenerateError::TooManyPoints { points_per_m2, area_m2, points, limit });
        }
        let there: Vec<usize> = there().collect();
        let laid = there.into_par_iter().map(|instance| self.lay_one(scene, pose, tracer, instance, None));
        self.join(laid.collect())
    }

    /// What the inside test knows of each instance.
    pub(super) fn sides(&self) -> &Sides {
        &self.sides
    }

    pub(super) fn lay_one(
        &self,
        scene: &Scene,
        pose: &Pose,
        tracer: &Tracer,
        instance: usize,
        pilots: Option<&Pilots>,
    ) -> LaidInstance {
        let area = SurfaceArea::measure(scene, instance);
        let (density, seed) = (self.params.points_per_m2, self.params.seed);
        let mut laid = lay_instance(scene, instance, &area, density, self.r_max, seed, pilots);
        laid.drop_inside(scene, pose, tracer, &self.sides, &self.params);
        laid
    }

    /// What was laid, in order of instance, as a layout.
    pub(super) fn join(&self, laid: Vec<LaidInstance>) -> Result<GeneratedPoints, GenerateError> {
        let mut sets = Vec::new();
        let mut anchors = Vec::new();
        let mut dropped_inside = 0;
        for laid in laid {
            dropped_inside += laid.dropped;
            if !laid.points.is_empty() {
                let instance = laid.instance as u32;
                sets.push(laid.into_set(instance, self.quantum_m, &mut anchors));
            }
        }
        let layout = Arc::new(PointLayout::new(self.quantum_m, self.spacing_m, sets)?);
        Ok(GeneratedPoints { layout, anchors, dropped_inside })
    }
}
