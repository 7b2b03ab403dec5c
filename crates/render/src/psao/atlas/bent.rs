//! Bent normals in the atlas: sums of rest-space directions, by the weights of visibility, beside the texels that are shown.

use dapple_scene::{Pose, Scene};
use dapple_store::points::{BentChange, BentNormal, BentPlanes, PackedNormal, PointSet};
use glam::Vec3;
use rayon::prelude::*;

use super::resolve::PointTexels;
use super::{ReadySet, SetState, VisibilityAtlas};
use crate::gbuffer::GBuffer;

/// Length of a direction before it is weighed. Weights of a texel sum to 256, so a sum fits 16 bits.
const LENGTH: f32 = 127.0;

/// Exact sums of weight × direction, one a texel of a set; zero where no point counts.
#[derive(Clone, Debug)]
pub(super) struct BentSums {
    sums: Vec<[i16; 3]>,
}

impl BentSums {
    fn new(texels: usize, table: &PointTexels, set: &PointSet, [first, second]: &BentPlanes) -> BentSums {
        let mut sums = BentSums { sums: vec![[0; 3]; texels] };
        for (i, normal) in set.normals.iter().enumerate() {
            let point = set.first as usize + i;
            sums.add(table, i, whole(BentNormal([first[point], second[point]]), *normal));
        }
        sums
    }

    fn add(&mut self, table: &PointTexels, point: usize, direction: [i16; 3]) {
        table.for_each_run(point, |texel, weights| {
            for (sum, weight) in self.sums[texel as usize..].iter_mut().zip(weights) {
                for (sum, component) in sum.iter_mut().zip(direction) {
                    // The true sum fits; modulo 2¹⁶ the way there does not matter.
                    *sum = sum.wrapping_add(component.wrapping_mul(i16::from(*weight) + 1));
                }
            }
        });
    }

    fn at(&self, texel: u32) -> Vec3 {
        Vec3::from(self.sums[texel as usize].map(f32::from))
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.sums[..])
    }
}

/// The direction in whole numbers, so that sums are exact.
fn whole(bent: BentNormal, normal: PackedNormal) -> [i16; 3] {
    (bent.unpack(normal) * LENGTH).to_array().map(|c| c.round() as i16)
}

impl VisibilityAtlas {
    /// Takes in the bent normals of all points of instances that are ready and have none yet; to be called again when others are.
    ///
    /// # Panics
    /// If there are not as many as points of the layout.
    pub fn resolve_bent(&mut self, bent: &BentPlanes) {
        assert!(bent.iter().all(|plane| plane.len() == self.layout.len()), "two bytes a point");
        let sets = self.layout.sets();
        self.sets.par_iter_mut().zip(sets).for_each(|(state, set)| {
            if let SetState::Ready(ready) = state
                && ready.bent.is_none()
            {
                ready.bent = Some(BentSums::new(ready.sums.len(), &ready.table, set, bent));
            }
        });
    }

    /// Takes over changed bent normals where they have been taken in. Exact, as changes of visibility are.
    pub fn apply_bent(&mut self, changes: &[BentChange]) {
        let sets = self.layout.sets();
        for BentChange { point, old, new } in changes {
            let at = sets.partition_point(|set| set.first + set.len() as u32 <= *point);
            let Some(set) = sets.get(at) else { continue };
            let SetState::Ready(ready) = &mut self.sets[at] else { continue };
            let ReadySet { table, bent: Some(bent), .. } = &mut **ready else { continue };
            let local = (point - set.first) as usize;
            let [old, new] = [old, new].map(|bent| whole(*bent, set.normals[local]));
            bent.add(table, local, [0, 1, 2].map(|k| new[k] - old[k]));
        }
    }

    /// Where from light comes at a place of a triangle, in rest space: a unit vector, the mean of those of the points around it by the
    /// weights of [`VisibilityAtlas::visibility`]; `None` where there is none. What changed is there at once: only visibility fades.
    pub fn bent_normal(
        &self,
        instance: u32,
        triangle: u32,
        barycentrics: [f32; 2],
        back: bool,
    ) -> Option<Vec3> {
        let ready = self.ready_set(instance)?;
        let bent = ready.bent.as_ref()?;
        let mix = ready.mix(triangle, barycentrics, back)?;
        let sum: Vec3 = mix.texels().iter().map(|&(texel, weight)| bent.at(texel) * weight).sum();
        sum.try_normalize()
    }

    /// Bent normals in the world of each sample of a picture of `scene` in `pose`; zero where there is none. In parallel in the caller's
    /// rayon pool.
    pub fn reconstruct_bent(&self, scene: &Scene, pose: &Pose, gbuffer: &GBuffer) -> Vec<Vec3> {
        let samples = gbuffer.samples().par_iter().enumerate().with_min_len(1024);
        let of_sample = |(i, s): (usize, &crate::gbuffer::Sample)| {
            let rest = self.bent_normal(s.instance, s.triangle, s.barycentrics, s.is_back_face())?;
            Some(gbuffer.world_from_rest(scene, pose, i)? * rest)
        };
        samples.map(|sample| of_sample(sample).unwrap_or(Vec3::ZERO)).collect()
    }
}
