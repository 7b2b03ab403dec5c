//! The same shading on a graphics card: the twin is [`shade_cones`](super::shade_cones), and takes the same.
//!
//! - takes: a device, a [`CapTable`] of our cones, once for all viewers of a moment; then the samples of each viewer
//! - returns: a texture of outgoing radiance, in rows from the top
//!
//! Entries are found on the card, by a hash table of blocks; only those that changed are sent to it. Fragments and textures alone, as WebGL2 has them.

mod entries;
mod samples;
#[cfg(test)]
mod tests;

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use dapple_gpu::{Gpu, ReadError, join, read_texture, shader_module, wgpu};
use dapple_scene::ShadingPoint;
use dapple_store::cones::{MomentEntry, PixelPlace};
use glam::Vec3;

use self::entries::{Entries, HASH_ROW_TEXELS, ROW_TEXELS};
use super::{Blending, CapTable, Form, Samples, SlcShading};
use crate::area_lights::MAX_AREA_LIGHTS;
use crate::area_lights::table::TABLE_WIDTH;
use crate::forward::layouts::{LOADED, layout, texture, uniform};
use crate::tables::{float_table, word_table, write_layer, write_rows};

/// Four words of a table.
type Texel = [u32; 4];

/// Rows of a layer of entries: no more than WebGL2's textures have.
const MOST_LAYER_ROWS: usize = 2048;

/// Rows of entries in all: a gibibyte.
const MOST_ROWS: usize = (1 << 30) / (ROW_TEXELS * size_of::<Texel>());

/// Samples that are on the card at once: 64 MiB.
const BAND_SAMPLES: u32 = 1 << 19;

const OUT_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

/// Why cones cannot be shaded on a card.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CardError {
    /// Radiance is more than a texture of bytes holds.
    #[error("light cones: this device cannot draw into textures of floats; shade them on the processor")]
    NoFloats,
    /// More blocks of entries than textures have room for.
    #[error(
        "light cones: the cache has {found} blocks, there is room for {most} on the card: give the cache less memory"
    )]
    Blocks {
        /// Blocks of the cache, at least.
        found: usize,
        /// What there is room for.
        most: usize,
    },
    /// The picture has no pixels, or is larger than textures are, or its lists are not as long as it is large.
    #[error(
        "light cones: {samples} samples with {places} places in rows of {width} are no picture that this device can draw: there is a place a sample, rows \
         are whole, and sides 1 to {most}"
    )]
    Size {
        /// Samples there are.
        samples: usize,
        /// Places in the charts.
        places: usize,
        /// Samples of a row.
        width: usize,
        /// Longest side.
        most: usize,
    },
    /// Nothing came back.
    #[error(transparent)]
    Read(#[from] ReadError),
}

/// What one viewer sees.
#[derive(Clone, Copy, Debug)]
pub struct CardView<'a> {
    /// Samples of a row.
    pub width: usize,
    /// Samples, rows from the top: [`crate::shade::shading_points`].
    pub points: &'a [Option<ShadingPoint>],
    /// Their places in the charts: [`super::pixel_places`].
    pub pixels: &'a [Option<PixelPlace>],
}

impl CardView<'_> {
    /// Columns and rows.
    fn size(&self, gpu: &Gpu) -> Result<(u32, u32), CardError> {
        let (samples, places, width) = (self.points.len(), self.pixels.len(), self.width);
        let most = gpu.device.limits().max_texture_dimension_2d as usize;
        let height = samples.checked_div(width).unwrap_or(0);
        let fits = (1..=most).contains(&width) && (1..=most).contains(&height);
        if !fits || width * height != samples || places != samples {
            return Err(CardError::Size { samples, places, width, most });
        }
        Ok((width as u32, height as u32))
    }
}

/// `ConeParams` of `read.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct ConeUniform {
    bias: f32,
    mask: u32,
    directions: i32,
    flags: u32,
    first_row: i32,
    lights: i32,
    pad_b: [u32; 2],
}

/// Shades cones on a card. Keeps what it sent from moment to moment.
#[derive(Debug)]
pub struct ConePass {
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
    uniform: wgpu::Buffer,
    lights: wgpu::Texture,
    light_count: i32,
    entries: Entries,
    entry_table: wgpu::Texture,
    hash_table: wgpu::Texture,
    samples: wgpu::Texture,
    picture: wgpu::Texture,
}

