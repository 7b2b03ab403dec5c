//! Samples of the entries of a square of blocks, which share places on lights: rays of one place on a light to many entries beside each other are
//! hardly more work than a few to one.

use dapple_scene::area_lights::{AreaLights, BEFORE_LIGHT, Chooser, Facing, LightSpot};
use dapple_scene::glam::Vec3;
use dapple_store::cones::{
    BLOCK_SIDE, BLOCK_TEXELS, BlockKey, ConeSample, EntryId, HiddenSample, MomentEntry, QueuedBlock, Touch,
    luminance,
};

use super::{Drawn, EntryPlace, EntryPlaces, Fate, SlcParams, Source};
use super::{chooser_for, facing_of, judge, site_of, take_samples};
use crate::bvh::{Tracer, offset_origin};
use crate::direct::Draws;
use crate::sampling::{hash, unit_interval};

/// Blocks along a side of the square whose entries share places, as a power of two: entries of a square are as many of each kind as a bundle of rays
/// has room for.
pub(super) const SQUARE: u8 = 1;
/// Entries from which on they share places; fewer take rays of their own, all from one place.
const LEAST_TOGETHER: usize = 4;
/// Most that do: all that one bundle of rays can go to.
const MOST_TOGETHER: usize = 64;

/// Which entries of a square of blocks share places on lights, and their random numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    stride: usize,
    site: u64,
}

impl Group {
    /// Of the square that a block is in: every `stride`th texel in a row and a column. 0: all of them share their turns, not their places.
    pub(super) fn of(block: &BlockKey, stride: u32) -> Group {
        let square = block.square(SQUARE);
        let place = u64::from(square.x as u32) << 32 | u64::from(square.y as u32);
        let [level, slab] = [i64::from(square.level) as u64, i64::from(square.slab) as u64];
        let chart = u64::from(square.chart) << 32 | u64::from(square.instance);
        let half = |purpose| u64::from(hash(place ^ chart.rotate_left(17), slab << 8 ^ level, purpose));
        let stride = 1 << stride.clamp(1, BLOCK_SIDE as u32).ilog2();
        Group { stride, site: half(0) << 32 | half(1) }
    }

    /// Which of the groups of its square an entry is in.
    fn index(&self, id: EntryId) -> usize {
        let side = BLOCK_SIDE as usize;
        let texel = id.index() % BLOCK_TEXELS;
        texel / side % self.stride * self.stride + texel % side % self.stride
    }

    /// Names one of them.
    fn site(&self, index: usize) -> u64 {
        self.site.rotate_left(index as u32 % 64) ^ index as u64
    }

    /// Spreads over frames what groups do now and then.
    pub(super) fn turn(&self, id: EntryId) -> u32 {
        (self.site(self.index(id)) as u32) << 1
    }
}

/// What samples are taken with.
pub(super) struct Hands<'a> {
    pub(super) places: &'a EntryPlaces,
    pub(super) tracer: &'a Tracer,
    pub(super) lights: &'a AreaLights<'a>,
    pub(super) source: &'a Source,
    pub(super) params: &'a SlcParams,
}

