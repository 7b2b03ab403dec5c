//! Pictures from the card and from the twins, and how they are compared.

use std::sync::Arc;

use dapple_gpu::testing::{block_on, gpu_for_tests};
use dapple_gpu::{Gpu, read_texture, wgpu};
use dapple_scene::{Pose, PosedCamera, Scene};

use super::super::{
    Drawn, Forward, FrameInputs, GpuScene, GpuSceneOptions, Lookup, LookupId, Transparency, View,
};
use crate::compose::compose;
use crate::gbuffer::{GBuffer, rasterize};
use crate::image::{Rgb8Image, ToneMap};
use crate::shade::{ShadeParams, render_shadow_maps, shade};

pub(super) const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// A device, a scene on it, and a pass.
pub(super) struct Bench {
    pub(super) gpu: Gpu,
    pub(super) scene: GpuScene,
    pub(super) forward: Forward,
    /// What the last picture came to.
    pub(super) drawn: Drawn,
}

impl Bench {
    /// `None` (said aloud) without an adapter.
    pub(super) fn new(scene: &Scene, samples: u32, lookups: &[Lookup]) -> Option<Bench> {
        let gpu = gpu_for_tests()?;
        let options = GpuSceneOptions { mips: false };
        let gpu_scene = GpuScene::new(&gpu, Arc::new(scene.clone()), &options).unwrap();
        let forward = Forward::new(&gpu, FORMAT, samples, lookups).unwrap();
        Some(Bench { gpu, scene: gpu_scene, forward, drawn: Drawn::default() })
    }

    pub(super) fn draw(&mut self, (width, height): (u32, u32), inputs: &FrameInputs<'_>) -> Rgb8Image {
        let texture = self.gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let (gpu, size) = (&self.gpu, (width, height));
        self.drawn = self.forward.draw(gpu, &mut encoder, &view, size, &mut self.scene, inputs).unwrap();
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = block_on(read_texture(&self.gpu, &texture, 0)).unwrap();
        let pixels = bytes.chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect();
        Rgb8Image { width, height, pixels }
    }

    /// The lit scene without visibility, as the twin draws it.
    pub(super) fn beauty(
        &mut self,
        size: (u32, u32),
        pose: &Pose,
        camera: &PosedCamera,
        shade: &ShadeParams,
    ) -> Rgb8Image {
        let views = [View::new(*camera, LookupId::NONE)];
        self.draw(size, &inputs(pose, shade, &views))
    }
}

pub(super) fn inputs<'a>(pose: &'a Pose, shade: &'a ShadeParams, views: &'a [View<'a>]) -> FrameInputs<'a> {
    FrameInputs {
        pose,
        shade,
        tone_map: ToneMap::default(),
        transparency: Transparency::Cutout,
        fade: 1.0,
        views,
    }
}

/// What the twins draw.
pub(super) fn twin(
    scene: &Scene,
    pose: &Pose,
    camera: &PosedCamera,
    (width, height): (u32, u32),
    params: &ShadeParams,
) -> (Rgb8Image, GBuffer) {
    let gbuffer = rasterize(scene, pose, camera, width, height, 1).unwrap();
    let maps = render_shadow_maps(scene, pose, params);
    let shaded = shade(scene, pose, camera, &gbuffer, &maps, params);
    let picture = compose(&shaded, &gbuffer, None).unwrap().to_rgb8(&ToneMap::default());
    (picture, gbuffer)
}

/// How much two pictures differ, away from edges.
#[derive(Clone, Copy, Debug)]
pub(super) struct Difference {
    /// Pixels compared.
    pub(super) compared: usize,
    /// Fraction of them whose channels differ by at most 2 codes.
    pub(super) within: f64,
    /// Mean absolute difference of a channel, codes.
    pub(super) mean: f64,
    /// Largest.
    #[allow(dead_code, reason = "for messages")]
    pub(super) worst: u8,
}

/// Compares pixels around which (3 × 3) the twin sees one instance, and the background with itself.
pub(super) fn compare(card: &Rgb8Image, twin: &Rgb8Image, gbuffer: &GBuffer) -> Difference {
    let (width, height) = (twin.width as usize, twin.height as usize);
    let instance = |x: usize, y: usize| gbuffer.samples()[y * width + x].instance;
    let (mut compared, mut within, mut sum, mut worst) = (0usize, 0usize, 0.0, 0);
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let here = instance(x, y);
            if (0..9).any(|i| instance(x + i % 3 - 1, y + i / 3 - 1) != here) {
                continue;
            }
            let i = y * width + x;
            let differences: [u8; 3] = std::array::from_fn(|c| card.pixels[i][c].abs_diff(twin.pixels[i][c]));
            let most = differences.into_iter().max().unwrap_or(0);
            compared += 1;
            within += usize::from(most <= 2);
            sum += differences.iter().map(|&d| f64::from(d)).sum::<f64>() / 3.0;
            worst = worst.max(most);
        }
    }
    let count = compared.max(1) as f64;
    Difference { compared, within: within as f64 / count, mean: sum / count, worst }
}

/// Fails unless the two agree: 99 % of the pixels within 2 codes, 0.3 codes on average. Writes both to
/// `DAPPLE_PICTURES` if that is set, for looking at them.
pub(super) fn assert_agrees(name: &str, card: &Rgb8Image, twin: &Rgb8Image, gbuffer: &GBuffer) {
    save(&format!("{name}-card"), card);
    save(&format!("{name}-twin"), twin);
    let difference = compare(card, twin, gbuffer);
    eprintln!("{name}: {difference:?}");
    assert!(difference.compared > twin.pixels.len() / 4, "{name}: {difference:?}");
    assert!(difference.within > 0.99 && difference.mean < 0.3, "{name}: {difference:?}");
}

/// Writes a picture to the folder `DAPPLE_PICTURES`, if that is set.
pub(super) fn save(name: &str, picture: &Rgb8Image) {
    if let Some(folder) = std::env::var_os("DAPPLE_PICTURES") {
        let folder = std::path::PathBuf::from(folder);
        std::fs::create_dir_all(&folder).unwrap();
        crate::testing::write_png(&folder.join(format!("{name}.png")), picture);
    }
}
