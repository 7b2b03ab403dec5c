//! Light cones on surfaces, kept up to date by rays ([Stadlbauer2023] sec. 3.1): ours with moment cones, and the paper's.
//!
//! - takes: a [`Tracer`], [`AreaLights`] of this moment, what changed since the last ([`Changes`]), the frame's queue of a
//!   [`ConeCache`]
//! - returns: entries of the cache updated, and how many rays that took
//!
//! And, for clients that know where lights are: how much of each light points see ([`trace_visibility`]).
//!
//! Equations, deviations and parameters in `README.md`.

mod changes;
mod follow;
#[cfg(test)]
mod follow_tests;
mod paper;
mod places;
#[cfg(test)]
mod tests;
mod together;
#[cfg(test)]
mod together_tests;
mod visibility;

use std::sync::atomic::{AtomicU64, Ordering};

use dapple_scene::area_lights::{AreaLights, Chooser, Facing, LightSample, Pick};
use dapple_scene::glam::Vec3;
use dapple_store::cones::{
    BLOCK_SIDE, BLOCK_TEXELS, ConeCache, ConeEntry, ConeSample, EntryId, HiddenSample, MomentEntry,
    MomentParams, QueuedTexel, Touch, UpdateQueue, luminance,
};

use crate::bvh::{Tracer, offset_origin};
use crate::direct::{Draws, Sequence};
use crate::sampling::hash;
use changes::Arrivals;
pub use changes::{Changes, Moment};
pub use paper::PaperParams;
pub use places::{EntryPlace, EntryPlaces};
use together::{Group, Hands, SQUARE};
pub use visibility::{
    LightTracker, TrackerParams, VisibilityCounts, VisibilityParams, retrace_visibility, trace_visibility,
};

/// Most samples of an entry in one update.
pub const MAX_SAMPLES: u32 = 256;

/// How moment cones are updated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlcParams {
    /// How samples become cones.
    pub moment: MomentParams,
    /// Samples of an update while an entry is young, 1 … [`MAX_SAMPLES`], default 16: rays from one place together are quicker than apart. The 8 of
    /// [Stadlbauer2023] sec. 4 are the paper's own entries'.
    pub first_samples: u32,
    /// Updates with that many, default 2.
    pub first_updates: u32,
    /// Most samples of an update of an entry some of whose light changed: all of them if all did, and not less than that times the root of the part that
    /// did. 0 … [`MAX_SAMPLES`], default 8.
    pub changed_samples: u32,
    /// Samples a frame after that, while nothing changes, default 3, taken several at a time. None are taken once an entry
    /// stands for [`MomentParams::max_samples`]: where nothing changes it is as good as it gets. 0: none.
    pub samples: u32,
    /// How lights are picked, default by fluence.
    pub pick: Pick,
    /// Where samples lie, default a lattice that goes on through the life of an entry.
    pub sequence: Sequence,
    /// Entries of a square of 16 × 16 texels share places on lights, and the bundles of rays from these, with every so-manyth in a row and a column: there are
    /// `together`² sets of places. 1, 2, 4 or 8; others are rounded down to these. Default 2: the four that a pixel blends have different ones. 0: none share.
    pub together: u32,
    /// Whether cones of lights that moved are turned with them, before they are updated. Default.
    pub re_aim: bool,
    /// Seed of the samples, default 0.
    pub seed: u64,
}

impl Default for SlcParams {
    fn default() -> Self {
        SlcParams {
            moment: MomentParams::default(),
            first_samples: 16,
            first_updates: 2,
            changed_samples: 8,
            samples: 3,
            pick: Pick::Fluence,
            sequence: Sequence::Lattice,
            together: 2,
            re_aim: true,
            seed: 0,
        }
    }
}

/// What an update took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SlcCounts {
    /// Entries that took samples.
    pub updated: u64,
    /// Shadow rays.
    pub rays: u64,
    /// Entries to which something changed since the last moment.
    pub changed: u64,
}

/// Confidence that an entry keeps of which a light moved or was hidden, times the root of that light's share: with cones that are turned
/// after the light, and without.
const KEPT_RE_AIMED: f32 = 24.0;
const KEPT: f32 = 8.0;
/// A share of an entry's light below which a change is not worth rays.
const LEAST_SHARE: f32 = 0.01;

/// How a kind of entry is brought up to date with rays.
pub trait Update: ConeEntry {
    /// Its settings.
    type Params: Sync;

    /// Updates the entries of a frame's queue, in parallel in the caller's rayon pool. `places` are of the queue
    /// ([`EntryPlaces::of`]). What comes out depends on the arguments alone. A queue of another frame updates nothing.
    ///
    /// Directions of cones are in world space: where a receiver turns, the light about it does not.
    fn update_queue(
        cache: &mut ConeCache<Self>,
        queue: &UpdateQueue,
        places: &EntryPlaces,
        tracer: &Tracer,
        changes: &Changes<'_>,
        params: &Self::Params,
    ) -> SlcCounts;
}

