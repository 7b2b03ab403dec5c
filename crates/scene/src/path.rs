//! Ways to look at a scene: the cameras of the file, and a computed orbit that always exists.

use glam::{Vec2, Vec3};

use crate::{Aabb, Pose, PosedCamera, Projection, Scene};

/// Vertical field of view of the computed orbit, radians (50°).
const ORBIT_YFOV: f32 = 0.873;
/// Seconds for one turn of the computed orbit.
const ORBIT_PERIOD_S: f64 = 20.0;
/// Distance of the orbit around an object, in bounding radii: just fits the sphere into the field of view.
const TURNTABLE_RADII: f32 = 2.4;
/// Elevation of the orbit around an object, radians (20°).
const TURNTABLE_ELEVATION: f32 = 0.349;
/// Free distance that makes a place a room, as a part of the scene's diagonal.
const MIN_FREE_OF_DIAGONAL: f32 = 0.05;
/// Hollow things with an outside are objects below this diagonal.
const BUILDING_DIAGONAL_M: f32 = 10.0;
/// Places that are tried for the middle of a room.
const PLACES: usize = 9;
/// Rays sent from each.
const RAYS: usize = 14;
/// Height of eyes above the floor, metres.
const EYE_HEIGHT_M: f32 = 1.7;

/// A camera that may move, by name.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPath {
    /// The camera node's name, or `orbit`. Unique within a scene's list: repetitions get a number.
    pub name: String,
    /// Where it comes from.
    pub source: CameraSource,
    duration_s: f64,
}

/// Where a camera path comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraSource {
    /// A camera of the file that the active animation moves.
    Animated {
        /// Index into [`Scene::nodes`].
        node: u32,
    },
    /// A camera of the file that stands still.
    Still {
        /// Index into [`Scene::nodes`].
        node: u32,
    },
    /// Computed from the scene's bounds.
    Orbit(Orbit),
}

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

impl CameraPath {
    /// Seconds after which the path repeats; 0 for a camera that stands still.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// The camera at the time of `pose`, which must be a pose of `scene`, from whose list this path came.
    pub fn camera(&self, scene: &Scene, pose: &Pose) -> PosedCamera {
        match &self.source {
            CameraSource::Animated { node } | CameraSource::Still { node } => {
                // Poses list cameras in node order.
                let before = scene.nodes.iter().take(*node as usize).filter(|n| n.camera.is_some()).count();
                match pose.cameras.get(before) {
                    Some((_, camera)) => *camera,
                    None => orbit(scene).at(pose.time),
                }
            }
            CameraSource::Orbit(orbit) => orbit.at(pose.time),
        }
    }
}

impl Orbit {
    fn at(&self, time_s: f64) -> PosedCamera {
        let time_s = if time_s.is_finite() { time_s } else { 0.0 };
        let turn = (time_s.rem_euclid(ORBIT_PERIOD_S) / ORBIT_PERIOD_S) as f32;
        let side = Vec2::from_angle(turn * std::f32::consts::TAU);
        let eye = self.center_world + self.radius_m * Vec3::new(side.y, 0.0, side.x);
        let mut camera = PosedCamera::look_at(eye, self.target_world, ORBIT_YFOV);
        camera.projection = Projection::Perspective { yfov: ORBIT_YFOV, near: self.near_m };
        camera
    }
}

impl Scene {
    /// All ways to look at the scene: cameras the active animation moves, in node order; then cameras that stand
    /// still; then a computed `orbit`, always the last.
    pub fn camera_paths(&self) -> Vec<CameraPath> {
        let animation = self.active_animation.and_then(|i| self.animations.get(i as usize));
        let duration_s = animation.map_or(0.0, |animation| f64::from(animation.duration()));
        let mut moves = vec![false; self.nodes.len()];
        for channel in animation.iter().flat_map(|animation| &animation.channels) {
            let rigid = channel.target != crate::ChannelTarget::MorphWeights;
            moves[channel.node as usize] |= rigid && channel.times.len() > 1;
        }
        for (i, node) in self.nodes.iter().enumerate() {
            moves[i] |= node.parent.is_some_and(|parent| moves[parent as usize]);
        }
        let mut paths: Vec<CameraPath> = Vec::new();
        for animated in [true, false] {
            for (i, node) in self.nodes.iter().enumerate() {
                if node.camera.is_some() && moves[i] == animated {
                    let node_index = i as u32;
                    let (source, duration_s) = match animated {
                        true => (CameraSource::Animated { node: node_index }, duration_s),
                        false => (CameraSource::Still { node: node_index }, 0.0),
                    };
                    paths.push(CameraPath { name: free_name(&paths, &node.name), source, duration_s });
                }
            }
        }
        let source = CameraSource::Orbit(orbit(self));
        paths.push(CameraPath { name: free_name(&paths, "orbit"), source, duration_s: ORBIT_PERIOD_S });
        paths
    }
}

fn free_name(paths: &[CameraPath], name: &str) -> String {
    let taken = |name: &str| paths.iter().any(|path| path.name == name);
    let numbered = (2..).map(|n| format!("{name} {n}"));
    std::iter::once(name.to_owned()).chain(numbered).find(|name| !taken(name)).unwrap_or_default()
}

