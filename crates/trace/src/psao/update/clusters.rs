//! Runs of 64 neighbouring points with their bounds: finds the points near movers without looking at all.

use dapple_scene::{Aabb, Pose, Scene};
use dapple_store::points::PointLayout;
use rayon::prelude::*;

use crate::psao::generate::Anchor;

/// Points a cluster. Points are in Morton order, so a run is compact.
const CLUSTER: u32 = 64;

#[derive(Clone, Debug)]
struct Cluster {
    instance: u32,
    first: u32,
    end: u32,
    bounds_world: Aabb,
}

/// All clusters, in order of their points.
#[derive(Clone, Debug)]
pub(super) struct Clusters {
    clusters: Vec<Cluster>,
}

impl Clusters {
    pub(super) fn new(layout: &PointLayout) -> Clusters {
        let mut clusters = Vec::new();
        for set in layout.sets() {
            let set_end = set.first + set.len() as u32;
            for first in (set.first..set_end).step_by(CLUSTER as usize) {
                clusters.push(Cluster {
                    instance: set.instance,
                    first,
                    end: (first + CLUSTER).min(set_end),
                    bounds_world: Aabb::EMPTY,
                });
            }
        }
        Clusters { clusters }
    }

    pub(super) fn bytes(&self) -> usize {
        self.clusters.len() * size_of::<Cluster>()
    }

    /// Brings the bounds of the chosen instances' clusters up to `pose`.
    pub(super) fn refresh(
        &mut self,
        scene: &Scene,
        pose: &Pose,
        anchors: &[Anchor],
        chosen: impl Fn(usize) -> bool + Sync,
    ) {
        self.clusters.par_iter_mut().filter(|c| chosen(c.instance as usize)).for_each(|c| {
            let posed = anchors[c.first as usize..c.end as usize]
                .iter()
                .filter_map(|a| a.pose(scene, pose, c.instance as usize));
            c.bounds_world = Aabb::from_points(posed.map(|p| p.position));
        });
    }

    /// Points on instances that `moved`, and points within `reach_m` of any `swept` box; ascending.
    pub(super) fn select(
        &self,
        scene: &Scene,
        pose: &Pose,
        anchors: &[Anchor],
        moved: &[bool],
        swept: &[Aabb],
        reach_m: f32,
    ) -> Vec<u32> {
        self.clusters
            .par_iter()
            .flat_map_iter(|c| {
                let points = c.first..c.end;
                if moved[c.instance as usize] {
                    return points.collect::<Vec<u32>>();
                }
                let grown = c.bounds_world.inflated(reach_m);
                let near: Vec<&Aabb> = swept.iter().filter(|b| b.intersects(&grown)).collect();
                if near.is_empty() {
                    return Vec::new();
                }
                points
                    .filter(|&p| {
                        anchors[p as usize].pose(scene, pose, c.instance as usize).is_some_and(|posed| {
                            near.iter().any(|b| b.distance_squared(posed.position) <= reach_m * reach_m)
                        })
                    })
                    .collect()
            })
            .collect()
    }
}
