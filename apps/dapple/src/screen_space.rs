//! Methods that need a picture's depths and normals alone, or those of what is hidden, too: no server, no points, no bits.

use std::time::{Duration, Instant};

use anyhow::Result;
use dapple_render::gbuffer::{GBuffer, GuardBand, Layers, Screen};
use dapple_render::screen_space::{ScreenKind, ScreenMethod};
use dapple_render::sdao::{Lookup, MapParams, SideParams, SideView, StochasticMap, bent_normals};
use dapple_render::{AfterPass, Chosen, Preset, RenderError, upsample};
use dapple_scene::glam::Vec3;
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
    /// Of a second camera beside the first one, too; SSAO and HBAO+ alone.
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
        self.single().kind().name()
    }
}

/// What is known of hidden surfaces.
#[derive(Default)]
struct Known {
    map: Option<StochasticMap>,
    /// Of a second camera.
    side: Option<SideView>,
    layers: Option<Layers>,
    is_paper: bool,
}

impl Known {
    fn lookup(&self, compensation: f32) -> Lookup<'_> {
        let lookup = match (&self.map, &self.layers) {
            (Some(map), _) if self.is_paper => Lookup::paper(map),
            (Some(map), _) => Lookup::stochastic(map),
            (None, Some(layers)) => Lookup::peeled(layers),
            (None, None) => Lookup::default(),
        };
        Lookup { compensation, ..lookup }
    }

    /// Of the samples of [`Screen::half`]; the second camera's picture has its own.
    fn half(self) -> Known {
        let (map, layers) = (self.map.map(|map| map.half()), self.layers.map(|layers| layers.half()));
        Known { map, layers, ..self }
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
    pub(crate) const ALL: [ScreenSpace; 14] = [
        ScreenSpace::Ssao,
        ScreenSpace::Alchemy,
        ScreenSpace::Sao,
        ScreenSpace::Hbao,
        ScreenSpace::HbaoPlus,
        ScreenSpace::Gtao,
        ScreenSpace::Stochastic(Layered::Ssao, Stochastic::DEFAULT),
        ScreenSpace::Stochastic(Layered::Hbao, Stochastic::DEFAULT),
        ScreenSpace::Stochastic(Layered::HbaoPlus, Stochastic::DEFAULT),
        ScreenSpace::Stochastic(Layered::Ssao, Stochastic::TWO_CAMERAS),
        ScreenSpace::Stochastic(Layered::HbaoPlus, Stochastic::TWO_CAMERAS),
        ScreenSpace::Peeled(Layered::Ssao),
        ScreenSpace::Peeled(Layered::Hbao),
        ScreenSpace::Peeled(Layered::HbaoPlus),
    ];

    /// What names there are, for messages.
    pub(crate) const KNOWN: &str = "ssao, alchemy, sao, hbao, hbao-plus, gtao, sd-ssao, sd-hbao, sd-hbao-plus and these with -S for 1, 2, 4, \
                                    8 or 16 samples, sd-ssao-mv, sd-hbao-plus-mv, -paper after any of them, ssao-peeled, hbao-peeled, hbao-plus-peeled";

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
        let is_possible = !two_cameras || method != Layered::Hbao;
        is_possible.then_some(ScreenSpace::Stochastic(method, Stochastic { samples, two_cameras, paper }))
    }

    /// As `eval` and `render` name it.
    pub(crate) fn name(self) -> String {
        match self {
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
            single => single.kind().name().to_owned(),
        }
    }

    /// The method, whatever it knows of hidden surfaces.
    fn kind(self) -> ScreenKind {
        match self {
            ScreenSpace::Ssao => ScreenKind::Ssao,
            ScreenSpace::Alchemy => ScreenKind::Alchemy,
            ScreenSpace::Sao => ScreenKind::Sao,
            ScreenSpace::Hbao => ScreenKind::Hbao,
            ScreenSpace::HbaoPlus => ScreenKind::HbaoPlus,
            ScreenSpace::Gtao => ScreenKind::Gtao,
            ScreenSpace::Stochastic(method, _) | ScreenSpace::Peeled(method) => method.single().kind(),
        }
    }

    /// Visibility of a picture, with its guard band and at the resolution that is asked for.
    pub(crate) fn estimate(self, sight: &Sight<'_>, effort: Effort) -> Result<Estimate> {
        let start = Instant::now();
        let beyond = sight.beyond(effort.guard_band, |screen, sight| {
            Ok(self.on_screen(screen, sight, effort, &mut |_| ())?)
        })?;
        let visibility = beyond.crop(sight, &beyond.found)?;
        Ok(Estimate { visibility, time: start.elapsed() - beyond.of_picture })
    }

    /// How much around each sample of a picture is open, and where, in the world, by HBAO or HBAO+ with what they know of hidden surfaces; `None` of other methods, and
    /// of two cameras.
    pub(crate) fn bent(self, sight: &Sight<'_>, effort: Effort) -> Result<Option<(Vec<f32>, Vec<Vec3>)>> {
        let params = match self.method(sight, effort.preset).params {
            ScreenMethod::Hbao(params) if !self.has_two_cameras() => params,
            _ => return Ok(None),
        };
        let beyond = sight.beyond(effort.guard_band, |screen, sight| {
            let known = self.known(screen, sight, effort, false, &mut |_| ())?;
            let bent = bent_normals(screen, &params, &known.lookup(effort.compensation))?;
            let open_world = bent.open_world(sight.camera);
            Ok((bent.visibility, open_world))
        })?;
        let (visibility, open_world) = &beyond.found;
        Ok(Some((beyond.crop(sight, visibility)?, beyond.crop(sight, open_world)?)))
    }

    /// Whether [`ScreenSpace::bent`] is there.
    pub(crate) fn can_bend(self) -> bool {
        matches!(self.kind(), ScreenKind::Hbao | ScreenKind::HbaoPlus) && !self.has_two_cameras()
    }

    fn has_two_cameras(self) -> bool {
        matches!(self, ScreenSpace::Stochastic(_, Stochastic { two_cameras: true, .. }))
    }

    /// With a preset's parameters, and the resolution that they are meant for.
    fn method(self, sight: &Sight<'_>, preset: Preset) -> Chosen<ScreenMethod> {
        let Chosen { params, half_resolution } = self.kind().preset(preset);
        Chosen { params: params.with_radius(sight.radius_m).with_seed(sight.seed), half_resolution }
    }

    /// Visibility of each sample of what is seen, which is that of `sight`'s picture and camera; `after` is told the name of each pass.
    pub(crate) fn on_screen(
        self,
        screen: &Screen,
        sight: &Sight<'_>,
        effort: Effort,
        after: AfterPass<'_>,
    ) -> Result<Vec<f32>, RenderError> {
        let Chosen { params: method, half_resolution } = self.method(sight, effort.preset);
        let half_resolution = effort.half_resolution.unwrap_or(half_resolution);
        let known = self.known(screen, sight, effort, half_resolution, after)?;
        let known = if half_resolution { known.half() } else { known };
        let lookup = known.lookup(effort.compensation);
        let run = |screen: &Screen, after: AfterPass<'_>| {
            method.estimate_by_passes(screen, &lookup, known.side.as_ref(), after)
        };
        if half_resolution { upsample::at_half_resolution(screen, after, run) } else { run(screen, after) }
    }

    /// Draws the hidden surfaces that the method looks at.
    fn known(
        self,
        screen: &Screen,
        sight: &Sight<'_>,
        effort: Effort,
        half_resolution: bool,
        after: AfterPass<'_>,
    ) -> Result<Known, RenderError> {
        let Sight { scene, pose, camera, gbuffer, seed, .. } = *sight;
        match self {
            ScreenSpace::Stochastic(_, stochastic) => {
                let params = MapParams { seed, ..stochastic.map() };
                let map = StochasticMap::draw(scene, pose, camera, gbuffer, &params)?;
                after("map");
                let mut known = Known { map: Some(map), is_paper: stochastic.paper, ..Known::default() };
                if stochastic.two_cameras {
                    let size = [screen.columns(), screen.rows()];
                    let coarseness = effort.second_coarseness;
                    let second = SideParams { coarseness, ..SideParams::default() };
                    let second = if half_resolution { second.half() } else { second };
                    known.side = Some(SideView::draw(scene, pose, camera, size, &second, &params)?);
                    after("second map");
                }
                Ok(known)
            }
            ScreenSpace::Peeled(_) => {
                let [width, height, n] = [gbuffer.width, gbuffer.height, gbuffer.samples_per_axis];
                let layers = Layers::draw(scene, pose, camera, width, height, n)?;
                after("layers");
                Ok(Known { layers: Some(layers), ..Known::default() })
            }
            _ => Ok(Known::default()),
        }
    }
}

