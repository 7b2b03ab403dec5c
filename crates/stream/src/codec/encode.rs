//! Stores and changes → payloads. Deterministic: the same input gives the same bytes.

use dapple_store::charts::Cuts;
use dapple_store::points::{PointLayout, morton_code};

use super::plane::{Plane, reference};
use super::entropy::Writer;
use super::section::pack;
use super::values::{Fit, Goal, Near, Scratch, ValueChange, code_changes, code_values};
use super::varint::write_varint;
use super::zigzag;

/// Zstandard level of the layout: made once, sent to everyone.
const LAYOUT_LEVEL: i32 = 15;

/// Most bits of a coordinate within its cell: they are coded as one byte.
const MAX_LOCAL_BITS: u32 = 8;

/// The layout part of a snapshot with the cuts that belong to it.
#[derive(Clone, Debug)]
pub(crate) struct EncodedLayout {
    pub(crate) bytes: Vec<u8>,
    /// How many of these are cuts.
    pub(crate) cut_bytes: usize,
    /// Bits of a coordinate within its cell.
    pub(crate) local_bits: u32,
}

pub(crate) fn encode_layout(layout: &PointLayout, cuts: &Cuts) -> Result<EncodedLayout, std::io::Error> {
    let local_bits = local_bits(layout);
    let local_mask = (1u32 << local_bits) - 1;
    let mut out = Vec::new();
    out.extend(layout.quantum_m().to_le_bytes());
    out.extend(layout.spacing_m().to_le_bytes());
    out.push(local_bits as u8);
    write_varint(&mut out, layout.sets().len() as u64);
    let mut next_instance = 0;
    let mut normals = [Vec::new(), Vec::new()];
    let mut cell_gaps = Vec::new();
    let mut locals = [Vec::new(), Vec::new(), Vec::new()];
    for set in layout.sets() {
        write_varint(&mut out, u64::from(set.instance) - next_instance);
        next_instance = u64::from(set.instance) + 1;
        for component in set.origin_rest.to_array() {
            out.extend(component.to_le_bytes());
        }
        write_varint(&mut out, set.len() as u64);
        let mut last_normal = [0u8; 2];
        let mut last_cell = 0;
        for (i, (&position, &normal)) in set.positions.iter().zip(&set.normals).enumerate() {
            for axis in 0..2 {
                normals[axis].push(zigzag(normal.0[axis].wrapping_sub(last_normal[axis])));
            }
            last_normal = normal.0;
            let cell = morton_code(position) >> (3 * local_bits);
            write_varint(&mut cell_gaps, cell - last_cell);
            last_cell = cell;
            let plane = Plane::new(normal);
            let along = plane.along.map(|axis| position[axis]);
            let predicted = plane.predict(reference(&set.positions, &set.normals, i), along);
            let across = position[plane.across].wrapping_sub(predicted);
            for (column, value) in locals.iter_mut().zip([along[0], along[1], across]) {
                column.push((value & local_mask) as u8);
            }
        }
    }
    let [n0, n1] = &normals;
    let [l0, l1, l2] = &locals;
    for section in [n0, n1, &cell_gaps, l0, l1, l2] {
        pack(&mut out, section, LAYOUT_LEVEL)?;
    }
    let without_cuts = out.len();
    encode_cuts(&mut out, cuts)?;
    let cut_bytes = out.len() - without_cuts;
    Ok(EncodedLayout { bytes: out, cut_bytes, local_bits })
}

fn encode_cuts(out: &mut Vec<u8>, cuts: &Cuts) -> Result<(), std::io::Error> {
    let sets = || cuts.sets().iter().filter(|set| !set.cuts.is_empty());
    write_varint(out, sets().count() as u64);
    let mut next_instance = 0;
    let mut gaps = Vec::new();
    let mut masks = [Vec::new(), Vec::new()];
    for set in sets() {
        write_varint(out, u64::from(set.instance) - next_instance);
        next_instance = u64::from(set.instance) + 1;
        write_varint(out, u64::from(set.sites));
        out.extend(set.fingerprint.to_le_bytes());
        write_varint(out, set.cuts.len() as u64);
        let mut next = 0;
        for cut in &set.cuts {
            write_varint(&mut gaps, u64::from(cut.site - next));
            next = cut.site + 1;
            for (column, byte) in masks.iter_mut().zip(cut.mask.to_le_bytes()) {
                column.push(byte);
            }
        }
    }
    let [low, high] = &masks;
    for section in [&gaps, low, high] {
        pack(out, section, LAYOUT_LEVEL)?;
    }
    Ok(())
}

/// The payload of a snapshot; `encoded` is what [`encode_layout`] gave for `layout`, `visibility` one value a point.
pub(crate) fn snapshot_payload(
    scene_hash: &[u8; 32],
    encoded: &EncodedLayout,
    (layout, near): (&PointLayout, &Near),
    visibility: &[u8],
) -> Vec<u8> {
    let mut out = Vec::with_capacity(encoded.bytes.len() + visibility.len() / 2 + 64);
    out.extend(scene_hash);
    write_varint(&mut out, encoded.bytes.len() as u64);
    out.extend(&encoded.bytes);
    let mut writer = Writer::new(out);
    code_values(&mut writer, layout, near, |point| visibility[point])
        .expect("only reading fails");
    writer.finish()
}

/// The payload of a delta that brings `held` to within the goal, and what it changes. `epochs_back` is the distance from the
/// frame's epoch to that of `held`, at least 1.
pub(crate) fn delta_payload(
    epochs_back: u64,
    (layout, near): (&PointLayout, &mut Near),
    held: &[u8],
    mut goal: Goal<'_>,
    fit: &mut Fit,
    scratch: &mut Scratch,
) -> (Vec<u8>, Vec<ValueChange>) {
    let mut out = Vec::new();
    write_varint(&mut out, epochs_back);
    let scale = goal.scale(fit);
    out.extend([scale.step, scale.follow]);
    let mut writer = Writer::new(out);
    let changes = code_changes(&mut writer, (layout, near), held, scale, &mut goal, scratch);
    fit.learn(&goal);
    (writer.finish(), changes.unwrap_or_default())
}

/// Bits of a coordinate within its cell, so that a cell is about as large as the points are apart: then most
/// surface cells hold one point, which is where gaps and places together are shortest.
fn local_bits(layout: &PointLayout) -> u32 {
    let steps = (layout.spacing_m() / layout.quantum_m()) as u32; // saturates
    steps.max(1).ilog2().min(MAX_LOCAL_BITS)
}
