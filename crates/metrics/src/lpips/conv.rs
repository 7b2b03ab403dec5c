//! Maps of many channels, and the three things that the network does to them: convolve, rectify, pool.
//!
//! Channels are interleaved, so the window of a convolution is one run of numbers a row. An output is a sum over
//! window rows from the top, in them over pixels from the left, in them over channels: one order, whatever the
//! vectors of the processor and the number of threads, because lanes and tasks are outputs, never parts of a sum.

use rayon::prelude::*;

/// Outputs that are summed side by side: channels in a block of weights, pixels in a group.
const LANES: usize = 8;
const GROUP: usize = 4;

/// Numbers on a grid of pixels, channels interleaved, rows from the top, with a frame of zeros around them.
pub(super) struct Map {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) channels: usize,
    /// Pixels of the frame on each side.
    frame: usize,
    values: Vec<f32>,
}

impl Map {
    /// All zero.
    pub(super) fn new(width: usize, height: usize, channels: usize, frame: usize) -> Map {
        let values = vec![0.0; (width + 2 * frame) * (height + 2 * frame) * channels];
        Map { width, height, channels, frame, values }
    }

    /// Numbers from the start of a row to that of the next.
    fn pitch(&self) -> usize {
        (self.width + 2 * self.frame) * self.channels
    }

    /// A row, without its frame.
    pub(super) fn row(&self, y: usize) -> &[f32] {
        let start = (y + self.frame) * self.pitch() + self.frame * self.channels;
        &self.values[start..start + self.width * self.channels]
    }

    /// The row `y - frame`, with its frame.
    fn framed_row(&self, y: usize) -> &[f32] {
        &self.values[y * self.pitch()..(y + 1) * self.pitch()]
    }

    /// Calls `write` with every row's number and the row, without its frame, in parallel.
    pub(super) fn write_rows(&mut self, write: impl Fn(usize, &mut [f32]) + Sync) {
        let (pitch, side, length) = (self.pitch(), self.frame * self.channels, self.width * self.channels);
        self.values
            .par_chunks_mut(pitch)
            .skip(self.frame)
            .take(self.height)
            .enumerate()
            .for_each(|(y, row)| write(y, &mut row[side..side + length]));
    }
}

/// A square window of weights, and a bias for each output.
pub(super) struct Conv {
    pub(super) inputs: usize,
    pub(super) outputs: usize,
    /// Pixels along the window's side.
    pub(super) side: usize,
    /// For each block of [`LANES`] outputs, each row of the window, each pixel in it and each input: a weight for
    /// each output of the block.
    weights: Vec<[f32; LANES]>,
    bias: Vec<[f32; LANES]>,
}

impl Conv {
    /// From weights in the order outputs, inputs, rows, columns. `outputs` is a multiple of 8.
    pub(super) fn new(inputs: usize, outputs: usize, side: usize, weights: &[f32], bias: &[f32]) -> Conv {
        let (blocks, rest) = bias.as_chunks::<LANES>();
        assert!(rest.is_empty() && bias.len() == outputs && weights.len() == outputs * inputs * side * side);
        let mut packed = Vec::with_capacity(weights.len() / LANES);
        for block in 0..outputs / LANES {
            for window in 0..side * side {
                for input in 0..inputs {
                    packed.push(std::array::from_fn(|lane| {
                        weights[((block * LANES + lane) * inputs + input) * side * side + window]
                    }));
                }
            }
        }
        Conv { inputs, outputs, side, weights: packed, bias: blocks.to_vec() }
    }