/// The computed orbit: inside the scene if there is a room about its middle, else around it.
///
/// From nine places 14 rays go out. A place is in a room if at least three in five of them first meet a front face (the
/// inside of a solid object shows back faces) and if it has some room to the sides. A hollow thing that is smaller
/// than a building and whose outside is modelled too is an object all the same. In the roomiest place the camera
/// walks a small circle and looks across it.
fn orbit(scene: &Scene) -> Orbit {
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

/// Places where the middle of a room may be: three heights at the centre and half way to both ends.
fn candidate_places(bounds: &Aabb) -> [Vec3; PLACES] {
    let size = bounds.max - bounds.min;
    // Scenes whose units are not metres have no sensible eye height.
    let eye = if (2.0..40.0).contains(&size.y) { EYE_HEIGHT_M } else { 0.35 * size.y };
    let aside = if size.x >= size.z { 0.25 * size.x * Vec3::X } else { 0.25 * size.z * Vec3::Z };
    let floor = Vec3::new(bounds.center().x, bounds.min.y, bounds.center().z);
    std::array::from_fn(|i| {
        let height = [eye, 0.25 * size.y, 0.5 * size.y][i % 3];
        floor + height * Vec3::Y + [0.0, 1.0, -1.0][i / 3] * aside
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, Instance, LocalTransform, Material, Mesh, Node, Part};
    use glam::Mat3;

    /// A box from −1 to 1 whose faces look outwards or inwards.
    fn cube(inwards: bool) -> Scene {
        let positions = (0..8).map(|i| {
            let at = |bit: i32| if i & bit == 0 { -1.0 } else { 1.0 };
            Vec3::new(at(1), at(2), at(4))
        });
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let mut triangles: Vec<[u32; 3]> =
            quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        if inwards {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        let mesh = Mesh {
            positions: positions.collect(),
            normals: vec![Vec3::Y; 8],
            parts: vec![Part { first_triangle: 0, triangle_count: 12, material: 0 }],
            triangles,
            ..Mesh::default()
        };
        let instance = Instance {
            node: 0,
            mesh: 0,
            skin: None,
            casts: true,
            receives: true,
            rest_from_mesh: Mat3::IDENTITY,
        };
        Scene {
            nodes: vec![Node::default()],
            meshes: vec![mesh],
            instances: vec![instance],
            materials: vec![Material::default()],
            ..Scene::default()
        }
    }

    #[test]
    fn orbit_is_inside_rooms_and_around_objects() {
        for (inwards, inside) in [(true, true), (false, false)] {
            let scene = cube(inwards);
            let paths = scene.camera_paths();
            let [path] = &paths[..] else { panic!("{paths:?}") };
            assert_eq!(path.name, "orbit");
            let bounds = Aabb { min: Vec3::NEG_ONE, max: Vec3::ONE };
            for time in [0.0, 3.0, 7.0, 19.0] {
                let pose = scene.pose(time);
                let camera = path.camera(&scene, &pose);
                assert_eq!(bounds.distance_squared(camera.eye_world()) == 0.0, inside, "at {time}");
                let forward = -camera.world_from_view.matrix3.z_axis;
                let to_middle = Vec3::ZERO - camera.eye_world();
                assert!(Vec3::from(forward).dot(to_middle) > 0.0);
                if !inside {
                    assert!((to_middle.length() - TURNTABLE_RADII * 3_f32.sqrt()).abs() < 1e-4);
                }
            }
        }
    }

    #[test]
    fn cameras_of_the_file_come_first() {
        let mut scene = cube(true);
        let at = |x| LocalTransform::Trs {
            translation: Vec3::new(x, 0.0, 0.0),
            rotation: glam::Quat::IDENTITY,
            scale: Vec3::splat(2.0),
        };
        let node =
            |name: &str, x| Node { name: name.into(), local: at(x), camera: Some(0), ..Node::default() };
        scene.nodes.extend([node("still", 1.0), node("still", 2.0), node("moving", 3.0)]);
        let projection = Projection::Perspective { yfov: 1.0, near: 0.1 };
        scene.cameras.push(Camera { name: "lens".into(), projection });
        scene.animations.push(crate::Animation {
            name: String::new(),
            channels: vec![crate::Channel {
                node: 3,
                target: crate::ChannelTarget::Translation,
                interpolation: crate::Interpolation::Linear,
                times: vec![0.0, 2.0],
                values: vec![0.0, 0.0, 0.0, 4.0, 0.0, 0.0],
            }],
        });
        scene.active_animation = Some(0);
        let paths = scene.camera_paths();
        let names: Vec<&str> = paths.iter().map(|path| path.name.as_str()).collect();
        assert_eq!(names, ["moving", "still", "still 2", "orbit"]);
        assert_eq!(paths[0].duration_s(), 2.0);
        assert_eq!(paths[1].duration_s(), 0.0);
        let pose = scene.pose(1.0);
        assert_eq!(paths[0].camera(&scene, &pose).eye_world(), Vec3::new(2.0, 0.0, 0.0));
        let still = paths[2].camera(&scene, &pose);
        assert_eq!(still.eye_world(), Vec3::new(2.0, 0.0, 0.0));
        assert!(still.world_from_view.matrix3.determinant() - 1.0 < 1e-6, "scale does not reach the camera");
    }

    #[test]
    fn an_empty_scene_has_an_orbit() {
        let scene = Scene::default();
        let paths = scene.camera_paths();
        assert!(paths[0].camera(&scene, &scene.pose(1.0)).world_from_view.is_finite());
    }
}
