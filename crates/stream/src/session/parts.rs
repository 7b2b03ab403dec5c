//! Light that comes in parts, each from a publisher of its own: which instances have points in each of them.

use std::collections::BTreeMap;
use std::sync::Arc;

use dapple_store::charts::Cuts;
use dapple_store::light_visibility::{LightChange, MAX_VALUES};
use dapple_store::points::{
    BentChange, Change, LayoutError, PackedNormal, PointLayout, PointSet, PointStore,
};

use super::{Applied, ReceiveError, Subscriber};
use crate::codec::{Limits, ValueChange};

/// A subscriber of several publishers that puts their stores together. Parts come in any order, and whichever have come make the whole.
#[derive(Clone, Debug)]
pub struct Parts {
    expected_scene_hash: Option<[u8; 32]>,
    limits: Limits,
    parts: BTreeMap<u32, Part>,
    /// Whether anything has come.
    has_come: bool,
    whole: PointStore,
    cuts: Cuts,
    bent_changes: Vec<BentChange>,
    light_changes: Vec<LightChange>,
}

/// One publisher's light.
#[derive(Clone, Debug)]
struct Part {
    subscriber: Subscriber,
    /// Its instances that have points in the whole, ascending.
    instances: Vec<u32>,
}

impl Parts {
    /// Holds nothing. The scene's hash is that of each part, as in [`Subscriber::new`]; the limits are those of all parts together.
    pub fn new(expected_scene_hash: Option<[u8; 32]>, limits: Limits) -> Parts {
        Parts {
            expected_scene_hash,
            limits,
            parts: BTreeMap::new(),
            has_come: false,
            whole: PointStore::default(),
            cuts: Cuts::default(),
            bent_changes: Vec::new(),
            light_changes: Vec::new(),
        }
    }

    /// Takes a complete frame of a part. What it did is said of the whole: indices are those of [`Parts::store`].
    ///
    /// # Errors
    /// The frame does not fit what is held, which is as it was. After [`ReceiveError::Misfit`] the part's next frame must be a snapshot.
    pub fn receive(&mut self, part: u32, frame: &[u8]) -> Result<Applied, ReceiveError> {
        self.bent_changes.clear();
        self.light_changes.clear();
        let new = || Part {
            subscriber: Subscriber::new(self.expected_scene_hash, self.limits),
            instances: Vec::new(),
        };
        let left = self.left_for(part);
        let subscriber = &mut self.parts.entry(part).or_insert_with(new).subscriber;
        subscriber.set_limits(left);
        match subscriber.receive(frame)? {
            Applied::Ignored(reason) => Ok(Applied::Ignored(reason)),
            Applied::Changes(changes) => Ok(Applied::Changes(self.change(part, &changes))),
            // The part says which of its sets differ; the others stay in the whole as they are.
            Applied::Sets { removed, added, changes } => {
                let changes = self.replace(part, &removed, &added, changes)?;
                Ok(Applied::Sets { removed, added, changes })
            }
            Applied::NewLayout => {
                let is_first = self.whole.layout().sets().is_empty();
                let removed = self.parts[&part].instances.clone();
                let added = instances(self.parts[&part].subscriber.store());
                self.replace(part, &removed, &added, Vec::new())?;
                Ok(if is_first {
                    Applied::NewLayout
                } else {
                    Applied::Sets { removed, added, changes: Vec::new() }
                })
            }
        }
    }

    /// The next frame of a part is of another publisher: it must be a snapshot, of whatever group. What came before stays until then.
    pub fn begin(&mut self, part: u32) {
        if let Some(part) = self.parts.get_mut(&part) {
            part.subscriber.forget();
        }
    }

    /// What is held of any part belongs to other streams from now on, as in [`Subscriber::outdate`].
    pub fn outdate(&mut self) {
        for part in self.parts.values_mut() {
            part.subscriber.outdate();
        }
    }

    /// Everything that has come, if anything has.
    pub fn store(&self) -> Option<&PointStore> {
        self.has_come.then_some(&self.whole)
    }

    /// Which points do not count at which texels; empty where publishers send none.
    pub fn cuts(&self) -> &Cuts {
        &self.cuts
    }

    /// As [`Subscriber::bent_changes`], of the whole.
    pub fn bent_changes(&self) -> &[BentChange] {
        &self.bent_changes
    }

    /// As [`Subscriber::light_changes`], of the whole.
    pub fn light_changes(&self) -> &[LightChange] {
        &self.light_changes
    }

    /// What has come of one part.
    pub fn part(&self, part: u32) -> Option<&Subscriber> {
        self.parts.get(&part).map(|part| &part.subscriber)
    }

    /// Bytes held beside the whole, by capacity or, of stores, by their points; the parts' cuts, which the whole has once more, are not counted.
    pub fn bytes(&self) -> usize {
        const A_PLACE: usize = size_of::<[u32; 3]>() + size_of::<PackedNormal>();
        let points = |store: &PointStore| store.value_bytes() + store.layout().len() * A_PLACE;
        let of = |part: &Part| part.subscriber.store().map_or(0, points) + part.subscriber.bytes();
        self.parts.values().map(of).sum()
    }

