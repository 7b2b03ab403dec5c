//! Any bytes as weights of LPIPS, and as the table of tensors in front of plausible numbers.

use std::fmt::Write;

use dapple_metrics::{LPIPS_MIN_SIDE, Lpips, MetricError};

use crate::Random;

/// Numbers of the tensors of LPIPS over SqueezeNet 1.1, in bytes.
const NUMBERS_BYTES: usize = 2_898_968;

/// Reads `data` as a file of weights, then as the table of one. Nothing may panic; what is taken finds no difference
/// between equal pictures, and between others a number or an error that says why not.
pub fn read_weights(data: &[u8]) {
    compare(data);
    compare(&with_numbers(data));
}

fn compare(file: &[u8]) {
    let Ok(lpips) = Lpips::from_safetensors(file) else { return };
    let side = LPIPS_MIN_SIDE;
    let picture: Vec<u8> = (0..side * side * 3).map(|i| (i * i % 251) as u8).collect();
    let other: Vec<u8> = picture.iter().map(|v| 255 - v).collect();
    let distance = |test: &[u8]| lpips.distance(side, side, &picture, test);
    let overflow = Err(MetricError::Overflow { metric: "LPIPS" });
    let (same, different) = (distance(&picture), distance(&other));
    assert!(same == Ok(0.0) || same == overflow, "{same:?}");
    assert!(different == overflow || different.is_ok_and(|d| d.is_finite() && d >= 0.0));
}

/// A file with `table` in front of as many numbers as the network has, each 0 … 1/8.
fn with_numbers(table: &[u8]) -> Vec<u8> {
    let mut random = Random(0);
    let mut file = [&(table.len() as u64).to_le_bytes(), table].concat();
    file.reserve(NUMBERS_BYTES);
    for _ in 0..NUMBERS_BYTES / 4 {
        file.extend((random.below(1024) as f32 / 8192.0).to_le_bytes());
    }
    file
}

/// The table of tensors of LPIPS over SqueezeNet 1.1.
pub(crate) fn table() -> String {
    let mut out = String::from("{");
    let mut end = 0;
    let mut add = |name: &str, shape: &[usize]| {
        let start = end;
        end += 4 * shape.iter().product::<usize>();
        let comma = if start == 0 { "" } else { "," };
        write!(
            out,
            "{comma}\"{name}\":{{\"dtype\":\"F32\",\"shape\":{shape:?},\"data_offsets\":[{start},{end}]}}"
        )
        .expect("strings take all");
    };
    let mut conv = |name: &str, inputs: usize, outputs: usize, side: usize| {
        add(&format!("{name}.weight"), &[outputs, inputs, side, side]);
        add(&format!("{name}.bias"), &[outputs]);
    };
    conv("features.0", 3, 64, 3);
    for (number, inputs, squeezed, expanded) in [
        (3, 64, 16, 64),
        (4, 128, 16, 64),
        (6, 128, 32, 128),
        (7, 256, 32, 128),
        (9, 256, 48, 192),
        (10, 384, 48, 192),
        (11, 384, 64, 256),
        (12, 512, 64, 256),
    ] {
        conv(&format!("features.{number}.squeeze"), inputs, squeezed, 1);
        conv(&format!("features.{number}.expand1x1"), squeezed, expanded, 1);
        conv(&format!("features.{number}.expand3x3"), squeezed, expanded, 3);
    }
    for (tap, channels) in [64, 128, 256, 384, 384, 512, 512].into_iter().enumerate() {
        add(&format!("lin{tap}.model.1.weight"), &[1, channels, 1, 1]);
    }
    add("scaling_layer.shift", &[1, 3, 1, 1]);
    add("scaling_layer.scale", &[1, 3, 1, 1]);
    assert_eq!(end, NUMBERS_BYTES);
    out + "}"
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Or the search would hardly get anywhere.
    #[test]
    fn the_table_is_taken() {
        assert!(Lpips::from_safetensors(&with_numbers(table().as_bytes())).is_ok());
    }
}