impl ConePass {
    /// Without a cache.
    ///
    /// # Errors
    /// A device that cannot draw floats.
    pub fn new(gpu: &Gpu) -> Result<ConePass, CardError> {
        let features = gpu.adapter.get_texture_format_features(OUT_FORMAT);
        if !features.allowed_usages.contains(wgpu::TextureUsages::RENDER_ATTACHMENT) {
            return Err(CardError::NoFloats);
        }
        let layout = cone_layout(&gpu.device);
        Ok(ConePass {
            pipeline: pipeline(&gpu.device, &layout),
            layout,
            uniform: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("cones"),
                size: size_of::<ConeUniform>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            lights: float_table(gpu, "lights of cones", TABLE_WIDTH as u32, MAX_AREA_LIGHTS as u32),
            light_count: 0,
            entries: Entries::default(),
            entry_table: word_table(gpu, "cones", (ROW_TEXELS as u32, 1, 2)),
            hash_table: word_table(gpu, "blocks of cones", (HASH_ROW_TEXELS as u32, 1, 1)),
            samples: word_table(gpu, "samples of cones", (1, 1, samples::LAYERS as u32)),
            picture: picture(gpu, (1, 1)),
        })
    }

    /// Sends what changed of the entries that have a place now, and the lights. Returns the bytes sent.
    ///
    /// # Errors
    /// More blocks than there is room for, or a device that fails; then nothing is taken to be sent.
    pub fn update(&mut self, gpu: &Gpu, table: &CapTable<'_, MomentEntry>) -> Result<u64, CardError> {
        let layers = gpu.device.limits().max_texture_array_layers as usize;
        self.entries.take(table, (layers * MOST_LAYER_ROWS).min(MOST_ROWS))?;
        let lights = table.lights.map(|lights| lights.texels()).unwrap_or_default();
        if !lights.is_empty() {
            write_rows(gpu, &self.lights, 0, &lights);
        }
        self.light_count = (lights.len() / TABLE_WIDTH) as i32;
        let sent = self.send_entries(gpu) + self.send_hash(gpu) + size_of_val(&lights[..]) as u64;
        match gpu.take_fault() {
            None => Ok(sent),
            Some(fault) => {
                // Tables that there was no memory for are made anew.
                self.entry_table = word_table(gpu, "cones", (ROW_TEXELS as u32, 1, 2));
                self.hash_table = word_table(gpu, "blocks of cones", (HASH_ROW_TEXELS as u32, 1, 1));
                self.entries.forget_sent();
                Err(ReadError::Fault(fault).into())
            }
        }
    }

    fn send_entries(&mut self, gpu: &Gpu) -> u64 {
        let rows = self.entries.dirty.len();
        let held = self.entry_table.height() as usize * self.entry_table.depth_or_array_layers() as usize;
        if rows > held {
            // Two layers at least: WebGL2 takes one for a plain texture.
            let layer_rows = rows.div_ceil(2).next_power_of_two().clamp(16, MOST_LAYER_ROWS);
            let layers = rows.div_ceil(layer_rows).max(2);
            let size = (ROW_TEXELS as u32, layer_rows as u32, layers as u32);
            self.entry_table = word_table(gpu, "cones", size);
            self.entries.dirty.fill(true);
        }
        let layer_rows = self.entry_table.height() as usize;
        let mut sent = 0;
        let mut row = 0;
        while row < rows {
            let layer_end = (row / layer_rows + 1) * layer_rows;
            let run = self.entries.dirty[row..rows.min(layer_end)].iter().take_while(|dirty| **dirty).count();
            if run > 0 {
                let texels = &self.entries.texels[row * ROW_TEXELS..(row + run) * ROW_TEXELS];
                let (layer, first) = (row / layer_rows, row % layer_rows);
                write_layer(gpu, &self.entry_table, layer as u32, first as u32, texels);
                sent += size_of_val(texels) as u64;
            }
            row += run.max(1);
        }
        self.entries.dirty.fill(false);
        sent
    }

    fn send_hash(&mut self, gpu: &Gpu) -> u64 {
        if !std::mem::take(&mut self.entries.is_hash_dirty) {
            return 0;
        }
        let texels = &self.entries.hash;
        let rows = (texels.len() / HASH_ROW_TEXELS) as u32;
        if self.hash_table.height() != rows {
            self.hash_table = word_table(gpu, "blocks of cones", (HASH_ROW_TEXELS as u32, rows, 1));
        }
        write_rows(gpu, &self.hash_table, 0, texels);
        size_of_val(&texels[..]) as u64
    }

