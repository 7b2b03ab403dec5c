//! Cones shaded on a graphics card.

use anyhow::{Context, Result};
use dapple_gpu::Gpu;
use dapple_render::slc::card::{CardView, ConePass};
use dapple_render::slc::{CapTable, SlcShading};
use dapple_scene::glam::Vec3;
use dapple_store::cones::MomentEntry;

use super::{Places, Seen};

/// A card, and what it has of the cones.
pub(crate) struct Card {
    gpu: Gpu,
    pass: ConePass,
}

impl Card {
    pub(crate) fn new() -> Result<Card> {
        let instead = "slc-card needs a graphics card or a software driver; slc is the same on the processor";
        let gpu = pollster::block_on(Gpu::headless()).context(instead)?;
        let pass = ConePass::new(&gpu).context(instead)?;
        tracing::info!("cones are shaded on {}", gpu.description());
        Ok(Card { gpu, pass })
    }

    /// Radiance of every pixel of every viewer.
    pub(crate) fn shade_all(
        &mut self,
        table: &CapTable<'_, MomentEntry>,
        seen: &[Seen],
        pixels: &Places,
        shading: &SlcShading,
    ) -> Result<Vec<Vec<Vec3>>> {
        self.pass.update(&self.gpu, table)?;
        let shade = |(seen, pixels): (&Seen, &Vec<_>)| {
            let view =
                CardView { width: seen.gbuffer.width_samples() as usize, points: &seen.points, pixels };
            Ok(pollster::block_on(self.pass.shade(&self.gpu, &view, shading))?)
        };
        seen.iter().zip(pixels).map(shade).collect()
    }
}
