//! The virtual grid of one instance ([Neff2023] sec. 3.2): every cell has a number, few exist.

use glam::Vec3;

use super::AREA_OF_A_POINT;

/// Cells in a box, and where their buckets lie.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VirtualGrid {
    /// Least corner of the box, metres, in the space that the grid is in.
    pub origin: Vec3,
    /// Cells along each axis, D of [Neff2023] eq. 1; their product is at most `u32::MAX`.
    pub dims: [u32; 3],
    /// The instance's first bucket (or slot of another table), and how many it has.
    pub first: u32,
    /// See `first`. 0: the instance has no points.
    pub count: u32,
}

/// The cells of a box cannot be numbered in 32 bits.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "a grid of {cells:.0} cells, at most {} can be numbered; use larger cells or a smaller box",
    u32::MAX
)]
pub struct GridTooLarge {
    /// How many cells the box holds.
    pub cells: f64,
}

impl VirtualGrid {
    /// A grid from `origin` up to a place that lies `most_cells` ≥ 0 cells from it along each axis; without buckets yet.
    ///
    /// # Errors
    /// Its cells cannot be numbered.
    pub fn spanning(origin: Vec3, most_cells: Vec3) -> Result<VirtualGrid, GridTooLarge> {
        let dims = most_cells.to_array().map(|c| f64::from(c.floor()) + 1.0);
        let cells: f64 = dims.iter().product();
        if cells.is_nan() || cells > f64::from(u32::MAX) {
            return Err(GridTooLarge { cells });
        }
        Ok(VirtualGrid { origin, dims: dims.map(|c| c as u32), first: 0, count: 0 })
    }

    /// A position in units of cells of `edge_m` metres from the grid's corner.
    pub fn position_cells(&self, position: Vec3, edge_m: f32) -> Vec3 {
        (position - self.origin) / edge_m
    }

    /// The cell that a position in cells falls into, held inside the grid.
    pub fn cell(&self, position_cells: Vec3) -> [u32; 3] {
        let cell = position_cells.to_array().map(|c| c.floor() as u32);
        std::array::from_fn(|axis| cell[axis].min(self.dims[axis].saturating_sub(1)))
    }

    /// Whether a position in cells lies in the grid's box.
    pub fn contains(&self, position_cells: Vec3) -> bool {
        let dims = Vec3::from_array(self.dims.map(|d| d as f32));
        position_cells.cmpge(Vec3::ZERO).all() && position_cells.cmple(dims).all()
    }

    /// Number of a cell; unique within the grid.
    pub fn key(&self, cell: [u32; 3]) -> u32 {
        (cell[2].wrapping_mul(self.dims[1]).wrapping_add(cell[1]))
            .wrapping_mul(self.dims[0])
            .wrapping_add(cell[0])
    }

    /// [Neff2023] eq. 1, H(p) = p_x + p_y · D_x · 17 + p_z · D_x · D_y · 31, taken modulo the grid's buckets, of which there
    /// must be one.
    pub fn bucket(&self, cell: [u32; 3]) -> u32 {
        let [dx, dy, _] = self.dims;
        let h = cell[0]
            .wrapping_add(cell[1].wrapping_mul(dx).wrapping_mul(17))
            .wrapping_add(cell[2].wrapping_mul(dx).wrapping_mul(dy).wrapping_mul(31));
        self.first.wrapping_add(h % self.count)
    }

    /// The 2×2×2 cells nearest to a position in cells ([Neff2023] sec. 3.5), those outside the grid left out.
    pub fn nearest_cells(&self, position_cells: Vec3) -> impl Iterator<Item = [u32; 3]> + use<> {
        let base = (position_cells - 0.5).floor().to_array().map(|c| i64::from(c as i32));
        self.cells_from(base, 2)
    }

