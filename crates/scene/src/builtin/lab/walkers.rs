//! The walkers as nodes, skins and channels.

use glam::{Mat4, Quat, Vec3};

use super::body::{self, Build, JOINTS, SKELETON, Skinned};
use super::gait::Gait;
use super::plan::{LOOPS, SECONDS};
use crate::builtin::Detail;
use crate::builtin::builder::*;
use crate::builtin::noise::unit;
use crate::builtin::physics::{SAMPLES_PER_SECOND, frame_times};

/// Frames between the keys of joints that lead no foot: they move slowly enough.
const SPARSE: usize = 3;

/// A walker: which body it has, how large it is, how it walks, and on which height.
pub(super) struct Walker {
    pub(super) look: usize,
    pub(super) size: f32,
    pub(super) gait: Gait,
    pub(super) floor: f32,
}

/// Bodies that walkers have: build, and which coat and trousers.
const LOOKS: [(Build, usize, usize); 6] = [
    (Build { girth: 1.0, hem: 0.62, helmet: false }, 0, 0),
    (Build { girth: 0.9, hem: 0.60, helmet: false }, 0, 1),
    (Build { girth: 1.08, hem: 0.79, helmet: true }, 1, 1),
    (Build { girth: 1.0, hem: 0.78, helmet: false }, 2, 0),
    (Build { girth: 1.12, hem: 0.62, helmet: false }, 0, 1),
    (Build { girth: 0.94, hem: 0.79, helmet: true }, 3, 0),
];

/// Everybody, in the order of their nodes.
pub(super) fn crew() -> Vec<Walker> {
    let mut crew = Vec::new();
    for (number, walk) in LOOPS.iter().enumerate() {
        for k in 0..walk.walkers {
            let i = crew.len() as u32;
            let size = 0.94 + 0.13 * unit(301, i);
            // Evenly spread on the loop, so that nobody catches up.
            let start = f64::from(unit(302, number as u32)) + f64::from(k) / f64::from(walk.walkers);
            let gait = Gait::new(walk.route(), size, SECONDS, start, f64::from(unit(303, i)));
            crew.push(Walker {
                look: (i as usize * 5 + number) % LOOKS.len(),
                size,
                gait,
                floor: walk.floor,
            });
        }
    }
    crew
}

/// What walkers are made of.
pub(super) struct Clothes {
    pub(super) skins: [MaterialId; 2],
    pub(super) coats: [MaterialId; 4],
    pub(super) trousers: [MaterialId; 2],
    pub(super) shoes: MaterialId,
    pub(super) hair: [MaterialId; 2],
    pub(super) helmet: MaterialId,
}

/// Adds all walkers and their animation.
pub(super) fn place(b: &mut GlbBuilder, clothes: &Clothes, animation: AnimationId, detail: Detail) {
    let meshes: Vec<MeshId> = LOOKS
        .iter()
        .enumerate()
        .map(|(i, (build, coat, trousers))| {
            let body = body::body(build, detail);
            let top = if build.helmet { clothes.helmet } else { clothes.hair[i % 2] };
            let part =
                |s: &Skinned, m: MaterialId| (s.geometry.clone(), m, s.joints.clone(), s.weights.clone());
            let parts = [
                part(&body.skin, clothes.skins[(i / 2) % 2]),
                part(&body.coat, clothes.coats[*coat]),
                part(&body.trousers, clothes.trousers[*trousers]),
                part(&body.shoes, clothes.shoes),
                part(&body.top, top),
            ];
            let parts: Vec<_> =
                parts.iter().map(|(g, m, joints, weights)| (g, *m, Influences { joints, weights })).collect();
            b.skinned_mesh("walker", &parts)
        })
        .collect();
    for (i, walker) in crew().iter().enumerate() {
        place_walker(b, &format!("walker-{i}"), meshes[walker.look], walker, animation);
    }
}

fn place_walker(b: &mut GlbBuilder, name: &str, mesh: MeshId, walker: &Walker, animation: AnimationId) {
    let frames = (SECONDS as u32 * SAMPLES_PER_SECOND) as usize;
    let poses: Vec<_> =
        (0..=frames).map(|k| walker.gait.pose(k as f64 / f64::from(SAMPLES_PER_SECOND))).collect();
    let frame = NodeSpec {
        translation: Vec3::Y * walker.floor,
        scale: Vec3::splat(walker.size),
        ..NodeSpec::default()
    };
    let frame = b.node(&format!("{name}-frame"), &frame);
    let mut nodes: Vec<NodeId> = Vec::with_capacity(JOINTS);
    for (j, joint) in SKELETON.iter().enumerate() {
        let (parent, translation) = match joint.parent {
            Some(parent) => (nodes[parent], joint.at - SKELETON[parent].at),
            None => (frame, poses[0].pelvis),
        };
        let spec = NodeSpec {
            parent: Some(parent),
            translation,
            rotation: poses[0].turns[j],
            ..NodeSpec::default()
        };
        nodes.push(b.node(&format!("{name}-{}", joint.name), &spec));
    }
    let inverse_bind: Vec<Mat4> = SKELETON.iter().map(|j| Mat4::from_translation(-j.at)).collect();
    let skin = b.skin(name, &nodes, &inverse_bind);
    b.node(name, &NodeSpec { mesh: Some(mesh), skin: Some(skin), ..NodeSpec::default() });

    let every: Vec<usize> = (0..=frames).collect();
    let some: Vec<usize> = (0..=frames).step_by(SPARSE).collect();
    let way: Vec<Vec3> = poses.iter().map(|p| p.pelvis).collect();
    b.channel(animation, nodes[body::PELVIS], &frame_times(&every), Track::Translation(&way), false);
    for (j, &node) in nodes.iter().enumerate() {
        let leads = j == body::PELVIS || body::LEGS.iter().flatten().any(|&leg| leg == j);
        let kept = if leads { &every } else { &some };
        let mut turns: Vec<Quat> = Vec::with_capacity(kept.len());
        for &k in kept {
            let next = poses[k].turns[j];
            let flipped = turns.last().is_some_and(|last| last.dot(next) < 0.0);
            turns.push(if flipped { -next } else { next });
        }
        b.channel(animation, node, &frame_times(kept), Track::Rotation(&turns), false);
    }
}
