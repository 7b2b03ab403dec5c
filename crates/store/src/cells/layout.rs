//! Where the grids of all instances lie, and how many buckets they share: fixed while a table lasts.

use super::grid::expected_cells;
use super::{BUCKET_CELLS, GridTooLarge, VirtualGrid};

/// Surface of a kept point in squared spacings: an area of √3/2 · spacing² of surface belongs to each point, as in Poisson disks in
/// a hexagonal packing, whose densest radius defines the spacing.
pub const AREA_OF_A_POINT: f64 = 0.866_025_403_784_438_6;

/// Buckets of an instance with so many points, cells having an edge of `edge_in_spacings` spacings: 4 × expected cells / 8
/// ([Neff2023] sec. 3.2), at least one.
pub fn buckets_for(points: usize, edge_in_spacings: f64) -> u32 {
    expected_cells(points, edge_in_spacings).saturating_mul(4).div_ceil(BUCKET_CELLS as u32)
}

/// One instance's grid, in its local space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceGrid {
    /// Index into the scene's instances.
    pub instance: u32,
    /// Its cells and buckets.
    pub grid: VirtualGrid,
}

/// The shape of a table: what both ends must agree on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TableLayout {
    spacing_m: f32,
    edge_m: f32,
    grids: Vec<InstanceGrid>,
    buckets: u32,
}

/// Why a table was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TableLayoutError {
    /// A length is not a positive finite number.
    #[error("table: {name} is {value}, must be positive and finite")]
    BadLength {
        /// Which.
        name: &'static str,
        /// What it was.
        value: f32,
    },
    /// An instance's box has too many cells.
    #[error("table: instance {instance}: {source}")]
    Grid {
        /// Index into the scene's instances.
        instance: u32,
        /// What is wrong.
        source: GridTooLarge,
    },
    /// A grid breaks a rule.
    #[error("table: instance {instance}: {reason}")]
    BadGrid {
        /// Index into the scene's instances.
        instance: u32,
        /// What is wrong.
        reason: &'static str,
    },
    /// Entries of buckets could not be numbered.
    #[error("table: {0} buckets, at most {limit} can be numbered; lay fewer points", limit = TableLayout::MAX_BUCKETS)]
    TooManyBuckets(u64),
}

impl TableLayout {
    /// Most buckets of a table.
    pub const MAX_BUCKETS: u32 = 1 << 28;

    /// Checks and joins grids; their `count` says how many buckets each gets, `first` is filled in. `spacing_m` is the unit of
    /// the kernels' radii, `edge_m` the edge of a cell.
    ///
    /// # Errors
    /// A length or a grid breaks a rule, or there are too many buckets.
    pub fn new(
        spacing_m: f32,
        edge_m: f32,
        mut grids: Vec<InstanceGrid>,
    ) -> Result<TableLayout, TableLayoutError> {
        for (name, value) in [("spacing_m", spacing_m), ("edge_m", edge_m)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(TableLayoutError::BadLength { name, value });
            }
        }
        let total: u64 = grids.iter().map(|g| u64::from(g.grid.count)).sum();
        if total > u64::from(Self::MAX_BUCKETS) {
            return Err(TableLayoutError::TooManyBuckets(total));
        }
        let (mut first, mut last) = (0, None);
        for InstanceGrid { instance, grid } in &mut grids {
            let bad = |reason| TableLayoutError::BadGrid { instance: *instance, reason };
            if last.is_some_and(|last| last >= *instance) {
                return Err(bad("instances must increase"));
            }
            last = Some(*instance);
            if !grid.origin.is_finite() {
                return Err(bad("the origin is not finite"));
            }
            if grid.count == 0 || grid.dims.contains(&0) {
                return Err(bad("a grid without buckets or cells"));
            }
            let cells: f64 = grid.dims.iter().map(|d| f64::from(*d)).product();
            if cells > f64::from(u32::MAX) {
                let source = GridTooLarge { cells };
                return Err(TableLayoutError::Grid { instance: *instance, source });
            }
            grid.first = first;
            first += grid.count;
        }
        Ok(TableLayout { spacing_m, edge_m, grids, buckets: first })
    }

    /// Spacing r0 of the points, metres.
    pub fn spacing_m(&self) -> f32 {
        self.spacing_m
    }

    /// Edge of a cell, metres.
    pub fn edge_m(&self) -> f32 {
        self.edge_m
    }

    /// All grids, in order of instance.
    pub fn grids(&self) -> &[InstanceGrid] {
        &self.grids
    }

    /// The grid of an instance, if it has points.
    pub fn grid_of(&self, instance: u32) -> Option<&VirtualGrid> {
        let at = self.grids.binary_search_by_key(&instance, |g| g.instance).ok()?;
        Some(&self.grids[at].grid)
    }

    /// Number of buckets.
    pub fn bucket_count(&self) -> u32 {
        self.buckets
    }

    /// Most cells that can exist: the entries of all buckets.
    pub fn max_cells(&self) -> u32 {
        self.buckets * BUCKET_CELLS as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn grid(instance: u32, dims: [u32; 3], count: u32) -> InstanceGrid {
        InstanceGrid { instance, grid: VirtualGrid { origin: Vec3::ZERO, dims, first: 77, count } }
    }

    #[test]
    fn buckets_follow_each_other() {
        let layout = TableLayout::new(0.1, 0.2, vec![grid(3, [2, 2, 2], 5), grid(9, [1, 1, 1], 2)]).unwrap();
        assert_eq!(layout.grid_of(3).unwrap().first, 0);
        assert_eq!(layout.grid_of(9).unwrap().first, 5);
        assert!(layout.grid_of(4).is_none());
        assert_eq!((layout.bucket_count(), layout.max_cells()), (7, 56));
    }

    #[test]
    fn the_table_is_four_times_what_is_expected() {
        // 1000 points, two spacings an edge: 4 / 0.866 = 4.62 points a cell, 217 cells, 868 entries, 109 buckets.
        assert_eq!(buckets_for(1000, 2.0), 109);
        assert_eq!(buckets_for(1, 2.0), 1);
    }

    #[test]
    fn nonsense_is_refused() {
        let bad =
            |spacing, edge, grids: &[InstanceGrid]| TableLayout::new(spacing, edge, grids.to_vec()).is_err();
        let good = grid(0, [1, 1, 1], 1);
        assert!(!bad(0.1, 0.1, &[good]));
        assert!(bad(0.0, 0.1, &[good]) && bad(0.1, f32::NAN, &[good]));
        assert!(bad(0.1, 0.1, &[good, good]), "twice the same instance");
        assert!(bad(0.1, 0.1, &[grid(0, [1, 1, 1], 0)]) && bad(0.1, 0.1, &[grid(0, [1, 0, 1], 1)]));
        assert!(bad(0.1, 0.1, &[grid(0, [70_000, 70_000, 1], 1)]));
        assert!(bad(0.1, 0.1, &[grid(0, [1; 3], u32::MAX), grid(1, [1; 3], u32::MAX)]));
        let far = VirtualGrid { origin: Vec3::splat(f32::NAN), ..good.grid };
        assert!(bad(0.1, 0.1, &[InstanceGrid { instance: 0, grid: far }]));
    }
}
