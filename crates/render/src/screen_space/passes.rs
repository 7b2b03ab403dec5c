//! A method's passes on the card, and what they write.

use dapple_gpu::{Gpu, wgpu};
use dapple_scene::{Pose, PosedCamera};

use super::bindings::{Kit, Resource, group, lookup_layout};
use super::cameras::{Cameras, SideCamera};
use super::method::ScreenMethod;
use super::plan::{Image, hidden_layers, padded_size, seen_size};
use super::steps::Plan;
use super::textures::can_draw_maps;
use crate::RenderError;
use crate::forward::{
    Forward, ForwardError, GeometryTarget, GpuScene, HIDDEN_SAMPLES, HiddenChoice, HiddenTarget, Lookup,
    LookupId,
};
use crate::gbuffer::GuardBand;
use crate::sdao::side_from_main;

/// One screen-space method on a card: draws depths and normals of a view, runs the method over them, and lets the forward pass look the result up. Keeps what it makes
/// from frame to frame.
#[derive(Debug)]
pub struct ScreenPasses {
    lookup: LookupId,
    kit: Kit,
    cameras: Cameras,
    choice: Option<HiddenChoice>,
    plan: Option<Plan>,
}

/// What a method is to do for one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScreenView {
    /// The picture's camera.
    pub camera: PosedCamera,
    /// Its columns and rows.
    pub size: (u32, u32),
    /// The method and its parameters.
    pub method: ScreenMethod,
    /// What is drawn beyond the picture, where things block, too.
    pub guard: GuardBand,
    /// Whether a quarter of the samples is estimated ([`crate::upsample`]).
    pub half_resolution: bool,
}

impl ScreenView {
    /// Columns and rows with the guard band.
    pub(super) fn guarded(&self) -> (u32, u32) {
        self.guard.size([self.size.0, self.size.1]).into()
    }

    /// Columns and rows of the second camera's picture, if there is one.
    pub(super) fn side_size(&self) -> Option<(u32, u32)> {
        let side = self.method.second_camera(self.half_resolution)?;
        Some(side.size(self.guarded().into()).into())
    }

    /// The second camera beside one with the guard band.
    fn side_camera(&self, main: &PosedCamera) -> Result<Option<SideCamera>, RenderError> {
        let Some(side) = self.method.second_camera(self.half_resolution) else { return Ok(None) };
        let (columns, rows) = self.guarded();
        let camera = side.camera(main, f64::from(columns) / f64::from(rows))?;
        let size = side.size([columns, rows]).into();
        let side_from_main = side_from_main(main, &camera);
        Ok(Some(SideCamera { camera, size, side_from_main, main_is_half: self.half_resolution }))
    }
}

impl ScreenPasses {
    /// How the forward pass looks up what a method has found: give it to [`Forward::new`].
    pub fn lookup(gpu: &Gpu) -> Lookup {
        Lookup {
            label: "screen space",
            wgsl: vec![include_str!("wgsl/lookup.wgsl")],
            needs_rest: false,
            layout: Some(lookup_layout(&gpu.device)),
        }
    }

    /// Prepares to serve one look-up of a forward pass, which was made with [`ScreenPasses::lookup`].
    ///
    /// # Errors
    /// A device that cannot draw into textures of floats.
    pub fn new(gpu: &Gpu, lookup: LookupId) -> Result<ScreenPasses, ForwardError> {
        let formats = [Image::Distances(0), Image::Value(0), Image::Picture].map(Image::format);
        let draws = |format: wgpu::TextureFormat| {
            let features = gpu.adapter.get_texture_format_features(format);
            features.allowed_usages.contains(wgpu::TextureUsages::RENDER_ATTACHMENT)
        };
        if !formats.into_iter().all(draws) {
            let reason = "this device cannot draw into textures of floats, which screen-space methods need";
            return Err(ForwardError::Frame { reason });
        }
        Ok(ScreenPasses { lookup, kit: Kit::new(gpu), cameras: Cameras::new(gpu), choice: None, plan: None })
    }

    /// Lets go of the textures of the last picture.
    pub fn release(&mut self) {
        self.plan = None;
    }

    /// Whether the device can run a method at all: some cannot draw stochastic depth maps.
    ///
    /// # Errors
    /// What it lacks.
    pub fn check_device(gpu: &Gpu, method: &ScreenMethod) -> Result<(), ForwardError> {
        if hidden_layers(method) > 0 && !can_draw_maps(gpu) {
            let reason = "this device cannot read samples of depths, which stochastic depth maps need (WebGL2 \
                          never can): choose a method without sd- in its name";
            return Err(ForwardError::Frame { reason });
        }
        Ok(())
    }

    /// Records the method's passes for a picture and gives `forward` the result for its look-up. The view's camera and size, and the pose, must be those that the
    /// picture is then drawn with. The geometry is drawn anew, with the guard band. A submission may hold any number of these calls, from any cameras, of one pose; each
    /// overwrites what the last one found.
    ///
    /// # Errors
    /// A parameter out of its range, or what [`Forward::draw_geometry`] refuses. Then nothing is recorded.
    pub fn draw(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        forward: &mut Forward,
        scene: &mut GpuScene,
        pose: &Pose,
        view: &ScreenView,
    ) -> Result<(), ForwardError> {
        self.draw_geometry(gpu, encoder, forward, scene, pose, view)?;
        for step in 0..self.steps().count() {
            self.record_step(encoder, step);
        }
        Ok(())
    }

