//! What can be wrong with a pair of pictures, in words that say what to change.

/// Why two pictures could not be compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MetricError {
    /// There is nothing to compare.
    #[error("the images are empty ({width} x {height}): a metric needs at least one pixel")]
    Empty {
        /// Width given, in pixels.
        width: u32,
        /// Height given, in pixels.
        height: u32,
    },
    /// Reference and test have different lengths.
    #[error(
        "the reference has {reference} values and the test {test}: compare images of one size and format"
    )]
    LengthsDiffer {
        /// Number of values in the reference.
        reference: usize,
        /// Number of values in the test.
        test: usize,
    },
    /// An image does not have the number of values that its size asks for.
    #[error(
        "an image of {width} x {height} pixels with {channels} channel(s) has {expected} values, \
         but {found} were given"
    )]
    WrongLength {
        /// Width given, in pixels.
        width: u32,
        /// Height given, in pixels.
        height: u32,
        /// Channels a pixel that the metric takes.
        channels: usize,
        /// Values that this makes.
        expected: u64,
        /// Values given.
        found: usize,
    },
    /// A side is shorter than the window of the metric.
    #[error(
        "an image of {width} x {height} pixels is smaller than the metric's window of {minimum} x {minimum}"
    )]
    TooSmall {
        /// Width given, in pixels.
        width: u32,
        /// Height given, in pixels.
        height: u32,
        /// Least width and height, in pixels.
        minimum: u32,
    },
    /// The image has more pixels than the metric's 32-bit sizes can count.
    #[error("an image of {width} x {height} pixels is too large: at most {maximum} pixels can be compared")]
    TooLarge {
        /// Width given, in pixels.
        width: u32,
        /// Height given, in pixels.
        height: u32,
        /// Largest number of pixels.
        maximum: u64,
    },
    /// A value is NaN or infinite.
    #[error("value {index} of the {image} is {value}: clear or mask such pixels before comparing")]
    NotFinite {
        /// `"reference"` or `"test"`.
        image: &'static str,
        /// Index into the slice.
        index: usize,
        /// The value found.
        value: f32,
    },
    /// The mask's length is not that of the image in pixels.
    #[error(
        "a mask of {mask} pixels does not fit {values} values: the number of values must be a multiple of it"
    )]
    MaskLength {
        /// Entries of the mask.
        mask: usize,
        /// Values of the reference.
        values: usize,
    },
    /// The mask selects no pixel.
    #[error("the mask selects none of its {mask} pixels: there is nothing to compare")]
    MaskEmpty {
        /// Entries of the mask.
        mask: usize,
    },
    /// A parameter lies outside its range.
    #[error("{name} is {value}, but must lie in {range}")]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// Value given.
        value: f32,
        /// Values allowed.
        range: &'static str,
    },
    /// The reference is black.
    #[error("the reference has no light in it, which no exposure shows: give the exposures")]
    Black,
    /// Numbers within the metric exceed what floats can hold.
    #[error("{metric} overflowed: its weights are too large to be those of a trained network")]
    Overflow {
        /// The metric.
        metric: &'static str,
    },
}

/// Checks that both slices hold `width * height * channels` values and at least one.
pub(crate) fn check_size<T>(
    width: u32,
    height: u32,
    channels: usize,
    reference: &[T],
    test: &[T],
) -> Result<(), MetricError> {
    if width == 0 || height == 0 {
        return Err(MetricError::Empty { width, height });
    }
    if reference.len() != test.len() {
        return Err(MetricError::LengthsDiffer { reference: reference.len(), test: test.len() });
    }
    let expected = u64::from(width).saturating_mul(u64::from(height)).saturating_mul(channels as u64);
    if reference.len() as u64 != expected {
        return Err(MetricError::WrongLength { width, height, channels, expected, found: reference.len() });
    }
    Ok(())
}

/// Checks that no value is NaN or infinite.
pub(crate) fn check_finite(image: &'static str, values: &[f32]) -> Result<(), MetricError> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(MetricError::NotFinite { image, index, value: values[index] }),
        None => Ok(()),
    }
}
