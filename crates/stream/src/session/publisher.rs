//! States of a store → frames.

use std::sync::{Arc, OnceLock};

use dapple_store::charts::Cuts;
use dapple_store::light_visibility::LightVisibility;
use dapple_store::points::{PointLayout, PointStore, SetsChange};

use super::lights::{light_changes, lights_within};
use super::precision::Precision;
use super::sets::{apply, difference};
use super::within::{ENVELOPE_BYTES, Pressure, Search, Spending};
use crate::codec::{
    Changes, EncodedLayout, Extras, Fit, FrameKind, Goal, Near, PLANES, Scratch, Tolerances, append_changes,
    encode_layout, local_bits, planes, seal, sets_head, snapshot_payload, varint::write_varint,
};

/// How a [`Publisher`] numbers and cuts its groups, and how exact its deltas are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PublisherConfig {
    /// Number of the first group. Must exceed every group number that subscribers of this stream can have seen,
    /// also from an earlier process: milliseconds since 1970 at start will do. Default 0.
    /// At most 2⁶³ − 1; more is taken as that, so that groups cannot run out of numbers.
    pub first_group: u64,
    /// Deltas after which the next change starts a new group, whose snapshot then goes to everyone. Default 0:
    /// only a new layout or [`Publisher::start_group`] does. Relays that keep whole groups for late joiners need
    /// it; who asks [`Publisher::join`] for each joiner does not.
    pub deltas_per_group: u32,
    /// How exact deltas are.
    pub precision: Precision,
    /// How exact bent normals are in deltas, where what is published has some: in 127ths along each tangent.
    pub bent_precision: Precision,
}

impl PublisherConfig {
    /// Precisions within their ranges, by plane.
    fn precisions(&self) -> [Precision; PLANES] {
        [self.precision, self.bent_precision, self.bent_precision].map(Precision::in_range)
    }
}

/// One frame, ready for any transport.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Snapshot, delta or change of sets.
    pub kind: FrameKind,
    /// Its group.
    pub group: u64,
    /// Epoch of the store once it is applied.
    pub epoch: u64,
    /// The complete bytes on the wire.
    pub bytes: Arc<[u8]>,
}

/// The sending end: takes the state of each epoch, gives the frame that carries subscribers there.
///
/// It keeps what subscribers hold, some bytes a point to find out how to say what changed, and the encoded layout, and never an older state: a
/// subscriber that fell behind or joins takes a snapshot of the present one, made at most once an epoch.
#[derive(Clone, Debug)]
pub struct Publisher {
    scene_hash: [u8; 32],
    config: PublisherConfig,
    next_epoch: u64,
    /// Points that the last call changed.
    changed: u32,
    state: Option<State>,
    /// For layouts that are yet to come.
    cuts: Option<(Arc<PointLayout>, Cuts)>,
}

/// What subscribers that are up to date hold.
#[derive(Clone, Debug)]
struct State {
    store: PointStore,
    cuts: Cuts,
    /// Layout and cuts for snapshots, once someone needed one.
    encoded: OnceLock<EncodedLayout>,
    near: Near,
    scratch: Scratch,
    /// By plane.
    fits: [Fit; PLANES],
    pressure: Pressure,
    /// Which value of a light is the next in turn, where not all fit.
    next_light: usize,
    group: u64,
    /// Epoch of the last change, not of the last call.
    epoch: u64,
    deltas: u32,
    /// The snapshot of this very state, once someone needed it.
    snapshot: OnceLock<Frame>,
}

impl Publisher {
    /// A publisher of the scene with this hash. Nothing is sent before the first [`Publisher::publish`].
    pub fn new(scene_hash: [u8; 32], config: PublisherConfig) -> Publisher {
        Publisher { scene_hash, config, next_epoch: 0, changed: 0, state: None, cuts: None }
    }

    /// From the next [`Publisher::publish`] on, deltas are this exact.
    pub fn set_precision(&mut self, precision: Precision) {
        self.config.precision = precision;
    }

    /// Gives the cuts of a layout that is to be published next: they go out with its snapshots. Without them a layout
    /// has none. A layout that has been published keeps what it has, and so do sets of the layout before that stay: only those that come
    /// take theirs from here.
    pub fn set_cuts(&mut self, layout: Arc<PointLayout>, cuts: Cuts) {
        self.cuts = Some((layout, cuts));
    }

    /// How many bytes of each snapshot are cuts; 0 before the first [`Publisher::publish`].
    pub fn cut_bytes(&self) -> usize {
        self.state.as_ref().map_or(0, |state| state.encoded().cut_bytes)
    }

