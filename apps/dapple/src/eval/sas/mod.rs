//! Shading atlas streaming as a rival ([Mueller2018] as [Neff2023] sec. 4 uses it): visibility in patches of two triangles, in an
//! atlas that goes to the client as video. See README.md.

mod atlas;
mod patches;
mod server;
#[cfg(test)]
mod tests;
mod video;

use std::sync::Arc;

use anyhow::Result;
use dapple_client::Drawn;
use dapple_scene::Scene;

pub(super) use server::{SasParams, SasServer};

use atlas::Block;
use patches::Patches;
use video::Receiver;

/// Patches of all instances, both sides of each, under one number.
#[derive(Debug, Clone)]
struct Numbers {
    /// By mesh.
    patches: Vec<Arc<Patches>>,
    /// By instance: number of its first patch, and its mesh.
    first: Vec<(u32, u32)>,
    count: u32,
}

impl Numbers {
    fn new(scene: &Scene) -> Numbers {
        let patches: Vec<Arc<Patches>> =
            scene.meshes.iter().map(|mesh| Arc::new(Patches::new(mesh))).collect();
        let mut count = 0;
        let mut first = Vec::with_capacity(scene.instances.len());
        for instance in &scene.instances {
            first.push((count, instance.mesh));
            count += 2 * patches[instance.mesh as usize].patches.len() as u32;
        }
        Numbers { patches, first, count }
    }

    /// The patch of a place in a triangle of an instance, and where it is in the patch.
    fn find(
        &self,
        instance: u32,
        triangle: u32,
        weights: [f32; 2],
        is_back: bool,
    ) -> Option<(u32, [f32; 2])> {
        let (first, mesh) = *self.first.get(instance as usize)?;
        let (patch, at) = self.patches[mesh as usize].find(triangle, weights)?;
        Some((first + 2 * patch + u32::from(is_back), at))
    }
}

/// Where patches lie in the atlas: what a server sends beside the video, by number.
pub(super) type Blocks = Arc<Vec<Option<Block>>>;

/// What a step sends.
pub(super) struct SasFrame {
    /// One picture of the video.
    pub(super) video: Vec<u8>,
    /// Not counted, as in the paper.
    pub(super) blocks: Blocks,
}

/// What a step did.
pub(super) struct SasStep {
    /// Nothing where nothing changed.
    pub(super) frame: Option<SasFrame>,
    pub(super) rays: u64,
}

/// The receiving end: the latest picture, and where patches lie in it.
pub(super) struct SasClient {
    numbers: Numbers,
    size: (u32, u32),
    receiver: Receiver,
    luma: Vec<u8>,
    blocks: Blocks,
}

impl SasClient {
    pub(super) fn of(server: &SasServer) -> Result<SasClient> {
        Ok(SasClient {
            numbers: server.numbers().clone(),
            size: server.size(),
            receiver: Receiver::new()?,
            luma: Vec::new(),
            blocks: Blocks::default(),
        })
    }

    /// Takes a picture of the video, and where patches lie in it.
    pub(super) fn receive(&mut self, video: &[u8], blocks: Blocks) -> Result<()> {
        self.luma = self.receiver.decode(video, self.size)?;
        self.blocks = blocks;
        Ok(())
    }

    /// One visibility a sample; open where no patch was sent.
    pub(super) fn visibility(&self, drawn: &Drawn) -> Vec<f32> {
        use rayon::prelude::*;
        drawn
            .gbuffer
            .samples()
            .par_iter()
            .with_min_len(1024)
            .map(|sample| {
                if !sample.is_covered() {
                    return 1.0;
                }
                let (instance, triangle) = (sample.instance, sample.triangle);
                let back = sample.is_back_face();
                self.numbers
                    .find(instance, triangle, sample.barycentrics, back)
                    .and_then(|(number, at)| Some((self.blocks.get(number as usize).copied()??, at)))
                    .map_or(1.0, |(block, at)| self.look(block, at))
            })
            .collect()
    }

    /// Bilinear between the centres of texels; beyond the outermost ones as there.
    fn look(&self, block: Block, [u, v]: [f32; 2]) -> f32 {
        let row = self.size.0 as usize;
        let split = |at: f32, side: u16| {
            let at = (at * f32::from(side) - 0.5).clamp(0.0, f32::from(side - 1));
            let low = (at as u16).min(side - 2);
            (usize::from(low), at - f32::from(low))
        };
        let ((x, tx), (y, ty)) = (split(u, block.width), split(v, block.height));
        let first = (usize::from(block.y) + y) * row + usize::from(block.x) + x;
        let texel = |dx: usize, dy: usize| {
            f32::from(self.luma.get(first + dy * row + dx).copied().unwrap_or(u8::MAX))
        };
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let (above, below) = (mix(texel(0, 0), texel(1, 0), tx), mix(texel(0, 1), texel(1, 1), tx));
        mix(above, below, ty) / 255.0
    }
}
