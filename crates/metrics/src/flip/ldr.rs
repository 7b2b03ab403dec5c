//! The comparison of two pictures in linear light, 0 … 1: filters, colour, features, one error a pixel.
//!
//! Bands of rows are evaluated in parallel, each with as many rows beyond its own as the filters reach. Sums are in
//! one order, so what comes out does not depend on the bands.

use rayon::prelude::*;

use super::color::{Space, distance};
use super::filters::{Filters, Kernel};

/// Least rows of a band.
const BAND_ROWS: usize = 64;

/// Compression of colour distances, and the share of the largest one that is spread over the share of errors
/// ([Andersson2020] sec. 5.1). Feature differences are compressed by a square root (sec. 5.2).
const COLOR_POWER: f32 = 0.7;
const KNEE_DISTANCE: f32 = 0.4;
const KNEE_ERROR: f32 = 0.95;

/// A picture: writes one row of its interleaved linear R, G, B, 0 … 1.
pub(super) type Rows<'a> = dyn Fn(usize, &mut [[f32; 3]]) + Sync + 'a;

/// What all pictures under one viewing condition have in common.
pub(super) struct Flipper {
    filters: Filters,
    space: Space,
    /// Largest colour distance, compressed.
    largest: f32,
    /// Logarithms of the knee, as a compressed distance, and of the slope of errors below it.
    knee_log2: f32,
    slope_log2: f32,
    band_rows: usize,
}

/// Rows of one picture, filtered along x.
struct Band {
    /// Rows that the first one has above it in the picture.
    first: usize,
    /// Width, and height of the picture, in pixels.
    width: usize,
    height: usize,
    /// By the filters for: lightness, red–green, blue–yellow twice; smooth, edge and point of luminance.
    planes: [Vec<f32>; 7],
}

/// One row, filtered in full.
struct Filtered {
    colors: [Vec<f32>; 3],
    /// Edges and points along x, then along y.
    edges: [Vec<f32>; 2],
    points: [Vec<f32>; 2],
}

impl Flipper {
    pub(super) fn new(pixels_per_degree: f32) -> Flipper {
        let (filters, space) = (Filters::new(pixels_per_degree), Space::srgb());
        let largest = libm::powf(space.largest_distance(), COLOR_POWER);
        // What lies beyond a band is filtered along x by its neighbours as well.
        let band_rows = BAND_ROWS.max(2 * filters.reach());
        let knee = KNEE_DISTANCE * largest;
        let (knee_log2, slope_log2) = (libm::log2f(knee), libm::log2f(KNEE_ERROR / knee));
        Flipper { filters, space, largest, knee_log2, slope_log2, band_rows }
    }

    #[cfg(test)]
    pub(super) fn with_band_rows(self, band_rows: usize) -> Flipper {
        Flipper { band_rows, ..self }
    }

