//! Taking hold of a thing in the picture and moving it: from places of the picture to places in the world.

use dapple_scene::glam::{Affine3A, Mat3, Vec3};
use dapple_scene::{Edits, Placement, Pose, PosedCamera, Projection, Scene};

/// A surface that is seen flatter than this (sine of the angle) says nothing of where one points.
const LEAST_SLOPE: f32 = 0.03;

/// A thing follows to at most so many times its distance at once: near the horizon a pixel is a long way.
const FARTHEST: f32 = 4.0;

/// Which way a thing goes that is dragged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Over the horizontal plane through where it was taken.
    Across,
    /// Up and down.
    Upright,
}

/// A thing that is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grab {
    /// Index into [`Scene::nodes`].
    pub node: u32,
    /// Where the node stands now, in its parent's space.
    pub placement: Placement,
    /// The place of its surface that is held, metres.
    at_world: Vec3,
    parent_from_world: Mat3,
}

impl Grab {
    /// Takes hold of a node at a place of the world. `None` for one whose own transform cannot be said.
    pub fn new(scene: &Scene, edits: &Edits, pose: &Pose, node: u32, at_world: Vec3) -> Option<Grab> {
        let placement = placement_of(scene, edits, pose, node)?;
        let parent_from_world = Mat3::from(world_from_parent(scene, pose, node)?.matrix3).inverse();
        parent_from_world.is_finite().then_some(Grab { node, placement, at_world, parent_from_world })
    }

    /// Moves it so that the place that is held lies under `at` (pixels of a picture of `size` from its top left corner). False if it
    /// stays, because that says nothing.
    pub fn drag(&mut self, camera: &PosedCamera, size: (u32, u32), at: (f32, f32), way: Way) -> bool {
        let (origin, direction) = ray(camera, size, at);
        let normal = match way {
            Way::Across => Vec3::Y,
            Way::Upright => Vec3::new(direction.x, 0.0, direction.z).normalize_or_zero(),
        };
        let slope = direction.dot(normal);
        if slope.abs() < LEAST_SLOPE {
            return false;
        }
        let distance_m = (self.at_world - origin).dot(normal) / slope;
        let most_m = FARTHEST * self.at_world.distance(origin);
        if !(distance_m > 0.0 && distance_m <= most_m) {
            return false;
        }
        let mut way_world = origin + distance_m * direction - self.at_world;
        match way {
            Way::Across => way_world.y = 0.0,
            Way::Upright => way_world = way_world.y * Vec3::Y,
        }
        self.at_world += way_world;
        let translation = Vec3::from(self.placement.translation) + self.parent_from_world * way_world;
        self.placement.translation = translation.to_array();
        true
    }
}

/// Where a node stands in its parent's space. `None` where a translation, a rotation and a scale do not say that.
pub fn placement_of(scene: &Scene, edits: &Edits, pose: &Pose, node: u32) -> Option<Placement> {
    if let Some(placement) = edits.placed.get(&node) {
        return Some(*placement);
    }
    let world = pose.world_from_node.get(node as usize)?;
    let local = world_from_parent(scene, pose, node)?.inverse() * *world;
    let (scale, rotation, translation) = local.to_scale_rotation_translation();
    let is_sound = scale.is_finite() && rotation.is_finite() && translation.is_finite();
    is_sound.then(|| Placement {
        translation: translation.to_array(),
        rotation: rotation.normalize().to_array(),
        scale: scale.to_array(),
    })
}

/// A placement that lies so far away in the world, metres.
pub fn moved(
    scene: &Scene,
    pose: &Pose,
    node: u32,
    placement: &Placement,
    way_world: Vec3,
) -> Option<Placement> {
    let parent_from_world = Mat3::from(world_from_parent(scene, pose, node)?.matrix3).inverse();
    let translation = Vec3::from(placement.translation) + parent_from_world * way_world;
    translation.is_finite().then_some(Placement { translation: translation.to_array(), ..*placement })
}

fn world_from_parent(scene: &Scene, pose: &Pose, node: u32) -> Option<Affine3A> {
    match scene.nodes.get(node as usize)?.parent {
        Some(parent) => pose.world_from_node.get(parent as usize).copied(),
        None => Some(Affine3A::IDENTITY),
    }
}

