//! What both ends of a session ask of layouts whose sets come and go.

use dapple_store::charts::{Cuts, SetCuts};
use dapple_store::points::{PointStore, SetsChange};

use crate::codec::ValueChange;

/// Which sets make the difference between what was and what is, if any set with points stays and the lengths are the same. A set whose cuts
/// differ goes and comes.
pub(super) fn difference(old: (&PointStore, &Cuts), new: (&PointStore, &Cuts)) -> Option<SetsChange> {
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

/// The points of sets that stayed, all but those of the instances `added`, whose values differ; by their index in `new`.
pub(super) fn value_changes(old: &PointStore, new: &PointStore, added: &[u32]) -> Vec<ValueChange> {
    let mut changes = Vec::new();
    for set in new.layout().sets() {
        let Some(before) = old.layout().set_of_instance(set.instance) else { continue };
        if added.binary_search(&set.instance).is_ok() {
            continue;
        }
        let before = &old.visibility()[before.first as usize..][..before.len()];
        let now = &new.visibility()[set.first as usize..][..set.len()];
        let points = (set.first..).zip(before.iter().zip(now)).filter(|(_, (old, new))| old != new);
        changes.extend(points.map(|(point, (&old, &new))| ValueChange { point, old, new }));
    }
    changes
}
