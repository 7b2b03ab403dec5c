//! Which values of lights a delta brings, and how many fit.

use dapple_store::points::PointStore;

use crate::codec::Near;
use crate::codec::entropy::Writer;
use crate::light_visibility::code_light_changes;

/// Tolerances are raised up to so many times before fewer values are sent.
const COARSEST: u32 = 16;

/// What subscribers are to hold of `store`: what is off by more than `times` its tolerance (index and steps, ascending; 0 of those that are not
/// listed, but where `times` is above 1, one step of all) as it is there, the rest as it is `held`. `None` where all of it is near enough.
pub(super) fn light_changes(
    held: &PointStore,
    store: &PointStore,
    tolerances: &[(u32, u8)],
    times: u32,
) -> Option<Vec<u8>> {
    let (held, new) = (held.lights()?.values(), store.lights()?.values());
    let mut wanted: Option<Vec<u8>> = None;
    let mut tolerances = tolerances.iter().peekable();
    for (index, (old, new)) in held.iter().zip(new).enumerate().filter(|(_, (old, new))| old != new) {
        while tolerances.next_if(|(listed, _)| (*listed as usize) < index).is_some() {}
        let tolerance = tolerances.peek().filter(|(listed, _)| *listed as usize == index);
        let steps = tolerance.map_or(0, |(_, steps)| u32::from(*steps)).max(u32::from(times > 1));
        if u32::from(old.abs_diff(*new)) > times * steps {
            wanted.get_or_insert_with(|| held.to_vec())[index] = *new;
        }
    }
    wanted
}

/// As [`light_changes`], in at most so many bytes: the least that is off waits first, and if that is not enough, each value in its turn, from `next` on, which
/// goes on to where the next call is to begin. Nothing that waits is lost: it is off the next time too.
pub(super) fn lights_within(
    held: &PointStore,
    store: &PointStore,
    near: &mut Near,
    tolerances: &[(u32, u8)],
    (most_bytes, next): (usize, &mut usize),
) -> Option<Vec<u8>> {
    let values = held.lights()?.values();
    let mut bytes_of = |wanted: &[u8]| {
        let mut coder = Writer::new(Vec::new());
        let coded = code_light_changes(&mut coder, (held.layout(), &mut *near), values, Some(wanted));
        debug_assert!(coded.is_some(), "only reading fails");
        coder.finish().len()
    };
    let mut wanted = light_changes(held, store, tolerances, 1)?;
    let mut bytes = bytes_of(&wanted);
    let mut times = 1;
    while bytes > most_bytes && times < COARSEST {
        times *= 2;
        // Where nothing is that far off, there still is something to say.
        let Some(fewer) = light_changes(held, store, tolerances, times) else { break };
        bytes = bytes_of(&fewer);
        wanted = fewer;
    }
    // Fewer each time, and by no less than an eighth, so that this ends.
    let mut changed = changed_values(values, &wanted);
    let turn = changed.partition_point(|index| index < next);
    changed.rotate_left(turn);
    while bytes > most_bytes {
        let share = (most_bytes as f64 / bytes as f64).min(0.97) * 0.9;
        let kept = (changed.len() as f64 * share) as usize;
        for index in changed.drain(kept..) {
            wanted[index] = values[index];
        }
        let last = changed.last()?;
        *next = last + 1;
        bytes = bytes_of(&wanted);
    }
    Some(wanted)
}

fn changed_values(held: &[u8], wanted: &[u8]) -> Vec<usize> {
    (0..held.len()).filter(|&index| held[index] != wanted[index]).collect()
}
