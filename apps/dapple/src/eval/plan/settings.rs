//! The settings of one scene, with every default filled in.

use anyhow::{Result, bail};
use dapple_render::gbuffer::GuardBand;

use crate::args::{Method, Options, Preset, Radius, Size, StepArgs};
use crate::screen_space::Effort;

/// Frame times lie on a grid of this rate, whatever the server's rate.
pub(in crate::eval) const CLIENT_HZ: f64 = 60.0;

/// Smallest picture side that every metric accepts.
const MIN_SIDE: u32 = 16;

#[derive(Debug, Clone, PartialEq)]
pub(in crate::eval) struct Settings {
    pub(in crate::eval) methods: Vec<Method>,
    /// Names of camera paths; empty for the scene's first.
    pub(in crate::eval) paths: Vec<String>,
    /// As much of a path as is played; all of it without.
    pub(in crate::eval) seconds: Option<f64>,
    pub(in crate::eval) frames: u32,
    pub(in crate::eval) size: Size,
    pub(in crate::eval) supersample: u32,
    pub(in crate::eval) points_per_m2: Vec<f32>,
    pub(in crate::eval) hz: Vec<f64>,
    pub(in crate::eval) reference_rays: u32,
    pub(in crate::eval) radius: Radius,
    pub(in crate::eval) point_rays: u32,
    pub(in crate::eval) threshold: u8,
    pub(in crate::eval) seed: u32,
    pub(in crate::eval) adaptive: f32,
    pub(in crate::eval) bent_normals: bool,
    /// Whether ambient light in the truth's pictures comes from the directions that are open.
    pub(in crate::eval) gather_ambient: bool,
    pub(in crate::eval) step: StepArgs,
    /// Of screen-space methods.
    pub(in crate::eval) effort: Effort,
    pub(in crate::eval) hdr_flip: bool,
}

impl Settings {
    /// `small` is the built-in setting, which takes less than a minute.
    pub(in crate::eval) fn new(options: &Options, small: bool) -> Result<Settings> {
        let options = options.clone();
        let supersample = options.supersample.unwrap_or(2);
        // Zero is refused below.
        let samples = supersample.saturating_mul(supersample).max(1);
        let whole = |rays: u32| rays.checked_next_multiple_of(samples).unwrap_or(rays);
        let default_methods = vec![
            Method::Psao,
            Method::PsaoHat { radius: 1.0 },
            Method::Rtao { rays: whole(16) },
            Method::None,
        ];
        let preset = options.preset;
        let effort = options.effort();
        let points = preset.map_or(if small { 256.0 } else { 512.0 }, Preset::points_per_m2);
        let settings = Settings {
            methods: distinct(options.methods.unwrap_or(default_methods)),
            paths: distinct(options.path.unwrap_or_default()),
            seconds: options.seconds.or(small.then_some(2.0)),
            frames: options.frames.unwrap_or(if small { 2 } else { 4 }),
            size: options.size.unwrap_or(Size { width: 480, height: 270 }),
            supersample,
            points_per_m2: distinct(options.points.unwrap_or_else(|| vec![points])),
            hz: distinct(options.hz.unwrap_or_else(|| vec![preset.map_or(15.0, Preset::hz)])),
            reference_rays: options.reference_rays.unwrap_or(whole(if small { 128 } else { 512 })),
            radius: options.radius.unwrap_or(Radius::Metres(0.6)),
            point_rays: options.point_rays.unwrap_or(64),
            threshold: options.threshold.unwrap_or(4),
            seed: options.seed.unwrap_or(1),
            adaptive: options.adaptive.unwrap_or(0.0),
            bent_normals: options.bent_normals.unwrap_or(false),
            gather_ambient: options.gather_ambient.unwrap_or(false) || options.bent_normals.unwrap_or(false),
            step: StepArgs {
                ray_budget: options.ray_budget,
                rays_still: options.rays_still.unwrap_or(0),
                budget: options.budget.or(preset.map(Preset::budget)),
                max_points: options.max_points,
            },
            effort,
            hdr_flip: options.hdr_flip.unwrap_or(false),
        };
        settings.check()?;
        Ok(settings)
    }

