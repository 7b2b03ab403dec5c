//! Nodes that move from key to key.

use glam::{Quat, Vec3};

use super::builder::{AnimationId, GlbBuilder, NodeSpec, Track};

/// What moves a node: places and rotations, one a key; what is `None` stays as the node has it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Motion<'a> {
    pub(super) places: Option<&'a [Vec3]>,
    pub(super) turns: Option<&'a [Quat]>,
}

/// Adds a node that moves through keys at `times` (seconds); it stands as the first key says.
pub(super) fn place(
    b: &mut GlbBuilder,
    animation: AnimationId,
    times: &[f32],
    name: &str,
    spec: &NodeSpec,
    motion: Motion<'_>,
) {
    let turns = motion.turns.map(short_ways);
    let first = |list: Option<&[Vec3]>| list.and_then(|list| list.first().copied());
    let spec = NodeSpec {
        translation: first(motion.places).unwrap_or(spec.translation),
        rotation: turns.as_deref().and_then(|turns| turns.first().copied()).unwrap_or(spec.rotation),
        ..spec.clone()
    };
    let node = b.node(name, &spec);
    if let Some(places) = motion.places {
        b.channel(animation, node, times, Track::Translation(places), false);
    }
    if let Some(turns) = &turns {
        b.channel(animation, node, times, Track::Rotation(turns), false);
    }
}

/// The same rotations with their signs such that neighbours lie in one hemisphere.
fn short_ways(turns: &[Quat]) -> Vec<Quat> {
    let mut turns = turns.to_vec();
    for k in 1..turns.len() {
        if turns[k - 1].dot(turns[k]) < 0.0 {
            turns[k] = -turns[k];
        }
    }
    turns
}