    /// Publishes the state of the next epoch; epochs count the calls, from 0. Gives the frame for subscribers
    /// that are up to date, or `None` where what they hold is within the tolerance: a still scene sends nothing.
    ///
    /// What changed is found here, by comparison with what subscribers hold, which [`Publisher::store`] then is. The frame is a
    /// delta, or a snapshot where a group starts: at first, with a new layout, and as [`PublisherConfig::deltas_per_group`] says. A layout
    /// that shares sets with the one before is no new one: the frame says which sets go and come.
    pub fn publish(&mut self, store: &PointStore) -> Option<Frame> {
        self.publish_within(store, &Spending::default())
    }

    /// As [`Publisher::publish`], with a delta that takes no more than so many bytes: what matters least is left as it is, or less
    /// exact, until a later call has room for it. Then what subscribers hold can be farther off than the tolerance. Where nothing worth
    /// saying fits, nothing is sent.
    ///
    /// Snapshots are as long as they are, and so is what brings sets, without news of those that stay; and where a group starts, subscribers get to the values that a delta within
    /// the limit would have brought.
    pub fn publish_within(&mut self, store: &PointStore, spending: &Spending<'_>) -> Option<Frame> {
        let epoch = self.next_epoch;
        let (frame, changed) = match &mut self.state {
            Some(state)
                if same_layout(state.store.layout(), store.layout())
                    && Extras::of(&state.store) == Extras::of(store) =>
            {
                let full = self.config.deltas_per_group;
                match state.encode_within(epoch, store, self.config.precisions(), spending) {
                    None => (None, 0),
                    Some(delta) if full > 0 && state.deltas >= full => {
                        // To the same values as without a new group: what subscribers hold does not depend on when groups start.
                        let (_, changed) = state.advance(epoch, delta);
                        (Some(state.start_group(epoch, &self.scene_hash)), changed)
                    }
                    Some(delta) => {
                        let (frame, changed) = state.advance(epoch, delta);
                        (Some(frame), changed)
                    }
                }
            }
            old => {
                let given = self.cuts.take().filter(|(layout, _)| same_layout(layout, store.layout()));
                let cuts = given.map_or(Cuts::default(), |(_, cuts)| cuts);
                if let Some(state) = old
                    && let Some(change) = state.difference(store)
                {
                    let full = self.config.deltas_per_group;
                    let ends = full > 0 && state.deltas >= full;
                    // Within a limit, what stays waits for the next frame.
                    let exact = spending.most_bytes.is_none();
                    let exact = exact.then(|| (self.config.precisions(), spending.light_tolerances));
                    let (frame, changed) = state.change_sets(epoch, (store, cuts), &change, exact);
                    let frame = if ends { state.start_group(epoch, &self.scene_hash) } else { frame };
                    (self.next_epoch, self.changed) = (epoch + 1, changed as u32);
                    return Some(frame);
                }
                let group =
                    old.as_ref().map_or(self.config.first_group.min(u64::MAX >> 1), |state| state.group + 1);
                let encoded = encode_layout(store.layout(), &cuts, Extras::of(store));
                let state = State {
                    near: Near::new(store.layout(), encoded.local_bits),
                    store: store.clone(),
                    cuts,
                    encoded: OnceLock::from(encoded),
                    scratch: Scratch::default(),
                    fits: Default::default(),
                    pressure: Pressure::default(),
                    next_light: 0,
                    group,
                    epoch,
                    deltas: 0,
                    snapshot: OnceLock::new(),
                };
                let frame = state.snapshot(&self.scene_hash);
                *old = Some(state);
                (Some(frame), store.visibility().len())
            }
        };
        (self.next_epoch, self.changed) = (epoch + 1, changed as u32);
        frame
    }

    /// What subscribers that are up to date hold, to the bit. `None` before the first [`Publisher::publish`].
    pub fn store(&self) -> Option<&PointStore> {
        self.state.as_ref().map(|state| &state.store)
    }

    /// How many points the last [`Publisher::publish`] gave subscribers new values of.
    pub fn changed(&self) -> u32 {
        self.changed
    }

    /// Bytes held for what subscribers hold and for saying what changed, by capacity; the layout, which is shared, not counted.
    pub fn bytes(&self) -> usize {
        self.state.as_ref().map_or(0, |state| {
            let cuts = state.cuts.sets().iter().map(|set| size_of_val(set) + size_of_val(&set.cuts[..]));
            state.store.value_bytes()
                + cuts.sum::<usize>()
                + state.encoded.get().map_or(0, |encoded| encoded.bytes.capacity())
                + state.near.bytes()
                + state.scratch.bytes()
                + state.snapshot.get().map_or(0, |frame| frame.bytes.len())
        })
    }

    /// What a subscriber that joins now, or fell behind, needs: one snapshot of the present state, after which
    /// it is up to date. `None` before the first [`Publisher::publish`].
    pub fn join(&self) -> Option<Frame> {
        self.state.as_ref().map(|state| state.snapshot(&self.scene_hash))
    }

