//! How much brighter a picture is than it should be, in the mean.

use crate::error::{MetricError, check_finite, check_size};

/// Most of a channel at pixels whose means are compared: a lamp itself, its mirror image, or a wall beside it would hide all else.
const BRIGHTEST: f32 = 4.0;

/// Pixels about a brighter one that are left out with it, in rows and columns. Told apart by the reference alone, those at the edge of what is bright would have
/// the light of those left out, as soon as the test is blurred by a pixel.
const BESIDE: usize = 1;

/// Relative error of the mean luminance (Rec. 709) of `test`: 0 when equal, 0.01 if it is 1 % brighter than `reference`. Both are linear red, green and blue of any
/// range, row by row.
///
/// Compared are pixels that are neither brighter in the reference than 4 in any channel nor beside one that is. What the test has there is not cut: its noise would
/// look like a lack of light. 0 if there is no such pixel, or no light in them and in the test's.
///
/// # Errors
/// An empty image, lengths that do not fit, a value that is not finite.
pub fn mean_bias(width: u32, height: u32, reference: &[f32], test: &[f32]) -> Result<f64, MetricError> {
    check_size(width, height, 3, reference, test)?;
    check_finite("reference", reference)?;
    check_finite("test", test)?;
    let side = width as usize;
    let [reference, test] = [reference, test].map(|values| values.as_chunks::<3>().0);
    let is_bright = |pixel: &[f32; 3]| pixel.iter().any(|v| *v > BRIGHTEST);
    let (mut all, mut more) = (0.0, 0.0);
    for (i, (r, t)) in reference.iter().zip(test).enumerate() {
        let (x, y) = (i % side, i / side);
        let mut rows = reference.chunks(side).skip(y.saturating_sub(BESIDE)).take(y.min(BESIDE) + BESIDE + 1);
        let columns = x.saturating_sub(BESIDE)..(x + BESIDE + 1).min(side);
        if !rows.any(|row| row[columns.clone()].iter().any(is_bright)) {
            all += luminance(r);
            more += luminance(t) - luminance(r);
        }
    }
    Ok(more / f64::max(all, 1e-12))
}

fn luminance([r, g, b]: &[f32; 3]) -> f64 {
    0.2126 * f64::from(*r) + 0.7152 * f64::from(*g) + 0.0722 * f64::from(*b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_brighter_picture_is_so_much_brighter() {
        let reference: Vec<f32> = (0..7 * 5 * 3).map(|i| 0.01 * i as f32).collect();
        let test: Vec<f32> = reference.iter().map(|v| 1.03 * v).collect();
        let bias = mean_bias(7, 5, &reference, &test).unwrap();
        assert!((bias - 0.03).abs() < 1e-6, "{bias}");
        assert_eq!(mean_bias(7, 5, &reference, &reference), Ok(0.0));
        assert_eq!(mean_bias(7, 5, &[0.0; 105], &[0.0; 105]), Ok(0.0));
        // Green alone.
        let test: Vec<f32> = [0.0, 1.0, 0.0].repeat(4);
        let bias = mean_bias(2, 2, &[1.0; 12], &test).unwrap();
        assert!((bias - (0.7152 - 1.0)).abs() < 1e-6, "{bias}");
    }

    /// The light of a lamp that is blurred by a pixel is neither missed nor held against those beside; noise of what is dim counts as it is.
    #[test]
    fn what_is_bright_is_left_out_with_its_neighbours() {
        let at = |x: usize, y: usize| 3 * (y * 9 + x);
        let mut reference = vec![0.5; 9 * 9 * 3];
        let mut test = reference.clone();
        reference[at(4, 4) + 1] = 40.0;
        for y in 3..6 {
            for x in 3..6 {
                test[at(x, y)] = 4.0;
            }
        }
        assert_eq!(mean_bias(9, 9, &reference, &test), Ok(0.0));
        // At a corner and an edge, too, and not across the border to the other side.
        let mut reference = vec![0.5; 9 * 9 * 3];
        let mut test = reference.clone();
        reference[at(8, 2)] = 5.0;
        test[at(7, 1)..at(7, 1) + 3].fill(3.0);
        assert_eq!(mean_bias(9, 9, &reference, &test), Ok(0.0));
        test[at(0, 3)..at(0, 3) + 3].fill(30.0);
        let bias = mean_bias(9, 9, &reference, &test).unwrap();
        // 81 pixels but two columns of three.
        assert!((bias - 29.5 / (0.5 * 75.0)).abs() < 1e-6, "{bias}");
    }

    #[test]
    fn says_what_is_wrong() {
        assert!(matches!(mean_bias(0, 1, &[], &[]), Err(MetricError::Empty { .. })));
        assert!(matches!(mean_bias(1, 1, &[0.0; 3], &[0.0; 2]), Err(MetricError::LengthsDiffer { .. })));
        assert!(matches!(mean_bias(2, 1, &[0.0; 3], &[0.0; 3]), Err(MetricError::WrongLength { .. })));
        let test = [0.0, f32::NAN, 0.0];
        assert!(matches!(
            mean_bias(1, 1, &[0.0; 3], &test),
            Err(MetricError::NotFinite { image: "test", .. })
        ));
    }
}
