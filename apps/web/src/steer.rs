//! Where the picture is taken from: a camera path of the scene, or the reader's own hand.

use std::sync::Arc;

use dapple_client::controls::Controls;
use dapple_scene::glam::Vec3;
use dapple_scene::{CameraPath, PosedCamera, Projection, Scene};
use wasm_bindgen::prelude::*;

use crate::core::{Core, object};

/// Field of view where the scene has none, radians (50°).
const DEFAULT_YFOV: f32 = 0.873;

/// The camera and what moves it.
pub(crate) struct Steering {
    paths: Vec<CameraPath>,
    aim: Aim,
    yfov: f32,
    /// Metres a second ahead, to the right and up.
    speed: Vec3,
    /// The scene's diagonal at its start, metres.
    diagonal_m: f32,
}

#[derive(Clone, Copy)]
enum Aim {
    Path(usize),
    Hand(Controls),
}

impl Default for Steering {
    fn default() -> Steering {
        Steering {
            paths: Vec::new(),
            aim: Aim::Path(0),
            yfov: DEFAULT_YFOV,
            speed: Vec3::ZERO,
            diagonal_m: 1.0,
        }
    }
}

impl Steering {
    /// On the scene's first camera path.
    pub(crate) fn new(scene: &Scene) -> Steering {
        let diagonal_m = scene.bounds_world(&scene.pose(0.0)).diagonal();
        Steering { paths: scene.camera_paths(), diagonal_m, ..Steering::default() }
    }

    /// How long the scene plays by itself: its animation, else its first camera path.
    pub(crate) fn duration_s(&self, scene: &Scene) -> f64 {
        let animation = scene.active_animation.and_then(|index| scene.animations.get(index as usize));
        let animated = animation.map_or(0.0, |animation| f64::from(animation.duration()));
        if animated > 0.0 { animated } else { self.paths.first().map_or(0.0, CameraPath::duration_s) }
    }

    /// The scene's diagonal at its start, metres.
    pub(crate) fn diagonal_m(&self) -> f32 {
        self.diagonal_m
    }

    /// Whether the picture changes with the scene's time: something is animated, or the camera follows a path.
    pub(crate) fn follows_time(&self, scene: &Scene) -> bool {
        scene.active_animation.is_some() || matches!(self.aim, Aim::Path(_))
    }

    /// The camera at a time of the scene, seconds.
    pub(crate) fn camera(&self, scene: &Scene, time_s: f64) -> PosedCamera {
        match (self.aim, self.paths.first()) {
            (Aim::Hand(controls), _) => controls.camera(self.yfov),
            (Aim::Path(index), Some(first)) => {
                self.paths.get(index).unwrap_or(first).camera(scene, &scene.pose_undeformed(time_s))
            }
            (Aim::Path(_), None) => PosedCamera::look_at(Vec3::ONE, Vec3::ZERO, self.yfov),
        }
    }

    /// Walks on; true if that moved anything.
    pub(crate) fn advance(&mut self, elapsed_s: f64) -> bool {
        match &mut self.aim {
            Aim::Hand(controls) if self.speed != Vec3::ZERO => {
                controls.walk(self.speed.x, self.speed.y, self.speed.z, elapsed_s.clamp(0.0, 0.1) as f32);
                true
            }
            _ => false,
        }
    }

    /// The reader's hand, which takes over from a path where the path is now: on foot inside the scene, around its
    /// middle from outside.
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

#[wasm_bindgen]
impl Core {
    /// Names of the scene's camera paths.
    #[wasm_bindgen(js_name = cameraPaths)]
    pub fn camera_paths(&self) -> Vec<String> {
        self.steering.paths.iter().map(|path| path.name.clone()).collect()
    }

    /// Follows a camera path of the scene, by name.
    #[wasm_bindgen(js_name = followPath)]
    pub fn follow_path(&mut self, name: &str) -> Result<(), JsError> {
        let index = self.steering.paths.iter().position(|path| path.name == name).ok_or_else(|| {
            let known = self.camera_paths().join(", ");
            JsError::new(&format!("there is no camera \"{name}\": choose from {known}"))
        })?;
        self.steering.aim = Aim::Path(index);
        self.changed = true;
        Ok(())
    }

