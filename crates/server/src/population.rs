//! Who has points where there is a cap on them: lays what comes, with its cuts, and gives up what goes.

use std::collections::BTreeMap;

use dapple_scene::{Aabb, Pose, Scene};
use dapple_store::charts::{Cuts, SetCuts};
use dapple_trace::Tracer;
use dapple_trace::psao::cuts::find_cuts;
use dapple_trace::psao::generate::{GenerateError, GeneratedPoints, PointLayer};
use dapple_trace::psao::residency::{Residency, ResidencyParams, Watch};
use dapple_trace::psao::update::{StepInput, Updater};

use crate::{ServerConfig, ServerError};

/// What a server keeps to lay points while it runs.
#[derive(Clone)]
pub(crate) struct Population {
    layer: PointLayer,
    residency: Residency,
    /// The scene at time 0, in which points are laid whenever they come.
    pose: Pose,
    tracer: Tracer,
    cuts: bool,
    /// Of instances whose points are laid and not yet published.
    cuts_of: BTreeMap<u32, SetCuts>,
}

impl Population {
    /// Nobody has points. `pose` and `tracer` are those of time 0.
    pub(crate) fn new(
        scene: &Scene,
        pose: Pose,
        tracer: Tracer,
        config: &ServerConfig,
        max_points: u32,
    ) -> Result<Population, GenerateError> {
        let layer = PointLayer::new(scene, &config.generate)?;
        let most_points = (0..scene.instances.len()).map(|i| layer.most_points(i)).collect();
        let residency = Residency::new(ResidencyParams::with_max_points(max_points), most_points);
        Ok(Population { layer, residency, pose, tracer, cuts: config.cuts, cuts_of: BTreeMap::new() })
    }

    /// The points of a start, of whom viewers see or nobody says otherwise.
    pub(crate) fn fill(
        &mut self,
        scene: &Scene,
        input: &StepInput<'_>,
    ) -> Result<GeneratedPoints, GenerateError> {
        let bounds: Vec<Aabb> =
            (0..scene.instances.len()).map(|i| scene.instance_bounds_world(&self.pose, i)).collect();
        let turnover = self.residency.fill(&watch(&bounds, input));
        self.lay(scene, &turnover.spawn)
    }

    /// One step: gives up what goes, lays what comes and hands it over to be traced. Returns how many instances went.
    pub(crate) fn turn_over(
        &mut self,
        scene: &Scene,
        updater: &mut Updater,
        input: &StepInput<'_>,
    ) -> Result<u32, ServerError> {
        let turnover = self.residency.step(&watch(updater.bounds_world(), input));
        if !turnover.evict.is_empty() {
            updater.evict(&turnover.evict);
            self.cuts_of.retain(|instance, _| turnover.evict.binary_search(instance).is_err());
        }
        if !turnover.spawn.is_empty() {
            let points = self.lay(scene, &turnover.spawn)?;
            if self.cuts {
                let cuts = find_cuts(scene, &self.pose, &self.tracer, &points.layout, &|_| ());
                self.cuts_of.extend(cuts.sets().iter().map(|set| (set.instance, set.clone())));
            }
            updater.spawn(points)?;
        }
        Ok(turnover.evict.len() as u32)
    }

    /// The cuts of instances (ascending) whose points are to be published now.
    pub(crate) fn take_cuts(&mut self, instances: &[u32]) -> Cuts {
        let sets = instances.iter().filter_map(|instance| self.cuts_of.remove(instance)).collect();
        Cuts::new(sets).expect("they were found, and instances ascend")
    }

    pub(crate) fn too_large(&self) -> &[u32] {
        self.residency.too_large()
    }

    fn lay(&mut self, scene: &Scene, instances: &[u32]) -> Result<GeneratedPoints, GenerateError> {
        let points = self.layer.lay(scene, &self.pose, &self.tracer, instances)?;
        for &instance in instances {
            let laid = points.layout.set_of_instance(instance).map_or(0, |set| set.len());
            self.residency.laid(instance, laid as u64);
        }
        Ok(points)
    }
}

fn watch<'a>(bounds_world: &'a [Aabb], input: &StepInput<'a>) -> Watch<'a> {
    Watch { bounds_world, interest: input.interest }
}
