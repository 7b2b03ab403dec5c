//! Animations: channels with their key frames, checked and copied out of the accessors.

use glam::Quat;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::animation::{
    Animation as Source, Channel as SourceChannel, Interpolation as Curve, Property,
};
use gltf::json::validation::Checked;

use super::accessor::{Allowed, Elements};
use super::document::{Document, label, name_of};
use crate::load::LoadError;
use crate::load::context::is_usable;
use crate::load::finish::Draft;
use crate::{Animation, Channel, ChannelTarget, Interpolation, LocalTransform};

use ComponentType::{F32, I8, I16, U8, U16};

const TIMES: Allowed = Allowed::new(&[Type::Scalar], &[F32]);
const VECTORS: Allowed = Allowed::new(&[Type::Vec3], &[F32]);
const ROTATIONS: Allowed = Allowed::new(&[Type::Vec4], &[F32, I8, U8, I16, U16]);
const WEIGHTS: Allowed = Allowed::new(&[Type::Scalar], &[F32, I8, U8, I16, U16]);

/// Reads all animations into `draft`; the first one that moves anything plays.
pub(super) fn read(document: &Document<'_>, draft: &mut Draft) -> Result<(), LoadError> {
    // Morph targets of each node's mesh.
    let mut targets = vec![0; draft.scene.nodes.len()];
    for placement in &draft.placements {
        targets[placement.node as usize] = draft.scene.meshes[placement.mesh as usize].morph_targets.len();
    }
    for (i, source) in document.root.animations.iter().enumerate() {
        let at = label("animation", i, &source.name);
        let mut animation = Animation { name: name_of("animation", i, &source.name), channels: Vec::new() };
        for (c, channel) in source.channels.iter().enumerate() {
            let channel_at = format!("{at}.channels[{c}]");
            let Some(channel) = read_channel(document, &at, &channel_at, source, channel, &targets)? else {
                continue;
            };
            let same = |c: &Channel| c.node == channel.node && c.target == channel.target;
            if let Some(old) = animation.channels.iter_mut().find(|c| same(c)) {
                let label = &draft.labels[channel.node as usize];
                let target = channel.target;
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
                document.context.warn(format!("{at} animates {label}, which has a matrix; decomposed"));
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
    at: &str,
    channel_at: &str,
    animation: &Source,
    channel: &SourceChannel,
    targets: &[usize],
) -> Result<Option<Channel>, LoadError> {
    let context = document.context;
    let (s, samplers) = (channel.sampler.value(), &animation.samplers);
    let Some(sampler) = samplers.get(s) else {
        let at = format!("{channel_at}.sampler");
        return Err(context.out_of_range(at, "sampler", s as u64, samplers.len()));
    };
    let sampler_at = format!("{at}.samplers[{s}]");
    let node = document.resolve(channel.target.node, "node", channel_at, "target.node")?;
    let property = match channel.target.path {
        Checked::Valid(Property::Translation) => ChannelTarget::Translation,
        Checked::Valid(Property::Rotation) => ChannelTarget::Rotation,
        Checked::Valid(Property::Scale) => ChannelTarget::Scale,
        Checked::Valid(Property::MorphTargetWeights) => ChannelTarget::MorphWeights,
        Checked::Invalid => {
            context.warn(format!(
                "{channel_at} animates something else than a node's transform or weights; left out"
            ));
            return Ok(None);
        }
    };
    let (width, allowed) = match property {
        ChannelTarget::Translation | ChannelTarget::Scale => (3, VECTORS),
        ChannelTarget::Rotation => (4, ROTATIONS),
        ChannelTarget::MorphWeights => (targets[node], WEIGHTS),
    };
    if width == 0 {
        context.warn(format!("{channel_at} animates morph weights of node {node}, which has none; left out"));
        return Ok(None);
    }
    let interpolation = match sampler.interpolation {
        Checked::Valid(Curve::Linear) => Interpolation::Linear,
        Checked::Valid(Curve::Step) => Interpolation::Step,
        Checked::Valid(Curve::CubicSpline) => Interpolation::CubicSpline,
        Checked::Invalid => {
            context.warn(format!("{sampler_at}: unknown interpolation, taken as LINEAR"));
            Interpolation::Linear
        }
    };
    let input = document.elements(sampler.input, &sampler_at, "input", TIMES)?;
    let output = document.elements(sampler.output, &sampler_at, "output", allowed)?;
    let values_per_key = if interpolation == Interpolation::CubicSpline { 3 * width } else { width };
    let keys = input.count;
    if keys == 0 {
        context.warn(format!("{sampler_at} has no key frames; left out"));
        return Ok(None);
    }
    let has = output.count as u64 * output.width as u64;
    let needs = (keys as u64).saturating_mul(values_per_key as u64);
    if has != needs {
        let problem =
            format!("holds {has} numbers, but {keys} key frames need {needs}; export the file again");
        return Err(context.invalid(output.at.as_str(), problem));
    }
    context.charge(&sampler_at, keys as u64, 4 * (1 + values_per_key as u64))?;
    let mut channel =
        Channel { node: node as u32, target: property, interpolation, times: Vec::new(), values: Vec::new() };
    copy_keys(document, &input, &output, values_per_key, &mut channel)?;
    Ok(Some(channel))
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
