//! Sets that come and go: what stays is kept, what goes gives its texels back, what comes is made like any other.

use std::sync::Arc;

use dapple_scene::Scene;
use dapple_store::charts::Cuts;
use dapple_store::points::PointLayout;

use super::{BuildError, SetState, VisibilityAtlas};

impl VisibilityAtlas {
    /// Goes on with another layout, in which the sets of the instances `removed` (ascending) are gone or are others, and all others stay
    /// as they were; where there are more, these come. `cuts` are those of all sets that there are now. The texels of what
    /// stays do not change; those of what goes are open and free; what comes is made by [`VisibilityAtlas::work`], and fades in.
    ///
    /// Changes of values are applied afterwards, by their indices in the new layout.
    pub fn change_sets(
        &mut self,
        scene: &Scene,
        layout: Arc<PointLayout>,
        cuts: Option<&Cuts>,
        removed: &[u32],
    ) {
        let before = std::mem::replace(&mut self.layout, layout);
        let sets = self.layout.sets();
        // Where each of the sets before is now.
        let now: Vec<Option<usize>> = before
            .sets()
            .iter()
            .map(|set| {
                let stays = removed.binary_search(&set.instance).is_err();
                let at = sets.binary_search_by_key(&set.instance, |set| set.instance).ok();
                at.filter(|at| stays && sets[*at].len() == set.len())
            })
            .collect();
        let states = std::mem::replace(&mut self.sets, sets.iter().map(|_| SetState::Open).collect());
        for ((state, at), set) in states.into_iter().zip(&now).zip(before.sets()) {
            match (at, state) {
                (Some(at), state) => self.sets[*at] = state,
                (None, SetState::Ready(ready)) => {
                    let sides = ready.placements.len() / ready.charts.pages().len().max(1);
                    self.pages.free(&ready.placements, &ready.charts.pages().repeat(sides));
                    if let Some(texels) = &mut self.light_texels {
                        texels.free(&ready.placements, ready.charts.pages());
                    }
                    self.texels -= ready.sums.len() as u64;
                    self.gone.push(set.instance);
                }
                (None, SetState::Open) => {}
            }
        }
        let pages = &self.pages;
        self.fading.retain(|address| pages.is_listed(*address));
        // The last of the fresh sets are those that nobody has asked for: they leave together.
        let asked = self.fresh.len() - self.ready.len();
        let unasked = self.fresh.split_off(asked);
        let mut stays = unasked.iter().map(|set| now[*set].is_some());
        self.ready.retain(|_| stays.next().unwrap_or(false));
        self.fresh = self.fresh.drain(..).chain(unasked).filter_map(|set| now[set]).collect();
        if let Some(job) = &mut self.job {
            match now[job.set] {
                Some(at) => job.set = at,
                None => self.job = None,
            }
        }
        // What found no room may find it now, if some went.
        self.failed.retain(|(instance, error)| {
            let finds_none = removed.is_empty() || matches!(error, BuildError::Charts(_));
            removed.binary_search(instance).is_err() && finds_none
        });
        self.cuts = cuts.cloned();
        self.queue_open(scene);
    }

    /// Instances whose texels went since the last call, in any order. To be taken off what is drawn before what
    /// [`VisibilityAtlas::take_ready`] gives is put on it: their place may be another's, and they may be back already.
    pub fn take_gone(&mut self) -> Vec<u32> {
        std::mem::take(&mut self.gone)
    }

    /// Everything waits that is not ready, not being made and not impossible.
    pub(super) fn queue_open(&mut self, scene: &Scene) {
        let sets = self.layout.sets();
        let waits = |i: &usize| {
            let instance = sets[*i].instance;
            matches!(self.sets[*i], SetState::Open)
                && !sets[*i].is_empty()
                && scene.instances.get(instance as usize).is_some()
                && self.job.as_ref().is_none_or(|job| job.set != *i)
                && !self.failed.iter().any(|(failed, _)| *failed == instance)
        };
        self.queue = (0..sets.len()).filter(waits).collect();
        // The largest last, where it is taken from first.
        self.queue.sort_by_key(|&i| (sets[i].len(), std::cmp::Reverse(i)));
    }
}
