//! Finds the points of a set near a place. Points are in Morton order, so a cell of them is a run: nothing is sorted.

use std::ops::Range;

use glam::Vec3;

use crate::points::{MAX_COORDINATE, PointSet, morton_code};

/// Bits of a coordinate.
const BITS: u32 = MAX_COORDINATE.count_ones();

/// Cubic cells of 2ᵏ steps of the integer grid, found through a hash table.
#[derive(Clone, Debug)]
pub(super) struct PointCells {
    origin_rest: Vec3,
    quantum_m: f32,
    shift: u32,
    /// Open addressing: index into `runs` + 1, 0 = free. Length is a power of two.
    table: Vec<u32>,
    /// Morton code of each cell and its first point, ascending; one closing entry.
    runs: Vec<(u64, u32)>,
}

impl PointCells {
    /// Cells with an edge of at least `edge_m` (less than twice that), unless the whole grid is smaller.
    pub(super) fn new(set: &PointSet, quantum_m: f32, edge_m: f32) -> PointCells {
        let mut shift = 0;
        // In f64 nothing overflows: a cell must not come out smaller than the radius that is asked for later.
        while shift < BITS && f64::from(1u32 << shift) * f64::from(quantum_m) < f64::from(edge_m) {
            shift += 1;
        }
        let mut runs: Vec<(u64, u32)> = Vec::new();
        for (i, &position) in (0u32..).zip(&set.positions) {
            let cell = morton_code(position) >> (3 * shift);
            if runs.last().is_none_or(|&(last, _)| last != cell) {
                runs.push((cell, i));
            }
        }
        let mut table = vec![0u32; (2 * runs.len()).next_power_of_two().max(2)];
        for (index, &(cell, _)) in runs.iter().enumerate() {
            let mut slot = hash(cell) & (table.len() - 1);
            while table[slot] != 0 {
                slot = (slot + 1) & (table.len() - 1);
            }
            table[slot] = index as u32 + 1;
        }
        runs.push((u64::MAX, set.positions.len() as u32));
        PointCells { origin_rest: set.origin_rest, quantum_m, shift, table, runs }
    }

    fn in_cell(&self, cell: u64) -> Range<u32> {
        let mut slot = hash(cell) & (self.table.len() - 1);
        while self.table[slot] != 0 {
            let index = self.table[slot] as usize - 1;
            if self.runs[index].0 == cell {
                return self.runs[index].1..self.runs[index + 1].1;
            }
            slot = (slot + 1) & (self.table.len() - 1);
        }
        0..0
    }

    /// First and last cell of the box around `position_rest` with half edges of `radius_m`.
    pub(super) fn cells_around(&self, position_rest: Vec3, radius_m: f32) -> CellBox {
        // `as` saturates and takes NaN for 0, so nothing here can overflow.
        let cell = |p: Vec3| {
            let steps = (p - self.origin_rest) / self.quantum_m;
            steps
                .floor()
                .to_array()
                .map(|c| (c as i64).clamp(-1, i64::from(MAX_COORDINATE) + 1) >> self.shift)
        };
        CellBox { first: cell(position_rest - radius_m), last: cell(position_rest + radius_m) }
    }

    /// The points of a box as runs of indices, ascending.
    pub(super) fn gather(&self, cells: &CellBox, runs: &mut Vec<Range<u32>>) {
        runs.clear();
        let most = i64::from(MAX_COORDINATE) >> self.shift;
        let range = |axis: usize| cells.first[axis].max(0)..=cells.last[axis].min(most);
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let run = self.in_cell(morton_code([x as u32, y as u32, z as u32]));
                    if !run.is_empty() {
                        runs.push(run);
                    }
                }
            }
        }
        runs.sort_unstable_by_key(|run| run.start);
    }

    pub(super) fn bytes(&self) -> usize {
        self.table.len() * size_of::<u32>() + self.runs.len() * size_of::<(u64, u32)>()
    }
}

/// A box of cells, borders included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CellBox {
    first: [i64; 3],
    last: [i64; 3],
}

fn hash(cell: u64) -> usize {
    (cell.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::PackedNormal;
    use proptest::prelude::*;

    fn set(mut positions: Vec<[u32; 3]>) -> PointSet {
        positions.sort_unstable_by_key(|&p| morton_code(p));
        let normals = vec![PackedNormal::default(); positions.len()];
        PointSet { instance: 0, first: 0, origin_rest: Vec3::new(-1.0, 0.5, 2.0), positions, normals }
    }

    proptest! {
        #[test]
        fn everything_within_the_radius_is_gathered_once_in_order(
            positions in prop::collection::vec(prop::array::uniform3(0u32..300), 0..200),
            q in prop::array::uniform3(-100f32..400.0),
            edge in 1f32..90.0,
            part in 0.1f32..2.0,
        ) {
            const QUANTUM: f32 = 0.01;
            let set = set(positions);
            let cells = PointCells::new(&set, QUANTUM, edge * QUANTUM);
            let radius = edge * part;
            let q = set.origin_rest + Vec3::from(q) * QUANTUM;
            let mut runs = Vec::new();
            cells.gather(&cells.cells_around(q, radius * QUANTUM), &mut runs);
            let found: Vec<u32> = runs.into_iter().flatten().collect();
            prop_assert!(found.windows(2).all(|w| w[0] < w[1]));
            for i in 0..set.len() {
                if set.position_rest(i, QUANTUM).distance(q) < radius * QUANTUM * 0.999 {
                    prop_assert!(found.contains(&(i as u32)));
                }
            }
        }
    }

    #[test]
    fn extreme_places_and_lengths_do_no_harm() {
        let set = set(vec![[0; 3], [MAX_COORDINATE; 3]]);
        for (quantum, edge) in [(1e-30, 1e30), (1e30, 1e-30), (f32::MIN_POSITIVE, f32::MAX)] {
            let cells = PointCells::new(&set, quantum, edge);
            for q in [Vec3::ZERO, Vec3::splat(3e38), Vec3::splat(-3e38), Vec3::NAN] {
                let mut runs = Vec::new();
                let around = cells.cells_around(q, edge);
                cells.gather(&around, &mut runs);
                assert!(runs.len() <= 2);
            }
        }
    }
}
