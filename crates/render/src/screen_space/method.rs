//! The methods by one name each.

use crate::alchemy::{self, AlchemyParams};
use crate::gbuffer::Screen;
use crate::gtao::{self, GtaoParams};
use crate::hbao::{self, HbaoParams, Horizon};
use crate::sao::{self, SaoParams};
use crate::ssao::{self, SsaoParams};
use crate::{Chosen, Preset, RenderError};

/// Which method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ScreenKind {
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
    /// GTAO with a visibility bitmask.
    Gtao,
}

impl ScreenKind {
    /// All, the simplest first.
    pub const ALL: [ScreenKind; 6] = [
        ScreenKind::Ssao,
        ScreenKind::Alchemy,
        ScreenKind::Sao,
        ScreenKind::Hbao,
        ScreenKind::HbaoPlus,
        ScreenKind::Gtao,
    ];

    /// As programs name it: lower case, words joined by hyphens.
    pub const fn name(self) -> &'static str {
        match self {
            ScreenKind::Ssao => "ssao",
            ScreenKind::Alchemy => "alchemy",
            ScreenKind::Sao => "sao",
            ScreenKind::Hbao => "hbao",
            ScreenKind::HbaoPlus => "hbao-plus",
            ScreenKind::Gtao => "gtao",
        }
    }

    /// With its defaults.
    pub fn method(self) -> ScreenMethod {
        self.preset(Preset::default()).params
    }

    /// With a preset's parameters, and the resolution that they are meant for.
    pub fn preset(self, preset: Preset) -> Chosen<ScreenMethod> {
        fn of<P>(chosen: Chosen<P>, method: impl Fn(P) -> ScreenMethod) -> Chosen<ScreenMethod> {
            Chosen { params: method(chosen.params), half_resolution: chosen.half_resolution }
        }
        match self {
            ScreenKind::Ssao => of(preset.ssao(), ScreenMethod::Ssao),
            ScreenKind::Alchemy => of(preset.alchemy(), ScreenMethod::Alchemy),
            ScreenKind::Sao => of(preset.sao(), ScreenMethod::Sao),
            ScreenKind::Hbao => of(preset.hbao(), ScreenMethod::Hbao),
            ScreenKind::HbaoPlus => of(preset.hbao_plus(), ScreenMethod::Hbao),
            ScreenKind::Gtao => of(preset.gtao(), ScreenMethod::Gtao),
        }
    }
}

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
    /// Which it is.
    pub fn kind(&self) -> ScreenKind {
        match self {
            ScreenMethod::Ssao(_) => ScreenKind::Ssao,
            ScreenMethod::Alchemy(_) => ScreenKind::Alchemy,
            ScreenMethod::Sao(_) => ScreenKind::Sao,
            ScreenMethod::Hbao(HbaoParams { horizon: Horizon::Highest, .. }) => ScreenKind::Hbao,
            ScreenMethod::Hbao(HbaoParams { horizon: Horizon::Mean, .. }) => ScreenKind::HbaoPlus,
            ScreenMethod::Gtao(_) => ScreenKind::Gtao,
        }
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
