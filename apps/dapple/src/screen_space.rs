//! Methods that need a picture's depths and normals alone: no server, no points, no bits.

use anyhow::Result;
use dapple_render::gbuffer::Screen;
use dapple_render::{alchemy, gtao, hbao, sao, ssao};

/// Which of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ScreenSpace {
    /// Random places in a hemisphere.
    Ssao,
    /// AlchemyAO.
    Alchemy,
    /// Scalable ambient obscurance.
    Sao,
    /// Horizon-based.
    Hbao,
    /// HBAO+.
    HbaoPlus,
    /// Ground-truth ambient occlusion with a visibility bitmask.
    Gtao,
}

impl ScreenSpace {
    /// All, the simplest first.
    pub(crate) const ALL: [ScreenSpace; 6] = [
        ScreenSpace::Ssao,
        ScreenSpace::Alchemy,
        ScreenSpace::Sao,
        ScreenSpace::Hbao,
        ScreenSpace::HbaoPlus,
        ScreenSpace::Gtao,
    ];

    /// As `eval` and `render` name it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            ScreenSpace::Ssao => "ssao",
            ScreenSpace::Alchemy => "alchemy",
            ScreenSpace::Sao => "sao",
            ScreenSpace::Hbao => "hbao",
            ScreenSpace::HbaoPlus => "hbao-plus",
            ScreenSpace::Gtao => "gtao",
        }
    }

    /// Visibility of each sample with the method's defaults; the seed is for those that draw random numbers.
    pub(crate) fn visibility(self, screen: &Screen, radius_m: f32, seed: u32) -> Result<Vec<f32>> {
        Ok(match self {
            ScreenSpace::Ssao => {
                let params = ssao::SsaoParams { radius_m, seed, ..ssao::SsaoParams::default() };
                ssao::estimate_visibility(screen, &params)?
            }
            ScreenSpace::Alchemy => {
                let params = alchemy::AlchemyParams { radius_m, ..alchemy::AlchemyParams::default() };
                alchemy::estimate_visibility(screen, &params)?
            }
            ScreenSpace::Sao => {
                let params = sao::SaoParams { radius_m, ..sao::SaoParams::default() };
                sao::estimate_visibility(screen, &params)?
            }
            ScreenSpace::Hbao => {
                let params = hbao::HbaoParams { radius_m, ..hbao::HbaoParams::hbao() };
                hbao::estimate_visibility(screen, &params)?
            }
            ScreenSpace::HbaoPlus => {
                let params = hbao::HbaoParams { radius_m, ..hbao::HbaoParams::hbao_plus() };
                hbao::estimate_visibility(screen, &params)?
            }
            ScreenSpace::Gtao => {
                let params = gtao::GtaoParams { radius_m, ..gtao::GtaoParams::default() };
                gtao::estimate_visibility(screen, &params)?
            }
        })
    }
}
