//! The computed orbit: inside rooms, around objects.

use glam::{Vec2, Vec3};

use crate::{Aabb, Pose, PosedCamera, Projection, Scene};

/// Vertical field of view of the computed orbit, radians (50°).
const ORBIT_YFOV: f32 = 0.873;
/// Seconds for one turn of the computed orbit.
pub(super) const ORBIT_PERIOD_S: f64 = 20.0;
/// Distance of the orbit around an object, in bounding radii: just fits the sphere into the field of view.
pub(super) const TURNTABLE_RADII: f32 = 2.4;
/// Elevation of the orbit around an object, radians (20°).
const TURNTABLE_ELEVATION: f32 = 0.349;
/// Free distance that makes a place a room, as a part of the scene's diagonal.
const MIN_FREE_OF_DIAGONAL: f32 = 0.05;
/// Hollow things with an outside are objects below this diagonal.
const BUILDING_DIAGONAL_M: f32 = 10.0;
/// Places that are tried for the middle of a room.
const PLACES: usize = 12;
/// Rays sent from each.
const RAYS: usize = 14;
/// Height of eyes above the floor, metres.
const EYE_HEIGHT_M: f32 = 1.7;

/// A circle walked once in 20 seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Centre of the circle.
    pub center_world: Vec3,
    /// Radius of the circle, metres; the circle is horizontal.
    pub radius_m: f32,
    /// What the camera looks at, if the orbit is around an object. Inside a building it looks along the
    /// horizontal line through the centre, so that the far walls fill the picture.
    pub target_world: Vec3,
    /// Near plane distance, metres.
    pub near_m: f32,
}

impl Orbit {
    pub(super) fn at(&self, time_s: f64) -> PosedCamera {
        let time_s = if time_s.is_finite() { time_s } else { 0.0 };
        let turn = (time_s.rem_euclid(ORBIT_PERIOD_S) / ORBIT_PERIOD_S) as f32;
        let side = Vec2::from_angle(turn * std::f32::consts::TAU);
        let eye = self.center_world + self.radius_m * Vec3::new(side.y, 0.0, side.x);
        let mut camera = PosedCamera::look_at(eye, self.target_world, ORBIT_YFOV);
        camera.projection = Projection::Perspective { yfov: ORBIT_YFOV, near: self.near_m };
        camera
    }
}

/// The computed orbit: inside the scene if there is a room about its middle, else around it.
///
/// From twelve places 14 rays go out. A place is in a room if at least three in five of them first meet a front face (the
/// inside of a solid object shows back faces) and if it has some room to the sides. A hollow thing that is smaller
/// than a building and whose outside is modelled too is an object all the same. In the roomiest place the camera
/// walks a small circle and looks across it.
pub(super) fn orbit(scene: &Scene) -> Orbit {
    let pose = scene.pose(0.0);
    let bounds = scene.bounds_world(&pose);
    if bounds.is_empty() {
        let center_world = Vec3::new(0.0, 1.0, 0.0);
        return Orbit { center_world, radius_m: 3.0, target_world: Vec3::ZERO, near_m: 0.02 };
    }
    let diagonal = bounds.diagonal();
    let near_m = (1e-3 * diagonal).clamp(1e-6, 0.1);
    let places = candidate_places(&bounds);
    let mut best: Option<(Vec3, f32)> = None;
    for (place, views) in places.into_iter().zip(look_around(scene, &pose, &places)) {
        let most = |count: usize| 5 * count >= 3 * RAYS;
        let walls = views.iter().filter(|view| view.nearest_is_front).count();
        let hull = views.iter().filter(|view| view.farthest_is_front).count();
        let free_m =
            views.iter().filter(|view| !view.is_vertical).fold(diagonal, |free, view| free.min(view.nearest));
        let is_room = most(walls) && free_m >= MIN_FREE_OF_DIAGONAL * diagonal;
        let is_shell = most(hull) && diagonal < BUILDING_DIAGONAL_M;
        if is_room && !is_shell && best.is_none_or(|(_, most_free_m)| free_m > most_free_m) {
            best = Some((place, free_m));
        }
    }
    if let Some((place, free_m)) = best {
        return Orbit { center_world: place, radius_m: 0.4 * free_m, target_world: place, near_m };
    }
    // Animated objects move out of their first box.
    let whole = scene.animations.get(scene.active_animation.unwrap_or(u32::MAX) as usize).map_or(
        bounds,
        |animation| {
            let duration = f64::from(animation.duration());
            [0.25, 0.5, 0.75]
                .into_iter()
                .map(|part| scene.bounds_world(&scene.pose(part * duration)))
                .fold(bounds, Aabb::union)
        },
    );
    let distance = (TURNTABLE_RADII * 0.5 * whole.diagonal()).max(1e-3);
    let elevation = Vec2::from_angle(TURNTABLE_ELEVATION);
    Orbit {
        center_world: whole.center() + distance * elevation.y * Vec3::Y,
        radius_m: distance * elevation.x,
        target_world: whole.center(),
        near_m,
    }
}