    /// Starts a new group with the present state; its snapshot is for everyone. `None` before the first
    /// [`Publisher::publish`].
    pub fn start_group(&mut self) -> Option<Frame> {
        self.state.as_mut().map(|state| state.start_group(state.epoch, &self.scene_hash))
    }

    /// The group that subscribers that are up to date are in.
    pub fn group(&self) -> Option<u64> {
        self.state.as_ref().map(|state| state.group)
    }

    /// Epoch of the last change: the one that subscribers that are up to date hold.
    pub fn epoch(&self) -> Option<u64> {
        self.state.as_ref().map(|state| state.epoch)
    }
}

impl State {
    /// The snapshot of the present state. Its layout part is only copied.
    fn snapshot(&self, scene_hash: &[u8; 32]) -> Frame {
        let make = || Frame::new(FrameKind::Snapshot, self.group, self.epoch, &self.payload(scene_hash));
        self.snapshot.get_or_init(make).clone()
    }

    fn encoded(&self) -> &EncodedLayout {
        let extras = Extras::of(&self.store);
        self.encoded.get_or_init(|| encode_layout(self.store.layout(), &self.cuts, extras))
    }

    fn payload(&self, scene_hash: &[u8; 32]) -> Vec<u8> {
        snapshot_payload(scene_hash, self.encoded(), &self.near, &self.store)
    }

    /// Puts the present values into a new group at `epoch`.
    fn start_group(&mut self, epoch: u64, scene_hash: &[u8; 32]) -> Frame {
        let payload = self.payload(scene_hash);
        let frame = Frame::new(FrameKind::Snapshot, self.group + 1, epoch, &payload);
        (self.group, self.epoch, self.deltas) = (self.group + 1, epoch, 0);
        self.snapshot = OnceLock::from(frame.clone());
        frame
    }

    /// The delta to values as near to these as fits; `None` where there is nothing to say, or nothing fits.
    fn encode_within(
        &mut self,
        epoch: u64,
        store: &PointStore,
        precisions: [Precision; PLANES],
        spending: &Spending<'_>,
    ) -> Option<Delta> {
        let exact = precisions.map(|Precision { tolerance, step }| (Tolerances::Even(tolerance), step));
        let precision = precisions[0];
        let Some(most_bytes) = spending.most_bytes else {
            self.pressure = Pressure::default();
            let lights = light_changes(&self.store, store, spending.light_tolerances, (1, true));
            return self.encode(epoch, store, exact, lights.as_ref());
        };
        let most = most_bytes.saturating_sub(ENVELOPE_BYTES);
        let lights = lights_within(
            &self.store,
            store,
            &mut self.near,
            spending.light_tolerances,
            (most / 2, &mut self.next_light),
        );
        let lights = lights.as_ref();
        let mut best: Option<Delta> = None;
        let mut search = Search::new(self.pressure, precision, spending.coarseness);
        loop {
            let pressure = search.pressure();
            let found = if pressure.is_none() {
                self.encode(epoch, store, exact, lights)
            } else {
                let points = store.layout().len();
                let planes = precisions.iter().take(planes(store).count());
                let by_plane: Vec<_> = planes
                    .map(|precision| pressure.tolerances(*precision, spending.coarseness, points))
                    .collect();
                let of = |k: usize| by_plane.get(k).map(|(each, step)| (Tolerances::Each(each), *step));
                let goals = std::array::from_fn(|k| of(k).unwrap_or(exact[k]));
                self.encode(epoch, store, goals, lights)
            };
            let bytes = found.as_ref().map_or(0, |delta| delta.payload.len());
            match found {
                Some(delta)
                    if bytes <= most && best.as_ref().is_none_or(|best| best.payload.len() < bytes) =>
                {
                    best = Some(Delta { pressure, ..delta });
                }
                // Nothing is too far off.
                None if pressure.is_none() => self.pressure = pressure,
                // What does not fit says nothing of what the next one takes.
                _ => {}
            }
            match search.next(bytes, most) {
                Some(further) => search = further,
                None => break,
            }
        }
        if let Some(best) = &best {
            self.pressure = best.pressure;
        }
        best
    }

