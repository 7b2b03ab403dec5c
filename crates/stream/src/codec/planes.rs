//! The bytes of a point, each kind in a plane of its own: visibility, and the two of a bent normal if there are any. What is held of lights
//! comes after them.

use dapple_store::light_visibility::{LightChange, LightVisibility};
use dapple_store::points::{BentChange, BentNormal, PointStore};

use super::values::ValueChange;

/// Most planes of a store.
pub(crate) const PLANES: usize = 3;

/// In the byte that says how many bits of a coordinate are local: values come with bent normals.
pub(super) const HAS_BENT: u8 = 0x80;

/// In the same byte: how many lights there are values of comes after it.
pub(super) const HAS_LIGHTS: u8 = 0x40;

/// In the same byte, only beside that: with where on each light lies what is seen of it.
pub(super) const HAS_LEANS: u8 = 0x20;

/// In the byte that says which planes of a delta change: so do values of lights.
pub(super) const LIGHTS_CHANGE: u8 = 1 << PLANES;

/// What comes with visibility.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Extras {
    /// Bent normals.
    pub(crate) has_bent: bool,
    /// Values of so many lights.
    pub(crate) lights: u32,
    /// And where what is seen of them lies.
    pub(crate) has_leans: bool,
}

impl Extras {
    pub(crate) fn of(store: &PointStore) -> Extras {
        let has_leans = store.lights().is_some_and(LightVisibility::has_leans);
        Extras { has_bent: store.bent().is_some(), lights: store.light_count(), has_leans }
    }

    /// Whether a delta says which planes change.
    pub(super) fn is_any(self) -> bool {
        self != Extras::default()
    }
}

/// The planes of a store.
pub(crate) fn planes(store: &PointStore) -> impl Iterator<Item = &[u8]> {
    std::iter::once(store.visibility()).chain(store.bent().into_iter().flatten().map(Vec::as_slice))
}

/// What changed of a store, in order of point.
#[derive(Clone, Debug, Default)]
pub(crate) struct Changes {
    pub(crate) visibility: Vec<ValueChange>,
    pub(crate) bent: Vec<BentChange>,
    /// In order of index.
    pub(crate) lights: Vec<LightChange>,
}

impl Changes {
    /// From the changes of each plane of `before`, and those of lights.
    pub(crate) fn new(
        [visibility, first, second]: [Vec<ValueChange>; PLANES],
        lights: Vec<LightChange>,
        before: &PointStore,
    ) -> Changes {
        let Some(planes) = before.bent() else { return Changes { visibility, bent: Vec::new(), lights } };
        let mut bent = Vec::with_capacity(first.len().max(second.len()));
        let (mut first, mut second) = (first.into_iter().peekable(), second.into_iter().peekable());
        loop {
            let next = first.peek().into_iter().chain(second.peek()).map(|change| change.point).min();
            let Some(point) = next else { break };
            let old = BentNormal([planes[0][point as usize], planes[1][point as usize]]);
            let mut new = old;
            for (byte, changes) in new.0.iter_mut().zip([&mut first, &mut second]) {
                if let Some(change) = changes.next_if(|change| change.point == point) {
                    *byte = change.new;
                }
            }
            bent.push(BentChange { point, old, new });
        }
        Changes { visibility, bent, lights }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dapple_store::points::{PackedNormal, PointLayout, PointSet};

    #[test]
    fn changes_of_both_bytes_of_a_point_are_one() {
        let set = PointSet {
            positions: vec![[0; 3]; 4],
            normals: vec![PackedNormal([127, 254]); 4],
            ..PointSet::default()
        };
        let layout = PointLayout::new(1.0, 1.0, vec![set]).unwrap();
        let store = PointStore::new(layout.into(), vec![0; 4]).unwrap();
        let store = store.with_bent([vec![10, 11, 12, 13], vec![20, 21, 22, 23]]).unwrap();
        let change = |point: u32, plane: u8| ValueChange { point, old: 10 * plane + point as u8, new: 99 };
        let planes = [vec![], vec![change(0, 1), change(2, 1)], vec![change(2, 2), change(3, 2)]];
        let bent = |point: u32, new: [u8; 2]| {
            let old = store.bent_of(point as usize).unwrap();
            BentChange { point, old, new: BentNormal(new) }
        };
        let expected = [bent(0, [99, 20]), bent(2, [99, 99]), bent(3, [13, 99])];
        assert_eq!(Changes::new(planes, Vec::new(), &store).bent, expected);
    }
}
