//! Methods that need a picture's depths and normals alone, or those of what is hidden, too: no server, no points, no bits.

use std::time::{Duration, Instant};

use anyhow::Result;
use dapple_render::gbuffer::{GBuffer, GuardBand, Layers, Screen};
use dapple_render::sdao::{
    Lookup, MapParams, SideParams, SideView, StochasticMap, estimate_visibility_of_two,
};
use dapple_render::{AfterPass, Chosen, Preset, RenderError, alchemy, gtao, hbao, sao, ssao, upsample};
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
    pub(crate) samples: u32,
    /// Of a second camera beside the first one, too; HBAO+ alone.
    pub(crate) two_cameras: bool,
    /// The paper's parameters, not those that are best here.
    pub(crate) paper: bool,
}

impl Stochastic {
    pub(crate) const DEFAULT: Stochastic = Stochastic { samples: 4, two_cameras: false, paper: false };
    pub(crate) const TWO_CAMERAS: Stochastic = Stochastic { two_cameras: true, ..Stochastic::DEFAULT };

    fn map(self) -> MapParams {
        if self.paper { MapParams::paper(self.samples) } else { MapParams::with_samples(self.samples) }
    }
}

impl Layered {
    pub(crate) const ALL: [Layered; 3] = [Layered::Ssao, Layered::Hbao, Layered::HbaoPlus];

    /// As it is without hidden surfaces.
    pub(crate) fn single(self) -> ScreenSpace {
        match self {
            Layered::Ssao => ScreenSpace::Ssao,
            Layered::Hbao => ScreenSpace::Hbao,
            Layered::HbaoPlus => ScreenSpace::HbaoPlus,
        }
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Layered::Ssao => "ssao",
            Layered::Hbao => "hbao",
            Layered::HbaoPlus => "hbao-plus",
        }
    }

    /// Parameters of HBAO or HBAO+, and whether they are meant for half the resolution.
    fn hbao(self, preset: Preset, radius_m: f32) -> Chosen<hbao::HbaoParams> {
        let Chosen { params, half_resolution } = match self {
            Layered::Hbao => preset.hbao(),
            Layered::Ssao | Layered::HbaoPlus => preset.hbao_plus(),
        };
        Chosen { params: hbao::HbaoParams { radius_m, ..params }, half_resolution }
    }
}

/// What is known of hidden surfaces.
enum Known {
    Nothing,
    Map(StochasticMap),
    Layers(Layers),
}

impl Known {
    fn lookup(&self, is_paper: bool) -> Lookup<'_> {
        match self {
            Known::Nothing => Lookup::default(),
            Known::Map(map) if is_paper => Lookup::paper(map),
            Known::Map(map) => Lookup::stochastic(map),
            Known::Layers(layers) => Lookup::peeled(layers),
        }
    }

    fn half(&self) -> Known {
        match self {
            Known::Nothing => Known::Nothing,
            Known::Map(map) => Known::Map(map.half()),
            Known::Layers(layers) => Known::Layers(layers.half()),
        }
    }
}

/// How much work a method does, and how far beyond the picture it sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Effort {
    pub(crate) preset: Preset,
    /// The preset's where it is not said.
    pub(crate) half_resolution: Option<bool>,
    /// Part of the picture's height.
    pub(crate) guard_band: f32,
    /// What occlusion by hidden surfaces is multiplied by, 1.
    pub(crate) compensation: f32,
    /// Samples of the picture along a side of one of a second camera's, 1.
    pub(crate) second_coarseness: u32,
}

impl Default for Effort {
    fn default() -> Self {
        Effort {
            preset: Preset::default(),
            half_resolution: None,
            guard_band: Effort::GUARD_BAND,
            compensation: 1.0,
            second_coarseness: 1,
        }
    }
}

impl Effort {
    /// Default guard band, a part of the picture's height: chosen by measurement, see `docs/evaluation.md`.
    pub(crate) const GUARD_BAND: f32 = 0.1;
}

/// What a method looks at.
pub(crate) struct Sight<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) pose: &'a Pose,
    pub(crate) camera: &'a PosedCamera,
    /// The picture, without a guard band.
    pub(crate) gbuffer: &'a GBuffer,
    pub(crate) radius_m: f32,
    /// For those that draw random numbers.
    pub(crate) seed: u32,
}

/// One visibility a sample of the picture, and what it took beside drawing the picture itself.
pub(crate) struct Estimate {
    pub(crate) visibility: Vec<f32>,
    /// All passes, and of drawing the picture with its guard band the band's part by its samples: a client draws once.
    pub(crate) time: Duration,
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

