//! All metrics of one pair of pictures, and maps of its error.

use std::path::Path;

use anyhow::{Result, bail};
use dapple_metrics::{
    Exposures, LPIPS_MIN_SIDE, MetricError, PixelError, SSIM_MIN_SIDE, error_map, flip, flip_hdr,
    magma_srgb8, psnr, ssim, ssim_map,
};
use dapple_render::compose::{ERROR_RANGE, ErrorKind, view_error};
use dapple_render::image::Plane;
use serde::Serialize;

use super::read::{Picture, Values, bytes};
use crate::args::ErrorMap;
use crate::judge::Judge;
use crate::picture::write_png;

/// LPIPS at which its map is palest.
const LPIPS_RANGE: f32 = 0.5;

/// What was found. What does not apply to the pictures is absent.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Measured {
    /// Mean square error over all channels.
    pub(super) mse: f64,
    /// The largest value that counts for PSNR: 1, or of linear light the largest channel of the reference.
    pub(super) peak: f32,
    /// Absent where pictures are equal.
    pub(super) psnr_db: Option<f64>,
    pub(super) ssim: Option<f64>,
    pub(super) flip: Option<f64>,
    pub(super) hdr_flip: Option<f64>,
    pub(super) lpips: Option<f64>,
}

impl Measured {
    /// FLIP, of whichever kind.
    pub(super) fn any_flip(&self) -> f64 {
        self.flip.or(self.hdr_flip).unwrap_or(0.0)
    }
}

/// The metrics of a pair, and FLIP's map; without one and exposures if linear pictures have a black reference.
pub(super) struct Found {
    pub(super) measured: Measured,
    pub(super) flip_map: Option<Vec<f32>>,
    pub(super) exposures: Option<Exposures>,
}

impl Judge {
    pub(super) fn measure(&self, reference: &Picture, test: &Picture) -> Result<Found> {
        check_pair(reference, test)?;
        let (width, height) = (reference.width, reference.height);
        let squares = error_map(width, height, 3, reference.values(), test.values(), PixelError::Squared)?;
        let mse = squares.iter().map(|e| f64::from(*e)).sum::<f64>() / squares.len() as f64;
        match (&reference.values, &test.values) {
            (Values::Encoded(reference_unit), Values::Encoded(test_unit)) => {
                let (reference_srgb8, test_srgb8) = (bytes(reference_unit), bytes(test_unit));
                let ssim = (width.min(height) >= SSIM_MIN_SIDE)
                    .then(|| ssim(width, height, &reference.luma(), &test.luma()));
                let lpips = self.lpips.as_ref().filter(|_| width.min(height) >= LPIPS_MIN_SIDE);
                let lpips = lpips.map(|lpips| lpips.distance(width, height, &reference_srgb8, &test_srgb8));
                let flip = flip(width, height, &reference_srgb8, &test_srgb8, self.pixels_per_degree)?;
                let measured = Measured {
                    mse,
                    peak: 1.0,
                    psnr_db: finite(psnr(reference_unit, test_unit, 1.0)?),
                    ssim: ssim.transpose()?,
                    flip: Some(flip.mean),
                    hdr_flip: None,
                    lpips: lpips.transpose()?,
                };
                Ok(Found { measured, flip_map: Some(flip.error_map), exposures: None })
            }
            (Values::Linear(reference), Values::Linear(test)) => {
                let brightest = reference.iter().copied().fold(0.0, f32::max);
                let peak = if brightest > 0.0 { brightest } else { 1.0 };
                let flip = match flip_hdr(width, height, reference, test, self.pixels_per_degree, None) {
                    // A sequence may well begin in the dark.
                    Err(MetricError::Black) => None,
                    flip => Some(flip?),
                };
                let measured = Measured {
                    mse,
                    peak,
                    psnr_db: finite(psnr(reference, test, peak)?),
                    ssim: None,
                    flip: None,
                    hdr_flip: flip.as_ref().map(|flip| flip.mean),
                    lpips: None,
                };
                let (flip_map, exposures) = flip.map(|flip| (flip.error_map, flip.exposures)).unzip();
                Ok(Found { measured, flip_map, exposures })
            }
            _ => bail!("one picture is sRGB-encoded and the other linear light: convert one of them"),
        }
    }

