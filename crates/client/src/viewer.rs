//! A viewer on a graphics card: frames and a camera in, a picture in a texture out. The same for a window, a browser
//! tab and a run without either.

use std::sync::Arc;

use dapple_gpu::{Gpu, wgpu};
use dapple_render::image::ToneMap;
use dapple_render::shade::ShadeParams;
use dapple_scene::{PosedCamera, Scene};
use dapple_stream::{Applied, Limits, ReceiveError, Subscriber};

/// What a viewer is made for.
#[derive(Clone, Debug)]
pub struct ViewerConfig {
    /// Format of the textures it draws to. Colours are written sRGB-encoded, so a format that encodes by itself
    /// (`…Srgb`) is written through its plain view.
    pub format: wgpu::TextureFormat,
    /// Samples a pixel, 1 or 4. Default 4.
    pub samples: u32,
    /// Lights, ambient, shadow maps.
    pub shade: ShadeParams,
    /// What it takes from a server.
    pub limits: Limits,
}

/// How the visibility in a picture is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Method {
    /// Not at all: everything is open.
    None,
    /// Points, through the visibility atlas.
    #[default]
    Psao,
    /// Points, by the paper's look-up ([Neff2023] sec. 3.5), where the device has storage buffers.
    PsaoPaper,
}

/// What a picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum DebugView {
    /// The lit scene.
    #[default]
    Beauty,
    /// Visibility, white is open.
    Visibility,
    /// Shading normals in the world as colours.
    Normal,
    /// The points themselves, in the shade of their visibility.
    Points,
    /// The texels of the atlas, charts in different colours.
    Texels,
    /// How many points a texel depends on, and how much the heaviest weighs.
    Weights,
    /// Time since the visibility last changed.
    Age,
    /// Difference of the two methods of a split screen.
    Error,
}

/// How one picture is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawOptions {
    /// What it shows.
    pub view: DebugView,
    /// How visibility is found.
    pub method: Method,
    /// Right of this part of the width (0 … 1) the other method is shown.
    pub split: Option<(f32, Method)>,
    /// Fade from the last update to this one over so many seconds; 0 shows updates as they come. Default 1/15.
    pub fade_s: f32,
    /// Radiance to display.
    pub tone_map: ToneMap,
}

impl Default for DrawOptions {
    fn default() -> Self {
        DrawOptions {
            view: DebugView::default(),
            method: Method::default(),
            split: None,
            fade_s: 1.0 / 15.0,
            tone_map: ToneMap::default(),
        }
    }
}

/// Work of a viewer after a snapshot, in texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LoadProgress {
    /// Done.
    pub done: u64,
    /// Of how many; 0 before the first snapshot.
    pub total: u64,
}

/// Figures for an overlay.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewerStats {
    /// Points of the store.
    pub points: u32,
    /// Bytes received since the start.
    pub bytes_received: u64,
    /// Frames received since the start.
    pub frames_received: u64,
    /// Points changed by the last frame.
    pub changed: u32,
    /// Texels of the atlas.
    pub texels: u32,
    /// Memory of store, weights and atlas in bytes: on the heap, and on the card.
    pub memory_bytes: (u64, u64),
    /// When the last frame arrived (the `now_s` it came with), seconds.
    pub last_frame_s: Option<f64>,
}

/// Why a viewer cannot be made or draw.
#[derive(Debug, thiserror::Error)]
pub enum ViewerError {
    /// The camera, scene or size cannot be drawn.
    #[error(transparent)]
    Render(#[from] dapple_render::RenderError),
}

/// One viewer's copy of the light on a graphics card, and the passes that draw with it.
pub struct Viewer {
    scene: Arc<Scene>,
    subscriber: Subscriber,
    config: ViewerConfig,
    stats: ViewerStats,
}

impl Viewer {
    /// Uploads the scene.
    pub fn new(_gpu: &Gpu, scene: Arc<Scene>, config: ViewerConfig) -> Result<Viewer, ViewerError> {
        let mut limits = config.limits;
        limits.max_sets = limits.max_sets.max(u32::try_from(scene.instances.len()).unwrap_or(u32::MAX));
        let subscriber = Subscriber::new(Some(scene.hash().0), limits);
        Ok(Viewer { scene, subscriber, config, stats: ViewerStats::default() })
    }

    /// Takes one frame off the wire, which came at `now_s` (seconds on the caller's clock, as in [`Viewer::draw`]).
    /// On an error nothing has changed.
    pub fn receive(&mut self, bytes: &[u8], now_s: f64) -> Result<Applied, ReceiveError> {
        let applied = self.subscriber.receive(bytes)?;
        self.stats.bytes_received += bytes.len() as u64;
        self.stats.frames_received += 1;
        self.stats.last_frame_s = Some(now_s);
        if let Applied::Changes(changes) = &applied {
            self.stats.changed = changes.len() as u32;
        }
        Ok(applied)
    }

    /// Goes on with the work that a snapshot causes (charts, weights), about `texels` texels of it; call it between
    /// frames until it is done. Until then the surfaces that are not ready are shown open.
    pub fn work(&mut self, _texels: usize) -> LoadProgress {
        LoadProgress::default()
    }

    /// Draws the scene as it is at `scene_time_s` (its animation's time) into `target`.
    #[allow(clippy::too_many_arguments, reason = "a picture has that many sides")]
    pub fn draw(
        &mut self,
        gpu: &Gpu,
        target: &wgpu::TextureView,
        (_width, _height): (u32, u32),
        _camera: &PosedCamera,
        _scene_time_s: f64,
        _now_s: f64,
        _options: &DrawOptions,
    ) -> Result<(), ViewerError> {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("viewer"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            })],
            ..Default::default()
        });
        gpu.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Figures for an overlay.
    pub fn stats(&self) -> ViewerStats {
        self.stats
    }

    /// The scene that it shows.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// The format it draws to.
    pub fn format(&self) -> wgpu::TextureFormat {
        self.config.format
    }
}
