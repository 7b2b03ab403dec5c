//! What both ends of a session ask of layouts whose sets come and go.

use dapple_store::charts::{Cuts, SetCuts};
use dapple_store::points::{BentChange, Change, PointStore, SetsChange, StoreError};

use crate::codec::{Changes, ValueChange};

/// Which sets make the difference between what was and what is, if any set with points stays, the lengths are the same, and both have bent
/// normals or neither. A set whose cuts differ goes and comes.
pub(super) fn difference(old: (&PointStore, &Cuts), new: (&PointStore, &Cuts)) -> Option<SetsChange> {
    if old.0.bent().is_some() != new.0.bent().is_some() {
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
    changes
}

/// Brings a store to what a frame says.
pub(super) fn apply(store: &mut PointStore, changes: &Changes) -> Result<(), StoreError> {
    let visibility = |c: &ValueChange| Change { point: c.point, visibility: c.new };
    let news: Vec<Change> = changes.visibility.iter().map(visibility).collect();
    store.apply(&news)?;
    store.apply_bent(&changes.bent)
}
