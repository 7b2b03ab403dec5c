//! Posing against cases computed by hand.

use glam::{Affine3A, Mat3, Quat, Vec3};

use crate::{
    Animation, Channel, ChannelTarget, Instance, Interpolation, LocalTransform, Material, Mesh, MorphTarget,
    Node, Part, Scene, Skin, SkinInfluences,
};

fn trs(translation: Vec3, rotation: Quat, scale: Vec3) -> LocalTransform {
    LocalTransform::Trs { translation, rotation, scale }
}

fn node(parent: Option<u32>, local: LocalTransform) -> Node {
    Node { parent, local, ..Node::default() }
}

fn triangle() -> Mesh {
    Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        normals: vec![Vec3::Z; 3],
        triangles: vec![[0, 1, 2]],
        parts: vec![Part { first_triangle: 0, triangle_count: 1, material: 0 }],
        ..Mesh::default()
    }
}

fn scene(nodes: Vec<Node>, mesh: Mesh, node: u32, skin: Option<u32>) -> Scene {
    let instance = Instance {
        node,
        mesh: 0,
        skin,
        casts: true,
        emitter: Default::default(),
        receives: true,
        rest_from_mesh: Mat3::IDENTITY,
        spare: false,
    };
    Scene {
        nodes,
        meshes: vec![mesh],
        instances: vec![instance],
        materials: vec![Material::default()],
        ..Scene::default()
    }
}

fn animate(scene: &mut Scene, node: u32, target: ChannelTarget, times: &[f32], values: &[f32]) {
    if scene.animations.is_empty() {
        scene.animations.push(Animation::default());
        scene.active_animation = Some(0);
    }
    let channel = Channel {
        node,
        target,
        interpolation: Interpolation::Linear,
        times: times.to_vec(),
        values: values.to_vec(),
    };
    scene.animations[0].channels.push(channel);
}

#[test]
fn children_follow_their_parents_and_time_loops() {
    let nodes = vec![
        node(None, trs(Vec3::X, Quat::from_rotation_z(std::f32::consts::FRAC_PI_2), Vec3::splat(2.0))),
        node(Some(0), trs(Vec3::X, Quat::IDENTITY, Vec3::ONE)),
    ];
    let mut scene = scene(nodes, triangle(), 1, None);
    let at = |scene: &Scene, time| Vec3::from(scene.pose(time).world_from_node[1].translation);
    assert!(at(&scene, 0.0).abs_diff_eq(Vec3::new(1.0, 2.0, 0.0), 1e-6));
    animate(&mut scene, 1, ChannelTarget::Translation, &[0.0, 2.0], &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    assert!(at(&scene, 0.5).abs_diff_eq(Vec3::new(1.0, 2.0, 0.0), 1e-6));
    assert_eq!(at(&scene, 0.5), at(&scene, 2.5));
    assert_eq!(at(&scene, 0.5), at(&scene, -1.5));
    assert_eq!(at(&scene, 0.0), at(&scene, f64::NAN));
    let pose = scene.pose(0.5);
    assert!(pose.instances[0].deformed.is_none(), "rigid instances are not copied");
    let bounds = scene.bounds_world(&pose);
    assert!(bounds.min.abs_diff_eq(Vec3::new(-1.0, 2.0, 0.0), 1e-6), "{bounds:?}");
    assert!(bounds.max.abs_diff_eq(Vec3::new(1.0, 4.0, 0.0), 1e-6), "{bounds:?}");
}

#[test]
fn skinning_blends_joint_matrices() {
    // Joint 0 rests at the origin; joint 1 is bound at x = 1 and turned by 90° about z there, then lifted by 5.
    let lift = trs(Vec3::new(1.0, 5.0, 0.0), Quat::from_rotation_z(std::f32::consts::FRAC_PI_2), Vec3::ONE);
    let nodes = vec![
        node(None, LocalTransform::default()),
        node(None, lift),
        // glTF: the place of a skinned mesh's own node does not count.
        node(None, trs(Vec3::splat(100.0), Quat::IDENTITY, Vec3::ONE)),
    ];
    let mut mesh = triangle();
    mesh.influences = vec![SkinInfluences {
        joints: vec![[0, 1, 0, 0]; 3],
        weights: vec![[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]],
    }];
    mesh.positions = vec![Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0), Vec3::new(2.0, 1.0, 0.0)];
    mesh.normals = vec![Vec3::Y; 3];
    let mut scene = scene(nodes, mesh, 2, Some(0));
    scene.skins.push(Skin {
        name: String::new(),
        joints: vec![0, 1],
        inverse_bind_matrices: vec![Affine3A::IDENTITY, Affine3A::from_translation(Vec3::NEG_X)],
    });
    let pose = scene.pose(0.0);
    assert_eq!(pose.instances[0].world_from_mesh, Affine3A::IDENTITY);
    let deformed = pose.instances[0].deformed.as_ref().unwrap();
    // Joint 1 takes (2,0,0) to local (1,0,0), turned (0,1,0), placed (1,6,0); half way to (2,0,0) is (1.5,3,0).
    // It takes (2,1,0) to local (1,1,0), turned (−1,1,0), placed (0,6,0).
    let expected = [Vec3::ZERO, Vec3::new(1.5, 3.0, 0.0), Vec3::new(0.0, 6.0, 0.0)];
    for (found, expected) in deformed.positions.iter().zip(expected) {
        assert!(found.abs_diff_eq(expected, 1e-5), "{found} instead of {expected}");
    }
    let half = Vec3::new(-1.0, 1.0, 0.0).normalize();
    for (found, expected) in deformed.normals.iter().zip([Vec3::Y, half, Vec3::NEG_X]) {
        assert!(found.abs_diff_eq(expected, 1e-5), "{found} instead of {expected}");
    }
    assert_eq!(scene.vertex_positions(&pose, 0), deformed.positions);
}

