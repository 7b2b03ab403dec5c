//! Payloads → layouts, values and changes. Total: any bytes give a value or an error, within [`Limits`].

use std::sync::Arc;

use dapple_store::charts::{Cuts, SetCuts, SiteCut};
use dapple_store::light_visibility::{LightVisibility, MAX_LIGHTS, MAX_VALUES, OPEN};
use dapple_store::points::{MAX_POINTS, PointLayout, PointSet, PointStore};
use glam::Vec3;

use super::MAX_LOCAL_BITS;
use super::columns::{CutColumns, PointColumns};
use super::entropy::{self, Coder};
use super::planes::{Changes, Extras, HAS_BENT, HAS_LEANS, HAS_LIGHTS, LIGHTS_CHANGE, PLANES, planes};
use super::values::{Guide, MOST_FOLLOW, Near, Scale, Scratch, code_changes, code_values};
use super::varint::Reader;
use super::{DecodeError, Limits};
use crate::light_visibility::{LeanCoder, code_light_changes};

/// The parts of a snapshot, the large ones still encoded.
pub(crate) struct SnapshotParts<'a> {
    pub(crate) scene_hash: [u8; 32],
    pub(crate) layout: &'a [u8],
    pub(crate) values: &'a [u8],
}

/// The parts of a delta, its changes still encoded.
pub(crate) struct DeltaParts<'a> {
    pub(crate) base_epoch: u64,
    pub(super) changes: Reader<'a>,
}

/// What the layout part of a snapshot says.
pub(crate) struct DecodedLayout {
    pub(crate) layout: PointLayout,
    pub(crate) cuts: Cuts,
    /// Bits of a coordinate within its cell.
    pub(crate) local_bits: u32,
    /// What comes with the values.
    pub(crate) extras: Extras,
}

pub(crate) fn parse_snapshot(payload: &[u8]) -> Result<SnapshotParts<'_>, DecodeError> {
    let mut reader = Reader::new(payload);
    let scene_hash = reader.array("scene hash")?;
    let layout_bytes = usize::try_from(reader.varint("layout")?).unwrap_or(usize::MAX);
    let layout = reader.take(layout_bytes, "layout")?;
    let values = reader.take(reader.len(), "values")?;
    Ok(SnapshotParts { scene_hash, layout, values })
}

pub(crate) fn decode_layout(bytes: &[u8], limits: &Limits) -> Result<DecodedLayout, DecodeError> {
    let bad = |part, reason| DecodeError::Malformed { part, reason };
    let mut reader = Reader::new(bytes);
    let quantum_m = reader.f32("layout lengths")?;
    let spacing_m = reader.f32("layout lengths")?;
    let flags = reader.byte("layout local bits")?;
    // Leans alone are none.
    let lit = if flags & HAS_LIGHTS != 0 { HAS_LIGHTS | HAS_LEANS } else { 0 };
    let (local_bits, has_bent) = (u32::from(flags & !(HAS_BENT | lit)), flags & HAS_BENT != 0);
    if local_bits > MAX_LOCAL_BITS {
        return Err(bad("layout local bits", "exceed 8"));
    }
    let lights = if flags & HAS_LIGHTS != 0 { decode_light_count(&mut reader)? } else { 0 };
    let extras = Extras { has_bent, lights, has_leans: flags & lit & HAS_LEANS != 0 };
    let (mut sets, counts) = decode_sets(&mut reader, limits)?;
    // Sets without points are work for each light too.
    let points = counts.iter().map(|count| *count as u64).sum::<u64>();
    let values = points.max(counts.len() as u64) * u64::from(lights);
    let limit = u64::from(limits.max_light_values).min(MAX_VALUES as u64);
    if values > limit {
        return Err(DecodeError::TooLarge { what: "values of lights", value: values, limit });
    }
    let (mut cut_sets, cut_counts) = decode_cut_sets(&mut reader, limits)?;
    // No more room is made than these bytes can well fill.
    let most = 8 * reader.len() + 64;
    let mut coded = entropy::Reader::new(reader.take(reader.len(), "layout")?);
    let ended = bad("layout", "ends early");
    let mut columns = PointColumns::new(local_bits);
    for (set, count) in sets.iter_mut().zip(counts) {
        set.positions = Vec::with_capacity(count.min(most));
        set.normals = Vec::with_capacity(count.min(most));
        columns.begin_set();
        for _ in 0..count {
            let before = (&set.positions[..], &set.normals[..]);
            let (position, normal) = columns.code(&mut coded, before, None).map_err(|(part, reason)| {
                if coded.is_exhausted() { ended.clone() } else { bad(part, reason) }
            })?;
            if coded.is_exhausted() {
                return Err(ended);
            }
            set.positions.push(position);
            set.normals.push(normal);
        }
        set.positions.shrink_to_fit();
        set.normals.shrink_to_fit();
    }
    let mut columns = CutColumns::new();
    for (set, count) in cut_sets.iter_mut().zip(cut_counts) {
        columns.begin_set();
        set.cuts = Vec::with_capacity(count.min(most));
        for _ in 0..count {
            let cut = columns.code(&mut coded, SiteCut { site: 0, mask: 0 }).map_err(|(part, reason)| {
                if coded.is_exhausted() { ended.clone() } else { bad(part, reason) }
            })?;
            if coded.is_exhausted() {
                return Err(ended);
            }
            if cut.site >= set.sites {
                return Err(bad("cut gaps", "name a site that does not exist"));
            }
            set.cuts.push(cut);
        }
        set.cuts.shrink_to_fit();
    }
    if !coded.is_complete() {
        return Err(bad("layout", "has bytes after its end"));
    }
    // A mask of 0 is found here.
    let cuts = Cuts::new(cut_sets).map_err(|error| bad("cut masks", error.reason))?;
    let layout = PointLayout::new(quantum_m, spacing_m, sets)?;
    Ok(DecodedLayout { layout, cuts, local_bits, extras })
}

