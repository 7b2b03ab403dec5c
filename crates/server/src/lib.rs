//! The server's half: scene + trace + stream. One [`Server::step`] a tick, frames out; no socket, no clock.
//!
//! ```text
//! pose(now) ─► tracer ─► updater (what changed) ─► publisher ─► frames for every subscriber
//! ```

pub mod cones;
pub mod paper;
mod population;
pub mod shards;
mod streams;

use std::sync::Arc;

use dapple_scene::area_lights::AreaLights;
use dapple_scene::glam::Vec3;
use dapple_scene::{Edits, Pose, Scene};
use dapple_store::light_visibility::{LightVisibility, LightVisibilityError};
use dapple_store::points::{LayoutError, PointStore};
use dapple_stream::{Budget, Frame, Precision, Publisher, PublisherConfig};
use dapple_trace::Tracer;
use dapple_trace::psao::cuts::find_cuts;
use dapple_trace::psao::generate::{
    GenerateError, GenerateParams, GeneratedPoints, PointLayer, check_density, generate_points,
};
use dapple_trace::psao::paper::PaperError;
use dapple_trace::psao::update::{StepCounts, StepInput, UpdateError, UpdateParams, Updater};
use dapple_trace::slc::{LightTracker, TrackerParams, VisibilityCounts};

use population::Population;
use shards::Shard;
use streams::Stream;

/// Settings of a server. Each group documents its own ranges and defaults.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServerConfig {
    /// How points are laid.
    pub generate: GenerateParams,
    /// How they are traced.
    pub update: UpdateParams,
    /// How changes are grouped, and how exactly they are sent. Its default here lets values be off by 4 of 255.
    pub publish: PublisherConfig,
    /// Most bits that deltas take in any second; `None` (default): as many as they need. Under it what matters least to viewers waits, or is
    /// less exact: what is out of view, far away, or nearly right. Snapshots, and points that come under a cap, are not counted.
    pub bits_per_s: Option<u64>,
    /// Whether rays find out which points must not count at which texels of a client's atlas, because something solid stands
    /// between them. Costs some seconds at the start and some bytes of each snapshot; light leaks less. Default true.
    pub cuts: bool,
    /// Most points at a time: instances share them, and their points come and go with what viewers see
    /// ([`StepInput::interest`]). Then the scene may have more than [`GenerateParams::max_points`] in all; at most so many at a time.
    /// Default `None`: all points of all instances are there from the start to the end.
    pub max_resident_points: Option<u32>,
    /// The part of the scene that this server lights; default `None`: all of it.
    pub shard: Option<Shard>,
    /// Whether, and how, points say how much of each of the scene's area lights they see (5 bits a point and light): then clients draw soft
    /// shadows of them. Default `None`. A scene without lights has none either way.
    pub lights: Option<TrackerParams>,
}

impl ServerConfig {
    /// Finds quickly whether a server of this scene would refuse these settings.
    ///
    /// # Errors
    /// What [`Server::new`] would say.
    pub fn check(&self, scene: &Scene) -> Result<(), ServerError> {
        if let Some(Shard { number, of }) = self.shard {
            if number >= of || of > Shard::MOST {
                return Err(ServerError::BadShard { number, of });
            }
            if self.generate.adaptive > 0.0 || self.max_resident_points.is_some() {
                return Err(ServerError::UnevenShard);
            }
        }
        match self.max_resident_points {
            None => check_density(scene, &self.generate)?,
            Some(points) if !(1..=self.generate.max_points).contains(&points) => {
                return Err(ServerError::BadCap { points, limit: self.generate.max_points });
            }
            Some(_) if self.generate.adaptive > 0.0 => return Err(ServerError::AdaptiveCap),
            Some(_) => drop(PointLayer::new(scene, &self.generate)?),
        }
        if let (Some(_), Some(points)) = (self.lights, self.max_resident_points) {
            // As many as there can be at a time; without a cap their number is not known yet.
            let lights = AreaLights::new(scene, &scene.pose_undeformed(0.0)).len() as u32;
            LightVisibility::check(points as usize, lights)?;
        }
        self.check_lights()?;
        Ok(self.update.check()?)
    }