/// What was found in a picture with its guard band.
struct Beyond<T> {
    found: T,
    band: GuardBand,
    /// Of drawing, the picture's own part: a client draws that anyway.
    of_picture: Duration,
}

impl<T> Beyond<T> {
    /// Of one value a sample those of the picture.
    fn crop<V: Copy>(&self, sight: &Sight<'_>, values: &[V]) -> Result<Vec<V>, RenderError> {
        let gbuffer = sight.gbuffer;
        self.band.crop(values, [gbuffer.width, gbuffer.height], gbuffer.samples_per_axis)
    }
}

impl Sight<'_> {
    /// Lets `look` see the picture with a guard band that is a part of its height wide.
    fn beyond<T>(
        &self,
        guard_band: f32,
        look: impl FnOnce(&Screen, &Sight<'_>) -> Result<T>,
    ) -> Result<Beyond<T>> {
        let Sight { scene, pose, camera, gbuffer, .. } = *self;
        let size = [gbuffer.width, gbuffer.height];
        let band = GuardBand::of_height(guard_band, gbuffer.height)?.within(size, gbuffer.samples_per_axis);
        if band.pixels() == 0 {
            let screen = gbuffer.screen(scene, pose, camera)?;
            return Ok(Beyond { found: look(&screen, self)?, band, of_picture: Duration::ZERO });
        }
        let start = Instant::now();
        let wide = band.rasterize(scene, pose, camera, size, gbuffer.samples_per_axis)?;
        let of_picture = start.elapsed().mul_f64(1.0 - band.part(size));
        let camera = band.camera(camera, gbuffer.height);
        let screen = wide.screen(scene, pose, &camera)?;
        let found = look(&screen, &Sight { gbuffer: &wide, camera: &camera, ..*self })?;
        Ok(Beyond { found, band, of_picture })
    }
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
            "sd-ssao-8-mv",
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
            let bent = method.bent(&sight, Effort::default()).unwrap();
            assert_eq!(bent.is_some(), method.can_bend(), "{method:?}");
            if let Some((open, open_world)) = bent {
                assert_eq!([open.len(), open_world.len()], [64 * 36; 2]);
                // No more than the whole hemisphere, and some of it where anything is open.
                let lengths = open_world.iter().zip(gbuffer.samples()).filter(|(_, s)| s.is_covered());
                assert!(lengths.into_iter().all(|(d, _)| (0.0..0.67).contains(&d.length())), "{method:?}");
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
