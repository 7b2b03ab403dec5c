//! The visibility atlas: points resolved into texels of rest-space charts by fixed weights, exactly, where values change.
//!
//! Takes a layout, a scene, the values of the points and their changes; gives texels `[old, new]` in layers, which a
//! fragment reads once, bilinearly. See `README.md`.

mod bent;
mod job;
mod light_texels;
mod lights;
mod mix;
mod pages;
mod resolve;
mod sets;
#[cfg(test)]
pub(crate) mod tests;
mod twin;
mod upload;

use std::sync::Arc;

use dapple_scene::Scene;
use dapple_store::charts::{AtlasError, ChartError, ChartSet, Cuts, InstanceKey, WeightParams};
use dapple_store::points::PointLayout;

pub use dapple_store::charts::Placement;
pub use light_texels::{LIGHTS_A_TEXEL, PLANES_WITH_LEANS};
pub use pages::{DirtyBand, MAX_LAYERS};
pub use upload::TexelInfo;

use bent::BentSums;
use job::{ENCODED_A_TEXEL, Job, SUMMED_A_TEXEL, Stage, VISITS_A_TEXEL};
use light_texels::LightTexels;
use lights::LightSums;
use pages::{Pages, PlacedPages};
use resolve::{PointTexels, Sums};

/// How an atlas is made. Cuts fit only the default texel sizes and kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtlasParams {
    /// How the points of a texel are chosen and weighed.
    pub weights: WeightParams,
    /// Factor on the edge of texels, > 0. Default 1: [`ChartParams::for_spacing`](dapple_store::charts::ChartParams::for_spacing).
    pub texel_factor: f32,
    /// Most texels of all instances together, gaps between pages not counted: an instance beyond stays open
    /// ([`VisibilityAtlas::failed`]). Texels are as fine as the layout says that points are dense, and a layout comes from
    /// outside: this bounds the memory that it can ask for, some 10 bytes a texel and 60 more while an instance is made.
    /// Default `None`: 16 a point, and 2²⁰ more; 4 a point are common.
    pub max_texels: Option<u64>,
    /// Most bytes of sums of how much is seen of lights, for all instances together ([`VisibilityAtlas::resolve_lights`]), default 256 MiB: how many lights
    /// there are comes from outside, too.
    pub max_light_bytes: u64,
}

impl Default for AtlasParams {
    fn default() -> Self {
        AtlasParams {
            weights: WeightParams::default(),
            texel_factor: 1.0,
            max_texels: None,
            max_light_bytes: 256 << 20,
        }
    }
}

/// How far an atlas is, in texels of work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Done.
    pub done: u64,
    /// Of how many; partly an estimate until `done` reaches it.
    pub total: u64,
}

impl Progress {
    /// Whether nothing is left to do.
    pub fn is_complete(&self) -> bool {
        self.done >= self.total
    }
}

/// A point whose value changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PointChange {
    /// Index of the point in the store.
    pub point: u32,
    /// Visibility before, 255 = open.
    pub old: u8,
    /// Visibility now.
    pub new: u8,
}

/// The texels of all instances and what they are made of.
pub struct VisibilityAtlas {
    layout: Arc<PointLayout>,
    cuts: Option<Cuts>,
    params: AtlasParams,
    /// Parallel to the layout's sets.
    sets: Vec<SetState>,
    moves: Vec<bool>,
    /// Sets still to be made, the next one last.
    queue: Vec<usize>,
    job: Option<Job>,
    done: u64,
    /// Of the sets that are ready.
    texels: u64,
    pages: Pages,
    /// Instances that became ready since they were last asked for.
    ready: Vec<u32>,
    /// Instances whose points went since they were last asked for.
    gone: Vec<u32>,
    /// Sets whose texels fade in from open and are not listed among `fading`; the last ones are those of `ready`.
    fresh: Vec<usize>,
    /// All other texels whose two values may differ, each once.
    fading: Vec<u32>,
    failed: Vec<(u32, BuildError)>,
    /// Of lights that are shown on a card.
    light_texels: Option<LightTexels>,
    /// Whether values of lights come with leans.
    has_leans: bool,
}