    /// The error of every pixel, 0 … 1. Width and height are at least 1.
    pub(super) fn error_map(&self, width: usize, height: usize, pictures: [&Rows<'_>; 2]) -> Vec<f32> {
        let mut errors = vec![0.0; width * height];
        errors.par_chunks_mut(self.band_rows * width).enumerate().for_each(|(band, errors)| {
            let first = band * self.band_rows;
            let end = first + errors.len() / width;
            let reach = self.filters.reach();
            let rows = first.saturating_sub(reach)..(end + reach).min(height);
            let bands = pictures.map(|picture| self.filter_rows(width, height, rows.clone(), picture));
            for (y, errors) in (first..end).zip(errors.chunks_exact_mut(width)) {
                let [reference, test] = [0, 1].map(|i: usize| self.filter_columns(&bands[i], y));
                for (x, error) in errors.iter_mut().enumerate() {
                    *error = self.error(&reference, &test, x);
                }
            }
        });
        errors
    }

    /// Filters some rows along x; outside of the picture its outermost pixels go on.
    fn filter_rows(
        &self,
        width: usize,
        height: usize,
        rows: std::ops::Range<usize>,
        picture: &Rows<'_>,
    ) -> Band {
        let f = &self.filters;
        let reach = f.reach();
        let mut planes = [(); 7].map(|()| vec![0.0; rows.len() * width]);
        let mut rgb = vec![[0.0; 3]; width];
        let mut opponents = [(); 3].map(|()| vec![0.0; width + 2 * reach]);
        for (i, y) in rows.clone().enumerate() {
            picture(y, &mut rgb);
            for (x, rgb) in rgb.iter().enumerate() {
                let values = self.space.opponents(*rgb);
                opponents.iter_mut().zip(values).for_each(|(plane, value)| plane[reach + x] = value);
            }
            for plane in &mut opponents {
                let (left, right) = (plane[reach], plane[reach + width - 1]);
                plane[..reach].fill(left);
                plane[reach + width..].fill(right);
            }
            let kernels = [
                (&f.achromatic, 0),
                (&f.red_green, 1),
                (&f.blue_yellow[0], 2),
                (&f.blue_yellow[1], 2),
                (&f.smooth, 0),
                (&f.edge, 0),
                (&f.point, 0),
            ];
            for (plane, (kernel, opponent)) in planes.iter_mut().zip(kernels) {
                let first = reach - kernel.radius();
                let shifted = |tap| &opponents[opponent][first + tap..first + tap + width];
                let sources: Vec<&[f32]> = (0..=2 * kernel.radius()).map(shifted).collect();
                kernel.add(&mut plane[i * width..(i + 1) * width], &sources);
            }
        }
        Band { first: rows.start, width, height, planes }
    }

    /// Filters one row along y; outside of the picture its outermost rows go on.
    fn filter_columns(&self, band: &Band, y: usize) -> Filtered {
        let f = &self.filters;
        let add = |sums: &mut [f32], plane: usize, kernel: &Kernel| {
            let row = |tap: usize| {
                let row = (y + tap).saturating_sub(kernel.radius()).min(band.height - 1) - band.first;
                &band.planes[plane][row * band.width..(row + 1) * band.width]
            };
            let sources: Vec<&[f32]> = (0..=2 * kernel.radius()).map(row).collect();
            kernel.add(sums, &sources);
        };
        let filtered = |plane: usize, kernel: &Kernel| {
            let mut sums = vec![0.0; band.width];
            add(&mut sums, plane, kernel);
            sums
        };
        let mut blue_yellow = filtered(2, &f.blue_yellow_shares[0]);
        add(&mut blue_yellow, 3, &f.blue_yellow_shares[1]);
        Filtered {
            colors: [filtered(0, &f.achromatic), filtered(1, &f.red_green), blue_yellow],
            edges: [filtered(5, &f.smooth), filtered(4, &f.edge)],
            points: [filtered(6, &f.smooth), filtered(4, &f.point)],
        }
    }

    /// Colour differs, and the more where edges and points do: ΔE_c^(1 − ΔE_f).
    fn error(&self, reference: &Filtered, test: &Filtered, x: usize) -> f32 {
        let [reference_color, test_color] =
            [reference, test].map(|f| self.space.seen(std::array::from_fn(|c| f.colors[c][x])));
        let distance = distance(reference_color, test_color);
        if distance == 0.0 {
            return 0.0;
        }
        // Powers by logarithms: most colours lie below the knee and need but one.
        let compressed_log2 = COLOR_POWER * libm::log2f(distance);
        let knee = KNEE_DISTANCE * self.largest;
        let color_log2 = if compressed_log2 < self.knee_log2 {
            compressed_log2 + self.slope_log2
        } else {
            let above = (libm::exp2f(compressed_log2) - knee) / (self.largest - knee);
            libm::log2f(KNEE_ERROR + above * (1.0 - KNEE_ERROR)).min(0.0)
        };

        let strength = |along: &[Vec<f32>; 2]| {
            let [u, v] = [along[0][x], along[1][x]];
            (u * u + v * v).sqrt()
        };
        let edges = (strength(&reference.edges) - strength(&test.edges)).abs();
        let points = (strength(&reference.points) - strength(&test.points)).abs();
        let features = (std::f32::consts::FRAC_1_SQRT_2 * edges.max(points)).sqrt().min(1.0);
        libm::exp2f(color_log2 * (1.0 - features))
    }
}
