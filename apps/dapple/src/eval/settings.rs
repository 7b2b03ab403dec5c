//! What an evaluation does, with every default filled in.

use anyhow::{Result, bail};
use dapple_scene::{CameraPath, Scene};

use crate::args::{EvalArgs, Method, Size, StepArgs};
use crate::source::{self, Loaded};

/// The scene and detail of an evaluation without arguments.
pub(super) const DEFAULT_SCENE: (&str, f32) = ("atrium", 0.15);

/// Frame times lie on a grid of this rate, whatever the server's rate.
pub(super) const CLIENT_HZ: f64 = 60.0;

/// Smallest picture side that every metric accepts.
const MIN_SIDE: u32 = 16;

#[derive(Debug)]
pub(super) struct Settings {
    pub(super) methods: Vec<Method>,
    pub(super) path: CameraPath,
    pub(super) seconds: f64,
    pub(super) frame_times_s: Vec<f64>,
    pub(super) size: Size,
    pub(super) supersample: u32,
    pub(super) points_per_m2: Vec<f32>,
    pub(super) hz: Vec<f64>,
    pub(super) reference_rays: u32,
    pub(super) radius_m: f32,
    /// Factor on `points_per_m2` for scenes that are not in metres.
    pub(super) density_factor: f32,
    pub(super) point_rays: u32,
    pub(super) threshold: u8,
    pub(super) seed: u32,
    pub(super) step: StepArgs,
}

impl Settings {
    pub(super) fn new(args: &EvalArgs, loaded: &Loaded) -> Result<Settings> {
        let path = source::find_path(&loaded.scene, args.path.as_deref())?;
        let whole = path_seconds(&loaded.scene, &path);
        // A file's own scene gets all of its path; the built-in setting a short piece, to stay under a minute.
        let small = args.scene.scene.is_none() && args.scene.builtin.is_none();
        let wanted = args.seconds.unwrap_or(if small { 2.0 } else { whole });
        if wanted > whole {
            tracing::warn!("--seconds {wanted}: the path {} lasts {whole:.2} s, which are played", path.name);
        }
        let seconds = wanted.min(whole);
        let frames = args.frames.unwrap_or(if small { 2 } else { 4 });
        let size = args.size.unwrap_or(Size { width: 480, height: 270 });
        let default_methods =
            vec![Method::Psao, Method::PsaoHat { radius: 1.0 }, Method::Rtao { rays: 16 }, Method::None];
        let (radius_m, density_factor) = source::resolve_radius(&loaded.scene, &args.visibility)?;
        let settings = Settings {
            methods: distinct(args.methods.clone().unwrap_or(default_methods)),
            path,
            seconds,
            frame_times_s: frame_times(frames, seconds),
            size,
            supersample: args.supersample.unwrap_or(2),
            points_per_m2: distinct(
                args.points.clone().unwrap_or_else(|| vec![if small { 256.0 } else { 512.0 }]),
            ),
            hz: distinct(args.hz.clone().unwrap_or_else(|| vec![15.0])),
            reference_rays: args.reference_rays.unwrap_or(if small { 128 } else { 512 }),
            radius_m,
            density_factor,
            point_rays: args.visibility.point_rays,
            threshold: args.visibility.threshold,
            seed: args.visibility.seed,
            step: args.step,
        };
        settings.check(frames, args)?;
        Ok(settings)
    }

    fn check(&self, frames: u32, args: &EvalArgs) -> Result<()> {
        if frames == 0 || frames > 100_000 {
            bail!("--frames is {frames}, must be 1 to 100000");
        }
        if args.seconds.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
            bail!("--seconds must be above 0");
        }
        if self.size.width < MIN_SIDE || self.size.height < MIN_SIDE {
            bail!("--size is {}: the metrics need at least {MIN_SIDE}x{MIN_SIDE} pixels", self.size);
        }
        if !(1..=8).contains(&self.supersample) {
            bail!("--supersample is {}, must be 1 to 8", self.supersample);
        }
        if !(1..=65536).contains(&self.reference_rays) {
            bail!("--reference-rays is {}, must be 1 to 65536", self.reference_rays);
        }
        if let Some(bad) = self.hz.iter().find(|h| !(h.is_finite() && **h > 0.0 && **h <= 1000.0)) {
            bail!("--hz has {bad}, must be above 0 to 1000");
        }
        if let Some(bad) = self.points_per_m2.iter().find(|n| !(n.is_finite() && **n > 0.0)) {
            bail!("--points has {bad}, must be above 0");
        }
        Ok(())
    }

    /// Rays a sample so that a pixel gets at least `rays_per_pixel`.
    pub(super) fn rays_per_sample(&self, rays_per_pixel: u32) -> u32 {
        rays_per_pixel.div_ceil(self.supersample * self.supersample)
    }

    pub(super) fn summary(&self, loaded: &Loaded) -> String {
        let scene = &loaded.scene;
        let list = |values: Vec<String>| values.join(", ");
        format!(
            "{}: {} triangles, {} instances, path {}\n{} pictures of {} over {:.2} s, points per m² {}, server at {} Hz, \
             truth {} rays a pixel, radius {:.3} m",
            loaded.title,
            scene.triangle_count(),
            scene.instances.len(),
            self.path.name,
            self.frame_times_s.len(),
            self.size,
            self.seconds,
            list(self.points_per_m2.iter().map(|n| n.to_string()).collect()),
            list(self.hz.iter().map(|h| h.to_string()).collect()),
            self.reference_rays,
            self.radius_m,
        )
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

/// How long a path lasts; a camera that stands still watches the animation once, or ten seconds of a still scene.
fn path_seconds(scene: &Scene, path: &CameraPath) -> f64 {
    let animated = scene.active_animation.map_or(0.0, |i| f64::from(scene.animations[i as usize].duration()));
    [path.duration_s(), animated, 10.0].into_iter().find(|s| *s > 0.0).unwrap_or(10.0)
}

/// Times in the middle of `frames` equal pieces, on the client's frame grid.
fn frame_times(frames: u32, seconds: f64) -> Vec<f64> {
    (0..frames)
        .map(|i| {
            let middle = (f64::from(i) + 0.5) / f64::from(frames) * seconds;
            (middle * CLIENT_HZ).floor() / CLIENT_HZ
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_lie_on_the_grid_inside_the_path() {
        let times = frame_times(4, 15.0);
        assert_eq!(
            times,
            [1.866_666_666_666_666_7, 5.616_666_666_666_666, 9.366_666_666_666_667, 13.116_666_666_666_667]
        );
        for n in [1, 3, 900] {
            let times = frame_times(n, 15.0);
            assert!(times.windows(2).all(|w| w[0] < w[1]) && times[times.len() - 1] < 15.0, "{n}");
        }
    }
}
