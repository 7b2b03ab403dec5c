//! A device, or why there is none and what to do about it.

/// A device with its queue.
#[derive(Clone, Debug)]
pub struct Gpu {
    /// Where it came from.
    pub adapter: wgpu::Adapter,
    /// Makes resources.
    pub device: wgpu::Device,
    /// Takes work.
    pub queue: wgpu::Queue,
}

/// What kind of device is wanted.
#[derive(Clone, Copy, Debug, Default)]
pub struct GpuOptions {
    /// Prefer the strongest adapter over the most economical.
    pub high_performance: bool,
}

/// Why there is no device.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// No driver offers an adapter.
    #[error("gpu: no adapter: {0}")]
    NoAdapter(#[from] wgpu::RequestAdapterError),
    /// The adapter refuses a device.
    #[error("gpu: no device: {0}")]
    NoDevice(#[from] wgpu::RequestDeviceError),
}

impl Gpu {
    /// Asks for a device of `instance` that can present to `surface`, if one is given.
    pub async fn request(
        instance: &wgpu::Instance,
        surface: Option<&wgpu::Surface<'_>>,
        options: &GpuOptions,
    ) -> Result<Gpu, GpuError> {
        let power_preference = if options.high_performance {
            wgpu::PowerPreference::HighPerformance
        } else {
            wgpu::PowerPreference::None
        };
        let adapter = instance
            .request_adapter(&wgpu::RequestAdapterOptions {
                power_preference,
                compatible_surface: surface,
                ..Default::default()
            })
            .await?;
        let (device, queue) = adapter
            .request_device(&wgpu::DeviceDescriptor {
                required_limits: wgpu::Limits::downlevel_webgl2_defaults().using_resolution(adapter.limits()),
                ..Default::default()
            })
            .await?;
        Ok(Gpu { adapter, device, queue })
    }
}
