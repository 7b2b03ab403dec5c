//! Direct light of area lights for all viewers: the on-surface cache of light cones, one step a frame ([Stadlbauer2023] sec. 2.1).
//!
//! ```text
//! what viewers see ─► requests ─► cache: queue, places ─► what changed ─► rays ─► entries, for every viewer's shading
//! ```

use std::sync::Arc;

use dapple_scene::area_lights::{AreaLights, Environment};
use dapple_scene::{Pose, Scene};
use dapple_store::charts::{ChartParams, ChartSet, InstanceKey, SceneCharts};
use dapple_store::cones::{
    CacheParams, Charting, ConeCache, ConeError, EntryId, EntrySite, LookUp, Requests, UpdateQueue, View,
};
use dapple_trace::Tracer;
use dapple_trace::slc::{Changes, EntryPlaces, Moment, SlcCounts, Update};

/// Edge of a chart's texels, metres, at level 0. Texels of the cache are up to 64 times finer.
pub const CHART_TEXEL_M: f32 = 0.05;

/// The charts that all ends of a scene lay cones on: one set for all instances of equal mesh and rest space. Those whose charts cannot be
/// made have none, and come with the reason. What carries no points (`receives`) has charts all the same: rays light it, too.
pub fn cone_charts(scene: &Scene) -> (Charting, Vec<String>) {
    let key = |instance: &dapple_scene::Instance| {
        Some(InstanceKey {
            mesh: instance.mesh,
            rest_from_mesh: instance.rest_from_mesh,
            texel_m: CHART_TEXEL_M,
        })
    };
    let plan = SceneCharts::plan(scene.instances.iter().map(key));
    let defaults = ChartParams { texel_m: CHART_TEXEL_M, ..ChartParams::for_spacing(CHART_TEXEL_M, false) };
    let mut problems = Vec::new();
    let sets: Vec<Option<Arc<ChartSet>>> = plan
        .sets()
        .iter()
        .map(|key| {
            let mesh = &scene.meshes[key.mesh as usize];
            match ChartSet::new(&key.positions_rest(&mesh.positions), &mesh.triangles, &key.params(&defaults))
            {
                Ok(charts) => Some(Arc::new(charts)),
                Err(error) => {
                    problems.push(format!("mesh {}: {error}", mesh.name));
                    None
                }
            }
        })
        .collect();
    let of_instance = (0..scene.instances.len())
        .map(|i| plan.set_index_of_instance(i).and_then(|set| sets[set as usize].clone()));
    (Charting::new(of_instance.collect()), problems)
}

/// Keeps the cones that viewers need.
pub struct ConeServer<E> {
    cache: ConeCache<E>,
    look_up: LookUp,
    requests: Requests,
    queue: UpdateQueue,
    places: EntryPlaces,
    before: Option<Pose>,
    /// Steps since something changed.
    quiet: u32,
}

/// What a step did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ConeStep {
    /// Texels that viewers need, each once.
    pub wanted: u64,
    /// Of those, entries made in this step.
    pub new: u64,
    /// Texels that there was no memory for, counted once a tile of pixels.
    pub refused: u64,
    /// What the rays did.
    pub counts: SlcCounts,
}

/// A scene as it is now, ready to be traced.
#[derive(Clone, Copy)]
pub struct Now<'a> {
    /// What it is of.
    pub scene: &'a Scene,
    /// When.
    pub pose: &'a Pose,
    /// Of the scene in the pose.
    pub tracer: &'a Tracer,
    /// Light from all around.
    pub environment: Option<&'a Environment>,
}

impl<'a> Now<'a> {
    /// Its lights, in this or another pose.
    pub fn lights(&self, pose: &Pose) -> AreaLights<'a> {
        let lights = AreaLights::new(self.scene, pose);
        match self.environment {
            Some(environment) => lights.with_environment(environment, pose),
            None => lights,
        }
    }
}

impl<E: Update> ConeServer<E> {
    /// Without entries.
    ///
    /// # Errors
    /// A parameter out of range.
    pub fn new(cache: CacheParams, look_up: LookUp) -> Result<ConeServer<E>, ConeError> {
        look_up.check()?;
        Ok(ConeServer {
            cache: ConeCache::new(cache)?,
            look_up,
            requests: Requests::default(),
            queue: UpdateQueue::default(),
            places: EntryPlaces::default(),
            before: None,
            quiet: u32::MAX,
        })
    }

    /// Brings what the viewers see up to date. `now` is of the same scene in every step: what stays where it was is not looked up again. `pass` is
    /// called with the name of each stage after it: `requests`, `queue`, `places`, `rays`.
    pub fn step(
        &mut self,
        now: &Now<'_>,
        views: &[View<'_>],
        params: &E::Params,
        pass: &mut dyn FnMut(&'static str),
    ) -> ConeStep {
        let is_as_before = self.requests.gather_again(views, &self.look_up);
        pass("requests");
        if !(is_as_before && self.cache.repeat(&self.requests, &mut self.queue)) {
            self.queue = self.cache.admit(&self.requests);
        }
        pass("queue");
        let before = self.before.as_ref().unwrap_or(now.pose);
        self.places.follow(&self.cache, &self.queue, now.scene, before, now.pose);
        pass("places");
        let (lights, lights_before) = (now.lights(now.pose), now.lights(before));
        let then = Moment { scene: now.scene, pose: before, lights: &lights_before };
        let now_there = Moment { pose: now.pose, lights: &lights, ..then };
        let changes = Changes::between(&then, &now_there).after_quiet(self.quiet);
        self.quiet = if changes.is_nothing() { self.quiet.saturating_add(1) } else { 0 };
        let counts =
            E::update_queue(&mut self.cache, &self.queue, &self.places, now.tracer, &changes, params);
        pass("rays");
        self.before = Some(now.pose.clone());
        ConeStep {
            wanted: self.queue.texels.len() as u64,
            new: self.queue.texels.iter().filter(|texel| texel.is_new).count() as u64,
            refused: u64::from(self.queue.refused),
            counts,
        }
    }

    /// All entries.
    pub fn cache(&self) -> &ConeCache<E> {
        &self.cache
    }

    /// When a block last changed by the clock of the cache ([`ConeCache::changed_at`]), or the places of its entries did.
    pub fn changed_at(&self, block: usize) -> u64 {
        let moved = self.cache.instance_of(block).map_or(0, |instance| self.places.moved_at(instance));
        self.cache.changed_at(block).max(moved)
    }

    /// Where in the world an entry is that was wanted in the last step.
    #[inline]
    pub fn place_of(&self, id: EntryId) -> Option<EntrySite> {
        self.places.of_entry(id).map(|place| EntrySite {
            position_world: place.position_world,
            normal_world: place.normal_world,
            normal_shading_world: place.normal_shading_world,
        })
    }
}
