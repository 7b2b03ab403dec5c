//! What a viewer is asked for, and what it says of itself.

use dapple_gpu::{GpuFault, wgpu};
use dapple_render::Preset;
use dapple_render::forward::ForwardError;
use dapple_render::image::ToneMap;
use dapple_render::screen_space::ScreenKind;
use dapple_render::sdao::SideParams;
use dapple_render::shade::ShadeParams;
use dapple_stream::Limits;

/// What a viewer is made for.
#[derive(Clone, Debug)]
pub struct ViewerConfig {
    /// Format of the textures it draws to. Colours are written sRGB-encoded: where the format encodes by itself (`…Srgb`),
    /// hand over views of the plain format.
    pub format: wgpu::TextureFormat,
    /// Samples a pixel, 1 or 4. Default 4.
    pub samples: u32,
    /// Whether textures get smaller levels for surfaces far away. Default true; the processor's pictures have none.
    pub mips: bool,
    /// Lights, ambient, shadow maps.
    pub shade: ShadeParams,
    /// What it takes from a server. The number of sets is raised to the scene's instances, the most a server can send.
    pub limits: Limits,
}

impl ViewerConfig {
    /// The defaults, for targets of one format.
    pub fn new(format: wgpu::TextureFormat) -> ViewerConfig {
        let (shade, limits) = (ShadeParams::default(), Limits::default());
        ViewerConfig { format, samples: 4, mips: true, shade, limits }
    }
}

/// How the visibility in a picture is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Method {
    /// Not at all: everything is open.
    None,
    /// Points, through the visibility atlas.
    #[default]
    Psao,
    /// Points, by the paper's look-up ([Neff2023] sec. 3.5).
    PsaoPaper,
    /// From the picture alone, without points.
    Screen(ScreenKind),
}

impl Method {
    /// All, points first.
    pub const ALL: [Method; 3 + ScreenKind::ALL.len()] = {
        let mut all = [Method::None; 3 + ScreenKind::ALL.len()];
        (all[0], all[1]) = (Method::Psao, Method::PsaoPaper);
        let mut i = 0;
        while i < ScreenKind::ALL.len() {
            all[2 + i] = Method::Screen(ScreenKind::ALL[i]);
            i += 1;
        }
        all
    };

    /// As programs and pages name it: lower case, words joined by hyphens.
    pub const fn name(self) -> &'static str {
        match self {
            Method::None => "none",
            Method::Psao => "psao",
            Method::PsaoPaper => "psao-paper",
            Method::Screen(kind) => kind.name(),
        }
    }
}

/// What methods that look at the picture alone are given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScreenOptions {
    /// How far away what blocks may be, metres, > 0; default 0.6.
    pub radius_m: f32,
    /// How far beyond the picture is looked, as a part of its height, 0 … 0.5; default 0.1.
    pub guard_band: f32,
    /// How much work they do.
    pub preset: Preset,
    /// Whether they look at a quarter of the samples, and the rest follows; `None` (default) as the preset has it.
    pub half_resolution: Option<bool>,
    /// Where those over stochastic depth have a second camera, which sees what the first one looks along; `None` (default): nowhere. Others take no notice
    /// ([`ScreenKind::takes_second_camera`]).
    pub second_camera: Option<SideParams>,
}

impl Default for ScreenOptions {
    fn default() -> Self {
        ScreenOptions {
            radius_m: 0.6,
            guard_band: 0.1,
            preset: Preset::default(),
            half_resolution: None,
            second_camera: None,
        }
    }
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
    /// Time since the visibility last changed: yellow is new, dark blue ten seconds and more.
    Age,
    /// Difference of the method and the one of a split screen (of no method at all without a split).
    Error,
}

impl DebugView {
    /// All, the lit scene first.
    pub const ALL: [DebugView; 8] = [
        DebugView::Beauty,
        DebugView::Visibility,
        DebugView::Normal,
        DebugView::Points,
        DebugView::Texels,
        DebugView::Weights,
        DebugView::Age,
        DebugView::Error,
    ];

    /// As programs and pages name it.
    pub const fn name(self) -> &'static str {
        match self {
            DebugView::Beauty => "beauty",
            DebugView::Visibility => "visibility",
            DebugView::Normal => "normal",
            DebugView::Points => "points",
            DebugView::Texels => "texels",
            DebugView::Weights => "weights",
            DebugView::Age => "age",
            DebugView::Error => "error",
        }
    }
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
    /// What stands in for points while there are none: before the first snapshot, or where none ever come. `None` (default): everything is open.
    pub fallback: Option<ScreenKind>,
    /// Of methods that look at the picture alone, the fallback among them.
    pub screen: ScreenOptions,
    /// Fade from the last update to this one over so many seconds, 0 …; 0 shows updates as they come. `None` (default)
    /// follows the pace of updates, so that a fade is over when the next one comes: [`Pace`](crate::pace::Pace).
    pub fade_s: Option<f32>,
    /// Radiance to display.
    pub tone_map: ToneMap,
    /// Whether light of area lights is drawn where the stream tells how much of each is seen. Default true.
    pub area_lights: bool,
}

impl Default for DrawOptions {
    fn default() -> Self {
        DrawOptions {
            view: DebugView::default(),
            method: Method::default(),
            split: None,
            fallback: None,
            screen: ScreenOptions::default(),
            fade_s: None,
            tone_map: ToneMap::default(),
            area_lights: true,
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

impl LoadProgress {
    /// Whether nothing is left to do.
    pub fn is_complete(&self) -> bool {
        self.done >= self.total
    }
}

/// Figures for an overlay.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewerStats {
    /// Points of the store.
    pub points: u32,
    /// Area lights of which the store says how much points see.
    pub area_lights: u32,
    /// Bytes received since the start.
    pub bytes_received: u64,
    /// Frames received since the start.
    pub frames_received: u64,
    /// Points changed by the last frame.
    pub changed: u32,
    /// Texels of the atlas, gaps included.
    pub texels: u32,
    /// Memory in bytes: of store, weights and atlas on the heap; of meshes and atlas on the card.
    pub memory_bytes: (u64, u64),
    /// When the last frame arrived (the `now_s` it came with), seconds.
    pub last_frame_s: Option<f64>,
    /// Lights of the last picture that were left out, because a frame takes at most
    /// [`MAX_LIGHTS`](dapple_render::forward::MAX_LIGHTS).
    pub ignored_lights: u32,
}

/// Why a viewer cannot be made or draw.
#[derive(Debug, thiserror::Error)]
pub enum ViewerError {
    /// The camera, scene or size cannot be drawn.
    #[error(transparent)]
    Forward(#[from] ForwardError),
    /// The device failed; after a loss nothing works until everything is made anew on another.
    #[error(transparent)]
    Fault(#[from] GpuFault),
}
