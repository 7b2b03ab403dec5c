//! One scene along one camera path: its pictures without visibility, their truth, and what stays still between them.

use std::cell::{Ref, RefCell};
use std::rc::Rc;

use anyhow::Result;
use dapple_client::{Drawn, PictureParams, draw};
use dapple_render::area_lights::{AreaLightTable, shade_area_lights};
use dapple_render::gbuffer::GBuffer;
use dapple_render::shade::{Gathering, Openings, ShadeParams, shade_gathered, shading_points};
use dapple_scene::area_lights::AreaLights;
use dapple_scene::glam::Vec3;
use dapple_scene::{CameraPath, Pose, PosedCamera, Scene};
use dapple_store::light_visibility::SeenLight;
use dapple_trace::Tracer;
use dapple_trace::direct::{DirectParams, trace_direct};

use super::plan::{CLIENT_HZ, Settings};
use super::still::{StillMap, still_map};
use super::truth::{Cache, Request, open_directions};
use crate::picture::Shown;
use crate::screen_space::Sight;
use crate::source::Loaded;

/// Pictures are kept while they fit into so many bytes, and drawn again where they do not.
const MAX_KEPT_BYTES: usize = 3 << 29;
/// About what a sample takes: what it shows, its light, and the truth.
const BYTES_A_SAMPLE: usize = 92;
/// Most client frames after a picture in which flicker is watched: a step of a server at 5 Hz. Of slower ones only some steps
/// are seen, which is as often as they flicker.
const MAX_WATCHED: u32 = 12;
/// Part of a piece by which a picture lies further in its piece of the path than the one before lies in its own: the golden
/// ratio, whose multiples spread evenly over any period, that of server steps among them.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// One picture of the path.
pub(super) struct Frame {
    pub(super) time_s: f64,
    pub(super) drawn: Drawn,
    pub(super) truth: Shown,
    /// Of the truth's visibility, over pixels.
    pub(super) noise_mse: f64,
    /// Client frames from here on in which flicker is watched: before the next picture, and about a server step long.
    pub(super) watched_s: Vec<f64>,
    /// What stands still in all of them.
    pub(super) still: StillMap,
    /// What samples would reflect of area lights with nothing in the way, where pictures have that light.
    pub(super) open_light: Option<Vec<Vec3>>,
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
                // No sun is made up where something else shines.
                shade: ShadeParams { sun_without_lights: !settings.has_area_lights(), ..Default::default() },
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
        let time_s = self.frame_times_s[index];
        let until_s = self.frame_times_s.get(index + 1).copied().unwrap_or(self.seconds);
        let frame = Rc::new(self.make(time_s, &self.watched(time_s, until_s), cache, progress)?);
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
        let frame = Rc::new(self.make(time_s, &[], cache, &|_| ())?);
        *self.middle.borrow_mut() = Some(frame.clone());
        Ok(frame)
    }

    /// Of the slowest server.
    fn client_frames_a_step(&self) -> u32 {
        (CLIENT_HZ / self.settings.slowest_hz()).ceil() as u32
    }

    /// Client frames after a picture in which flicker is watched, the last one not after `until_s`.
    fn watched(&self, time_s: f64, until_s: f64) -> Vec<f64> {
        let step = self.client_frames_a_step().min(MAX_WATCHED);
        let left = ((until_s - time_s) * CLIENT_HZ + 1e-6) as u32;
        (1..=step.min(left)).map(|k| time_s + f64::from(k) / CLIENT_HZ).collect()
    }

    fn make(
        &self,
        time_s: f64,
        watched_s: &[f64],
        cache: &Cache,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Frame> {
        let scene = self.scene();
        let camera = self.camera(time_s);
        let drawn = draw(scene, &camera, time_s, &self.params)?;
        let request = Request {
            scene,
            drawn: &drawn,
            rays: self.settings.rays_per_sample(self.settings.reference_rays),
            radius_m: self.radius_m,
            seed: self.settings.seed,
        };
        let traced = cache.get(&request, || self.tracer_at(&drawn), progress)?;
        let ambient = self.settings.gather_ambient.then(|| {
            let open_world = open_directions(&request, &self.tracer_at(&drawn));
            let openings = Openings::Traced(&open_world);
            let gathering = Gathering { visibility: &traced.visibility, openings };
            shade_gathered(scene, &drawn.pose, &camera, &drawn.gbuffer, self.shade(), gathering)
        });
        let open_light = self.settings.has_area_lights().then(|| {
            let points = shading_points(scene, &drawn.pose, &camera, &drawn.gbuffer, self.shade().specular);
            let table = AreaLightTable::new(&AreaLights::new(scene, &drawn.pose));
            shade_area_lights(&points, &table, |_, seen| seen.fill(SeenLight::ALL))
        });
        let reflected = open_light.as_ref().map(|_| {
            let params = DirectParams {
                samples: self.settings.rays_per_sample(self.settings.reference_rays),
                seed: u64::from(self.settings.seed) << 8,
                ..DirectParams::default()
            };
            self.traced_light(&drawn, &params).0
        });
        let truth = Shown::lit(&drawn, ambient.as_deref(), reflected.as_deref(), Some(&traced.visibility))?;
        // What the client shows first may be a step old: what moved since then is no flicker when it arrives.
        let before =
            (1..=self.client_frames_a_step().min(MAX_WATCHED)).map(|k| time_s - f64::from(k) / CLIENT_HZ);
        let times_s: Vec<f64> = before.filter(|t| *t >= 0.0).chain(watched_s.iter().copied()).collect();
        let still = still_map(scene, &drawn, &times_s, &self.moving, self.radius_m);
        let (noise_mse, watched_s) = (traced.noise_mse, watched_s.to_vec());
        Ok(Frame { time_s, drawn, truth, noise_mse, watched_s, still, open_light })
    }

    /// What each sample reflects of area lights, by rays; and how many these are.
    pub(super) fn traced_light(&self, drawn: &Drawn, params: &DirectParams) -> (Vec<Vec3>, u64) {
        let scene = self.scene();
        let camera = self.camera_at(drawn);
        let points = shading_points(scene, &drawn.pose, &camera, &drawn.gbuffer, self.shade().specular);
        let lights = AreaLights::new(scene, &drawn.pose);
        let mut radiance = vec![Vec3::ZERO; points.len()];
        let counts = trace_direct(&self.tracer_at(drawn), &lights, &points, params, &mut radiance);
        // What surfaces emit is drawn already.
        for (radiance, point) in radiance.iter_mut().zip(&points) {
            *radiance = point.as_ref().map_or(Vec3::ZERO, |point| point.reflected_of(*radiance));
        }
        (radiance, counts.rays)
    }

    /// How pictures are shaded.
    pub(super) fn shade(&self) -> &ShadeParams {
        &self.params.shade
    }

    /// The camera that a picture of the path was drawn with.
    pub(super) fn camera_at(&self, drawn: &Drawn) -> PosedCamera {
        self.camera(drawn.pose.time)
    }

    /// The path's camera.
    pub(super) fn camera(&self, time_s: f64) -> PosedCamera {
        let scene = self.scene();
        self.path.camera(scene, &scene.pose_undeformed(time_s))
    }

    /// What screen-space methods look at in a picture of the scene, or of one made from it.
    pub(super) fn sight<'b>(
        &self,
        scene: &'b Scene,
        pose: &'b Pose,
        camera: &'b PosedCamera,
        gbuffer: &'b GBuffer,
    ) -> Sight<'b> {
        Sight { scene, pose, camera, gbuffer, radius_m: self.radius_m, seed: self.settings.seed }
    }

    /// The scene's tracer in a picture's pose.
    pub(super) fn tracer_at(&self, drawn: &Drawn) -> Ref<'_, Tracer> {
        self.tracer_in(&drawn.pose)
    }

    /// The scene's tracer in a pose of the scene.
    pub(super) fn tracer_in(&self, pose: &Pose) -> Ref<'_, Tracer> {
        if self.tracer.borrow().1 != Some(pose.time) {
            let mut tracer = self.tracer.borrow_mut();
            tracer.0.update(self.scene(), pose);
            tracer.1 = Some(pose.time);
        }
        Ref::map(self.tracer.borrow(), |tracer| &tracer.0)
    }
}

