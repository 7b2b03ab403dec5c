//! Pages never overlap, whatever comes and goes.

use proptest::prelude::*;

use super::super::*;

fn page(width: u16, height: u16) -> PageSize {
    PageSize { width, height }
}

/// Panics if pages overlap or leave their layer.
fn check(atlas: &Atlas, placed: &[(Vec<Placement>, Vec<PageSize>)]) {
    let side = usize::from(atlas.side());
    let mut taken = vec![vec![false; side * side]; usize::from(atlas.layers())];
    let mut texels = 0;
    for (placement, page) in placed.iter().flat_map(|(a, b)| a.iter().zip(b)) {
        texels += u64::from(page.area());
        for y in placement.y..placement.y + page.height {
            for x in placement.x..placement.x + page.width {
                let cell = &mut taken[usize::from(placement.layer)][usize::from(y) * side + usize::from(x)];
                assert!(!*cell, "{page:?} at {placement:?} lies over another");
                *cell = true;
            }
        }
    }
    assert_eq!(atlas.used_texels(), texels);
}

proptest! {
    #[test]
    fn pages_never_overlap(
        steps in prop::collection::vec((any::<bool>(), prop::collection::vec((0u16..40, 0u16..40), 0..6)), 0..40),
        side in 1u16..80,
        layers in 1u16..4,
    ) {
        let mut atlas = Atlas::new(side, layers);
        let mut placed: Vec<(Vec<Placement>, Vec<PageSize>)> = Vec::new();
        for (remove, sizes) in steps {
            if remove && !placed.is_empty() {
                let (placements, pages) = placed.remove(sizes.len() % placed.len());
                atlas.remove(&placements, &pages);
                // A second time does nothing.
                atlas.remove(&placements, &pages);
            } else {
                let pages: Vec<PageSize> = sizes.iter().map(|&(w, h)| page(w, h)).collect();
                if let Ok(placements) = atlas.insert(&pages) {
                    placed.push((placements, pages));
                }
            }
            check(&atlas, &placed);
        }
    }

    #[test]
    fn what_an_atlas_was_sized_for_fits(sizes in prop::collection::vec((1u16..60, 1u16..60), 0..60)) {
        let pages: Vec<PageSize> = sizes.iter().map(|&(w, h)| page(w, h)).collect();
        let mut atlas = Atlas::for_pages(&pages, 4096, 1);
        prop_assert!(atlas.side().is_power_of_two());
        let mut placed = Vec::new();
        for one in &pages {
            placed.push((atlas.insert(&[*one]).unwrap(), vec![*one]));
        }
        check(&atlas, &placed);
        if atlas.side() > 1 {
            prop_assert!(Atlas::new(atlas.side() / 2, 1).insert(&pages).is_err());
        }
    }
}

#[test]
fn freed_room_is_used_again() {
    let mut atlas = Atlas::new(64, 1);
    for _ in 0..100 {
        let pages = [page(64, 32), page(32, 32), page(32, 32)];
        let placements = atlas.insert(&pages).unwrap();
        assert!(atlas.insert(&[page(1, 1)]).is_err());
        atlas.remove(&placements[1..2], &pages[1..2]);
        let again = atlas.insert(&[page(32, 32)]).unwrap();
        assert_eq!(again[0], placements[1]);
        atlas.remove(&placements, &pages);
        assert_eq!((atlas.used_texels(), atlas.layers()), (0, 1));
    }
}

#[test]
fn errors_name_the_need_and_the_limit() {
    let mut atlas = Atlas::new(32, 2);
    let error = atlas.insert(&[page(33, 1)]).unwrap_err();
    assert_eq!(error, AtlasError::PageTooLarge { width: 33, height: 1, side: 32 });
    atlas.insert(&[page(32, 32), page(32, 20)]).unwrap();
    let error = atlas.insert(&[page(10, 10), page(20, 13)]).unwrap_err();
    assert_eq!(error, AtlasError::Full { needed: 360, used: 1664, limit: 2048, layers: 2, side: 32 });
    // Nothing was placed, and the rest is still free.
    assert_eq!(atlas.used_texels(), 1664);
    atlas.insert(&[page(32, 12)]).unwrap();
}

#[test]
fn the_largest_side_is_kept_where_one_layer_does_not_do() {
    assert_eq!(Atlas::for_pages(&[page(100, 100); 9], 256, 4).side(), 256);
    assert_eq!(Atlas::for_pages(&[page(290, 10)], 300, 4).side(), 300);
    assert_eq!(Atlas::for_pages(&[], 300, 4).side(), 1);
}
