//! Laws and cases of the cache.

use std::collections::BTreeMap;

use glam::Vec3;
use proptest::prelude::*;
use rayon::ThreadPoolBuilder;

use super::super::key::{BLOCK_SIDE, SLABS};
use super::super::test_lights::uniform;
use super::super::{ChartPlace, ConeSample, MomentEntry, MomentParams};
use super::*;

/// A floor of one chart with texels of 1 m, seen from `origin`: pixels of `pixel_m`. Each pixel has a triangle of its own number.
fn floor(width: usize, rows: usize, origin: [f32; 2], pixel_m: f32) -> Vec<Option<PixelPlace>> {
    let pixel = |i: usize| {
        let uv = [(i % width) as f32, (i / width) as f32];
        let uv = [0, 1].map(|k| origin[k] + (uv[k] + 0.37) * pixel_m);
        let place = ChartPlace { chart: 2, uv, depth: 0.0, size: [400, 300], texel_m: 1.0 };
        Some(PixelPlace {
            instance: 5,
            triangle: i as u32,
            barycentrics: [0.0; 2],
            place,
            footprint_m: pixel_m,
            lean: [0.0; 2],
        })
    };
    (0..width * rows).map(pixel).collect()
}

/// Pixels all over several charts, slabs, instances and levels.
pub(super) fn scattered(seed: u32, count: u32) -> Vec<Option<PixelPlace>> {
    let pixel = |i| {
        let u = |dimension| uniform(seed, i, dimension);
        if u(0) < 0.1 {
            return None;
        }
        let (chart, size) =
            if u(1) < 0.5 { ((u(2) * 2.0) as u32, [40, 30]) } else { (SLABS + (u(2) * 2.0) as u32, [0; 2]) };
        let uv = [0.5 + u(3) * 39.0, 0.5 + u(4) * 29.0];
        Some(PixelPlace {
            instance: (u(5) * 2.0) as u32,
            triangle: (u(6) * 50.0) as u32,
            barycentrics: [u(7), u(8)],
            place: ChartPlace {
                chart,
                uv,
                depth: if size[0] == 0 { u(9) * 3.0 } else { 0.0 },
                size,
                texel_m: 0.1,
            },
            footprint_m: 0.1 * libm::exp2f(u(10) * 4.0 - 2.0),
            lean: [u(11), u(12)],
        })
    };
    (0..count).map(pixel).collect()
}

#[test]
fn a_place_keeps_how_its_normal_leans() {
    let mut pixels = floor(4, 1, [0.0; 2], 1.0);
    let leans = [[0.25f32, -0.5], [1.0, -1.0], [f32::NAN, 3.0], [0.0, -9.0]];
    for (pixel, lean) in pixels.iter_mut().flatten().zip(leans) {
        pixel.lean = lean;
    }
    let requests =
        Requests::gather(&[View { width: 4, pixels: &pixels }], &LookUp { bias: 1.0, blend: false });
    let mut found: Vec<_> =
        cache(9).admit(&requests).texels.iter().map(|t| (t.place.triangle, t.place.lean())).collect();
    found.sort_by_key(|(triangle, _)| *triangle);
    for ((_, found), asked) in found.iter().zip([[0.25f32, -0.5], [1.0, -1.0], [0.0, 1.0], [0.0, -1.0]]) {
        assert!((0..2).all(|k| (found[k] - asked[k]).abs() < 1e-4), "{found:?} {asked:?}");
    }
    assert_eq!(found.len(), 4);
}

pub(super) fn cache(most_blocks: u64) -> ConeCache<MomentEntry> {
    let most_bytes = most_blocks * ConeCache::<MomentEntry>::block_bytes();
    ConeCache::new(CacheParams { most_bytes, ..CacheParams::default() }).unwrap()
}

fn sample(value: f32) -> ConeSample {
    ConeSample { direction: Vec3::Z, value: Vec3::splat(value), light: 0, cosine: 1.0 }
}

/// Updates the whole queue with one sample of a value that the instance and triangle decide.
pub(super) fn update_all(cache: &mut ConeCache<MomentEntry>, queue: &UpdateQueue) {
    let done = cache.update(queue, |_, queued, entry| {
        entry.update(&[sample(1.0 + queued.place.triangle as f32)], 1, &MomentParams::default());
        true
    });
    assert_eq!(done, Ok(queue.texels.len() as u64));
}

