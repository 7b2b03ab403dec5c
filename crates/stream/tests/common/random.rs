//! Random stores: what a publisher may be handed, the awkward ones included.

use std::sync::Arc;

use dapple_store::light_visibility::{LEAN_STEPS, Lean, LightVisibility, OPEN};
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
        let count = layout.len() * lights as usize;
        let of_lights = prop::collection::vec(0..=OPEN, count);
        let leans = prop::option::of(prop::collection::vec([-LEAN_STEPS..=LEAN_STEPS, -1..=1], count));
        (plane(), prop::option::of([plane(), plane()]), of_lights, leans).prop_map(
            move |(values, bent, of_lights, leans)| {
                let mut store = PointStore::new(layout.clone(), values).expect("one value a point");
                if let Some(bent) = bent {
                    store = store.with_bent(bent).expect("one a point");
                }
                if lights > 0 {
                    let of = leans.into_iter().flatten().zip(&of_lights);
                    let leans: Vec<Lean> = of.map(|(lean, value)| Lean(lean).of_value(*value)).collect();
                    let mut lights = LightVisibility::new(&layout, lights, of_lights).expect("a few lights");
                    if !leans.is_empty() {
                        lights = lights.with_leans(leans).expect("one a value");
                    }
                    store = store.with_lights(lights).expect("one a point and light");
                }
                store
            },
        )
    })
}
