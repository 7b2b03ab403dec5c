//! Distances at ever coarser resolution, so that places far from a sample are read from few lines of memory (sec. 2.2, Table 1).

use rayon::prelude::*;

use crate::gbuffer::Screen;

/// How four distances become one (\[McGuire2012\] Table 1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MipFilter {
    /// One of them, another in each row and column: values that are in the picture, without bias.
    #[default]
    RotatedGrid,
    /// Their mean: keeps area on the screen.
    Mean,
    /// Their harmonic mean: keeps area in the world.
    HarmonicMean,
    /// The farthest: the paper's *min* of z, never more occlusion than there is.
    Farthest,
    /// The nearest: the paper's *max* of z, never less.
    Nearest,
}

impl MipFilter {
    /// All of them, in the order of the paper's table.
    pub const ALL: [MipFilter; 5] = [
        MipFilter::RotatedGrid,
        MipFilter::Mean,
        MipFilter::HarmonicMean,
        MipFilter::Farthest,
        MipFilter::Nearest,
    ];
}

/// Distances of a picture and its coarser levels: sample (x, y) lies in texel (x ≫ m, y ≫ m) of level m.
#[derive(Clone, Debug, PartialEq)]
pub struct Pyramid {
    filter: MipFilter,
    levels: Vec<Level>,
}

#[derive(Clone, Debug, PartialEq)]
struct Level {
    columns: usize,
    rows: usize,
    distances_m: Vec<f32>,
}

impl Pyramid {
    /// Of a picture, with at most so many levels above the first: fewer where one has a single texel.
    pub fn new(screen: &Screen, filter: MipFilter, levels: u32) -> Pyramid {
        let first = Level {
            columns: screen.columns() as usize,
            rows: screen.rows() as usize,
            distances_m: screen.distances_m().to_vec(),
        };
        let mut all = vec![first];
        for _ in 0..levels {
            let last = &all[all.len() - 1];
            if last.columns.max(last.rows) <= 1 {
                break;
            }
            all.push(last.coarser(filter));
        }
        Pyramid { filter, levels: all }
    }

    /// How many levels there are, the first included.
    pub fn levels(&self) -> usize {
        self.levels.len()
    }

    /// The distance at the texel of a level that a sample of the picture lies in, metres, and the point of the picture that it stands for, as of
    /// [`Screen::place_view`]: with the rotated grid the centre of the sample that it is of, else that of the texel's samples. The sample must be in the picture.
    pub(super) fn read(&self, screen: &Screen, level: usize, [column, row]: [usize; 2]) -> (f32, [f32; 2]) {
        let Level { columns, rows, distances_m } = &self.levels[level];
        let texel = [column >> level, row >> level];
        debug_assert!(texel[0] < *columns && texel[1] < *rows);
        let distance = distances_m[texel[1] * columns + texel[0]];
        let stands_for = match self.filter {
            MipFilter::RotatedGrid => screen.centre(self.source(level, texel)),
            _ if level == 0 => screen.centre(texel),
            _ => {
                let first = &self.levels[0];
                let centre = |texel: usize, count: usize| {
                    let (low, high) = (texel << level, ((texel + 1) << level).min(count));
                    0.5 * (low + high) as f32
                };
                [centre(texel[0], first.columns), centre(texel[1], first.rows)]
            }
        };
        (distance, stands_for)
    }

    /// The sample of the picture whose distance a texel of the rotated grid has.
    fn source(&self, level: usize, texel: [usize; 2]) -> [usize; 2] {
        (0..level).rev().fold(texel, |texel, below| self.levels[below].chosen(texel))
    }
}

impl Level {
    /// The one of four texels that the rotated grid takes for a texel of the level above: (2x + (y & 1 ^ 1), 2y + (x & 1 ^ 1)).
    fn chosen(&self, [x, y]: [usize; 2]) -> [usize; 2] {
        let column = 2 * x + (y & 1 ^ 1);
        let row = 2 * y + (x & 1 ^ 1);
        [column.min(self.columns - 1), row.min(self.rows - 1)]
    }

    fn coarser(&self, filter: MipFilter) -> Level {
        let (columns, rows) = (self.columns.div_ceil(2), self.rows.div_ceil(2));
        let at = |x: usize, y: usize| {
            self.distances_m[y.min(self.rows - 1) * self.columns + x.min(self.columns - 1)]
        };
        let mut distances_m = vec![0.0; columns * rows];
        distances_m.par_chunks_mut(columns).enumerate().for_each(|(y, values)| {
            for (x, value) in values.iter_mut().enumerate() {
                let four = || {
                    [at(2 * x, 2 * y), at(2 * x + 1, 2 * y), at(2 * x, 2 * y + 1), at(2 * x + 1, 2 * y + 1)]
                };
                *value = match filter {
                    MipFilter::RotatedGrid => {
                        let [column, row] = self.chosen([x, y]);
                        at(column, row)
                    }
                    MipFilter::Mean => 0.25 * four().iter().sum::<f32>(),
                    MipFilter::HarmonicMean => 4.0 / four().iter().map(|d| 1.0 / d).sum::<f32>(),
                    MipFilter::Farthest => four().into_iter().fold(f32::NEG_INFINITY, f32::max),
                    MipFilter::Nearest => four().into_iter().fold(f32::INFINITY, f32::min),
                };
            }
        });
        Level { columns, rows, distances_m }
    }
}
