//! Which points may not count at which texels: those that something solid stands in front of, seen from the texel.
//!
//! Takes the scene at time 0 and a layout; returns [`Cuts`] for clients, which have no rays. See the README one folder up.

#[cfg(test)]
mod tests;

use std::sync::Arc;

use dapple_scene::{Pose, Scene};
use dapple_store::charts::{
    Candidate, ChartParams, ChartSet, Cuts, InstanceKey, PointNeighbours, SetCuts, Site, SiteCut,
    WeightParams, add_back_sites, fingerprint,
};
use dapple_store::points::PointLayout;
use glam::Vec3;
use rayon::prelude::*;

use crate::{Ray, Tracer};

/// How far both ends of a segment are lifted off their surfaces, in units of the layout's spacing: more than a curved
/// surface bulges between them, less than what should separate them is thick or high.
const LIFT: f32 = 0.15;

/// Finds the cuts of all instances. `pose` is the scene's at time 0, `tracer` is up to date with it.
///
/// What never moves is tested against everything that never moves. What moves, or is not there yet, is tested against its own
/// mesh at rest, the only thing that stays in place about it. Instances whose mesh cannot be cut into charts have none.
///
/// `progress` is called with the number of instances that are done.
pub fn find_cuts(
    scene: &Scene,
    pose: &Pose,
    tracer: &Tracer,
    layout: &PointLayout,
    progress: &(dyn Fn(usize) + Sync),
) -> Cuts {
    let moves = scene.moving_instances();
    let still = tracer.only(|instance| !moves[instance]);
    let mut found = Vec::new();
    // Instances with the same mesh and scale have the same charts; they mostly follow each other.
    let mut last: Option<(InstanceKey, Arc<ChartSet>)> = None;
    for (done, set) in layout.sets().iter().enumerate() {
        let index = set.instance as usize;
        let (Some(instance), Some(posed)) = (scene.instances.get(index), pose.instances.get(index)) else {
            continue;
        };
        if set.is_empty() {
            continue;
        }
        let mesh = &scene.meshes[instance.mesh as usize];
        let defaults = ChartParams::for_spacing(layout.spacing_m(), moves[index]);
        let key = InstanceKey {
            mesh: instance.mesh,
            rest_from_mesh: instance.rest_from_mesh,
            texel_m: defaults.texel_m,
        };
        let positions = key.positions_rest(&mesh.positions);
        let charts = match &last {
            Some((of, charts)) if *of == key => charts.clone(),
            _ => {
                let params = key.params(&defaults);
                let Ok(charts) = ChartSet::new(&positions, &mesh.triangles, &params) else { continue };
                Arc::new(charts)
            }
        };
        last = Some((key, charts.clone()));
        let mut sites = charts.sites(&positions, &mesh.triangles);
        if scene.is_two_sided(mesh) {
            add_back_sites(&mut sites, charts.texel_count());
        }
        let rests = moves[index] || posed.deformed.is_some() || !posed.is_there();
        let own = rests.then(|| tracer.resting(scene, index));
        let test = Test {
            tracer: own.as_ref().unwrap_or(&still),
            // Rest space is the world without the instance's translation.
            offset: if rests { Vec3::ZERO } else { Vec3::from(posed.world_from_mesh.translation) },
            lift_m: LIFT * layout.spacing_m(),
        };
        let weights = WeightParams::default();
        let neighbours = PointNeighbours::new(layout, set, &weights);
        let cuts: Vec<SiteCut> = sites
            .par_iter()
            .enumerate()
            .with_min_len(256)
            .map_init(
                || neighbours.weigher(set),
                |weigher, (i, site)| {
                    let mask = test.mask(site, weigher.candidates(site));
                    (mask != 0).then_some(SiteCut { site: i as u32, mask })
                },
            )
            .flatten()
            .collect();
        if !cuts.is_empty() {
            found.push(SetCuts {
                instance: set.instance,
                sites: sites.len() as u32,
                fingerprint: fingerprint(&sites, &weights.kernel),
                cuts,
            });
        }
        progress(done + 1);
    }
    Cuts::new(found).expect("sets and sites were visited in order")
}

struct Test<'a> {
    tracer: &'a Tracer,
    /// From rest space to the tracer's.
    offset: Vec3,
    lift_m: f32,
}

impl Test<'_> {
    /// The candidates that are blocked from the site; none if hardly anything would be left, or gone.
    fn mask(&self, site: &Site, candidates: &[Candidate]) -> u16 {
        let origin_world = site.position_rest + site.normal_rest * self.lift_m + self.offset;
        let target = |c: &Candidate| c.position_rest + c.normal_rest * self.lift_m + self.offset;
        // All of them at once, as far as the farthest: mostly nothing is in the way of any.
        let mut directions = [Vec3::ZERO; u16::BITS as usize];
        let mut farthest = 0.0f32;
        for (direction, candidate) in directions.iter_mut().zip(candidates) {
            let segment = target(candidate) - origin_world;
            farthest = farthest.max(segment.length());
            *direction = segment.normalize_or(site.normal_rest);
        }
        let [suspects, ..] = self.tracer.occlusion(origin_world, &directions[..candidates.len()], farthest);
        let mut mask = 0u16;
        let (mut all, mut left) = (0.0, 0.0);
        for (i, candidate) in candidates.iter().enumerate() {
            let direction_world = target(candidate) - origin_world;
            let is_cut = suspects >> i & 1 == 1
                && self.tracer.occluded(&Ray { origin_world, direction_world, t_max: 1.0 });
            mask |= u16::from(is_cut) << i;
            all += candidate.weight();
            left += if is_cut { 0.0 } else { candidate.weight() };
        }
        // A texel that lies beyond a wall serves the surface on this side, whatever stands between them.
        if left < LEAST_LEFT * all || left > MOST_LEFT * all { 0 } else { mask }
    }
}

/// Cuts that would leave less than this part of the weight are not made.
const LEAST_LEFT: f32 = 0.05;

/// Nor are those that would leave more than this: they are not worth their bytes.
const MOST_LEFT: f32 = 0.95;