    fn check_lights(&self) -> Result<(), ServerError> {
        match self.lights {
            Some(TrackerParams { tolerance, .. }) if !(0.0..=1.0).contains(&tolerance) => {
                Err(ServerError::BadLightTolerance(tolerance))
            }
            _ => Ok(()),
        }
    }
}

impl Default for ServerConfig {
    fn default() -> Self {
        ServerConfig {
            generate: GenerateParams::default(),
            update: UpdateParams::default(),
            publish: PublisherConfig {
                precision: Precision { tolerance: 4, step: 0 },
                bent_precision: BENT_PRECISION,
                ..Default::default()
            },
            bits_per_s: None,
            cuts: true,
            max_resident_points: None,
            shard: None,
            lights: None,
        }
    }
}

/// How exactly bent normals are sent if nobody says otherwise: within 8 of 127 along each tangent, about what 64 rays know of them.
pub const BENT_PRECISION: Precision = Precision { tolerance: 8, step: 0 };

/// What a long start is doing, for progress bars.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// Laying points: instances done, of how many.
    Laying(usize, usize),
    /// Tracing every point once: points done, of how many.
    Tracing(usize, usize),
    /// Looking for what stands between points and texels: instances done, of how many.
    Cutting(usize, usize),
}

/// Why a server did not start or step.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// Points could not be laid.
    #[error(transparent)]
    Generate(#[from] GenerateError),
    /// Settings of the update are out of range.
    #[error(transparent)]
    Update(#[from] UpdateError),
    /// The cap on points is out of range.
    #[error("at most {points} points at a time: must be 1 to {limit}")]
    BadCap {
        /// What was asked for.
        points: u32,
        /// [`GenerateParams::max_points`].
        limit: u32,
    },
    /// A cap on points with density that is not uniform.
    #[error(
        "density that follows visibility is weighed over all instances together, so it does not go with a cap on points: \
         leave out one of them (--adaptive, --max-points)"
    )]
    AdaptiveCap,
    /// A part that does not exist.
    #[error("part {number} of {of}: parts count from 0, and there are 1 to {most}", most = Shard::MOST)]
    BadShard {
        /// Which.
        number: u32,
        /// Of how many.
        of: u32,
    },
    /// A part of a scene with settings that are weighed over all of it.
    #[error(
        "density that follows visibility, or a cap on points, is weighed over the whole scene, so neither goes with parts of it: leave \
         out --adaptive and --max-points"
    )]
    UnevenShard,
    /// An error of an area light's visibility that may wait is no share of a point's light.
    #[error("--area-lights is {0}, must be 0 to 1: the share of a point's light that may be off for a while")]
    BadLightTolerance(f32),
    /// Points that came did not fit those that there are.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// More points and lights than can be held.
    #[error(transparent)]
    Lights(#[from] LightVisibilityError),
    /// The paper's table could not be made.
    #[error(transparent)]
    Paper(#[from] PaperError),
    /// The paper's frames could not be compressed, which means that memory ran out.
    #[error("compression failed: {0}; free memory and step again")]
    Compress(#[from] std::io::Error),
}

/// What one step did.
#[derive(Clone, Debug, Default)]
pub struct StepReport {
    /// What subscribers that are up to date must receive; nothing when nothing changed.
    pub frame: Option<Frame>,
    /// Points traced because something moved.
    pub traced: u32,
    /// Rays traced, for whatever reason.
    pub rays: u64,
    /// The same in detail, and what is left to do.
    pub counts: StepCounts,
    /// Points whose published visibility changed.
    pub changed: u32,
    /// Points, and values of lights, that subscribers hold less exactly than they should, because the budget of bits did not reach.
    pub held_back: u32,
    /// Points that there are, those that wait for their first rays counted.
    pub points: u32,
    /// Instances whose points came with this step's frame.
    pub spawned: u32,
    /// Instances whose points went.
    pub evicted: u32,
    /// What lights took, in pairs of a point and a light; their rays are among `rays`.
    pub lights: VisibilityCounts,
    /// Pairs that may see another part of their light than is known, because the budget of rays did not reach.
    pub lights_due: u64,
}

/// A scene that is being lit. A clone goes on from the same state by itself.
#[derive(Clone)]
pub struct Server {
    scene: Arc<Scene>,
    /// What the next step's pose goes by.
    edits: Edits,
    tracer: Tracer,
    updater: Updater,
    /// What [`Server::step_at`] publishes, and what was added to it.
    streams: Vec<Stream>,
    tolerance: u8,
    dropped_inside: u32,
    /// Who has points, where there is a cap on them.
    population: Option<Population>,
    /// How much of each light the points see.
    lights: Option<LightTracker>,
    /// The scene as it is now.
    pose: Pose,
}

impl Server {
    /// Lays and traces all points at time 0 and publishes the first snapshot, which [`Server::join`] returns.
    pub fn new(
        scene: Arc<Scene>,
        config: &ServerConfig,
        progress: &(dyn Fn(Progress) + Sync),
    ) -> Result<Server, ServerError> {
        Server::watched(scene, config, &StepInput::default(), progress)
    }

    /// As [`Server::new`], knowing what viewers see at first: where there is a cap on points, they get them.
    pub fn watched(
        scene: Arc<Scene>,
        config: &ServerConfig,
        input: &StepInput<'_>,
        progress: &(dyn Fn(Progress) + Sync),
    ) -> Result<Server, ServerError> {
        let pose = scene.pose(0.0);
        let tracer = Tracer::new(&scene, &pose);
        if config.shard.is_some() {
            config.check(&scene)?;
        }
        if let Some(most_points) = config.max_resident_points {
            config.check(&scene)?;
            let mut population = Population::new(&scene, pose.clone(), tracer.clone(), config, most_points)?;
            progress(Progress::Laying(0, 1));
            let points = population.fill(&scene, input)?;
            progress(Progress::Laying(1, 1));
            let mut server = Server::with_points(scene, pose, tracer, points, config, progress)?;
            server.population = Some(population);
            return Ok(server);
        }
        if let Some(shard) = config.shard {
            let layer = PointLayer::new(&scene, &config.generate)?;
            let own = shard.instances(&scene, &config.generate)?;
            progress(Progress::Laying(0, 1));
            let points = layer.lay(&scene, &pose, &tracer, &own)?;
            progress(Progress::Laying(1, 1));
            return Server::with_points(scene, pose, tracer, points, config, progress);
        }
        let instances = scene.instances.len();
        let laying = |done| progress(Progress::Laying(done, instances));
        let points = generate_points(&scene, &pose, &tracer, &config.generate, &laying)?;
        Server::with_points(scene, pose, tracer, points, config, progress)
    }

    /// Like [`Server::new`] with points that were laid before, in this scene at time 0.
    pub fn with_points(
        scene: Arc<Scene>,
        pose: Pose,
        tracer: Tracer,
        points: GeneratedPoints,
        config: &ServerConfig,
        progress: &(dyn Fn(Progress) + Sync),
    ) -> Result<Server, ServerError> {
        config.check_lights()?;
        let (count, dropped_inside) = (points.anchors.len(), points.dropped_inside);
        let tracing = |done| progress(Progress::Tracing(done, count));
        let updater = Updater::new(&scene, &pose, &tracer, points, config.update, &tracing)?;
        let mut publisher = Publisher::new(scene.hash().0, config.publish);
        if config.cuts {
            let layout = updater.store().layout();
            let sets = layout.sets().len();
            let cuts =
                find_cuts(&scene, &pose, &tracer, layout, &|done| progress(Progress::Cutting(done, sets)));
            publisher.set_cuts(layout.clone(), cuts);
        }
        let lights = match config.lights {
            Some(params) if !AreaLights::new(&scene, &pose).is_empty() => {
                let points = (updater.store().layout(), updater.anchors());
                Some(LightTracker::new(&scene, &pose, &tracer, points, params)?)
            }
            _ => None,
        };
        publisher.publish(&lit(&updater, lights.as_ref()));
        let streams = vec![Stream { publisher, budget: config.bits_per_s.map(Budget::new) }];
        let tolerance = config.publish.precision.tolerance;
        let (edits, population) = (Edits::new(&scene), None);
        Ok(Server {
            scene,
            edits,
            tracer,
            updater,
            streams,
            tolerance,
            dropped_inside,
            population,
            lights,
            pose,
        })
    }

    /// Brings the scene to `now_s` (seconds) and publishes what changed. Time may run in any direction. Takes as many rays
    /// as that needs.
    pub fn step(&mut self, now_s: f64) -> Result<StepReport, ServerError> {
        self.step_with(now_s, &StepInput::default())
    }

    /// As [`Server::step`] within a budget of rays, spent first where viewers look. What does not fit is published by later
    /// steps, so a server that runs short falls behind a little everywhere instead of stopping anywhere.
    pub fn step_with(&mut self, now_s: f64, input: &StepInput<'_>) -> Result<StepReport, ServerError> {
        self.step_at(now_s, now_s, input)
    }

    /// As [`Server::step_with`], of a scene whose time is not the clock's: `sent_s` (seconds, never falling) is when the frame goes out, which
    /// a budget of bits goes by.
    pub fn step_at(
        &mut self,
        now_s: f64,
        sent_s: f64,
        input: &StepInput<'_>,
    ) -> Result<StepReport, ServerError> {
        let pose = self.scene.pose_edited(now_s, &self.edits);
        self.tracer.update(&self.scene, &pose);
        let (mut spawned, mut evicted) = (Vec::new(), 0);
        if let Some(population) = &mut self.population {
            evicted = population.turn_over(&self.scene, &mut self.updater, input)?;
        }
        // Lights get what ambient light leaves, and where that was not enough, a part of their own.
        let for_lights = match (&self.lights, input.ray_budget) {
            (Some(lights), Some(budget)) if lights.due() > 0 => {
                (budget / LIGHTS_PART).min(lights.due() as u64 * u64::from(lights.rays()))
            }
            _ => 0,
        };
        let ambient = StepInput { ray_budget: input.ray_budget.map(|rays| rays - for_lights), ..*input };
        let report = self.updater.step(&self.scene, &pose, &mut self.tracer, &ambient);
        if let Some(population) = &mut self.population {
            spawned = self.updater.take_ready();
            if !spawned.is_empty() {
                let cuts = population.take_cuts(&spawned);
                for stream in &mut self.streams {
                    stream.publisher.set_cuts(self.updater.store().layout().clone(), cuts.clone());
                }
            }
        }
        let lights = self.step_lights(&pose, input.ray_budget, report.counts.rays())?;
        self.pose = pose;
        let frame = self.publish_stream(0, sent_s, input.interest);
        Ok(StepReport {
            lights,
            lights_due: self.lights.as_ref().map_or(0, |lights| lights.due() as u64),
            frame,
            traced: report.counts.traced(),
            rays: report.counts.rays() + lights.rays,
            counts: report.counts,
            changed: self.streams[0].publisher.changed(),
            held_back: self.held_back(),
            points: (self.updater.store().layout().len() + self.updater.spawning()) as u32,
            spawned: spawned.len() as u32,
            evicted,
        })
    }

    /// Brings what is known of lights to a pose, with the rays that ambient light left.
    fn step_lights(
        &mut self,
        pose: &Pose,
        budget: Option<u64>,
        taken: u64,
    ) -> Result<VisibilityCounts, ServerError> {
        let Some(lights) = &mut self.lights else { return Ok(VisibilityCounts::default()) };
        let (scene, tracer) = (&self.scene, &self.tracer);
        let points = (self.updater.store().layout(), self.updater.anchors());
        let came = lights.follow(scene, pose, tracer, points)?;
        let left = budget.map(|budget| budget.saturating_sub(taken.saturating_add(came.rays)));
        Ok(came + lights.step(scene, pose, tracer, points.1, left))
    }

    /// From the next step on the scene is changed like this. The edits must be ones that [`Edits::check`] lets pass, and every client
    /// must draw with the same. What becomes visible or dark by them is traced as if it had moved by itself.
    pub fn set_edits(&mut self, edits: Edits) {
        self.edits = edits;
    }

    /// What viewers have changed; as at first ([`Edits::new`]) until [`Server::set_edits`].
    pub fn edits(&self) -> &Edits {
        &self.edits
    }

    /// Points that a budget of bits did not reach.
    fn held_back(&self) -> u32 {
        if self.streams[0].budget.is_none() {
            return 0;
        }
        let pairs = self.store().visibility().iter().zip(self.traced().visibility());
        let points = pairs.filter(|(held, traced)| held.abs_diff(**traced) > self.tolerance).count();
        (points + self.lights_held_back()) as u32
    }

    /// Values of lights that subscribers hold less exactly than they should.
    fn lights_held_back(&self) -> usize {
        let Some((lights, held)) = self.lights.as_ref().zip(self.store().lights()) else { return 0 };
        let traced = lights.values();
        if held.points() != traced.points() {
            return 0;
        }
        let is_off = |&(index, steps): &(u32, u8)| {
            let index = index as usize;
            held.values()[index].abs_diff(traced.values()[index]) > steps
        };
        lights.tolerances(held, &self.scene, &self.pose).iter().filter(|listed| is_off(listed)).count()
    }

    /// The snapshot that brings a subscriber that joins now up to date. Encoded at most once an update.
    pub fn join(&mut self) -> Result<Option<Frame>, ServerError> {
        Ok(self.join_stream(0))
    }

    /// How many bytes of a snapshot are cuts.
    pub fn cut_bytes(&self) -> usize {
        self.streams[0].publisher.cut_bytes()
    }

    /// What has been published: what every subscriber that is up to date holds, to the bit.
    pub fn store(&self) -> &PointStore {
        self.streams[0].publisher.store().expect("a server publishes as it starts")
    }

    /// What was traced: what has been published is nowhere farther from it than the publisher's tolerance, but for
    /// [`StepReport::held_back`] points. Lights are not in it: [`Server::lights`].
    pub fn traced(&self) -> &PointStore {
        self.updater.store()
    }

    /// What was traced of lights, where it is ([`ServerConfig::lights`]).
    pub fn lights(&self) -> Option<&LightTracker> {
        self.lights.as_ref()
    }

    /// Where every point is in the world at `pose`, in the order of the store.
    pub fn positions_world(&self, pose: &Pose) -> Vec<Option<Vec3>> {
        self.updater.positions_world(&self.scene, pose)
    }

    /// Points that were not laid because they lie inside geometry.
    pub fn dropped_inside(&self) -> u32 {
        self.dropped_inside
    }

    /// Instances that stay open because they alone have more points than there may be.
    pub fn too_large(&self) -> &[u32] {
        self.population.as_ref().map_or(&[], |population| population.too_large())
    }

    /// The scene.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Bytes held now for each point, tracer and scene not counted ([`Updater::bytes_per_point`], [`Publisher::bytes`]).
    pub fn bytes_per_point(&self) -> f64 {
        let points = self.store().layout().len().max(1) as f64;
        let published: usize = self.streams.iter().map(|stream| stream.publisher.bytes()).sum();
        let lights = self.lights.as_ref().map_or(0, LightTracker::bytes);
        self.updater.bytes_per_point() + (published + lights) as f64 / points
    }
}

/// Of the rays of a step lights may take this part before ambient light, as its reciprocal.
const LIGHTS_PART: u64 = 3;

/// What is to be published: visibility, and where it is known how much of each light the points see.
fn lit(updater: &Updater, lights: Option<&LightTracker>) -> PointStore {
    let store = updater.store().clone();
    match lights {
        Some(lights) => store
            .with_lights(lights.values().clone())
            .expect("the tracker follows points that come and go before anything is published"),
        None => store,
    }
}
