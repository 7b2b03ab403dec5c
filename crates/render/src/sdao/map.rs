//! The stochastic depth map: for each sample of a picture, distances of a few surfaces under it, chosen at random.

use dapple_scene::{Pose, PosedCamera, Projection, Scene};
use rayon::prelude::*;

use super::picks::{Chooser, Picks};
use crate::gbuffer::{AlphaTest, GBuffer, Layers, Sink, Triangle, View, buffer, draw, half_sources};
use crate::{RenderError, projection};

/// How a stochastic depth map is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapParams {
    /// Distances kept for a sample of the picture, 1, 2, 4, 8 or 16; default 4 \[S\].
    pub samples: u32,
    /// Part of them that a surface is expected to be kept in, above 0 to 1; default 0.25 \[α\].
    pub alpha: f32,
    /// How those are chosen; default stratified.
    pub picks: Picks,
    /// Whether the first surface, which the G-buffer has, is left out, so that samples are free for others; default true.
    pub is_first_left_out: bool,
    /// Of what is random; any, default 0.
    pub seed: u32,
}

impl Default for MapParams {
    fn default() -> Self {
        MapParams::with_samples(4)
    }
}

impl MapParams {
    /// What removes most of the error with so many samples: the first surface is left out, and each other one kept in one sample, in two of 8 or 16, so that the
    /// second is always there.
    pub fn with_samples(samples: u32) -> MapParams {
        let kept_in = if samples > 4 { 2.0 } else { 1.0 };
        let alpha = kept_in / samples.max(1) as f32;
        MapParams { samples, alpha, picks: Picks::Stratified, is_first_left_out: true, seed: 0 }
    }

    /// As in \[Vermeer2021\] sec. 4: α is 0.2, and the first surface is one among the others.
    pub fn paper(samples: u32) -> MapParams {
        MapParams { alpha: 0.2, is_first_left_out: false, ..MapParams::with_samples(samples) }
    }
}

impl MapParams {
    /// Whether every parameter is in its range.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn check(&self) -> Result<(), RenderError> {
        if !matches!(self.samples, 1 | 2 | 4 | 8 | 16) {
            let found = self.samples.into();
            return Err(RenderError::Parameter { name: "sdao: samples", found, range: "1, 2, 4, 8 or 16" });
        }
        if !(self.alpha > 0.0 && self.alpha <= 1.0) {
            let found = self.alpha.into();
            return Err(RenderError::Parameter { name: "sdao: alpha", found, range: "above 0 to 1" });
        }
        Ok(())
    }
}

/// Most distances of a map; each takes 4 bytes.
pub const MAX_DISTANCES: u64 = 1 << 30;

/// Distances of some of the surfaces under each sample of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct StochasticMap {
    columns: u32,
    rows: u32,
    samples: u32,
    distances_m: Vec<f32>,
}

/// What a sample of the map holds before a surface is kept: less than every depth.
const EMPTY: f32 = -1.0;

impl StochasticMap {
    /// Draws the map of a picture in one pass (Alg. 1), as a card does with a sample mask; `gbuffer` is what was drawn of the same scene, pose and camera. In
    /// parallel in the caller's rayon pool, and the same for any number of threads.
    ///
    /// # Errors
    /// A parameter out of its range, or what [`rasterize`](crate::gbuffer::rasterize) refuses.
    pub fn draw(
        scene: &Scene,
        pose: &Pose,
        camera: &PosedCamera,
        gbuffer: &GBuffer,
        params: &MapParams,
    ) -> Result<StochasticMap, RenderError> {
        let size = [gbuffer.width, gbuffer.height];
        let view = View::checked(scene, pose, camera, size, gbuffer.samples_per_axis)?;
        StochasticMap::drawn(scene, pose, camera, &view, params.is_first_left_out.then_some(gbuffer), params)
    }

    /// Draws a map of what a camera sees without a G-buffer, of a picture of so many pixels: first surfaces are among the others, whatever the parameters say.
    ///
    /// # Errors
    /// Those of [`StochasticMap::draw`].
    pub fn draw_alone(
        scene: &Scene,
        pose: &Pose,
        camera: &PosedCamera,
        size: [u32; 2],
        samples_per_axis: u32,
        params: &MapParams,
    ) -> Result<StochasticMap, RenderError> {
        let view = View::checked(scene, pose, camera, size, samples_per_axis)?;
        StochasticMap::drawn(scene, pose, camera, &view, None, params)
    }

    fn drawn(
        scene: &Scene,
        pose: &Pose,
        camera: &PosedCamera,
        view: &View,
        first: Option<&GBuffer>,
        params: &MapParams,
    ) -> Result<StochasticMap, RenderError> {
        params.check()?;
        let distances = u64::from(view.columns) * u64::from(view.rows) * u64::from(params.samples);
        if distances > MAX_DISTANCES {
            return Err(RenderError::Fragments { fragments: distances, most: MAX_DISTANCES });
        }
        let chooser = Chooser::new(params.picks, params.samples, params.alpha, params.seed);
        let keep = Keep { scene, pose, view, first, chooser };
        let depths = match params.samples {
            1 => keep.drawn::<1>()?,
            2 => keep.drawn::<2>()?,
            4 => keep.drawn::<4>()?,
            8 => keep.drawn::<8>()?,
            _ => keep.drawn::<16>()?,
        };
        Ok(StochasticMap::of_depths([view.columns, view.rows], params.samples, depths, &camera.projection))
    }