    /// The first part of [`ScreenPasses::draw`]: depths and normals. After it [`ScreenPasses::record_step`] records the passes one by one.
    ///
    /// # Errors
    /// Those of [`ScreenPasses::draw`].
    pub fn draw_geometry(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        forward: &mut Forward,
        scene: &mut GpuScene,
        pose: &Pose,
        view: &ScreenView,
    ) -> Result<(), ForwardError> {
        view.method.check()?;
        let mut view = *view;
        if let (ScreenMethod::Sao(params), wgpu::Backend::Gl) =
            (&mut view.method, gpu.adapter.get_info().backend)
        {
            // Of textures that are not filtered GLES 3 reads the first level alone.
            params.levels = 0;
        }
        let view = &view;
        let largest = gpu.device.limits().max_texture_dimension_2d;
        let size = view.guarded();
        let padded = padded_size(&view.method, seen_size(size, view.half_resolution));
        let widest = size.0.max(size.1).max(padded.0).max(padded.1);
        if view.size.0 == 0 || view.size.1 == 0 || widest > largest {
            let reason = "the picture has no pixels, or with its guard band more than the device allows: make it smaller";
            return Err(ForwardError::Frame { reason });
        }
        let camera = view.guard.camera(&view.camera, view.size.1);
        let side = view.side_camera(&camera)?;
        let map = match &view.method {
            ScreenMethod::Stochastic(_, stochastic) => Some(&stochastic.map),
            _ => None,
        };
        ScreenPasses::check_device(gpu, &view.method)?;
        if let Some(map) = map.filter(|map| self.choice.as_ref().map(HiddenChoice::params) != Some(map)) {
            self.choice = Some(HiddenChoice::new(gpu, map));
        }
        let is_current = self.plan.as_ref().is_some_and(|plan| plan.serves(view));
        if !is_current {
            self.plan = Some(Plan::new(gpu, &mut self.kit, &self.cameras, view));
        }
        let Some(plan) = &self.plan else { return Ok(()) };
        let target = GeometryTarget { camera, size, normals: Some(&plan.normals), depths: &plan.depths };
        let mut targets = vec![target];
        if let (Some(side), Some(depths)) = (&side, &plan.side_depths) {
            targets.push(GeometryTarget { camera: side.camera, size: side.size, normals: None, depths });
        }
        forward.draw_geometry(gpu, encoder, scene, pose, &targets)?;
        let mut maps = vec![(camera, size, &plan.depths, &plan.maps)];
        if let Some(side) = &side {
            // Where no first surface is left out none is read.
            let first_depths = plan.side_depths.as_ref().unwrap_or(&self.kit.blank);
            maps.push((side.camera, side.size, first_depths, &plan.side_maps));
        }
        for (camera, size, first_depths, layers) in maps {
            for (depths, index) in layers.iter().zip(0..) {
                let Some(choice) = &self.choice else { break };
                let first_sample = index * HIDDEN_SAMPLES;
                let target = HiddenTarget { camera, size, first_depths, depths, first_sample };
                forward.draw_hidden(gpu, encoder, scene, pose, choice, &target)?;
            }
        }
        self.cameras.record(gpu, encoder, &camera, size, side.as_ref());
        let view = plan.picture.create_view(&Default::default());
        forward.bind_lookup(
            self.lookup,
            group(&gpu.device, &self.kit.lookup_layout, &[(0, Resource::Texture(&view))]),
        );
        Ok(())
    }

    /// What the passes are called, in order; several may have one name. None before the first picture.
    pub fn steps(&self) -> impl Iterator<Item = &'static str> + '_ {
        self.plan.iter().flat_map(|plan| plan.steps.iter().map(|step| step.label))
    }

    /// Records one of the passes of the last [`ScreenPasses::draw_geometry`]; nothing where there is none of this number.
    pub fn record_step(&self, encoder: &mut wgpu::CommandEncoder, index: usize) {
        let Some(step) = self.plan.as_ref().and_then(|plan| plan.steps.get(index)) else { return };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(step.label),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &step.target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
            ..Default::default()
        });
        pass.set_viewport(0.0, 0.0, step.size.0 as f32, step.size.1 as f32, 0.0, 1.0);
        pass.set_pipeline(&step.pipeline);
        for (index, group) in (0..).zip(&step.groups) {
            pass.set_bind_group(index, group, &[]);
        }
        pass.draw(0..3, 0..1);
    }

    /// What the last picture's method found: visibility and distance of each pixel.
    pub fn picture(&self) -> Option<&wgpu::Texture> {
        self.plan.as_ref().map(|plan| &plan.picture)
    }

    /// Distances of the last picture's hidden surfaces, metres, and of the second camera's: four a texel and layer, 1e30 where there is none.
    #[cfg(test)]
    pub(super) fn hidden(&self) -> Option<&[wgpu::Texture; 2]> {
        self.plan.as_ref().map(|plan| &plan.hidden)
    }
}
