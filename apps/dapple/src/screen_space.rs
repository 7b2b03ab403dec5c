//! Methods that need a picture's depths and normals alone, or those of what is hidden, too: no server, no points, no bits.

use anyhow::Result;
use dapple_render::gbuffer::{GBuffer, Layers, Screen};
use dapple_render::sdao::{
    Lookup, MapParams, SideParams, SideView, StochasticMap, estimate_visibility_of_two,
};
use dapple_render::{alchemy, gtao, hbao, sao, ssao};
use dapple_scene::{Pose, PosedCamera, Scene};

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
    /// Over a stochastic depth map.
    Stochastic(Layered, Stochastic),
    /// Over all layers.
    Peeled(Layered),
}

/// A method that can look behind the first surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Layered {
    Ssao,
    Hbao,
    HbaoPlus,
}

/// Which stochastic depth maps there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stochastic {
    /// Of each sample of the picture: 1, 2, 4, 8 or 16.
    samples: u32,
    /// Of a second camera beside the first one, too; HBAO+ alone.
    two_cameras: bool,
    /// The paper's parameters, not those that are best here.
    paper: bool,
}

impl Stochastic {
    pub(crate) const DEFAULT: Stochastic = Stochastic { samples: 4, two_cameras: false, paper: false };
    pub(crate) const TWO_CAMERAS: Stochastic = Stochastic { two_cameras: true, ..Stochastic::DEFAULT };

    fn map(self) -> MapParams {
        if self.paper { MapParams::paper(self.samples) } else { MapParams::with_samples(self.samples) }
    }
}

/// A picture with all that was drawn.
pub(crate) struct Picture<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) pose: &'a Pose,
    pub(crate) camera: &'a PosedCamera,
    pub(crate) gbuffer: &'a GBuffer,
}

impl Layered {
    const ALL: [Layered; 3] = [Layered::Ssao, Layered::Hbao, Layered::HbaoPlus];

    fn name(self) -> &'static str {
        match self {
            Layered::Ssao => "ssao",
            Layered::Hbao => "hbao",
            Layered::HbaoPlus => "hbao-plus",
        }
    }

    fn hbao(self, radius_m: f32) -> hbao::HbaoParams {
        let params = match self {
            Layered::Hbao => hbao::HbaoParams::hbao(),
            Layered::Ssao | Layered::HbaoPlus => hbao::HbaoParams::hbao_plus(),
        };
        hbao::HbaoParams { radius_m, ..params }
    }

    fn visibility(self, screen: &Screen, lookup: &Lookup<'_>, radius_m: f32, seed: u32) -> Result<Vec<f32>> {
        Ok(match self {
            Layered::Ssao => {
                let params = ssao::SsaoParams { radius_m, seed, ..ssao::SsaoParams::default() };
                ssao::estimate_visibility_with(screen, &params, lookup)?
            }
            Layered::Hbao | Layered::HbaoPlus => {
                hbao::estimate_visibility_with(screen, &self.hbao(radius_m), lookup)?
            }
        })
    }
}

impl ScreenSpace {
    /// Those without parameters in their names, the simplest first.
    pub(crate) const ALL: [ScreenSpace; 13] = [
        ScreenSpace::Ssao,
        ScreenSpace::Alchemy,
        ScreenSpace::Sao,
        ScreenSpace::Hbao,
        ScreenSpace::HbaoPlus,
        ScreenSpace::Gtao,
        ScreenSpace::Stochastic(Layered::Ssao, Stochastic::DEFAULT),
        ScreenSpace::Stochastic(Layered::Hbao, Stochastic::DEFAULT),
        ScreenSpace::Stochastic(Layered::HbaoPlus, Stochastic::DEFAULT),
        ScreenSpace::Stochastic(Layered::HbaoPlus, Stochastic::TWO_CAMERAS),
        ScreenSpace::Peeled(Layered::Ssao),
        ScreenSpace::Peeled(Layered::Hbao),
        ScreenSpace::Peeled(Layered::HbaoPlus),
    ];

    /// By the name that `eval` and `render` give it.
    pub(crate) fn from_name(name: &str) -> Option<ScreenSpace> {
        if let Some(plain) = ScreenSpace::ALL.into_iter().find(|method| method.name() == name) {
            return Some(plain);
        }
        // sd-METHOD[-S][-mv][-paper]
        let rest = name.strip_prefix("sd-")?;
        let (rest, paper) = rest.strip_suffix("-paper").map_or((rest, false), |rest| (rest, true));
        let (rest, two_cameras) = rest.strip_suffix("-mv").map_or((rest, false), |rest| (rest, true));
        let (rest, samples) = match rest.rsplit_once('-') {
            Some((rest, digits)) if digits.starts_with(|c: char| c.is_ascii_digit()) => {
                (rest, [1, 2, 4, 8, 16].into_iter().find(|samples: &u32| samples.to_string() == digits)?)
            }
            _ => (rest, Stochastic::DEFAULT.samples),
        };
        let method = Layered::ALL.into_iter().find(|method| method.name() == rest)?;
        let is_possible = !two_cameras || method == Layered::HbaoPlus;
        is_possible.then_some(ScreenSpace::Stochastic(method, Stochastic { samples, two_cameras, paper }))
    }