/// Why an instance cannot be shown with its visibility, or lights with theirs.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// Lights of more texels than fit.
    #[error("what is seen of {lights} lights takes {} MB, more than {} MB", needed / 1_000_000, limit / 1_000_000)]
    TooManyLights {
        /// Lights.
        lights: u32,
        /// Bytes that it would take.
        needed: u64,
        /// [`AtlasParams::max_light_bytes`].
        limit: u64,
    },
    /// Its mesh cannot be cut into charts.
    #[error(transparent)]
    Charts(#[from] ChartError),
    /// There is no room for its texels.
    #[error(transparent)]
    Atlas(#[from] AtlasError),
    /// It has more texels than are left of what all instances may have.
    #[error(
        "atlas: {needed} texels with those of the instances before, at most {limit} may be; texels follow the layout's \
         spacing, which does not fit its number of points"
    )]
    TooManyTexels {
        /// Texels that there would be.
        needed: u64,
        /// [`AtlasParams::max_texels`].
        limit: u64,
    },
}

enum SetState {
    /// Not made yet, or it cannot be: open.
    Open,
    Ready(Box<ReadySet>),
}

struct ReadySet {
    charts: Arc<ChartSet>,
    charts_key: InstanceKey,
    table: PointTexels,
    sums: Sums,
    /// Once they are taken in.
    bent: Option<BentSums>,
    /// Once it is taken in.
    lights: Option<LightSums>,
    /// Of the front's pages, then, if it is seen from both sides, of the back's.
    placements: Vec<Placement>,
    placed: PlacedPages,
}

/// Changes that are made together: enough to wait for memory together, few enough to stay in the nearest cache.
const CHANGES_A_BATCH: usize = 32;

impl VisibilityAtlas {
    /// An atlas in which everything is still open. `scene` must be the one that the layout was made for; `cuts` are left
    /// out where they do not fit its charts.
    pub fn new(
        layout: Arc<PointLayout>,
        scene: &Scene,
        cuts: Option<&Cuts>,
        params: AtlasParams,
    ) -> VisibilityAtlas {
        let pages = Pages::for_points(layout.len());
        let mut atlas = VisibilityAtlas {
            cuts: cuts.cloned(),
            params,
            sets: layout.sets().iter().map(|_| SetState::Open).collect(),
            moves: scene.moving_instances(),
            queue: Vec::new(),
            job: None,
            done: 0,
            texels: 0,
            pages,
            ready: Vec::new(),
            gone: Vec::new(),
            fresh: Vec::new(),
            fading: Vec::new(),
            failed: Vec::new(),
            light_texels: None,
            has_leans: false,
            layout,
        };
        atlas.queue_open(scene);
        atlas
    }

    /// Goes on making charts and weights, about `texels` texels of it, in parallel in the caller's rayon pool. Call it with
    /// the same `scene` and the present `visibility` (one value a point) until it is complete; changes may be
    /// applied in between. How the work is cut in pieces does not change what comes out.
    ///
    /// An instance appears at once when all of it is ready, and fades in from open.
    ///
    /// # Panics
    /// If `visibility` has another length than the layout.
    pub fn work(&mut self, scene: &Scene, visibility: &[u8], texels: usize) -> Progress {
        assert_eq!(visibility.len(), self.layout.len(), "one value a point");
        let mut budget = texels.max(1);
        while budget > 0 {
            let job = match self.job.take() {
                Some(job) => job,
                None => match self.queue.pop() {
                    Some(set) => {
                        let (job, cost) = self.begin(scene, set);
                        self.job = job;
                        budget = budget.saturating_sub(cost);
                        self.done += cost as u64;
                        continue;
                    }
                    None => break,
                },
            };
            let cost = self.advance(scene, visibility, job, budget).max(1);
            budget = budget.saturating_sub(cost);
            self.done += cost as u64;
        }
        self.progress()
    }

    /// How far it is.
    pub fn progress(&self) -> Progress {
        let sets = self.layout.sets();
        let waiting: usize = self.queue.iter().map(|&set| 3 * sets[set].len() + 1).sum();
        let job = self.job.as_ref().map_or(0, |job| {
            let points = sets[job.set].len();
            let texels = job.charts.texel_count() as usize;
            match &job.stage {
                Stage::Charts(builder) => (builder.left() * points as f64) as usize + 3 * points + 1,
                Stage::Sites { .. } => texels + texels / VISITS_A_TEXEL + 1,
                Stage::Weigh(b) => b.sites() - b.weighed() + b.sites() / ENCODED_A_TEXEL + 1,
                Stage::Encode(b) => (b.sites() - b.encoded()) / ENCODED_A_TEXEL + 1,
                Stage::Sum { next, .. } => (points - next) / SUMMED_A_TEXEL + 1,
            }
        });
        Progress { done: self.done, total: self.done + (waiting + job) as u64 }
    }

