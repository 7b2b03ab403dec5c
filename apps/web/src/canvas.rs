//! A canvas to draw on: a device of one of the browser's two interfaces, and what it presents.

use dapple_gpu::wgpu::{self, CurrentSurfaceTexture, TextureFormat};
use dapple_gpu::{Gpu, GpuOptions};
use web_sys::HtmlCanvasElement;

use crate::names::Backend;

/// A canvas with its device.
pub(crate) struct Screen {
    pub(crate) gpu: Gpu,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
}

impl Screen {
    /// Takes `canvas` for one backend. A canvas that was drawn on by other means is refused by the browser.
    pub(crate) async fn open(canvas: HtmlCanvasElement, backend: Backend) -> Result<Screen, String> {
        let mut reasons = Vec::new();
        if backend != Backend::WebGl2 {
            match webgpu().await {
                Ok((instance, gpu)) => return Screen::present(&instance, gpu, canvas),
                Err(reason) => reasons.push(format!("WebGPU: {reason}")),
            }
        }
        if backend != Backend::WebGpu {
            let instance = instance(wgpu::Backends::GL);
            match instance.create_surface(wgpu::SurfaceTarget::Canvas(canvas.clone())) {
                // This interface finds its device by the canvas.
                Ok(surface) => match Gpu::request(&instance, Some(&surface), &GpuOptions::default()).await {
                    Ok(gpu) => return Screen::configure(gpu, surface, &canvas),
                    Err(error) => reasons.push(format!("WebGL2: {error}")),
                },
                // All that can be in the way of a fresh canvas; wgpu's message is for programmers.
                Err(_) => {
                    reasons.push(
                        "WebGL2: this browser does not offer it, or has no graphics card for it".to_owned(),
                    );
                }
            }
        }
        Err(reasons.join("; "))
    }

    fn present(instance: &wgpu::Instance, gpu: Gpu, canvas: HtmlCanvasElement) -> Result<Screen, String> {
        let target = wgpu::SurfaceTarget::Canvas(canvas.clone());
        let surface = instance.create_surface(target).map_err(|error| error.to_string())?;
        Screen::configure(gpu, surface, &canvas)
    }

    fn configure(
        gpu: Gpu,
        surface: wgpu::Surface<'static>,
        canvas: &HtmlCanvasElement,
    ) -> Result<Screen, String> {
        let formats = surface.get_capabilities(&gpu.adapter).formats;
        // The viewer encodes by itself, so that both interfaces show the same.
        let plain =
            |format: &&TextureFormat| matches!(format, TextureFormat::Rgba8Unorm | TextureFormat::Bgra8Unorm);
        let format =
            *formats.iter().find(plain).ok_or("the canvas offers no format of 8 plain bits a channel")?;
        let config = wgpu::SurfaceConfiguration {
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            format,
            color_space: wgpu::SurfaceColorSpace::Auto,
            width: canvas.width().max(1),
            height: canvas.height().max(1),
            present_mode: wgpu::PresentMode::Fifo,
            desired_maximum_frame_latency: 2,
            alpha_mode: wgpu::CompositeAlphaMode::Opaque,
            view_formats: Vec::new(),
        };
        surface.configure(&gpu.device, &config);

        Ok(Screen { gpu, surface, config })
    }

    /// Format of what is drawn to.
    pub(crate) fn format(&self) -> TextureFormat {
        self.config.format
    }

    /// Pixels, width and height.
    pub(crate) fn size(&self) -> (u32, u32) {
        (self.config.width, self.config.height)
    }

    /// Takes on a size in pixels, within what the device can do.
    pub(crate) fn resize(&mut self, width: u32, height: u32) {
        let most = self.gpu.device.limits().max_texture_dimension_2d;
        let (width, height) = (width.clamp(1, most), height.clamp(1, most));
        if (width, height) != self.size() {
            (self.config.width, self.config.height) = (width, height);
            self.surface.configure(&self.gpu.device, &self.config);
        }
    }

    /// Lets `draw` draw the next picture and shows it; false if the browser wants none now.
    pub(crate) fn draw<E: std::fmt::Display>(
        &self,
        draw: impl FnOnce(&Gpu, &wgpu::TextureView) -> Result<(), E>,
    ) -> Result<bool, String> {
        let texture = match self.surface.get_current_texture() {
            CurrentSurfaceTexture::Success(texture) | CurrentSurfaceTexture::Suboptimal(texture) => texture,
            CurrentSurfaceTexture::Timeout | CurrentSurfaceTexture::Occluded => return Ok(false),
            CurrentSurfaceTexture::Outdated | CurrentSurfaceTexture::Lost => {
                self.surface.configure(&self.gpu.device, &self.config);
                return Ok(false);
            }
            CurrentSurfaceTexture::Validation => {
                // It may be the first that is heard of a lost device.
                let fault = self.gpu.take_fault();
                return Err(fault.map_or("the canvas cannot be drawn to".to_owned(), |f| f.to_string()));
            }
        };
        let view = texture.texture.create_view(&wgpu::TextureViewDescriptor::default());
        draw(&self.gpu, &view).map_err(|error| error.to_string())?;
        self.gpu.queue.present(texture);
        Ok(true)
    }
}

fn instance(backends: wgpu::Backends) -> wgpu::Instance {
    wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    })
}

/// A device by WebGPU. The canvas is not touched before there is one: a canvas serves one interface for life.
async fn webgpu() -> Result<(wgpu::Instance, Gpu), String> {
    if !wgpu::util::is_browser_webgpu_supported().await {
        return Err("this browser does not offer it, or has no graphics card for it".to_owned());
    }
    let instance = instance(wgpu::Backends::BROWSER_WEBGPU);
    let gpu =
        Gpu::request(&instance, None, &GpuOptions::default()).await.map_err(|error| error.to_string())?;
    Ok((instance, gpu))
}
