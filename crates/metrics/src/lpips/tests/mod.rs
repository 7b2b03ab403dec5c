//! Against the values of others, against plain loops, and what must hold whatever the weights.

mod naive;
mod reference;

use std::collections::BTreeMap;

use super::network::{FIRES, TAPS};
use super::*;
use crate::test_images::{assert_same_on_every_thread_count, color_pair};

/// Tensors by name, each with its shape and numbers.
type Tensors = BTreeMap<String, (Vec<usize>, Vec<f32>)>;

/// Weights that a hash makes, of the network's shapes, about as large as trained ones.
fn made_weights() -> Tensors {
    let mut tensors = Tensors::new();
    let mut state = 1u32;
    let mut add = |name: String, shape: Vec<usize>, low: f32, high: f32| {
        let numbers = (0..shape.iter().product()).map(|_| {
            state = state.wrapping_mul(0x9E37_79B1).wrapping_add(0x7F4A_7C15);
            let bits = (state ^ state >> 15).wrapping_mul(0x2C1B_3C6D);
            low + (high - low) * ((bits >> 8) as f32 / (1 << 24) as f32)
        });
        let numbers = numbers.collect();
        tensors.insert(name, (shape, numbers));
    };
    let mut conv = |name: String, inputs: usize, outputs: usize, side: usize| {
        // Keeps the size of numbers from layer to layer.
        let reach = (6.0 / (inputs * side * side) as f32).sqrt();
        add(format!("{name}.weight"), vec![outputs, inputs, side, side], -reach, reach);
        add(format!("{name}.bias"), vec![outputs], -0.3, 0.3);
    };
    conv("features.0".into(), 3, 64, 3);
    for (number, inputs, squeezed, expanded) in FIRES {
        conv(format!("features.{number}.squeeze"), inputs, squeezed, 1);
        conv(format!("features.{number}.expand1x1"), squeezed, expanded, 1);
        conv(format!("features.{number}.expand3x3"), squeezed, expanded, 3);
    }
    for (tap, channels) in TAPS.into_iter().enumerate() {
        add(format!("lin{tap}.model.1.weight"), vec![1, channels, 1, 1], 0.0, 2.0);
    }
    add("scaling_layer.shift".into(), vec![1, 3, 1, 1], -0.2, 0.0);
    add("scaling_layer.scale".into(), vec![1, 3, 1, 1], 0.4, 0.5);
    tensors
}

fn file(tensors: &Tensors) -> Vec<u8> {
    let bytes: Vec<Vec<u8>> =
        tensors.values().map(|(_, numbers)| numbers.iter().flat_map(|n| n.to_le_bytes()).collect()).collect();
    let views = tensors.iter().zip(&bytes).map(|((name, (shape, _)), bytes)| {
        (name, safetensors::tensor::TensorView::new(safetensors::Dtype::F32, shape.clone(), bytes).unwrap())
    });
    safetensors::serialize(views, None).unwrap()
}

fn made() -> Lpips {
    Lpips::from_safetensors(&file(&made_weights())).unwrap()
}

#[test]
fn agrees_with_plain_loops_in_double_precision() {
    let tensors = made_weights();
    let lpips = Lpips::from_safetensors(&file(&tensors)).unwrap();
    // The least, odd and even sides, several bands of rows, and a last window of a pooling that is cut off.
    for (width, height) in [(17, 17), (18, 35), (37, 20), (24, 83), (20, 70)] {
        let (reference, test) = color_pair(width, height);
        let expected = naive::taps(&tensors, width as usize, height as usize, [&reference, &test]);
        let found = lpips.taps_srgb8(width, height, &reference, &test).unwrap();
        for (tap, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let at = format!("{width} x {height}, tap {tap}");
            assert_eq!(
                (found.width, found.height, found.values.len()),
                (expected.0, expected.1, expected.2.len()),
                "{at}"
            );
            for (found, expected) in found.values.iter().zip(&expected.2) {
                assert!(
                    (f64::from(*found) - expected).abs() < 1e-4 * (expected + 1e-2),
                    "{at}: {found} {expected}"
                );
            }
        }
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let expected: f64 = expected.iter().map(|tap| mean(&tap.2)).sum();
        let distance = lpips.distance(width, height, &reference, &test).unwrap();
        assert!(distance > 0.01 && (distance - expected).abs() < 1e-5 * expected, "{distance} {expected}");
    }
}

#[test]
fn equal_pictures_have_no_distance_and_it_is_symmetric() {
    let (reference, test) = color_pair(40, 33);
    let lpips = made();
    let same = lpips.distance_map(40, 33, &reference, &reference).unwrap();
    assert_eq!((same.distance, same.map), (0.0, vec![0.0; 40 * 33]));
    let there = lpips.distance(40, 33, &reference, &test).unwrap();
    assert_eq!(there, lpips.distance(40, 33, &test, &reference).unwrap());
    assert!(there > 0.0);
}

#[test]
fn does_not_depend_on_the_thread_count() {
    let (reference, test) = color_pair(61, 90);
    let lpips = made();
    assert_same_on_every_thread_count(|| {
        let found = lpips.distance_map(61, 90, &reference, &test).unwrap();
        (found.distance.to_bits(), found.map.iter().map(|v| v.to_bits()).collect::<Vec<u32>>())
    });
}