#[test]
fn normals_stay_perpendicular_under_uneven_scale_and_mirrors() {
    for scale in [Vec3::new(1.0, 3.0, 0.5), Vec3::new(-1.0, 3.0, 0.5)] {
        let linear = Mat3::from_diagonal(scale);
        let (u, v) = (Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, -1.0));
        let normal = u.cross(v).normalize();
        let moved = super::transform_normal(&linear, normal);
        assert!(moved.dot(linear * u).abs() < 1e-6 && moved.dot(linear * v).abs() < 1e-6);
        // It stays on the side where a point on the normal goes.
        assert!(moved.dot(linear * normal) > 0.0);
    }
}

#[test]
fn morph_targets_add_up() {
    let mut mesh = triangle();
    mesh.morph_targets = vec![
        MorphTarget { positions: vec![Vec3::Z; 3], normals: vec![Vec3::X; 3] },
        MorphTarget { positions: vec![Vec3::ZERO, Vec3::Y, Vec3::ZERO], normals: Vec::new() },
    ];
    mesh.morph_weights = vec![0.5, 2.0];
    let mut scene = scene(vec![node(None, LocalTransform::default())], mesh, 0, None);
    let posed = |scene: &Scene, time| scene.pose(time).instances[0].deformed.clone().unwrap();
    let still = posed(&scene, 0.0);
    assert_eq!(
        still.positions,
        [Vec3::new(0.0, 0.0, 0.5), Vec3::new(1.0, 2.0, 0.5), Vec3::new(0.0, 1.0, 0.5)]
    );
    assert!(still.normals[0].abs_diff_eq(Vec3::new(0.5, 0.0, 1.0).normalize(), 1e-6));
    scene.nodes[0].morph_weights = vec![0.0, 0.0];
    assert_eq!(posed(&scene, 0.0).positions, scene.meshes[0].positions);
    animate(&mut scene, 0, ChannelTarget::MorphWeights, &[0.0, 1.0], &[0.0, 0.0, 2.0, 0.0]);
    assert_eq!(posed(&scene, 0.25).positions[0], Vec3::new(0.0, 0.0, 0.5));
}

#[test]
fn overflow_collapses_instead_of_spreading() {
    let huge = trs(Vec3::ZERO, Quat::IDENTITY, Vec3::splat(1e15));
    let nodes = vec![node(None, huge), node(Some(0), huge), node(Some(1), huge)];
    let scene = scene(nodes, triangle(), 2, None);
    assert_eq!(scene.first_unplaceable_node(0.0), Some(2));
    assert_eq!(scene.bounds_world(&scene.pose(0.0)).diagonal(), 0.0);
}

#[test]
fn hash_follows_content_but_not_names() {
    let mut scene = scene(vec![node(None, LocalTransform::default())], triangle(), 0, None);
    let before = scene.hash();
    scene.name = "other".to_owned();
    scene.meshes[0].name = "other".to_owned();
    assert_eq!(scene.hash(), before);
    scene.meshes[0].positions[1].x += 1e-6;
    let moved = scene.hash();
    assert_ne!(moved, before);
    scene.instances[0].casts = false;
    assert_ne!(scene.hash(), moved);
    animate(&mut scene, 0, ChannelTarget::Translation, &[0.0], &[0.0; 3]);
    assert_ne!(scene.hash(), moved);
}

#[test]
fn an_undeformed_pose_has_all_that_deforming_needs() {
    let nodes = vec![node(None, trs(Vec3::X, Quat::IDENTITY, Vec3::splat(2.0)))];
    let mut scene = scene(nodes, triangle(), 0, None);
    scene.meshes[0].morph_targets = vec![MorphTarget { positions: vec![Vec3::Y; 3], normals: Vec::new() }];
    scene.meshes[0].morph_weights = vec![0.25];
    let (full, light) = (scene.pose(0.0), scene.pose_undeformed(0.0));
    assert_eq!(full.morph_weights, [[0.25]]);
    assert_eq!(light.morph_weights, full.morph_weights);
    assert!(full.instances[0].deformed.is_some() && light.instances[0].deformed.is_none());
    assert_eq!(light.instances[0].world_from_mesh, full.instances[0].world_from_mesh);
    scene.nodes[0].morph_weights = vec![0.5];
    assert_eq!(scene.pose(0.0).morph_weights, [[0.5]]);

    scene.skins.push(Skin {
        name: String::new(),
        joints: vec![0],
        inverse_bind_matrices: vec![Affine3A::from_translation(Vec3::Y)],
    });
    scene.instances[0].skin = Some(0);
    scene.meshes[0].influences =
        vec![SkinInfluences { joints: vec![[0; 4]; 3], weights: vec![[1.0, 0.0, 0.0, 0.0]; 3] }];
    let light = scene.pose_undeformed(0.0);
    assert_eq!(light.instances[0].world_from_mesh, Affine3A::IDENTITY, "skins pose in the world");
    let bind = scene.world_from_bind(&light, 0)[0];
    // A lift of 1 at bind time, then doubled and moved along x.
    assert!(bind.transform_point3(Vec3::ZERO).abs_diff_eq(Vec3::new(1.0, 2.0, 0.0), 1e-6));
}