    /// Looks from a place at another (metres), with a vertical field of view in degrees; by hand from there on.
    #[wasm_bindgen(js_name = lookAt)]
    pub fn look_at(&mut self, eye: &[f32], target: &[f32], yfov_degrees: f32) -> Result<(), JsError> {
        let place = |xyz: &[f32]| match xyz {
            [x, y, z] if x.is_finite() && y.is_finite() && z.is_finite() => Ok(Vec3::new(*x, *y, *z)),
            _ => Err(JsError::new("a camera's eye and target are three finite numbers each")),
        };
        let (eye, target) = (place(eye)?, place(target)?);
        if !(1.0..=170.0).contains(&yfov_degrees) {
            return Err(JsError::new("a camera's field of view is 1 to 170 degrees"));
        }
        self.steering.yfov = yfov_degrees.to_radians();
        let camera = PosedCamera::look_at(eye, target, self.steering.yfov);
        let distance = (!self.is_walking()).then_some(eye.distance(target));
        self.steering.aim = Aim::Hand(Controls::from_camera(&camera, distance));
        self.changed = true;
        Ok(())
    }

    /// All of the scene, from outside.
    pub fn fit(&mut self) {
        if let Some(scene) = self.scene() {
            let bounds = scene.bounds_world(&scene.pose(self.clock.time_s()));
            self.steering.aim = Aim::Hand(Controls::fit(&bounds, self.steering.yfov, self.aspect()));
            self.changed = true;
        }
    }

    /// On foot (true) or around what is in front, from where the camera is.
    #[wasm_bindgen(js_name = setWalking)]
    pub fn set_walking(&mut self, walking: bool) {
        self.by_hand(|controls, diagonal_m| {
            *controls = if walking { controls.to_walk() } else { controls.to_orbit(0.25 * diagonal_m) };
        });
    }

    /// Whether the camera is on foot.
    #[wasm_bindgen(js_name = isWalking)]
    pub fn is_walking(&self) -> bool {
        matches!(self.steering.aim, Aim::Hand(Controls::Walk { .. }))
    }

    /// Turns by a pointer's way, in heights of the picture to the right and down.
    pub fn rotate(&mut self, dx: f32, dy: f32) {
        // A drag over the whole height turns half round.
        self.by_hand(|controls, _| controls.rotate(core::f32::consts::PI * dx, core::f32::consts::PI * dy));
    }

    /// Moves sideways by a pointer's way, in heights of the picture to the right and down.
    pub fn pan(&mut self, dx: f32, dy: f32) {
        let yfov = self.steering.yfov;
        self.by_hand(|controls, _| controls.pan(dx, dy, yfov));
    }

    /// Comes closer (above 1) or goes back (below).
    pub fn zoom(&mut self, factor: f32) {
        self.by_hand(|controls, _| controls.zoom(factor));
    }

    /// Sets the speed of walking, −1 … 1 ahead, to the right and up, until it is set anew. At 1 a scene of the size of
    /// a hall is crossed in ten seconds.
    pub fn walk(&mut self, forward: f32, right: f32, up: f32) {
        let direction = Vec3::new(forward, right, up);
        if direction == Vec3::ZERO || !direction.is_finite() {
            self.steering.speed = Vec3::ZERO;
            return;
        }
        let mut speed = 0.0;
        self.by_hand(|_, diagonal_m| speed = (0.1 * diagonal_m).clamp(0.01, 10.0));
        self.steering.speed = speed * direction.clamp(Vec3::NEG_ONE, Vec3::ONE);
    }

    /// The camera as `{ path, walking, eye, target, yfovDegrees }`.
    pub fn camera(&self) -> JsValue {
        let Some(scene) = self.scene() else { return JsValue::NULL };
        let camera = self.steering.camera(&scene, self.clock.time_s());
        let (path, distance) = match self.steering.aim {
            Aim::Path(index) => {
                (self.steering.paths.get(index).map_or(JsValue::NULL, |path| path.name.as_str().into()), 1.0)
            }
            Aim::Hand(Controls::Orbit { distance, .. }) => (JsValue::NULL, distance),
            Aim::Hand(Controls::Walk { .. }) => (JsValue::NULL, 1.0),
        };
        let eye = camera.eye_world();
        let target = eye - distance * Vec3::from(camera.world_from_view.matrix3.z_axis);
        let yfov = match camera.projection {
            Projection::Perspective { yfov, .. } => f64::from(yfov.to_degrees()).into(),
            Projection::Orthographic { .. } => JsValue::NULL,
        };
        let place = |v: Vec3| js_sys::Array::of3(&v.x.into(), &v.y.into(), &v.z.into()).into();
        object(&[
            ("path", path),
            ("walking", self.is_walking().into()),
            ("eye", place(eye)),
            ("target", place(target)),
            ("yfovDegrees", yfov),
        ])
    }

    /// Changes the controls, which take over from a path; the change learns the diagonal of the scene in metres.
    fn by_hand(&mut self, change: impl FnOnce(&mut Controls, f32)) {
        let Some(scene): Option<Arc<Scene>> = self.scene() else { return };
        let mut controls = self.steering.hand(&scene, self.clock.time_s());
        change(&mut controls, self.steering.diagonal_m);
        self.steering.aim = Aim::Hand(controls);
        self.changed = true;
    }
}