const NEAREST: LookUp = LookUp { bias: 1.0, blend: false };

#[test]
fn a_picture_asks_for_each_texel_once_and_the_pixel_nearest_to_the_centre_gives_the_place() {
    // 2.3 pixels a texel along each side.
    let pixels = floor(150, 130, [0.5, 0.5], 1.0 / 2.3);
    let mut best: BTreeMap<[i32; 2], (f32, u32)> = BTreeMap::new();
    for (i, pixel) in pixels.iter().enumerate() {
        let uv = pixel.unwrap().place.uv;
        let texel = uv.map(|v| (v * 2.0).floor() as i32);
        let from = |k: usize| uv[k] * 2.0 - (texel[k] as f32 + 0.5);
        let distance = from(0) * from(0) + from(1) * from(1);
        let held = best.entry(texel).or_insert((distance, i as u32));
        *held = (*held).min_by_distance((distance, i as u32));
    }
    for blend in [false, true] {
        let look_up = LookUp { bias: 1.0, blend };
        let mut cache = cache(1000);
        let requests = Requests::gather(&[View { width: 150, pixels: &pixels }], &look_up);
        let queue = cache.admit(&requests);
        let mut seen = BTreeMap::new();
        for queued in &queue.texels {
            let key = cache.key(queued.id).unwrap();
            assert_eq!((key.block.instance, key.block.chart, key.block.level), (5, 2, -1));
            assert!(queued.is_new && !queued.moved && cache.entry(queued.id).unwrap().samples() == 0);
            assert_eq!(seen.insert(key.xy(), queued.place), None, "twice");
        }
        for (texel, (_, triangle)) in &best {
            let place = seen.remove(texel).unwrap();
            assert!(place.is_inside() && place.triangle == *triangle, "{texel:?}: {place:?} for {triangle}");
        }
        // What is left was only asked for by neighbours: the rim.
        assert_eq!(seen.is_empty(), !blend, "{seen:?}");
        assert!(seen.values().all(|place| !place.is_inside()));
        assert_eq!(cache.counts().entries, queue.texels.len() as u64);
    }
}

trait MinByDistance {
    fn min_by_distance(self, other: Self) -> Self;
}

impl MinByDistance for (f32, u32) {
    fn min_by_distance(self, other: Self) -> Self {
        if (other.0.to_bits(), other.1) < (self.0.to_bits(), self.1) { other } else { self }
    }
}

#[test]
fn threads_do_not_matter_where_memory_is_full() {
    let views: Vec<_> = (0..3).map(|seed| scattered(seed, 9000)).collect();
    let run = |threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut cache = cache(40);
            let queues = views.iter().map(|pixels| {
                let views = [View { width: 90, pixels }];
                let queue = cache.admit(&Requests::gather(&views, &LookUp::default()));
                update_all(&mut cache, &queue);
                queue
            });
            queues.collect::<Vec<_>>()
        })
    };
    let one = run(1);
    assert!(one.iter().any(|queue| queue.refused > 0) && one.iter().any(|queue| queue.evicted > 0));
    assert_eq!(one, run(2));
}

#[test]
fn threads_do_not_matter_and_neither_does_the_order_of_viewers() {
    let views: Vec<_> = (0..3).map(|seed| scattered(seed, 9000)).collect();
    let run = |threads: usize, order: [usize; 3]| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut cache = cache(100_000);
            let views: Vec<_> = order.iter().map(|&i| View { width: 90, pixels: &views[i] }).collect();
            let mut queues = Vec::new();
            for shown in 1..=views.len() {
                let queue = cache.admit(&Requests::gather(&views[..shown], &LookUp::default()));
                update_all(&mut cache, &queue);
                queues.push(queue);
            }
            let entries: BTreeMap<_, _> = cache
                .ids()
                .map(|id| (cache.key(id).unwrap(), (cache.place(id), *cache.entry(id).unwrap())))
                .collect();
            (queues, entries)
        })
    };
    let (queues, entries) = run(1, [0, 1, 2]);
    assert!(entries.len() > 5000, "{}", entries.len());
    for threads in [2, 5] {
        assert_eq!(run(threads, [0, 1, 2]), (queues.clone(), entries.clone()));
    }
    // Another order of viewers within a frame: another order of the queue, the same texels at the same places.
    let all = |order: [usize; 3]| {
        let mut cache = cache(100_000);
        let views: Vec<_> = order.iter().map(|&i| View { width: 90, pixels: &views[i] }).collect();
        let queue = cache.admit(&Requests::gather(&views, &LookUp::default()));
        queue.texels.iter().map(|q| (cache.key(q.id).unwrap(), cache.place(q.id))).collect::<BTreeMap<_, _>>()
    };
    assert_eq!(all([0, 1, 2]), all([2, 0, 1]));
}

