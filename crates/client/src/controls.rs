//! How a viewer's camera is steered: around a place, or on foot. Pure mathematics: pixels, keys and time are the
//! caller's.
//!
//! Angles are those of a head: `yaw` 0 looks along −Z and grows to the left (counter-clockwise seen from above),
//! `pitch` 0 is level and grows upwards. Numbers that are not finite are ignored wherever they come in.

use dapple_scene::glam::{Affine3A, Mat3, Vec2, Vec3};
use dapple_scene::{Aabb, PosedCamera, Projection};

/// Steepest look up or down, radians: short of the pole, where left and right would swap.
const MAX_PITCH: f32 = 1.55;
/// Least and largest distance between an orbiting eye and its target, metres.
const DISTANCE_RANGE_M: (f32, f32) = (0.01, 1.0e5);
/// How far away things are taken to be where a walker pans, metres.
const WALK_REACH_M: f32 = 4.0;
/// Near plane, metres; nearer still where the eye orbits something small.
const NEAR_M: f32 = 0.02;

/// Where a steered camera is, and by which of the two ways it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Controls {
    /// Around a place.
    Orbit {
        /// What it circles, in the world.
        target: Vec3,
        /// Distance of the eye from it, metres, 0.01 … 100,000.
        distance: f32,
        /// Direction of view, radians.
        yaw: f32,
        /// Direction of view, radians, within ±1.55.
        pitch: f32,
    },
    /// On foot.
    Walk {
        /// Where the eye is, in the world.
        eye: Vec3,
        /// Direction of view, radians.
        yaw: f32,
        /// Direction of view, radians, within ±1.55.
        pitch: f32,
    },
}

impl Controls {
    /// Takes over from a camera; its roll and lens are left behind. With `orbit_distance_m` it circles the place so
    /// far in front of it, without it walks.
    pub fn from_camera(camera: &PosedCamera, orbit_distance_m: Option<f32>) -> Controls {
        let forward = -Vec3::from(camera.world_from_view.matrix3.z_axis);
        let (yaw, pitch) = angles(forward.normalize_or(Vec3::NEG_Z));
        let eye = camera.eye_world();
        let walk = Controls::Walk { eye: if eye.is_finite() { eye } else { Vec3::ZERO }, yaw, pitch };
        match orbit_distance_m {
            Some(distance) => walk.to_orbit(distance),
            None => walk,
        }
    }

    /// Takes over from a camera by hand: on foot inside of `bounds`, around their middle from outside.
    pub fn take_over(camera: &PosedCamera, bounds: &Aabb) -> Controls {
        let eye = camera.eye_world();
        let inside = eye.cmpge(bounds.min).all() && eye.cmple(bounds.max).all();
        Controls::from_camera(camera, (!inside).then_some(bounds.center().distance(eye)))
    }

    /// Circles the middle of `bounds`, all of which is in the picture: seen a little from above, along −Z.
    /// `yfov` is the vertical field of view (radians), `aspect` width / height. An empty box gives a view of the origin.
    pub fn fit(bounds: &Aabb, yfov: f32, aspect: f32) -> Controls {
        let usable = !bounds.is_empty() && bounds.min.is_finite() && bounds.max.is_finite();
        let (target, radius) = if usable {
            (0.5 * (bounds.min + bounds.max), 0.5 * (bounds.max - bounds.min).length())
        } else {
            (Vec3::ZERO, 1.0)
        };
        // The narrower of the two half-angles must hold the sphere around the box.
        let tangent = half_tangent(yfov) * aspect.clamp(0.01, 1.0);
        let sine = tangent / (1.0 + tangent * tangent).sqrt();
        Controls::Orbit { target, distance: clamp_distance(radius / sine), yaw: 0.0, pitch: -0.35 }
    }

    /// The camera, with a vertical field of view of `yfov` radians.
    pub fn camera(&self, yfov: f32) -> PosedCamera {
        let (right, up, forward) = self.axes();
        let near = match *self {
            Controls::Orbit { distance, .. } => NEAR_M.min(0.1 * distance),
            Controls::Walk { .. } => NEAR_M,
        };
        PosedCamera {
            world_from_view: Affine3A::from_mat3_translation(
                Mat3::from_cols(right, up, -forward),
                self.eye(),
            ),
            projection: Projection::Perspective { yfov, near },
        }
    }

    /// Where the eye is, in the world.
    pub fn eye(&self) -> Vec3 {
        match *self {
            Controls::Orbit { target, distance, .. } => target - distance * self.axes().2,
            Controls::Walk { eye, .. } => eye,
        }
    }

