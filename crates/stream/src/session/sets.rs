//! What both ends of a session ask of layouts whose sets come and go.

use dapple_store::charts::{Cuts, SetCuts};
use dapple_store::light_visibility::LightChange;
use dapple_store::points::{BentChange, Change, PointStore, SetsChange, StoreError};

use crate::codec::{Changes, Extras, ValueChange};

/// Which sets make the difference between what was and what is, if any set with points stays, the lengths are the same, and both have the same
/// beside visibility. A set whose cuts differ goes and comes.
pub(super) fn difference(old: (&PointStore, &Cuts), new: (&PointStore, &Cuts)) -> Option<SetsChange> {
    if Extras::of(old.0) != Extras::of(new.0) {
        return None;
    }
    let mut change = old.0.layout().difference(new.0.layout())?;
    let mut stays = false;
    for set in new.0.layout().sets() {
        let instance = set.instance;
        if change.added.binary_search(&instance).is_ok() {
            continue;
        }
        if cuts_of(old.1, instance) == cuts_of(new.1, instance) {
            stays |= !set.is_empty();
            continue;
        }
        change.removed.push(instance);
        change.added.push(instance);
    }
    change.removed.sort_unstable();
    change.added.sort_unstable();
    (stays || change.is_empty()).then_some(change)
}

fn cuts_of(cuts: &Cuts, instance: u32) -> Option<&SetCuts> {
    let sets = cuts.sets();
    sets.binary_search_by_key(&instance, |set| set.instance).ok().map(|at| &sets[at])
}

/// What differs of the points of sets that stayed, all but those of the instances `added`; by their index in `new`.
pub(super) fn changes_between(old: &PointStore, new: &PointStore, added: &[u32]) -> Changes {
    let mut changes = Changes::default();
    for set in new.layout().sets() {
        let Some(before) = old.layout().set_of_instance(set.instance) else { continue };
        if added.binary_search(&set.instance).is_ok() {
            continue;
        }
        let values = &old.visibility()[before.first as usize..][..before.len()];
        let now = &new.visibility()[set.first as usize..][..set.len()];
        let points = (set.first..).zip(values.iter().zip(now)).filter(|(_, (old, new))| old != new);
        changes.visibility.extend(points.map(|(point, (&old, &new))| ValueChange { point, old, new }));
        let places = (set.first..).zip(before.first..).take(set.len());
        changes.bent.extend(places.filter_map(|(point, was)| {
            let (old, new) = old.bent_of(was as usize).zip(new.bent_of(point as usize))?;
            (old != new).then_some(BentChange { point, old, new })
        }));
    }
    changes.lights = light_changes(old, new, added);
    changes
}

/// The same of lights' visibility, where both have as many lights.
fn light_changes(old: &PointStore, new: &PointStore, added: &[u32]) -> Vec<LightChange> {
    let mut changes = Vec::new();
    let (Some(before), Some(now)) = (old.lights(), new.lights()) else { return changes };
    if before.lights() != now.lights() {
        return changes;
    }
    for light in 0..now.lights() {
        let first = light as usize * now.points();
        for set in new.layout().sets() {
            let was = old.layout().set_of_instance(set.instance);
            let Some(was) = was.filter(|_| added.binary_search(&set.instance).is_err()) else { continue };
            let values = &before.of_light(light)[was.first as usize..][..was.len()];
            let new = &now.of_light(light)[set.first as usize..][..set.len()];
            let places =
                (first + set.first as usize..).zip(light as usize * before.points() + was.first as usize..);
            for ((at, was_at), (&old, &new)) in places.zip(values.iter().zip(new)) {
                let (old_lean, new_lean) = (before.lean(was_at), now.lean(at));
                if old != new || old_lean != new_lean {
                    changes.push(LightChange { index: at as u32, old, new, old_lean, new_lean });
                }
            }
        }
    }
    changes
}

/// Brings a store to what a frame says.
pub(super) fn apply(store: &mut PointStore, changes: &Changes) -> Result<(), StoreError> {
    let visibility = |c: &ValueChange| Change { point: c.point, visibility: c.new };
    let news: Vec<Change> = changes.visibility.iter().map(visibility).collect();
    store.apply(&news)?;
    store.apply_bent(&changes.bent)?;
    store.apply_lights(&changes.lights)
}