fn decode_light_count(reader: &mut Reader<'_>) -> Result<u32, DecodeError> {
    let count = reader.varint("number of lights")?;
    if count == 0 {
        return Err(DecodeError::Malformed { part: "number of lights", reason: "is 0" });
    }
    let limit = u64::from(MAX_LIGHTS);
    u32::try_from(count).ok().filter(|count| *count <= MAX_LIGHTS).ok_or(DecodeError::TooLarge {
        what: "lights",
        value: count,
        limit,
    })
}

/// The table of sets of cuts, still without cuts, and how many each has: together within the limits.
fn decode_cut_sets(
    reader: &mut Reader<'_>,
    limits: &Limits,
) -> Result<(Vec<SetCuts>, Vec<usize>), DecodeError> {
    let part = "cuts";
    let bad = |reason| DecodeError::Malformed { part, reason };
    let count = reader.varint(part)?;
    if count > u64::from(limits.max_sets) {
        return Err(DecodeError::TooLarge {
            what: "sets of cuts",
            value: count,
            limit: limits.max_sets.into(),
        });
    }
    let mut sets = Vec::new();
    let mut counts = Vec::new();
    let mut next_instance = 0u64;
    let mut total = 0u64;
    for _ in 0..count {
        let instance = reader.varint(part)?.saturating_add(next_instance);
        next_instance = instance.saturating_add(1);
        let instance = u32::try_from(instance).map_err(|_| bad("an instance exceeds 32 bits"))?;
        let sites = u32::try_from(reader.varint(part)?).map_err(|_| bad("sites exceed 32 bits"))?;
        let fingerprint = u32::from_le_bytes(reader.array(part)?);
        let cuts = reader.varint(part)?;
        if cuts == 0 {
            return Err(bad("a set has none"));
        }
        total = total.saturating_add(cuts);
        if total > u64::from(limits.max_cuts) {
            return Err(DecodeError::TooLarge { what: part, value: total, limit: limits.max_cuts.into() });
        }
        counts.push(cuts as usize);
        sets.push(SetCuts { instance, sites, fingerprint, cuts: Vec::new() });
    }
    Ok((sets, counts))
}

/// The table of sets, still without points, and how many points each has: together within the limits.
fn decode_sets(reader: &mut Reader<'_>, limits: &Limits) -> Result<(Vec<PointSet>, Vec<usize>), DecodeError> {
    let part = "sets";
    let count = reader.varint(part)?;
    if count > u64::from(limits.max_sets) {
        return Err(DecodeError::TooLarge { what: part, value: count, limit: limits.max_sets.into() });
    }
    let max_points = u64::from(limits.max_points.min(MAX_POINTS));
    let mut sets = Vec::new();
    let mut counts = Vec::new();
    let mut next_instance = 0u64;
    let mut total = 0u64;
    for _ in 0..count {
        let instance = reader.varint(part)?.saturating_add(next_instance);
        next_instance = instance.saturating_add(1);
        let instance = u32::try_from(instance)
            .map_err(|_| DecodeError::Malformed { part, reason: "an instance exceeds 32 bits" })?;
        let origin_rest = Vec3::new(reader.f32(part)?, reader.f32(part)?, reader.f32(part)?);
        let points = reader.varint(part)?;
        total = total.saturating_add(points);
        if total > max_points {
            return Err(DecodeError::TooLarge { what: "points", value: total, limit: max_points });
        }
        counts.push(points as usize);
        sets.push(PointSet { instance, origin_rest, ..PointSet::default() });
    }
    Ok((sets, counts))
}