    /// Turns the view by angles in radians, as a pointer dragged right (`dx`) and down (`dy`) does: a walker looks to
    /// the right and down, an orbiting eye moves to the left and up, so that what it circles follows the pointer.
    pub fn rotate(&mut self, dx: f32, dy: f32) {
        let (Controls::Orbit { yaw, pitch, .. } | Controls::Walk { yaw, pitch, .. }) = self;
        if dx.is_finite() && dy.is_finite() {
            *yaw = wrap(*yaw - dx);
            *pitch = (*pitch - dy).clamp(-MAX_PITCH, MAX_PITCH);
        }
    }

    /// Moves sideways as a pointer does that drags the picture right (`dx`) and down (`dy`), in heights of the
    /// picture: what lies as far away as the target (a walker: 4 m) stays under the pointer.
    pub fn pan(&mut self, dx: f32, dy: f32, yfov: f32) {
        let reach = match *self {
            Controls::Orbit { distance, .. } => distance,
            Controls::Walk { .. } => WALK_REACH_M,
        };
        let (right, up, _) = self.axes();
        self.shift(2.0 * reach * half_tangent(yfov) * (dy * up - dx * right));
    }

    /// Comes closer (`factor` > 1) or goes back (0 < `factor` < 1): an orbiting eye divides its distance by it, a
    /// walker steps along its direction of view, by 4 m for a factor of *e*.
    pub fn zoom(&mut self, factor: f32) {
        if !(factor.is_finite() && factor > 0.0) {
            return;
        }
        match self {
            Controls::Orbit { distance, .. } => *distance = clamp_distance(*distance / factor),
            Controls::Walk { .. } => {
                let step = WALK_REACH_M * factor.ln() * self.axes().2;
                self.shift(step);
            }
        }
    }

    /// Walks for `dt_s` seconds with speeds in metres a second: ahead and to the right over level ground whatever the
    /// pitch, and straight up. An orbiting eye takes its target along.
    pub fn walk(&mut self, forward_m_s: f32, right_m_s: f32, up_m_s: f32, dt_s: f32) {
        let (right, _, forward) = self.axes();
        let ahead = Vec3::new(forward.x, 0.0, forward.z).normalize_or_zero();
        self.shift(dt_s * (forward_m_s * ahead + right_m_s * right + up_m_s * Vec3::Y));
    }

    /// The same view, circling the place `distance_m` in front of it.
    pub fn to_orbit(self, distance_m: f32) -> Controls {
        match self {
            Controls::Orbit { .. } => self,
            Controls::Walk { eye, yaw, pitch } => {
                let distance = clamp_distance(distance_m);
                Controls::Orbit { target: eye + distance * self.axes().2, distance, yaw, pitch }
            }
        }
    }

    /// The same view, on foot.
    pub fn to_walk(self) -> Controls {
        match self {
            Controls::Orbit { yaw, pitch, .. } => Controls::Walk { eye: self.eye(), yaw, pitch },
            Controls::Walk { .. } => self,
        }
    }

    /// Right, up and forward, in the world.
    fn axes(&self) -> (Vec3, Vec3, Vec3) {
        let (Controls::Orbit { yaw, pitch, .. } | Controls::Walk { yaw, pitch, .. }) = *self;
        let (turn, tilt) = (Vec2::from_angle(yaw), Vec2::from_angle(pitch));
        let right = Vec3::new(turn.x, 0.0, -turn.y);
        let forward = Vec3::new(-turn.y * tilt.x, tilt.y, -turn.x * tilt.x);
        (right, right.cross(forward), forward)
    }

    fn shift(&mut self, by: Vec3) {
        let (Controls::Orbit { target: place, .. } | Controls::Walk { eye: place, .. }) = self;
        let moved = *place + by;
        if moved.is_finite() {
            *place = moved;
        }
    }
}

/// Yaw and pitch of a direction of unit length.
fn angles(forward: Vec3) -> (f32, f32) {
    let level = Vec2::new(forward.x, forward.z).length();
    // Straight up or down has no yaw.
    let yaw = if level > 1e-6 { Vec2::new(-forward.z, -forward.x).to_angle() } else { 0.0 };
    (yaw, Vec2::new(level, forward.y).to_angle().clamp(-MAX_PITCH, MAX_PITCH))
}

/// An angle brought back to ±π, so that it keeps its digits however long one turns.
fn wrap(angle: f32) -> f32 {
    let turn = core::f32::consts::TAU;
    angle - turn * (angle / turn).round()
}