/// Places where the middle of a room may be: four heights at the centre and half way to both ends.
fn candidate_places(bounds: &Aabb) -> [Vec3; PLACES] {
    let size = bounds.max - bounds.min;
    // Scenes whose units are not metres have no sensible eye height.
    let eye = if (2.0..40.0).contains(&size.y) { EYE_HEIGHT_M } else { 0.35 * size.y };
    let aside = if size.x >= size.z { 0.25 * size.x * Vec3::X } else { 0.25 * size.z * Vec3::Z };
    let floor = Vec3::new(bounds.center().x, bounds.min.y, bounds.center().z);
    std::array::from_fn(|i| {
        let height = [eye, 0.25 * size.y, 0.5 * size.y, 0.65 * size.y][i % 4];
        floor + height * Vec3::Y + [0.0, 1.0, -1.0][i / 4] * aside
    })
}

/// What one ray meets.
#[derive(Clone, Copy)]
struct View {
    /// Distance of the first triangle, infinite without one.
    nearest: f32,
    nearest_is_front: bool,
    /// Distance of the last triangle.
    farthest: f32,
    /// Whether the last triangle is seen from its front by who looks back from beyond it.
    farthest_is_front: bool,
    is_vertical: bool,
}

/// Rays along the axes and space diagonals from each place, against every triangle.
fn look_around(scene: &Scene, pose: &Pose, places: &[Vec3; PLACES]) -> [[View; RAYS]; PLACES] {
    let mut directions = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z].to_vec();
    for i in 0..8 {
        let sign = |bit: i32| if i & bit == 0 { 1.0 } else { -1.0 };
        // Flatter than cube corners, and off the symmetry planes of what people build.
        directions.push(Vec3::new(sign(1) * 0.9, sign(2) * 0.45, sign(4) * 0.8).normalize());
    }
    let nothing = View {
        nearest: f32::INFINITY,
        nearest_is_front: false,
        farthest: 0.0,
        farthest_is_front: false,
        is_vertical: false,
    };
    let mut views = [[nothing; RAYS]; PLACES];
    for view in &mut views {
        for (view, direction) in view.iter_mut().zip(&directions) {
            view.is_vertical = direction.y.abs() == 1.0;
        }
    }
    for (i, (instance, posed)) in scene.instances.iter().zip(&pose.instances).enumerate() {
        let mesh = &scene.meshes[instance.mesh as usize];
        let positions = scene.vertex_positions(pose, i);
        let mirrored = posed.world_from_mesh.matrix3.determinant() < 0.0;
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|v| posed.world_from_mesh.transform_point3(positions[v as usize]));
            let normal = (b - a).cross(c - a);
            let bounds = Aabb::from_points([a, b, c]);
            for (place, views) in places.iter().zip(&mut views) {
                for (view, direction) in views.iter_mut().zip(&directions) {
                    if let Some(distance) = hit(*place, *direction, [a, b, c], normal, &bounds) {
                        let is_front = (normal.dot(*direction) < 0.0) != mirrored;
                        if distance < view.nearest {
                            (view.nearest, view.nearest_is_front) = (distance, is_front);
                        }
                        if distance > view.farthest {
                            (view.farthest, view.farthest_is_front) = (distance, !is_front);
                        }
                    }
                }
            }
        }
    }
    views
}

fn hit(origin: Vec3, direction: Vec3, [a, b, c]: [Vec3; 3], normal: Vec3, bounds: &Aabb) -> Option<f32> {
    let ahead = (bounds.max - origin).cmpge(Vec3::ZERO) | direction.cmplt(Vec3::ZERO);
    let behind = (bounds.min - origin).cmple(Vec3::ZERO) | direction.cmpgt(Vec3::ZERO);
    if !(ahead & behind).all() {
        return None;
    }
    let slope = normal.dot(direction);
    if slope == 0.0 {
        return None;
    }
    let distance = normal.dot(a - origin) / slope;
    if !(distance > 0.0 && distance.is_finite()) {
        return None;
    }
    let p = origin + distance * direction;
    let inside = |u: Vec3, v: Vec3| (v - u).cross(p - u).dot(normal) >= 0.0;
    (inside(a, b) && inside(b, c) && inside(c, a)).then_some(distance)
}