    /// As `eval` and `render` name it.
    pub(crate) fn name(self) -> String {
        match self {
            ScreenSpace::Ssao => "ssao".into(),
            ScreenSpace::Alchemy => "alchemy".into(),
            ScreenSpace::Sao => "sao".into(),
            ScreenSpace::Hbao => "hbao".into(),
            ScreenSpace::HbaoPlus => "hbao-plus".into(),
            ScreenSpace::Gtao => "gtao".into(),
            ScreenSpace::Stochastic(method, Stochastic { samples, two_cameras, paper }) => {
                let samples = match samples {
                    4 => String::new(),
                    samples => format!("-{samples}"),
                };
                let [two_cameras, paper] =
                    [(two_cameras, "-mv"), (paper, "-paper")].map(|(is, says)| if is { says } else { "" });
                format!("sd-{}{samples}{two_cameras}{paper}", method.name())
            }
            ScreenSpace::Peeled(method) => format!("{}-peeled", method.name()),
        }
    }

    /// Visibility of each sample with the method's defaults; the seed is for those that draw random numbers.
    pub(crate) fn visibility(self, picture: &Picture<'_>, radius_m: f32, seed: u32) -> Result<Vec<f32>> {
        let Picture { scene, pose, camera, gbuffer } = *picture;
        let screen = &gbuffer.screen(scene, pose, camera)?;
        let alone = |method: Layered| method.visibility(screen, &Lookup::default(), radius_m, seed);
        Ok(match self {
            ScreenSpace::Ssao => alone(Layered::Ssao)?,
            ScreenSpace::Alchemy => {
                let params = alchemy::AlchemyParams { radius_m, ..alchemy::AlchemyParams::default() };
                alchemy::estimate_visibility(screen, &params)?
            }
            ScreenSpace::Sao => {
                let params = sao::SaoParams { radius_m, ..sao::SaoParams::default() };
                sao::estimate_visibility(screen, &params)?
            }
            ScreenSpace::Hbao => alone(Layered::Hbao)?,
            ScreenSpace::HbaoPlus => alone(Layered::HbaoPlus)?,
            ScreenSpace::Gtao => {
                let params = gtao::GtaoParams { radius_m, ..gtao::GtaoParams::default() };
                gtao::estimate_visibility(screen, &params)?
            }
            ScreenSpace::Stochastic(method, stochastic) => {
                let map_params = MapParams { seed, ..stochastic.map() };
                let map = StochasticMap::draw(scene, pose, camera, gbuffer, &map_params)?;
                let lookup = if stochastic.paper { Lookup::paper(&map) } else { Lookup::stochastic(&map) };
                if !stochastic.two_cameras {
                    return method.visibility(screen, &lookup, radius_m, seed);
                }
                let size = [screen.columns(), screen.rows()];
                let side = SideView::draw(scene, pose, camera, size, &SideParams::default(), &map_params)?;
                estimate_visibility_of_two(screen, &method.hbao(radius_m), &lookup, &side)?
            }
            ScreenSpace::Peeled(method) => {
                let [width, height, n] = [gbuffer.width, gbuffer.height, gbuffer.samples_per_axis];
                let layers = Layers::draw(scene, pose, camera, width, height, n)?;
                method.visibility(screen, &Lookup::peeled(&layers), radius_m, seed)?
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_they_are_written() {
        for method in ScreenSpace::ALL {
            assert_eq!(ScreenSpace::from_name(&method.name()), Some(method));
        }
        for name in [
            "sd-ssao-1",
            "sd-hbao-16",
            "sd-hbao-plus-2",
            "sd-hbao-plus-8-mv",
            "sd-hbao-plus-paper",
            "sd-hbao-plus-16-mv-paper",
        ] {
            assert_eq!(ScreenSpace::from_name(name).unwrap().name(), name);
        }
        let four = ScreenSpace::from_name("sd-hbao-plus-4").unwrap();
        assert_eq!(four.name(), "sd-hbao-plus");
        for name in
            ["sd-gtao", "sd-hbao-3", "sd-hbao-32", "sd-hbao-mv", "sd-", "sd-hbao-plus-paper-mv", "hbao-4"]
        {
            assert_eq!(ScreenSpace::from_name(name), None, "{name}");
        }
    }
}