#[test]
fn the_map_shows_where_pictures_differ() {
    // One corner differs. The far one sees nothing of it, except through the layers of widest reach.
    let (reference, _) = color_pair(160, 96);
    let mut test = reference.clone();
    for y in 0..24 {
        test[y * 160 * 3..][..24 * 3].iter_mut().for_each(|v| *v = 255 - *v);
    }
    let found = made().distance_map(160, 96, &reference, &test).unwrap();
    let mean = |xs: std::ops::Range<usize>, ys: std::ops::Range<usize>| {
        let count = (xs.len() * ys.len()) as f64;
        ys.flat_map(|y| xs.clone().map(move |x| (x, y)))
            .map(|(x, y)| f64::from(found.map[y * 160 + x]))
            .sum::<f64>()
            / count
    };
    let (all, near, far) = (mean(0..160, 0..96), mean(0..24, 0..24), mean(136..160, 72..96));
    assert!(near > 5.0 * all && far < 0.01 * near, "{near} {all} {far}");
    assert!((all - found.distance).abs() < 0.1 * found.distance, "{all} {}", found.distance);
}

#[test]
fn maps_are_resampled_as_squares() {
    // Twice as wide: centres lie at a quarter and three quarters of the way; at the rim the value holds.
    let tap = TapMap { width: 2, height: 1, values: vec![1.0, 5.0] };
    let mut map = vec![0.5; 8];
    add_resampled(&tap, 4, &mut map);
    assert_eq!(map, [1.5, 2.5, 4.5, 5.5, 1.5, 2.5, 4.5, 5.5]);
}

#[test]
fn pictures_that_do_not_fit_are_refused() {
    let lpips = made();
    let picture = [0u8; 16 * 17 * 3];
    let error = lpips.distance(16, 17, &picture, &picture).unwrap_err();
    assert_eq!(error, MetricError::TooSmall { width: 16, height: 17, minimum: 17 });
    let error = lpips.distance(17, 17, &picture, &picture).unwrap_err();
    assert!(matches!(error, MetricError::WrongLength { expected: 867, found: 816, .. }));
    let error = lpips.distance_map(16, 17, &picture, &picture[3..]).unwrap_err();
    assert!(matches!(error, MetricError::LengthsDiffer { .. }));
    let wide = vec![0u8; 3 * 17 * 1_000_000];
    let error = lpips.distance(1_000_000, 17, &wide, &wide).unwrap_err();
    assert!(matches!(error, MetricError::TooLarge { maximum: LPIPS_MAX_PIXELS, .. }), "{error}");
}

#[test]
fn files_that_are_no_weights_are_refused() {
    let tensors = made_weights();
    let whole = file(&tensors);
    let error = |bytes: &[u8]| Lpips::from_safetensors(bytes).unwrap_err();
    for end in [0, 4, 8, 9, 1000, whole.len() - 1] {
        assert!(matches!(error(&whole[..end]), WeightsError::Format { .. }), "{end}");
    }
    // A table that claims to be as long as memory, and one longer than the file.
    for length in [u64::MAX, 1 << 40, whole.len() as u64] {
        let bytes = [&length.to_le_bytes(), &whole[8..]].concat();
        assert!(matches!(error(&bytes), WeightsError::Format { .. }), "{length}");
    }
    assert!(matches!(error(b"\x80\x02}q\x00X\x06pickled by another program"), WeightsError::Format { .. }));
    assert!(matches!(error(&vec![0; (16 << 20) + 1]), WeightsError::TooLarge { .. }));

    let with = |change: &dyn Fn(&mut Tensors)| {
        let mut tensors = tensors.clone();
        change(&mut tensors);
        error(&file(&tensors))
    };
    let missing = with(&|t| drop(t.remove("features.9.squeeze.bias")));
    assert_eq!(missing, WeightsError::Missing { name: "features.9.squeeze.bias".into() });
    let shape = with(&|t| t.get_mut("lin3.model.1.weight").unwrap().0 = vec![384]);
    assert!(
        matches!(shape, WeightsError::Shape { found, expected, .. } if found == [384] && expected == [1, 384, 1, 1])
    );
    for bad in [f32::NAN, f32::INFINITY] {
        let value = with(&|t| t.get_mut("features.0.weight").unwrap().1[77] = bad);
        assert!(matches!(value, WeightsError::Value { index: 77, range: "finite", .. }), "{value}");
    }
    let negative = with(&|t| t.get_mut("lin0.model.1.weight").unwrap().1[5] = -0.5);
    assert!(matches!(negative, WeightsError::Value { index: 5, value: -0.5, .. }), "{negative}");
    let flat = with(&|t| t.get_mut("scaling_layer.scale").unwrap().1[2] = 0.0);
    assert!(matches!(flat, WeightsError::Value { index: 2, .. }), "{flat}");
    let halves = String::from_utf8_lossy(&whole).find("\"F32\"").unwrap();
    let mut other = whole.clone();
    other[halves..halves + 5].copy_from_slice(b"\"I32\"");
    assert!(matches!(error(&other), WeightsError::Type { .. }));
}

#[test]
fn weights_that_overflow_are_an_error_and_not_a_number() {
    let mut tensors = made_weights();
    for (name, (_, numbers)) in &mut tensors {
        if name.starts_with("features") {
            numbers.iter_mut().for_each(|n| *n *= 1e30);
        }
    }
    let (reference, test) = color_pair(20, 20);
    let lpips = Lpips::from_safetensors(&file(&tensors)).unwrap();
    let error = lpips.distance(20, 20, &reference, &test).unwrap_err();
    assert_eq!(error, MetricError::Overflow { metric: "LPIPS" });
}