/// From where, and in which direction (a unit vector), one looks at a place of the picture.
fn ray(camera: &PosedCamera, size: (u32, u32), at: (f32, f32)) -> (Vec3, Vec3) {
    let (width, height) = (size.0 as f32, size.1 as f32);
    // From the middle to the right and up, in halves of the height.
    let (right, up) = ((2.0 * at.0 - width) / height, (height - 2.0 * at.1) / height);
    let (from, to) = match camera.projection {
        Projection::Perspective { yfov, .. } => {
            let half = (0.5 * yfov).tan();
            (Vec3::ZERO, Vec3::new(half * right, half * up, -1.0))
        }
        Projection::Orthographic { half_height, .. } => {
            (half_height * Vec3::new(right, up, 0.0), Vec3::NEG_Z)
        }
    };
    let world = &camera.world_from_view;
    (world.transform_point3(from), world.transform_vector3(to).normalize_or_zero())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use dapple_scene::{NoFiles, builtin};

    use super::*;

    const SIZE: (u32, u32) = (200, 100);

    fn scene() -> Scene {
        dapple_scene::load("lab.glb", &builtin::glb("lab", 0.02).unwrap(), &NoFiles).unwrap()
    }

    /// The pixel at which a place is seen.
    fn pixel(camera: &PosedCamera, place: Vec3) -> (f32, f32) {
        let Projection::Perspective { yfov, .. } = camera.projection else { panic!("perspective") };
        let view = camera.world_from_view.inverse().transform_point3(place);
        let half = (0.5 * yfov).tan() * -view.z;
        let (width, height) = (SIZE.0 as f32, SIZE.1 as f32);
        (0.5 * (width + height * view.x / half), 0.5 * (height - height * view.y / half))
    }

    #[test]
    fn what_is_held_stays_under_the_hand() {
        let scene = scene();
        let edits = Edits::new(&scene);
        let pose = scene.pose_edited(0.0, &edits);
        let camera = PosedCamera::look_at(Vec3::new(0.5, 3.0, 5.0), Vec3::ZERO, 0.9);
        for node in scene.instances.iter().map(|instance| instance.node) {
            let at = Vec3::new(0.2, 0.4, -0.3);
            let mut grab = Grab::new(&scene, &edits, &pose, node, at).unwrap();
            let targets = [
                (Way::Across, Vec3::new(1.0, 0.4, 1.0)),
                (Way::Upright, Vec3::new(1.0, 1.1, 1.0)),
                (Way::Across, Vec3::new(-0.5, 1.1, 0.0)),
            ];
            let mut moved = edits.clone();
            for (way, target) in targets {
                assert!(grab.drag(&camera, SIZE, pixel(&camera, target), way));
                let edit = dapple_scene::Edit::Place { node, placement: grab.placement };
                moved.apply(&scene, &edit).unwrap();
                let now = scene.pose_edited(0.0, &moved);
                let [before, after] = [&pose, &now]
                    .map(|pose| pose.world_from_node[node as usize].transform_point3(Vec3::ZERO));
                assert!((after - before).distance(target - at) < 1e-3, "{node} {way:?}: {before} {after}");
            }
        }
    }

    #[test]
    fn the_sky_moves_nothing() {
        let scene = scene();
        let edits = Edits::new(&scene);
        let pose = scene.pose_edited(0.0, &edits);
        let camera = PosedCamera::look_at(Vec3::new(0.0, 1.0, 5.0), Vec3::new(0.0, 1.0, 0.0), 0.9);
        let mut grab = Grab::new(&scene, &edits, &pose, scene.instances[0].node, Vec3::ZERO).unwrap();
        let before = grab;
        for at in [(100.0, 0.0), (100.0, 50.0), (100.0, 50.5)] {
            assert!(!grab.drag(&camera, SIZE, at, Way::Across), "{at:?}");
        }
        let down = PosedCamera::look_at(Vec3::new(0.0, 5.0, 0.0), Vec3::ZERO, 0.9);
        assert!(!grab.drag(&down, SIZE, (100.0, 50.0), Way::Upright));
        assert_eq!(grab, before);
    }

    #[test]
    fn a_placement_says_where_a_node_stands() {
        let scene = scene();
        let edits = Edits::new(&scene);
        let pose = scene.pose_edited(1.3, &edits);
        let mut placed = edits.clone();
        for node in scene.instances.iter().map(|instance| instance.node) {
            let placement = placement_of(&scene, &edits, &pose, node).unwrap();
            placed.apply(&scene, &dapple_scene::Edit::Place { node, placement }).unwrap();
        }
        let again = scene.pose_edited(1.3, &placed);
        for instance in &scene.instances {
            let [a, b] = [&pose, &again].map(|pose| pose.world_from_node[instance.node as usize]);
            assert!(a.abs_diff_eq(b, 1e-3), "{}: {a} {b}", scene.nodes[instance.node as usize].name);
        }
    }
}
