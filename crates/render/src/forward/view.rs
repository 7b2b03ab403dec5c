//! A view's camera, background and uniform.

use dapple_gpu::wgpu;
use dapple_scene::Projection;
use glam::{DMat4, DVec3, Mat4, Vec3};

use super::ForwardError;
use super::inputs::{FrameInputs, Rect, View, ViewKind};
use super::uniforms::FrameUniform;
use crate::compose::{BACKGROUND_RGB8, PointsView};
use crate::image::ToneCurve;
use crate::projection;
use crate::shade::Ambient;

pub(super) fn inspection_background() -> wgpu::Color {
    let [r, g, b] = BACKGROUND_RGB8.map(|c| f64::from(c) / 255.0);
    wgpu::Color { r, g, b, a: 1.0 }
}

/// What is seen where there is no surface, as displayed.
pub(super) fn background(inputs: &FrameInputs<'_>) -> wgpu::Color {
    let kind = inputs.views.first().map_or(ViewKind::Beauty, |view| view.kind);
    if !kind.is_lit() {
        return inspection_background();
    }
    let dim = f64::from(dim(kind));
    let [r, g, b] = inputs.tone_map.map(inputs.shade.background).to_array().map(|linear| {
        let linear = f64::from(linear);
        let code =
            if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 };
        code * dim
    });
    wgpu::Color { r, g, b, a: 1.0 }
}

fn dim(kind: ViewKind) -> f32 {
    if kind == ViewKind::Points { PointsView::default().dim } else { 1.0 }
}

pub(super) fn frame_uniform(
    inputs: &FrameInputs<'_>,
    view: &View<'_>,
    camera: &ViewCamera,
    light_count: u32,
    area_lights: u32,
) -> FrameUniform {
    let shade = inputs.shade;
    let (sky, ground) = match shade.ambient {
        Ambient::Constant(radiance) => (radiance, radiance),
        Ambient::Hemisphere { sky, ground } => (sky, ground),
    };
    let radius_px = PointsView::default().radius_px;
    let viewport = camera.viewport;
    FrameUniform {
        clip_from_relative: camera.clip_from_relative.to_cols_array_2d(),
        eye_world: camera.eye_world.to_array(),
        view: view.kind.code(),
        axis_world: camera.axis_world.to_array(),
        is_parallel: u32::from(camera.is_parallel),
        ambient_sky: sky.to_array(),
        exposure: inputs.tone_map.exposure,
        ambient_ground: ground.to_array(),
        tone_curve: match inputs.tone_map.curve {
            ToneCurve::Clamp => 0,
            ToneCurve::Reinhard => 1,
            ToneCurve::Filmic => 2,
        },
        fade: inputs.fade.clamp(0.0, 1.0),
        specular: u32::from(shade.specular),
        light_count,
        dim: dim(view.kind),
        point_half: [radius_px / viewport.width as f32, radius_px / viewport.height as f32],
        point_half_m: radius_px * camera.pixel_m,
        area_lights,
    }
}

/// A view's camera as the pass uses it.
pub(super) struct ViewCamera {
    pub(super) index: u32,
    pub(super) viewport: Rect,
    pub(super) clip_from_world: Mat4,
    pub(super) clip_from_relative: Mat4,
    pub(super) eye_world: Vec3,
    pub(super) axis_world: Vec3,
    pub(super) is_parallel: bool,
    /// Metres a pixel at distance 1 (perspective) or anywhere (parallel).
    pub(super) pixel_m: f32,
}

impl ViewCamera {
    pub(super) fn new(view: &View<'_>, index: u32, size: (u32, u32)) -> Result<ViewCamera, ForwardError> {
        let viewport = view.viewport.unwrap_or(Rect { x: 0, y: 0, width: size.0, height: size.1 });
        let camera = &view.camera;
        let clip_from_world = projection::clip_from_world(camera, viewport.width, viewport.height)?;
        let eye_world = camera.eye_world();
        let eye = DVec3::new(f64::from(eye_world.x), f64::from(eye_world.y), f64::from(eye_world.z));
        let (is_parallel, half) = match camera.projection {
            Projection::Perspective { yfov, .. } => (false, libm::tanf(0.5 * yfov)),
            Projection::Orthographic { half_height, .. } => (true, half_height),
        };
        Ok(ViewCamera {
            index,
            viewport,
            clip_from_world: clip_from_world.as_mat4(),
            clip_from_relative: (clip_from_world * DMat4::from_translation(eye)).as_mat4(),
            eye_world,
            axis_world: camera.world_from_view.transform_vector3(Vec3::Z).normalize_or_zero(),
            is_parallel,
            pixel_m: 2.0 * half / viewport.height as f32,
        })
    }

    /// How far away a place is, metres.
    pub(super) fn distance(&self, world: Vec3) -> f32 {
        let offset = self.eye_world - world;
        if self.is_parallel { offset.dot(self.axis_world) } else { offset.length() }
    }

    pub(super) fn apply(&self, pass: &mut wgpu::RenderPass<'_>, view: &View<'_>) {
        let v = self.viewport;
        pass.set_viewport(v.x as f32, v.y as f32, v.width as f32, v.height as f32, 0.0, 1.0);
        let s = view.scissor.unwrap_or(v);
        pass.set_scissor_rect(s.x, s.y, s.width, s.height);
    }
}
