//! Animations: channels with their key frames, checked and copied out of the accessors.

use glam::Quat;

use super::accessor::{Allowed, Component, Elements};
use super::document::Document;
use super::json::Object;
use crate::load::LoadError;
use crate::load::context::is_usable;
use crate::load::finish::Draft;
use crate::{Animation, Channel, ChannelTarget, Interpolation, LocalTransform};

use Component::{F32, I8, I16, U8, U16};

const TIMES: Allowed = Allowed::new(&["SCALAR"], &[F32]);
const VECTORS: Allowed = Allowed::new(&["VEC3"], &[F32]);
const ROTATIONS: Allowed = Allowed::new(&["VEC4"], &[F32, I8, U8, I16, U16]);
const WEIGHTS: Allowed = Allowed::new(&["SCALAR"], &[F32, I8, U8, I16, U16]);

/// Reads all animations into `draft`; the first one that moves anything plays.
pub(super) fn read(document: &Document<'_>, draft: &mut Draft) -> Result<(), LoadError> {
    // Morph targets of each node's mesh.
    let mut targets = vec![0; draft.scene.nodes.len()];
    for placement in &draft.placements {
        targets[placement.node as usize] = draft.scene.meshes[placement.mesh as usize].morph_targets.len();
    }
    for (i, object) in document.animations.iter().enumerate() {
        let mut animation = Animation { name: object.name("animation", i)?, channels: Vec::new() };
        let samplers = object.objects("samplers")?;
        for channel in object.objects("channels")? {
            let Some(channel) = read_channel(document, &channel, &samplers, &targets)? else { continue };
            let same = |c: &Channel| c.node == channel.node && c.target == channel.target;
            if let Some(old) = animation.channels.iter_mut().find(|c| same(c)) {
                let label = &draft.labels[channel.node as usize];
                let (at, target) = (&object.at, channel.target);
                document
                    .context
                    .warn(format!("{at} animates {target:?} of {label} twice; the last one counts"));
                *old = channel;
                continue;
            }
            let node = &mut draft.scene.nodes[channel.node as usize];
            if let (LocalTransform::Matrix(matrix), true) =
                (node.local, channel.target != ChannelTarget::MorphWeights)
            {
                let label = &draft.labels[channel.node as usize];
                document
                    .context
                    .warn(format!("{} animates {label}, which has a matrix; decomposed", object.at));
                node.local = decompose(&matrix);
            }
            animation.channels.push(channel);
        }
        draft.scene.animations.push(animation);
    }
    let moving = |animation: &Animation| !animation.channels.is_empty();
    draft.scene.active_animation = draft.scene.animations.iter().position(moving).map(|i| i as u32);
    Ok(())
}

fn decompose(matrix: &glam::Mat4) -> LocalTransform {
    let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
    let sound = rotation.is_finite() && rotation.length() > 0.5;
    let rotation = if sound { rotation.normalize() } else { Quat::IDENTITY };
    let translation = if translation.is_finite() { translation } else { glam::Vec3::ZERO };
    LocalTransform::Trs { translation, rotation, scale }
}

