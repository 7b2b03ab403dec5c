//! Which values of lights a delta brings, and how many fit.

use dapple_store::light_visibility::{LightVisibility, OPEN};
use dapple_store::points::PointStore;

use crate::codec::Near;
use crate::codec::entropy::Writer;
use crate::light_visibility::code_light_changes;

/// Tolerances are raised up to so many times before fewer values are sent.
const COARSEST: u32 = 16;

/// What subscribers are to hold of `store`: what is off by more than `times` its tolerance (index and steps, ascending; 0 of those that are not
/// listed, but where `times` is above 1, one step of all), and with `turns` what leans farther off than a step, as it is there, the rest as it is `held`.
/// `None` where all of it is near enough.
pub(super) fn light_changes(
    held: &PointStore,
    store: &PointStore,
    tolerances: &[(u32, u8)],
    (times, turns): (u32, bool),
) -> Option<LightVisibility> {
    let (held, new) = (held.lights()?, store.lights()?);
    let turns = turns && new.has_leans();
    let mut wanted: Option<LightVisibility> = None;
    let mut tolerances = tolerances.iter().peekable();
    for (index, (old, value)) in held.values().iter().zip(new.values()).enumerate() {
        if old == value && !(turns && held.lean(index) != new.lean(index)) {
            continue;
        }
        let (old_lean, lean) = (held.lean(index), new.lean(index));
        while tolerances.next_if(|(listed, _)| (*listed as usize) < index).is_some() {}
        let tolerance = tolerances.peek().filter(|(listed, _)| *listed as usize == index);
        let tolerance = tolerance.map_or(0, |(_, steps)| u32::from(*steps));
        let steps = tolerance.max(u32::from(times > 1));
        // What is not half seen there, or hardly shines, need not lean.
        let leans = |value: u8| value > 0 && value < OPEN;
        let is_turned = turns
            && leans(*old)
            && leans(*value)
            && tolerance < u32::from(OPEN)
            && lean.is_far_from(old_lean);
        if u32::from(old.abs_diff(*value)) > times * steps || is_turned {
            wanted.get_or_insert_with(|| held.clone()).set(index, *value, lean);
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
) -> Option<LightVisibility> {
    let before = held.lights()?;
    let mut bytes_of = |wanted: &LightVisibility| {
        let mut coder = Writer::new(Vec::new());
        let coded = code_light_changes(&mut coder, (held.layout(), &mut *near), before, Some(wanted));
        debug_assert!(coded.is_some(), "only reading fails");
        coder.finish().len()
    };
    let mut wanted = light_changes(held, store, tolerances, (1, true))?;
    let mut bytes = bytes_of(&wanted);
    // How much is seen is worth more than where.
    if bytes > most_bytes
        && let Some(fewer) = light_changes(held, store, tolerances, (1, false))
    {
        (bytes, wanted) = (bytes_of(&fewer), fewer);
    }
    let mut times = 1;
    while bytes > most_bytes && times < COARSEST {
        times *= 2;
        // Where nothing is that far off, there still is something to say.
        let Some(fewer) = light_changes(held, store, tolerances, (times, false)) else { break };
        bytes = bytes_of(&fewer);
        wanted = fewer;
    }
    // Fewer each time, and by no less than an eighth, so that this ends.
    let mut changed = changed_values(before, &wanted);
    let turn = changed.partition_point(|index| index < next);
    changed.rotate_left(turn);
    while bytes > most_bytes {
        let share = (most_bytes as f64 / bytes as f64).min(0.97) * 0.9;
        let kept = (changed.len() as f64 * share) as usize;
        for index in changed.drain(kept..) {
            wanted.set(index, before.values()[index], before.lean(index));
        }
        let last = changed.last()?;
        *next = last + 1;
        bytes = bytes_of(&wanted);
    }
    Some(wanted)
}

fn changed_values(held: &LightVisibility, wanted: &LightVisibility) -> Vec<usize> {
    let differs = |index: &usize| {
        held.values()[*index] != wanted.values()[*index] || held.lean(*index) != wanted.lean(*index)
    };
    (0..held.values().len()).filter(differs).collect()
}
