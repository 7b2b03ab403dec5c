//! The paper's client ([Neff2023] sec. 3.4, 3.5), beside [`Client`](crate::Client) as the baseline that it is compared with.
//!
//! ```text
//! frames ─► subscriber ─► table of cells, pose of the last frame ─┐
//! drawn samples ─► their places in that pose's local spaces ──────┴─► visibility
//! ```

use std::sync::{Arc, OnceLock};

use dapple_render::psao::Kernel;
use dapple_render::psao::paper::reconstruct;
use dapple_scene::{Pose, Scene};
use dapple_store::cells::{CellChanges, CellTable};
use dapple_stream::cells::{CellError, CellLimits, CellSubscriber};

use crate::Drawn;

/// One viewer's copy of the paper's table.
pub struct PaperClient {
    scene: Arc<Scene>,
    subscriber: CellSubscriber,
    /// The scene at the time of the last frame, made when it is first needed.
    server_pose: OnceLock<Pose>,
}

impl PaperClient {
    /// A client that accepts only frames made for this scene. Of `limits`, the number of instances is raised to the scene's.
    pub fn new(scene: Arc<Scene>, mut limits: CellLimits) -> PaperClient {
        limits.max_grids = limits.max_grids.max(u32::try_from(scene.instances.len()).unwrap_or(u32::MAX));
        let subscriber = CellSubscriber::new(Some(scene.hash().0), limits);
        PaperClient { scene, subscriber, server_pose: OnceLock::new() }
    }

    /// Takes one frame off the wire.
    ///
    /// # Errors
    /// The frame cannot be applied. Then nothing has changed.
    pub fn receive(&mut self, bytes: &[u8]) -> Result<CellChanges, CellError> {
        let changes = self.subscriber.receive(bytes)?;
        self.server_pose = OnceLock::new();
        Ok(changes)
    }

    /// What it holds; nothing before the first snapshot.
    pub fn table(&self) -> Option<&CellTable> {
        self.subscriber.table()
    }

    /// Time of the server's scene at the last frame, seconds.
    pub fn server_time_s(&self) -> Option<f64> {
        self.subscriber.time_s()
    }

    /// Visibility 0 … 1 of each sample of a picture of any time, from where its place on the mesh was at the server's last
    /// update: all open before the first snapshot.
    pub fn visibility(&self, drawn: &Drawn, kernel: &Kernel) -> Vec<f32> {
        let (Some(table), Some(time_s)) = (self.subscriber.table(), self.subscriber.time_s()) else {
            return vec![1.0; drawn.gbuffer.samples().len()];
        };
        let pose = self.server_pose.get_or_init(|| self.scene.pose(time_s));
        let fragments = drawn.gbuffer.map_surfaces_local(&self.scene, pose, |_, surface| surface.copied());
        reconstruct(table, kernel, &fragments)
    }
}
