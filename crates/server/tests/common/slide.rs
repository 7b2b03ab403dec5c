//! A scene of two instances, one of which slides over the other.

use std::sync::Arc;

use dapple_scene::glam::{Mat3, Vec3};
use dapple_scene::{
    Animation, Channel, ChannelTarget, Instance, Interpolation, Material, Mesh, Node, Part, Scene,
};

fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Mesh {
    let parts = vec![Part { first_triangle: 0, triangle_count: triangles.len() as u32, material: 0 }];
    Mesh { normals: vec![Vec3::Y; positions.len()], positions, triangles, parts, ..Mesh::default() }
}

/// A floor of 4 m × 4 m, and on it a box of half a metre that goes from x = −1 to 1 in two seconds.
pub(crate) fn scene() -> Arc<Scene> {
    let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32);
    let floor = [0, 4, 5, 1].map(|i| (corner(i) - 0.5) * Vec3::new(4.0, 0.0, 4.0));
    let cube = (0..8).map(|i| (corner(i) - Vec3::new(0.5, 0.0, 0.5)) * 0.5).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let instance = |i| Instance {
        node: i,
        mesh: i,
        skin: None,
        casts: true,
        emitter: Default::default(),
        receives: true,
        rest_from_mesh: Mat3::IDENTITY,
        spare: false,
    };
    Arc::new(Scene {
        nodes: vec![Node::default(), Node::default()],
        meshes: vec![
            mesh(floor.to_vec(), vec![[0, 1, 2], [0, 2, 3]]),
            mesh(cube, faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()),
        ],
        instances: vec![instance(0), instance(1)],
        materials: vec![Material::default()],
        animations: vec![Animation {
            name: "slide".into(),
            channels: vec![Channel {
                node: 1,
                target: ChannelTarget::Translation,
                interpolation: Interpolation::Linear,
                times: vec![0.0, 2.0],
                values: vec![-1.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            }],
        }],
        active_animation: Some(0),
        ..Scene::default()
    })
}
