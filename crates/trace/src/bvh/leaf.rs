//! Triangles in leaf order, laid out so that eight of them load with nine instructions.

use std::ops::Range;

use dapple_scene::Aabb;
use dapple_scene::glam::Vec3;
use fearless_simd::{Simd, SimdBase, f32x8};

use super::triangle::FARTHEST;

/// Lanes of a block of triangles.
pub(crate) const LANES: usize = 8;
/// Rows of a block: x, y, z of corner 0, of corner 1, of corner 2.
const ROWS: usize = 9;

/// Corners relative to each other and to the origin of a query are computed from these rows.
pub(crate) type Rows<S> = [f32x8<S>; ROWS];

/// The triangles of a tree: each leaf is a block of nine rows as long as the leaf, without padding between them.
///
/// 40 bytes a triangle. A triangle that is not there (bad index, number not finite) has NaN corners.
#[derive(Clone, Default)]
pub(crate) struct Triangles {
    /// A leaf of `n` triangles from triangle `first` fills `9 first .. 9 (first + n)`; some numbers more at the end, so
    /// that the last rows can be loaded whole.
    rows: Vec<f32>,
    /// Index into the mesh's triangles.
    ids: Vec<u32>,
}

/// A triangle's corners; NaN if one has no position within [`FARTHEST`].
#[inline]
pub(crate) fn corners(positions: &[Vec3], indices: [u32; 3]) -> [[f32; 3]; 3] {
    const NOWHERE: [[f32; 3]; 3] = [[f32::NAN; 3]; 3];
    let [a, b, c] = indices.map(|i| positions.get(i as usize));
    let (Some(a), Some(b), Some(c)) = (a, b, c) else { return NOWHERE };
    let corners = [a.to_array(), b.to_array(), c.to_array()];
    let near = corners.as_flattened().iter().fold(true, |near, x| near & (x.abs() <= FARTHEST));
    if near { corners } else { NOWHERE }
}

impl Triangles {
    /// Room for as many triangles as there are `ids`; the corners are still to be set.
    pub(crate) fn new(ids: Vec<u32>) -> Triangles {
        Triangles { rows: vec![f32::NAN; ids.len() * ROWS + LANES], ids }
    }

    pub(crate) fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.rows.capacity() * size_of::<f32>() + self.ids.capacity() * size_of::<u32>()
    }

    /// Sets all corners of the leaf `range` from the mesh's `triangles`; returns the box around them.
    ///
    /// Runs for every leaf of every deformed mesh each frame, hence without branches for each number.
    pub(crate) fn set_leaf(
        &mut self,
        range: Range<usize>,
        positions: &[Vec3],
        triangles: &[[u32; 3]],
    ) -> Aabb {
        let n = range.len();
        let block = &mut self.rows[range.start * ROWS..range.end * ROWS];
        let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for (lane, &id) in self.ids[range].iter().enumerate() {
            let corners = corners(positions, triangles[id as usize]);
            for (corner, position) in corners.iter().enumerate() {
                for (axis, &x) in position.iter().enumerate() {
                    block[(3 * corner + axis) * n + lane] = x;
                    // Of no effect where x is none.
                    min[axis] = if x < min[axis] { x } else { min[axis] };
                    max[axis] = if x > max[axis] { x } else { max[axis] };
                }
            }
        }
        Aabb { min: min.into(), max: max.into() }
    }

    /// Corners of the triangle in a lane of the leaf `range`.
    pub(crate) fn corners(&self, range: &Range<usize>, lane: usize) -> [[f32; 3]; 3] {
        let n = range.len();
        let block = &self.rows[range.start * ROWS..];
        [0, 1, 2].map(|corner| [0, 1, 2].map(|axis| block[(3 * corner + axis) * n + lane]))
    }

    /// The rows of the leaf `range` of at most [`LANES`] triangles. Lanes beyond it hold numbers of no meaning.
    #[inline(always)]
    pub(crate) fn load<S: Simd>(&self, simd: S, range: &Range<usize>) -> Rows<S> {
        let n = range.len();
        let block = &self.rows[range.start * ROWS..range.start * ROWS + 8 * n + LANES];
        let mut rows = [f32x8::splat(simd, 0.0); ROWS];
        for (row, out) in rows.iter_mut().enumerate() {
            *out = f32x8::from_slice(simd, &block[row * n..row * n + LANES]);
        }
        rows
    }
}
