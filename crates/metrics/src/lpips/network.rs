//! The network's layers in their order, run on a pair of pictures; what comes out are the maps of the seven taps.

use rayon::prelude::*;

use super::conv::{Conv, Fire, Map, pool, pooled_row, pooled_side};
use super::weights::{Weights, WeightsError};

/// Least width and height in pixels: with fewer the last pooling has nothing to take.
pub(super) const MIN_SIDE: u32 = 17;

/// Added to the length of a pixel's features before they are divided by it.
const LENGTH_BIAS: f64 = 1e-10;

/// Rows of the first pooling that one task makes.
const BAND_ROWS: usize = 8;

/// Fire modules: number in the file, channels in, squeezed, and of each of the two expansions.
pub(super) const FIRES: [(usize, usize, usize, usize); 8] = [
    (3, 64, 16, 64),
    (4, 128, 16, 64),
    (6, 128, 32, 128),
    (7, 256, 32, 128),
    (9, 256, 48, 192),
    (10, 384, 48, 192),
    (11, 384, 64, 256),
    (12, 512, 64, 256),
];

/// Whether a pooling comes before the fire module, and whether a tap follows it.
const AROUND: [(bool, bool); 8] = [
    (false, false),
    (false, true),
    (true, false),
    (false, true),
    (true, true),
    (false, true),
    (false, true),
    (false, true),
];

/// Channels at the taps.
pub(super) const TAPS: [usize; 7] = [64, 128, 256, 384, 384, 512, 512];

/// A picture: writes one row of its interleaved R, G, B in −1 … 1.
pub(super) type Rows<'a> = dyn Fn(usize, &mut [f32]) + Sync + 'a;

/// What differs at one tap: a number for each of its pixels, rows from the top.
pub(super) struct TapMap {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) values: Vec<f32>,
}

impl TapMap {
    /// Mean over the pixels, summed in order.
    pub(super) fn mean(&self) -> f64 {
        self.values.iter().map(|v| f64::from(*v)).sum::<f64>() / self.values.len() as f64
    }
}

/// SqueezeNet 1.1 without its classifier, and the weights of what it finds.
pub(super) struct Network {
    shift: [f32; 3],
    scale: [f32; 3],
    first: Conv,
    fires: Vec<Fire>,
    /// Weight of each channel, for each tap.
    taps: Vec<Vec<f32>>,
}

impl Network {
    /// Takes the tensors it needs out of `weights`.
    pub(super) fn new(weights: &Weights<'_>) -> Result<Network, WeightsError> {
        let conv = |name: &str, inputs: usize, outputs: usize, side: usize| {
            let bias = weights.tensor(&format!("{name}.bias"), &[outputs])?;
            let window = weights.tensor(&format!("{name}.weight"), &[outputs, inputs, side, side])?;
            Ok(Conv::new(inputs, outputs, side, &window, &bias))
        };
        let fires = FIRES.iter().map(|&(number, inputs, squeezed, expanded)| {
            Ok(Fire {
                squeeze: conv(&format!("features.{number}.squeeze"), inputs, squeezed, 1)?,
                expand1: conv(&format!("features.{number}.expand1x1"), squeezed, expanded, 1)?,
                expand3: conv(&format!("features.{number}.expand3x3"), squeezed, expanded, 3)?,
            })
        });
        let taps = TAPS.iter().enumerate().map(|(tap, &channels)| {
            weights.tensor_within(
                &format!("lin{tap}.model.1.weight"),
                &[1, channels, 1, 1],
                "at least 0",
                |w| w >= 0.0,
            )
        });
        let three = |values: Vec<f32>| [values[0], values[1], values[2]];
        Ok(Network {
            shift: three(weights.tensor("scaling_layer.shift", &[1, 3, 1, 1])?),
            scale: three(weights.tensor_within(
                "scaling_layer.scale",
                &[1, 3, 1, 1],
                "above 0",
                |scale| scale > 0.0,
            )?),
            first: conv("features.0", 3, 64, 3)?,
            fires: fires.collect::<Result<_, _>>()?,
            taps: taps.collect::<Result<_, _>>()?,
        })
    }