/// How long a path lasts; a camera that stands still watches the animation once, or ten seconds of a still scene.
fn path_seconds(scene: &Scene, path: &CameraPath) -> f64 {
    let animated = scene.active_animation.map_or(0.0, |i| f64::from(scene.animations[i as usize].duration()));
    [path.duration_s(), animated, 10.0].into_iter().find(|s| *s > 0.0).unwrap_or(10.0)
}

/// One time in each of `frames` equal pieces, on the client's frame grid; fewer where pieces are shorter than its steps.
/// The first is in the middle of its piece. Each next one lies a golden part further in its own: were all in the middle, a path
/// whose pieces last a whole number of server steps would be seen at one lag after a step alone.
fn frame_times(frames: u32, seconds: f64) -> Vec<f64> {
    let mut times: Vec<f64> = (0..frames)
        .map(|i| {
            let i = f64::from(i);
            let at = (i + (0.5 + i * GOLDEN) % 1.0) / f64::from(frames) * seconds;
            (at * CLIENT_HZ).floor() / CLIENT_HZ
        })
        .collect();
    times.dedup();
    times
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_lie_on_the_grid_inside_their_pieces() {
        for n in [1u32, 2, 3, 4, 30, 900] {
            let times = frame_times(n, 15.0);
            assert!(times.windows(2).all(|w| w[0] < w[1]), "{n}");
            let piece_s = 15.0 / f64::from(n);
            for (i, time_s) in times.iter().enumerate() {
                let steps = time_s * CLIENT_HZ;
                assert!((steps - steps.round()).abs() < 1e-9, "{n}: {time_s}");
                let start_s = i as f64 * piece_s;
                // The grid takes up to a step off.
                assert!(
                    (start_s - 1.0 / CLIENT_HZ..start_s + piece_s).contains(time_s),
                    "{n}: {i}: {time_s}"
                );
            }
        }
        assert_eq!(frame_times(1, 15.0), [7.5]);
        let crowded = frame_times(60, 0.1);
        assert!(
            crowded.len() <= 6 && crowded.windows(2).all(|w| w[0] < w[1]),
            "no picture twice: {crowded:?}"
        );
    }

    #[test]
    fn pictures_see_every_lag_after_a_server_step() {
        for (frames, hz) in [(8, 15.0), (30, 15.0), (60, 30.0), (60, 5.0), (75, 5.0)] {
            // Client frames since the last step.
            let lags: std::collections::BTreeSet<u32> = frame_times(frames, 15.0)
                .into_iter()
                .map(|t| (t * CLIENT_HZ).round() as u32 % (CLIENT_HZ / hz) as u32)
                .collect();
            assert_eq!(lags.len(), (CLIENT_HZ / hz) as usize, "{frames} pictures at {hz} Hz: {lags:?}");
        }
    }
}
