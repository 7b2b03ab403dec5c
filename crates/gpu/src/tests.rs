//! The plumbing, on a real device where there is one.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use crate::testing::{block_on, check_struct, gpu_for_tests, validate};
use crate::{GpuFault, ReadError, join, read_buffer, read_texture, shader_module, timing};

const CONSTANTS: &str = "const SIDE: f32 = 2.0;";
const USES_IT: &str = "
struct Sizes { side: f32, at: vec3<f32>, last: u32 }
@group(0) @binding(0) var<uniform> sizes: Sizes;
@fragment fn main() -> @location(0) vec4<f32> { return vec4(area(), sizes.at); }
fn area() -> f32 { return SIDE * sizes.side; }";

#[test]
fn files_join_in_any_order() {
    for files in [[CONSTANTS, USES_IT], [USES_IT, CONSTANTS]] {
        validate(&join(&files)).unwrap();
    }
    let error = validate(&join(&[USES_IT])).unwrap_err();
    assert!(error.contains("SIDE"), "{error}");
}

#[test]
fn layouts_are_compared() {
    let module = validate(&join(&[CONSTANTS, USES_IT])).unwrap();
    let right = [("side", 0), ("at", 16), ("last", 28)];
    check_struct(&module, "Sizes", 32, &right).unwrap();
    assert!(check_struct(&module, "Sizes", 28, &right).unwrap_err().contains("32 bytes"));
    assert!(check_struct(&module, "Sizes", 32, &right[..2]).unwrap_err().contains("members"));
    let packed = [("side", 0), ("at", 4), ("last", 28)];
    assert!(check_struct(&module, "Sizes", 32, &packed).unwrap_err().contains("lies at 16"));
    assert!(check_struct(&module, "Shape", 32, &right).unwrap_err().contains("no structure"));
}

#[test]
fn the_smallest_limits_suffice_and_smaller_ones_are_named() {
    let least = wgpu::Limits::downlevel_webgl2_defaults();
    assert_eq!(crate::limits::missing(&crate::limits::wanted(&least), &least), None);
    let tiny = wgpu::Limits { max_texture_dimension_2d: 64, max_vertex_attributes: 8, ..least };
    let missing = crate::limits::missing(&crate::limits::wanted(&tiny), &tiny).unwrap();
    assert!(missing.contains("max_vertex_attributes is 8, 16 needed"), "{missing}");
}

fn texture(gpu: &crate::Gpu, width: u32, height: u32) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 2 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rg8Unorm,
        usage: wgpu::TextureUsages::COPY_DST
            | wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    })
}

#[test]
fn textures_come_back_without_padding() {
    let Some(gpu) = gpu_for_tests() else { return };
    assert!(!gpu.description().is_empty());
    // 2 × 7 bytes a row: far from the copy alignment of 256.
    let texture = texture(&gpu, 7, 3);
    let bytes: Vec<u8> = (0..2 * 7 * 3 * 2).map(|i| i as u8).collect();
    gpu.queue.write_texture(
        texture.as_image_copy(),
        &bytes,
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(14), rows_per_image: Some(3) },
        texture.size(),
    );
    assert_eq!(block_on(read_texture(&gpu, &texture, 0)).unwrap(), bytes[..42]);
    assert_eq!(block_on(read_texture(&gpu, &texture, 1)).unwrap(), bytes[42..]);
}

#[test]
fn buffers_come_back() {
    let Some(gpu) = gpu_for_tests() else { return };
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: 12,
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    gpu.queue.write_buffer(&buffer, 4, &[1, 2, 3, 4]);
    assert_eq!(block_on(read_buffer(&gpu, &buffer)).unwrap(), [0, 0, 0, 0, 1, 2, 3, 4, 0, 0, 0, 0]);
}

#[test]
fn mistakes_reach_whoever_asks() {
    let Some(gpu) = gpu_for_tests() else { return };
    assert_eq!(gpu.take_fault(), None);
    shader_module(&gpu.device, "broken", "fn main( {");
    shader_module(&gpu.device, "broken too", "no");
    let fault = gpu.clone().take_fault().unwrap();
    assert!(matches!(&fault, GpuFault::Rejected(message) if message.contains("broken")), "{fault}");
    assert_eq!(gpu.take_fault(), None);
    // A readback does not hand out what a failed call has left behind.
    shader_module(&gpu.device, "broken again", "no");
    let texture = texture(&gpu, 1, 1);
    let error = block_on(read_texture(&gpu, &texture, 0)).unwrap_err();
    assert!(matches!(error, ReadError::Fault(GpuFault::Rejected(_))), "{error}");
}

#[test]
fn every_round_is_timed() {
    let Some(gpu) = gpu_for_tests() else { return };
    let target = texture(&gpu, 4, 4);
    let clock = std::cell::Cell::new(0.0);
    let tick = || clock.replace(clock.get() + 1.0);
    let seconds = block_on(timing::measure(&gpu, tick, 3, &target, |_| ())).unwrap();
    assert_eq!(seconds, [1.0; 3]);
}
