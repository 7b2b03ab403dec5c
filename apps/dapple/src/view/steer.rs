//! Where the picture is taken from: a camera path of the scene, or the viewer's own hand.

use anyhow::Result;
use dapple_client::controls::Controls;
use dapple_scene::glam::Vec3;
use dapple_scene::{CameraPath, CameraSource, PosedCamera, Projection, Scene};

use crate::source;

/// Field of view where the scene has none, radians (50°).
const DEFAULT_YFOV: f32 = 0.873;

/// Radians turned by a drag over the whole height of the picture.
const DRAG_RADIANS: f32 = core::f32::consts::PI;

/// The camera and what moves it.
pub(super) struct Steering {
    paths: Vec<CameraPath>,
    aim: Aim,
    yfov: f32,
    /// −1 … 1 ahead, to the right and up.
    direction: Vec3,
    /// The scene's diagonal at its start, metres.
    diagonal_m: f32,
}

#[derive(Clone, Copy)]
enum Aim {
    Path(usize),
    Still(PosedCamera),
    Hand(Controls),
}

impl Steering {
    /// On the camera that `text` names or describes, or the scene's first path.
    pub(super) fn new(scene: &Scene, text: Option<&str>, time_s: f64) -> Result<Steering> {
        let paths = scene.camera_paths();
        let diagonal_m = scene.bounds_world(&scene.pose(0.0)).diagonal();
        let mut steering =
            Steering { paths, aim: Aim::Path(0), yfov: DEFAULT_YFOV, direction: Vec3::ZERO, diagonal_m };
        if let Some(text) = text.filter(|text| source::is_camera_text(text)) {
            steering.aim = Aim::Still(source::find_camera(scene, Some(text), time_s)?);
            return Ok(steering);
        }
        let wanted = source::find_path(scene, text)?;
        steering.aim = Aim::Path(match steering.paths.iter().position(|path| *path == wanted) {
            Some(index) => index,
            None => steering.add(wanted),
        });
        Ok(steering)
    }

    /// Adds a camera path that is not the scene's own, by its name or a numbered one; returns its number.
    pub(super) fn add(&mut self, mut path: CameraPath) -> usize {
        let names: Vec<&str> = self.paths.iter().map(|path| path.name.as_str()).collect();
        let numbered = (2..).map(|n| format!("{} {n}", path.name));
        let free =
            std::iter::once(path.name.clone()).chain(numbered).find(|name| !names.contains(&name.as_str()));
        path.name = free.unwrap_or_default();
        self.paths.push(path);
        self.paths.len() - 1
    }

    /// Seconds of the longest camera path that is not the scene's own.
    pub(super) fn added_s(&self) -> f64 {
        let added = self.paths.iter().filter(|path| matches!(path.source, CameraSource::Keys(_)));
        added.map(CameraPath::duration_s).fold(0.0, f64::max)
    }

    /// The scene's diagonal at its start, metres.
    pub(super) fn diagonal_m(&self) -> f32 {
        self.diagonal_m
    }

    /// The camera at a time of the scene, seconds.
    pub(super) fn camera(&self, scene: &Scene, time_s: f64) -> PosedCamera {
        match (self.aim, self.paths.first()) {
            (Aim::Hand(controls), _) => controls.camera(self.yfov),
            (Aim::Still(camera), _) => camera,
            (Aim::Path(index), Some(first)) => {
                self.paths.get(index).unwrap_or(first).camera(scene, &scene.pose_undeformed(time_s))
            }
            (Aim::Path(_), None) => PosedCamera::look_at(Vec3::ONE, Vec3::ZERO, self.yfov),
        }
    }

    /// What the camera is doing, for an overlay.
    pub(super) fn label(&self) -> &str {
        match self.aim {
            Aim::Path(index) => self.paths.get(index).map_or("", |path| &path.name),
            Aim::Still(_) => "as given",
            Aim::Hand(Controls::Orbit { .. }) => "orbit",
            Aim::Hand(Controls::Walk { .. }) => "on foot",
        }
    }

