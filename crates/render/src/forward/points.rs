//! Points in the world with their values, for the view that shows them.

use dapple_gpu::{Gpu, wgpu};
use glam::Vec3;

use super::layouts::Growing;

/// Points on the card.
#[derive(Debug)]
pub struct GpuPoints {
    pub(super) buffer: Growing,
    pub(super) count: u32,
    bytes: Vec<[f32; 4]>,
}

impl GpuPoints {
    /// No points yet.
    pub fn new(gpu: &Gpu) -> GpuPoints {
        let buffer = Growing::new(&gpu.device, "points", 256, wgpu::BufferUsages::VERTEX);
        GpuPoints { buffer, count: 0, bytes: Vec::new() }
    }

    /// Replaces the points: where they are now, metres, and their values 0 … 1.
    pub fn upload(&mut self, gpu: &Gpu, points: impl IntoIterator<Item = (Vec3, f32)>) {
        self.bytes.clear();
        self.bytes.extend(points.into_iter().map(|(position, value)| position.extend(value).to_array()));
        // As many as fit into a buffer.
        self.bytes.truncate((gpu.device.limits().max_buffer_size / 32) as usize);
        self.count = self.bytes.len() as u32;
        self.buffer.write(gpu, bytemuck::cast_slice(&self.bytes));
    }
}
