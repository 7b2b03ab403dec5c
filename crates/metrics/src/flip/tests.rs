//! Against two other programs, and what must hold for all pictures.

use super::*;
use crate::test_images::{assert_same_on_every_thread_count, color_pair};

/// What `flip-evaluator` 1.7 gives for the images of `test_images` (height × width × 3 bytes `r`, `t`):
///
/// ```text
/// flip_evaluator.evaluate((r / 255).astype("float32"), (t / 255).astype("float32"), "LDR",
///                         inputsRGB=True, applyMagma=False, parameters={"ppd": ppd})
/// ```
///
/// Mean, then the error of the first, the middle (w / 2, h / 2) and the last pixel.
#[test]
fn agrees_with_flip_evaluator() {
    for (width, height, ppd, mean, pixels) in [
        (96, 64, 67.0, 0.204_928_65, [0.293_754_5, 0.124_716_77, 0.239_927_63]),
        (96, 64, 20.0, 0.267_210_22, [0.334_097_92, 0.165_822_07, 0.182_403_15]),
        // Taller than a band.
        (40, 300, 67.0, 0.227_695_78, [0.293_754_5, 0.268_248_23, 0.184_972_39]),
    ] {
        let (reference, test) = color_pair(width, height);
        let found = flip(width, height, &reference, &test, ppd).unwrap();
        assert!((found.mean - mean).abs() < 1e-5, "{width} x {height}: {}", found.mean);
        let count = found.error_map.len();
        assert_eq!(count, (width * height) as usize);
        let middle = (height / 2 * width + width / 2) as usize;
        for (index, expected) in [0, middle, count - 1].into_iter().zip(pixels) {
            let error: f32 = found.error_map[index];
            assert!((error - expected).abs() < 1e-4, "{width} x {height} at {index}: {error}");
        }
    }
}

/// Every pixel, beside the implementation of FLIP's authors.
#[test]
fn agrees_with_its_authors_at_every_pixel() {
    let mut largest = 0.0f32;
    for (width, height, ppd) in [
        (96, 64, 67.0),
        (1, 1, 67.0),
        (2, 150, 67.0),
        (131, 7, 30.0),
        (70, 90, 5.0),
        (64, 200, 140.0),
        (40, 30, 11.5),
    ] {
        let (reference, test) = color_pair(width, height);
        // Slight differences as well as those of the pair.
        let close: Vec<u8> = reference.iter().enumerate().map(|(i, v)| v ^ u8::from(i % 11 == 0)).collect();
        for test in [&test, &close] {
            let found = flip(width, height, &reference, test, ppd).unwrap();
            let image = |data| nv_flip::FlipImageRgb8::with_data(width, height, data);
            let theirs = nv_flip::flip(image(&reference), image(test), ppd).to_vec();
            for (index, (ours, theirs)) in found.error_map.iter().zip(&theirs).enumerate() {
                let at = format!("{width} x {height} at {ppd}, pixel {index}");
                assert!((ours - theirs).abs() < 1e-4, "{at}: {ours} {theirs}");
                largest = largest.max((ours - theirs).abs());
            }
        }
    }
    println!("largest difference {largest:.1e}");
}

#[test]
fn bands_are_the_whole_picture_bit_for_bit() {
    let (reference, test) = color_pair(50, 130);
    for ppd in [5.0, 67.0, 140.0] {
        let by_bands_of = |rows| flip_by(&Flipper::new(ppd).with_band_rows(rows), 50, 130, &reference, &test);
        let whole = by_bands_of(130);
        for rows in [1, 7, 64] {
            assert_eq!(whole, by_bands_of(rows));
        }
    }
}

#[test]
fn equal_pictures_have_no_error_and_black_on_white_almost_all() {
    let (reference, _) = color_pair(9, 1);
    let same = flip(9, 1, &reference, &reference, PIXELS_PER_DEGREE).unwrap();
    assert_eq!((same.mean, same.error_map), (0.0, vec![0.0; 9]));
    let different = flip(1, 1, &[0; 3], &[255; 3], PIXELS_PER_DEGREE).unwrap();
    assert!((different.mean - 0.967_388_2).abs() < 1e-4, "{}", different.mean);
    // No colours are farther apart than green and blue.
    let most = flip(1, 1, &[0, 255, 0], &[0, 0, 255], PIXELS_PER_DEGREE).unwrap();
    assert!((most.mean - 1.0).abs() < 1e-5, "{}", most.mean);
}

#[test]
fn errors_stay_in_their_range_at_any_distance() {
    let (reference, test) = color_pair(23, 19);
    for ppd in [1.0, 1.5, 3.0, 1000.0] {
        let found = flip(23, 19, &reference, &test, ppd).unwrap();
        assert!(found.error_map.iter().all(|e| (0.0..=1.0).contains(e)), "{ppd}");
        assert!(found.mean > 0.01, "{ppd}: {}", found.mean);
    }
}

#[test]
fn does_not_depend_on_the_thread_count() {
    let (reference, test) = color_pair(30, 300);
    assert_same_on_every_thread_count(|| {
        let found = flip(30, 300, &reference, &test, PIXELS_PER_DEGREE).unwrap();
        found.error_map.iter().map(|e| e.to_bits()).collect::<Vec<u32>>()
    });
}

#[test]
fn magma_runs_from_black_to_pale_yellow() {
    assert_eq!(magma_srgb8(&[0.0, -3.0, f32::NAN]), [0, 0, 4].repeat(3));
    assert_eq!(magma_srgb8(&[1.0, 7.0]), [252, 253, 191].repeat(2));
    assert_eq!(magma_srgb8(&[]), Vec::<u8>::new());
    let ramp: Vec<f32> = (0..256).map(|i| i as f32 / 255.0).collect();
    let theirs = nv_flip::magma_lut().to_vec();
    assert!(magma_srgb8(&ramp).iter().zip(&theirs).all(|(ours, theirs)| ours.abs_diff(*theirs) <= 1));
}

#[test]
fn says_what_is_wrong() {
    let one = [0u8; 3];
    assert!(matches!(flip(0, 0, &[], &[], 67.0), Err(MetricError::Empty { .. })));
    assert!(matches!(flip(1, 1, &one, &one[..2], 67.0), Err(MetricError::LengthsDiffer { .. })));
    assert!(matches!(
        flip(2, 1, &one, &one, 67.0),
        Err(MetricError::WrongLength { expected: 6, found: 3, .. })
    ));
    assert!(matches!(flip(u32::MAX, u32::MAX, &one, &one, 67.0), Err(MetricError::WrongLength { .. })));
    for ppd in [0.0, -1.0, 1e9, f32::NAN] {
        assert!(matches!(
            flip(1, 1, &one, &one, ppd),
            Err(MetricError::Parameter { name: "pixels_per_degree", .. })
        ));
    }
}
