//! The one owner of wgpu: a device, errors that say what to do, joined shaders, readback, timing.

mod device;
mod fault;
mod limits;
mod readback;
mod shader;
#[cfg(feature = "testing")]
pub mod testing;
#[cfg(test)]
mod tests;
pub mod timing;

pub use device::{Gpu, GpuError, GpuOptions};
pub use fault::GpuFault;
pub use readback::{ReadError, read_buffer, read_texture};
pub use shader::{join, shader_module};
pub use wgpu;
