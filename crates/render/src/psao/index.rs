//! Finds the points near a fragment.

use dapple_store::charts::Weighed;
use dapple_store::points::{CellGrid, PointLayout};
use glam::Vec3;

use crate::gbuffer::RestSurface;

/// Decoded points in cells, one grid an instance. Made once for a layout.
#[derive(Clone, Debug)]
pub struct PointIndex {
    spacing_m: f32,
    len: usize,
    /// In order of instance.
    sets: Vec<IndexedSet>,
}

#[derive(Clone, Debug)]
struct IndexedSet {
    instance: u32,
    first: u32,
    grid: CellGrid,
    positions_rest: Vec<Vec3>,
    normals_rest: Vec<Vec3>,
}

/// Edge of a cell in units of the spacing: the widest kernel reaches one cell further.
const CELL_IN_SPACINGS: f32 = 1.0;

impl PointIndex {
    /// Decodes a layout. About 40 bytes a point.
    pub fn new(layout: &PointLayout) -> PointIndex {
        let mut sets = Vec::with_capacity(layout.sets().len());
        for set in layout.sets() {
            let positions_rest: Vec<Vec3> =
                (0..set.len()).map(|i| set.position_rest(i, layout.quantum_m())).collect();
            sets.push(IndexedSet {
                instance: set.instance,
                first: set.first,
                grid: CellGrid::new(&positions_rest, layout.spacing_m() * CELL_IN_SPACINGS),
                positions_rest,
                normals_rest: set.normals.iter().map(|n| n.unpack()).collect(),
            });
        }
        PointIndex { spacing_m: layout.spacing_m(), len: layout.len(), sets }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The layout's spacing r0, metres.
    pub fn spacing_m(&self) -> f32 {
        self.spacing_m
    }

    fn set(&self, instance: u32) -> Option<(usize, &IndexedSet)> {
        let at = self.sets.binary_search_by_key(&instance, |set| set.instance).ok()?;
        Some((at, &self.sets[at]))
    }

    /// Collects the fragment's candidates into `near`: all its instance's points within `radius_m`, and some beyond.
    pub(super) fn candidates(&self, fragment: &RestSurface, radius_m: f32, near: &mut Near) {
        let Some((at, set)) = self.set(fragment.instance) else {
            near.points.clear();
            near.key = None;
            return;
        };
        let reach = (radius_m / set.grid.cell_m()).ceil().clamp(1.0, 8.0) as i32;
        let key = (at, set.grid.cell_of(fragment.position_rest), reach);
        // Neighbouring fragments mostly share a cell.
        if near.key == Some(key) {
            return;
        }
        near.key = Some(key);
        near.indices.clear();
        set.grid.gather(key.1, reach, &mut near.indices);
        near.points.clear();
        near.points.extend(near.indices.iter().map(|&i| NearPoint {
            position_rest: set.positions_rest[i as usize],
            normal_rest: set.normals_rest[i as usize],
            point: set.first + i,
        }));
    }

    /// The point of the fragment's instance that is nearest to it among those on its side, or of all if none is;
    /// `None` for an instance without points within eight cells.
    pub(super) fn nearest(&self, fragment: &RestSurface, near: &mut Near) -> Option<u32> {
        for reach in [1.0, 2.0, 4.0, 8.0] {
            let radius_m = reach * self.spacing_m * CELL_IN_SPACINGS;
            self.candidates(fragment, radius_m, near);
            let best = near
                .points
                .iter()
                .map(|p| {
                    let opposed = p.normal_rest.dot(fragment.normal_rest) <= 0.0;
                    (opposed, p.position_rest.distance_squared(fragment.position_rest), p.point)
                })
                .min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
            if let Some((opposed, _, point)) = best
                && (!opposed || reach == 8.0)
            {
                return Some(point);
            }
        }
        None
    }
}

/// Candidates of the last fragment, kept for the next.
#[derive(Debug, Default)]
pub(super) struct Near {
    key: Option<(usize, [i32; 3], i32)>,
    indices: Vec<u32>,
    pub(super) points: Vec<NearPoint>,
    /// What least squares makes of them, with their values.
    pub(super) weighed: Vec<(Weighed, f32)>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct NearPoint {
    pub(super) position_rest: Vec3,
    pub(super) normal_rest: Vec3,
    pub(super) point: u32,
}
