//! All surfaces under each sample of a picture, the nearest first: an A-buffer.

use std::marker::PhantomData;

use dapple_scene::{Pose, PosedCamera, Scene};
use rayon::prelude::*;

use super::raster::{Sink, Triangle, View, draw};
use super::screen::{Lens, half_sources};
use super::{AlphaTest, Screen, buffer};
use crate::{RenderError, projection};

/// Most surfaces under all samples of a picture together; each takes 8 bytes.
pub const MAX_FRAGMENTS: u64 = 1 << 27;

/// Depth of every surface under every sample's centre: what [`rasterize`](super::rasterize) would see if nearer ones were not there. The
/// first is what it does see. Surfaces that coincide are as many.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers {
    columns: u32,
    rows: u32,
    lens: Lens,
    /// Of each sample its first entry in the lists below; one more at the end.
    starts: Vec<u32>,
    depths: Vec<f32>,
    distances_m: Vec<f32>,
}

impl Layers {
    /// Draws all surfaces. Sidedness and holes are those of [`rasterize`](super::rasterize), and so are arguments and limits. The result does not depend on the
    /// number of threads.
    ///
    /// # Errors
    /// Those of [`rasterize`](super::rasterize), and more than [`MAX_FRAGMENTS`] surfaces.
    pub fn draw(
        scene: &Scene,
        pose: &Pose,
        camera: &PosedCamera,
        width: u32,
        height: u32,
        samples_per_axis: u32,
    ) -> Result<Layers, RenderError> {
        let view = View::checked(scene, pose, camera, [width, height], samples_per_axis)?;
        Layers::up_to(MAX_FRAGMENTS, &view, scene, pose, camera)
    }

    pub(super) fn up_to(
        most: u64,
        view: &View,
        scene: &Scene,
        pose: &Pose,
        camera: &PosedCamera,
    ) -> Result<Layers, RenderError> {
        // Counted first, so that each sample's surfaces have their place and nothing grows.
        let mut counts = buffer(view, 0u32)?;
        draw(view, scene, pose, true, |_| true, &Every { scene, pose, view, pile: PhantomData }, &mut counts);
        let fragments = counts.iter().map(|count| u64::from(*count)).sum();
        if fragments > most {
            return Err(RenderError::Fragments { fragments, most });
        }
        let no_memory = |_| RenderError::Memory { samples: fragments };
        let mut depths = Vec::new();
        depths.try_reserve_exact(fragments as usize).map_err(no_memory)?;
        depths.resize(fragments as usize, 0.0f32);

        let mut starts = buffer(view, 0u32)?;
        starts.try_reserve_exact(1).map_err(no_memory)?;
        starts.push(0);
        for (i, count) in counts.iter().enumerate() {
            starts[i + 1] = starts[i] + count;
        }
        let mut free = divided(&mut depths, &counts)?;
        draw(view, scene, pose, true, |_| true, &Every { scene, pose, view, pile: PhantomData }, &mut free);
        let filled = divided(&mut depths, &counts)?.into_par_iter().with_min_len(1024);
        filled.for_each(|own| own.sort_unstable_by(|a, b| b.total_cmp(a)));
        let distance = |depth: &f32| projection::view_distance(&camera.projection, *depth);
        let mut distances_m = Vec::new();
        distances_m.try_reserve_exact(depths.len()).map_err(no_memory)?;
        distances_m.extend(depths.iter().map(distance));
        let lens = Lens::new(&camera.projection, f64::from(view.columns) / f64::from(view.rows));
        Ok(Layers { columns: view.columns, rows: view.rows, lens, starts, depths, distances_m })
    }

    /// Samples in a row.
    pub fn columns(&self) -> u32 {
        self.columns
    }

    /// Rows of samples.
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Surfaces under all samples together.
    pub fn fragments(&self) -> usize {
        self.depths.len()
    }

    /// Reverse-z clip depths of all surfaces under a sample, the nearest (greatest) first; none for the background and for an index that is out of range.
    pub fn depths(&self, sample_index: usize) -> &[f32] {
        self.of(sample_index, &self.depths)
    }

    /// Distances along the view axis, metres, of the same.
    pub fn distances_m(&self, sample_index: usize) -> &[f32] {
        self.of(sample_index, &self.distances_m)
    }

