//! One scene along one camera path: its pictures without visibility, their truth, and what stays still between them.

use std::cell::{Ref, RefCell};
use std::rc::Rc;

use anyhow::Result;
use dapple_client::{Drawn, PictureParams, draw};
use dapple_render::gbuffer::rasterize;
use dapple_render::shade::Shaded;
use dapple_scene::{CameraPath, Scene};
use dapple_trace::Tracer;

use super::plan::{CLIENT_HZ, Settings};
use super::still::{StillMap, still_map};
use super::truth::{Cache, Request};
use crate::picture::Shown;
use crate::source::Loaded;

/// Pictures are kept while they fit into so many bytes, and drawn again where they do not.
const MAX_KEPT_BYTES: usize = 3 << 29;
/// About what a sample takes: what it shows, now and a moment later, its light, and the truth.
const BYTES_A_SAMPLE: usize = 100;

/// One picture of the path.
pub(super) struct Frame {
    pub(super) time_s: f64,
    pub(super) drawn: Drawn,
    pub(super) truth: Shown,
    /// Of the truth's visibility, over pixels.
    pub(super) noise_mse: f64,
    pub(super) next: Next,
}

/// What the viewer sees one client frame later.
pub(super) struct Next {
    pub(super) time_s: f64,
    /// Without light: only visibility is compared.
    pub(super) drawn: Drawn,
    /// Where the pixels of before are now.
    pub(super) still: StillMap,
}

pub(super) struct Stage<'a> {
    pub(super) loaded: &'a Loaded,
    pub(super) settings: &'a Settings,
    pub(super) path: CameraPath,
    /// Length of the path, and how much of it is played.
    pub(super) whole_s: f64,
    pub(super) seconds: f64,
    pub(super) frame_times_s: Vec<f64>,
    pub(super) radius_m: f32,
    /// Factor on points per m² for scenes that are not in metres.
    pub(super) density_factor: f32,
    params: PictureParams,
    moving: Vec<bool>,
    /// The scene's tracer, and the time it was last brought to.
    tracer: RefCell<(Tracer, Option<f64>)>,
    frames: RefCell<Vec<Option<Rc<Frame>>>>,
    middle: RefCell<Option<Rc<Frame>>>,
}

