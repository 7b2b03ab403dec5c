//! A window's surface and the device that draws to it.

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use dapple_gpu::wgpu::{self, CurrentSurfaceTexture, TextureFormat};
use dapple_gpu::{Gpu, GpuFault, GpuOptions};
use winit::event_loop::ActiveEventLoop;
use winit::window::Window;

/// A window that can be drawn to.
pub(super) struct Screen {
    pub(super) gpu: Gpu,
    pub(super) window: Arc<Window>,
    instance: wgpu::Instance,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    /// What pictures are written as: plain, because the viewer encodes by itself.
    format: TextureFormat,
}

/// A picture that can be drawn and then shown.
pub(super) struct Canvas {
    texture: wgpu::SurfaceTexture,
    pub(super) view: wgpu::TextureView,
}

/// What there is to draw to.
pub(super) enum Next {
    /// A picture.
    Canvas(Canvas),
    /// Nothing now, the system wants none.
    Nothing,
    /// Nothing now, and soon again: the surface was set up anew for its window.
    Again,
    /// Nothing: the surface is lost, but for all one knows not the device. [`Screen::renew_surface`] makes another.
    SurfaceLost,
    /// Nothing: the device failed.
    Fault(GpuFault),
}

impl Screen {
    /// A device for the window.
    pub(super) fn open(event_loop: &ActiveEventLoop, window: Arc<Window>) -> Result<Screen> {
        let display = Box::new(event_loop.owned_display_handle());
        let instance =
            wgpu::Instance::new(wgpu::InstanceDescriptor::new_with_display_handle_from_env(display));
        let surface = instance.create_surface(window.clone()).context("the window cannot be drawn to")?;
        let options = GpuOptions { high_performance: true };
        let gpu = pollster::block_on(Gpu::request(&instance, Some(&surface), &options))?;
        let formats = surface.get_capabilities(&gpu.adapter).formats;
        let plain =
            |format: TextureFormat| matches!(format, TextureFormat::Rgba8Unorm | TextureFormat::Bgra8Unorm);
        let chosen = formats
            .iter()
            .find(|format| plain(**format))
            .or_else(|| formats.iter().find(|format| plain(format.remove_srgb_suffix())));
        let Some(&chosen) = chosen else {
            bail!("the window offers no format of 8 bits a channel (it has {formats:?}); use --headless");
        };
        let format = chosen.remove_srgb_suffix();
        let size = window.inner_size();
        let config = wgpu::SurfaceConfiguration {
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            format: chosen,
            color_space: wgpu::SurfaceColorSpace::Auto,
            width: size.width.max(1),
            height: size.height.max(1),
            present_mode: wgpu::PresentMode::Fifo,
            desired_maximum_frame_latency: 2,
            alpha_mode: wgpu::CompositeAlphaMode::Auto,
            view_formats: if format == chosen { Vec::new() } else { vec![format] },
        };
        surface.configure(&gpu.device, &config);
        Ok(Screen { gpu, window, instance, surface, config, format })
    }

    /// Format of what is drawn to.
    pub(super) fn format(&self) -> TextureFormat {
        self.format
    }

    /// Pixels, width and height.
    pub(super) fn size(&self) -> (u32, u32) {
        (self.config.width, self.config.height)
    }

    /// Takes on a size in pixels, within what the device can do.
    pub(super) fn resize(&mut self, (width, height): (u32, u32)) {
        let most = self.gpu.device.limits().max_texture_dimension_2d;
        let (width, height) = (width.clamp(1, most), height.clamp(1, most));
        if (width, height) != self.size() {
            (self.config.width, self.config.height) = (width, height);
            self.surface.configure(&self.gpu.device, &self.config);
        }
    }

    /// The next picture to draw.
    ///
    /// # Errors
    /// A surface that refuses although the device is sound.
    pub(super) fn next(&self) -> Result<Next> {
        let texture = match self.surface.get_current_texture() {
            CurrentSurfaceTexture::Success(texture) | CurrentSurfaceTexture::Suboptimal(texture) => texture,
            CurrentSurfaceTexture::Timeout | CurrentSurfaceTexture::Occluded => return Ok(Next::Nothing),
            CurrentSurfaceTexture::Outdated => {
                self.surface.configure(&self.gpu.device, &self.config);
                return Ok(Next::Again);
            }
            // Both may be the first that is heard of a lost device.
            CurrentSurfaceTexture::Lost => {
                return Ok(self.gpu.take_fault().map_or(Next::SurfaceLost, Next::Fault));
            }
            CurrentSurfaceTexture::Validation => match self.gpu.take_fault() {
                Some(fault) => return Ok(Next::Fault(fault)),
                None => bail!("the window cannot be drawn to any more"),
            },
        };
        let view = texture
            .texture
            .create_view(&wgpu::TextureViewDescriptor { format: Some(self.format), ..Default::default() });
        Ok(Next::Canvas(Canvas { texture, view }))
    }

    /// Makes another surface for the window, on the same device.
    ///
    /// # Errors
    /// A window that cannot be drawn to any more.
    pub(super) fn renew_surface(&mut self) -> Result<()> {
        let window = self.window.clone();
        self.surface =
            self.instance.create_surface(window).context("the window cannot be drawn to any more")?;
        self.surface.configure(&self.gpu.device, &self.config);
        Ok(())
    }

    /// Shows a picture that was drawn.
    pub(super) fn present(&self, canvas: Canvas) {
        self.window.pre_present_notify();
        self.gpu.queue.present(canvas.texture);
    }
}
