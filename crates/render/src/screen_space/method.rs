//! The methods by one name each.

use crate::alchemy::{self, AlchemyParams};
use crate::gbuffer::Screen;
use crate::gtao::{self, GtaoParams};
use crate::hbao::{self, HbaoParams, Horizon};
use crate::sao::{self, SaoParams};
use crate::sdao::{
    Hidden, Looks, Lookup, MapParams, SideParams, SideView, StochasticMap, check_horizon_of_two,
    estimate_ssao_of_two, estimate_visibility_of_two,
};
use crate::ssao::{self, SsaoParams};
use crate::{AfterPass, Chosen, Preset, RenderError};

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
    /// SSAO over a stochastic depth map of four samples.
    SdSsao,
    /// HBAO over such a map.
    SdHbao,
    /// HBAO+ over such a map.
    SdHbaoPlus,
}

impl ScreenKind {
    /// All, the simplest first.
    pub const ALL: [ScreenKind; 9] = [
        ScreenKind::Ssao,
        ScreenKind::Alchemy,
        ScreenKind::Sao,
        ScreenKind::Hbao,
        ScreenKind::HbaoPlus,
        ScreenKind::Gtao,
        ScreenKind::SdSsao,
        ScreenKind::SdHbao,
        ScreenKind::SdHbaoPlus,
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
            ScreenKind::SdSsao => "sd-ssao",
            ScreenKind::SdHbao => "sd-hbao",
            ScreenKind::SdHbaoPlus => "sd-hbao-plus",
        }
    }

    /// Whether a second camera can be added: where hidden surfaces are looked at, without a tangent.
    pub const fn takes_second_camera(self) -> bool {
        matches!(self, ScreenKind::SdSsao | ScreenKind::SdHbaoPlus)
    }

    /// With its defaults.
    pub fn method(self) -> ScreenMethod {
        self.preset(Preset::default()).params
    }

    /// With a preset's parameters, and the resolution that they are meant for.
    pub fn preset(self, preset: Preset) -> Chosen<ScreenMethod> {
        let stochastic = |layered| ScreenMethod::Stochastic(layered, StochasticParams::default());
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
            ScreenKind::SdSsao => of(preset.ssao(), |params| stochastic(Layered::Ssao(params))),
            ScreenKind::SdHbao => of(preset.hbao(), |params| stochastic(Layered::Hbao(params))),
            ScreenKind::SdHbaoPlus => of(preset.hbao_plus(), |params| stochastic(Layered::Hbao(params))),
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
    /// A method over a stochastic depth map.
    Stochastic(Layered, StochasticParams),
}

/// A method that can look behind the first surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Layered {
    /// Random places in a hemisphere.
    Ssao(SsaoParams),
    /// HBAO or HBAO+.
    Hbao(HbaoParams),
}

/// Which hidden surfaces there are, and what is made of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StochasticParams {
    /// The map.
    pub map: MapParams,
    /// Where it is looked at.
    pub looks: Looks,
    /// What occlusion by hidden surfaces is multiplied by, 0 … 16; default 1.
    pub compensation: f32,
    /// Where a second camera stands that has a map of its own (Alg. 3); default none. Of SSAO and HBAO+ alone.
    pub second: Option<SideParams>,
}

impl Default for StochasticParams {
    fn default() -> Self {
        StochasticParams {
            map: MapParams::default(),
            looks: Looks::default(),
            compensation: 1.0,
            second: None,
        }
    }
}