    /// The delta to values that are no farther from these than they may be, and to these of lights; `None` where there is nothing to say.
    fn encode(
        &mut self,
        epoch: u64,
        store: &PointStore,
        goals: [(Tolerances<'_>, u8); PLANES],
        lights: Option<&LightVisibility>,
    ) -> Option<Delta> {
        let goals = goals_of(&self.store, store, goals);
        if goals.is_none() && lights.is_none() {
            return None;
        }
        let goals = goals.unwrap_or_default();
        let mut out = Vec::new();
        write_varint(&mut out, epoch - self.epoch);
        let mut fits = self.fits;
        let (payload, changes) =
            append_changes(out, &mut self.near, &self.store, goals, lights, &mut fits, &mut self.scratch);
        Some(Delta { payload, changes, fits, pressure: Pressure::default() })
    }

    /// Goes on to the values of a delta, in the same group. Also says how many changed.
    fn advance(&mut self, epoch: u64, delta: Delta) -> (Frame, usize) {
        let Delta { payload, changes, fits, .. } = delta;
        apply(&mut self.store, &changes).expect("changes are of points of the store");
        self.fits = fits;
        self.epoch = epoch;
        self.deltas = self.deltas.saturating_add(1);
        self.snapshot = OnceLock::new();
        (Frame::new(FrameKind::Delta, self.group, epoch, &payload), changes.visibility.len())
    }

    /// Which sets lead to another layout, if it shares any with this one. What the frame would be is not weighed against a snapshot,
    /// which would have to be made for that: it is shorter by about what stays.
    fn difference(&self, store: &PointStore) -> Option<SetsChange> {
        difference((&self.store, &self.cuts), (store, &self.cuts))
    }

    /// Goes on to another layout in the same group, and to values within the tolerance if there is one for what stays; `cuts` are those
    /// of the sets that come. Also says how many points have other values, those that come included.
    fn change_sets(
        &mut self,
        epoch: u64,
        (store, cuts): (&PointStore, Cuts),
        change: &SetsChange,
        exact: Option<Exactness<'_>>,
    ) -> (Frame, usize) {
        let added = PointStore::default().carried(store.layout().only(&change.added).into(), store);
        let cuts = cuts.only(&change.added);
        let mut payload = sets_head(epoch - self.epoch, &change.removed, &added, &cuts);
        let mut changed = added.visibility().len();
        self.store = self.store.carried(store.layout().clone(), &added);
        self.cuts = self.cuts.with_sets(&change.removed, &cuts);
        self.near = Near::new(store.layout(), local_bits(store.layout()));
        let goals = exact.and_then(|(precisions, _)| {
            let exact = precisions.map(|Precision { tolerance, step }| (Tolerances::Even(tolerance), step));
            goals_of(&self.store, store, exact)
        });
        let lights =
            exact.and_then(|(_, tolerances)| light_changes(&self.store, store, tolerances, (1, true)));
        if goals.is_some() || lights.is_some() {
            let goals = goals.unwrap_or_default();
            let State { near, store: held, fits, scratch, .. } = self;
            let (bytes, changes) = append_changes(payload, near, held, goals, lights.as_ref(), fits, scratch);
            apply(held, &changes).expect("changes are of points of the store");
            (payload, changed) = (bytes, changed + changes.visibility.len());
        }
        (self.encoded, self.snapshot) = (OnceLock::new(), OnceLock::new());
        self.epoch = epoch;
        self.deltas = self.deltas.saturating_add(1);
        (Frame::new(FrameKind::Sets, self.group, epoch, &payload), changed)
    }
}

/// How far off each plane may be, and values of lights ([`Spending::light_tolerances`]).
type Exactness<'a> = ([Precision; PLANES], &'a [(u32, u8)]);

/// A delta that can be sent.
struct Delta {
    payload: Vec<u8>,
    changes: Changes,
    /// What is learned from it.
    fits: [Fit; PLANES],
    /// What it took to make it fit.
    pressure: Pressure,
}

/// What each plane of `held` is to be brought near to; `None` where all are near enough.
fn goals_of<'a>(
    held: &PointStore,
    store: &'a PointStore,
    how: [(Tolerances<'a>, u8); PLANES],
) -> Option<[Option<Goal<'a>>; PLANES]> {
    let mut goals = [const { None }; PLANES];
    for (((goal, held), values), (tolerances, step)) in
        goals.iter_mut().zip(planes(held)).zip(planes(store)).zip(how)
    {
        *goal = Goal::new(held, values, tolerances, step);
    }
    goals.iter().any(Option::is_some).then_some(goals)
}

impl Frame {
    fn new(kind: FrameKind, group: u64, epoch: u64, payload: &[u8]) -> Frame {
        Frame { kind, group, epoch, bytes: seal(kind, group, epoch, payload).into() }
    }
}

/// Whether the layouts are the same to the bit (`==` holds 0 and -0 to be equal).
fn same_layout(a: &Arc<PointLayout>, b: &Arc<PointLayout>) -> bool {
    let origins = |layout: &PointLayout| -> Vec<[u32; 3]> {
        layout.sets().iter().map(|set| set.origin_rest.to_array().map(f32::to_bits)).collect()
    };
    Arc::ptr_eq(a, b) || (a == b && origins(a) == origins(b))
}