    /// Begins a fade: what is shown becomes old, and what was new stays new. Call it before the changes of an update are
    /// applied, and show them with a fade that starts at 0. `progress` is how far the fade before has come that this one
    /// breaks off, 0 … 1 (1: it was over, and what was new becomes old). Nothing shown jumps by more than half a step of
    /// 1/255. Without it texels go on fading from what they showed before.
    ///
    /// Instances that nobody has asked for yet by [`VisibilityAtlas::take_ready`] are not shown so far: whatever the
    /// progress, they start from open.
    pub fn begin_update(&mut self, progress: f32) {
        // What is no number breaks nothing off.
        let progress = if progress.is_nan() { 1.0 } else { progress.clamp(0.0, 1.0) };
        if progress == 0.0 {
            return;
        }
        self.pages.advance(&mut self.fading, progress);
        let shown = self.fresh.len() - self.ready.len();
        for set in self.fresh.drain(..shown) {
            if let SetState::Ready(ready) = &self.sets[set] {
                for (placement, size) in ready.placements.iter().zip(ready.charts.pages().iter().cycle()) {
                    self.pages.advance_page(*placement, *size, progress, &mut self.fading);
                }
            }
        }
    }

    /// Takes over the changes of an update. Exact: after any sequence of changes the texels are those of an atlas
    /// made afresh from the final values. Changes of points that do not exist are left out.
    pub fn apply(&mut self, changes: impl IntoIterator<Item = PointChange>) {
        let sets = self.layout.sets();
        let mut at = 0;
        // Changes of one set that wait to be made together.
        let mut batch: Vec<(usize, i32)> = Vec::with_capacity(CHANGES_A_BATCH);
        let (pages, fading) = (&mut self.pages, &mut self.fading);
        for PointChange { point, old, new } in changes {
            let difference = i32::from(new) - i32::from(old);
            let in_set = |at: usize| {
                sets.get(at).is_some_and(|s| s.first <= point && point - s.first < s.len() as u32)
            };
            if !in_set(at) {
                if let Some(SetState::Ready(ready)) = self.sets.get_mut(at) {
                    ready.apply(&batch, pages, fading);
                }
                batch.clear();
                // Empty sets share their first point with the one after them, which is the last of those.
                at = sets.partition_point(|s| s.first <= point).saturating_sub(1);
                if !in_set(at) {
                    continue;
                }
            }
            let local = (point - sets[at].first) as usize;
            match &mut self.sets[at] {
                SetState::Ready(ready) => {
                    batch.push((local, difference));
                    if batch.len() == CHANGES_A_BATCH {
                        ready.apply(&batch, pages, fading);
                        batch.clear();
                    }
                }
                SetState::Open => {
                    if let Some(Job { set, stage: Stage::Sum { table, sums, next }, .. }) = &mut self.job
                        && *set == at
                        && local < *next
                    {
                        table.for_each_run(local, |texel, weights| {
                            sums.add(texel, weights, difference, |_| ());
                        });
                    }
                }
            }
        }
        if let Some(SetState::Ready(ready)) = self.sets.get_mut(at) {
            ready.apply(&batch, pages, fading);
        }
        // Who never begins an update must not pay for that with memory without bound.
        if self.fading.len() > self.pages.texel_count() {
            self.fading.sort_unstable();
            self.fading.dedup();
        }
    }
}

impl ReadySet {
    /// Adds changes, each a point of the set and new − old value, to sums and texels.
    ///
    /// Changed points lie anywhere, so this waits for memory more than for anything else. It therefore reads ahead for all of them
    /// first, so that they wait together.
    fn apply(&mut self, changes: &[(usize, i32)], pages: &mut Pages, fading: &mut Vec<u32>) {
        if changes.is_empty() {
            return;
        }
        let mut ahead = self.table.read_ahead(changes.iter().map(|change| change.0));
        let mut rows: Vec<(u32, u32, &[u8], i32)> = Vec::with_capacity(8 * changes.len());
        for &(point, difference) in changes {
            let mut walk = self.placed.walk();
            self.table.for_each_run(point, |mut texel, mut weights| {
                while !weights.is_empty() {
                    let (address, left) = walk.address(texel);
                    let (row, rest) = weights.split_at(weights.len().min(left as usize));
                    ahead ^= self.sums.value(texel) ^ pages.all_texels()[address as usize][0];
                    rows.push((texel, address, row, difference));
                    (texel, weights) = (texel + left, rest);
                }
            });
        }
        // What was read ahead must not be optimised away.
        std::hint::black_box(ahead);
        for (texel, address, row, difference) in rows {
            let mut texels = pages.write(address, row.len(), fading);
            self.sums.add(texel, row, difference, |value| texels.next(value));
        }
    }
}
