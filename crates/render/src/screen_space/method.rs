//! The methods by one name each.

use crate::RenderError;
use crate::alchemy::{self, AlchemyParams};
use crate::gbuffer::Screen;
use crate::gtao::{self, GtaoParams};
use crate::hbao::{self, HbaoParams, Horizon};
use crate::sao::{self, SaoParams};
use crate::ssao::{self, SsaoParams};

/// A screen-space method with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ScreenMethod {
    /// Random places in a hemisphere.
    Ssao(SsaoParams),
    /// AlchemyAO.
    Alchemy(AlchemyParams),
    /// Scalable ambient obscurance.
    Sao(SaoParams),
    /// HBAO or HBAO+.
    Hbao(HbaoParams),
    /// GTAO with a visibility bitmask.
    Gtao(GtaoParams),
}

impl ScreenMethod {
    /// All with their defaults, the simplest first.
    pub fn all() -> [ScreenMethod; 6] {
        [
            ScreenMethod::Ssao(SsaoParams::default()),
            ScreenMethod::Alchemy(AlchemyParams::default()),
            ScreenMethod::Sao(SaoParams::default()),
            ScreenMethod::Hbao(HbaoParams::hbao()),
            ScreenMethod::Hbao(HbaoParams::hbao_plus()),
            ScreenMethod::Gtao(GtaoParams::default()),
        ]
    }

    /// As programs name it: lower case, words joined by hyphens.
    pub fn name(&self) -> &'static str {
        match self {
            ScreenMethod::Ssao(_) => "ssao",
            ScreenMethod::Alchemy(_) => "alchemy",
            ScreenMethod::Sao(_) => "sao",
            ScreenMethod::Hbao(HbaoParams { horizon: Horizon::Highest, .. }) => "hbao",
            ScreenMethod::Hbao(HbaoParams { horizon: Horizon::Mean, .. }) => "hbao-plus",
            ScreenMethod::Gtao(_) => "gtao",
        }
    }

    /// The method of a name with its defaults.
    pub fn named(name: &str) -> Option<ScreenMethod> {
        ScreenMethod::all().into_iter().find(|method| method.name() == name)
    }

    /// The same with another occlusion distance, metres.
    pub fn with_radius(self, radius_m: f32) -> ScreenMethod {
        match self {
            ScreenMethod::Ssao(params) => ScreenMethod::Ssao(SsaoParams { radius_m, ..params }),
            ScreenMethod::Alchemy(params) => ScreenMethod::Alchemy(AlchemyParams { radius_m, ..params }),
            ScreenMethod::Sao(params) => ScreenMethod::Sao(SaoParams { radius_m, ..params }),
            ScreenMethod::Hbao(params) => ScreenMethod::Hbao(HbaoParams { radius_m, ..params }),
            ScreenMethod::Gtao(params) => ScreenMethod::Gtao(GtaoParams { radius_m, ..params }),
        }
    }

    /// Whether every parameter is in its range.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn check(&self) -> Result<(), RenderError> {
        match self {
            ScreenMethod::Ssao(params) => params.check(),
            ScreenMethod::Alchemy(params) => params.check(),
            ScreenMethod::Sao(params) => params.check(),
            ScreenMethod::Hbao(params) => params.check(),
            ScreenMethod::Gtao(params) => params.check(),
        }
    }

    /// Visibility 0 … 1 of each sample of a picture, row-major from the top, 1 for the background: the method's own `estimate_visibility`.
    ///
    /// # Errors
    /// A parameter out of its range.
    pub fn estimate_visibility(&self, screen: &Screen) -> Result<Vec<f32>, RenderError> {
        match self {
            ScreenMethod::Ssao(params) => ssao::estimate_visibility(screen, params),
            ScreenMethod::Alchemy(params) => alchemy::estimate_visibility(screen, params),
            ScreenMethod::Sao(params) => sao::estimate_visibility(screen, params),
            ScreenMethod::Hbao(params) => hbao::estimate_visibility(screen, params),
            ScreenMethod::Gtao(params) => gtao::estimate_visibility(screen, params),
        }
    }
}
