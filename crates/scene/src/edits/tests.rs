//! Edits against poses worked out by hand, and through JSON.

use glam::{Mat3, Vec3};
use proptest::prelude::*;

use super::{Edit, EditError, Edits, LightSetting, MAX_SPARES, Placement, Spare, SpareError};
use crate::{
    Animation, Channel, ChannelTarget, Instance, Interpolation, Light, LightKind, Material, Mesh, Node, Part,
    Scene, Skin, SkinInfluences,
};

const HOME: Placement =
    Placement { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0], scale: [1.0, 1.0, 1.0] };

/// A root that an animation moves along x, a child of it with a mesh and a light, and a skinned mesh whose joint is the child.
fn scene() -> Scene {
    let node = |parent, light| Node { parent, light, ..Node::default() };
    let mesh = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        normals: vec![Vec3::Z; 3],
        triangles: vec![[0, 1, 2]],
        parts: vec![Part { first_triangle: 0, triangle_count: 1, material: 0 }],
        ..Mesh::default()
    };
    let influences = SkinInfluences { joints: vec![[0; 4]; 3], weights: vec![[1.0, 0.0, 0.0, 0.0]; 3] };
    let skinned = Mesh { influences: vec![influences], ..mesh.clone() };
    let instance = |node, mesh, skin| Instance {
        node,
        mesh,
        skin,
        casts: true,
        emitter: Default::default(),
        receives: true,
        rest_from_mesh: Mat3::IDENTITY,
        spare: false,
    };
    let channel = Channel {
        node: 0,
        target: ChannelTarget::Translation,
        interpolation: Interpolation::Linear,
        times: vec![0.0, 1.0],
        values: vec![0.0, 0.0, 0.0, 4.0, 0.0, 0.0],
    };
    Scene {
        nodes: vec![node(None, None), node(Some(0), Some(0)), node(None, None)],
        meshes: vec![mesh, skinned],
        instances: vec![instance(1, 0, None), instance(2, 1, Some(0))],
        skins: vec![Skin {
            name: String::new(),
            joints: vec![1],
            inverse_bind_matrices: vec![glam::Affine3A::IDENTITY],
        }],
        materials: vec![Material::default()],
        lights: vec![Light {
            name: String::new(),
            color: Vec3::ONE,
            intensity: 2.0,
            range: None,
            kind: LightKind::Point,
        }],
        animations: vec![Animation { channels: vec![channel], ..Animation::default() }],
        active_animation: Some(0),
        ..Scene::default()
    }
}

fn edited(scene: &Scene, edits: &[Edit]) -> Edits {
    let mut state = Edits::new(scene);
    for edit in edits {
        state.apply(scene, edit).unwrap();
        state.check(scene).unwrap();
    }
    state
}

fn place(node: u32, translation: [f32; 3]) -> Edit {
    Edit::Place { node, placement: Placement { translation, ..HOME } }
}

#[test]
fn what_is_placed_stands_there_with_what_hangs_from_it_until_released() {
    let scene = scene();
    let mut edits = edited(&scene, &[place(0, [0.0, 3.0, 0.0])]);
    let pose = scene.pose_edited(0.5, &edits);
    // The animation is where it was; the child, its light and the skin on it come along.
    for place in [
        pose.instances[0].world_from_mesh.translation.into(),
        pose.lights[0].position_world,
        pose.instances[1].deformed.as_ref().unwrap().positions[0],
    ] {
        assert_eq!(place, Vec3::Y * 3.0);
    }
    assert_eq!(scene.placement(0, 0.5, &edits).unwrap().translation, [0.0, 3.0, 0.0]);
    edits.apply(&scene, &Edit::Release { node: 0 }).unwrap();
    assert_eq!(edits, Edits::new(&scene));
    assert_eq!(scene.pose(0.5).lights[0].position_world, Vec3::X * 2.0);
    assert_eq!(scene.placement(0, 0.5, &edits).unwrap().translation, [2.0, 0.0, 0.0]);
    assert_eq!(scene.placement(3, 0.5, &edits), None);
}

#[test]
fn what_is_removed_is_nowhere() {
    let scene = scene();
    let edits = edited(&scene, &[Edit::Remove { instance: 1 }, Edit::Remove { instance: 1 }]);
    for pose in [scene.pose_edited(0.5, &edits), scene.pose_undeformed_edited(0.5, &edits)] {
        assert!(pose.instances[0].is_there() && !pose.instances[1].is_there());
        assert!(pose.instances[1].deformed.is_none());
        assert!(scene.instance_bounds_world(&pose, 1).is_empty());
        assert_eq!(scene.bounds_world(&pose), scene.instance_bounds_world(&pose, 0));
    }
    let back = edited(&scene, &[Edit::Remove { instance: 1 }, Edit::Restore { instance: 1 }]);
    assert_eq!(back, Edits::new(&scene));
}

