//! Depths and normals of a view, for methods that look at the picture alone.

use dapple_gpu::{Gpu, wgpu};
use dapple_scene::{Pose, PosedCamera};

use super::draw::{FRAME_STRIDE, Wants, frame_group};
use super::layouts;
use super::pipelines::{DEPTH_FORMAT, NORMAL_FORMAT, Stage};
use super::view::{ViewCamera, frame_uniform};
use super::{Forward, ForwardError, FrameInputs, GpuScene, LookupId, Transparency, View};
use crate::gbuffer::check_scene;
use crate::image::ToneMap;
use crate::shade::ShadeParams;

/// One view's textures, each `size` pixels large.
#[derive(Clone, Copy, Debug)]
pub struct GeometryTarget<'a> {
    /// From where.
    pub camera: PosedCamera,
    /// Columns and rows.
    pub size: (u32, u32),
    /// Gets the unit normals of triangles in the world on the viewer's side, each component as (*n* + 1) / 2, and 1; zero where there is nothing.
    /// [`GeometryTarget::NORMAL_FORMAT`]. None where depths are all that is wanted.
    pub normals: Option<&'a wgpu::TextureView>,
    /// Gets depths, reversed: 0 is the background. [`GeometryTarget::DEPTH_FORMAT`].
    pub depths: &'a wgpu::TextureView,
}

impl GeometryTarget<'_> {
    /// Of the normals: ten bits a component, a tenth of a degree.
    pub const NORMAL_FORMAT: wgpu::TextureFormat = NORMAL_FORMAT;
    /// Of the depths.
    pub const DEPTH_FORMAT: wgpu::TextureFormat = DEPTH_FORMAT;
}

impl Forward {
    /// Records depths and normals of views, as [`crate::gbuffer::GBuffer::screen`] has them at one sample a pixel. Materials whose alpha is blended
    /// are cut out at one half. A submission may hold any number of these calls, each with its own cameras, and one pose.
    ///
    /// # Errors
    /// A pose of another scene, a camera that cannot project, or a size beyond the device's. Then nothing is recorded.
    pub fn draw_geometry(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        scene: &mut GpuScene,
        pose: &Pose,
        targets: &[GeometryTarget<'_>],
    ) -> Result<(), ForwardError> {
        check_scene(&scene.scene().clone(), pose)?;
        let largest = gpu.device.limits().max_texture_dimension_2d;
        let mut views = Vec::with_capacity(targets.len());
        for (target, index) in targets.iter().zip(0..) {
            if [target.size.0, target.size.1].iter().any(|side| !(1..=largest).contains(side)) {
                let reason = "the picture has no pixels, or more than the device allows";
                return Err(ForwardError::Frame { reason });
            }
            let view = View::new(target.camera, LookupId::NONE);
            views.push((view, ViewCamera::new(&view, index, target.size)?));
        }
        scene.place(gpu, pose);
        let group = self.geometry_group(gpu, pose, &views);
        for (target, (_, camera)) in targets.iter().zip(&views) {
            let stage = if target.normals.is_some() { Stage::Geometry } else { Stage::Depths };
            let wants = Wants { stage, blends: false, inspects: false };
            let list = self.list(gpu, scene, camera, wants);
            let normals = target.normals.map(|view| {
                Some(wgpu::RenderPassColorAttachment {
                    view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        store: wgpu::StoreOp::Store,
                    },
                })
            });
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("geometry"),
                color_attachments: normals.as_slice(),
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
            self.run(&mut pass, scene, &group, camera, &list);
        }
        Ok(())
    }

    /// Group 0 of passes over views that light does not matter to. Each has a small buffer of its own, so that a submission may look from several places.
    pub(super) fn geometry_group(
        &self,
        gpu: &Gpu,
        pose: &Pose,
        views: &[(View<'_>, ViewCamera)],
    ) -> wgpu::BindGroup {
        let shade = ShadeParams::default();
        let inputs = FrameInputs {
            pose,
            shade: &shade,
            tone_map: ToneMap::default(),
            transparency: Transparency::Cutout,
            fade: 1.0,
            views: &[],
        };
        let mut bytes = vec![0u8; FRAME_STRIDE * views.len()];
        for (slot, (view, camera)) in bytes.chunks_exact_mut(FRAME_STRIDE).zip(views) {
            let uniform = frame_uniform(&inputs, view, camera, 0, 0);
            slot[..size_of_val(&uniform)].copy_from_slice(bytemuck::bytes_of(&uniform));
        }
        let frames = layouts::buffer(&gpu.device, "geometry frames", &bytes, wgpu::BufferUsages::UNIFORM);
        frame_group(gpu, &self.frame_layout, &frames, &self.lights, &self.shadows)
    }
}