    /// Shades a view, band after band of rows; what it finds is in [`ConePass::picture`], until the next.
    ///
    /// # Errors
    /// A picture that the device cannot draw. Nothing is drawn then.
    pub fn draw(&mut self, gpu: &Gpu, view: &CardView<'_>, shading: &SlcShading) -> Result<(), CardError> {
        let (width, height) = view.size(gpu)?;
        if (self.picture.width(), self.picture.height()) != (width, height) {
            self.picture = picture(gpu, (width, height));
        }
        let rows = (BAND_SAMPLES / width).clamp(1, height);
        if (self.samples.width(), self.samples.height()) != (width, rows) {
            self.samples = word_table(gpu, "samples of cones", (width, rows, samples::LAYERS as u32));
        }
        let group = self.group(gpu);
        let target = self.picture.create_view(&wgpu::TextureViewDescriptor::default());
        let places = self.entries.hash.len() / 2;
        for first in (0..height).step_by(rows as usize) {
            let end = (first + rows).min(height);
            self.write_samples(gpu, view, shading.look_up.bias, first..end);
            let (first_row, lights) = (first as i32, self.light_count);
            let uniform = ConeUniform { first_row, lights, ..cone_uniform(shading, places) };
            gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let background = wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT);
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("cones"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &target,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: if first == 0 { background } else { wgpu::LoadOp::Load },
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..Default::default()
            });
            pass.set_viewport(0.0, 0.0, width as f32, height as f32, 0.0, 1.0);
            pass.set_scissor_rect(0, first, width, end - first);
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.draw(0..3, 0..1);
            drop(pass);
            // What is written to the queue is there before what is submitted next: a submission holds one band.
            gpu.queue.submit([encoder.finish()]);
        }
        Ok(())
    }

    /// Outgoing radiance of the last view's samples: red, green, blue, and whether there is a surface.
    pub fn picture(&self) -> &wgpu::Texture {
        &self.picture
    }

    /// Draws and reads back: what [`shade_cones`](super::shade_cones) returns.
    ///
    /// # Errors
    /// A picture that the device cannot draw, or a device that fails.
    pub async fn shade(
        &mut self,
        gpu: &Gpu,
        view: &CardView<'_>,
        shading: &SlcShading,
    ) -> Result<Vec<Vec3>, CardError> {
        self.draw(gpu, view, shading)?;
        let bytes = read_texture(gpu, &self.picture, 0).await?;
        let texels: &[[f32; 4]] = bytemuck::cast_slice(&bytes);
        Ok(texels.iter().map(|[r, g, b, _]| Vec3::new(*r, *g, *b)).collect())
    }

    fn write_samples(&self, gpu: &Gpu, view: &CardView<'_>, bias: f32, rows: Range<u32>) {
        let range = rows.start as usize * view.width..rows.end as usize * view.width;
        let texels = samples::texels(&view.points[range.clone()], &view.pixels[range.clone()], bias);
        for (layer, texels) in (0..).zip(texels.chunks_exact(range.len())) {
            write_layer(gpu, &self.samples, layer, 0, texels);
        }
    }

    fn group(&self, gpu: &Gpu) -> wgpu::BindGroup {
        let plain = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        let layers = |texture: &wgpu::Texture| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2Array),
                ..Default::default()
            })
        };
        let views =
            [layers(&self.samples), plain(&self.hash_table), layers(&self.entry_table), plain(&self.lights)];
        let mut entries =
            vec![wgpu::BindGroupEntry { binding: 0, resource: self.uniform.as_entire_binding() }];
        entries.extend((1..).zip(&views).map(|(binding, view)| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::TextureView(view),
        }));
        let layout = &self.layout;
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("cones"),
            layout,
            entries: &entries,
        })
    }
}

fn cone_uniform(shading: &SlcShading, places: usize) -> ConeUniform {
    let directions = match shading.samples {
        Samples::Adaptive => 0,
        Samples::Fixed(n) => match n {
            0..4 => 1,
            4..8 => 4,
            8..16 => 8,
            16..64 => 16,
            64.. => 64,
        },
    };
    let flags = u32::from(shading.look_up.blend)
        | u32::from(shading.form == Form::Ratio) << 1
        | u32::from(shading.blending == Blending::Cones) << 2;
    ConeUniform {
        bias: shading.look_up.bias,
        // Without a block an empty table, of one place or more.
        mask: places.max(1) as u32 - 1,
        directions,
        flags,
        first_row: 0,
        lights: 0,
        pad_b: [0; 2],
    }
}

/// The files of the pass.
fn module() -> String {
    join(&[
        include_str!("../../forward/wgsl/math.wgsl"),
        include_str!("../../area_lights/arrival.wgsl"),
        include_str!("../../area_lights/gloss.wgsl"),
        include_str!("read.wgsl"),
        include_str!("shade.wgsl"),
    ])
}

/// Group 0: `read.wgsl`.
fn cone_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let words = wgpu::TextureSampleType::Uint;
    let (plain, layers) = (wgpu::TextureViewDimension::D2, wgpu::TextureViewDimension::D2Array);
    let types = [
        uniform(false),
        texture(words, layers),
        texture(words, plain),
        texture(words, layers),
        texture(LOADED, plain),
    ];
    layout(device, "cones", &types.map(|ty| (wgpu::ShaderStages::FRAGMENT, ty)))
}

fn pipeline(device: &wgpu::Device, layout: &wgpu::BindGroupLayout) -> wgpu::RenderPipeline {
    let module = shader_module(device, "cones", &module());
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("cones"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("cones"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("cone_vertex"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("cone_fragment"),
            compilation_options: Default::default(),
            targets: &[Some(OUT_FORMAT.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn picture(gpu: &Gpu, (width, height): (u32, u32)) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("light of cones"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: OUT_FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}
