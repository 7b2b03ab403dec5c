//! Pictures of one method, compared with the truth.

use std::path::Path;

use anyhow::{Context, Result};
use dapple_client::Drawn;
use dapple_metrics::{MetricError, flip, flip_hdr, magma_srgb8, psnr, psnr_masked, ssim};
use dapple_render::compose::{ErrorKind, ResolvedPlane, compose, resolve_plane, view_error, view_visibility};
use dapple_render::image::{Rgb8Image, ToneMap};
use dapple_render::shade::Shaded;
use dapple_scene::Scene;
use dapple_scene::glam::Vec3;
use dapple_trace::Tracer;
use dapple_trace::rtao::{BentVisibility, RtaoParams, Site, SmoothSite, trace_bent};

pub(crate) use crate::file::write_file;
use crate::judge::Judge;

/// Writes 8-bit sRGB pixels as a PNG.
pub(crate) fn write_png(path: &Path, width: u32, height: u32, rgb8: &[[u8; 3]]) -> Result<()> {
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    image::ImageEncoder::write_image(
        encoder,
        rgb8.as_flattened(),
        width,
        height,
        image::ExtendedColorType::Rgb8,
    )
    .with_context(|| format!("cannot encode {}", path.display()))?;
    write_file(path, &bytes)
}

/// Mean of the directions that are open over each sample (`sites` of the samples `indices`), in the world; zero where there is nothing.
pub(crate) fn open_directions(
    drawn: &Drawn,
    tracer: &Tracer,
    (indices, sites): (&[usize], &[Site]),
    params: &RtaoParams,
) -> Vec<Vec3> {
    let smooth: Vec<SmoothSite> = sites
        .iter()
        .map(|site| SmoothSite {
            site: *site,
            shading_normal_world: site.normal_world,
            first_ray: 0,
            axes_world: None,
        })
        .collect();
    let mut traced = vec![BentVisibility::default(); smooth.len()];
    trace_bent(tracer, &smooth, params, &mut traced);
    let mut open_world = vec![Vec3::ZERO; drawn.gbuffer.samples().len()];
    for (&index, traced) in indices.iter().zip(traced) {
        open_world[index] = traced.open_world;
    }
    open_world
}

/// A picture with one method's visibility, resolved to pixels.
pub(crate) struct Shown {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Before tone mapping.
    radiance: Vec<Vec3>,
    beauty: Vec<[u8; 3]>,
    visibility_picture: Vec<[u8; 3]>,
    visibility: ResolvedPlane,
    /// Whether a pixel shows any geometry.
    covered: Vec<bool>,
    pub(crate) covered_pixels: usize,
}

/// Names of the pictures that were written, relative to their folder.
pub(crate) struct Files {
    pub(crate) beauty: String,
    pub(crate) visibility: String,
}

impl Shown {
    /// Composes `drawn` with one visibility a sample (all open for `None`), and with other ambient light than its own if there is some.
    pub(crate) fn new(drawn: &Drawn, ambient: Option<&[Vec3]>, visibility: Option<&[f32]>) -> Result<Shown> {
        Shown::lit(drawn, ambient, None, visibility)
    }

    /// As [`Shown::new`], with what each sample reflects beside what is drawn.
    pub(crate) fn lit(
        drawn: &Drawn,
        ambient: Option<&[Vec3]>,
        reflected: Option<&[Vec3]>,
        visibility: Option<&[f32]>,
    ) -> Result<Shown> {
        let gbuffer = &drawn.gbuffer;
        let open;
        let samples = match visibility {
            Some(samples) => samples,
            None => {
                open = vec![1.0; gbuffer.samples().len()];
                &open
            }
        };
        let radiance = match reflected {
            None => drawn.compose_with(ambient, visibility)?,
            Some(reflected) => {
                let direct = drawn.shaded.direct.iter().zip(reflected).map(|(drawn, more)| *drawn + *more);
                let shaded = Shaded {
                    direct: direct.collect(),
                    ambient: ambient.unwrap_or(&drawn.shaded.ambient).to_vec(),
                };
                compose(&shaded, gbuffer, visibility)?
            }
        };
        let beauty = radiance.to_rgb8(&ToneMap::default());
        let visibility = resolve_plane(gbuffer, samples, 1.0)?;
        let covered: Vec<bool> = visibility.coverage.values.iter().map(|&c| c > 0.0).collect();
        Ok(Shown {
            width: beauty.width,
            height: beauty.height,
            radiance: radiance.pixels,
            beauty: beauty.pixels,
            visibility_picture: view_visibility(gbuffer, samples)?.pixels,
            visibility,
            covered_pixels: covered.iter().filter(|c| **c).count(),
            covered,
        })
    }

    /// Visibility of each pixel, over its samples that show geometry; 1 where none does.
    pub(crate) fn visibility(&self) -> &[f32] {
        &self.visibility.values.values
    }

    /// The same, without the rest.
    pub(crate) fn into_visibility(self) -> Vec<f32> {
        self.visibility.values.values
    }

    /// Whether each pixel shows any geometry.
    pub(crate) fn covered(&self) -> &[bool] {
        &self.covered
    }

    /// Linear light of each pixel.
    pub(crate) fn radiance(&self) -> &[Vec3] {
        &self.radiance
    }

