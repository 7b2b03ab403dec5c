//! Sets that come and go: one layout made from another.
//!
//! Everything here is pure: a change is found between two layouts, or made on one, and values go with the sets that stay.

use std::sync::Arc;

use super::layout::MAX_POINTS;
use super::{BentNormal, LayoutError, PointLayout, PointSet, PointStore};
use crate::light_visibility::{Lean, LightVisibility, OPEN};

/// Which sets make the difference between two layouts of the same lengths. A set whose points differ goes and comes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SetsChange {
    /// Instances whose sets go, ascending.
    pub removed: Vec<u32>,
    /// Instances whose sets come, ascending.
    pub added: Vec<u32>,
}

impl SetsChange {
    /// Whether both layouts are the same.
    pub fn is_empty(&self) -> bool {
        self.removed.is_empty() && self.added.is_empty()
    }
}

impl PointLayout {
    /// What makes `later` of this layout; `None` where their quantum or spacing differ, so that nothing can stay.
    pub fn difference(&self, later: &PointLayout) -> Option<SetsChange> {
        if !self.has_lengths_of(later) {
            return None;
        }
        let mut change = SetsChange::default();
        let (mut old, mut new) = (self.sets().iter().peekable(), later.sets().iter().peekable());
        loop {
            let next = match (old.peek(), new.peek()) {
                (Some(a), Some(b)) => a.instance.min(b.instance),
                (Some(set), None) | (None, Some(set)) => set.instance,
                (None, None) => return Some(change),
            };
            let a = old.next_if(|set| set.instance == next);
            let b = new.next_if(|set| set.instance == next);
            if let (Some(a), Some(b)) = (a, b)
                && a.has_points_of(b)
            {
                continue;
            }
            change.removed.extend(a.map(|set| set.instance));
            change.added.extend(b.map(|set| set.instance));
        }
    }

    /// This layout without the sets of the instances `removed` (ascending), and then with those of `added`.
    ///
    /// # Errors
    /// A set that is to go is not there, one that comes is, the lengths differ, or there would be more than [`MAX_POINTS`].
    pub fn with_sets(&self, removed: &[u32], added: &PointLayout) -> Result<PointLayout, LayoutError> {
        if !added.sets().is_empty() && !self.has_lengths_of(added) {
            return Err(LayoutError::OtherLengths);
        }
        if let Some(&instance) = removed.iter().find(|&&i| self.set_of_instance(i).is_none()) {
            return Err(LayoutError::NoSuchSet(instance));
        }
        let stays = |set: &&PointSet| removed.binary_search(&set.instance).is_err();
        let staying = || self.sets().iter().filter(stays);
        if let Some(set) = staying().find(|set| added.set_of_instance(set.instance).is_some()) {
            return Err(LayoutError::SetExists(set.instance));
        }
        let total = staying().chain(added.sets()).map(|set| set.len() as u64).sum();
        if total > u64::from(MAX_POINTS) {
            return Err(LayoutError::TooManyPoints(total));
        }
        let mut sets: Vec<PointSet> = staying().chain(added.sets()).cloned().collect();
        sets.sort_unstable_by_key(|set| set.instance);
        Ok(PointLayout::joined(self.quantum_m(), self.spacing_m(), sets))
    }

    /// Whether quantum and spacing are the same to the bit, so that sets of both can stand in one layout.
    pub fn has_lengths_of(&self, other: &PointLayout) -> bool {
        let lengths = |layout: &PointLayout| [layout.quantum_m(), layout.spacing_m()].map(f32::to_bits);
        lengths(self) == lengths(other)
    }

    /// The sets of some instances (ascending) alone; instances without a set are left out.
    pub fn only(&self, instances: &[u32]) -> PointLayout {
        let is_kept = |set: &&PointSet| instances.binary_search(&set.instance).is_ok();
        let sets = self.sets().iter().filter(is_kept).cloned().collect();
        PointLayout::joined(self.quantum_m(), self.spacing_m(), sets)
    }
}

impl PointSet {
    /// Whether both have the same points of the same instance, to the bit.
    fn has_points_of(&self, other: &PointSet) -> bool {
        let origin = |set: &PointSet| set.origin_rest.to_array().map(f32::to_bits);
        self.instance == other.instance
            && origin(self) == origin(other)
            && self.positions == other.positions
            && self.normals == other.normals
    }
}

impl PointStore {
    /// This store without the sets of the instances `removed` (ascending), and then with those of `added`; values stay.
    ///
    /// # Errors
    /// As of [`PointLayout::with_sets`].
    pub fn with_sets(&self, removed: &[u32], added: &PointStore) -> Result<PointStore, LayoutError> {
        let layout = Arc::new(self.layout().with_sets(removed, added.layout())?);
        Ok(self.carried(layout, added))
    }

