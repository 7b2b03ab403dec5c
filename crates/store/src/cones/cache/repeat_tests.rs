//! What stays from one frame to the next is as it would be anew.

use proptest::prelude::*;

use super::super::MomentEntry;
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
                let done = cache.repeat(&mut queue);
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
    fn blocks_tell_when_they_changed(seeds in prop::collection::vec(0u32..2, 2..6), few in any::<bool>()) {
        let mut cache = cache(if few { 40 } else { 100_000 });
        let (mut before, mut clock) = (cache.clone(), 0);
        for seed in seeds {
            let pixels = scattered(seed, 300);
            let requests = Requests::gather(&[View { width: 64, pixels: &pixels }], &LookUp::default());
            let mut queue = cache.admit(&requests);
            let of_block = |cache: &ConeCache<MomentEntry>, block: usize| {
                let ids: Vec<_> = cache.ids_of_blocks(block..block + 1).collect();
                let entries: Vec<_> = ids.iter().map(|id| (cache.place(*id), *cache.entry(*id).unwrap())).collect();
                (ids.first().map(|id| cache.key(*id).unwrap().block), entries)
            };
            for step in 0..3 {
                if step == 1 {
                    update_all(&mut cache, &queue);
                } else if step == 2 {
                    let done = cache.repeat(&mut queue);
                    prop_assert!(done || few);
                }
                for block in 0..cache.end_block() {
                    let same = of_block(&cache, block) == of_block(&before, block);
                    prop_assert!(same || cache.changed_at(block) > clock, "block {}, step {}", block, step);
                    prop_assert!(step < 2 || cache.changed_at(block) <= clock, "nothing was done");
                }
                prop_assert!(cache.clock() > clock || step == 2);
                (before, clock) = (cache.clone(), cache.clock());
            }
        }
    }
}