#[test]
fn lights_shine_as_they_are_told() {
    let scene = scene();
    let light = Edit::Light { light: 0, color: [1.0, 0.5, 0.0], intensity: 7.0 };
    let posed = &scene.pose_edited(0.0, &edited(&scene, &[light])).lights[0];
    assert_eq!((posed.color, posed.intensity), (Vec3::new(1.0, 0.5, 0.0), 7.0));
    let posed = &scene.pose(0.0).lights[0];
    assert_eq!((posed.color, posed.intensity), (Vec3::ONE, 2.0));
    assert_eq!(edited(&scene, &[light, Edit::ResetLight { light: 0 }]), Edits::new(&scene));
    let all = [light, place(2, [1.0; 3]), Edit::Remove { instance: 0 }, Edit::Reset];
    assert_eq!(edited(&scene, &all), Edits::new(&scene));
}

#[test]
fn what_cannot_be_is_refused_and_changes_nothing() {
    let scene = scene();
    let mut edits = edited(&scene, &[place(0, [1.0, 2.0, 3.0])]);
    let before = edits.clone();
    let at = |placement| Edit::Place { node: 0, placement };
    let light = |color, intensity| Edit::Light { light: 0, color, intensity };
    let wrong = [
        (place(3, [0.0; 3]), "node 3"),
        (Edit::Release { node: 9 }, "node 9"),
        (Edit::Remove { instance: 2 }, "instance 2"),
        (Edit::Restore { instance: u32::MAX }, "instance 4294967295"),
        (Edit::ResetLight { light: 1 }, "light 1"),
        (place(0, [0.0, f32::NAN, 0.0]), "moved to"),
        (place(0, [0.0, 0.0, -1.1e6]), "moved to"),
        (at(Placement { rotation: [0.0; 4], ..HOME }), "turned by"),
        (at(Placement { rotation: [0.0, 0.0, 0.0, 1.01], ..HOME }), "turned by"),
        (at(Placement { rotation: [f32::NAN; 4], ..HOME }), "turned by"),
        (at(Placement { rotation: [f32::INFINITY; 4], ..HOME }), "turned by"),
        (at(Placement { scale: [1.0, 0.0, 1.0], ..HOME }), "scaled by"),
        (at(Placement { scale: [1.0, 1.0, -1001.0], ..HOME }), "scaled by"),
        (light([-0.1, 0.0, 0.0], 1.0), "colour"),
        (light([f32::NAN, 0.0, 0.0], 1.0), "colour"),
        (light([1.0; 3], 2e9), "intensity"),
        (light([1.0; 3], f32::NAN), "intensity"),
    ];
    for (edit, says) in wrong {
        let error = edits.apply(&scene, &edit).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
        assert_eq!(edits, before);
    }
    let mut foreign = before.clone();
    foreign.lights.insert(0, LightSetting { color: [1e7; 3], intensity: 1.0 });
    assert!(foreign.check(&scene).is_err());
    foreign = before.clone();
    foreign.removed.insert(2);
    assert!(foreign.check(&scene).is_err());
}

#[test]
fn what_hangs_from_a_node_must_bear_its_place() {
    let mut scene = scene();
    let mut last = 1;
    for _ in 0..12 {
        scene.nodes.push(Node { parent: Some(last), ..Node::default() });
        last = scene.nodes.len() as u32 - 1;
    }
    let large = |node| Edit::Place { node, placement: Placement { scale: [1e3; 3], ..HOME } };
    let mut edits = Edits::new(&scene);
    let mut refused = None;
    for node in (0..2).chain(3..=last) {
        let before = edits.clone();
        if let Err(error) = edits.apply(&scene, &large(node)) {
            assert_eq!(edits, before);
            refused.get_or_insert(error);
        }
        edits.check(&scene).unwrap();
    }
    assert!(matches!(refused, Some(EditError::Unbearable { .. })), "{refused:?}");
    assert!(scene.pose_edited(0.0, &edits).world_from_node.iter().all(|world| world.is_finite()));
}

#[test]
fn spares_are_gone_until_they_are_wanted() {
    let original = scene();
    let mut scene = original.clone();
    assert_eq!(
        scene.add_spares(&[Spare { instance: 1, count: 1 }]),
        Err(SpareError::Skinned { instance: 1, name: String::new() })
    );
    assert!(matches!(
        scene.add_spares(&[Spare { instance: 2, count: 1 }]),
        Err(SpareError::NoInstance { .. })
    ));
    let many = Spare { instance: 0, count: MAX_SPARES };
    assert!(matches!(scene.add_spares(&[many, many]), Err(SpareError::TooMany { .. })));
    assert_eq!(scene.hash(), original.hash());
    scene.add_spares(&[Spare { instance: 0, count: 2 }]).unwrap();
    assert_ne!(scene.hash(), original.hash());
    let mut plain = scene.clone();
    plain.instances[2].spare = false;
    assert_ne!(scene.hash(), plain.hash());
    assert!((0u32..).zip(&scene.nodes).all(|(i, node)| node.parent.is_none_or(|parent| parent < i)));

    let mut edits = Edits::new(&scene);
    assert!(edits.removed.iter().eq(&[2, 3]));
    assert!(!scene.pose(0.0).instances[3].is_there());
    assert_eq!(scene.pose(0.0).lights.len(), 1);
    assert_eq!(edits.free_like(&scene, 0), Some(2));
    assert_eq!(edits.free_like(&scene, 1), None);
    assert_eq!(edits.free_like(&scene, 9), None);
    for edit in [Edit::Restore { instance: 2 }, place(scene.instances[2].node, [0.0, 5.0, 0.0])] {
        edits.apply(&scene, &edit).unwrap();
    }
    let pose = scene.pose_edited(0.5, &edits);
    assert_eq!(Vec3::from(pose.instances[2].world_from_mesh.translation), Vec3::new(2.0, 5.0, 0.0));
    assert_eq!(edits.free_like(&scene, 0), Some(3));
    edits.apply(&scene, &Edit::Remove { instance: 0 }).unwrap();
    assert_eq!(edits.free_like(&scene, 2), Some(0));
    edits.apply(&scene, &Edit::Reset).unwrap();
    assert_eq!(edits, Edits::new(&scene));
}