impl Update for MomentEntry {
    type Params = SlcParams;

    fn update_queue(
        cache: &mut ConeCache<Self>,
        queue: &UpdateQueue,
        places: &EntryPlaces,
        tracer: &Tracer,
        changes: &Changes<'_>,
        params: &SlcParams,
    ) -> SlcCounts {
        let (rays, changed) = (AtomicU64::new(0), AtomicU64::new(0));
        let lights = changes.lights();
        let SlcParams { pick, sequence, seed, .. } = *params;
        let source = Source { pick, sequence, seed, with_cosine: true };
        let frame = cache.frame();
        let updated = cache.update_blocks(queue, SQUARE, |blocks| {
            if lights.is_empty() {
                return;
            }
            let group = Group::of(&blocks[0].key, params.together);
            let mut arrivals = Arrivals::default();
            let mut counts = vec![[0; BLOCK_TEXELS]; blocks.len()];
            for (block, counts) in blocks.iter_mut().zip(&mut counts) {
                for (i, count) in counts.iter_mut().enumerate().take(block.texels.len()) {
                    let Some(place) = places.get(block.first + i) else { continue };
                    let texel = &block.texels[i];
                    let turns = (frame, turn_of(texel.id), group.turn(texel.id));
                    let (touch, wanted) =
                        prepare(block.entry(i), texel, place, changes, params, turns, &mut arrivals);
                    changed.fetch_add(u64::from(wanted.is_changed), Ordering::Relaxed);
                    (block.touched[i], *count) = (touch, wanted.count);
                }
            }
            let hands = Hands { places, tracer, lights, source: &source, params };
            rays.fetch_add(together::update(blocks, &counts, group, &hands), Ordering::Relaxed);
        });
        // A queue of another frame is the caller's mistake, and updates nothing.
        let updated = updated.unwrap_or(0);
        SlcCounts { updated, rays: rays.into_inner(), changed: changed.into_inner() }
    }
}

/// Samples that an entry takes.
struct Wanted {
    count: u32,
    /// Whether that is since something changed.
    is_changed: bool,
}

/// What a change of the scene does to an entry before it takes samples, and how many it takes then. `turns`: the frame, whose turn of two the entry's
/// is, and when it is that of its group.
fn prepare(
    entry: &mut MomentEntry,
    texel: &QueuedTexel,
    place: &EntryPlace,
    changes: &Changes<'_>,
    params: &SlcParams,
    (frame, turn, group_turn): (u32, u32, u32),
    arrivals: &mut Arrivals,
) -> (Touch, Wanted) {
    let mut touch = Touch::Nothing;
    let change = changes.of(place, texel.instance, arrivals);
    if texel.moved {
        // What it knows is of a place beside it.
        ConeEntry::cut_confidence(entry, KEPT as u16);
        touch = Touch::Changed;
    }
    if let Some(kept) = (KEPT as u32).checked_div(changes.missed(texel.absent)) {
        // What it knows may be of another time.
        ConeEntry::cut_confidence(entry, kept as u16);
        touch = Touch::Changed;
    }
    // When it is its turn in any case: that of all of its group.
    let phase = frame.wrapping_add(turn & 1).wrapping_add(group_turn);
    let mut count = quiet_samples(entry, params, phase);
    let is_changed = change.share > LEAST_SHARE;
    if is_changed {
        touch = Touch::Changed;
        let root = change.share.sqrt();
        if params.re_aim {
            follow::follow(entry, place, changes, arrivals);
        }
        let kept = if params.re_aim && !change.hidden { KEPT_RE_AIMED } else { KEPT };
        // Of a light that was not there, what the entry knows says nothing.
        let kept = if change.new > LEAST_SHARE { kept.min(1.0 / change.new) } else { kept / root };
        entry.cut_confidence(kept.clamp(1.0, 4095.0) as u16);
        let follows = params.re_aim && change.new <= LEAST_SHARE && !texel.moved && !texel.is_new;
        if follows && is_plain(entry) && !turn.wrapping_add(frame).is_multiple_of(2) {
            return (touch, Wanted { count: 0, is_changed });
        }
        let most = params.changed_samples;
        count = count.min(most).max(libm::ceilf(most as f32 * root) as u32);
    }
    (touch, Wanted { count: count.min(MAX_SAMPLES), is_changed })
}

/// Part of a light from which on all of it is seen.
const ALL_SEEN: f32 = 0.98;

/// Whether an entry sees all of a light or nothing, of every one: while that stays so, it needs no samples to follow lights that move, and a shadow that
/// comes is found a frame later.
fn is_plain(entry: &MomentEntry) -> bool {
    f32::from(entry.samples()) >= KEPT
        && entry.cones().iter().all(|cone| entry.seen_of(cone.lights) >= ALL_SEEN)
}

/// Of two frames in one it is an entry's turn; its neighbours' is in the other, in a checkerboard, so that pixels that blend entries have both.
fn turn_of(id: EntryId) -> u32 {
    let side = BLOCK_SIDE as usize;
    (id.index() % side + id.index() / side % side) as u32
}

