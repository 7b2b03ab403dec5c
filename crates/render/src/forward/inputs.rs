//! What a frame is asked for, and what it came to.

use dapple_scene::{Pose, PosedCamera};

use super::lookup::LookupId;
use super::points::GpuPoints;
use crate::image::ToneMap;
use crate::shade::ShadeParams;

/// What a view shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ViewKind {
    /// The lit scene.
    #[default]
    Beauty,
    /// Visibility as gray without an sRGB curve, white is open.
    Visibility,
    /// Shading normals in the world as colours.
    Normal,
    /// The points over a dimmed lit scene, in the shade of their values (see [`View::points`]).
    Points,
    /// Texels of the atlas: charts in different colours, shaded by visibility.
    Texels,
    /// Of each texel how much the heaviest point weighs (red) and how many there are (green).
    Weights,
    /// Time since the value of a texel last changed: yellow is new.
    Age,
    /// Absolute difference of this view's look-up and another's.
    Error {
        /// The other.
        other: LookupId,
    },
}

impl ViewKind {
    /// `VIEW_` constant of `frame.wgsl`.
    pub(super) fn code(self) -> u32 {
        match self {
            ViewKind::Beauty | ViewKind::Points => 0,
            ViewKind::Visibility | ViewKind::Error { .. } => 1,
            ViewKind::Normal => 2,
            ViewKind::Texels => 3,
            ViewKind::Weights => 4,
            ViewKind::Age => 5,
        }
    }

    pub(super) fn is_lit(self) -> bool {
        matches!(self, ViewKind::Beauty | ViewKind::Points)
    }
}

/// How materials are drawn whose alpha is blended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Transparency {
    /// Mixed with what is behind, from back to front by the instances' centres, after all else.
    #[default]
    Blend,
    /// Cut out where alpha is below one half, as the twin does.
    Cutout,
}

/// A part of the picture, pixels from the top left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// One look at the scene: a picture has one, two side by side, or one over a part of another.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// From where.
    pub camera: PosedCamera,
    /// The part of the picture that the camera's picture fills; the whole by default.
    pub viewport: Option<Rect>,
    /// The part of the picture that may change; the viewport by default.
    pub scissor: Option<Rect>,
    /// What is shown.
    pub kind: ViewKind,
    /// How visibility is found.
    pub lookup: LookupId,
    /// What [`ViewKind::Points`] shows.
    pub points: Option<&'a GpuPoints>,
}

impl View<'_> {
    /// The lit scene over the whole picture.
    pub fn new(camera: PosedCamera, lookup: LookupId) -> View<'static> {
        View { camera, viewport: None, scissor: None, kind: ViewKind::Beauty, lookup, points: None }
    }
}

/// What one frame shows.
#[derive(Clone, Copy, Debug)]
pub struct FrameInputs<'a> {
    /// The scene's pose; [`dapple_scene::Scene::pose_undeformed`] suffices.
    pub pose: &'a Pose,
    /// Lights, ambient, shadow maps.
    pub shade: &'a ShadeParams,
    /// Radiance to display.
    pub tone_map: ToneMap,
    /// Of materials whose alpha is blended.
    pub transparency: Transparency,
    /// From old values of visibility (0) to new ones (1).
    pub fade: f32,
    /// In the order they are drawn, at least one. All share the background of the first.
    pub views: &'a [View<'a>],
}

/// What a frame came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Drawn {
    /// Draw calls of the picture (not of shadow maps).
    pub draws: u32,
    /// Triangles handed to the card for the picture, before clipping.
    pub triangles: u64,
    /// Lights that were left out because there are more than [`super::MAX_LIGHTS`].
    pub ignored_lights: u32,
    /// Faces of shadow maps that were drawn anew; the others show what they did.
    pub shadow_faces: u32,
}
