//! The network once more, as plain loops over tensors in double precision: channels first, and nothing shared with
//! what it judges but the names of the tensors.

use super::Tensors;

/// Channels of `width` × `height` numbers each.
struct Planes {
    width: usize,
    height: usize,
    channels: Vec<Vec<f64>>,
}

impl Planes {
    /// 0 outside.
    fn at(&self, channel: usize, x: isize, y: isize) -> f64 {
        let inside = x >= 0 && y >= 0 && x < self.width as isize && y < self.height as isize;
        if inside { self.channels[channel][y as usize * self.width + x as usize] } else { 0.0 }
    }
}

fn convolve(tensors: &Tensors, name: &str, input: &Planes, stride: usize, padding: usize) -> Planes {
    let (shape, weights) = &tensors[&format!("{name}.weight")];
    let bias = &tensors[&format!("{name}.bias")].1;
    let [outputs, inputs, side] = [shape[0], shape[1], shape[2]];
    assert_eq!(inputs, input.channels.len());
    let size = |n: usize| (n + 2 * padding - side) / stride + 1;
    let (width, height) = (size(input.width), size(input.height));
    let channels = (0..outputs).map(|o| {
        let mut out = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let mut sum = f64::from(bias[o]);
                for i in 0..inputs {
                    for ky in 0..side {
                        for kx in 0..side {
                            let weight = weights[((o * inputs + i) * side + ky) * side + kx];
                            let (x, y) = (x * stride + kx, y * stride + ky);
                            let at = |v: usize| v as isize - padding as isize;
                            sum += f64::from(weight) * input.at(i, at(x), at(y));
                        }
                    }
                }
                out.push(sum.max(0.0));
            }
        }
        out
    });
    Planes { width, height, channels: channels.collect() }
}

/// Windows of 3, every 2, begun wherever one pixel at least is inside: "ceil mode".
fn pool(input: &Planes) -> Planes {
    let size = |n: usize| (n as f64 / 2.0 - 0.5).ceil() as usize;
    let (width, height) = (size(input.width), size(input.height));
    let channels = (0..input.channels.len()).map(|c| {
        let mut out = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let mut most = f64::NEG_INFINITY;
                for v in 2 * y..(2 * y + 3).min(input.height) {
                    for u in 2 * x..(2 * x + 3).min(input.width) {
                        most = most.max(input.channels[c][v * input.width + u]);
                    }
                }
                out.push(most);
            }
        }
        out
    });
    Planes { width, height, channels: channels.collect() }
}

fn fire(tensors: &Tensors, number: usize, input: &Planes) -> Planes {
    let squeezed = convolve(tensors, &format!("features.{number}.squeeze"), input, 1, 0);
    let mut out = convolve(tensors, &format!("features.{number}.expand1x1"), &squeezed, 1, 0);
    let wide = convolve(tensors, &format!("features.{number}.expand3x3"), &squeezed, 1, 1);
    out.channels.extend(wide.channels);
    out
}

/// Features of one picture at the seven taps.
fn features(tensors: &Tensors, width: usize, height: usize, srgb8: &[u8]) -> Vec<Planes> {
    let channels = (0..3).map(|c| {
        let (shift, scale) = (&tensors["scaling_layer.shift"].1, &tensors["scaling_layer.scale"].1);
        let unit = |byte: u8| f64::from(byte) / 255.0 * 2.0 - 1.0;
        srgb8
            .iter()
            .skip(c)
            .step_by(3)
            .map(|b| (unit(*b) - f64::from(shift[c])) / f64::from(scale[c]))
            .collect()
    });
    let input = Planes { width, height, channels: channels.collect() };
    let tap1 = convolve(tensors, "features.0", &input, 2, 0);
    let tap2 = fire(tensors, 4, &fire(tensors, 3, &pool(&tap1)));
    let tap3 = fire(tensors, 7, &fire(tensors, 6, &pool(&tap2)));
    let tap4 = fire(tensors, 9, &pool(&tap3));
    let tap5 = fire(tensors, 10, &tap4);
    let tap6 = fire(tensors, 11, &tap5);
    let tap7 = fire(tensors, 12, &tap6);
    vec![tap1, tap2, tap3, tap4, tap5, tap6, tap7]
}

/// Width, height and numbers of the map of each tap.
pub(super) fn taps(
    tensors: &Tensors,
    width: usize,
    height: usize,
    pictures: [&[u8]; 2],
) -> Vec<(usize, usize, Vec<f64>)> {
    let [a, b] = pictures.map(|picture| features(tensors, width, height, picture));
    let maps = a.iter().zip(&b).enumerate().map(|(tap, (a, b))| {
        let weights = &tensors[&format!("lin{tap}.model.1.weight")].1;
        let values = (0..a.width * a.height).map(|i| {
            let length = |f: &Planes| f.channels.iter().map(|c| c[i] * c[i]).sum::<f64>().sqrt() + 1e-10;
            let (length_a, length_b) = (length(a), length(b));
            let differences = a.channels.iter().zip(&b.channels).zip(weights);
            differences
                .map(|((a, b), weight)| f64::from(*weight) * (a[i] / length_a - b[i] / length_b).powi(2))
                .sum()
        });
        (a.width, a.height, values.collect())
    });
    maps.collect()
}
