//! Which bindings each group has, and small makers of resources.

use dapple_gpu::wgpu;

/// Entries of one group, numbered in order.
pub(crate) fn layout(
    device: &wgpu::Device,
    label: &str,
    entries: &[(wgpu::ShaderStages, wgpu::BindingType)],
) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = entries
        .iter()
        .zip(0..)
        .map(|(&(visibility, ty), binding)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility,
            ty,
            count: None,
        })
        .collect();
    device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

pub(crate) const fn uniform(has_dynamic_offset: bool) -> wgpu::BindingType {
    wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset,
        min_binding_size: None,
    }
}

pub(crate) const fn texture(
    sample_type: wgpu::TextureSampleType,
    view_dimension: wgpu::TextureViewDimension,
) -> wgpu::BindingType {
    wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false }
}

const FILTERED: wgpu::TextureSampleType = wgpu::TextureSampleType::Float { filterable: true };
pub(crate) const LOADED: wgpu::TextureSampleType = wgpu::TextureSampleType::Float { filterable: false };
const SAMPLER: wgpu::BindingType = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);

use wgpu::ShaderStages as Stages;
use wgpu::TextureViewDimension as Dimension;

/// Group 0 of the forward pass: `frame.wgsl`.
pub(super) fn frame(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entries = [
        (Stages::VERTEX_FRAGMENT, uniform(true)),
        (Stages::FRAGMENT, uniform(false)),
        (Stages::FRAGMENT, texture(wgpu::TextureSampleType::Depth, Dimension::D2Array)),
        (Stages::FRAGMENT, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Comparison)),
    ];
    layout(device, "frame", &entries)
}

/// Group 0 of shadow maps: `caster.wgsl`.
pub(super) fn face(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    layout(device, "shadow face", &[(Stages::VERTEX, uniform(true))])
}

/// Group 1: `material.wgsl`.
pub(super) fn material(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let mut entries = vec![(Stages::FRAGMENT, uniform(false))];
    for _ in 0..4 {
        entries.push((Stages::FRAGMENT, texture(FILTERED, Dimension::D2)));
        entries.push((Stages::FRAGMENT, SAMPLER));
    }
    layout(device, "material", &entries)
}

/// Group 2: `deform.wgsl`, `vertex.wgsl` and `area_lights/reflect.wgsl`.
pub(super) fn surface(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entries = [
        (Stages::VERTEX, texture(LOADED, Dimension::D2)),
        (Stages::VERTEX, texture(LOADED, Dimension::D2)),
        (Stages::VERTEX, texture(wgpu::TextureSampleType::Uint, Dimension::D2)),
        (Stages::VERTEX_FRAGMENT, texture(FILTERED, Dimension::D2Array)),
        (Stages::FRAGMENT, SAMPLER),
        (Stages::FRAGMENT, texture(FILTERED, Dimension::D2Array)),
        (Stages::FRAGMENT, texture(FILTERED, Dimension::D2Array)),
        (Stages::FRAGMENT, texture(LOADED, Dimension::D2)),
    ];
    layout(device, "surface", &entries)
}

/// Group 3 of hidden surfaces: `hidden.wgsl`.
pub(super) fn hidden(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entries = [
        (Stages::FRAGMENT, uniform(false)),
        (Stages::FRAGMENT, texture(LOADED, Dimension::D2)),
        (Stages::FRAGMENT, texture(wgpu::TextureSampleType::Uint, Dimension::D2)),
    ];
    layout(device, "hidden", &entries)
}

/// The two pictures that `error.wgsl` compares.
pub(super) fn error(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    layout(device, "error", &[(Stages::FRAGMENT, texture(LOADED, Dimension::D2)); 2])
}

/// A group of a layout whose bindings are numbered in order.
pub(super) fn group(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    resources: &[wgpu::BindingResource<'_>],
) -> wgpu::BindGroup {
    let entries: Vec<_> = resources
        .iter()
        .zip(0..)
        .map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

/// How many layers a texture gets that is read as an array: WebGL2 takes one layer for a plain texture, and a multiple of six
/// for a cube.
pub(super) fn array_layers(wanted: u32) -> u32 {
    let layers = wanted.max(2);
    if layers.is_multiple_of(6) { layers + 1 } else { layers }
}

/// A buffer with these bytes (padded to a multiple of four; never empty).
pub(super) fn buffer(
    device: &wgpu::Device,
    label: &str,
    bytes: &[u8],
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    let size = (bytes.len() as u64).next_multiple_of(4).max(4);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: true,
    });
    if let Ok(mut mapped) = buffer.get_mapped_range_mut(..) {
        mapped.slice(..bytes.len()).copy_from_slice(bytes);
    }
    buffer.unmap();
    buffer
}

/// A buffer that is written anew each frame and grows when it must.
#[derive(Debug)]
pub(super) struct Growing {
    label: &'static str,
    usage: wgpu::BufferUsages,
    pub(super) buffer: wgpu::Buffer,
}

impl Growing {
    pub(super) fn new(
        device: &wgpu::Device,
        label: &'static str,
        size: u64,
        usage: wgpu::BufferUsages,
    ) -> Growing {
        let usage = usage | wgpu::BufferUsages::COPY_DST;
        let buffer = Growing::make(device, label, size, usage);
        Growing { label, usage, buffer }
    }

    fn make(device: &wgpu::Device, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage,
            mapped_at_creation: false,
        })
    }

    /// Writes bytes (a multiple of four) from the start; returns whether the buffer is another one now.
    pub(super) fn write(&mut self, gpu: &dapple_gpu::Gpu, bytes: &[u8]) -> bool {
        let grows = bytes.len() as u64 > self.buffer.size();
        if grows {
            let size = (bytes.len() as u64 * 3 / 2).next_multiple_of(256);
            self.buffer = Growing::make(&gpu.device, self.label, size, self.usage);
        }
        if !bytes.is_empty() {
            gpu.queue.write_buffer(&self.buffer, 0, bytes);
        }
        grows
    }
}