    /// Values for the points of `layout`: of `added` where that has the set, else this store's, else open. With bent normals if either
    /// has some; what has none is unbent. So it is with lights: of as many as the one that has more, and open where it is not known.
    ///
    /// A set with another number of points than here counts as one that is not there.
    pub fn carried(&self, layout: Arc<PointLayout>, added: &PointStore) -> PointStore {
        let carry = |of: &dyn Fn(&PointStore) -> Option<&[u8]>, otherwise: u8| {
            carry_plane((self, added), &layout, of, otherwise)
        };
        let visibility = carry(&|store| Some(store.visibility.as_slice()), 255);
        let has_bent = self.bent.is_some() || added.bent.is_some();
        let plane = |k: usize| {
            carry(&|store| store.bent.as_ref().map(|planes| planes[k].as_slice()), BentNormal::UNBENT.0[k])
        };
        let bent = has_bent.then(|| Box::new([plane(0), plane(1)]));
        let count = self.light_count().max(added.light_count());
        let lights = (count > 0).then(|| {
            let of = |light| carry(&|store| store.lights().map(|lights| lights.of_light(light)), OPEN);
            let values = (0..count).flat_map(of).collect();
            let has_leans = |store: &PointStore| store.lights().is_some_and(LightVisibility::has_leans);
            let of = |light| carry_plane((self, added), &layout, leans_of(light), Lean::NONE);
            let leans = (has_leans(self) || has_leans(added)).then(|| (0..count).flat_map(of).collect());
            Box::new(LightVisibility::carried(layout.len(), count, values, leans))
        });
        PointStore { layout, visibility, bent, lights }
    }
}

fn leans_of<'a>(light: u32) -> impl Fn(&'a PointStore) -> Option<&'a [Lean]> {
    move |store| store.lights().map(|lights| lights.leans_of_light(light))
}

/// A plane of `layout`: of each set what `added` has, else what `old` has, else this.
fn carry_plane<'a, T: Copy + 'a>(
    (old, added): (&'a PointStore, &'a PointStore),
    layout: &PointLayout,
    of: impl Fn(&'a PointStore) -> Option<&'a [T]>,
    otherwise: T,
) -> Vec<T> {
    let mut values = Vec::with_capacity(layout.len());
    for set in layout.sets() {
        let same = |store: &PointStore| {
            let found = store.layout().set_of_instance(set.instance).filter(|f| f.len() == set.len());
            found.map(|f| f.first as usize..f.first as usize + f.len())
        };
        let (store, range) = match (same(added), same(old)) {
            (Some(range), _) => (added, range),
            (None, Some(range)) => (old, range),
            (None, None) => (added, 0..0),
        };
        // Of a light that a store does not have there is nothing.
        values.extend_from_slice(of(store).and_then(|plane| plane.get(range)).unwrap_or(&[]));
        values.resize(set.first as usize + set.len(), otherwise);
    }
    values
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use super::*;
    use crate::points::PackedNormal;
    use glam::Vec3;
    use proptest::prelude::*;

    fn store(instances: &[u32], version: u8) -> PointStore {
        let set = |&instance: &u32| {
            let count = instance % 4;
            PointSet {
                instance,
                origin_rest: Vec3::splat(f32::from(version)),
                positions: (0..count).map(|i| [i, 0, 0]).collect(),
                normals: vec![PackedNormal([127, 254]); count as usize],
                ..PointSet::default()
            }
        };
        let layout = PointLayout::new(0.5, 1.0, instances.iter().map(set).collect()).unwrap();
        let values = layout.sets().iter().flat_map(|s| vec![s.instance as u8 ^ version; s.len()]).collect();
        PointStore::new(layout.into(), values).unwrap()
    }

    fn instances() -> impl Strategy<Value = Vec<u32>> {
        prop::collection::btree_set(0u32..12, 0..8).prop_map(|set| set.into_iter().collect())
    }

    proptest! {
        #[test]
        fn a_difference_that_is_made_leads_to_the_other(
            from in instances(), to in instances(), same_version: bool,
        ) {
            let version = u8::from(!same_version);
            let (from, to) = (store(&from, 0), store(&to, version));
            let change = from.layout().difference(to.layout()).unwrap();
            // A set of no points has only an origin, which tells versions apart like any other.
            prop_assert_eq!(change.is_empty(), from.layout() == to.layout());
            let added = PointStore::new(
                to.layout().only(&change.added).into(),
                to.layout().sets().iter().filter(|s| change.added.contains(&s.instance))
                    .flat_map(|s| to.visibility()[s.first as usize..][..s.len()].to_vec()).collect(),
            ).unwrap();
            let made = from.with_sets(&change.removed, &added).unwrap();
            prop_assert_eq!(made.layout(), to.layout());
            let checked = PointLayout::new(0.5, 1.0, made.layout().sets().to_vec()).unwrap();
            prop_assert_eq!(&checked, &**made.layout());
            // What stays has its values from before, and these are by instance and version.
            prop_assert_eq!(made.visibility(), to.visibility());
        }
    }

    #[test]
    fn changes_that_do_not_fit_are_refused() {
        let held = store(&[1, 2, 3], 0);
        let refused = |removed: &[u32], added: &PointStore| held.with_sets(removed, added).unwrap_err();
        assert_eq!(refused(&[4], &store(&[], 0)), LayoutError::NoSuchSet(4));
        assert_eq!(refused(&[2], &store(&[3], 0)), LayoutError::SetExists(3));
        let sets = store(&[5], 0).layout().sets().to_vec();
        let other = PointStore::new(PointLayout::new(0.5, 2.0, sets).unwrap().into(), vec![0]).unwrap();
        assert_eq!(refused(&[], &other), LayoutError::OtherLengths);
        assert!(held.layout().difference(other.layout()).is_none());
        // Replaced by itself in one go.
        assert_eq!(held.with_sets(&[1, 2, 3], &store(&[1, 2, 3], 0)).unwrap(), held);
    }
}
