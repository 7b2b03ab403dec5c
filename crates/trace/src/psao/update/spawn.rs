//! Points that come and go while a server runs: instance by instance, traced before they count.

use std::collections::BTreeMap;
use std::sync::Arc;

use dapple_scene::{Pose, Scene};
use dapple_store::points::{LayoutError, PointLayout, PointStore};
use rayon::prelude::*;

use super::clusters::{Cluster, bits};
use super::motion::Observed;
use super::trace::{Context, NEUTRAL, PointLight, Scratch};
use super::{StepCounts, Updater, layout_bytes, store_of};
use crate::Tracer;
use crate::psao::generate::{Anchor, GeneratedPoints};

/// The points of one instance between laying and the first ray of the last of them.
#[derive(Clone, Debug)]
pub(super) struct Spawn {
    store: PointStore,
    anchors: Vec<Anchor>,
    /// In which the points are counted from 0.
    clusters: Vec<Cluster>,
    /// Parallel to the clusters: points that no ray has left yet.
    untraced: Vec<u64>,
}

impl Spawn {
    fn new(layout: PointLayout, anchors: Vec<Anchor>, has_bent: bool) -> Spawn {
        let clusters = Cluster::all(&layout);
        let neutral = vec![NEUTRAL; layout.len()];
        Spawn {
            untraced: clusters.iter().map(Cluster::everything).collect(),
            store: store_of(Arc::new(layout), &neutral, has_bent),
            anchors,
            clusters,
        }
    }

    fn layout(&self) -> &PointLayout {
        self.store.layout()
    }

    fn is_complete(&self) -> bool {
        self.untraced.iter().all(|points| *points == 0)
    }

    fn has(&self, instance: u32) -> bool {
        self.layout().set_of_instance(instance).is_some()
    }

    /// Marks what motion may have changed of the points that are traced already.
    pub(super) fn follow(&mut self, scene: &Scene, pose: &Pose, observed: &Observed, step: u32) {
        let anchors = &self.anchors;
        self.clusters.par_iter_mut().zip(&self.untraced).for_each(|(cluster, untraced)| {
            cluster.follow(scene, pose, anchors, observed, step);
            cluster.dirty &= !untraced;
            cluster.waiting &= !untraced;
        });
    }

    pub(super) fn bytes(&self) -> usize {
        layout_bytes(self.layout())
            + self.anchors.capacity() * size_of::<Anchor>()
            + self.store.value_bytes()
            + self.clusters.iter().map(Cluster::bytes).sum::<usize>()
            + self.untraced.capacity() * size_of::<u64>()
    }
}

impl Updater {
    /// Takes in points of instances that have none. They get their rays in the next steps, within their budgets, and count once all of
    /// an instance have: [`Updater::take_ready`].
    ///
    /// # Errors
    /// An instance has points already, or they were laid with other lengths than those that there are. Then none is taken in.
    pub fn spawn(&mut self, points: GeneratedPoints) -> Result<(), LayoutError> {
        let GeneratedPoints { layout, anchors, .. } = points;
        let waits = |instance| self.spawns.iter().any(|spawn| spawn.has(instance));
        if let Some(set) = layout.sets().iter().find(|set| waits(set.instance)) {
            return Err(LayoutError::SetExists(set.instance));
        }
        let held = self.store.layout();
        if !layout.has_lengths_of(held) {
            return Err(LayoutError::OtherLengths);
        }
        if let Some(set) = layout.sets().iter().find(|set| held.set_of_instance(set.instance).is_some()) {
            return Err(LayoutError::SetExists(set.instance));
        }
        for set in layout.sets() {
            let first = set.first as usize;
            let anchors = anchors[first..first + set.len()].to_vec();
            self.spawns.push(Spawn::new(layout.only(&[set.instance]), anchors, self.params.bent_normals));
        }
        self.restless |= !self.spawns.is_empty();
        Ok(())
    }

    /// Gives up the points of some instances (ascending), traced or not. Instances without any are left out.
    pub fn evict(&mut self, instances: &[u32]) {
        self.spawns.retain(|spawn| !instances.iter().any(|instance| spawn.has(*instance)));
        let held = self.store.layout();
        let gone: Vec<u32> =
            instances.iter().copied().filter(|i| held.set_of_instance(*i).is_some()).collect();
        if !gone.is_empty() {
            self.change_sets(&gone, Vec::new());
        }
    }

    /// Lets the points count of instances that have had all their first rays. Gives these instances, ascending. Ask after each
    /// step: what is marked in the meantime waits as if it had been there all along.
    pub fn take_ready(&mut self) -> Vec<u32> {
        let (ready, waiting) =
            std::mem::take(&mut self.spawns).into_iter().partition(|spawn| spawn.is_complete());
        self.spawns = waiting;
        let ready: Vec<Spawn> = ready;
        let mut instances: Vec<u32> =
            ready.iter().flat_map(|spawn| spawn.layout().sets()).map(|set| set.instance).collect();
        instances.sort_unstable();
        if !ready.is_empty() {
            self.change_sets(&[], ready);
        }
        instances
    }