    /// Maps of the seven taps for a pair of pictures.
    pub(super) fn taps(&self, width: usize, height: usize, pictures: [&Rows<'_>; 2]) -> Vec<TapMap> {
        let (first_tap, mut maps) = self.begin(width, height, pictures);
        let mut taps = vec![first_tap];
        for (fire, (pooled, tapped)) in self.fires.iter().zip(AROUND) {
            maps = maps.map(|map| if pooled { fire.run(&pool(&map)) } else { fire.run(&map) });
            if tapped {
                taps.push(tap(&maps, &self.taps[taps.len()]));
            }
        }
        taps
    }

    /// The first convolution, its tap and the pooling after it. Nothing later is as large as the output of that
    /// convolution, so it exists in bands of rows only.
    fn begin(&self, width: usize, height: usize, pictures: [&Rows<'_>; 2]) -> (TapMap, [Map; 2]) {
        let channels = self.first.outputs;
        let (width1, height1) = ((width - 3) / 2 + 1, (height - 3) / 2 + 1);
        let (width2, height2) = (pooled_side(width1), pooled_side(height1));
        let bands: Vec<(Vec<f32>, [Vec<f32>; 2])> = (0..height2.div_ceil(BAND_ROWS))
            .into_par_iter()
            .map(|band| {
                let pooled = band * BAND_ROWS..((band + 1) * BAND_ROWS).min(height2);
                let first_row = 2 * pooled.start;
                // The last row of a band's last window is the next band's; what is left over, the last band's.
                let end_row = (2 * pooled.end + 1).min(height1);
                let own_rows = if pooled.end == height2 { end_row } else { 2 * pooled.end } - first_row;
                let features =
                    pictures.map(|picture| self.features(width, width1, first_row..end_row, picture));
                let row = |y: usize| y * width1 * channels..(y + 1) * width1 * channels;
                let mut differences = vec![0.0; own_rows * width1];
                for (y, out) in differences.chunks_exact_mut(width1).enumerate() {
                    let rows = [0, 1].map(|i: usize| &features[i][row(y)]);
                    tap_row(rows, &self.taps[0], out);
                }
                let pools = features.map(|features| {
                    let mut out = vec![0.0; pooled.len() * width2 * channels];
                    for (y, out) in out.chunks_exact_mut(width2 * channels).enumerate() {
                        let rows: Vec<&[f32]> = (2 * y..(2 * y + 3).min(end_row - first_row))
                            .map(|y| &features[row(y)])
                            .collect();
                        pooled_row(&rows, channels, out);
                    }
                    out
                });
                (differences, pools)
            })
            .collect();

        let mut values = Vec::with_capacity(width1 * height1);
        let mut maps = [0, 1].map(|_| Map::new(width2, height2, channels, 0));
        let (differences, pools): (Vec<_>, Vec<_>) = bands.into_iter().unzip();
        differences.iter().for_each(|band| values.extend_from_slice(band));
        for (i, map) in maps.iter_mut().enumerate() {
            map.write_rows(|y, row| {
                let start = y % BAND_ROWS * row.len();
                row.copy_from_slice(&pools[y / BAND_ROWS][i][start..start + row.len()]);
            });
        }
        (TapMap { width: width1, height: height1, values }, maps)
    }

    /// Some rows of the first convolution.
    fn features(
        &self,
        width: usize,
        width1: usize,
        rows: std::ops::Range<usize>,
        picture: &Rows<'_>,
    ) -> Vec<f32> {
        let channels = self.first.outputs;
        let first_row = 2 * rows.start;
        let mut scaled = vec![0.0; (2 * rows.len() + 1) * width * 3];
        for (y, row) in scaled.chunks_exact_mut(width * 3).enumerate() {
            picture(first_row + y, row);
            for pixel in row.as_chunks_mut::<3>().0 {
                *pixel = std::array::from_fn(|c| (pixel[c] - self.shift[c]) / self.scale[c]);
            }
        }
        let mut out = vec![0.0; rows.len() * width1 * channels];
        for (y, out) in out.chunks_exact_mut(width1 * channels).enumerate() {
            let window = [0, 1, 2].map(|i| &scaled[(2 * y + i) * width * 3..][..width * 3]);
            self.first.rectified_row(&window, 2, out, channels, 0);
        }
        out
    }
}

/// What differs between two maps.
fn tap(maps: &[Map; 2], weights: &[f32]) -> TapMap {
    let (width, height) = (maps[0].width, maps[0].height);
    let mut values = vec![0.0; width * height];
    values
        .par_chunks_mut(width)
        .enumerate()
        .for_each(|(y, out)| tap_row([maps[0].row(y), maps[1].row(y)], weights, out));
    TapMap { width, height, values }
}

/// For each pixel Σ w (a / (‖a‖ + ε) − b / (‖b‖ + ε))² over the channels.
fn tap_row(rows: [&[f32]; 2], weights: &[f32], out: &mut [f32]) {
    let length = |pixel: &[f32]| {
        let squares: f64 = pixel.iter().map(|v| f64::from(*v) * f64::from(*v)).sum();
        squares.sqrt() + LENGTH_BIAS
    };
    let pixels = rows[0].chunks_exact(weights.len()).zip(rows[1].chunks_exact(weights.len()));
    for (out, (a, b)) in out.iter_mut().zip(pixels) {
        let [scale_a, scale_b] = [a, b].map(|pixel| 1.0 / length(pixel));
        let mut sum = 0.0f64;
        for ((a, b), weight) in a.iter().zip(b).zip(weights) {
            let difference = f64::from(*a) * scale_a - f64::from(*b) * scale_b;
            sum += f64::from(*weight) * (difference * difference);
        }
        *out = sum as f32;
    }
}