    fn check(&self) -> Result<()> {
        if self.frames == 0 || self.frames > 100_000 {
            bail!("--frames is {}, must be 1 to 100000", self.frames);
        }
        if self.seconds.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
            bail!("--seconds must be above 0");
        }
        if self.size.width < MIN_SIDE || self.size.height < MIN_SIDE {
            bail!("--size is {}: the metrics need at least {MIN_SIDE}x{MIN_SIDE} pixels", self.size);
        }
        if !(1..=8).contains(&self.supersample) {
            bail!("--supersample is {}, must be 1 to 8", self.supersample);
        }
        if self.threshold > 127 {
            bail!("--threshold is {}, must be 0 to 127", self.threshold);
        }
        if !(0.0..=1.0).contains(&self.adaptive) {
            bail!("--adaptive is {}, must be 0 to 1", self.adaptive);
        }
        if !(0.0..=GuardBand::MAX_PART).contains(&self.effort.guard_band) {
            bail!("--guard-band is {}, must be 0 to {}", self.effort.guard_band, GuardBand::MAX_PART);
        }
        if !(1..=65536).contains(&self.reference_rays) {
            bail!("--reference-rays is {}, must be 1 to 65536", self.reference_rays);
        }
        let samples = self.supersample * self.supersample;
        let of_methods = self.methods.iter().filter_map(|method| match method {
            Method::Rtao { rays } => Some((format!("--methods has {method}"), *rays)),
            _ => None,
        });
        let of_truth = (format!("--reference-rays is {}", self.reference_rays), self.reference_rays);
        // Rounding in silence would give a method other rays than its name says.
        for (what, rays) in of_methods.chain([of_truth]) {
            if !rays.is_multiple_of(samples) {
                let near = (rays / samples * samples).max(samples);
                bail!(
                    "{what}: with --supersample {} a pixel has {samples} samples, each with as many rays, so rays a \
                     pixel must be a multiple of {samples}: {near}, for example",
                    self.supersample
                );
            }
        }
        if let Some(bad) = self.hz.iter().find(|h| !(h.is_finite() && **h > 0.0 && **h <= 1000.0)) {
            bail!("--hz has {bad}, must be above 0 to 1000");
        }
        if let Some(bad) = self.points_per_m2.iter().find(|n| !(n.is_finite() && **n > 0.0)) {
            bail!("--points has {bad}, must be above 0");
        }
        if let Some(method) = self.methods.iter().find(|m| matches!(m, Method::Sas { .. }))
            && !cfg!(feature = "sas")
        {
            bail!(
                "{method} needs a video codec, which this program was built without: build it with `--features sas`, or leave \
                 {method} out of --methods"
            );
        }
        if let Some(method) = self.methods.iter().find(|m| m.is_paper())
            && self.step.max_points.is_some()
        {
            bail!("--max-points: the points of {method} cannot come and go; leave one of the two out");
        }
        for (name, empty) in [
            ("--methods", self.methods.is_empty()),
            ("--hz", self.hz.is_empty()),
            ("--points", self.points_per_m2.is_empty()),
        ] {
            if empty {
                bail!("{name} is empty: give at least one, or leave it out");
            }
        }
        Ok(())
    }

    /// Whether pictures have direct light of whatever emits.
    pub(in crate::eval) fn has_area_lights(&self) -> bool {
        self.methods.contains(&Method::Slc)
    }

    /// The slowest of the rates, or the client's own where all are faster.
    pub(in crate::eval) fn slowest_hz(&self) -> f64 {
        self.hz.iter().copied().fold(CLIENT_HZ, f64::min)
    }

    /// Rays a sample so that a pixel gets `rays_per_pixel`.
    pub(in crate::eval) fn rays_per_sample(&self, rays_per_pixel: u32) -> u32 {
        rays_per_pixel / (self.supersample * self.supersample)
    }
}

/// The list without repetitions, in order.
fn distinct<T: PartialEq>(list: Vec<T>) -> Vec<T> {
    list.into_iter().fold(Vec::new(), |mut kept, item| {
        if !kept.contains(&item) {
            kept.push(item);
        }
        kept
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_a_pixel_are_shared_evenly_by_its_samples() {
        let with = |supersample, methods, reference_rays| Options {
            supersample: Some(supersample),
            methods,
            reference_rays,
            ..Options::default()
        };
        for (options, says) in [
            (with(2, Some(vec![Method::Rtao { rays: 6 }]), None), "rtao-6"),
            (with(3, None, Some(512)), "504, for example"),
            (with(2, None, Some(2)), "4, for example"),
        ] {
            let error = Settings::new(&options, false).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
        // Defaults fit themselves.
        let settings = Settings::new(&with(3, None, None), false).unwrap();
        assert_eq!((settings.reference_rays, settings.rays_per_sample(513)), (513, 57));
        assert!(settings.methods.contains(&Method::Rtao { rays: 18 }));
    }
}
