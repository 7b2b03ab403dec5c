//! An atlas on the card: an array texture of two or four bytes a texel, of which only what changed is written.

use dapple_gpu::{Gpu, wgpu};

use super::{ForwardError, layouts};
use crate::psao::atlas::MAX_LAYERS;

/// Rows of one layer that changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AtlasBand {
    /// Which layer.
    pub layer: u32,
    /// First row.
    pub first_row: u32,
    /// Row after the last.
    pub end_row: u32,
}

/// Square layers of texels with two or four numbers 0 … 1 each (8 bits). Two: the old value and the new one of visibility. Four: how much of
/// each of four lights is seen, or where on two of them.
#[derive(Debug)]
pub struct AtlasTexture<const BYTES: usize = 2> {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
    side: u32,
    /// Layers that were asked for; the texture may have more.
    layers: u32,
}

impl<const BYTES: usize> AtlasTexture<BYTES> {
    /// A texel of two bytes, or of four.
    const FORMAT: wgpu::TextureFormat = match BYTES {
        2 => wgpu::TextureFormat::Rg8Unorm,
        4 => wgpu::TextureFormat::Rgba8Unorm,
        _ => panic!("texels have two or four bytes"),
    };

    /// One texel and no layer in use.
    pub fn new(gpu: &Gpu) -> AtlasTexture<BYTES> {
        let (texture, view) = make(gpu, Self::FORMAT, 1, 0);
        AtlasTexture { texture, view, side: 1, layers: 0 }
    }

    /// Writes the bands of `layers`, each `side²` texels, rows from the top. A texture of another size is made anew, and
    /// written whole. Returns whether that happened, so that groups must be made anew too.
    ///
    /// # Errors
    /// A size beyond the device's limits, more layers than [`MAX_LAYERS`], or a layer of the wrong length; then nothing has changed.
    pub fn upload(
        &mut self,
        gpu: &Gpu,
        side: u32,
        layers: &[&[[u8; BYTES]]],
        bands: &[AtlasBand],
    ) -> Result<bool, ForwardError> {
        let texels = layers;
        let layers = texels.len() as u32;
        let limits = gpu.device.limits();
        // A texture may get one layer more than are wanted.
        let max_layers = (limits.max_texture_array_layers - 1).min(u32::from(MAX_LAYERS));
        if side == 0 || side > limits.max_texture_dimension_2d || layers > max_layers {
            return Err(ForwardError::AtlasTooLarge {
                side,
                layers,
                max_side: limits.max_texture_dimension_2d,
                max_layers,
            });
        }
        let expected = side as usize * side as usize;
        if let Some(layer) = texels.iter().find(|layer| layer.len() != expected) {
            return Err(ForwardError::AtlasLength { found: layer.len(), expected });
        }
        let is_new = side != self.side || layers != self.layers;
        if is_new {
            (self.texture, self.view) = make(gpu, Self::FORMAT, side, layers);
            (self.side, self.layers) = (side, layers);
            for layer in 0..layers {
                self.write(gpu, texels, AtlasBand { layer, first_row: 0, end_row: side });
            }
        } else {
            for &band in bands {
                self.write(gpu, texels, band);
            }
        }
        Ok(is_new)
    }

    fn write(&self, gpu: &Gpu, texels: &[&[[u8; BYTES]]], band: AtlasBand) {
        let end_row = band.end_row.min(self.side);
        if band.layer >= self.layers || band.first_row >= end_row {
            return;
        }
        let row = |row: u32| row as usize * self.side as usize;
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                origin: wgpu::Origin3d { x: 0, y: band.first_row, z: band.layer },
                ..self.texture.as_image_copy()
            },
            texels[band.layer as usize][row(band.first_row)..row(end_row)].as_flattened(),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(BYTES as u32 * self.side),
                rows_per_image: None,
            },
            wgpu::Extent3d { width: self.side, height: end_row - band.first_row, depth_or_array_layers: 1 },
        );
    }

    /// Bytes on the card.
    pub fn bytes(&self) -> u64 {
        let layers = u64::from(self.texture.depth_or_array_layers());
        u64::from(self.side) * u64::from(self.side) * layers * BYTES as u64
    }

    pub(super) fn view(&self) -> &wgpu::TextureView {
        &self.view
    }
}

fn make(
    gpu: &Gpu,
    format: wgpu::TextureFormat,
    side: u32,
    layers: u32,
) -> (wgpu::Texture, wgpu::TextureView) {
    let depth_or_array_layers = layouts::array_layers(layers);
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("atlas"),
        size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    });
    (texture, view)
}
