//! A device, or why there is none and what to do about it.

use crate::fault::Faults;
use crate::{GpuFault, limits};

/// A device with its queue. Clones are handles of the same device.
#[derive(Clone, Debug)]
pub struct Gpu {
    /// Where it came from.
    pub adapter: wgpu::Adapter,
    /// Makes resources.
    pub device: wgpu::Device,
    /// Takes work.
    pub queue: wgpu::Queue,
    faults: Faults,
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
    #[error("gpu: there is no graphics adapter: {source}. {}", advice(.has_surface))]
    NoAdapter {
        /// What wgpu tried.
        source: wgpu::RequestAdapterError,
        /// Whether it had to present to a surface.
        has_surface: bool,
    },
    /// The variable WGPU_ADAPTER_NAME asks for an adapter that there is not.
    #[error(
        "gpu: no graphics adapter has {wanted:?} in its name, as the variable WGPU_ADAPTER_NAME asks; there is {found}. \
         Set it to a part of one of these names, or unset it"
    )]
    NoSuchAdapter {
        /// What the variable says.
        wanted: String,
        /// The adapters there are, or `none`.
        found: String,
    },
    /// The adapter has less than every pass needs.
    #[error(
        "gpu: {adapter} is too small: {missing}. At least what WebGL2 guarantees is needed; update the driver, or choose \
         another adapter by the variable WGPU_ADAPTER_NAME"
    )]
    TooSmall {
        /// Which adapter.
        adapter: String,
        /// Which limits, each as `name is value, value needed`.
        missing: String,
    },
    /// The adapter refuses a device.
    #[error(
        "gpu: {adapter} refuses a device: {source}. Update the driver, close programs that hold its memory, or choose \
         another adapter by the variable WGPU_ADAPTER_NAME"
    )]
    NoDevice {
        /// Which adapter.
        adapter: String,
        /// Why.
        source: wgpu::RequestDeviceError,
    },
}

fn advice(has_surface: &bool) -> String {
    let mut advice = String::from(if cfg!(target_arch = "wasm32") {
        "Use a browser with WebGPU (Chrome or Edge 113, Safari 26, Firefox 141, or newer) or WebGL2 (any of the last \
         years), and switch hardware acceleration on in its settings"
    } else if cfg!(target_os = "linux") {
        "Install the Vulkan driver of the graphics card's vendor; without a card, Debian's and Ubuntu's package \
         mesa-vulkan-drivers draws on the processor (Fedora: mesa-vulkan-drivers, Arch: vulkan-swrast). A container \
         needs the device files of /dev/dri too"
    } else if cfg!(target_os = "windows") {
        "Install the driver of the graphics card's vendor (Direct3D 12 or Vulkan)"
    } else {
        "Metal or Vulkan is needed: update the system"
    });
    if *has_surface {
        advice.push_str(". Drawing without a window may work where drawing into one does not");
    }
    advice
}

impl Gpu {
    /// Asks for a device of `instance` that can present to `surface`, if one is given. Its limits are those of WebGL2,
    /// raised to the adapter's where passes make use of more: sizes and layers of textures, sizes of buffers, storage
    /// buffers.
    ///
    /// Outside of browsers the environment variable `WGPU_ADAPTER_NAME` chooses the first adapter with this text in its
    /// name, in letters of either case, whatever `options` prefer.
    ///
    /// # Errors
    /// No adapter, none of that name, one that is too small, or one that refuses; each says what to do.
    pub async fn request(
        instance: &wgpu::Instance,
        surface: Option<&wgpu::Surface<'_>>,
        options: &GpuOptions,
    ) -> Result<Gpu, GpuError> {
        #[cfg(not(target_arch = "wasm32"))]
        if let Some(wanted) = std::env::var("WGPU_ADAPTER_NAME").ok().filter(|wanted| !wanted.is_empty()) {
            return Gpu::from_adapter(named_adapter(instance, surface, wanted).await?).await;
        }
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
            .await
            .map_err(|source| GpuError::NoAdapter { source, has_surface: surface.is_some() })?;
        Gpu::from_adapter(adapter).await
    }

    /// A device without any surface, for tests, servers and pictures in files. OpenGL is asked only where nothing else
    /// has a device: its drivers look for a display, and complain of none on standard error.
    ///
    /// # Errors
    /// As [`Gpu::request`].
    pub async fn headless() -> Result<Gpu, GpuError> {
        let all = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
        let backends = all.backends & wgpu::Backends::PRIMARY;
        if backends != all.backends && !backends.is_empty() {
            let primary = wgpu::Instance::new(wgpu::InstanceDescriptor {
                backends,
                ..wgpu::InstanceDescriptor::new_without_display_handle_from_env()
            });
            if let Ok(gpu) = Gpu::request(&primary, None, &GpuOptions::default()).await {
                return Ok(gpu);
            }
        }
        Gpu::request(&wgpu::Instance::new(all), None, &GpuOptions::default()).await
    }

