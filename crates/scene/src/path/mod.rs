//! Ways to look at a scene: the cameras of the file, a computed orbit that always exists, and paths of keys.

mod file;
mod keys;
mod orbit;

use std::sync::Arc;

use crate::{Animation, Pose, PosedCamera, Scene};

pub use file::{MAX_PATH_BYTES, PathError};
pub use keys::{Aim, Blend, CameraKey, KeyedPath, MAX_KEYS, MAX_NAME_BYTES};
pub use orbit::Orbit;
use orbit::{ORBIT_PERIOD_S, orbit};

/// A camera that may move, by name.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPath {
    /// The camera node's name, `orbit`, or that of the keys. Unique within a scene's list: repetitions get a number.
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
    /// Keys that are not the scene's own: recorded, or read from a file.
    Keys(Arc<KeyedPath>),
}

impl From<KeyedPath> for CameraPath {
    fn from(keys: KeyedPath) -> CameraPath {
        let (name, duration_s) = (keys.name().to_owned(), keys.duration_s());
        CameraPath { name, source: CameraSource::Keys(Arc::new(keys)), duration_s }
    }
}

impl CameraPath {
    /// Seconds after which the path repeats, or ends if it is of keys that do not repeat; 0 for a camera that stands still.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// The camera at the time of `pose`, which must be a pose of `scene`, from whose list this path came (unless it is of
    /// keys, which fit any scene).
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
            CameraSource::Keys(keys) => keys.camera(pose.time),
        }
    }
}

impl Scene {
    /// All ways to look at the scene: cameras the active animation moves, in node order; then cameras that stand
    /// still; then a computed `orbit`, always the last. A camera that only another animation moves stands still:
    /// [`Scene::animations_of_camera`] tells which do.
    pub fn camera_paths(&self) -> Vec<CameraPath> {
        let animation = self.active_animation.and_then(|i| self.animations.get(i as usize));
        let duration_s = animation.map_or(0.0, |animation| f64::from(animation.duration()));
        let moves = self.moved_nodes(animation);
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

    /// Indices of the animations that move the camera of a path; none if it is not a camera of the file.
    pub fn animations_of_camera(&self, path: &CameraPath) -> Vec<u32> {
        let (CameraSource::Animated { node } | CameraSource::Still { node }) = path.source else {
            return Vec::new();
        };
        let moves =
            |animation: &Animation| self.moved_nodes(Some(animation)).get(node as usize) == Some(&true);
        (0..)
            .zip(&self.animations)
            .filter(|(_, animation)| moves(animation))
            .map(|(index, _)| index)
            .collect()
    }

    /// Which nodes an animation moves, by themselves or with a parent.
    fn moved_nodes(&self, animation: Option<&Animation>) -> Vec<bool> {
        let mut moves = vec![false; self.nodes.len()];
        for channel in animation.iter().flat_map(|animation| &animation.channels) {
            let rigid = channel.target != crate::ChannelTarget::MorphWeights;
            moves[channel.node as usize] |= rigid && channel.times.len() > 1;
        }
        for (i, node) in self.nodes.iter().enumerate() {
            moves[i] |= node.parent.is_some_and(|parent| moves[parent as usize]);
        }
        moves
    }
}

fn free_name(paths: &[CameraPath], name: &str) -> String {
    let taken = |name: &str| paths.iter().any(|path| path.name == name);
    let numbered = (2..).map(|n| format!("{name} {n}"));
    std::iter::once(name.to_owned()).chain(numbered).find(|name| !taken(name)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::orbit::TURNTABLE_RADII;
    use super::*;
    use crate::{Aabb, Camera, Instance, LocalTransform, Material, Mesh, Node, Part, Projection};
    use glam::{Mat3, Vec3};

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
            emitter: Default::default(),
            receives: true,
            rest_from_mesh: Mat3::IDENTITY,
            spare: false,
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
