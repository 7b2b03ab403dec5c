//! Draws a posed scene into a buffer of visible surfaces, several samples a pixel.
//!
//! Takes a scene, its pose and a camera; returns for each sample which triangle is seen, where in it, and how deep.
//! See the README in this folder for rules and precision.

mod guard;
mod layers;
mod pick;
mod raster;
mod screen;
mod surface;
#[cfg(test)]
mod tests;

use dapple_scene::{AlphaMode, Mesh, Pose, PosedCamera, Scene};
use glam::{DVec2, DVec4, Vec4};
use rayon::prelude::*;

use crate::{RenderError, projection, texture};
pub use guard::GuardBand;
pub use layers::{Layers, MAX_FRAGMENTS};
pub use pick::surface_at;
pub(crate) use raster::{Sink, Triangle, View, barycentrics, draw};
pub use screen::Screen;
pub(crate) use screen::half_sources;
pub use surface::{LocalSurface, RestSurface, Surface};

/// The instance index of a sample that sees the background.
pub const NO_INSTANCE: u32 = u32::MAX;
/// Longest side of a picture, pixels.
pub const MAX_SIDE: u32 = 16384;
/// Largest number of samples along each axis of a pixel.
pub const MAX_SAMPLES_PER_AXIS: u32 = 8;
/// Largest number of samples in a picture.
pub const MAX_SAMPLES: u64 = 1 << 28;

/// What each sample of a picture sees.
#[derive(Clone, Debug, PartialEq)]
pub struct GBuffer {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// 1 … 8: each pixel has a regular grid of n × n samples, at the centres of n × n equal squares.
    pub samples_per_axis: u32,
    /// (width × n) × (height × n), row-major from the top.
    samples: Vec<Sample>,
}

/// What one sample sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Index into [`Scene::instances`], or [`NO_INSTANCE`] for the background.
    pub instance: u32,
    /// Index into [`Mesh::triangles`]; 0 for the background.
    pub triangle: u32,
    /// Perspective-correct weights of vertices 1 and 2, each ≥ 0, sum ≤ 1; vertex 0 has the rest.
    pub barycentrics: [f32; 2],
    /// Reverse-z clip depth z/w: 1 at the near plane, 0 at infinity, at the far plane and for the background.
    pub depth: f32,
    back_face: bool,
}

impl Sample {
    const BACKGROUND: Sample =
        Sample { instance: NO_INSTANCE, triangle: 0, barycentrics: [0.0; 2], depth: 0.0, back_face: false };

    /// Whether a surface is seen.
    pub fn is_covered(&self) -> bool {
        self.instance != NO_INSTANCE
    }

    /// Whether the surface is seen from its back (possible only for double-sided materials).
    pub fn is_back_face(&self) -> bool {
        self.back_face
    }
}

impl GBuffer {
    /// All samples, row-major from the top, `width_samples() × height_samples()`.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// Samples in a row.
    pub fn width_samples(&self) -> u32 {
        self.width * self.samples_per_axis
    }

    /// Rows of samples.
    pub fn height_samples(&self) -> u32 {
        self.height * self.samples_per_axis
    }

    /// Where a sample lies in the picture, in pixels from the top left corner.
    pub fn sample_position_px(&self, sample_index: usize) -> [f32; 2] {
        let width = self.width_samples() as usize;
        let center = |i: usize| (i as f32 + 0.5) / self.samples_per_axis as f32;
        [center(sample_index % width), center(sample_index / width)]
    }

    /// Reduces the samples of each pixel to one value, in parallel; pixels row-major from the top. `reduce` gets the
    /// indices of the pixel's samples row by row.
    pub fn map_pixels<T: Send>(
        &self,
        reduce: impl Fn(&mut dyn Iterator<Item = usize>) -> T + Sync,
    ) -> Vec<T> {
        let n = self.samples_per_axis as usize;
        let row = self.width_samples() as usize;
        let pixels = self.width as usize * self.height as usize;
        (0..pixels)
            .into_par_iter()
            .with_min_len(256)
            .map(|pixel| {
                let (x, y) = (pixel % self.width as usize, pixel / self.width as usize);
                let first = y * n * row + x * n;
                reduce(&mut (0..n * n).map(|i| first + (i / n) * row + i % n))
            })
            .collect()
    }
}