    fn of<'a>(&self, sample_index: usize, list: &'a [f32]) -> &'a [f32] {
        match self.starts.get(sample_index..).unwrap_or_default() {
            [start, end, ..] => &list[*start as usize..*end as usize],
            _ => &[],
        }
    }

    /// Of the samples of [`Screen::half`] alone.
    pub fn half(&self) -> Layers {
        let sources: Vec<usize> = half_sources(self.columns, self.rows).collect();
        let mut starts = vec![0];
        for &source in &sources {
            starts.push(starts[starts.len() - 1] + self.depths(source).len() as u32);
        }
        Layers {
            columns: self.columns.div_ceil(2),
            rows: self.rows.div_ceil(2),
            lens: self.lens,
            starts,
            depths: sources.iter().flat_map(|&i| self.depths(i)).copied().collect(),
            distances_m: sources.iter().flat_map(|&i| self.distances_m(i)).copied().collect(),
        }
    }

    /// The first surfaces as a screen without normals: they are zero.
    pub fn screen(&self) -> Screen {
        let first = |i| self.distances_m(i).first().copied().unwrap_or(f32::INFINITY);
        let samples = self.starts.len() - 1;
        Screen::without_normals(self.lens, self.columns, (0..samples).map(first).collect())
    }
}

/// A list cut into pieces of so many entries.
fn divided<'a>(mut list: &'a mut [f32], counts: &[u32]) -> Result<Vec<&'a mut [f32]>, RenderError> {
    let mut pieces = Vec::new();
    pieces
        .try_reserve_exact(counts.len())
        .map_err(|_| RenderError::Memory { samples: counts.len() as u64 })?;
    for count in counts {
        let (piece, others) = std::mem::take(&mut list).split_at_mut(*count as usize);
        pieces.push(piece);
        list = others;
    }
    Ok(pieces)
}

/// What depths are put on.
trait Pile: Send {
    fn put(&mut self, depth: f32);
}

/// How many were put.
impl Pile for u32 {
    fn put(&mut self, _: f32) {
        *self += 1;
    }
}

/// The places that are still free.
impl Pile for &mut [f32] {
    fn put(&mut self, depth: f32) {
        if let Some((place, others)) = std::mem::take(self).split_first_mut() {
            *place = depth;
            *self = others;
        }
    }
}

/// Puts the depth of every surface on its sample's pile.
struct Every<'a, P> {
    scene: &'a Scene,
    pose: &'a Pose,
    view: &'a View,
    pile: PhantomData<fn(P)>,
}

impl<'a, P: Pile> Sink for Every<'a, P> {
    type Pixel = P;
    type State = Option<AlphaTest<'a>>;

    fn begin(&self, triangle: &Triangle) -> Self::State {
        AlphaTest::new(self.view, self.scene, self.pose, triangle)
    }

    fn sample(&self, test: &Self::State, _: &Triangle, at: [u32; 2], depth: f32, pile: &mut P) {
        if test.as_ref().is_none_or(|test| test.passes(self.view.ndc(at))) {
            pile.put(depth);
        }
    }
}

#[cfg(test)]
mod tests {
    use dapple_scene::{AlphaMode, Filter, Projection};
    use glam::{Affine3A, Vec3};

    use super::*;
    use crate::gbuffer::rasterize;
    use crate::testing::screen::look;
    use crate::testing::{Stage, cube, ground, matte, quad, sphere, turned, with_threads};

