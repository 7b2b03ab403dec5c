//! Stores and changes → payloads. Deterministic: the same input gives the same bytes.

use dapple_store::charts::Cuts;
use dapple_store::light_visibility::LightVisibility;
use dapple_store::points::{PointLayout, PointStore};

use super::MAX_LOCAL_BITS;
use super::columns::{CutColumns, PointColumns};
use super::entropy::Writer;
use super::planes::{Changes, Extras, HAS_BENT, HAS_LEANS, HAS_LIGHTS, LIGHTS_CHANGE, PLANES, planes};
use super::values::{Fit, Goal, Near, Scratch, code_changes, code_values};
use super::varint::write_varint;
use crate::light_visibility::{LeanCoder, code_light_changes};

/// The layout part of a snapshot with the cuts that belong to it.
#[derive(Clone, Debug)]
pub(crate) struct EncodedLayout {
    pub(crate) bytes: Vec<u8>,
    /// How many of these are cuts.
    pub(crate) cut_bytes: usize,
    /// Bits of a coordinate within its cell.
    pub(crate) local_bits: u32,
}

/// The layout part of a snapshot, which says what comes with the values.
pub(crate) fn encode_layout(layout: &PointLayout, cuts: &Cuts, extras: Extras) -> EncodedLayout {
    let local_bits = local_bits(layout);
    let mut out = Vec::new();
    out.extend(layout.quantum_m().to_le_bytes());
    out.extend(layout.spacing_m().to_le_bytes());
    let bent = if extras.has_bent { HAS_BENT } else { 0 };
    let lights = if extras.lights > 0 { HAS_LIGHTS } else { 0 };
    let leans = if extras.has_leans { HAS_LEANS } else { 0 };
    out.push(local_bits as u8 | bent | lights | leans);
    if extras.lights > 0 {
        write_varint(&mut out, u64::from(extras.lights));
    }
    write_varint(&mut out, layout.sets().len() as u64);
    let mut next_instance = 0;
    for set in layout.sets() {
        write_varint(&mut out, u64::from(set.instance) - next_instance);
        next_instance = u64::from(set.instance) + 1;
        for component in set.origin_rest.to_array() {
            out.extend(component.to_le_bytes());
        }
        write_varint(&mut out, set.len() as u64);
    }
    let cut_sets: Vec<_> = cuts.sets().iter().filter(|set| !set.cuts.is_empty()).collect();
    let before_cuts = out.len();
    write_varint(&mut out, cut_sets.len() as u64);
    let mut next_instance = 0;
    for set in &cut_sets {
        write_varint(&mut out, u64::from(set.instance) - next_instance);
        next_instance = u64::from(set.instance) + 1;
        write_varint(&mut out, u64::from(set.sites));
        out.extend(set.fingerprint.to_le_bytes());
        write_varint(&mut out, set.cuts.len() as u64);
    }
    let table_bytes = out.len() - before_cuts;
    let mut writer = Writer::new(out);
    let mut columns = PointColumns::new(local_bits);
    for set in layout.sets() {
        columns.begin_set();
        for i in 0..set.len() {
            let (positions, normals) = (&set.positions, &set.normals);
            let place = Some((positions[i], normals[i]));
            columns.code(&mut writer, (&positions[..i], &normals[..i]), place).expect("only reading fails");
        }
    }
    let before_cuts = writer.bytes();
    let mut columns = CutColumns::new();
    for set in cut_sets {
        columns.begin_set();
        for cut in &set.cuts {
            columns.code(&mut writer, *cut).expect("only reading fails");
        }
    }
    let bytes = writer.finish();
    let cut_bytes = table_bytes + bytes.len().saturating_sub(before_cuts);
    EncodedLayout { bytes, cut_bytes, local_bits }
}

/// The payload of a snapshot; `encoded` is what [`encode_layout`] gave for the layout of `store`.
pub(crate) fn snapshot_payload(
    scene_hash: &[u8; 32],
    encoded: &EncodedLayout,
    near: &Near,
    store: &PointStore,
) -> Vec<u8> {
    let mut out = Vec::with_capacity(encoded.bytes.len() + store.value_bytes() / 2 + 64);
    out.extend(scene_hash);
    write_varint(&mut out, encoded.bytes.len() as u64);
    out.extend(&encoded.bytes);
    append_values(out, near, store)
}

/// The values of a snapshot, appended to `out`.
pub(super) fn append_values(out: Vec<u8>, near: &Near, store: &PointStore) -> Vec<u8> {
    let mut writer = Writer::new(out);
    let code = |writer: &mut Writer, plane: &[u8]| {
        code_values(writer, store.layout(), near, |point| plane[point]).expect("only reading fails");
    };
    planes(store).for_each(|plane| code(&mut writer, plane));
    if let Some(lights) = store.lights() {
        let mut leans = LeanCoder::new();
        for light in 0..lights.lights() {
            let (values, wanted) = (lights.of_light(light), lights.leans_of_light(light));
            code(&mut writer, values);
            if lights.has_leans() {
                let coded = leans.code_all(&mut writer, (store.layout(), near), values, Some(wanted));
                debug_assert!(coded.is_some(), "only reading fails");
            }
        }
    }
    writer.finish()
}

/// What a delta has after its base, appended to `out`: `held` to within the goals of its planes, and to these values of lights, of which one at
/// least is set. What the store does not have, is not.
pub(crate) fn append_changes(
    mut out: Vec<u8>,
    near: &mut Near,
    held: &PointStore,
    mut goals: [Option<Goal<'_>>; PLANES],
    lights: Option<&LightVisibility>,
    fits: &mut [Fit; PLANES],
    scratch: &mut Scratch,
) -> (Vec<u8>, Changes) {
    if Extras::of(held).is_any() {
        let planes: u8 = (0..).zip(&goals).map(|(plane, goal)| u8::from(goal.is_some()) << plane).sum();
        out.push(planes | if lights.is_some() { LIGHTS_CHANGE } else { 0 });
    }
    for (goal, fit) in goals.iter().zip(&*fits) {
        out.extend(goal.iter().flat_map(|goal| {
            let scale = goal.scale(fit);
            [scale.step, scale.follow]
        }));
    }
    let mut writer = Writer::new(out);
    let mut changes = [const { Vec::new() }; PLANES];
    for (k, values) in planes(held).enumerate() {
        let Some(goal) = &mut goals[k] else { continue };
        let scale = goal.scale(&fits[k]);
        let coded = code_changes(&mut writer, (held.layout(), near), values, scale, goal, scratch);
        changes[k] = coded.unwrap_or_default();
        fits[k].learn(goal);
    }
    let lights = lights.zip(held.lights()).and_then(|(wanted, lights)| {
        code_light_changes(&mut writer, (held.layout(), near), lights, Some(wanted))
    });
    (writer.finish(), Changes::new(changes, lights.unwrap_or_default(), held))
}

/// Bits of a coordinate within its cell, so that a cell is about as large as the points are apart: then most
/// surface cells hold one point, which is where gaps and places together are shortest.
pub(crate) fn local_bits(layout: &PointLayout) -> u32 {
    let steps = (layout.spacing_m() / layout.quantum_m()) as u32; // saturates
    steps.max(1).ilog2().min(MAX_LOCAL_BITS)
}