/// The values of a layout's points.
pub(crate) fn decode_values(
    bytes: &[u8],
    layout: Arc<PointLayout>,
    near: &Near,
    extras: Extras,
) -> Result<PointStore, DecodeError> {
    let bad = |reason| DecodeError::Malformed { part: "values", reason };
    let mut reader = entropy::Reader::new(bytes);
    let plane = |reader: &mut entropy::Reader<'_>| code_values(reader, &layout, near, |_| 0).map_err(bad);
    let visibility = plane(&mut reader)?;
    let bent = if extras.has_bent { Some([plane(&mut reader)?, plane(&mut reader)?]) } else { None };
    let mut lights = Vec::with_capacity(layout.len() * extras.lights as usize);
    let mut leans = Vec::with_capacity(if extras.has_leans { lights.capacity() } else { 0 });
    let mut coder = LeanCoder::new();
    for _ in 0..extras.lights {
        let values = plane(&mut reader)?;
        if values.iter().any(|value| *value > OPEN) {
            return Err(bad("of a light exceed that of one of which all is seen"));
        }
        if extras.has_leans {
            let of_light = coder.code_all(&mut reader, (&layout, near), &values, None);
            leans.extend(of_light.ok_or(bad("of lights end early"))?);
        }
        lights.extend(values);
    }
    if !reader.is_complete() {
        return Err(bad("have bytes after their end"));
    }
    let misfit = |_| bad("do not fit the layout");
    let mut store = PointStore::new(layout.clone(), visibility).map_err(misfit)?;
    if let Some(bent) = bent {
        store = store.with_bent(bent).map_err(misfit)?;
    }
    if extras.lights > 0 {
        let lights = LightVisibility::new(&layout, extras.lights, lights);
        let lights = lights.and_then(|lights| match extras.has_leans {
            true => lights.with_leans(leans),
            false => Ok(lights),
        });
        let lights = lights.map_err(|_| bad("of lights do not fit the layout"))?;
        store = store.with_lights(lights).map_err(misfit)?;
    }
    Ok(store)
}

/// Splits the payload of a delta whose frame carries `epoch`.
pub(crate) fn parse_delta(epoch: u64, payload: &[u8]) -> Result<DeltaParts<'_>, DecodeError> {
    let part = "base epoch";
    let mut changes = Reader::new(payload);
    let back = changes.varint(part)?;
    if back == 0 {
        return Err(DecodeError::Malformed { part, reason: "is the frame's own" });
    }
    let base_epoch = epoch.checked_sub(back).ok_or(DecodeError::Malformed { part, reason: "is negative" })?;
    Ok(DeltaParts { base_epoch, changes })
}

/// A guide for who reads: what it says does not count.
struct Read;

impl Guide for Read {
    fn wants(&self, _: std::ops::Range<usize>) -> bool {
        false
    }

    fn choose(&mut self, _: usize, _: i32, _: i32, _: i32) -> i32 {
        0
    }
}

/// What a delta changes of `held`.
pub(crate) fn decode_changes(
    parts: &DeltaParts<'_>,
    held: &PointStore,
    near: &mut Near,
    scratch: &mut Scratch,
) -> Result<Changes, DecodeError> {
    let bad = |part, reason| DecodeError::Malformed { part, reason };
    let mut reader = parts.changes;
    let extras = Extras::of(held);
    let which = if extras.is_any() { reader.byte("planes")? } else { 1 };
    let bent = if extras.has_bent { (1 << PLANES) - 2 } else { 0 };
    let there_are = 1 | bent | if extras.lights > 0 { LIGHTS_CHANGE } else { 0 };
    if which == 0 || which & !there_are != 0 {
        return Err(bad("planes", "are none, or others than there are"));
    }
    let mut scales = [None; PLANES];
    for (_, scale) in (0..).zip(&mut scales).filter(|(plane, _)| which >> plane & 1 == 1) {
        let Scale { step, follow } =
            *scale.insert(Scale { step: reader.byte("step")?, follow: reader.byte("share")? });
        if step == 0 {
            return Err(bad("step", "is 0"));
        }
        if follow > MOST_FOLLOW {
            return Err(bad("share", "exceeds 2"));
        }
    }
    let mut coded = entropy::Reader::new(reader.take(reader.len(), "changes")?);
    let mut changes = [const { Vec::new() }; PLANES];
    for ((values, scale), changes) in planes(held).zip(scales).zip(&mut changes) {
        let Some(scale) = scale else { continue };
        *changes = code_changes(&mut coded, (held.layout(), near), values, scale, &mut Read, scratch)
            .ok_or(bad("changes", "end early"))?;
        if changes.is_empty() {
            return Err(bad("changes", "are none"));
        }
    }
    let mut light_changes = Vec::new();
    if let Some(lights) = held.lights().filter(|_| which & LIGHTS_CHANGE != 0) {
        light_changes = code_light_changes(&mut coded, (held.layout(), near), lights, None)
            .ok_or(bad("changes of lights' visibility", "end early"))?;
        if light_changes.is_empty() {
            return Err(bad("changes of lights' visibility", "are none"));
        }
    }
    if !coded.is_complete() {
        return Err(bad("changes", "have bytes after their end"));
    }
    Ok(Changes::new(changes, light_changes, held))
}
