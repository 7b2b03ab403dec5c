//! Textures and buffers back to the processor.

use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};

use crate::{Gpu, GpuFault};

/// Why nothing came back.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReadError {
    /// The device had a fault while it worked.
    #[error(transparent)]
    Fault(#[from] GpuFault),
    /// The buffer could not be mapped.
    #[error("gpu: cannot read back: {0}; the device may be lost")]
    Map(String),
    /// A texture of several samples, or of a format that has no bytes of its own.
    #[error(
        "gpu: cannot read a texture of format {format:?} with {samples} samples: resolve or copy it first"
    )]
    Texture {
        /// Its format.
        format: wgpu::TextureFormat,
        /// Samples a pixel.
        samples: u32,
    },
}

/// The bytes of the first mip level of one layer, rows from the top, without padding. The texture needs
/// `TextureUsages::COPY_SRC`. Of depth formats the depth.
///
/// # Errors
/// A texture that cannot be copied, or a device that fails.
pub async fn read_texture(gpu: &Gpu, texture: &wgpu::Texture, layer: u32) -> Result<Vec<u8>, ReadError> {
    let format = texture.format();
    let aspect = if format.is_depth_stencil_format() {
        wgpu::TextureAspect::DepthOnly
    } else {
        wgpu::TextureAspect::All
    };
    let texel_bytes = format.block_copy_size(Some(aspect));
    let (Some(texel_bytes), 1, (1, 1)) = (texel_bytes, texture.sample_count(), format.block_dimensions())
    else {
        return Err(ReadError::Texture { format, samples: texture.sample_count() });
    };
    let (width, height) = (texture.width(), texture.height());
    let row_bytes = width * texel_bytes;
    let padded = row_bytes.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let staging = staging_buffer(gpu, u64::from(padded) * u64::from(height));
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
            aspect,
        },
        wgpu::TexelCopyBufferInfo {
            buffer: &staging,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded),
                rows_per_image: None,
            },
        },
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
    gpu.queue.submit([encoder.finish()]);
    let bytes = map(gpu, &staging).await?;
    let mut rows = Vec::with_capacity(row_bytes as usize * height as usize);
    for row in bytes.chunks_exact(padded as usize) {
        rows.extend_from_slice(&row[..row_bytes as usize]);
    }
    Ok(rows)
}

/// The bytes of a buffer, whose size is a multiple of four. It needs `BufferUsages::COPY_SRC`.
///
/// # Errors
/// A device that fails.
pub async fn read_buffer(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<Vec<u8>, ReadError> {
    let staging = staging_buffer(gpu, buffer.size());
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
    gpu.queue.submit([encoder.finish()]);
    map(gpu, &staging).await
}

fn staging_buffer(gpu: &Gpu, size: u64) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("readback"),
        size,
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    })
}

async fn map(gpu: &Gpu, staging: &wgpu::Buffer) -> Result<Vec<u8>, ReadError> {
    let signal = Signal::default();
    let sender = signal.clone();
    staging.map_async(wgpu::MapMode::Read, .., move |result| sender.set(result.map_err(|e| e.to_string())));
    // Native devices work when they are polled; browsers on their own, and there this does nothing.
    if let Err(error) = gpu.device.poll(wgpu::PollType::wait_indefinitely()) {
        // Waiting fails because of what went wrong before.
        return Err(gpu.take_fault().map_or_else(|| ReadError::Map(error.to_string()), ReadError::Fault));
    }
    let mapped = signal.await;
    if let Some(fault) = gpu.take_fault() {
        return Err(fault.into());
    }
    mapped.map_err(ReadError::Map)?;
    let bytes = match staging.get_mapped_range(..) {
        Ok(view) => view.to_vec(),
        Err(e) => return Err(ReadError::Map(e.to_string())),
    };
    staging.unmap();
    Ok(bytes)
}

/// Waits for a callback.
#[derive(Clone, Default)]
struct Signal(Arc<Mutex<SignalState>>);

#[derive(Default)]
struct SignalState {
    result: Option<Result<(), String>>,
    waker: Option<Waker>,
}

impl Signal {
    fn set(&self, result: Result<(), String>) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        state.result = Some(result);
        if let Some(waker) = state.waker.take() {
            waker.wake();
        }
    }
}

impl Future for Signal {
    type Output = Result<(), String>;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match state.result.take() {
            Some(result) => Poll::Ready(result),
            None => {
                state.waker = Some(context.waker().clone());
                Poll::Pending
            }
        }
    }
}
