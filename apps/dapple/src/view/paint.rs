//! The overlay's library, tied to window and device.

use dapple_gpu::wgpu;
use egui_wgpu::{Renderer, RendererOptions, ScreenDescriptor};
use winit::event::WindowEvent;
use winit::window::Window;

use super::screen::Screen;

/// Draws an overlay over pictures.
pub(super) struct Painter {
    context: egui::Context,
    input: egui_winit::State,
    renderer: Renderer,
    /// What panels leave free of the window, in the overlay's units.
    free: egui::Rect,
}

impl Painter {
    pub(super) fn new(screen: &Screen) -> Painter {
        let context = egui::Context::default();
        context.set_theme(egui::Theme::Dark);
        let most = screen.gpu.device.limits().max_texture_dimension_2d as usize;
        let scale = screen.window.scale_factor() as f32;
        let input = egui_winit::State::new(
            context.clone(),
            egui::ViewportId::ROOT,
            &*screen.window,
            Some(scale),
            None,
            Some(most),
        );
        let renderer = Renderer::new(&screen.gpu.device, screen.format(), RendererOptions::default());
        Painter { context, input, renderer, free: egui::Rect::EVERYTHING }
    }

    /// Hands an event to the overlay.
    pub(super) fn tell(&mut self, window: &Window, event: &WindowEvent) {
        let _ = self.input.on_window_event(window, event);
    }

    /// Whether the overlay lies over a pixel. The library itself only knows where the pointer was when it was last laid
    /// out, which may be long ago.
    pub(super) fn covers(&self, (x, y): (f64, f64)) -> bool {
        let at = egui::pos2(x as f32, y as f32) / self.context.pixels_per_point();
        let above = self.context.layer_id_at(at).is_some_and(|layer| layer.order != egui::Order::Background);
        above || !self.free.contains(at)
    }

    /// Whether it moves by itself.
    pub(super) fn wants_repaint(&self) -> bool {
        self.context.has_requested_repaint()
    }

    /// Lays the overlay out and draws it over what `view` holds.
    pub(super) fn paint<T>(
        &mut self,
        screen: &Screen,
        view: &wgpu::TextureView,
        mut lay: impl FnMut(&mut egui::Ui) -> Option<T>,
    ) -> Option<T> {
        let input = self.input.take_egui_input(&screen.window);
        let mut wish = None;
        // A layout may be made twice; what it asks for is wished once.
        let mut output = self.context.run_ui(input, |ui| {
            wish = lay(ui).or(wish.take());
            self.free = ui.available_rect_before_wrap();
        });
        self.input.handle_platform_output(&screen.window, output.platform_output);
        let (width, height) = screen.size();
        let descriptor =
            ScreenDescriptor { size_in_pixels: [width, height], pixels_per_point: output.pixels_per_point };
        let triangles = self.context.tessellate(output.shapes, output.pixels_per_point);
        let (device, queue) = (&screen.gpu.device, &screen.gpu.queue);
        #[allow(clippy::iter_over_hash_type, reason = "textures are independent of each other")]
        for (id, deltas) in output.textures_delta.set.drain() {
            for delta in deltas {
                self.renderer.update_texture(device, queue, id, &delta);
            }
        }
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut commands = self.renderer.update_buffers(device, queue, &mut encoder, &triangles, &descriptor);
        let mut pass = encoder
            .begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("overlay"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
                })],
                ..Default::default()
            })
            .forget_lifetime();
        self.renderer.render(&mut pass, &triangles, &descriptor);
        drop(pass);
        commands.push(encoder.finish());
        queue.submit(commands);
        #[allow(clippy::iter_over_hash_type, reason = "textures are independent of each other")]
        for id in output.textures_delta.free.drain() {
            self.renderer.free_texture(&id);
        }
        wish
    }
}