    /// Convolves the rows under the window, `stride` pixels from one output to the next, and writes
    /// max(0, sum) into the channels from `first_channel` on of a row of pixels of `channels` channels.
    pub(super) fn rectified_row(
        &self,
        rows: &[&[f32]],
        stride: usize,
        out: &mut [f32],
        channels: usize,
        first_channel: usize,
    ) {
        let run = self.side * self.inputs;
        let width = out.len() / channels;
        for (block, bias) in self.bias.iter().enumerate() {
            let weights = &self.weights[block * self.side * run..(block + 1) * self.side * run];
            let channel = first_channel + block * LANES;
            let mut write = |x: usize, sums: &[[f32; LANES]]| {
                for (pixel, sum) in out[x * channels..].chunks_mut(channels).zip(sums) {
                    // NaN stays NaN: what overflowed must not look like a feature that is not there.
                    pixel[channel..channel + LANES]
                        .copy_from_slice(&sum.map(|s| if s < 0.0 { 0.0 } else { s }));
                }
            };
            let step = stride * self.inputs;
            let groups = width / GROUP;
            for x in (0..groups).map(|group| group * GROUP) {
                write(x, &sums::<GROUP>(rows, x * step, step, run, weights, bias));
            }
            for x in groups * GROUP..width {
                write(x, &sums::<1>(rows, x * step, step, run, weights, bias));
            }
        }
    }
}

/// The sums of one block of outputs at `N` pixels whose windows begin at `first`, `first + step`, …
#[inline]
fn sums<const N: usize>(
    rows: &[&[f32]],
    first: usize,
    step: usize,
    run: usize,
    weights: &[[f32; LANES]],
    bias: &[f32; LANES],
) -> [[f32; LANES]; N] {
    let mut sums = [*bias; N];
    for (row, weights) in rows.iter().zip(weights.chunks_exact(run)) {
        let windows: [&[f32]; N] = std::array::from_fn(|n| &row[first + n * step..first + n * step + run]);
        for (i, weights) in weights.iter().enumerate() {
            for (sum, window) in sums.iter_mut().zip(windows) {
                let input = window[i];
                for (sum, weight) in sum.iter_mut().zip(weights) {
                    *sum += input * weight;
                }
            }
        }
    }
    sums
}

/// A fire module: a 1 × 1 convolution to few channels, then a 1 × 1 and a 3 × 3 one side by side; all rectified.
pub(super) struct Fire {
    pub(super) squeeze: Conv,
    pub(super) expand1: Conv,
    pub(super) expand3: Conv,
}

impl Fire {
    pub(super) fn run(&self, input: &Map) -> Map {
        let (width, height) = (input.width, input.height);
        let mut squeezed = Map::new(width, height, self.squeeze.outputs, 1);
        let channels = squeezed.channels;
        squeezed.write_rows(|y, row| self.squeeze.rectified_row(&[input.row(y)], 1, row, channels, 0));
        let channels = self.expand1.outputs + self.expand3.outputs;
        let mut out = Map::new(width, height, channels, 0);
        out.write_rows(|y, row| {
            self.expand1.rectified_row(&[squeezed.row(y)], 1, row, channels, 0);
            let rows = [0, 1, 2].map(|i| squeezed.framed_row(y + i));
            self.expand3.rectified_row(&rows, 1, row, channels, self.expand1.outputs);
        });
        out
    }
}

/// Outputs of [`pool`] along a side of `n` ≥ 2: windows of 3 from every second place on, the last one cut off if
/// need be, none that begins outside.
pub(super) fn pooled_side(n: usize) -> usize {
    n / 2
}

/// The maximum over windows of 3 × 3, every second pixel.
pub(super) fn pool(input: &Map) -> Map {
    let mut out = Map::new(pooled_side(input.width), pooled_side(input.height), input.channels, 0);
    out.write_rows(|y, row| {
        let rows: Vec<&[f32]> = (2 * y..(2 * y + 3).min(input.height)).map(|y| input.row(y)).collect();
        pooled_row(&rows, input.channels, row);
    });
    out
}

/// One row of [`pool`] from the rows under it. Rectified numbers are not negative, so the maximum starts at 0.
pub(super) fn pooled_row(rows: &[&[f32]], channels: usize, out: &mut [f32]) {
    out.fill(0.0);
    for (x, out) in out.chunks_exact_mut(channels).enumerate() {
        for row in rows {
            for pixel in row[2 * x * channels..].chunks_exact(channels).take(3) {
                for (out, value) in out.iter_mut().zip(pixel) {
                    *out = if *value > *out { *value } else { *out };
                }
            }
        }
    }
}