    /// Points that have been laid and do not count yet.
    pub fn spawning(&self) -> usize {
        self.spawns.iter().map(|spawn| spawn.layout().len()).sum()
    }

    fn change_sets(&mut self, gone: &[u32], ready: Vec<Spawn>) {
        let before = self.store.layout().clone();
        let mut sets: Vec<_> = ready.iter().flat_map(|spawn| spawn.layout().sets()).cloned().collect();
        sets.sort_unstable_by_key(|set| set.instance);
        let came = PointLayout::new(before.quantum_m(), before.spacing_m(), sets).expect("they were laid so");
        let mut light = vec![NEUTRAL; came.len()];
        let mut anchors_of: BTreeMap<u32, &[Anchor]> = BTreeMap::new();
        let mut clusters_of: BTreeMap<u32, Vec<Cluster>> = BTreeMap::new();
        for set in before.sets() {
            let first = set.first as usize;
            anchors_of.insert(set.instance, &self.anchors[first..first + set.len()]);
        }
        for cluster in std::mem::take(&mut self.clusters) {
            clusters_of.entry(cluster.instance).or_default().push(cluster);
        }
        for spawn in &ready {
            for set in spawn.layout().sets() {
                let to = came.set_of_instance(set.instance).map_or(0, |set| set.first as usize);
                for (point, light) in light[to..to + set.len()].iter_mut().enumerate() {
                    *light = PointLight::of(&spawn.store, point);
                }
                anchors_of.insert(set.instance, &spawn.anchors);
                clusters_of.insert(set.instance, spawn.clusters.clone());
            }
        }
        let came = store_of(came.into(), &light, self.params.bent_normals);
        let store = self.store.with_sets(gone, &came).expect("it was asked for what fits");
        let mut anchors = Vec::with_capacity(store.layout().len());
        let mut clusters = Vec::with_capacity(clusters_of.values().map(Vec::len).sum());
        for set in store.layout().sets() {
            anchors.extend_from_slice(anchors_of.get(&set.instance).copied().unwrap_or_default());
            let of_set = clusters_of.remove(&set.instance).unwrap_or_default();
            let first = of_set.first().map_or(0, |cluster| cluster.first);
            clusters.extend(of_set.into_iter().map(|mut cluster| {
                cluster.first = cluster.first - first + set.first;
                cluster
            }));
        }
        clusters.shrink_to_fit();
        (self.store, self.anchors, self.clusters) = (store, anchors, clusters);
        // What motion has marked since it was traced is not forgotten, and what is at rest may be refined.
        self.restless = true;
    }

    /// Chooses points for their first rays until `left` is spent; at least one if it `may`. Returns what is left.
    pub(super) fn choose_spawned(&mut self, mut left: u64, may: bool) -> u64 {
        let cost = u64::from(self.params.rays);
        let mut first = may;
        for spawn in &mut self.spawns {
            for (cluster, untraced) in spawn.clusters.iter_mut().zip(&spawn.untraced) {
                for bit in bits(*untraced) {
                    if cost > left && !first {
                        return left;
                    }
                    first = false;
                    left = left.saturating_sub(cost);
                    cluster.selected |= 1 << bit;
                }
            }
        }
        left
    }

    /// Traces the points that were chosen for their first rays.
    pub(super) fn trace_spawned(
        &mut self,
        scene: &Scene,
        pose: &Pose,
        tracer: &Tracer,
        counts: &mut StepCounts,
    ) {
        let (patterns, params) = (&self.patterns, &self.params);
        for spawn in &mut self.spawns {
            let Spawn { store, anchors, clusters, untraced } = spawn;
            let (anchors, known) = (&anchors[..], &*store);
            let context =
                Context { scene, pose, tracer, anchors, patterns, params, movers: Vec::new(), known };
            let traced: Vec<Vec<PointLight>> = clusters
                .par_iter()
                .map_init(Scratch::default, |scratch, cluster| {
                    let normals = context.normals(cluster.instance, cluster.first);
                    let trace = |bit: usize| {
                        let anchor = &anchors[cluster.first as usize + bit];
                        context.light(anchor, (cluster.instance, normals[bit]), params.rays, scratch)
                    };
                    bits(cluster.selected).map(trace).collect()
                })
                .collect();
            for ((cluster, untraced), traced) in clusters.iter_mut().zip(untraced).zip(traced) {
                counts.traced_full += traced.len() as u32;
                counts.rays_full += traced.len() as u64 * u64::from(params.rays);
                for (bit, light) in bits(cluster.selected).zip(traced) {
                    light.put(store, cluster.first + bit as u32);
                }
                *untraced &= !cluster.selected;
                cluster.selected = 0;
            }
        }
    }
}
