//! The paper's server ([Neff2023] sec. 3.2 to 3.4), beside [`Server`] as the baseline that it is compared with.
//!
//! ```text
//! pose(now), camera ─► tracer ─► updater (every point's visibility) ─► cells and buckets that changed ─► frames
//! ```

use std::sync::Arc;

use dapple_scene::{PosedCamera, Scene};
use dapple_store::cells::{CellTable, Overflow};
use dapple_stream::cells::{CellCodec, CellFrame, CellPublisher};
use dapple_trace::Tracer;
use dapple_trace::psao::paper::{PaperCounts, PaperParams, PaperUpdater, extended_view};
use dapple_trace::psao::update::{StepCounts, StepInput, Updater};

use crate::{Server, ServerError};

/// Settings of a [`PaperServer`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperConfig {
    /// When a point counts as changed, and the size of cells.
    pub params: PaperParams,
    /// By how much the field of view is extended on every side, degrees, 0 … 90. [Neff2023] sec. 3.3 names no number; default 20,
    /// which covers a head that turns by 300° a second at 15 Hz.
    pub margin_degrees: f32,
    /// How frames are compressed. Default zstd.
    pub codec: CellCodec,
}

impl Default for PaperConfig {
    fn default() -> Self {
        PaperConfig { params: PaperParams::default(), margin_degrees: 20.0, codec: CellCodec::default() }
    }
}

/// Through what the viewer looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Where the viewer is.
    pub camera: PosedCamera,
    /// Width / height of the picture.
    pub aspect: f32,
}

/// What one step did.
#[derive(Clone, Debug, Default)]
pub struct PaperReport {
    /// What a subscriber that is up to date must receive; nothing when nothing changed.
    pub frame: Option<CellFrame>,
    /// What was traced. All points that motion may have changed are, in view or not.
    pub counts: StepCounts,
    /// What changed.
    pub paper: PaperCounts,
}

/// A scene that is being lit for one viewer, as the paper does it. A clone goes on from the same state by itself.
#[derive(Clone)]
pub struct PaperServer {
    scene: Arc<Scene>,
    tracer: Tracer,
    updater: Updater,
    paper: PaperUpdater,
    publisher: CellPublisher,
    margin_degrees: f32,
}

impl PaperServer {
    /// The paper's server with the points and rays of `server`, which must not have stepped. The threshold is that of `config`.
    ///
    /// # Errors
    /// A parameter is out of range, or an instance has too many cells.
    pub fn new(server: Server, config: &PaperConfig) -> Result<PaperServer, ServerError> {
        let Server { scene, tracer, updater, .. } = server;
        let pose = scene.pose(0.0);
        let paper = PaperUpdater::new(&scene, &pose, &updater, config.params)?;
        let publisher = CellPublisher::new(scene.hash().0, config.codec, 0.0);
        Ok(PaperServer { scene, tracer, updater, paper, publisher, margin_degrees: config.margin_degrees })
    }

    /// Brings the scene to `now_s` (seconds) and publishes what changed of what the viewer sees, or of everything without a
    /// viewer. Points that a budget of rays leaves waiting keep their values.
    ///
    /// # Errors
    /// The compressor failed.
    pub fn step(
        &mut self,
        now_s: f64,
        look: Option<&Look>,
        input: &StepInput<'_>,
    ) -> Result<PaperReport, ServerError> {
        let pose = self.scene.pose(now_s);
        self.tracer.update(&self.scene, &pose);
        let counts = self.updater.step(&self.scene, &pose, &mut self.tracer, input).counts;
        let view = look.map(|look| extended_view(&look.camera, look.aspect, self.margin_degrees));
        let (changes, paper) = self.paper.step(&self.scene, &pose, &self.updater, view.as_ref());
        let frame = self.publisher.publish(self.paper.table(), &changes, now_s)?;
        Ok(PaperReport { frame, counts, paper })
    }

    /// The whole table, for a subscriber that joins now.
    ///
    /// # Errors
    /// The compressor failed.
    pub fn join(&self) -> Result<CellFrame, ServerError> {
        Ok(self.publisher.join(self.paper.table())?)
    }

    /// What has been published.
    pub fn table(&self) -> &CellTable {
        self.paper.table()
    }

    /// Points, those among them that found no place.
    pub fn points(&self) -> usize {
        self.updater.store().layout().len()
    }

    /// Points that found no place, counted each time that they asked for one.
    pub fn overflow(&self) -> Overflow {
        self.paper.overflow()
    }

    /// Points that have no place now.
    pub fn unplaced(&self) -> usize {
        self.paper.unplaced()
    }

    /// The scene.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }
}