/// Samples of an entry about which nothing changed. Rays from one place together are quicker than apart, so a grown entry takes several in
/// one of as many frames; `phase` says whose turn it is.
fn quiet_samples(entry: &MomentEntry, params: &SlcParams, phase: u32) -> u32 {
    let (first, most) = (params.first_samples.max(1), u32::from(params.moment.max_samples));
    let grown = first.saturating_mul(params.first_updates).min(most);
    let has = u32::from(entry.samples());
    let turns = (first / params.samples.max(1)).max(1);
    if has < grown {
        first
    } else if has < most && params.samples > 0 && phase.is_multiple_of(turns) {
        params.samples.saturating_mul(turns).min(most - has)
    } else {
        0
    }
}

/// Names a place on a surface, for its random numbers.
fn site_of(instance: u32, triangle: u32, [v, w]: [f32; 2]) -> u64 {
    let place = u64::from(v.to_bits()) << 32 | u64::from(w.to_bits());
    u64::from(hash(place, u64::from(triangle), instance)) << 32
        | u64::from(hash(place, u64::from(instance), triangle))
}

/// Where samples of light come from, and what they are.
struct Source {
    pick: Pick,
    sequence: Sequence,
    seed: u64,
    /// Irradiance by the shading normal, or fluence.
    with_cosine: bool,
}

/// Samples of light at one place.
struct Drawn {
    /// Those that reached a light.
    samples: Vec<ConeSample>,
    /// Those that something stood in the way of.
    hidden: Vec<HiddenSample>,
    /// How many rays were needed.
    rays: u64,
}

/// Where a sample of light goes.
enum Fate {
    /// To the place, if nothing is in the way.
    Open(ConeSample),
    /// The surface itself is in the way of its bumps.
    Hidden(HiddenSample),
}

/// What a place with this normal of its triangle makes of a sample; `None` if it faces away from it.
fn judge(sample: &LightSample, normal: Vec3, facing: &Facing, with_cosine: bool) -> Option<Fate> {
    let LightSample { light, to_light_world: direction, .. } = *sample;
    let cosine = facing.cosine(direction);
    if cosine <= 0.0 {
        return None;
    }
    let factor = if with_cosine { cosine } else { 1.0 };
    let value = sample.radiance * (factor / sample.density_per_sr);
    Some(if normal.dot(direction) <= 0.0 {
        Fate::Hidden(HiddenSample { light, value: luminance(value) })
    } else {
        Fate::Open(ConeSample { direction, value, light, cosine: factor })
    })
}

/// What light is by the cosine to. Light by the cosine to a surface that bumps turn is what the pixels there reflect; by that to the triangle under
/// it, lights that it hardly faces would have next to no part in a cone, and bumps that face them would lack their light.
fn facing_of(place: &EntryPlace, source: &Source) -> Facing {
    if source.with_cosine { place.facing() } else { place.normal_world.into() }
}

/// Sends rays to lights from one place, which `chooser` is aimed at. Places on lights are chosen from where rays leave ([`offset_origin`]), so that a ray
/// ends where its sample lies: moved by that little, it would end behind the face of a light that is near, or seen at a grazing angle.
fn take_samples(
    tracer: &Tracer,
    lights: &AreaLights<'_>,
    chooser: &Chooser,
    place: &EntryPlace,
    source: &Source,
    site: u64,
    indices: impl ExactSizeIterator<Item = u32>,
) -> Drawn {
    let normal = place.normal_world;
    let origin = offset_origin(place.position_world, normal);
    let draws = Draws::new(source.sequence, source.seed, site, 0, 1);
    let mut samples = Vec::with_capacity(indices.len());
    let mut reaches: Vec<Vec3> = Vec::with_capacity(indices.len());
    let mut hidden = Vec::new();
    for i in indices {
        let Some(sample) = lights.sample(chooser, origin, draws.at(i)) else {
            continue;
        };
        match judge(&sample, normal, &facing_of(place, source), source.with_cosine) {
            Some(Fate::Open(open)) => {
                samples.push(open);
                reaches.push(sample.reach());
            }
            Some(Fate::Hidden(sample)) => hidden.push(sample),
            None => {}
        }
    }
    let blocked = tracer.occlusion(origin, &reaches, 1.0);
    let mut i = 0;
    samples.retain(|sample| {
        i += 1;
        let is_hidden = blocked[(i - 1) / 64] >> ((i - 1) % 64) & 1 == 1;
        if is_hidden {
            hidden.push(HiddenSample { light: sample.light, value: luminance(sample.value) });
        }
        !is_hidden
    });
    Drawn { samples, hidden, rays: reaches.len() as u64 }
}

/// A chooser for one place.
fn chooser_for(lights: &AreaLights<'_>, place: &EntryPlace, source: &Source) -> Chooser {
    let mut chooser = Chooser::new(source.pick);
    let origin = offset_origin(place.position_world, place.normal_world);
    chooser.aim(lights, origin, facing_of(place, source));
    chooser
}