/// Draws what `camera` sees of `scene` in `pose` into `width × height` pixels of `samples_per_axis`² samples.
///
/// Back faces of single-sided materials are culled; `AlphaMode::Mask` and `Blend` (as a mask of 0.5) cut holes. The
/// result does not depend on the number of threads.
///
/// # Errors
/// A size out of range, a camera that cannot project, a pose of another scene, or a scene whose lists do not fit.
pub fn rasterize(
    scene: &Scene,
    pose: &Pose,
    camera: &PosedCamera,
    width: u32,
    height: u32,
    samples_per_axis: u32,
) -> Result<GBuffer, RenderError> {
    let view = View::checked(scene, pose, camera, [width, height], samples_per_axis)?;
    let mut samples = buffer(&view, Sample::BACKGROUND)?;
    let sink = SampleSink { scene, pose, view: &view };
    draw(&view, scene, pose, true, |_| true, &sink, &mut samples);
    fill_barycentrics(&view, scene, pose, &mut samples);
    Ok(GBuffer { width, height, samples_per_axis, samples })
}

/// One value for each sample of a view.
pub(crate) fn buffer<T: Clone>(view: &View, value: T) -> Result<Vec<T>, RenderError> {
    let count = view.columns as usize * view.rows as usize;
    let mut values = Vec::new();
    values.try_reserve_exact(count).map_err(|_| RenderError::Memory { samples: count as u64 })?;
    values.resize(count, value);
    Ok(values)
}

impl View {
    /// Of a camera that can project on a picture whose size is in range, for a scene that can be drawn.
    pub(crate) fn checked(
        scene: &Scene,
        pose: &Pose,
        camera: &PosedCamera,
        [width, height]: [u32; 2],
        samples_per_axis: u32,
    ) -> Result<View, RenderError> {
        let size_error = RenderError::Size { width, height, samples_per_axis };
        let sides = 1..=MAX_SIDE;
        if !sides.contains(&width)
            || !sides.contains(&height)
            || !(1..=MAX_SAMPLES_PER_AXIS).contains(&samples_per_axis)
        {
            return Err(size_error);
        }
        let (columns, rows) = (width * samples_per_axis, height * samples_per_axis);
        let count = u64::from(columns) * u64::from(rows);
        if count > MAX_SAMPLES {
            return Err(size_error);
        }
        let clip_from_world = projection::clip_from_world(camera, width, height)?;
        check_scene(scene, pose)?;
        Ok(View { clip_from_world, columns, rows })
    }
}

/// Keeps the nearest surface of each sample; equal depths go to the lower (instance, triangle).
struct SampleSink<'a> {
    scene: &'a Scene,
    pose: &'a Pose,
    view: &'a View,
}

impl<'a> Sink for SampleSink<'a> {
    type Pixel = Sample;
    type State = Option<AlphaTest<'a>>;

    fn begin(&self, triangle: &Triangle) -> Self::State {
        AlphaTest::new(self.view, self.scene, self.pose, triangle)
    }

    fn sample(&self, test: &Self::State, triangle: &Triangle, at: [u32; 2], depth: f32, pixel: &mut Sample) {
        let nearer = depth > pixel.depth
            || (depth == pixel.depth
                && (triangle.instance, triangle.index) < (pixel.instance, pixel.triangle));
        if !nearer || test.as_ref().is_some_and(|test| !test.passes(self.view.ndc(at))) {
            return;
        }
        pixel.instance = triangle.instance;
        pixel.triangle = triangle.index;
        pixel.depth = depth;
        pixel.back_face = triangle.back_face;
    }
}

/// Cuts holes by alpha.
pub(crate) struct AlphaTest<'a> {
    scene: &'a Scene,
    material: &'a dapple_scene::Material,
    mesh: &'a Mesh,
    indices: [u32; 3],
    clip: [DVec4; 3],
    cutoff: f32,
}