#[test]
fn json_is_as_documented() {
    let scene = scene();
    let edits = [
        (
            place(0, [0.1, 0.0, -2.5]),
            r#"{"edit":"place","node":0,"placement":{"translation":[0.1,0.0,-2.5],"rotation":[0.0,0.0,0.0,1.0],"scale":[1.0,1.0,1.0]}}"#,
        ),
        (Edit::Release { node: 1 }, r#"{"edit":"release","node":1}"#),
        (Edit::Remove { instance: 1 }, r#"{"edit":"remove","instance":1}"#),
        (Edit::Restore { instance: 1 }, r#"{"edit":"restore","instance":1}"#),
        (
            Edit::Light { light: 0, color: [1.0, 0.2, 0.0], intensity: 3.5 },
            r#"{"edit":"light","light":0,"color":[1.0,0.2,0.0],"intensity":3.5}"#,
        ),
        (Edit::ResetLight { light: 0 }, r#"{"edit":"reset-light","light":0}"#),
        (Edit::Reset, r#"{"edit":"reset"}"#),
    ];
    for (edit, text) in edits {
        assert_eq!(serde_json::to_string(&edit).unwrap(), text);
        assert_eq!(serde_json::from_str::<Edit>(text).unwrap(), edit);
    }
    let state = edited(&scene, &[place(0, [0.1, 0.0, 0.0]), Edit::Remove { instance: 1 }]);
    let text = serde_json::to_string(&state).unwrap();
    assert!(text.starts_with(r#"{"placed":[{"node":0,"placement":{"#), "{text}");
    assert_eq!(serde_json::from_str::<Edits>(&text).unwrap(), state);
    for wrong in [
        r#"{"edit":"remove"}"#,
        r#"{"edit":"remove","instance":-1}"#,
        r#"{"edit":"remove","instance":1,"more":2}"#,
        r#"{"edit":"explode"}"#,
        r#"{"edit":"place","node":0,"placement":{"translation":[0,0],"rotation":[0,0,0,1],"scale":[1,1,1]}}"#,
        r#"{"edit":"light","light":0,"color":[null,0,0],"intensity":1}"#,
    ] {
        assert!(serde_json::from_str::<Edit>(wrong).is_err(), "{wrong}");
    }
}

proptest! {
    /// Whoever applies what was sent, as it was sent or normalised, holds the same bits as the sender.
    #[test]
    fn numbers_survive_json(bits in prop::array::uniform8(any::<u32>()), length in 0.9991f64..1.0009) {
        let scene = scene();
        let numbers = bits.map(f32::from_bits).map(|x| if x.is_finite() { x } else { 0.1 });
        let fit = |x: f32, most: f32| x.clamp(-most, most);
        let [x, y, z, w] = [4, 5, 6, 7].map(|i: usize| f64::from(bits[i]) - 2_147_483_648.25);
        let scale = length / (x * x + y * y + z * z + w * w).sqrt();
        let placement = Placement {
            translation: [numbers[0], numbers[1], numbers[2]].map(|x| fit(x, 1e6)),
            rotation: [x, y, z, w].map(|x| (x * scale) as f32),
            scale: [numbers[3], numbers[4], numbers[5]].map(|x| fit(x, 1e3).abs().max(1e-3)),
        };
        let color = [numbers[1], numbers[2], numbers[3]].map(|x| fit(x, 1e6).abs());
        let light = Edit::Light { light: 0, color, intensity: fit(numbers[6], 1e9).abs() };
        let mut sender = Edits::new(&scene);
        for edit in [Edit::Place { node: 2, placement }, light] {
            sender.apply(&scene, &edit).unwrap();
        }
        let normalized = placement.normalized();
        prop_assert_eq!(normalized.normalized(), normalized);
        for placement in [placement, normalized] {
            let mut receiver = Edits::new(&scene);
            for edit in [Edit::Place { node: 2, placement }, light] {
                let text = serde_json::to_string(&edit).unwrap();
                receiver.apply(&scene, &serde_json::from_str(&text).unwrap()).unwrap();
            }
            prop_assert_eq!(&receiver, &sender);
            let text = serde_json::to_string(&receiver).unwrap();
            prop_assert_eq!(&serde_json::from_str::<Edits>(&text).unwrap(), &sender);
        }
    }
}