    /// The error of one kind in colours.
    pub(super) fn paint(
        &self,
        reference: &Picture,
        test: &Picture,
        found: &Found,
        kind: ErrorMap,
    ) -> Result<Vec<[u8; 3]>> {
        let (width, height) = (reference.width, reference.height);
        let errors = |error| error_map(width, height, 3, reference.values(), test.values(), error);
        let encoded = |values: &Values| match values {
            Values::Encoded(values) => Ok(bytes(values)),
            Values::Linear(_) => bail!("--kind {} is for sRGB-encoded pictures", kind.name()),
        };
        match kind {
            ErrorMap::Flip => Ok(heat(found.flip_map.as_ref().ok_or(MetricError::Black)?)),
            ErrorMap::Signed => cool_to_warm(width, height, errors(PixelError::Signed)?, ErrorKind::Signed),
            ErrorMap::Absolute => {
                cool_to_warm(width, height, errors(PixelError::Absolute)?, ErrorKind::Absolute)
            }
            ErrorMap::Squared => {
                // Colours end at the square of where they end for sizes.
                let squares = errors(PixelError::Squared)?.into_iter().map(|e| e / ERROR_RANGE).collect();
                cool_to_warm(width, height, squares, ErrorKind::Absolute)
            }
            ErrorMap::Ssim => {
                encoded(&reference.values)?;
                let map = ssim_map(width, height, &reference.luma(), &test.luma())?;
                let margin = (SSIM_MIN_SIDE / 2) as usize;
                // Pixels near the border have no window of their own: they show that of the nearest pixel that has.
                let window = |at: usize, windows: u32| at.saturating_sub(margin).min(windows as usize - 1);
                let pixels = (0..height as usize).flat_map(|y| (0..width as usize).map(move |x| (x, y)));
                let errors: Vec<f32> = pixels
                    .map(|(x, y)| {
                        1.0 - map.map[window(y, map.height) * map.width as usize + window(x, map.width)]
                    })
                    .collect();
                Ok(heat(&errors))
            }
            ErrorMap::Lpips => {
                let Some(lpips) = &self.lpips else {
                    bail!("--kind lpips needs --lpips-weights FILE or DAPPLE_LPIPS_WEIGHTS");
                };
                let (reference, test) = (encoded(&reference.values)?, encoded(&test.values)?);
                let map = lpips.distance_map(width, height, &reference, &test)?.map;
                Ok(heat(&map.iter().map(|d| d / LPIPS_RANGE).collect::<Vec<f32>>()))
            }
        }
    }
}

/// Checks that both have one size.
fn check_pair(reference: &Picture, test: &Picture) -> Result<()> {
    let size = |picture: &Picture| (picture.width, picture.height);
    if size(reference) != size(test) {
        bail!(
            "the reference has {} x {} pixels and the test {} x {}: compare pictures of one size",
            reference.width,
            reference.height,
            test.width,
            test.height
        );
    }
    Ok(())
}

fn finite(db: f64) -> Option<f64> {
    db.is_finite().then_some(db)
}

/// 0 … 1 as black to pale yellow.
pub(super) fn heat(errors: &[f32]) -> Vec<[u8; 3]> {
    magma_srgb8(errors).as_chunks::<3>().0.to_vec()
}

fn cool_to_warm(width: u32, height: u32, errors: Vec<f32>, kind: ErrorKind) -> Result<Vec<[u8; 3]>> {
    let plane = |values| Plane { width, height, values };
    let (zero, all) = (plane(vec![0.0; errors.len()]), plane(vec![1.0; errors.len()]));
    Ok(view_error(&zero, &plane(errors), &all, kind)?.pixels)
}

/// Writes a map.
pub(super) fn write_map(path: &Path, like: &Picture, pixels: &[[u8; 3]]) -> Result<()> {
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        bail!("{} would hold a map: name it .png", path.display());
    }
    write_png(path, like.width, like.height, pixels)
}

/// The names of both files in front of what is wrong with the pair.
pub(super) fn pair_context(reference: &Path, test: &Path) -> String {
    format!("cannot compare {} with {}", test.display(), reference.display())
}