fn clamp_distance(distance: f32) -> f32 {
    let (least, largest) = DISTANCE_RANGE_M;
    if distance.is_finite() { distance.clamp(least, largest) } else { 1.0 }
}

/// Tangent of half a field of view, which is kept between 0.01 and 3.1 radians.
fn half_tangent(yfov: f32) -> f32 {
    let yfov = if yfov.is_finite() { yfov.clamp(0.01, 3.1) } else { 1.0 };
    let half = Vec2::from_angle(0.5 * yfov);
    half.y / half.x
}

#[cfg(test)]
mod tests {
    use super::*;

    const YFOV: f32 = 0.9;

    fn assert_near(a: Vec3, b: Vec3) {
        assert!((a - b).length() < 1e-4, "{a} {b}");
    }

    fn orbit() -> Controls {
        Controls::Orbit { target: Vec3::new(1.0, 2.0, 3.0), distance: 5.0, yaw: 0.4, pitch: -0.3 }
    }

    /// Where a place of the world is in the picture, x right, y up, −1 … 1.
    fn project(controls: &Controls, place: Vec3, aspect: f32) -> Vec2 {
        let camera = controls.camera(YFOV);
        let clip =
            camera.clip_from_view(aspect) * camera.view_from_world().transform_point3(place).extend(1.0);
        assert!(clip.w > 0.0, "{place} is behind the camera");
        Vec2::new(clip.x, clip.y) / clip.w
    }

    #[test]
    fn yaw_and_pitch_are_those_of_a_head() {
        let ahead = |yaw, pitch| Controls::Walk { eye: Vec3::ZERO, yaw, pitch }.axes().2;
        assert_near(ahead(0.0, 0.0), Vec3::NEG_Z);
        assert_near(ahead(core::f32::consts::FRAC_PI_2, 0.0), Vec3::NEG_X);
        assert!(ahead(0.0, 0.5).y > 0.4);
    }

    #[test]
    fn the_camera_is_the_one_that_looks_at_the_target() {
        let Controls::Orbit { target, distance, .. } = orbit() else { unreachable!() };
        let camera = orbit().camera(YFOV);
        let expected = PosedCamera::look_at(camera.eye_world(), target, YFOV);
        for (a, b) in [
            (camera.world_from_view.matrix3.x_axis, expected.world_from_view.matrix3.x_axis),
            (camera.world_from_view.matrix3.y_axis, expected.world_from_view.matrix3.y_axis),
            (camera.world_from_view.matrix3.z_axis, expected.world_from_view.matrix3.z_axis),
        ] {
            assert_near(a.into(), b.into());
        }
        assert!((camera.eye_world().distance(target) - distance).abs() < 1e-4);
    }

    #[test]
    fn a_camera_taken_over_gives_itself_back() {
        for target in [Vec3::new(3.0, 1.0, -2.0), Vec3::new(-1.0, 4.0, 0.5), Vec3::new(0.2, -3.0, 9.0)] {
            let camera = PosedCamera::look_at(Vec3::new(0.5, 1.5, 2.0), target, YFOV);
            for distance in [None, Some(7.0)] {
                let again = Controls::from_camera(&camera, distance).camera(YFOV);
                assert!(camera.world_from_view.abs_diff_eq(again.world_from_view, 1e-4), "{again:?}");
            }
        }
        // A camera that looks straight down is taken over just short of it.
        let down = PosedCamera::look_at(Vec3::Y, Vec3::ZERO, YFOV);
        let Controls::Walk { pitch, .. } = Controls::from_camera(&down, None) else { unreachable!() };
        assert_eq!(pitch, -MAX_PITCH);
    }

    #[test]
    fn changing_the_way_keeps_the_view() {
        let walk = orbit().to_walk();
        assert!(matches!(walk, Controls::Walk { .. }));
        let before = orbit().camera(YFOV).world_from_view;
        assert!(walk.camera(YFOV).world_from_view.abs_diff_eq(before, 1e-4));
        assert!(walk.to_orbit(2.0).camera(YFOV).world_from_view.abs_diff_eq(before, 1e-4));
    }

    #[test]
    fn what_an_eye_circles_follows_the_pointer() {
        let mut controls = Controls::Orbit { target: Vec3::ZERO, distance: 5.0, yaw: 0.0, pitch: 0.0 };
        let near_side = Vec3::new(0.0, 0.0, 1.0);
        controls.rotate(0.2, 0.1);
        let seen = project(&controls, near_side, 1.0);
        assert!(seen.x > 0.0 && seen.y < 0.0, "{seen}");
        assert_near(project(&controls, Vec3::ZERO, 1.0).extend(0.0), Vec3::ZERO);
    }