    /// Names of the scene's camera paths.
    pub(super) fn paths(&self) -> impl Iterator<Item = &str> {
        self.paths.iter().map(|path| path.name.as_str())
    }

    /// Follows the path of that number.
    pub(super) fn follow(&mut self, index: usize) {
        self.aim = Aim::Path(index.min(self.paths.len().saturating_sub(1)));
    }

    /// Follows the next path.
    pub(super) fn next_path(&mut self) {
        let next = match self.aim {
            Aim::Path(index) => (index + 1) % self.paths.len().max(1),
            _ => 0,
        };
        self.follow(next);
    }

    /// Walks on for `elapsed_s`; true if that moved anything.
    pub(super) fn advance(&mut self, scene: &Scene, time_s: f64, elapsed_s: f64) -> bool {
        if self.direction == Vec3::ZERO {
            return false;
        }
        // At full speed a hall is crossed in ten seconds.
        let speed = (0.1 * self.diagonal_m).clamp(0.01, 10.0) * self.direction;
        let dt_s = elapsed_s.clamp(0.0, 0.1) as f32;
        self.by_hand(scene, time_s, |controls| controls.walk(speed.x, speed.y, speed.z, dt_s));
        true
    }

    /// Sets where keys push, −1 … 1 ahead, to the right and up, until it is set anew.
    pub(super) fn push(&mut self, direction: Vec3) {
        self.direction = direction.clamp(Vec3::NEG_ONE, Vec3::ONE);
    }

    /// Turns by a pointer's way, in heights of the picture to the right and down.
    pub(super) fn rotate(&mut self, scene: &Scene, time_s: f64, dx: f32, dy: f32) {
        self.by_hand(scene, time_s, |controls| controls.rotate(DRAG_RADIANS * dx, DRAG_RADIANS * dy));
    }

    /// Moves sideways by a pointer's way, in heights of the picture to the right and down.
    pub(super) fn pan(&mut self, scene: &Scene, time_s: f64, dx: f32, dy: f32) {
        let yfov = self.yfov;
        self.by_hand(scene, time_s, |controls| controls.pan(dx, dy, yfov));
    }

    /// Comes closer (above 1) or goes back (below).
    pub(super) fn zoom(&mut self, scene: &Scene, time_s: f64, factor: f32) {
        self.by_hand(scene, time_s, |controls| controls.zoom(factor));
    }

    /// From foot to orbit or back.
    pub(super) fn toggle_walking(&mut self, scene: &Scene, time_s: f64) {
        let reach_m = 0.25 * self.diagonal_m;
        self.by_hand(scene, time_s, |controls| {
            *controls = match controls {
                Controls::Orbit { .. } => controls.to_walk(),
                Controls::Walk { .. } => controls.to_orbit(reach_m),
            };
        });
    }

    /// All of the scene, from outside.
    pub(super) fn fit(&mut self, scene: &Scene, time_s: f64, aspect: f32) {
        let bounds = scene.bounds_world(&scene.pose(time_s));
        self.aim = Aim::Hand(Controls::fit(&bounds, self.yfov, aspect));
    }

    fn by_hand(&mut self, scene: &Scene, time_s: f64, change: impl FnOnce(&mut Controls)) {
        let mut controls = self.hand(scene, time_s);
        change(&mut controls);
        self.aim = Aim::Hand(controls);
    }

    /// The hand, which takes over from a path where that is now: on foot inside the scene, around its middle from
    /// outside.
    fn hand(&mut self, scene: &Scene, time_s: f64) -> Controls {
        if let Aim::Hand(controls) = self.aim {
            return controls;
        }
        let camera = self.camera(scene, time_s);
        if let Projection::Perspective { yfov, .. } = camera.projection {
            self.yfov = yfov;
        }
        Controls::take_over(&camera, &scene.bounds_world(&scene.pose(time_s)))
    }
}