    /// The same map from all layers of the picture, for those who have them.
    ///
    /// # Errors
    /// A parameter out of its range.
    pub fn of_layers(
        layers: &Layers,
        projection: &Projection,
        params: &MapParams,
    ) -> Result<StochasticMap, RenderError> {
        params.check()?;
        let chooser = Chooser::new(params.picks, params.samples, params.alpha, params.seed);
        let [columns, samples] = [layers.columns(), params.samples].map(|count| count as usize);
        let mut depths = vec![EMPTY; columns * layers.rows() as usize * samples];
        depths.par_chunks_mut(samples).with_min_len(1024).enumerate().for_each(|(i, kept)| {
            let at = [i % columns, i / columns].map(|axis| axis as u32);
            let found = layers.depths(i);
            let first = found.first().filter(|_| params.is_first_left_out);
            for depth in found.iter().filter(|depth| first.is_none_or(|first| *depth < first)) {
                keep_nearest(chooser.mask(at, *depth), *depth, kept);
            }
        });
        Ok(StochasticMap::of_depths([layers.columns(), layers.rows()], params.samples, depths, projection))
    }

    fn of_depths(
        [columns, rows]: [u32; 2],
        samples: u32,
        mut depths: Vec<f32>,
        projection: &Projection,
    ) -> StochasticMap {
        depths.par_iter_mut().with_min_len(1024).for_each(|depth| {
            *depth = if *depth < 0.0 { f32::INFINITY } else { projection::view_distance(projection, *depth) };
        });
        StochasticMap { columns, rows, samples, distances_m: depths }
    }

    /// A map that was made elsewhere: distances along the view axis, metres, `samples` (1, 2, 4, 8 or 16) for each sample of a picture with so many columns, infinite
    /// where none is.
    ///
    /// # Errors
    /// A list that fills no whole number of rows.
    pub fn of_distances(
        columns: u32,
        samples: u32,
        distances_m: Vec<f32>,
    ) -> Result<StochasticMap, RenderError> {
        MapParams { samples, ..MapParams::default() }.check()?;
        let row = (columns as usize).saturating_mul(samples as usize);
        let rows = distances_m.len().checked_div(row).unwrap_or(0);
        RenderError::check_length("distances of a stochastic map", distances_m.len(), row * rows)?;
        Ok(StochasticMap { columns, rows: rows as u32, samples, distances_m })
    }

    /// Of the samples of [`Screen::half`](crate::gbuffer::Screen::half) alone.
    pub fn half(&self) -> StochasticMap {
        let sources = half_sources(self.columns, self.rows);
        StochasticMap {
            columns: self.columns.div_ceil(2),
            rows: self.rows.div_ceil(2),
            samples: self.samples,
            distances_m: sources.flat_map(|i| self.distances_m(i)).copied().collect(),
        }
    }

    /// Samples of the picture in a row.
    pub fn columns(&self) -> u32 {
        self.columns
    }

    /// Rows of samples of the picture.
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Distances kept for a sample of the picture.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// Distances along the view axis, metres, that are kept for a sample of the picture, in no order, infinite where none is; empty for an index that is out of
    /// range.
    pub fn distances_m(&self, sample_index: usize) -> &[f32] {
        let samples = self.samples as usize;
        let start = sample_index.saturating_mul(samples);
        self.distances_m.get(start..start.saturating_add(samples)).unwrap_or_default()
    }
}

/// The depth test of each sample in a mask: the nearest that was kept stays.
fn keep_nearest(mask: u16, depth: f32, kept: &mut [f32]) {
    for (sample, kept) in kept.iter_mut().enumerate() {
        if mask >> sample & 1 == 1 && depth > *kept {
            *kept = depth;
        }
    }
}

/// Keeps surfaces in samples that are chosen at random.
struct Keep<'a> {
    scene: &'a Scene,
    pose: &'a Pose,
    view: &'a View,
    first: Option<&'a GBuffer>,
    chooser: Chooser,
}

impl Keep<'_> {
    fn drawn<const N: usize>(&self) -> Result<Vec<f32>, RenderError> {
        let mut kept = buffer(self.view, [EMPTY; N])?;
        draw(self.view, self.scene, self.pose, true, |_| true, &Kept::<N>(self), &mut kept);
        Ok(kept.into_flattened())
    }
}

/// `N` samples.
struct Kept<'a, const N: usize>(&'a Keep<'a>);

impl<'a, const N: usize> Sink for Kept<'a, N> {
    type Pixel = [f32; N];
    type State = Option<AlphaTest<'a>>;

    fn begin(&self, triangle: &Triangle) -> Self::State {
        AlphaTest::new(self.0.view, self.0.scene, self.0.pose, triangle)
    }

    fn sample(&self, test: &Self::State, _: &Triangle, at: [u32; 2], depth: f32, kept: &mut [f32; N]) {
        let keep = self.0;
        if let Some(first) = keep.first {
            let index = at[1] as usize * keep.view.columns as usize + at[0] as usize;
            if depth >= first.samples()[index].depth {
                return;
            }
        }
        if kept.iter().all(|kept| depth <= *kept) {
            return;
        }
        let mask = keep.chooser.mask(at, depth);
        if mask != 0 && test.as_ref().is_none_or(|test| test.passes(keep.view.ndc(at))) {
            keep_nearest(mask, depth, kept);
        }
    }
}
