//! A static grid over positions: which lie near a place.

use glam::Vec3;

/// Positions sorted into cubic cells, found through a hash table. Built once, never changed.
#[derive(Clone, Debug)]
pub struct CellGrid {
    cell_m: f32,
    /// Open addressing: index into `cells` + 1, 0 = free. Length is a power of two.
    table: Vec<u32>,
    /// Cell coordinate and the first of its entries; one closing entry.
    cells: Vec<([i32; 3], u32)>,
    /// Indices of positions, by cell, ascending within one.
    entries: Vec<u32>,
}

impl CellGrid {
    /// Sorts `positions` (finite) into cells of edge `cell_m` > 0. Coordinates beyond ±2³¹ cells share the border cells.
    pub fn new(positions: &[Vec3], cell_m: f32) -> CellGrid {
        let mut keyed: Vec<([i32; 3], u32)> =
            positions.iter().enumerate().map(|(i, &p)| (cell_of(p, cell_m), i as u32)).collect();
        keyed.sort_unstable();
        let entries = keyed.iter().map(|&(_, i)| i).collect();
        let mut cells: Vec<([i32; 3], u32)> = Vec::new();
        for (start, &(cell, _)) in keyed.iter().enumerate() {
            if cells.last().is_none_or(|&(last, _)| last != cell) {
                cells.push((cell, start as u32));
            }
        }
        let mut table = vec![0u32; (2 * cells.len()).next_power_of_two().max(2)];
        for (index, &(cell, _)) in cells.iter().enumerate() {
            let mut slot = hash(cell) as usize & (table.len() - 1);
            while table[slot] != 0 {
                slot = (slot + 1) & (table.len() - 1);
            }
            table[slot] = index as u32 + 1;
        }
        cells.push(([i32::MAX; 3], keyed.len() as u32));
        CellGrid { cell_m, table, cells, entries }
    }

    /// Edge of a cell, metres.
    pub fn cell_m(&self) -> f32 {
        self.cell_m
    }

    /// The cell that contains `p`.
    pub fn cell_of(&self, p: Vec3) -> [i32; 3] {
        cell_of(p, self.cell_m)
    }

    /// Indices of the positions in one cell, ascending.
    pub fn in_cell(&self, cell: [i32; 3]) -> &[u32] {
        let mut slot = hash(cell) as usize & (self.table.len() - 1);
        while self.table[slot] != 0 {
            let index = self.table[slot] as usize - 1;
            if self.cells[index].0 == cell {
                let (start, end) = (self.cells[index].1 as usize, self.cells[index + 1].1 as usize);
                return &self.entries[start..end];
            }
            slot = (slot + 1) & (self.table.len() - 1);
        }
        &[]
    }

    /// Appends the indices in the box of cells within `reach` cells of `cell`, in cell order.
    pub fn gather(&self, cell: [i32; 3], reach: i32, out: &mut Vec<u32>) {
        let range = |c: i32| c.saturating_sub(reach)..=c.saturating_add(reach);
        for z in range(cell[2]) {
            for y in range(cell[1]) {
                for x in range(cell[0]) {
                    out.extend_from_slice(self.in_cell([x, y, z]));
                }
            }
        }
    }
}

fn cell_of(p: Vec3, cell_m: f32) -> [i32; 3] {
    // `as` saturates, so nothing here can overflow.
    (p / cell_m).floor().to_array().map(|c| c as i32)
}

fn hash(cell: [i32; 3]) -> u32 {
    let mut h = (cell[0] as u32).wrapping_mul(0x9e37_79b1)
        ^ (cell[1] as u32).wrapping_mul(0x85eb_ca77)
        ^ (cell[2] as u32).wrapping_mul(0xc2b2_ae3d);
    h ^= h >> 15;
    h = h.wrapping_mul(0x2c1b_3c6d);
    h ^ h >> 13
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn everything_within_a_cell_edge_is_gathered(
            points in prop::collection::vec(prop::array::uniform3(-5f32..5.0), 0..200),
            q in prop::array::uniform3(-5f32..5.0),
            cell_m in 0.05f32..3.0,
        ) {
            let points: Vec<Vec3> = points.into_iter().map(Vec3::from).collect();
            let grid = CellGrid::new(&points, cell_m);
            let q = Vec3::from(q);
            let mut found = Vec::new();
            grid.gather(grid.cell_of(q), 1, &mut found);
            let mut unique = found.clone();
            unique.sort_unstable();
            unique.dedup();
            prop_assert_eq!(unique.len(), found.len());
            for (i, p) in points.iter().enumerate() {
                if p.distance(q) < cell_m {
                    prop_assert!(found.contains(&(i as u32)));
                }
            }
        }
    }

    #[test]
    fn extreme_coordinates_do_no_harm() {
        let grid = CellGrid::new(&[Vec3::splat(3e30), Vec3::splat(-3e30), Vec3::ZERO], 1e-3);
        let mut found = Vec::new();
        grid.gather(grid.cell_of(Vec3::splat(3e30)), 1, &mut found);
        assert_eq!(found, [0]);
    }
}