fn read_channel(
    document: &Document<'_>,
    object: &Object<'_>,
    samplers: &[Object<'_>],
    targets: &[usize],
) -> Result<Option<Channel>, LoadError> {
    let context = document.context;
    let sampler =
        object.index("sampler", "sampler", samplers.len())?.ok_or_else(|| object.missing("sampler"))?;
    let sampler = &samplers[sampler];
    let target = object.object("target")?.ok_or_else(|| object.missing("target"))?;
    let node = target.index("node", "node", document.nodes.len())?;
    let path = target.string("path")?.ok_or_else(|| target.missing("path"))?;
    let (Some(node), Some(property)) = (node, property_of(path)) else {
        context.warn(format!(
            "{} animates something else than a node's transform or weights; left out",
            object.at
        ));
        return Ok(None);
    };
    let (width, allowed) = match property {
        ChannelTarget::Translation | ChannelTarget::Scale => (3, VECTORS),
        ChannelTarget::Rotation => (4, ROTATIONS),
        ChannelTarget::MorphWeights => (targets[node], WEIGHTS),
    };
    if width == 0 {
        context
            .warn(format!("{} animates morph weights of node {node}, which has none; left out", object.at));
        return Ok(None);
    }
    let interpolation = match sampler.string("interpolation")? {
        None | Some("LINEAR") => Interpolation::Linear,
        Some("STEP") => Interpolation::Step,
        Some("CUBICSPLINE") => Interpolation::CubicSpline,
        Some(_) => {
            context.warn(format!("{}: unknown interpolation, taken as LINEAR", sampler.at));
            Interpolation::Linear
        }
    };
    let accessor = |key: &'static str, allowed: Allowed| {
        let index = sampler.index(key, "accessor", document.accessors.len())?;
        document.elements(index.ok_or_else(|| sampler.missing(key))?, sampler.at_key(key), allowed)
    };
    let input = accessor("input", TIMES)?;
    let output = accessor("output", allowed)?;
    let values_per_key = if interpolation == Interpolation::CubicSpline { 3 * width } else { width };
    let keys = input.count;
    if keys == 0 {
        context.warn(format!("{} has no key frames; left out", sampler.at));
        return Ok(None);
    }
    let has = output.count as u64 * output.width as u64;
    let needs = (keys as u64).saturating_mul(values_per_key as u64);
    if has != needs {
        let problem =
            format!("holds {has} numbers, but {keys} key frames need {needs}; export the file again");
        return Err(context.invalid(output.at.as_str(), problem));
    }
    context.charge(&sampler.at, keys as u64, 4 * (1 + values_per_key as u64))?;
    let mut channel =
        Channel { node: node as u32, target: property, interpolation, times: Vec::new(), values: Vec::new() };
    copy_keys(document, &input, &output, values_per_key, &mut channel)?;
    Ok(Some(channel))
}

fn property_of(path: &str) -> Option<ChannelTarget> {
    Some(match path {
        "translation" => ChannelTarget::Translation,
        "rotation" => ChannelTarget::Rotation,
        "scale" => ChannelTarget::Scale,
        "weights" => ChannelTarget::MorphWeights,
        _ => return None,
    })
}

/// Copies the key frames whose times increase, and makes rotations unit quaternions.
fn copy_keys(
    document: &Document<'_>,
    input: &Elements<'_>,
    output: &Elements<'_>,
    values_per_key: usize,
    channel: &mut Channel,
) -> Result<(), LoadError> {
    let context = document.context;
    let (mut unordered, mut mended) = (0, 0);
    for key in 0..input.count {
        let time = input.float(key, 0);
        if !is_usable(time) {
            return Err(context.not_finite(format!("{}, key {key},", input.at)));
        }
        if channel.times.last().is_some_and(|last| time <= *last) {
            unordered += 1;
            continue;
        }
        channel.times.push(time);
        let first = channel.values.len();
        for i in key * values_per_key..(key + 1) * values_per_key {
            let value = output.float(i / output.width, i % output.width);
            if !is_usable(value) {
                return Err(context.not_finite(format!("{}, key {key},", output.at)));
            }
            channel.values.push(value);
        }
        if channel.target == ChannelTarget::Rotation {
            // Tangents of splines are no rotations: only the value in the middle is.
            let at = if channel.interpolation == Interpolation::CubicSpline { first + 4 } else { first };
            mended += usize::from(normalize_rotation(&mut channel.values[at..at + 4]));
        }
    }
    if unordered > 0 {
        context
            .warn(format!("{}: {unordered} key frames are not later than those before; left out", input.at));
    }
    if mended > 0 {
        context.warn(format!("{}: {mended} rotations are not unit quaternions; normalized", output.at));
    }
    Ok(())
}

/// Returns whether the quaternion was clearly not of unit length.
fn normalize_rotation(xyzw: &mut [f32]) -> bool {
    let rotation = Quat::from_slice(xyzw);
    let length = rotation.length();
    let unit = if length > 0.0 { rotation / length } else { Quat::IDENTITY };
    let unit = if unit.is_finite() { unit } else { Quat::IDENTITY };
    unit.write_to_slice(xyzw);
    // Quantized rotations are off by up to 1/127.
    (length - 1.0).abs() > 0.02
}