#[test]
fn a_texel_keeps_its_place_and_its_age_unless_only_neighbours_had_asked() {
    let mut cache = cache(1000);
    let at = |u: f32, triangle| {
        let place = ChartPlace { chart: 0, uv: [u, 0.5], depth: 0.0, size: [50, 1], texel_m: 1.0 };
        [Some(PixelPlace {
            instance: 0,
            triangle,
            barycentrics: [0.25; 2],
            place,
            footprint_m: 1.0,
            lean: [0.0; 2],
        })]
    };
    let mut admit = |pixels: &[Option<PixelPlace>], update: bool| {
        let queue = cache.admit(&Requests::gather(&[View { width: 1, pixels }], &LookUp::default()));
        if update {
            update_all(&mut cache, &queue);
        }
        let samples = queue.texels.iter().map(|queued| cache.entry(queued.id).unwrap().samples());
        let samples: Vec<u16> = samples.collect();
        (queue.texels, samples)
    };
    // Texels 3 (its own) and 4 (beside it).
    let (first, _) = admit(&at(3.7, 10), true);
    assert_eq!(
        first.iter().map(|q| (q.place.is_inside(), q.place.triangle)).collect::<Vec<_>>(),
        [(true, 10), (false, 10)]
    );
    // Nearer to the centre of 3, but the place is given.
    let (second, samples) = admit(&at(3.5, 11), false);
    assert_eq!(second.len(), 1);
    assert!(second[0].place == first[0].place && !second[0].is_new && !second[0].moved);
    assert_eq!(samples, [1]);
    // Texel 4 gets a place inside, and says so.
    let (third, samples) = admit(&at(4.6, 12), false);
    let index = third.iter().position(|q| q.id == first[1].id).unwrap();
    let of_4 = &third[index];
    assert!(of_4.moved && of_4.place.is_inside() && of_4.place.triangle == 12);
    assert_eq!((samples[index], of_4.is_new), (1, false));
    assert_eq!(of_4.absent, 1, "not wanted in the second frame");
    let (fourth, _) = admit(&at(4.5, 13), false);
    assert!(!fourth[0].moved && fourth[0].place.triangle == 12 && fourth[0].absent == 0);
    // Nobody looks for two frames.
    assert!(admit(&[None], false).0.is_empty() && admit(&[None], false).0.is_empty());
    let (fifth, _) = admit(&at(4.5, 13), false);
    assert!(fifth[0].absent == 2 && !fifth[0].is_new);
}

