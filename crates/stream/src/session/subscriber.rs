//! Frames → the publisher's store.

use dapple_store::charts::Cuts;
use dapple_store::light_visibility::{LightChange, LightVisibility};
use dapple_store::points::{BentChange, LayoutError, PointStore, StoreError};

use crate::codec::{
    Changes, DecodeError, DecodedLayout, DecodedSets, DeltaParts, Extras, FrameHeader, FrameKind, Limits,
    Near, Scratch, ValueChange, decode_changes, decode_layout, decode_sets_change, decode_values, open,
    parse_delta, parse_snapshot,
};
use crate::session::sets::{apply, changes_between, difference};

/// What a frame did to the store, so that the receiver redoes only that.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Applied {
    /// A snapshot brought a layout: everything derived from points must be made anew.
    NewLayout,
    /// The points of whole instances went and came; what was derived from the others still holds, but their indices in the store
    /// may be others. A set that goes and comes is another one.
    Sets {
        /// Instances whose points went, ascending.
        removed: Vec<u32>,
        /// Instances whose points came, with the values that the store now holds, ascending.
        added: Vec<u32>,
        /// New values of points that stayed, in order of index, which is that in the store as it is now.
        changes: Vec<ValueChange>,
    },
    /// The points are the same; these have new values, in order of index.
    Changes(Vec<ValueChange>),
    /// Nothing; the frame was not needed.
    Ignored(IgnoreReason),
}

/// Why a sound frame was not needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IgnoreReason {
    /// Its group was replaced by a newer one.
    OlderGroup,
    /// The store is already further in its group.
    OldEpoch,
    /// The store is exactly there.
    Duplicate,
}

/// Why a frame could not be used. The store is as it was before.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReceiveError {
    /// The bytes are not a frame, or exceed the limits.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// The frame builds on a state that this end does not hold.
    #[error(
        "receive: the delta builds on group {group}, epoch {base_epoch}, but {} is held; ask for a snapshot",
        held.map_or("nothing".to_owned(), |(group, epoch)| format!("group {group}, epoch {epoch}"))
    )]
    NeedSnapshot {
        /// Group of the delta.
        group: u64,
        /// Epoch that it builds on.
        base_epoch: u64,
        /// Group and epoch that are held.
        held: Option<(u64, u64)>,
    },
    /// The light belongs to another scene.
    #[error(
        "receive: light of scene {}…, this end shows scene {}…; load the same scene on both ends",
        short(found),
        short(expected)
    )]
    WrongScene {
        /// Hash of the scene that this end shows.
        expected: [u8; 32],
        /// Hash in the snapshot.
        found: [u8; 32],
    },
    /// A part's points do not fit those of the others: it has instances of theirs, or points of another density.
    #[error("receive: a part does not fit the others: {0}")]
    Misfit(#[from] LayoutError),
}

impl ReceiveError {
    /// Whether a snapshot from the publisher ([`Publisher::join`](crate::Publisher::join)) would help: true for
    /// gaps and damage, false where the two ends do not fit each other.
    pub fn snapshot_helps(&self) -> bool {
        match self {
            ReceiveError::NeedSnapshot { .. } => true,
            ReceiveError::WrongScene { .. } | ReceiveError::Misfit(_) => false,
            ReceiveError::Decode(error) => matches!(
                error,
                DecodeError::Truncated { .. }
                    | DecodeError::TrailingBytes { .. }
                    | DecodeError::Corrupt { .. }
            ),
        }
    }
}

/// The receiving end: takes frames in any order, holds the newest state that they lead to.
#[derive(Clone, Debug)]
pub struct Subscriber {
    expected_scene_hash: Option<[u8; 32]>,
    limits: Limits,
    state: Option<State>,
}

#[derive(Clone, Debug)]
struct State {
    group: u64,
    epoch: u64,
    scene_hash: [u8; 32],
    /// The layout as it came, to know it again in the next snapshot without decoding it; empty once sets came or went.
    layout_bytes: Vec<u8>,
    /// Bits of a coordinate within its cell.
    local_bits: u32,
    cuts: Cuts,
    store: PointStore,
    /// Of the last frame.
    bent_changes: Vec<BentChange>,
    light_changes: Vec<LightChange>,
    near: Near,
    scratch: Scratch,
}

impl Subscriber {
    /// A subscriber that holds nothing. Snapshots of another scene than `expected_scene_hash` are refused;
    /// `None` takes any (default of tools that only look).
    pub fn new(expected_scene_hash: Option<[u8; 32]>, limits: Limits) -> Subscriber {
        Subscriber { expected_scene_hash, limits, state: None }
    }

