//! Two made scenes that ask whether light leaks through thin walls.

use dapple_scene::glam::{Mat3, Vec3};
use dapple_scene::{Instance, Material, Mesh, Node, Part, Scene};

/// Turn of the wall about the vertical: no grid of anything runs along it.
const TURN_DEGREES: f32 = 17.0;
/// Thickness of the wall, metres.
pub(super) const WALL_M: f32 = 0.02;
/// Places so near to a wall's face count for the leak score.
pub(super) const NEAR_M: f32 = 0.11;

/// A scene with one wall through the origin of its floor (instance 0), and which places count as near it.
pub(super) struct ThinScene {
    pub(super) name: &'static str,
    pub(super) scene: Scene,
}

/// Which side of the wall a place of the floor lies on, if it is near.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    /// Under the shelf.
    Dark,
    /// In the open.
    Open,
}

impl ThinScene {
    /// A floor of 4 × 4 m, on it a wall 2 cm thick and 3 m long, turned by 17°, and behind it a shelf 10 cm above the
    /// floor that keeps that side dark.
    pub(super) fn shelf() -> ThinScene {
        let mut scene = bare("thin wall");
        add(&mut scene, floor(2.0));
        add(&mut scene, turned_box(Vec3::new(0.0, 0.5, 0.0), Vec3::new(1.5, 0.5, 0.5 * WALL_M)));
        add(&mut scene, turned_box(Vec3::new(0.0, 0.11, -0.31), Vec3::new(1.5, 0.01, 0.3)));
        ThinScene { name: "thin wall", scene }
    }

    /// A room with a partition of 2 cm and boards of 1.6 cm on both of its sides, higher on one than on the other.
    pub(super) fn shelves() -> ThinScene {
        let mut scene = bare("shelves");
        add(&mut scene, floor(2.0));
        add(&mut scene, turned_box(Vec3::new(0.0, 1.0, 0.0), Vec3::new(1.5, 1.0, 0.5 * WALL_M)));
        for i in 0..5 {
            let height = 0.12 + 0.32 * i as f32;
            add(&mut scene, turned_box(Vec3::new(0.0, height, -0.21), Vec3::new(1.5, 0.008, 0.2)));
            add(&mut scene, turned_box(Vec3::new(0.0, height + 0.21, 0.26), Vec3::new(1.2, 0.008, 0.25)));
        }
        for side in [-1.0, 1.0] {
            add(&mut scene, turned_box(Vec3::new(1.51 * side, 1.0, 0.0), Vec3::new(0.008, 1.0, 0.5)));
        }
        ThinScene { name: "shelves", scene }
    }

    /// Where a place of the floor lies. Under the wall itself, beyond its ends, and elsewhere: nowhere.
    pub(super) fn side(&self, instance: u32, position_world: Vec3) -> Option<Side> {
        let local = turn().transpose() * position_world;
        let beyond = local.z.abs() - 0.5 * WALL_M;
        if instance != 0 || local.x.abs() > 1.3 || !(0.0..NEAR_M).contains(&beyond) {
            return None;
        }
        Some(if local.z < 0.0 { Side::Dark } else { Side::Open })
    }
}

fn bare(name: &str) -> Scene {
    Scene { name: name.to_owned(), materials: vec![Material::default()], ..Scene::default() }
}

fn turn() -> Mat3 {
    Mat3::from_rotation_y(TURN_DEGREES.to_radians())
}

/// An instance at the origin, mesh space being the world's.
fn add(scene: &mut Scene, mut mesh: Mesh) {
    mesh.parts = vec![Part { first_triangle: 0, triangle_count: mesh.triangles.len() as u32, material: 0 }];
    scene.nodes.push(Node::default());
    scene.instances.push(Instance {
        node: scene.nodes.len() as u32 - 1,
        mesh: scene.meshes.len() as u32,
        skin: None,
        casts: true,
        emitter: Default::default(),
        receives: true,
        rest_from_mesh: Mat3::IDENTITY,
        spare: false,
    });
    scene.meshes.push(mesh);
}

/// A square around the origin, facing up.
fn floor(half: f32) -> Mesh {
    let corner = |x: f32, z: f32| Vec3::new(x * half, 0.0, z * half);
    quad(Mesh::default(), [corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)])
}

/// A box by its middle and half sides, turned with the wall.
fn turned_box(middle: Vec3, half: Vec3) -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for sign in [-1.0f32, 1.0] {
            let unit =
                |i: usize| Vec3::from_array(std::array::from_fn(|k| if k == i % 3 { 1.0 } else { 0.0 }));
            let normal = unit(axis) * sign;
            let right = unit(axis + 1);
            let up = normal.cross(right);
            let corner = |r: f32, u: f32| turn() * (middle + (normal + right * r + up * u) * half);
            mesh = quad(mesh, [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
        }
    }
    mesh
}

/// Adds a quad, counter-clockwise from the front.
fn quad(mut mesh: Mesh, corners: [Vec3; 4]) -> Mesh {
    let first = mesh.positions.len() as u32;
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
    mesh.positions.extend(corners);
    mesh.normals.extend([normal; 4]);
    mesh.triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t| t.map(|v| v + first)));
    mesh
}