    #[test]
    fn pitch_stops_and_yaw_goes_round() {
        let mut controls = orbit();
        controls.rotate(0.0, 100.0);
        let Controls::Orbit { pitch, .. } = controls else { unreachable!() };
        assert_eq!(pitch, -MAX_PITCH);
        controls.rotate(core::f32::consts::TAU * 3.0, -100.0);
        let Controls::Orbit { yaw, pitch, .. } = controls else { unreachable!() };
        assert_eq!(pitch, MAX_PITCH);
        assert!((yaw - 0.4).abs() < 1e-4, "{yaw}");
    }

    #[test]
    fn panning_drags_the_target_with_the_pointer() {
        let Controls::Orbit { target, .. } = orbit() else { unreachable!() };
        let mut controls = orbit();
        controls.pan(0.25, 0.1, YFOV);
        // Half a picture is 1 in clip space, and its y goes up.
        let seen = project(&controls, target, 1.0);
        assert!((seen - Vec2::new(0.5, -0.2)).length() < 1e-3, "{seen}");
    }

    #[test]
    fn zooming_divides_the_distance_and_moves_a_walker() {
        let mut controls = orbit();
        controls.zoom(2.0);
        assert!(matches!(controls, Controls::Orbit { distance, .. } if distance == 2.5));
        controls.zoom(1e30);
        assert!(matches!(controls, Controls::Orbit { distance, .. } if distance == DISTANCE_RANGE_M.0));
        let mut walker = Controls::Walk { eye: Vec3::ZERO, yaw: 0.0, pitch: 0.0 };
        walker.zoom(core::f32::consts::E);
        assert_near(walker.eye(), Vec3::new(0.0, 0.0, -WALK_REACH_M));
        walker.zoom(1.0 / core::f32::consts::E);
        assert_near(walker.eye(), Vec3::ZERO);
    }

    #[test]
    fn walking_is_level_and_by_the_second() {
        let mut walker = Controls::Walk { eye: Vec3::ZERO, yaw: 0.0, pitch: -1.2 };
        walker.walk(2.0, 0.0, 0.0, 0.5);
        assert_near(walker.eye(), Vec3::new(0.0, 0.0, -1.0));
        walker.walk(0.0, 4.0, 1.0, 0.5);
        assert_near(walker.eye(), Vec3::new(2.0, 0.5, -1.0));
        let mut around = orbit();
        around.walk(0.0, 0.0, 3.0, 1.0);
        assert_near(around.eye(), orbit().eye() + 3.0 * Vec3::Y);
    }

    #[test]
    fn a_fitted_box_is_in_the_picture_and_fills_it() {
        let bounds = Aabb { min: Vec3::new(-3.0, 0.0, 2.0), max: Vec3::new(5.0, 2.0, 4.0) };
        for aspect in [16.0 / 9.0, 390.0 / 844.0] {
            let controls = Controls::fit(&bounds, YFOV, aspect);
            let mut widest = 0.0f32;
            for corner in 0..8 {
                let pick = |bit: u32| corner >> bit & 1 == 1;
                let choose = |bit, a: f32, b: f32| if pick(bit) { a } else { b };
                let place = Vec3::new(
                    choose(0, bounds.min.x, bounds.max.x),
                    choose(1, bounds.min.y, bounds.max.y),
                    choose(2, bounds.min.z, bounds.max.z),
                );
                let seen = project(&controls, place, aspect).abs();
                widest = widest.max(seen.max_element());
            }
            assert!((0.3..=1.0).contains(&widest), "{aspect} {widest}");
        }
        assert!(matches!(Controls::fit(&Aabb::EMPTY, YFOV, 1.0), Controls::Orbit { target: Vec3::ZERO, .. }));
    }

    #[test]
    fn numbers_that_are_not_finite_change_nothing() {
        for start in [orbit(), orbit().to_walk()] {
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                let mut controls = start;
                controls.rotate(bad, 0.0);
                controls.pan(0.0, bad, YFOV);
                controls.zoom(bad);
                controls.walk(bad, 0.0, 0.0, 0.1);
                assert_eq!(controls, start, "{bad}");
            }
            let mut controls = start;
            controls.zoom(0.0);
            controls.zoom(-1.0);
            assert_eq!(controls, start);
        }
    }
}
