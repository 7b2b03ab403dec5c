//! Random stores: what a publisher may be handed, the awkward ones included.

use std::sync::Arc;

use dapple_store::light_visibility::{LightVisibility, OPEN};
use dapple_store::points::{MAX_COORDINATE, PointLayout, PointStore};
use proptest::prelude::*;

use crate::common::set;

fn coordinate() -> impl Strategy<Value = u32> {
    prop_oneof![4 => 0u32..200, 2 => 0..=MAX_COORDINATE, 1 => Just(0), 1 => Just(MAX_COORDINATE)]
}

fn points() -> impl Strategy<Value = Vec<([u32; 3], [u8; 2])>> {
    let position = prop_oneof![
        6 => prop::array::uniform3(coordinate()),
        // Few places: several points in one.
        1 => prop::array::uniform3(5u32..7),
    ];
    let normal = prop_oneof![3 => Just([127, 254]), 2 => any::<[u8; 2]>(), 1 => Just([255, 255])];
    prop::collection::vec((position, normal), 0..60)
}

prop_compose! {
    /// Layouts of 0 to 4 sets of 0 to 60 points.
    pub fn layouts()(
        quantum in prop_oneof![Just(0.002f32), 1e-30f32..1e30, Just(f32::MIN_POSITIVE)],
        ratio in prop_oneof![Just(32f32), 0.1f32..3000.0],
        sets in prop::collection::vec((0u32..1000, prop::array::uniform3(any::<f32>()), points()), 0..4),
        last in any::<bool>(),
    ) -> Arc<PointLayout> {
        let mut instance = 0;
        let count = sets.len();
        let sets = sets.into_iter().enumerate().map(|(i, (gap, origin, points))| {
            instance = if last && i + 1 == count { u32::MAX } else { instance + gap + u32::from(i > 0) };
            let finite = origin.map(|c| if c.is_finite() { c } else { -0.0 });
            set(instance, finite, points)
        }).collect();
        let spacing = (quantum * ratio).max(f32::MIN_POSITIVE);
        Arc::new(PointLayout::new(quantum, spacing, sets).expect("the strategy keeps the store's rules"))
    }
}

/// Stores over random layouts, with or without bent normals and visibility of lights.
pub(crate) fn stores() -> impl Strategy<Value = PointStore> {
    (layouts(), 0u32..4).prop_flat_map(|(layout, lights)| {
        let plane = || prop::collection::vec(any::<u8>(), layout.len());
        let of_lights = prop::collection::vec(0..=OPEN, layout.len() * lights as usize);
        (plane(), prop::option::of([plane(), plane()]), of_lights).prop_map(
            move |(values, bent, of_lights)| {
                let mut store = PointStore::new(layout.clone(), values).expect("one value a point");
                if let Some(bent) = bent {
                    store = store.with_bent(bent).expect("one a point");
                }
                if lights > 0 {
                    let lights = LightVisibility::new(&layout, lights, of_lights).expect("a few lights");
                    store = store.with_lights(lights).expect("one a point and light");
                }
                store
            },
        )
    })
}
