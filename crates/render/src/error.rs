//! What can be wrong with a request to draw.

/// Why a picture could not be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// A side is zero or too long, or the sample grid is out of range, or there are too many samples.
    #[error(
        "cannot draw {width}x{height} pixels with {samples_per_axis}x{samples_per_axis} samples each: a side must be \
         1 to {max_side} pixels, samples per axis 1 to {max_samples_per_axis}, and samples in all at most {max_samples}",
        max_side = crate::gbuffer::MAX_SIDE,
        max_samples_per_axis = crate::gbuffer::MAX_SAMPLES_PER_AXIS,
        max_samples = crate::gbuffer::MAX_SAMPLES,
    )]
    Size {
        /// Requested width, pixels.
        width: u32,
        /// Requested height, pixels.
        height: u32,
        /// Requested samples along each axis of a pixel.
        samples_per_axis: u32,
    },
    /// The buffer does not fit into memory.
    #[error(
        "not enough memory for {samples} samples: draw a smaller picture or take fewer samples per pixel"
    )]
    Memory {
        /// Samples asked for.
        samples: u64,
    },
    /// More surfaces lie under the samples of a picture than may be kept.
    #[error(
        "{fragments} surfaces lie under the samples of this picture, at most {most} are kept: draw a smaller picture or take \
         fewer samples per pixel"
    )]
    Fragments {
        /// Surfaces under all samples together.
        fragments: u64,
        /// How many are kept.
        most: u64,
    },
    /// A lens or placement that projects nothing.
    #[error("the camera cannot project: {reason}")]
    Camera {
        /// Which number is wrong and what it must be.
        reason: &'static str,
    },
    /// Lists of the scene do not fit together, or the pose is of another scene.
    #[error(
        "the scene cannot be drawn: {reason}; pose the same scene that is drawn, and load it through its loader"
    )]
    Scene {
        /// What does not fit, and where.
        reason: String,
    },
    /// A parameter of a method is out of its range.
    #[error("{name} is {found}, must be {range}")]
    Parameter {
        /// Method and parameter.
        name: &'static str,
        /// What it is.
        found: f64,
        /// What it must be.
        range: &'static str,
    },
    /// A per-sample or per-pixel list is of the wrong length.
    #[error("{what} has {found} values where {expected} are needed: make it for the same G-buffer")]
    Length {
        /// Which list.
        what: &'static str,
        /// How long it is.
        found: usize,
        /// How long it must be.
        expected: usize,
    },
}

impl RenderError {
    /// `Ok` if a list has the length it must have.
    pub(crate) fn check_length(what: &'static str, found: usize, expected: usize) -> Result<(), RenderError> {
        if found == expected { Ok(()) } else { Err(RenderError::Length { what, found, expected }) }
    }
}
