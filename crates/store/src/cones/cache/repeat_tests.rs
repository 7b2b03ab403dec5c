//! What stays from one frame to the next is as it would be anew.

use proptest::prelude::*;

use super::super::{MomentEntry, MomentParams};
use super::tests::{cache, scattered, update_all};
use super::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// What is repeated, and what is gathered again, is as if it were done anew.
    #[test]
    fn repeating_is_the_same_as_asking_again(
        frames in prop::collection::vec((0u32..3, 1usize..70, 0u32..3), 2..6), few in any::<bool>(),
    ) {
        let mut cache = cache(if few { 12 } else { 100_000 });
        let mut requests = Requests::default();
        for (seed, width, repeats) in frames {
            let pixels = scattered(seed, 4000);
            let views = [View { width, pixels: &pixels }];
            requests.gather_again(&views, &LookUp::default());
            let anew = Requests::gather(&views, &LookUp::default());
            let mut other = cache.clone();
            let mut queue = cache.admit(&requests);
            prop_assert_eq!(&queue, &other.admit(&anew));
            for _ in 0..repeats {
                update_all(&mut cache, &queue);
                let mut other = cache.clone();
                prop_assert!(requests.gather_again(&views, &LookUp::default()));
                let done = cache.repeat(&requests, &mut queue);
                prop_assert_eq!(done, queue.refused == 0);
                if !done {
                    queue = cache.admit(&requests);
                }
                let expected = other.admit(&anew);
                prop_assert_eq!(&queue.texels, &expected.texels);
                prop_assert_eq!((queue.frame(), queue.refused), (expected.frame(), expected.refused));
                // Nothing in the cache tells them apart later on.
                let later = Requests::gather(&[View { width, pixels: &scattered(seed + 1, 900) }], &LookUp::default());
                let [mut a, mut b] = [cache.clone(), other];
                prop_assert_eq!(a.admit(&later), b.admit(&later));
            }
        }
    }

    /// Everything that happens to a block can be told by the clock.
    #[test]
    fn blocks_tell_when_they_changed(steps in prop::collection::vec((0u32..2, 0u32..7), 2..12), few in any::<bool>()) {
        let mut cache = cache(if few { 40 } else { 100_000 });
        let mut queue = UpdateQueue::default();
        let mut requests = Requests::default();
        let of_block = |cache: &ConeCache<MomentEntry>, queue: &UpdateQueue, block: usize| {
            let ids: Vec<_> = cache.ids_of_blocks(block..block + 1).collect();
            let entries: Vec<_> = ids.iter().map(|id| (cache.place(*id), *cache.entry(*id).unwrap())).collect();
            let wanted: Vec<_> =
                queue.texels.iter().map(|t| t.id).filter(|id| id.index() / BLOCK_TEXELS == block && cache.key(*id).is_some()).collect();
            (ids.first().map(|id| cache.key(*id).unwrap().block), entries, wanted)
        };
        for (seed, what) in steps {
            let (before, queue_before, clock) = (cache.clone(), queue.clone(), cache.clock());
            let mut is_idle = false;
            match what {
                0 | 1 => {
                    let pixels = scattered(seed, 300);
                    requests = Requests::gather(&[View { width: 64, pixels: &pixels }], &LookUp::default());
                    queue = cache.admit(&requests);
                }
                2 => is_idle = cache.repeat(&requests, &mut queue),
                3 => {
                    let update = |_: usize, _: &QueuedTexel, entry: &mut MomentEntry| {
                        entry.update(&[], 3, &MomentParams::default());
                        true
                    };
                    prop_assert!(cache.update(&queue, update).is_ok());
                }
                4 => {
                    // Few take samples, some change without.
                    let done = cache.update(&queue, |i, _, entry: &mut MomentEntry| match i % 50 {
                        0 => {
                            entry.cut_confidence(1);
                            Touch::Changed
                        }
                        _ => Touch::Nothing,
                    });
                    prop_assert!(queue.frame() == 0 || done == Ok(0));
                }
                5 => {
                    if let Some(texel) = queue.texels.first() {
                        cache.change(texel.id, |entry| entry.cut_confidence(2));
                    }
                }
                _ => cache.retain_instances(|instance| instance != 1),
            }
            for block in 0..cache.end_block() {
                let same = of_block(&cache, &queue, block) == of_block(&before, &queue_before, block);
                prop_assert!(same || cache.changed_at(block) > clock, "block {}, by {}", block, what);
                prop_assert!(!is_idle || cache.changed_at(block) <= clock, "nothing was done");
            }
        }
    }
}

