//! The client's half: stream + render. Frames in, pictures out; no socket, no window, no clock.
//!
//! ```text
//! frames ─► subscriber ─► store ─► point index ─┐
//! pose(now), camera ─► g-buffer ─► fragments ───┴─► visibility ─► compose ─► image
//! ```

pub mod controls;
#[cfg(feature = "gpu")]
pub mod viewer;

use std::sync::Arc;

use dapple_render::RenderError;
use dapple_render::compose::compose;
use dapple_render::gbuffer::{GBuffer, rasterize};
use dapple_render::image::LinearImage;
use dapple_render::psao::{Kernel, PointIndex, reconstruct};
use dapple_render::shade::{ShadeParams, Shaded, render_shadow_maps, shade};
use dapple_scene::{Pose, PosedCamera, Scene};
use dapple_store::points::PointStore;
use dapple_stream::{Applied, Limits, ReceiveError, Subscriber};

/// One viewer's copy of the light, and the passes that draw with it.
pub struct Client {
    scene: Arc<Scene>,
    subscriber: Subscriber,
    index: Option<PointIndex>,
}

/// How a picture is made.
#[derive(Clone, Debug)]
pub struct PictureParams {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Samples a pixel along each axis, 1 … 8.
    pub supersample: u32,
    /// Lights and ambient.
    pub shade: ShadeParams,
}

/// A scene drawn without visibility: geometry, and light split into the part that visibility touches and the rest.
pub struct Drawn {
    /// Everything that moves, at the picture's time.
    pub pose: Pose,
    /// What each sample shows.
    pub gbuffer: GBuffer,
    /// Its light.
    pub shaded: Shaded,
}

impl Drawn {
    /// The picture, with one visibility a sample (all open for `None`).
    pub fn compose(&self, visibility: Option<&[f32]>) -> Result<LinearImage, RenderError> {
        compose(&self.shaded, &self.gbuffer, visibility)
    }
}

impl Client {
    /// A client that accepts only frames made for this scene.
    /// Of `limits`, the number of sets is raised to the scene's instances, which is the most a server can send.
    pub fn new(scene: Arc<Scene>, mut limits: Limits) -> Client {
        limits.max_sets = limits.max_sets.max(u32::try_from(scene.instances.len()).unwrap_or(u32::MAX));
        let subscriber = Subscriber::new(Some(scene.hash().0), limits);
        Client { scene, subscriber, index: None }
    }

    /// Takes one frame off the wire. On an error nothing has changed.
    pub fn receive(&mut self, bytes: &[u8]) -> Result<Applied, ReceiveError> {
        let applied = self.subscriber.receive(bytes)?;
        if matches!(applied, Applied::NewLayout) {
            self.index = self.subscriber.store().map(|store| PointIndex::new(store.layout()));
        }
        Ok(applied)
    }

    /// What this client holds; nothing before the first snapshot.
    pub fn store(&self) -> Option<&PointStore> {
        self.subscriber.store()
    }

    /// Number of the update it holds.
    pub fn epoch(&self) -> Option<u64> {
        self.subscriber.epoch()
    }

    /// Draws the scene at `now_s` (seconds) without visibility.
    pub fn draw(
        &self,
        camera: &PosedCamera,
        now_s: f64,
        params: &PictureParams,
    ) -> Result<Drawn, RenderError> {
        draw(&self.scene, camera, now_s, params)
    }

    /// Visibility of each sample: all open before the first snapshot.
    pub fn visibility(&self, drawn: &Drawn, kernel: &Kernel) -> Vec<f32> {
        match (&self.index, self.subscriber.store()) {
            (Some(index), Some(store)) => {
                let fragments = drawn.gbuffer.map_surfaces_rest(&self.scene, |_, surface| surface.copied());
                reconstruct(index, store.visibility(), kernel, &fragments)
            }
            _ => vec![1.0; drawn.gbuffer.samples().len()],
        }
    }
}

/// Draws a scene at `now_s` (seconds) without visibility.
pub fn draw(
    scene: &Scene,
    camera: &PosedCamera,
    now_s: f64,
    params: &PictureParams,
) -> Result<Drawn, RenderError> {
    let pose = scene.pose(now_s);
    let gbuffer = rasterize(scene, &pose, camera, params.width, params.height, params.supersample)?;
    let shadow_maps = render_shadow_maps(scene, &pose, &params.shade);
    let shaded = shade(scene, &pose, camera, &gbuffer, &shadow_maps, &params.shade);
    Ok(Drawn { pose, gbuffer, shaded })
}