impl<'a> AlphaTest<'a> {
    /// The test of a triangle's material, if it has one that can fail.
    pub(crate) fn new(
        view: &View,
        scene: &'a Scene,
        pose: &Pose,
        triangle: &Triangle,
    ) -> Option<AlphaTest<'a>> {
        let material = &scene.materials[triangle.material as usize];
        let cutoff = match material.alpha_mode {
            AlphaMode::Opaque => return None,
            AlphaMode::Mask { cutoff } => cutoff,
            AlphaMode::Blend => 0.5,
        };
        let mesh = &scene.meshes[scene.instances[triangle.instance as usize].mesh as usize];
        let clip = view.clip_triangle(scene, pose, triangle.instance as usize, triangle.index as usize)?;
        Some(AlphaTest {
            scene,
            material,
            mesh,
            indices: mesh.triangles[triangle.index as usize],
            clip,
            cutoff,
        })
    }

    /// Whether the surface is there at a place of the picture.
    pub(crate) fn passes(&self, ndc: DVec2) -> bool {
        let weights = barycentrics(&self.clip, ndc);
        let uv = surface::interpolate_uv(self.mesh, self.indices, weights);
        let vertex = surface::interpolate_color(self.mesh, self.indices, weights);
        texture::base_color(self.scene, self.material, &uv, Vec4::new(1.0, 1.0, 1.0, vertex.w)).w
            >= self.cutoff
    }
}

/// Gives every covered sample its barycentrics. Done once a visible sample, not once a drawn one.
fn fill_barycentrics(view: &View, scene: &Scene, pose: &Pose, samples: &mut [Sample]) {
    samples.par_chunks_mut(view.columns as usize).enumerate().for_each(|(y, row)| {
        let mut last = None;
        for (x, sample) in row.iter_mut().enumerate() {
            if !sample.is_covered() {
                continue;
            }
            let id = (sample.instance, sample.triangle);
            let clip = match last {
                Some((last_id, clip)) if last_id == id => clip,
                _ => view.clip_triangle(scene, pose, id.0 as usize, id.1 as usize).unwrap_or_default(),
            };
            last = Some((id, clip));
            let weights = barycentrics(&clip, view.ndc([x as u32, y as u32]));
            sample.barycentrics = [weights[1], weights[2]];
        }
    });
}

/// Whether every list that drawing reads by index is long enough.
pub(crate) fn check_scene(scene: &Scene, pose: &Pose) -> Result<(), RenderError> {
    let fail = |reason: String| Err(RenderError::Scene { reason });
    if pose.instances.len() != scene.instances.len() {
        return fail(format!(
            "the pose has {} instances and the scene {}",
            pose.instances.len(),
            scene.instances.len()
        ));
    }
    for (m, mesh) in scene.meshes.iter().enumerate() {
        let vertices = mesh.positions.len();
        let optional = |len: usize| len == 0 || len == vertices;
        if mesh.normals.len() != vertices
            || !optional(mesh.tangents.len())
            || !optional(mesh.colors.len())
            || !mesh.uvs.iter().all(|uvs| optional(uvs.len()))
        {
            return fail(format!(
                "a vertex list of mesh {m} ({:?}) differs in length from its positions",
                mesh.name
            ));
        }
        let mut next = 0u64;
        for part in &mesh.parts {
            if u64::from(part.first_triangle) != next || part.material as usize >= scene.materials.len() {
                return fail(format!(
                    "parts of mesh {m} ({:?}) are not consecutive or lack a material",
                    mesh.name
                ));
            }
            next += u64::from(part.triangle_count);
        }
        if next != mesh.triangles.len() as u64 {
            return fail(format!("parts of mesh {m} ({:?}) do not cover its triangles", mesh.name));
        }
    }
    for (i, (instance, posed)) in scene.instances.iter().zip(&pose.instances).enumerate() {
        let Some(mesh) = scene.meshes.get(instance.mesh as usize) else {
            return fail(format!("instance {i} refers to mesh {}, which is not there", instance.mesh));
        };
        if let Some(deformed) = &posed.deformed
            && (deformed.positions.len() != mesh.positions.len()
                || deformed.normals.len() != mesh.normals.len())
        {
            return fail(format!("the deformed vertices of instance {i} are not as many as its mesh's"));
        }
    }
    Ok(())
}