    /// The cell of a position in cells and those up to `reach` ≥ 0 cells from it along each axis, those outside the grid left
    /// out.
    pub fn cells_around(&self, position_cells: Vec3, reach: u32) -> impl Iterator<Item = [u32; 3]> + use<> {
        let base = position_cells.floor().to_array().map(|c| i64::from(c as i32) - i64::from(reach));
        self.cells_from(base, 2 * i64::from(reach) + 1)
    }

    /// A cube of cells, x fastest.
    fn cells_from(&self, base: [i64; 3], side: i64) -> impl Iterator<Item = [u32; 3]> + use<> {
        let range = |axis: usize| {
            let first = base[axis].max(0);
            let end = (base[axis] + side).min(i64::from(self.dims[axis]));
            first..end.max(first)
        };
        let (x, y, z) = (range(0), range(1), range(2));
        z.flat_map(move |z| {
            let x = x.clone();
            y.clone().flat_map(move |y| x.clone().map(move |x| [x as u32, y as u32, z as u32]))
        })
    }
}

/// Cells that so many points of a surface fill with one layer, at least one.
pub(super) fn expected_cells(points: usize, edge_in_spacings: f64) -> u32 {
    let points_a_cell = edge_in_spacings * edge_in_spacings / AREA_OF_A_POINT;
    (points as f64 / points_a_cell).ceil().max(1.0) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_hash_is_equation_1() {
        let grid = VirtualGrid { origin: Vec3::ZERO, dims: [10, 20, 30], first: 1000, count: 97 };
        // 3 + 5·10·17 + 7·10·20·31 = 3 + 850 + 43400 = 44253 = 456·97 + 21.
        assert_eq!(grid.bucket([3, 5, 7]), 1000 + 21);
        assert_eq!(grid.bucket([0, 0, 0]), 1000);
        // 9 + 19·170 + 29·6200 = 183039 = 1887·97 + 0.
        assert_eq!(grid.bucket([9, 19, 29]), 1000);
        assert_eq!(grid.key([3, 5, 7]), 3 + 10 * (5 + 20 * 7));
    }

    #[test]
    fn a_grid_that_cannot_be_numbered_is_refused() {
        assert!(VirtualGrid::spanning(Vec3::ZERO, Vec3::splat(1600.0)).is_ok());
        for most in [Vec3::splat(1700.0), Vec3::splat(f32::INFINITY), Vec3::splat(f32::NAN)] {
            assert!(VirtualGrid::spanning(Vec3::ZERO, most).is_err(), "{most}");
        }
    }

    proptest! {
        #[test]
        fn the_nearest_cells_hold_everything_within_half_an_edge(
            p in prop::array::uniform3(-1f32..6.0), d in prop::array::uniform3(-0.5f32..0.5),
        ) {
            let grid = VirtualGrid { dims: [5, 4, 6], ..VirtualGrid::default() };
            let (p, d) = (Vec3::from(p), Vec3::from(d));
            prop_assume!(d.length() < 0.499);
            let q = p + d;
            let inside = grid.contains(q) && (0..3).all(|a| q[a] < grid.dims[a] as f32);
            let nearest: Vec<_> = grid.nearest_cells(p).collect();
            prop_assert!(nearest.len() <= 8);
            if inside {
                prop_assert!(nearest.contains(&grid.cell(q)));
                prop_assert!(grid.cells_around(p, 1).any(|c| c == grid.cell(q)));
            }
            prop_assert!(nearest.iter().all(|c| (0..3).all(|a| c[a] < grid.dims[a])));
        }
    }

    #[test]
    fn far_places_have_no_cells() {
        let grid = VirtualGrid { dims: [5, 4, 6], ..VirtualGrid::default() };
        for far in [Vec3::splat(1e30), Vec3::splat(-1e30), Vec3::new(0.0, 9.0, 0.0)] {
            assert_eq!(grid.nearest_cells(far).count() + grid.cells_around(far, 2).count(), 0, "{far}");
        }
        assert_eq!(grid.cells_around(Vec3::splat(2.5), 1).count(), 27);
    }
}