    /// Convex things, each one surface deep from any side, one with holes, one mirrored, and one seen from its back.
    fn stage() -> Stage {
        let mut stage = Stage::new();
        let mut net = matte(Vec3::ONE);
        net.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
        net.double_sided = true;
        net.base_color_texture =
            Some(stage.add_texture(2, Filter::Nearest, vec![[255; 4], [255, 255, 255, 0], [0; 4], [255; 4]]));
        let net = stage.add_material(net);
        let at = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        let face = quad([at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)]);
        stage.add(ground(6.0), 0, Affine3A::from_translation(Vec3::NEG_Y));
        stage.add(sphere(12, 16), 0, turned(0.3, Vec3::new(0.3, 0.2, -1.0)));
        stage.add(cube(), 0, turned(0.9, Vec3::new(-0.4, 0.1, 1.2)) * Affine3A::from_scale(Vec3::splat(0.6)));
        stage.add(sphere(8, 8), 0, Affine3A::from_scale(Vec3::new(-0.8, 0.8, 0.8)));
        stage.add(face.clone(), net, Affine3A::from_translation(Vec3::new(0.1, 0.1, 2.2)));
        stage.add(face, net, turned(2.6, Vec3::new(-0.1, 0.3, -2.0)));
        stage
    }

    fn cameras() -> [PosedCamera; 3] {
        let parallel = Projection::Orthographic { half_height: 2.0, near: -1.0, far: 7.0 };
        let above = look(Vec3::new(0.3, 0.9, 5.0), Vec3::ZERO);
        [above, PosedCamera { projection: parallel, ..above }, look(Vec3::new(-0.1, 0.3, 1.0), Vec3::ZERO)]
    }

    #[test]
    fn every_thing_is_drawn_as_if_it_were_alone_and_the_first_is_what_is_seen() {
        let stage = stage();
        for (camera, [width, height, n]) in cameras().into_iter().zip([[67, 43, 1], [31, 33, 2], [40, 21, 1]])
        {
            let layers = Layers::draw(&stage.scene, &stage.pose, &camera, width, height, n).unwrap();
            let seen = rasterize(&stage.scene, &stage.pose, &camera, width, height, n).unwrap();
            let alone: Vec<_> = (0..stage.scene.instances.len())
                .map(|only| {
                    let mut pose = stage.pose.clone();
                    for (i, instance) in pose.instances.iter_mut().enumerate() {
                        if i != only {
                            instance.world_from_mesh.translation.y += 1e4;
                        }
                    }
                    rasterize(&stage.scene, &pose, &camera, width, height, n).unwrap()
                })
                .collect();
            let (mut deepest, mut total) = (0, 0);
            for (i, sample) in seen.samples().iter().enumerate() {
                let covering = alone.iter().map(|buffer| buffer.samples()[i]).filter(|s| s.is_covered());
                let mut depths: Vec<f32> = covering.map(|s| s.depth).collect();
                depths.sort_by(|a, b| b.total_cmp(a));
                assert_eq!(layers.depths(i), depths);
                assert_eq!(layers.depths(i).first().copied(), sample.is_covered().then_some(sample.depth));
                (deepest, total) = (deepest.max(depths.len()), total + depths.len());
            }
            assert!(deepest >= 4, "{deepest}");
            assert_eq!(layers.fragments(), total);
            let screen = seen.screen(&stage.scene, &stage.pose, &camera).unwrap();
            assert_eq!(layers.screen().distances_m(), screen.distances_m());
            assert_eq!([layers.columns(), layers.rows()], [width * n, height * n]);
            assert!(
                layers.depths(seen.samples().len()).is_empty() && layers.distances_m(usize::MAX).is_empty()
            );
        }
    }

    #[test]
    fn threads_change_nothing_and_too_many_surfaces_are_refused() {
        let (stage, camera) = (stage(), cameras()[0]);
        let draw = || Layers::draw(&stage.scene, &stage.pose, &camera, 130, 90, 1).unwrap();
        let layers = with_threads(1, draw);
        assert_eq!(layers, with_threads(3, draw));
        let view = View::checked(&stage.scene, &stage.pose, &camera, [130, 90], 1).unwrap();
        let up_to = |most| Layers::up_to(most, &view, &stage.scene, &stage.pose, &camera);
        let fragments = layers.fragments() as u64;
        assert_eq!(up_to(fragments).unwrap(), layers);
        let error = up_to(fragments - 1).unwrap_err();
        assert_eq!(error, RenderError::Fragments { fragments, most: fragments - 1 });
        assert!(error.to_string().contains("draw a smaller picture"), "{error}");
    }

    #[test]
    fn nothing_in_view_has_no_layers() {
        let stage = Stage::new();
        for [width, height] in [[1, 1], [5, 3]] {
            let layers = Layers::draw(&stage.scene, &stage.pose, &cameras()[0], width, height, 1).unwrap();
            assert_eq!(layers.fragments(), 0);
            assert!(layers.screen().distances_m().iter().all(|d| *d == f32::INFINITY));
        }
        assert!(Layers::draw(&stage.scene, &stage.pose, &cameras()[0], 0, 3, 1).is_err());
    }
}