    /// What the other parts leave of the limits.
    fn left_for(&self, number: u32) -> Limits {
        let less = |limit: u32, used: u64| limit.saturating_sub(u32::try_from(used).unwrap_or(u32::MAX));
        let others = || {
            let others = self.parts.iter().filter(|(other, _)| **other != number);
            others.map(|(_, part)| &part.subscriber)
        };
        let stores = || others().filter_map(Subscriber::store);
        let cuts = others().filter_map(Subscriber::cuts).map(|cuts| cuts.site_count() as u64).sum();
        let lights = stores().filter_map(PointStore::lights).map(|lights| lights.values().len() as u64).sum();
        Limits {
            max_points: less(self.limits.max_points, stores().map(|store| store.layout().len() as u64).sum()),
            max_sets: less(
                self.limits.max_sets,
                stores().map(|store| store.layout().sets().len() as u64).sum(),
            ),
            max_cuts: less(self.limits.max_cuts, cuts),
            max_light_values: less(self.limits.max_light_values.min(MAX_VALUES as u32), lights),
            ..self.limits
        }
    }

    /// Brings the whole to a part's new values.
    fn change(&mut self, part: u32, changes: &[ValueChange]) -> Vec<ValueChange> {
        let part = &self.parts[&part].subscriber;
        let layout = part.store().expect("changes are of a store").layout();
        let mut place = places(layout, self.whole.layout());
        let changes: Vec<ValueChange> = changes
            .iter()
            .filter_map(|change| Some(ValueChange { point: place(change.point)?, ..*change }))
            .collect();
        let mut place = places(layout, self.whole.layout());
        let bent = part.bent_changes().iter();
        self.bent_changes =
            bent.filter_map(|change| Some(BentChange { point: place(change.point)?, ..*change })).collect();
        let points = layout.len() as u32;
        let wholes = self.whole.layout().len() as u32;
        let mut lights = Vec::with_capacity(part.light_changes().len());
        // Changes are light by light, and each light begins with the first point again.
        for of_light in part.light_changes().chunk_by(|a, b| a.index / points == b.index / points) {
            let mut place = places(layout, self.whole.layout());
            lights.extend(of_light.iter().filter_map(|change| {
                let (light, point) = (change.index / points, place(change.index % points)?);
                Some(LightChange { index: light * wholes + point, ..*change })
            }));
        }
        self.light_changes = lights;
        let news: Vec<Change> =
            changes.iter().map(|change| Change { point: change.point, visibility: change.new }).collect();
        self.whole.apply(&news).expect("they are points of the whole");
        self.whole.apply_bent(&self.bent_changes).expect("the whole has what its parts have");
        self.whole.apply_lights(&self.light_changes).expect("the whole has the lights of its parts");
        changes
    }

    /// Puts sets of a part in the place of others of it; `changes` are those of its points that stay.
    fn replace(
        &mut self,
        number: u32,
        removed: &[u32],
        added: &[u32],
        changes: Vec<ValueChange>,
    ) -> Result<Vec<ValueChange>, ReceiveError> {
        let replaced = self.try_replace(number, removed, added);
        if let Err(error) = replaced {
            // What it says next would not fit either: it begins anew.
            self.begin(number);
            return Err(error.into());
        }
        Ok(self.change(number, &changes))
    }

    fn try_replace(&mut self, number: u32, removed: &[u32], added: &[u32]) -> Result<(), LayoutError> {
        let part = &self.parts[&number];
        let of_part = part.subscriber.store().expect("it has just come");
        let (held, found) = (self.whole.light_count(), of_part.light_count());
        let stays = |set: &PointSet| removed.binary_search(&set.instance).is_err();
        let whole = if !self.whole.layout().sets().iter().any(stays) {
            of_part.clone()
        } else if held != found {
            // As many lights as one part has, times as many points as another has, may be more than both together.
            return Err(LayoutError::OtherLights { held, found });
        } else {
            let coming = Arc::new(of_part.layout().only(added));
            self.whole.with_sets(removed, &PointStore::default().carried(coming, of_part))?
        };
        let cuts = part.subscriber.cuts().map(|cuts| cuts.only(added)).unwrap_or_default();
        let all = instances(Some(of_part));
        self.cuts = self.cuts.with_sets(removed, &cuts);
        (self.whole, self.has_come) = (whole, true);
        self.parts.get_mut(&number).expect("it was there").instances = all;
        Ok(())
    }
}

fn instances(store: Option<&PointStore>) -> Vec<u32> {
    store.map_or_else(Vec::new, |store| store.layout().sets().iter().map(|set| set.instance).collect())
}

/// Where in the whole the points of a part are, to be asked in their order.
fn places(part: &PointLayout, whole: &PointLayout) -> impl FnMut(u32) -> Option<u32> + use<> {
    let first_of = |instance| whole.set_of_instance(instance).map(|set| set.first);
    let sets: Vec<_> = part
        .sets()
        .iter()
        .map(|set| (set.first..set.first + set.len() as u32, first_of(set.instance)))
        .collect();
    let mut at = 0;
    move |point| {
        while point >= sets[at].0.end {
            at += 1;
        }
        sets[at].1.map(|first| first + point - sets[at].0.start)
    }
}
