//! The one owner of wgpu: a device, errors that say what to do, joined shaders, readback, timing.

mod device;

pub use device::{Gpu, GpuError, GpuOptions};
pub use wgpu;