    /// Takes one complete frame. Any bytes are welcome; on an error the store is as it was.
    pub fn receive(&mut self, bytes: &[u8]) -> Result<Applied, ReceiveError> {
        if let Some(state) = &mut self.state {
            state.bent_changes.clear();
            state.light_changes.clear();
        }
        let (header, payload) = open(bytes, &self.limits)?;
        if let Some(reason) = self.not_needed(&header) {
            return Ok(Applied::Ignored(reason));
        }
        match header.kind {
            FrameKind::Snapshot => self.receive_snapshot(&header, payload),
            FrameKind::Delta => self.receive_delta(&header, payload),
            FrameKind::Sets => self.receive_sets(&header, payload),
        }
    }

    /// What is held belongs to another stream from now on: it stays, and the next snapshot replaces it, whatever its group is (above 0).
    pub fn outdate(&mut self) {
        if let Some(state) = &mut self.state {
            (state.group, state.epoch) = (0, 0);
        }
    }

    /// From the next frame on these limits hold.
    pub(super) fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
    }

    /// Lets go of what is held: the next frame must be a snapshot.
    pub fn forget(&mut self) {
        self.state = None;
    }

    /// What is held, if anything yet.
    pub fn store(&self) -> Option<&PointStore> {
        self.state.as_ref().map(|state| &state.store)
    }

    /// Which bent normals the last frame changed of points that stayed, in order of index, which is that in the store as it is now. Empty
    /// where it changed none, as without bent normals, and where it brought another layout.
    pub fn bent_changes(&self) -> &[BentChange] {
        self.state.as_ref().map_or(&[], |state| &state.bent_changes)
    }

    /// How much of each light the points see, if the stream says so: [`PointStore::lights`] of what is held.
    pub fn lights(&self) -> Option<&LightVisibility> {
        self.store().and_then(PointStore::lights)
    }

    /// Which values of lights the last frame changed at points that stayed, in order of index, which is that in the store as it is now. Empty where it
    /// changed none, and where it brought another layout, or another number of lights.
    pub fn light_changes(&self) -> &[LightChange] {
        self.state.as_ref().map_or(&[], |state| &state.light_changes)
    }

    /// Which points do not count at which texels, with the layout that is held. Empty where the publisher sends none.
    pub fn cuts(&self) -> Option<&Cuts> {
        self.state.as_ref().map(|state| &state.cuts)
    }

    /// Group of the state that is held.
    pub fn group(&self) -> Option<u64> {
        self.state.as_ref().map(|state| state.group)
    }

    /// Epoch of the state that is held: that of its last change.
    pub fn epoch(&self) -> Option<u64> {
        self.state.as_ref().map(|state| state.epoch)
    }

    /// Bytes held for what comes next, by capacity: the encoded layout and what deltas are foretold from. Store and cuts, which
    /// others see, are not counted.
    pub fn bytes(&self) -> usize {
        self.state
            .as_ref()
            .map_or(0, |state| state.layout_bytes.capacity() + state.near.bytes() + state.scratch.bytes())
    }

    /// Hash of the scene that the held light belongs to.
    pub fn scene_hash(&self) -> Option<[u8; 32]> {
        self.state.as_ref().map(|state| state.scene_hash)
    }

    fn not_needed(&self, header: &FrameHeader) -> Option<IgnoreReason> {
        let state = self.state.as_ref()?;
        if header.group < state.group {
            Some(IgnoreReason::OlderGroup)
        } else if header.group > state.group || header.epoch > state.epoch {
            None
        } else if header.epoch < state.epoch {
            Some(IgnoreReason::OldEpoch)
        } else {
            Some(IgnoreReason::Duplicate)
        }
    }

    fn receive_snapshot(&mut self, header: &FrameHeader, payload: &[u8]) -> Result<Applied, ReceiveError> {
        let parts = parse_snapshot(payload)?;
        if let Some(expected) = self.expected_scene_hash
            && expected != parts.scene_hash
        {
            return Err(ReceiveError::WrongScene { expected, found: parts.scene_hash });
        }
        if let Some(state) = self.state.as_mut()
            && state.scene_hash == parts.scene_hash
            // Empty where sets came or went since: a layout is never that.
            && !state.layout_bytes.is_empty()
            && state.layout_bytes == parts.layout
        {
            let extras = Extras::of(&state.store);
            let store = decode_values(parts.values, state.store.layout().clone(), &state.near, extras)?;
            let changes = changes_between(&state.store, &store, &[]);
            (state.store, state.bent_changes, state.light_changes) = (store, changes.bent, changes.lights);
            (state.group, state.epoch) = (header.group, header.epoch);
            return Ok(Applied::Changes(changes.visibility));
        }
        let decoded = decode_layout(parts.layout, &self.limits)?;
        let DecodedLayout { layout, cuts, local_bits, extras } = decoded;
        let near = Near::new(&layout, local_bits);
        let mut store = decode_values(parts.values, layout.into(), &near, extras)?;
        let (mut applied, mut bent_changes, mut light_changes) = (Applied::NewLayout, Vec::new(), Vec::new());
        if let Some(state) = self.state.as_ref()
            && state.scene_hash == parts.scene_hash
            && let Some(change) = difference((&state.store, &state.cuts), (&store, &cuts))
        {
            let Changes { visibility: changes, bent, lights } =
                changes_between(&state.store, &store, &change.added);
            (bent_changes, light_changes) = (bent, lights);
            applied = if change.is_empty() {
                // Known again by its points: what shares the layout goes on doing so.
                store = PointStore::default().carried(state.store.layout().clone(), &store);
                Applied::Changes(changes)
            } else {
                Applied::Sets { removed: change.removed, added: change.added, changes }
            };
        }
        self.state = Some(State {
            group: header.group,
            epoch: header.epoch,
            scene_hash: parts.scene_hash,
            layout_bytes: parts.layout.to_vec(),
            local_bits,
            cuts,
            store,
            bent_changes,
            light_changes,
            near,
            scratch: Scratch::default(),
        });
        Ok(applied)
    }

    fn receive_delta(&mut self, header: &FrameHeader, payload: &[u8]) -> Result<Applied, ReceiveError> {
        let (parts, state) = self.base(header, payload)?;
        let State { store, near, scratch, .. } = state;
        let changes = decode_changes(&parts, store, near, scratch)?;
        apply(store, &changes).map_err(misfit)?;
        (state.bent_changes, state.light_changes) = (changes.bent, changes.lights);
        state.epoch = header.epoch;
        Ok(Applied::Changes(changes.visibility))
    }

    /// What builds on an epoch of this group, and the state at that very epoch.
    fn base<'a>(
        &mut self,
        header: &FrameHeader,
        payload: &'a [u8],
    ) -> Result<(DeltaParts<'a>, &mut State), ReceiveError> {
        let parts = parse_delta(header.epoch, payload)?;
        let held = self.state.as_ref().map(|state| (state.group, state.epoch));
        match &mut self.state {
            Some(state) if held == Some((header.group, parts.base_epoch)) => Ok((parts, state)),
            _ => {
                let (group, base_epoch) = (header.group, parts.base_epoch);
                Err(ReceiveError::NeedSnapshot { group, base_epoch, held })
            }
        }
    }

    fn receive_sets(&mut self, header: &FrameHeader, payload: &[u8]) -> Result<Applied, ReceiveError> {
        let limits = self.limits;
        let (parts, state) = self.base(header, payload)?;
        let held = (&state.store, &state.cuts, state.local_bits);
        let DecodedSets { gone, added, cuts, changes } = decode_sets_change(&parts, held, &limits)?;
        let mut store = state.store.with_sets(&gone, &added).map_err(DecodeError::from)?;
        let mut near = Near::new(store.layout(), state.local_bits);
        if let Some(parts) = &changes {
            let scratch = &mut state.scratch;
            let changes = decode_changes(parts, &store, &mut near, scratch)?;
            apply(&mut store, &changes).map_err(misfit)?;
        }
        let added: Vec<u32> = added.layout().sets().iter().map(|set| set.instance).collect();
        let Changes { visibility: changes, bent, lights } = changes_between(&state.store, &store, &added);
        state.cuts = state.cuts.with_sets(&gone, &cuts);
        (state.layout_bytes, state.bent_changes, state.light_changes) = (Vec::new(), bent, lights);
        (state.store, state.near, state.epoch) = (store, near, header.epoch);
        Ok(Applied::Sets { removed: gone, added, changes })
    }
}

/// The decoder has checked counts and indices already; should the store see more, the sender is at fault.
fn misfit(_: StoreError) -> DecodeError {
    DecodeError::Malformed { part: "values", reason: "do not fit the layout" }
}

/// First bytes of a hash, as text.
fn short(hash: &[u8; 32]) -> String {
    hash[..6].iter().map(|b| format!("{b:02x}")).collect()
}