    /// A device of an adapter that was chosen elsewhere.
    ///
    /// # Errors
    /// An adapter that is too small or refuses.
    pub async fn from_adapter(adapter: wgpu::Adapter) -> Result<Gpu, GpuError> {
        let offered = adapter.limits();
        let required = limits::wanted(&offered);
        if let Some(missing) = limits::missing(&required, &offered) {
            return Err(GpuError::TooSmall { adapter: describe(&adapter), missing });
        }
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("dapple"),
            required_limits: required,
            ..Default::default()
        });
        let (device, queue) = match request.await {
            Ok(pair) => pair,
            Err(source) => return Err(GpuError::NoDevice { adapter: describe(&adapter), source }),
        };
        let faults = Faults::watch(&device);
        Ok(Gpu { adapter, device, queue, faults })
    }

    /// One line for logs and overlays: adapter, kind, interface, driver.
    pub fn description(&self) -> String {
        describe(&self.adapter)
    }

    /// The first thing that went wrong on the device since this was last asked: a rejected call or memory; or the loss of
    /// the device, which everyone who asks is told from then on. Ask once a frame: whoever does not ask sees a black
    /// picture at worst, and why in the log.
    pub fn take_fault(&self) -> Option<GpuFault> {
        self.faults.take()
    }
}

/// The first adapter with a text in its name that can present to the surface.
#[cfg(not(target_arch = "wasm32"))]
async fn named_adapter(
    instance: &wgpu::Instance,
    surface: Option<&wgpu::Surface<'_>>,
    wanted: String,
) -> Result<wgpu::Adapter, GpuError> {
    let mut adapters = instance.enumerate_adapters(wgpu::Backends::all()).await;
    adapters.retain(|adapter| surface.is_none_or(|surface| adapter.is_surface_supported(surface)));
    let names: Vec<String> = adapters.iter().map(|adapter| adapter.get_info().name).collect();
    match position_of(&names, &wanted) {
        Some(at) => Ok(adapters.swap_remove(at)),
        None => Err(no_such_adapter(wanted, &adapters.iter().map(describe).collect::<Vec<_>>())),
    }
}

/// The first name with this text in it, in letters of either case.
#[cfg(not(target_arch = "wasm32"))]
fn position_of(names: &[String], wanted: &str) -> Option<usize> {
    let wanted = wanted.to_lowercase();
    names.iter().position(|name| name.to_lowercase().contains(&wanted))
}

#[cfg(not(target_arch = "wasm32"))]
fn no_such_adapter(wanted: String, found: &[String]) -> GpuError {
    let found = if found.is_empty() { "none".to_owned() } else { found.join("; ") };
    GpuError::NoSuchAdapter { wanted, found }
}

fn describe(adapter: &wgpu::Adapter) -> String {
    let info = adapter.get_info();
    let kind = match info.device_type {
        wgpu::DeviceType::DiscreteGpu => "graphics card",
        wgpu::DeviceType::IntegratedGpu => "integrated graphics",
        wgpu::DeviceType::VirtualGpu => "virtual graphics card",
        wgpu::DeviceType::Cpu => "processor",
        wgpu::DeviceType::Other => "unknown kind",
    };
    let name = if info.name.is_empty() { "unnamed adapter" } else { &info.name };
    let mut line = format!("{name} ({kind}, {}", info.backend);
    for part in [&info.driver, &info.driver_info] {
        if !part.is_empty() {
            line.push_str(", ");
            line.push_str(part);
        }
    }
    line.push(')');
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adapters_are_chosen_by_a_part_of_their_name() {
        let names = ["NVIDIA GeForce RTX 4070", "llvmpipe (LLVM 19.1)", "LLVMpipe again"].map(str::to_owned);
        for (wanted, at) in [("llvmpipe", 1), ("LlvmPipe", 1), ("rtx", 0), ("again", 2)] {
            assert_eq!(position_of(&names, wanted), Some(at), "{wanted}");
        }
        assert_eq!(position_of(&names, "radeon"), None);
        let message = no_such_adapter("radeon".to_owned(), &names).to_string();
        assert!(message.contains("radeon") && message.contains("RTX 4070; llvmpipe"), "{message}");
        assert!(no_such_adapter("radeon".to_owned(), &[]).to_string().contains("there is none"));
    }
}