#[test]
fn new_entries_begin_with_those_of_other_levels() {
    for (pixel_m, level) in [(0.25, -2), (0.5, -1), (2.0, 1), (4.0, 2)] {
        let mut cache = cache(10_000);
        let old = floor((64.0 / pixel_m) as usize, (64.0 / pixel_m) as usize, [8.0; 2], pixel_m);
        let width = (64.0 / pixel_m) as usize;
        let queue = cache.admit(&Requests::gather(&[View { width, pixels: &old }], &NEAREST));
        assert_eq!(queue.reused, 0);
        for _ in 0..40 {
            let done = cache.update(&queue, |_, _, entry: &mut MomentEntry| {
                entry.update(&[sample(3.0)], 1, &MomentParams::default());
                true
            });
            assert_eq!(done, Ok(queue.texels.len() as u64));
        }
        assert_eq!(cache.key(queue.texels[0].id).unwrap().block.level, level);
        let new = floor(64, 64, [8.0; 2], 1.0);
        let queue = cache.admit(&Requests::gather(&[View { width: 64, pixels: &new }], &NEAREST));
        assert_eq!((queue.reused, queue.texels.len()), (64 * 64, 64 * 64), "level {level}");
        for queued in &queue.texels {
            assert!(queued.is_new);
            assert_eq!(cache.entry(queued.id).unwrap().samples(), CacheParams::default().reuse_samples);
            assert!((cache.entry(queued.id).unwrap().energy().y - 3.0).abs() < 1e-5);
        }
    }
    // Only coarser ones.
    for (pixel_m, reused) in [(0.5, 0), (2.0, 64 * 64)] {
        let params = CacheParams { reuse_finer: false, ..CacheParams::default() };
        let mut cache = ConeCache::<MomentEntry>::new(params).unwrap();
        let side = (80.0 / pixel_m) as usize;
        let old = floor(side, side, [0.0; 2], pixel_m);
        let queue = cache.admit(&Requests::gather(&[View { width: side, pixels: &old }], &NEAREST));
        update_all(&mut cache, &queue);
        let new = floor(64, 64, [8.0; 2], 1.0);
        let queue = cache.admit(&Requests::gather(&[View { width: 64, pixels: &new }], &NEAREST));
        assert_eq!(queue.reused, reused, "{pixel_m}");
    }
    // Too far away, or not at this place.
    let mut cache = cache(10_000);
    for (pixel_m, origin) in [(8.0, 8.0), (2.0, 200.0)] {
        let old = floor(8, 8, [origin; 2], pixel_m);
        let queue = cache.admit(&Requests::gather(&[View { width: 8, pixels: &old }], &NEAREST));
        update_all(&mut cache, &queue);
    }
    let new = floor(64, 64, [8.0; 2], 1.0);
    assert_eq!(cache.admit(&Requests::gather(&[View { width: 64, pixels: &new }], &NEAREST)).reused, 0);
}

#[test]
fn what_was_not_wanted_for_longest_makes_room_and_what_is_wanted_never_does() {
    let mut cache = cache(3);
    let block = |x: f32| floor(4, 4, [x * BLOCK_SIDE as f32 + 1.0, 1.0], 1.0);
    let admit = |cache: &mut ConeCache<MomentEntry>, blocks: &[f32]| {
        let views: Vec<_> = blocks.iter().map(|&x| block(x)).collect();
        let views: Vec<_> = views.iter().map(|pixels| View { width: 4, pixels }).collect();
        let queue = cache.admit(&Requests::gather(&views, &NEAREST));
        update_all(cache, &queue);
        let held: Vec<_> = (0..9).filter(|&x| cache.find(&key_of(x)).is_some()).collect();
        assert!(cache.counts().bytes <= 3 * ConeCache::<MomentEntry>::block_bytes());
        (held, queue.evicted, queue.refused)
    };
    assert_eq!(admit(&mut cache, &[0.0, 1.0]), (vec![0, 1], 0, 0));
    assert_eq!(admit(&mut cache, &[1.0, 2.0]), (vec![0, 1, 2], 0, 0));
    // 0 was not wanted for longest.
    assert_eq!(admit(&mut cache, &[3.0]), (vec![1, 2, 3], 1, 0));
    // 1 and 2 equally long ago: the first slot goes. 3 is wanted, though only after 4.
    assert_eq!(admit(&mut cache, &[4.0, 3.0]), (vec![2, 3, 4], 1, 0));
    // Four blocks of 16 texels for three: the last has no room.
    assert_eq!(admit(&mut cache, &[5.0, 6.0, 7.0, 8.0]), (vec![5, 6, 7], 3, 16));
    assert_eq!(cache.counts().blocks, 3);
    assert_eq!(cache.counts().entries, 48);
}

/// The second texel of the second row in the x-th block.
fn key_of(x: i32) -> TexelKey {
    let block = BlockKey { instance: 5, chart: 2, level: 0, slab: 0, x, y: 0 };
    TexelKey { block, texel: 9 }
}