impl<'a> Stage<'a> {
    /// `tracer` may stand at any time.
    pub(super) fn new(
        loaded: &'a Loaded,
        settings: &'a Settings,
        path: CameraPath,
        (radius_m, density_factor): (f32, f32),
        tracer: Tracer,
    ) -> Stage<'a> {
        let whole_s = path_seconds(&loaded.scene, &path);
        let wanted = settings.seconds.unwrap_or(whole_s);
        if wanted > whole_s {
            tracing::warn!(
                "--seconds {wanted}: the path {} lasts {whole_s:.2} s, which are played",
                path.name
            );
        }
        let seconds = wanted.min(whole_s);
        let frame_times_s = frame_times(settings.frames, seconds);
        let count = frame_times_s.len();
        if count < settings.frames as usize {
            tracing::warn!(
                "--frames {}: {seconds:.2} s have {count} at 60 Hz, which are compared",
                settings.frames
            );
        }
        Stage {
            loaded,
            settings,
            path,
            whole_s,
            seconds,
            frame_times_s,
            radius_m,
            density_factor,
            params: PictureParams {
                width: settings.size.width,
                height: settings.size.height,
                supersample: settings.supersample,
                shade: Default::default(),
            },
            moving: loaded.scene.moving_instances(),
            tracer: RefCell::new((tracer, None)),
            frames: RefCell::new((0..count).map(|_| None).collect()),
            middle: RefCell::new(None),
        }
    }

    pub(super) fn scene(&self) -> &Scene {
        &self.loaded.scene
    }

    /// Samples of a picture.
    pub(super) fn samples(&self) -> u64 {
        let a_pixel = u64::from(self.settings.supersample).pow(2);
        u64::from(self.settings.size.width) * u64::from(self.settings.size.height) * a_pixel
    }

    /// About how much work the truth is, in rays.
    pub(super) fn truth_work(&self) -> f64 {
        let rays = self.settings.rays_per_sample(self.settings.reference_rays);
        self.frame_times_s.len() as f64 * self.samples() as f64 * (20.0 + f64::from(rays))
    }

    /// A picture of the path, drawn and traced if it is not at hand. `progress` gets the part of the rays that is done.
    pub(super) fn frame(
        &self,
        index: usize,
        cache: &Cache,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Rc<Frame>> {
        if let Some(frame) = &self.frames.borrow()[index] {
            return Ok(frame.clone());
        }
        let frame = Rc::new(self.make(self.frame_times_s[index], cache, progress)?);
        let bytes = (self.samples() as usize).saturating_mul(BYTES_A_SAMPLE);
        if bytes.saturating_mul(self.frame_times_s.len()) <= MAX_KEPT_BYTES {
            self.frames.borrow_mut()[index] = Some(frame.clone());
        }
        Ok(frame)
    }

    /// The picture at the one time of the path at which settling is watched.
    pub(super) fn middle(&self, time_s: f64, cache: &Cache) -> Result<Rc<Frame>> {
        if let Some(frame) = self.middle.borrow().as_ref().filter(|frame| frame.time_s == time_s) {
            return Ok(frame.clone());
        }
        let frame = Rc::new(self.make(time_s, cache, &|_| ())?);
        *self.middle.borrow_mut() = Some(frame.clone());
        Ok(frame)
    }

    fn make(&self, time_s: f64, cache: &Cache, progress: &(dyn Fn(f64) + Sync)) -> Result<Frame> {
        let scene = self.scene();
        let camera = |time_s: f64| self.path.camera(scene, &scene.pose_undeformed(time_s));
        let drawn = draw(scene, &camera(time_s), time_s, &self.params)?;
        let request = Request {
            scene,
            drawn: &drawn,
            rays: self.settings.rays_per_sample(self.settings.reference_rays),
            radius_m: self.radius_m,
            seed: self.settings.seed,
        };
        let traced = cache.get(&request, || self.tracer_at(&drawn), progress)?;
        let truth = Shown::new(&drawn, Some(&traced.visibility))?;
        let next_s = time_s + 1.0 / CLIENT_HZ;
        let next_camera = camera(next_s);
        let pose = scene.pose(next_s);
        let (width, height) = (self.params.width, self.params.height);
        let gbuffer = rasterize(scene, &pose, &next_camera, width, height, self.params.supersample)?;
        let next_drawn = Drawn { pose, gbuffer, shaded: Shaded { direct: Vec::new(), ambient: Vec::new() } };
        let still = still_map(scene, &drawn, &next_drawn, &next_camera, &self.moving, self.radius_m);
        let next = Next { time_s: next_s, drawn: next_drawn, still };
        Ok(Frame { time_s, drawn, truth, noise_mse: traced.noise_mse, next })
    }

    /// The scene's tracer in a picture's pose.
    pub(super) fn tracer_at(&self, drawn: &Drawn) -> Ref<'_, Tracer> {
        if self.tracer.borrow().1 != Some(drawn.pose.time) {
            let mut tracer = self.tracer.borrow_mut();
            tracer.0.update(self.scene(), &drawn.pose);
            tracer.1 = Some(drawn.pose.time);
        }
        Ref::map(self.tracer.borrow(), |tracer| &tracer.0)
    }
}

/// How long a path lasts; a camera that stands still watches the animation once, or ten seconds of a still scene.
fn path_seconds(scene: &Scene, path: &CameraPath) -> f64 {
    let animated = scene.active_animation.map_or(0.0, |i| f64::from(scene.animations[i as usize].duration()));
    [path.duration_s(), animated, 10.0].into_iter().find(|s| *s > 0.0).unwrap_or(10.0)
}

/// Times in the middle of `frames` equal pieces, on the client's frame grid; fewer where pieces are shorter than its steps.
fn frame_times(frames: u32, seconds: f64) -> Vec<f64> {
    let mut times: Vec<f64> = (0..frames)
        .map(|i| {
            let middle = (f64::from(i) + 0.5) / f64::from(frames) * seconds;
            (middle * CLIENT_HZ).floor() / CLIENT_HZ
        })
        .collect();
    times.dedup();
    times
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
        assert_eq!(frame_times(60, 0.1).len(), 6, "no picture twice");
    }
}