/// Takes the samples of the entries of a square of blocks, `counts` of each, and updates them. Returns how many rays that took.
pub(super) fn update(
    blocks: &mut [QueuedBlock<'_, MomentEntry>],
    counts: &[[u32; BLOCK_TEXELS]],
    group: Group,
    hands: &Hands<'_>,
) -> u64 {
    if counts.iter().flatten().all(|count| *count == 0) {
        return 0;
    }
    let mut rays = 0;
    let mut members: Vec<Member> = Vec::with_capacity(MOST_TOGETHER);
    let groups = group.stride * group.stride;
    for index in 0..groups {
        // What is too many for one bundle has other places.
        let mut part = index;
        for (b, counts) in counts.iter().enumerate() {
            for (i, &count) in counts.iter().enumerate().take(blocks[b].texels.len()) {
                let id = blocks[b].texels[i].id;
                if count == 0 || group.index(id) != index {
                    continue;
                }
                let taken = blocks[b].entry(i).taken();
                let BlockKey { x, y, .. } = blocks[b].key;
                let name = (y as u64 & 1) << 7 | (x as u64 & 1) << 6 | (id.index() % BLOCK_TEXELS) as u64;
                let place = hands.places.get(blocks[b].first + i);
                members.extend(
                    place.map(|place| Member::new([b, i], name, [count, taken], place, hands.source)),
                );
                if members.len() == MOST_TOGETHER {
                    rays += serve(&mut members, blocks, group.site(part), hands);
                    part += groups;
                }
            }
        }
        rays += serve(&mut members, blocks, group.site(part), hands);
    }
    rays
}

/// Takes the samples of some entries, together if they are enough, and updates them; none are left.
fn serve(
    members: &mut Vec<Member>,
    blocks: &mut [QueuedBlock<'_, MomentEntry>],
    site: u64,
    hands: &Hands<'_>,
) -> u64 {
    let Hands { places, tracer, lights, source, params } = hands;
    let mut rays = 0;
    let shared = (params.together > 0 && members.len() >= LEAST_TOGETHER)
        .then(|| sample(tracer, lights, source, site, members));
    for mut member in members.drain(..) {
        let [b, i] = member.at;
        let own;
        let chooser = if let Some((first, shared)) = &shared {
            blocks[b].entry(i).skip_to(*first);
            shared
        } else {
            let Some(place) = places.get(blocks[b].first + i) else { continue };
            let texel = &blocks[b].texels[i];
            let site = site_of(texel.instance, texel.place.triangle, texel.place.barycentrics);
            let indices = (0..member.count).map(|i| member.taken.wrapping_add(i));
            own = chooser_for(lights, place, source);
            member.drawn = take_samples(tracer, lights, &own, place, source, site, indices);
            &own
        };
        let picked = |light| chooser.probability(lights, light as usize);
        let Drawn { samples, hidden, rays: traced } = &member.drawn;
        blocks[b].entry(i).update_seen(samples, hidden, member.count, picked, &params.moment);
        blocks[b].touched[i] = Touch::Updated;
        rays += traced;
    }
    rays
}

/// An entry among those that share places.
pub(super) struct Member {
    /// Which block, and which of its texels.
    at: [usize; 2],
    /// Tells it from the others, always.
    name: u64,
    pub(super) count: u32,
    pub(super) taken: u32,
    /// Where rays end, above the surface.
    pub(super) origin: Vec3,
    normal: Vec3,
    facing: Facing,
    pub(super) drawn: Drawn,
    /// Samples of places of its own.
    own: Vec<(ConeSample, Vec3)>,
}

impl Member {
    pub(super) fn new(
        at: [usize; 2],
        name: u64,
        [count, taken]: [u32; 2],
        place: &EntryPlace,
        source: &Source,
    ) -> Member {
        let normal = place.normal_world;
        let origin = offset_origin(place.position_world, normal);
        let drawn = Drawn { samples: Vec::new(), hidden: Vec::new(), rays: 0 };
        Member {
            at,
            name,
            count,
            taken,
            origin,
            normal,
            facing: facing_of(place, source),
            drawn,
            own: Vec::new(),
        }
    }

    /// Keeps a sample that nothing is in the way of, or what is known of one that something is.
    fn keep(&mut self, sample: ConeSample, is_hidden: bool) {
        self.drawn.rays += 1;
        if is_hidden {
            self.drawn.hidden.push(HiddenSample { light: sample.light, value: luminance(sample.value) });
        } else {
            self.drawn.samples.push(sample);
        }
    }
}

/// Takes samples of places on lights that all members share, each as many as it wants. Returns the number of the first, which none of them had, and
/// what picked their lights.
pub(super) fn sample(
    tracer: &Tracer,
    lights: &AreaLights<'_>,
    source: &Source,
    site: u64,
    members: &mut [Member],
) -> (u32, Chooser) {
    let mut chooser = Chooser::new(source.pick);
    chooser.aim_among(lights, members.iter().map(|member| (member.origin, member.facing)));
    let ball = ball_about(members);
    let draws = Draws::new(source.sequence, source.seed, site, 0, 1);
    // All go on from where the oldest is, and are moved there: who is younger would draw the same again when the oldest is not among them.
    let first = members.iter().map(|member| member.taken).max().unwrap_or(0);
    let most = members.iter().map(|member| member.count).max().unwrap_or(0);
    for member in &mut *members {
        member.drawn.samples.reserve_exact(member.count as usize);
    }
    for i in 0..most {
        let [u, v, w] = draws.at(first.wrapping_add(i));
        let Some((light, probability, rest)) = chooser.pick(lights, u) else { continue };
        let u = [rest, v, w];
        let takers = members.iter_mut().filter(|member| member.count > i);
        if let Some(spot) = lights.spot(light, ball, u) {
            share(tracer, source, &spot, probability, takers);
            continue;
        }
        for member in takers {
            // Places that nobody shares are moved, each member's by its own.
            let moved = |at: f32, d: u32| (at + unit_interval(hash(site, member.name, d))).fract();
            let u = [rest, moved(v, 0), moved(w, 1)];
            let Some(mut sample) = lights.sample_light(light, member.origin, u) else { continue };
            sample.density_per_sr *= probability;
            match judge(&sample, member.normal, &member.facing, source.with_cosine) {
                Some(Fate::Open(open)) => member.own.push((open, sample.reach())),
                Some(Fate::Hidden(hidden)) => member.drawn.hidden.push(hidden),
                None => {}
            }
        }
    }
    let mut reaches = Vec::new();
    for member in members.iter_mut().filter(|member| !member.own.is_empty()) {
        let own = std::mem::take(&mut member.own);
        reaches.clear();
        reaches.extend(own.iter().map(|(_, reach)| *reach));
        let blocked = tracer.occlusion(member.origin, &reaches, 1.0);
        for (i, (sample, _)) in own.into_iter().enumerate() {
            member.keep(sample, blocked[i / 64] >> (i % 64) & 1 == 1);
        }
    }
    (first, chooser)
}

/// Gives a place on a light to all that want one, by rays from there.
fn share<'a>(
    tracer: &Tracer,
    source: &Source,
    spot: &LightSpot,
    probability: f32,
    takers: impl Iterator<Item = &'a mut Member>,
) {
    let mut open: [Option<(&mut Member, ConeSample)>; MOST_TOGETHER] = [const { None }; MOST_TOGETHER];
    let mut reaches = [Vec3::ZERO; MOST_TOGETHER];
    let (mut count, mut nearest) = (0, f32::INFINITY);
    for member in takers {
        let Some(mut sample) = spot.seen_from(member.origin) else { continue };
        sample.density_per_sr *= probability;
        let distance = sample.distance_m;
        match judge(&sample, member.normal, &member.facing, source.with_cosine) {
            Some(Fate::Open(sample)) => {
                nearest = nearest.min(distance);
                reaches[count] = member.origin;
                open[count] = Some((member, sample));
                count += 1;
            }
            Some(Fate::Hidden(hidden)) => member.drawn.hidden.push(hidden),
            None => {}
        }
    }
    if count == 0 {
        return;
    }
    let before = spot.normal_world * (nearest * BEFORE_LIGHT);
    let from = offset_origin(spot.position_world + before, spot.normal_world);
    reaches[..count].iter_mut().for_each(|reach| *reach -= from);
    let blocked = tracer.occlusion(from, &reaches[..count], 1.0)[0];
    for (i, (member, sample)) in open.into_iter().flatten().enumerate() {
        member.keep(sample, blocked >> i & 1 == 1);
    }
}

/// Centre and radius of a ball that holds all members.
fn ball_about(members: &[Member]) -> (Vec3, f32) {
    let sum: Vec3 = members.iter().map(|member| member.origin).sum();
    let center = sum / members.len().max(1) as f32;
    let farthest = members.iter().map(|member| member.origin.distance_squared(center)).fold(0.0, f32::max);
    // What rounding may take from the distance of the farthest.
    (center, farthest.sqrt() * 1.0001)
}
