//! What passes read of the cameras: written in the order of commands, so that a submission may look from several places.

use dapple_gpu::{Gpu, wgpu};
use dapple_scene::PosedCamera;
use glam::Affine3A;

use super::plan::Sight;
use super::uniforms::{ScreenUniform, SideUniform};

/// Uniforms of the cameras.
#[derive(Debug)]
pub(super) struct Cameras {
    /// Of the whole picture, of half its resolution, and of the second camera's.
    screens: [wgpu::Buffer; 3],
    side: wgpu::Buffer,
}

/// The second camera, and its picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct SideCamera {
    pub(super) camera: PosedCamera,
    pub(super) size: (u32, u32),
    pub(super) side_from_main: Affine3A,
    /// Whether the first one's passes see half the resolution.
    pub(super) main_is_half: bool,
}

impl Cameras {
    pub(super) fn new(gpu: &Gpu) -> Cameras {
        let uniform = |label, size: usize| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        Cameras {
            screens: [(); 3].map(|()| uniform("screen", size_of::<ScreenUniform>())),
            side: uniform("second camera", size_of::<SideUniform>()),
        }
    }

    /// Lens and size of a picture.
    pub(super) fn screen(&self, sight: Sight) -> &wgpu::Buffer {
        &self.screens[match sight {
            Sight::Whole => 0,
            Sight::Half => 1,
            Sight::Beside => 2,
        }]
    }

    /// What passes of the second camera know of the first.
    pub(super) fn side(&self) -> &wgpu::Buffer {
        &self.side
    }

    /// Records that what follows looks from here.
    pub(super) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        camera: &PosedCamera,
        size: (u32, u32),
        side: Option<&SideCamera>,
    ) {
        let whole = ScreenUniform::new(camera, size);
        let [whole_buffer, half_buffer, side_buffer] = &self.screens;
        copy(gpu, encoder, whole_buffer, bytemuck::bytes_of(&whole));
        copy(gpu, encoder, half_buffer, bytemuck::bytes_of(&whole.half()));
        if let Some(side) = side {
            let beside = ScreenUniform::new(&side.camera, side.size);
            copy(gpu, encoder, side_buffer, bytemuck::bytes_of(&beside));
            let main = if side.main_is_half { whole.half() } else { whole };
            let main = SideUniform::new(main, &side.side_from_main);
            copy(gpu, encoder, &self.side, bytemuck::bytes_of(&main));
        }
    }
}

/// Records that a buffer gets these bytes, as many as it has.
fn copy(gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, to: &wgpu::Buffer, bytes: &[u8]) {
    let from = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("screen"),
        size: to.size(),
        usage: wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: true,
    });
    if let Ok(mut mapped) = from.get_mapped_range_mut(..) {
        mapped.slice(..bytes.len()).copy_from_slice(bytes);
    }
    from.unmap();
    encoder.copy_buffer_to_buffer(&from, 0, to, 0, to.size());
}