    /// Writes `STEM-beauty.png` and `STEM-visibility.png`.
    pub(crate) fn write(&self, folder: &Path, stem: &str) -> Result<Files> {
        let files =
            Files { beauty: format!("{stem}-beauty.png"), visibility: format!("{stem}-visibility.png") };
        self.write_as(&folder.join(&files.beauty), &folder.join(&files.visibility))?;
        Ok(files)
    }

    /// Writes the picture and its visibility as PNGs.
    pub(crate) fn write_as(&self, beauty: &Path, visibility: &Path) -> Result<()> {
        write_png(beauty, self.width, self.height, &self.beauty)?;
        write_png(visibility, self.width, self.height, &self.visibility_picture)
    }
}

/// One picture against the truth.
pub(crate) struct Compared {
    /// PSNR of visibility over the pixels that show geometry; `None` if none does, infinite if equal.
    pub(crate) visibility_psnr_db: Option<f64>,
    /// The same over some of these pixels, and how many they are.
    pub(crate) some_psnr_db: Option<f64>,
    pub(crate) some_pixels: usize,
    /// PSNR of the 8-bit picture; infinite if equal.
    pub(crate) psnr_db: f64,
    pub(crate) ssim: f64,
    pub(crate) flip: f64,
    pub(crate) hdr_flip: Option<f64>,
    pub(crate) lpips: Option<f64>,
    error: Rgb8Image,
    flip_map: Vec<f32>,
}

/// Names of the maps that were written, relative to their folder.
pub(crate) struct Maps {
    pub(crate) error: String,
    pub(crate) flip: String,
}

impl Compared {
    /// `some` says which pixels are looked at apart.
    pub(crate) fn new(
        truth: &Shown,
        test: &Shown,
        judge: &Judge,
        hdr_flip: bool,
        some: impl Fn(usize) -> bool,
    ) -> Result<Compared> {
        let (width, height) = (truth.width, truth.height);
        let (truth_v, test_v) = (&truth.visibility.values, &test.visibility.values);
        let over = |mask: &[bool]| match mask.contains(&true) {
            true => psnr_masked(&truth_v.values, &test_v.values, mask, 1.0).map(Some),
            false => Ok(None),
        };
        let some: Vec<bool> = truth.covered.iter().enumerate().map(|(i, c)| *c && some(i)).collect();
        let [truth_rgb, test_rgb] = [&truth.beauty, &test.beauty].map(|p| p.as_flattened());
        let unit = |bytes: &[u8]| bytes.iter().map(|&b| f32::from(b) / 255.0).collect::<Vec<f32>>();
        let ppd = judge.pixels_per_degree;
        let flip = flip(width, height, truth_rgb, test_rgb, ppd)?;
        let linear = |shown: &Shown| shown.radiance.iter().flat_map(|p| p.to_array()).collect::<Vec<f32>>();
        let hdr_flip = match hdr_flip {
            false => None,
            true => match flip_hdr(width, height, &linear(truth), &linear(test), ppd, None) {
                Ok(found) => Some(found.mean),
                // A black picture has no exposures.
                Err(MetricError::Black) => None,
                Err(error) => return Err(error.into()),
            },
        };
        let lpips = judge.lpips.as_ref().map(|lpips| lpips.distance(width, height, truth_rgb, test_rgb));
        Ok(Compared {
            visibility_psnr_db: over(&truth.covered)?,
            some_psnr_db: over(&some)?,
            some_pixels: some.iter().filter(|some| **some).count(),
            psnr_db: psnr(&unit(truth_rgb), &unit(test_rgb), 1.0)?,
            ssim: ssim(width, height, &luma(&truth.beauty), &luma(&test.beauty))?,
            flip: flip.mean,
            hdr_flip,
            lpips: lpips.transpose()?,
            error: view_error(truth_v, test_v, &truth.visibility.coverage, ErrorKind::Signed)?,
            flip_map: flip.error_map,
        })
    }

    /// Writes `STEM-error.png`, the difference in visibility, and `STEM-flip.png`, FLIP as a heat map.
    pub(crate) fn write(&self, folder: &Path, stem: &str) -> Result<Maps> {
        let maps = Maps { error: format!("{stem}-error.png"), flip: format!("{stem}-flip.png") };
        let (width, height) = (self.error.width, self.error.height);
        write_png(&folder.join(&maps.error), width, height, &self.error.pixels)?;
        let heat = magma_srgb8(&self.flip_map);
        let pixels: Vec<[u8; 3]> = heat.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
        write_png(&folder.join(&maps.flip), width, height, &pixels)?;
        Ok(maps)
    }
}

/// Rec. 709 luma of sRGB-encoded pixels, 0 … 1.
pub(crate) fn luma(rgb8: &[[u8; 3]]) -> Vec<f32> {
    let luma_of =
        |&[r, g, b]: &[u8; 3]| 0.2126 * f32::from(r) + 0.7152 * f32::from(g) + 0.0722 * f32::from(b);
    rgb8.iter().map(|p| luma_of(p) / 255.0).collect()
}

/// Indices of the samples that show geometry, and where rays start for them.
pub(crate) fn sites(scene: &Scene, drawn: &Drawn) -> (Vec<usize>, Vec<Site>) {
    let found = drawn.gbuffer.map_surfaces(scene, &drawn.pose, |index, surface| {
        surface.map(|s| {
            let key = index as u64;
            (index, Site { position_world: s.position_world, normal_world: s.normal_world, key })
        })
    });
    found.into_iter().flatten().unzip()
}