    /// Visibility of a picture, with its guard band and at the resolution that is asked for.
    pub(crate) fn estimate(self, sight: &Sight<'_>, effort: Effort) -> Result<Estimate> {
        let Sight { scene, pose, camera, gbuffer, .. } = *sight;
        let size = [gbuffer.width, gbuffer.height];
        let band = GuardBand::of_height(effort.guard_band, gbuffer.height)?;
        let start = Instant::now();
        if band.pixels() == 0 {
            let screen = gbuffer.screen(scene, pose, camera)?;
            let visibility = self.on_screen(&screen, sight, effort, &mut |_| ())?;
            return Ok(Estimate { visibility, time: start.elapsed() });
        }
        let wide = band.rasterize(scene, pose, camera, size, gbuffer.samples_per_axis)?;
        let drawing = start.elapsed();
        let wide_camera = band.camera(camera, gbuffer.height);
        let screen = wide.screen(scene, pose, &wide_camera)?;
        let wide_sight = Sight { gbuffer: &wide, camera: &wide_camera, ..*sight };
        let visibility = self.on_screen(&screen, &wide_sight, effort, &mut |_| ())?;
        let visibility = band.crop(&visibility, size, gbuffer.samples_per_axis)?;
        let of_picture = drawing.mul_f64(1.0 - band.part(size));
        Ok(Estimate { visibility, time: start.elapsed() - of_picture })
    }

    /// Visibility of each sample of what is seen, which is that of `sight`'s picture and camera; `after` is told the name of each pass.
    pub(crate) fn on_screen(
        self,
        screen: &Screen,
        sight: &Sight<'_>,
        effort: Effort,
        after: AfterPass<'_>,
    ) -> Result<Vec<f32>, RenderError> {
        let (preset, radius_m) = (effort.preset, sight.radius_m);
        let half = |of_preset: bool| effort.half_resolution.unwrap_or(of_preset);
        match self {
            ScreenSpace::Alchemy => {
                let Chosen { params, half_resolution } = preset.alchemy();
                let params = alchemy::AlchemyParams { radius_m, ..params };
                let run = |s: &Screen, after: AfterPass<'_>| alchemy::estimate_by_passes(s, &params, after);
                at(screen, half(half_resolution), run, after)
            }
            ScreenSpace::Sao => {
                let Chosen { params, half_resolution } = preset.sao();
                let params = sao::SaoParams { radius_m, ..params };
                let run = |s: &Screen, after: AfterPass<'_>| sao::estimate_by_passes(s, &params, after);
                at(screen, half(half_resolution), run, after)
            }
            ScreenSpace::Gtao => {
                let Chosen { params, half_resolution } = preset.gtao();
                let params = gtao::GtaoParams { radius_m, ..params };
                let run = |s: &Screen, after: AfterPass<'_>| gtao::estimate_by_passes(s, &params, after);
                at(screen, half(half_resolution), run, after)
            }
            ScreenSpace::Ssao => layered(Layered::Ssao, screen, sight, effort, None, after),
            ScreenSpace::Hbao => layered(Layered::Hbao, screen, sight, effort, None, after),
            ScreenSpace::HbaoPlus => layered(Layered::HbaoPlus, screen, sight, effort, None, after),
            ScreenSpace::Stochastic(method, stochastic) => {
                layered(method, screen, sight, effort, Some(Depths::Some(stochastic)), after)
            }
            ScreenSpace::Peeled(method) => layered(method, screen, sight, effort, Some(Depths::All), after),
        }
    }
}

/// Which hidden surfaces are drawn.
#[derive(Clone, Copy)]
enum Depths {
    Some(Stochastic),
    All,
}