impl StochasticParams {
    /// Whether every parameter is in its range.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn check(&self) -> Result<(), RenderError> {
        self.map.check()?;
        if !(0.0..=16.0).contains(&self.compensation) {
            let found = self.compensation.into();
            return Err(RenderError::Parameter { name: "sdao: compensation", found, range: "0 to 16" });
        }
        self.second.map_or(Ok(()), |side| side.check())
    }
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
            ScreenMethod::Stochastic(Layered::Ssao(_), _) => ScreenKind::SdSsao,
            ScreenMethod::Stochastic(Layered::Hbao(params), _) => match params.horizon {
                Horizon::Highest => ScreenKind::SdHbao,
                Horizon::Mean => ScreenKind::SdHbaoPlus,
            },
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
            ScreenMethod::Stochastic(layered, stochastic) => {
                let layered = match layered {
                    Layered::Ssao(params) => Layered::Ssao(SsaoParams { radius_m, ..params }),
                    Layered::Hbao(params) => Layered::Hbao(HbaoParams { radius_m, ..params }),
                };
                ScreenMethod::Stochastic(layered, stochastic)
            }
        }
    }

    /// The same with a second camera, or without one; as it is where there can be none ([`ScreenKind::takes_second_camera`]).
    pub fn with_second_camera(self, second: Option<SideParams>) -> ScreenMethod {
        match self {
            ScreenMethod::Stochastic(layered, stochastic) if self.kind().takes_second_camera() => {
                ScreenMethod::Stochastic(layered, StochasticParams { second, ..stochastic })
            }
            other => other,
        }
    }

    /// Where its second camera stands, if it has one, at a resolution of the first one's picture: as coarse as that.
    pub fn second_camera(&self, half_resolution: bool) -> Option<SideParams> {
        match self {
            ScreenMethod::Stochastic(_, StochasticParams { second, .. }) => {
                second.map(|side| if half_resolution { side.half() } else { side })
            }
            _ => None,
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
            ScreenMethod::Stochastic(layered, stochastic) => {
                stochastic.check()?;
                match layered {
                    Layered::Ssao(params) => params.check(),
                    Layered::Hbao(params) if stochastic.second.is_some() => {
                        params.check()?;
                        check_horizon_of_two(params)
                    }
                    Layered::Hbao(params) => params.check(),
                }
            }
        }
    }

    /// The same with another seed, where it draws random numbers.
    pub fn with_seed(self, seed: u32) -> ScreenMethod {
        match self {
            ScreenMethod::Ssao(params) => ScreenMethod::Ssao(SsaoParams { seed, ..params }),
            ScreenMethod::Stochastic(layered, stochastic) => {
                let map = MapParams { seed, ..stochastic.map };
                let layered = match layered {
                    Layered::Ssao(params) => Layered::Ssao(SsaoParams { seed, ..params }),
                    other => other,
                };
                ScreenMethod::Stochastic(layered, StochasticParams { map, ..stochastic })
            }
            other => other,
        }
    }

    /// Visibility 0 … 1 of each sample of a picture, row-major from the top, 1 for the background: the method's own `estimate_visibility`. A stochastic method is given
    /// its map, and what its second camera sees; the others need none.
    ///
    /// # Errors
    /// A parameter out of its range, or a map of another picture, or none where one is needed.
    pub fn estimate_visibility(
        &self,
        screen: &Screen,
        map: Option<&StochasticMap>,
        side: Option<&SideView>,
    ) -> Result<Vec<f32>, RenderError> {
        let lookup = match self {
            ScreenMethod::Stochastic(_, StochasticParams { looks, compensation, second, .. }) => {
                RenderError::check_length("stochastic maps", usize::from(map.is_some()), 1)?;
                let cameras = usize::from(second.is_some());
                RenderError::check_length("second cameras", usize::from(side.is_some()), cameras)?;
                let hidden = map.map_or(Hidden::Nothing, Hidden::Stochastic);
                Lookup { hidden, looks: *looks, compensation: *compensation }
            }
            _ => Lookup::default(),
        };
        self.estimate_by_passes(screen, &lookup, side, &mut |_| ())
    }

    /// The same with what is known of hidden surfaces, which AlchemyAO, SAO and GTAO do not look at, and of what a second camera sees, which HBAO does not take;
    /// `after` is told the name of each pass.
    ///
    /// # Errors
    /// A parameter out of its range, or hidden surfaces of another picture, or a second camera for HBAO.
    pub fn estimate_by_passes(
        &self,
        screen: &Screen,
        lookup: &Lookup<'_>,
        side: Option<&SideView>,
        after: AfterPass<'_>,
    ) -> Result<Vec<f32>, RenderError> {
        match self {
            ScreenMethod::Ssao(params) | ScreenMethod::Stochastic(Layered::Ssao(params), _) => match side {
                Some(side) => estimate_ssao_of_two(screen, params, lookup, side, after),
                None => ssao::estimate_by_passes(screen, params, lookup, after),
            },
            ScreenMethod::Hbao(params) | ScreenMethod::Stochastic(Layered::Hbao(params), _) => match side {
                Some(side) => estimate_visibility_of_two(screen, params, lookup, side, after),
                None => hbao::estimate_by_passes(screen, params, lookup, after),
            },
            ScreenMethod::Alchemy(params) => alchemy::estimate_by_passes(screen, params, after),
            ScreenMethod::Sao(params) => sao::estimate_by_passes(screen, params, after),
            ScreenMethod::Gtao(params) => gtao::estimate_by_passes(screen, params, after),
        }
    }
}