#[test]
fn instances_that_leave_take_their_entries_along() {
    let mut cache = cache(100_000);
    let pixels = scattered(7, 4000);
    let requests = Requests::gather(&[View { width: 64, pixels: &pixels }], &LookUp::default());
    let queue = cache.admit(&requests);
    update_all(&mut cache, &queue);
    let before = cache.counts();
    cache.retain_instances(|instance| instance == 1);
    assert!(cache.ids().all(|id| cache.place(id).unwrap().0 == 1));
    let left = cache.ids().count();
    let stayed = queue.texels.iter().filter(|q| q.instance == 1).count();
    assert!(left == stayed && left < queue.texels.len());
    let gone = queue.texels.iter().find(|q| q.instance == 0).unwrap().id;
    assert!(cache.entry(gone).is_none() && cache.key(gone).is_none());
    assert!(!cache.change(gone, |_| panic!("it is not there")));
    // An update after it touches only what is left.
    assert_eq!(cache.update(&queue, |_, queued, _| queued.instance == 1), Ok(stayed as u64));
    // The room is used again.
    let again = cache.admit(&requests);
    assert_eq!(cache.counts(), before);
    assert!(again.texels.iter().all(|q| q.is_new == (q.instance == 0)));
}

#[test]
fn blending_keeps_linear_functions_where_everything_is_known() {
    let pixels = floor(100, 80, [20.0, 20.0], 1.0);
    let mut cache = cache(1000);
    let queue = cache.admit(&Requests::gather(&[View { width: 100, pixels: &pixels }], &LookUp::default()));
    let mut reader = Reader::new(&cache, LookUp::default());
    assert!(reader.read(&pixels[0].unwrap()).entries().is_empty(), "nothing has samples yet");
    update_all(&mut cache, &queue);
    let mut reader = Reader::new(&cache, LookUp::default());
    let mut nearest = Reader::new(&cache, NEAREST);
    for pixel in pixels.iter().flatten() {
        let reads = reader.read(pixel);
        assert_eq!(reads.entries().len(), 4);
        let mut centre = [0.0; 2];
        for &(id, weight) in reads.entries() {
            let xy = cache.key(id).unwrap().xy();
            for k in 0..2 {
                centre[k] += weight * (xy[k] as f32 + 0.5);
            }
        }
        assert!((0..2).all(|k| (centre[k] - pixel.place.uv[k]).abs() < 1e-4), "{centre:?} {pixel:?}");
        let own = nearest.read(pixel);
        let [(id, weight)] = own.entries() else { panic!("one entry") };
        let at = pixel.place.uv.map(|v| v.floor() as i32);
        assert_eq!((cache.key(*id).unwrap().xy(), *weight), (at, 1.0));
    }
}

#[test]
fn reads_do_not_leave_the_chart_and_leave_out_what_is_not_known() {
    let mut cache = cache(1000);
    let at = |u: f32, v: f32| PixelPlace {
        instance: 0,
        triangle: 0,
        barycentrics: [0.0; 2],
        place: ChartPlace { chart: 0, uv: [u, v], depth: 0.0, size: [3, 1], texel_m: 1.0 },
        footprint_m: 1.0,
        lean: [0.0; 2],
    };
    let pixels = [0.5, 1.1, 2.5].map(|u| Some(at(u, 0.5)));
    let queue = cache.admit(&Requests::gather(&[View { width: 3, pixels: &pixels }], &LookUp::default()));
    let xy: Vec<_> = queue.texels.iter().map(|q| cache.key(q.id).unwrap().xy()).collect();
    assert_eq!(xy, [[0, 0], [1, 0], [2, 0]]);
    // Only texels 0 and 2 get samples.
    let done = cache.update(&queue, |i, _, entry| {
        entry.update(&[], u32::from(i != 1), &MomentParams::default());
        i != 1
    });
    assert_eq!(done, Ok(2));
    let mut reader = Reader::new(&cache, LookUp::default());
    let mut weights = |u: f32| {
        let reads = reader.read(&at(u, 0.5));
        reads.entries().iter().map(|&(id, w)| (cache.key(id).unwrap().xy()[0], w)).collect::<Vec<_>>()
    };
    assert_eq!(weights(0.75), [(0, 1.0)]);
    assert_eq!(weights(1.75), [(2, 1.0)]);
    assert_eq!(weights(1.5), []);
}