/// Runs a method that can look behind the first surface.
fn layered(
    method: Layered,
    screen: &Screen,
    sight: &Sight<'_>,
    effort: Effort,
    depths: Option<Depths>,
    after: AfterPass<'_>,
) -> Result<Vec<f32>, RenderError> {
    let Sight { scene, pose, camera, gbuffer, radius_m, seed } = *sight;
    let preset = effort.preset;
    let of_preset = match method {
        Layered::Ssao => preset.ssao().half_resolution,
        _ => method.hbao(preset, radius_m).half_resolution,
    };
    let half_resolution = effort.half_resolution.unwrap_or(of_preset);
    let (mut is_paper, mut side) = (false, None);
    let known = match depths {
        None => Known::Nothing,
        Some(Depths::Some(stochastic)) => {
            is_paper = stochastic.paper;
            let params = MapParams { seed, ..stochastic.map() };
            let map = StochasticMap::draw(scene, pose, camera, gbuffer, &params)?;
            after("map");
            if stochastic.two_cameras {
                let size = [screen.columns(), screen.rows()];
                // As coarse as the first.
                let coarseness = effort.second_coarseness * if half_resolution { 2 } else { 1 };
                let second = SideParams { coarseness, ..SideParams::default() };
                side = Some(SideView::draw(scene, pose, camera, size, &second, &params)?);
                after("second map");
            }
            Known::Map(map)
        }
        Some(Depths::All) => {
            let [width, height, n] = [gbuffer.width, gbuffer.height, gbuffer.samples_per_axis];
            let layers = Layers::draw(scene, pose, camera, width, height, n)?;
            after("layers");
            Known::Layers(layers)
        }
    };
    let known = if half_resolution { known.half() } else { known };
    let lookup = Lookup { compensation: effort.compensation, ..known.lookup(is_paper) };
    let run = |screen: &Screen, after: AfterPass<'_>| match (method, &side) {
        (Layered::Ssao, _) => {
            let params = ssao::SsaoParams { radius_m, seed, ..preset.ssao().params };
            ssao::estimate_by_passes(screen, &params, &lookup, after)
        }
        (_, None) => hbao::estimate_by_passes(screen, &method.hbao(preset, radius_m).params, &lookup, after),
        (_, Some(side)) => {
            let params = method.hbao(preset, radius_m).params;
            let visibility = estimate_visibility_of_two(screen, &params, &lookup, side)?;
            after("samples");
            Ok(visibility)
        }
    };
    at(screen, half_resolution, run, after)
}

/// Runs a method on all samples, or on a quarter of them and upsamples.
fn at(
    screen: &Screen,
    half_resolution: bool,
    run: impl Fn(&Screen, AfterPass<'_>) -> Result<Vec<f32>, RenderError>,
    after: AfterPass<'_>,
) -> Result<Vec<f32>, RenderError> {
    if !half_resolution {
        return run(screen, after);
    }
    let half = screen.half();
    after("half");
    let values = run(&half, after)?;
    let visibility = upsample::upsample(screen, &half, &values)?;
    after("upsampling");
    Ok(visibility)
}

#[cfg(test)]
mod tests {
    use dapple_render::gbuffer::rasterize;

    use super::*;
    use crate::source;

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

    #[test]
    fn efforts_change_what_is_seen_and_every_pass_is_told() {
        let glb = dapple_scene::builtin::glb("atrium", 0.1).unwrap();
        let scene = dapple_scene::load("atrium", &glb, &dapple_scene::NoFiles).unwrap();
        let camera = source::find_camera(&scene, None, 1.0).unwrap();
        let pose = scene.pose(1.0);
        let gbuffer = rasterize(&scene, &pose, &camera, 64, 36, 1).unwrap();
        let sight =
            Sight { scene: &scene, pose: &pose, camera: &camera, gbuffer: &gbuffer, radius_m: 0.6, seed: 1 };
        for method in ScreenSpace::ALL {
            let of = |effort| method.estimate(&sight, effort).unwrap().visibility;
            let plain = Effort { guard_band: 0.0, ..Effort::default() };
            let all = [
                of(plain),
                of(Effort { guard_band: 0.3, ..plain }),
                of(Effort { half_resolution: Some(true), ..plain }),
                of(Effort { preset: Preset::Low, ..plain }),
                of(Effort { preset: Preset::Ultra, ..plain }),
            ];
            for (i, values) in all.iter().enumerate() {
                assert_eq!(values.len(), 64 * 36, "{method:?}, {i}");
                assert!(values.iter().all(|v| (0.0..=1.0).contains(v)), "{method:?}, {i}");
                assert!(all[..i].iter().all(|other| other != values), "{method:?}, {i} is like another");
            }
            let half_said = Effort { half_resolution: Some(false), preset: Preset::Medium, ..plain };
            assert_ne!(of(half_said), of(Effort { half_resolution: None, ..half_said }));
            let screen = gbuffer.screen(&scene, &pose, &camera).unwrap();
            let mut passes = Vec::new();
            let low = Effort { preset: Preset::Low, ..plain };
            method.on_screen(&screen, &sight, low, &mut |pass| passes.push(pass)).unwrap();
            assert_eq!(passes[passes.len() - 1], "upsampling", "{passes:?}");
            assert!(passes.contains(&"half") && passes.contains(&"samples"), "{passes:?}");
        }
        let wide = Effort { guard_band: 0.6, ..Effort::default() };
        assert!(ScreenSpace::Sao.estimate(&sight, wide).is_err());
    }
}
