//! The scene's state, and what led to it of late.

use std::collections::VecDeque;
use std::sync::Arc;

use dapple_scene::{Edit, Edits, Scene};

use crate::{Event, FromHost, SceneClock};

/// Most edits that are kept to tell viewers what changed; who holds an older state gets all of it.
const MAX_KEPT_EDITS: usize = 512;

/// What can change of a scene, with its versions.
pub(super) struct SceneState {
    edits: Edits,
    clock: SceneClock,
    version: u64,
    /// What led to the last versions, one entry each, oldest first.
    log: VecDeque<Vec<Edit>>,
    kept: usize,
    /// The text of the whole state, and the last change's, once someone needed them.
    whole: Option<Arc<str>>,
    last_change: Option<Arc<str>>,
}

impl SceneState {
    pub(super) fn new(scene: &Scene, clock: SceneClock) -> SceneState {
        SceneState {
            edits: Edits::new(scene),
            clock,
            version: 1,
            log: VecDeque::new(),
            kept: 0,
            whole: None,
            last_change: None,
        }
    }

    pub(super) fn version(&self) -> u64 {
        self.version
    }

    pub(super) fn clock(&self) -> SceneClock {
        self.clock
    }

    pub(super) fn edits(&self) -> &Edits {
        &self.edits
    }

    /// What to tell who was last told this version (0: none).
    pub(super) fn news(&mut self, told: u64) -> Option<Arc<str>> {
        if told == self.version {
            return None;
        }
        let behind = self.version.checked_sub(told).filter(|_| told > 0).map(|behind| behind as usize);
        let (version, clock) = (self.version, self.clock);
        match behind.filter(|behind| *behind <= self.log.len()) {
            Some(1) => {
                let last = self.log.back().expect("there is an entry for each version kept");
                let make = || {
                    let edits = last.clone();
                    FromHost::Changes { from: told, to: version, clock, edits }.to_text().into()
                };
                Some(self.last_change.get_or_insert_with(make).clone())
            }
            Some(behind) => {
                let entries = self.log.iter().skip(self.log.len() - behind);
                let edits = entries.flatten().cloned().collect();
                Some(FromHost::Changes { from: told, to: version, clock, edits }.to_text().into())
            }
            None => {
                let make = || {
                    let edits = self.edits.clone();
                    FromHost::State { version, clock, edits }.to_text().into()
                };
                Some(self.whole.get_or_insert_with(make).clone())
            }
        }
    }

    /// Begins to change it, at a moment of the host's clock.
    pub(super) fn batch(&mut self, now_us: u64) -> Batch<'_> {
        Batch { now_us, edits: Vec::new(), clock: self.clock, state: self }
    }
}

/// The changes of one step, which are one version.
pub(super) struct Batch<'a> {
    state: &'a mut SceneState,
    now_us: u64,
    edits: Vec<Edit>,
    clock: SceneClock,
}

impl Batch<'_> {
    /// Makes an event take effect, or says why it does not.
    pub(super) fn apply(&mut self, scene: &Scene, event: Event) -> Result<(), String> {
        match event {
            Event::Play => self.clock = self.clock.with_playing(true, self.now_us),
            Event::Pause => self.clock = self.clock.with_playing(false, self.now_us),
            Event::Seek { time_s } => {
                if !(0.0..=SceneClock::MAX_TIME_S).contains(&time_s) {
                    return Err(format!(
                        "a time of {time_s} s is not within 0 to {}",
                        SceneClock::MAX_TIME_S
                    ));
                }
                self.clock = self.clock.with_time((time_s * 1e6).round() as u64, self.now_us);
            }
            Event::Edit { change } => self.edit(scene, &change)?,
            Event::Add { like, placement } => {
                let free = self.state.edits.free_like(scene, like).ok_or_else(|| {
                    format!(
                        "there is no free instance like {like}: remove one first, or start the host with more spare ones (--spare)"
                    )
                })?;
                let node = scene.instances[free as usize].node;
                self.edit(scene, &Edit::Place { node, placement })?;
                self.edit(scene, &Edit::Restore { instance: free })?;
            }
        }
        Ok(())
    }

    fn edit(&mut self, scene: &Scene, edit: &Edit) -> Result<(), String> {
        // What is told is what was applied, in its normal form.
        let applied = edit.normalized();
        self.state.edits.apply(scene, &applied).map_err(|error| error.to_string())?;
        if let Edit::Place { node, .. } = applied {
            // Of a drag only the end counts.
            self.edits.retain(|edit| !matches!(edit, Edit::Place { node: other, .. } if *other == node));
        }
        self.edits.push(applied);
        Ok(())
    }

    /// Makes them a version, if there are any.
    pub(super) fn end(self) {
        if self.edits.is_empty() && self.clock == self.state.clock {
            return;
        }
        let state = self.state;
        state.clock = self.clock;
        state.version += 1;
        (state.whole, state.last_change) = (None, None);
        state.kept += self.edits.len();
        state.log.push_back(self.edits);
        while state.kept > MAX_KEPT_EDITS || state.log.len() > MAX_KEPT_EDITS {
            let Some(oldest) = state.log.pop_front() else { break };
            state.kept -= oldest.len();
        }
    }
}
