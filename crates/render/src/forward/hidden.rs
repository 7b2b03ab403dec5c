//! Hidden surfaces of a view, some of them at random: the stochastic depth map (\[Vermeer2021\] Alg. 1).

use bytemuck::{Pod, Zeroable};
use dapple_gpu::{Gpu, wgpu};
use dapple_scene::{Pose, PosedCamera};

use super::draw::Wants;
use super::layouts;
use super::pipelines::Stage;
use super::view::ViewCamera;
use super::{Forward, ForwardError, GpuScene, LookupId, View};
use crate::gbuffer::check_scene;
use crate::sdao::MapParams;

/// Samples of the map that one drawing fills: what every card has.
pub(crate) const SAMPLES: u32 = 4;
/// Sets of samples in a row of their texture.
const SUBSETS_WIDTH: u32 = 256;

/// `HiddenParams` in `hidden.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct HiddenUniform {
    pub(super) whole: u32,
    pub(super) part: u32,
    pub(super) alpha: u32,
    pub(super) is_independent: u32,
    pub(super) seed: u32,
    pub(super) samples: u32,
    pub(super) first_sample: u32,
    pub(super) leaves_first_out: u32,
    pub(super) starts: [[u32; 4]; 5],
}

/// Four samples of the map of a view, `size` pixels large.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HiddenTarget<'a> {
    /// From where.
    pub(crate) camera: PosedCamera,
    /// Columns and rows.
    pub(crate) size: (u32, u32),
    /// What [`Forward::draw_geometry`] has drawn of the same view: depths of the first surfaces.
    pub(crate) first_depths: &'a wgpu::TextureView,
    /// Gets reversed depths in four samples a pixel, 0 where nothing was kept. [`super::GeometryTarget::DEPTH_FORMAT`].
    pub(crate) depths: &'a wgpu::TextureView,
    /// Which of the map's samples these are: the first, 0, 4, 8 or 12.
    pub(crate) first_sample: u32,
}

/// What chooses samples, on the card.
#[derive(Debug)]
pub(crate) struct HiddenChoice {
    params: MapParams,
    uniforms: Vec<wgpu::Buffer>,
    subsets: wgpu::TextureView,
}

impl HiddenChoice {
    /// The parameters must have passed [`MapParams::check`].
    pub(crate) fn new(gpu: &Gpu, params: &MapParams) -> HiddenChoice {
        let (uniform, masks) = params.on_card();
        let height = (masks.len() as u32).div_ceil(SUBSETS_WIDTH);
        let mut texels = masks;
        texels.resize((SUBSETS_WIDTH * height) as usize, 0);
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("subsets"),
            size: wgpu::Extent3d { width: SUBSETS_WIDTH, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R16Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(2 * SUBSETS_WIDTH),
            rows_per_image: None,
        };
        let bytes = bytemuck::cast_slice(&texels);
        gpu.queue.write_texture(texture.as_image_copy(), bytes, layout, texture.size());
        let uniforms = (0..params.samples.div_ceil(SAMPLES)).map(|pass| {
            let uniform = HiddenUniform { first_sample: pass * SAMPLES, ..uniform };
            layouts::buffer(&gpu.device, "hidden", bytemuck::bytes_of(&uniform), wgpu::BufferUsages::UNIFORM)
        });
        HiddenChoice {
            params: *params,
            uniforms: uniforms.collect(),
            subsets: texture.create_view(&wgpu::TextureViewDescriptor::default()),
        }
    }

    pub(crate) fn params(&self) -> &MapParams {
        &self.params
    }
}

impl Forward {
    /// Records four samples of the stochastic depth map of one view.
    ///
    /// # Errors
    /// A pose of another scene, or a camera that cannot project. Then nothing is recorded.
    pub(crate) fn draw_hidden(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        scene: &mut GpuScene,
        pose: &Pose,
        choice: &HiddenChoice,
        target: &HiddenTarget<'_>,
    ) -> Result<(), ForwardError> {
        check_scene(&scene.scene().clone(), pose)?;
        let view = View::new(target.camera, LookupId::NONE);
        let camera = ViewCamera::new(&view, 0, target.size)?;
        let Some(uniform) = choice.uniforms.get((target.first_sample / SAMPLES) as usize) else {
            return Err(ForwardError::Frame { reason: "the map has no such samples" });
        };
        scene.place(gpu, pose);
        let views = [(view, camera)];
        let frame = self.geometry_group(gpu, pose, &views);
        let [(_, camera)] = views;
        let wants = Wants { stage: Stage::Hidden, blends: false, inspects: false };
        let list = self.list(gpu, scene, &camera, wants);
        let resources = [
            uniform.as_entire_binding(),
            wgpu::BindingResource::TextureView(target.first_depths),
            wgpu::BindingResource::TextureView(&choice.subsets),
        ];
        let own = layouts::group(&gpu.device, &layouts::hidden(&gpu.device), &resources);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("hidden"),
            color_attachments: &[],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: target.depths,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_bind_group(3, &own, &[]);
        self.run(&mut pass, scene, &frame, &camera, &list);
        Ok(())
    }
}

impl MapParams {
    /// The uniform and all sets of samples by size.
    pub(super) fn on_card(&self) -> (HiddenUniform, Vec<u16>) {
        let table = crate::sdao::ChoiceTable::new(self);
        let mut starts = [[0; 4]; 5];
        for (i, start) in table.starts.iter().enumerate() {
            starts[i / 4][i % 4] = *start;
        }
        let uniform = HiddenUniform {
            whole: table.whole,
            part: table.part,
            alpha: table.alpha,
            is_independent: u32::from(self.picks == crate::sdao::Picks::Independent),
            seed: self.seed,
            samples: self.samples,
            first_sample: 0,
            leaves_first_out: u32::from(self.is_first_left_out),
            starts,
        };
        (uniform, table.masks)
    }
}
