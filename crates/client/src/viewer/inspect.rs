//! What debug views show of the atlas: what texels are made of, and when they last changed.

use dapple_gpu::Gpu;
use dapple_render::forward::{AtlasBand, ForwardError, GpuScene};
use dapple_render::psao::atlas::VisibilityAtlas;

/// Seconds after which a texel counts as old.
const OLDEST_S: f64 = 10.0;
/// Seconds between two uploads of ages.
const AGES_EVERY_S: f64 = 0.1;

/// Figures a texel, made only while a view shows them.
#[derive(Default)]
pub(super) struct Inspection {
    /// When each texel last changed, seconds; empty while nobody asks.
    changed_s: Vec<f32>,
    shown: Shown,
}

/// What lies on the card.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Shown {
    #[default]
    Nothing,
    /// Weights of the atlas when so many of its sets were ready.
    Weights(usize),
    /// Ages at a time.
    Ages(f64),
}

impl Inspection {
    /// Forgets all: the atlas is another one.
    pub(super) fn reset(&mut self) {
        *self = Inspection::default();
    }

    /// What lies on the card is no longer right: texels are others'.
    pub(super) fn forget_shown(&mut self) {
        self.shown = Shown::Nothing;
    }

    /// Notes the texels of dirty bands that are changing.
    pub(super) fn note(&mut self, atlas: &VisibilityAtlas, bands: &[AtlasBand], now_s: f64) {
        if self.changed_s.is_empty() {
            return;
        }
        let texels = atlas.all_texels();
        self.changed_s.resize(texels.len(), f32::NEG_INFINITY);
        let side = atlas.side() as usize;
        for band in bands {
            let row = |row: u32| (band.layer as usize * side + row as usize) * side;
            let range = row(band.first_row)..row(band.end_row);
            for (changed, [old, new]) in self.changed_s[range.clone()].iter_mut().zip(&texels[range]) {
                if old != new {
                    *changed = now_s as f32;
                }
            }
        }
    }

    /// Brings weights onto the card, unless they are there.
    pub(super) fn show_weights(
        &mut self,
        gpu: &Gpu,
        gpu_scene: &mut GpuScene,
        atlas: &VisibilityAtlas,
    ) -> Result<(), ForwardError> {
        let now = Shown::Weights(atlas.ready_count());
        if self.shown == now {
            return Ok(());
        }
        let mut texels = Vec::with_capacity(atlas.all_texels().len());
        for layer in 0..atlas.layers() {
            let infos = atlas.texel_infos(layer);
            texels.extend(
                infos.iter().map(|info| [info.weights, info.heaviest.saturating_sub(1).min(255) as u8]),
            );
        }
        upload(gpu, gpu_scene, atlas, &texels)?;
        self.shown = now;
        Ok(())
    }

    /// Brings ages onto the card, ten times a second.
    pub(super) fn show_ages(
        &mut self,
        gpu: &Gpu,
        gpu_scene: &mut GpuScene,
        atlas: &VisibilityAtlas,
        now_s: f64,
    ) -> Result<(), ForwardError> {
        if matches!(self.shown, Shown::Ages(then) if (0.0..AGES_EVERY_S).contains(&(now_s - then))) {
            return Ok(());
        }
        self.changed_s.resize(atlas.all_texels().len(), f32::NEG_INFINITY);
        let age = |&changed_s: &f32| {
            let part = (now_s - f64::from(changed_s)) / OLDEST_S;
            [(part.clamp(0.0, 1.0) * 255.0) as u8, 0]
        };
        let texels: Vec<[u8; 2]> = self.changed_s.iter().map(age).collect();
        upload(gpu, gpu_scene, atlas, &texels)?;
        self.shown = Shown::Ages(now_s);
        Ok(())
    }
}

fn upload(
    gpu: &Gpu,
    gpu_scene: &mut GpuScene,
    atlas: &VisibilityAtlas,
    texels: &[[u8; 2]],
) -> Result<(), ForwardError> {
    let bands = (0..atlas.layers()).map(|layer| AtlasBand { layer, first_row: 0, end_row: atlas.side() });
    let bands: Vec<AtlasBand> = bands.collect();
    let area = atlas.side() as usize * atlas.side() as usize;
    let layers: Vec<&[[u8; 2]]> = texels.chunks_exact(area).collect();
    gpu_scene.upload_inspection(gpu, atlas.side(), &layers, &bands)
}
