//! What tests of whole sessions share: sets in store order, and equality to the bit.

use dapple_store::points::{PackedNormal, PointSet, PointStore, morton_code};
use glam::Vec3;

/// A set with its points in store order.
pub(crate) fn set(instance: u32, origin: [f32; 3], mut points: Vec<([u32; 3], [u8; 2])>) -> PointSet {
    points.sort_by_key(|&(p, n)| (morton_code(p), n));
    PointSet {
        instance,
        first: 0,
        origin_rest: Vec3::from(origin),
        positions: points.iter().map(|p| p.0).collect(),
        normals: points.iter().map(|p| PackedNormal(p.1)).collect(),
    }
}

/// Whether two stores are the same to the last bit (`==` holds 0 and -0 to be equal).
pub(crate) fn same_bits(a: &PointStore, b: &PointStore) -> bool {
    let floats = |store: &PointStore| -> Vec<u32> {
        let layout = store.layout();
        let origins = layout.sets().iter().flat_map(|set| set.origin_rest.to_array());
        [layout.quantum_m(), layout.spacing_m()].into_iter().chain(origins).map(f32::to_bits).collect()
    };
    a == b && floats(a) == floats(b)
}
