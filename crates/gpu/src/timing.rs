//! How long a device works: wall time around a readback, because timestamp queries are wrong on software adapters.

use crate::{Gpu, ReadError, read_texture};

/// Seconds that each of `rounds` submissions took, from the first call to `record` until a texel that depends on the
/// work is back. `now_s` is the caller's clock, seconds. `watched` is what the work writes; one extra layer copy of it is
/// part of every round, so keep it small or compare differences. The first round may contain compilation: drop it.
///
/// # Errors
/// A device that fails.
pub async fn measure(
    gpu: &Gpu,
    now_s: impl Fn() -> f64,
    rounds: u32,
    watched: &wgpu::Texture,
    mut record: impl FnMut(&mut wgpu::CommandEncoder),
) -> Result<Vec<f64>, ReadError> {
    let mut seconds = Vec::with_capacity(rounds as usize);
    for _ in 0..rounds {
        // Nothing of the last round may be left in the queue.
        gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| ReadError::Map(e.to_string()))?;
        let start = now_s();
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        record(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        read_texture(gpu, watched, 0).await?;
        seconds.push(now_s() - start);
    }
    Ok(seconds)
}