#[test]
fn a_queue_of_another_frame_is_refused() {
    let mut cache = cache(10);
    let pixels = floor(2, 2, [1.0; 2], 1.0);
    let requests = Requests::gather(&[View { width: 2, pixels: &pixels }], &NEAREST);
    let queue = cache.admit(&requests);
    cache.admit(&requests);
    let error = cache.update(&queue, |_, _, _| true).unwrap_err();
    assert!(error.to_string().contains("frame"), "{error}");
    assert!(
        ConeCache::<MomentEntry>::new(CacheParams { reuse_samples: 0, ..CacheParams::default() }).is_err()
    );
    assert!(LookUp { bias: 0.0, blend: true }.check().is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Against a map that is kept the plain way.
    #[test]
    fn frames_do_what_a_plain_map_does(
        frames in prop::collection::vec((0u32..6, 1u32..600, any::<bool>(), 1usize..70), 1..8),
    ) {
        let mut cache = cache(100_000);
        let mut plain: BTreeMap<TexelKey, (u32, u32)> = BTreeMap::new();
        for (frame, (seed, count, blend, width)) in frames.into_iter().enumerate() {
            let frame = frame as u32 + 1;
            let pixels = scattered(seed, count);
            let look_up = LookUp { bias: 1.0, blend };
            let queue = cache.admit(&Requests::gather(&[View { width, pixels: &pixels }], &look_up));
            let mut wanted = BTreeMap::new();
            for pixel in pixels.iter().flatten() {
                let nearby = requests::Nearby::of(pixel, 1.0).unwrap();
                wanted.insert(nearby.own(), ());
                if blend {
                    nearby.each_of_four(|key, _, _| { wanted.insert(key, ()); });
                }
            }
            prop_assert_eq!(queue.texels.len(), wanted.len());
            for queued in &queue.texels {
                let key = cache.key(queued.id).unwrap();
                prop_assert!(wanted.contains_key(&key));
                prop_assert_eq!(cache.find(&key), Some(queued.id));
                let held = plain.get(&key);
                prop_assert_eq!(queued.is_new, held.is_none());
                if let Some((wanted, samples)) = held {
                    prop_assert_eq!(queued.absent, frame - wanted - 1);
                    prop_assert_eq!(u32::from(cache.entry(queued.id).unwrap().samples()), *samples);
                }
            }
            let began: Vec<u32> =
                queue.texels.iter().map(|queued| u32::from(cache.entry(queued.id).unwrap().samples())).collect();
            // Every other one gets a sample.
            let done = cache.update(&queue, |i, _, entry| {
                if i % 2 == 0 {
                    entry.update(&[sample(1.0)], 1, &MomentParams::default());
                }
                i % 2 == 0
            });
            prop_assert_eq!(done, Ok(queue.texels.len().div_ceil(2) as u64));
            for (i, queued) in queue.texels.iter().enumerate() {
                let held = plain.entry(cache.key(queued.id).unwrap()).or_insert((frame, began[i]));
                *held = (frame, (held.1 + u32::from(i % 2 == 0)).min(255));
            }
            prop_assert_eq!(cache.counts().entries, plain.len() as u64);
            let ids: Vec<_> = cache.ids().map(|id| cache.key(id).unwrap()).collect();
            prop_assert_eq!(ids.len(), plain.len());
            prop_assert!(ids.iter().all(|key| plain.contains_key(key)));
        }
    }

    #[test]
    fn no_pixel_panics(bits in prop::collection::vec(prop::array::uniform10(any::<u32>()), 1..40), width in 0usize..9) {
        let pixels: Vec<_> = bits
            .iter()
            .map(|b| {
                let f = b.map(f32::from_bits);
                let size = [b[0] as u16, b[1] as u16];
                let place = ChartPlace { chart: b[2], uv: [f[3], f[4]], depth: f[5], size, texel_m: f[6] };
                let barycentrics = [f[7], f[8]];
                Some(PixelPlace { instance: b[0], triangle: b[1], barycentrics, place, footprint_m: f[9], lean: [f[0], f[1]] })
            })
            .collect();
        let mut cache = cache(20);
        for _ in 0..2 {
            let queue = cache.admit(&Requests::gather(&[View { width, pixels: &pixels }], &LookUp::default()));
            update_all(&mut cache, &queue);
        }
        let mut reader = Reader::new(&cache, LookUp::default());
        for pixel in pixels.iter().flatten() {
            let reads = reader.read(pixel);
            let sum: f32 = reads.entries().iter().map(|(_, weight)| weight).sum();
            prop_assert!(reads.entries().is_empty() || (sum - 1.0).abs() < 1e-5);
        }
    }
}
