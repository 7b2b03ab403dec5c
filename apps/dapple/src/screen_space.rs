//! Methods that need a picture's depths and normals alone: no server, no points, no bits.

use std::time::{Duration, Instant};

use anyhow::Result;
use dapple_render::gbuffer::{GBuffer, GuardBand, Screen};
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
}

/// How much work a method does, and how far beyond the picture it sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Effort {
    pub(crate) preset: Preset,
    /// The preset's where it is not said.
    pub(crate) half_resolution: Option<bool>,
    /// Part of the picture's height.
    pub(crate) guard_band: f32,
}

impl Default for Effort {
    fn default() -> Self {
        Effort { preset: Preset::default(), half_resolution: None, guard_band: Effort::GUARD_BAND }
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
        let screen = wide.screen(scene, pose, &band.camera(camera, gbuffer.height))?;
        drop(wide);
        let visibility = self.on_screen(&screen, sight, effort, &mut |_| ())?;
        let visibility = band.crop(&visibility, size, gbuffer.samples_per_axis)?;
        let of_picture = drawing.mul_f64(1.0 - band.part(size));
        Ok(Estimate { visibility, time: start.elapsed() - of_picture })
    }

    /// Visibility of each sample of what is seen, with what lies in a guard band; `after` is told the name of each pass.
    pub(crate) fn on_screen(
        self,
        screen: &Screen,
        sight: &Sight<'_>,
        effort: Effort,
        after: AfterPass<'_>,
    ) -> Result<Vec<f32>, RenderError> {
        let (preset, radius_m, seed) = (effort.preset, sight.radius_m, sight.seed);
        let half = |of_preset: bool| effort.half_resolution.unwrap_or(of_preset);
        match self {
            ScreenSpace::Ssao => {
                let Chosen { params, half_resolution } = preset.ssao();
                let params = ssao::SsaoParams { radius_m, seed, ..params };
                let run = |s: &Screen, after: AfterPass<'_>| ssao::estimate_by_passes(s, &params, after);
                at(screen, half(half_resolution), run, after)
            }
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
            ScreenSpace::Hbao | ScreenSpace::HbaoPlus => {
                let is_plus = self == ScreenSpace::HbaoPlus;
                let Chosen { params, half_resolution } =
                    if is_plus { preset.hbao_plus() } else { preset.hbao() };
                let params = hbao::HbaoParams { radius_m, ..params };
                let run = |s: &Screen, after: AfterPass<'_>| hbao::estimate_by_passes(s, &params, after);
                at(screen, half(half_resolution), run, after)
            }
            ScreenSpace::Gtao => {
                let Chosen { params, half_resolution } = preset.gtao();
                let params = gtao::GtaoParams { radius_m, ..params };
                let run = |s: &Screen, after: AfterPass<'_>| gtao::estimate_by_passes(s, &params, after);
                at(screen, half(half_resolution), run, after)
            }
        }
    }
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
            assert_eq!((passes[0], passes[passes.len() - 1]), ("half", "upsampling"), "{passes:?}");
            assert!(passes.contains(&"samples") && passes.len() >= 4, "{passes:?}");
        }
        let wide = Effort { guard_band: 0.6, ..Effort::default() };
        assert!(ScreenSpace::Sao.estimate(&sight, wide).is_err());
    }
}