#[test]
fn only_the_same_is_repeated() {
    let mut cache = cache(100_000);
    let [first, second] = [1, 2].map(|seed| {
        let pixels = scattered(seed, 500);
        Requests::gather(&[View { width: 64, pixels: &pixels }], &LookUp::default())
    });
    let mut queue = cache.admit(&first);
    let old = queue.clone();
    assert!(!cache.repeat(&second, &mut queue), "other requests");
    assert!(!cache.repeat(&Requests::default(), &mut queue), "none");
    assert!(cache.repeat(&first, &mut queue) && cache.repeat(&first, &mut queue));
    assert!(!cache.repeat(&first, &mut old.clone()), "an old queue");
    cache.retain_instances(|instance| instance != 0);
    let frame = cache.frame();
    assert!(!cache.repeat(&first, &mut queue), "an instance is gone");
    assert_eq!(cache.frame(), frame);
    // Gathered again and not admitted: what is in the cache is of other pixels.
    let pixels = scattered(3, 500);
    let views = [View { width: 64, pixels: &pixels }];
    let mut requests = first.clone();
    let mut queue = cache.admit(&requests);
    assert!(!requests.gather_again(&views, &LookUp::default()));
    assert!(requests.gather_again(&views, &LookUp::default()));
    assert!(!cache.repeat(&requests, &mut queue), "never admitted");
}

/// Squares of blocks come whole, each texel of the queue once.
#[test]
fn blocks_beside_each_other_are_updated_at_once() {
    let pixels = scattered(3, 4000);
    for up in [0, 1, 2] {
        let mut cache = cache(100_000);
        let queue =
            cache.admit(&Requests::gather(&[View { width: 64, pixels: &pixels }], &LookUp::default()));
        let squares = std::sync::Mutex::new(Vec::new());
        let done = cache.update_blocks(&queue, up, |blocks| {
            let square = blocks[0].key.square(up);
            assert!(blocks.iter().all(|block| block.key.square(up) == square));
            let mut texels = Vec::new();
            for block in &mut *blocks {
                for i in 0..block.texels.len() {
                    assert_eq!(queue.texels[block.first + i], block.texels[i]);
                    texels.push(block.first + i);
                    block.entry(i).skip_to(7);
                    block.touched[i] = if i % 2 == 0 { Touch::Updated } else { Touch::Changed };
                }
            }
            squares.lock().unwrap().push((square, texels));
        });
        let squares = squares.into_inner().unwrap();
        let names: std::collections::BTreeSet<BlockKey> = squares.iter().map(|(square, _)| *square).collect();
        assert_eq!(names.len(), squares.len(), "each square once");
        let mut all: Vec<usize> = squares.into_iter().flat_map(|(_, texels)| texels).collect();
        all.sort_unstable();
        assert!(all.iter().copied().eq(0..queue.texels.len()), "each texel once");
        assert!(queue.texels.iter().all(|texel| cache.entry(texel.id).unwrap().taken() == 7));
        assert!(done.unwrap() * 2 >= queue.texels.len() as u64);
    }
    // Left of and under the origin, too.
    let key = BlockKey { instance: 0, chart: 0, level: 0, slab: 0, x: -1, y: -3 };
    assert_eq!((key.square(1).x, key.square(1).y, key.square(200).y), (-1, -2, -1));
}
