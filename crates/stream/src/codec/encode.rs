//! Stores and changes → payloads. Deterministic: the same input gives the same bytes.

use dapple_store::charts::Cuts;
use dapple_store::points::{PointLayout, morton_code};

use super::plane::{Plane, reference};
use super::section::pack;
use super::varint::write_varint;
use super::zigzag;

/// Zstandard level of the layout and of snapshot values: made once a group, sent to everyone.
const SNAPSHOT_LEVEL: i32 = 15;

/// Zstandard level of deltas: made every epoch. Measured (benches/codec.rs): higher levels gain at most 3 %.
const DELTA_LEVEL: i32 = 1;

/// Most bits of a coordinate within its cell: they are coded as one byte.
const MAX_LOCAL_BITS: u32 = 8;

/// The layout part of a snapshot with the cuts that belong to it, and how many of its bytes the cuts are.
pub(crate) fn encode_layout(layout: &PointLayout, cuts: &Cuts) -> Result<(Vec<u8>, usize), std::io::Error> {
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
        pack(&mut out, section, SNAPSHOT_LEVEL)?;
    }
    let without_cuts = out.len();
    encode_cuts(&mut out, cuts)?;
    let cut_bytes = out.len() - without_cuts;
    Ok((out, cut_bytes))
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
        pack(out, section, SNAPSHOT_LEVEL)?;
    }
    Ok(())
}

/// The payload of a snapshot; `layout` is what [`encode_layout`] gave for the layout of `visibility`.
pub(crate) fn snapshot_payload(
    scene_hash: &[u8; 32],
    layout: &[u8],
    visibility: &[u8],
) -> Result<Vec<u8>, std::io::Error> {
    let mut out = Vec::with_capacity(layout.len() + visibility.len() / 2 + 64);
    out.extend(scene_hash);
    write_varint(&mut out, layout.len() as u64);
    out.extend(layout);
    let mut last = u8::MAX;
    let residuals: Vec<u8> = visibility
        .iter()
        .map(|&value| zigzag(value.wrapping_sub(std::mem::replace(&mut last, value))))
        .collect();
    pack(&mut out, &residuals, SNAPSHOT_LEVEL)?;
    Ok(out)
}

/// The payload of a delta from `old` to `new` visibility, or nothing if they are equal.
/// `epochs_back` is the distance from the frame's epoch to that of `old`, at least 1.
pub(crate) fn delta_payload(
    epochs_back: u64,
    old: &[u8],
    new: &[u8],
) -> Result<Option<Vec<u8>>, std::io::Error> {
    /// Equal stretches of this many points are skipped at once.
    const STRIDE: usize = 64;
    let mut gaps = Vec::new();
    let mut residuals = Vec::new();
    let mut next = 0;
    for (stretch, (old, new)) in old.chunks(STRIDE).zip(new.chunks(STRIDE)).enumerate() {
        if old == new {
            continue;
        }
        for (i, (&old, &new)) in old.iter().zip(new).enumerate() {
            if old != new {
                let point = stretch * STRIDE + i;
                write_varint(&mut gaps, (point - next) as u64);
                next = point + 1;
                residuals.push(zigzag(new.wrapping_sub(old)));
            }
        }
    }
    if residuals.is_empty() {
        return Ok(None);
    }
    let mut out = Vec::new();
    write_varint(&mut out, epochs_back);
    write_varint(&mut out, residuals.len() as u64);
    pack(&mut out, &gaps, DELTA_LEVEL)?;
    pack(&mut out, &residuals, DELTA_LEVEL)?;
    Ok(Some(out))
}

/// Bits of a coordinate within its cell, so that a cell is about as large as the points are apart: then most
/// surface cells hold one point, which is where gaps and places together are shortest.
fn local_bits(layout: &PointLayout) -> u32 {
    let steps = (layout.spacing_m() / layout.quantum_m()) as u32; // saturates
    steps.max(1).ilog2().min(MAX_LOCAL_BITS)
}
