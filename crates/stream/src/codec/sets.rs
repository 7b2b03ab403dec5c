//! Sets that come and go ⇄ the payload of a frame: what a delta is for values, for the layout.
//!
//! What comes is written as the layout and the values of a snapshot that has nothing else; what else changed follows as in a
//! delta on top of it.

use dapple_store::charts::Cuts;
use dapple_store::light_visibility::MAX_VALUES;
use dapple_store::points::{MAX_POINTS, PointStore};

use super::decode::{DecodedLayout, DeltaParts, decode_layout, decode_values};
#[cfg(feature = "publish")]
use super::encode::{append_values, encode_layout};
use super::planes::Extras;
use super::values::Near;
#[cfg(feature = "publish")]
use super::varint::write_varint;
use super::{DecodeError, Limits};

/// The payload up to the changes of what stays. `gone` are instances, ascending; `added` is what comes, with its cuts.
#[cfg(feature = "publish")]
pub(crate) fn sets_head(epochs_back: u64, gone: &[u32], added: &PointStore, cuts: &Cuts) -> Vec<u8> {
    let mut out = Vec::new();
    write_varint(&mut out, epochs_back);
    write_varint(&mut out, gone.len() as u64);
    let mut next_instance = 0;
    for &instance in gone {
        write_varint(&mut out, u64::from(instance) - next_instance);
        next_instance = u64::from(instance) + 1;
    }
    let layout = added.layout();
    if layout.sets().is_empty() {
        out.push(0);
        return out;
    }
    let encoded = encode_layout(layout, cuts, Extras::of(added));
    write_varint(&mut out, encoded.bytes.len() as u64);
    out.extend(&encoded.bytes);
    let near = Near::new(layout, encoded.local_bits);
    let values = append_values(Vec::new(), &near, added);
    write_varint(&mut out, values.len() as u64);
    out.extend(values);
    out
}

/// What a payload says, its changes still encoded.
pub(crate) struct DecodedSets<'a> {
    /// Instances whose sets go, ascending; all of them are held.
    pub(crate) gone: Vec<u32>,
    /// What comes: it fits what stays.
    pub(crate) added: PointStore,
    pub(crate) cuts: Cuts,
    /// Of values, on top of that; if there are any.
    pub(crate) changes: Option<DeltaParts<'a>>,
}

/// Reads the payload of a frame that builds on a store, after the base epoch, which `parse_delta` has read. `local_bits` are those of
/// the store's layout, and `cuts` are its cuts.
pub(crate) fn decode_sets_change<'a>(
    parts: &DeltaParts<'a>,
    (store, cuts, local_bits): (&PointStore, &Cuts, u32),
    limits: &Limits,
) -> Result<DecodedSets<'a>, DecodeError> {
    let bad = |part, reason| DecodeError::Malformed { part, reason };
    let held = store.layout();
    let mut reader = parts.changes;
    let part = "sets that go";
    let count = reader.varint(part)?;
    if count > held.sets().len() as u64 {
        return Err(bad(part, "are more than there are"));
    }
    let mut gone = Vec::with_capacity(count as usize);
    let mut next_instance = 0u64;
    for _ in 0..count {
        let instance = reader.varint(part)?.saturating_add(next_instance);
        next_instance = instance.saturating_add(1);
        let instance = u32::try_from(instance).map_err(|_| bad(part, "exceed 32 bits"))?;
        if held.set_of_instance(instance).is_none() {
            return Err(bad(part, "are not there"));
        }
        gone.push(instance);
    }
    let size = |bytes: u64| usize::try_from(bytes).unwrap_or(usize::MAX);
    let layout_bytes = size(reader.varint("sets that come")?);
    let layout_bytes = reader.take(layout_bytes, "sets that come")?;
    let (added, added_cuts) = if layout_bytes.is_empty() {
        if gone.is_empty() {
            return Err(bad("sets", "neither come nor go"));
        }
        (PointStore::default(), Cuts::default())
    } else {
        // What stays counts as well.
        let stays = |instance: &u32| gone.binary_search(instance).is_err();
        let sets = held.sets().iter().filter(|set| stays(&set.instance));
        let points: u64 = sets.clone().map(|set| set.len() as u64).sum();
        let cut_sets = cuts.sets().iter().filter(|set| stays(&set.instance));
        let left = Limits {
            max_points: less(limits.max_points.min(MAX_POINTS), points),
            max_sets: less(limits.max_sets, sets.count() as u64),
            max_cuts: less(limits.max_cuts, cut_sets.map(|set| set.cuts.len() as u64).sum()),
            max_light_values: less(
                limits.max_light_values.min(MAX_VALUES as u32),
                points.saturating_mul(u64::from(store.light_count())),
            ),
            ..*limits
        };
        let decoded = decode_layout(layout_bytes, &left)?;
        check_fit(&decoded, (store, local_bits), &gone)?;
        let DecodedLayout { layout, cuts, extras, .. } = decoded;
        let near = Near::new(&layout, local_bits);
        let value_bytes = size(reader.varint("values")?);
        let added = decode_values(reader.take(value_bytes, "values")?, layout.into(), &near, extras)?;
        (added, cuts)
    };
    let changes =
        (!reader.is_empty()).then_some(DeltaParts { base_epoch: parts.base_epoch, changes: reader });
    Ok(DecodedSets { gone, added, cuts: added_cuts, changes })
}

fn less(limit: u32, taken: u64) -> u32 {
    u64::from(limit).saturating_sub(taken) as u32
}

/// Whether what comes can stand beside what stays.
fn check_fit(
    decoded: &DecodedLayout,
    (store, local_bits): (&PointStore, u32),
    gone: &[u32],
) -> Result<(), DecodeError> {
    let bad = |reason| Err(DecodeError::Malformed { part: "sets that come", reason });
    let (added, held) = (&decoded.layout, store.layout());
    if !added.has_lengths_of(held) || decoded.local_bits != local_bits {
        return bad("have other lengths than the layout");
    }
    if decoded.extras.has_bent != store.bent().is_some() {
        return bad("have bent normals where others have none, or none where others have");
    }
    if decoded.extras.lights != store.light_count() {
        return bad("have values of more or fewer lights than others have");
    }
    if decoded.extras.has_leans != Extras::of(store).has_leans {
        return bad("say where what is seen of lights lies where others do not, or do not where others do");
    }
    if added.sets().is_empty() {
        return bad("are none");
    }
    let is_held =
        |instance| held.set_of_instance(instance).is_some() && gone.binary_search(&instance).is_err();
    if added.sets().iter().any(|set| is_held(set.instance)) {
        return bad("are there already");
    }
    if decoded.cuts.sets().iter().any(|set| added.set_of_instance(set.instance).is_none()) {
        return bad("have cuts of other instances");
    }
    Ok(())
}
