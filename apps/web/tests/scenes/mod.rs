//! What the browser is shown, and the twin's pictures of the same.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use dapple_client::{Client, PictureParams, Reconstruction, draw};
use dapple_render::image::ToneMap;
use dapple_render::shade::ShadeParams;
use dapple_scene::glam::Vec3;
use dapple_scene::{NoFiles, PosedCamera, Scene, builtin};
use dapple_server::{Server, ServerConfig};
use dapple_stream::{Limits, Recorder, RecordingHeader};

/// Size of the pictures, pixels.
pub(crate) const WIDTH: u32 = 320;
/// Size of the pictures, pixels.
pub(crate) const HEIGHT: u32 = 180;
/// Texels along a side of the shadow maps, in the page and the twin.
pub(crate) const SHADOW_RESOLUTION: u32 = 512;
/// Updates a second.
const HZ: u32 = 15;
/// Vertical field of view, degrees.
pub(crate) const YFOV_DEGREES: f32 = 60.0;

/// One picture, as the twin draws it.
pub(crate) struct Shot {
    /// Name of the picture.
    pub(crate) name: String,
    /// Where it is taken from, metres.
    pub(crate) eye: Vec3,
    /// What is in its middle, metres.
    pub(crate) target: Vec3,
    /// Time of the scene, seconds.
    pub(crate) time_s: f64,
    /// sRGB bytes with visibility.
    pub(crate) lit: Vec<u8>,
    /// sRGB bytes with all open.
    pub(crate) open: Vec<u8>,
}

/// A scene, its stream, and pictures of both.
pub(crate) struct Prepared {
    pub(crate) name: &'static str,
    glb: Vec<u8>,
    stream: Vec<u8>,
    /// As the scene's first camera sees it at the start, and something that moves at the end.
    pub(crate) shots: Vec<Shot>,
}

impl Prepared {
    /// The part of the page's address that names the scene and its stream.
    pub(crate) fn query(&self) -> String {
        format!("?scene=data/{0}.glb&stream=data/{0}.dapple", self.name)
    }

    /// Writes the scene and its stream into a folder, as `NAME.glb` and `NAME.dapple`.
    pub(crate) fn write(&self, folder: &Path) {
        let file = |extension| folder.join(format!("{}.{extension}", self.name));
        std::fs::write(file("glb"), &self.glb).expect("the scene is written");
        std::fs::write(file("dapple"), &self.stream).expect("the stream is written");
    }
}

/// The built-in hall in few triangles, its stream of one second, and pictures.
pub(crate) fn hall() -> Prepared {
    make("hall", hall_glb(), &ServerConfig::default(), 64.0, 1, true)
}

/// The hall with so few points that they are soon traced, without pictures; 0 seconds are a snapshot alone.
pub(crate) fn hint_of_a_hall(seconds: u32) -> Prepared {
    make("hall", hall_glb(), &ServerConfig::default(), 8.0, seconds, false)
}

fn hall_glb() -> Vec<u8> {
    builtin::glb("atrium", 0.02).expect("a built-in scene")
}

/// A walking figure, if it is at hand.
pub(crate) fn walker() -> Option<Prepared> {
    let shared = std::env::var_os("DAPPLE_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"), PathBuf::from);
    let file = shared.join("scenes/anim-CesiumMan/CesiumMan.glb");
    let Ok(glb) = std::fs::read(&file) else {
        eprintln!("skipped: a walker in the page: no {}", file.display());
        return None;
    };
    let mut config = ServerConfig::default();
    config.update.radius_m = 0.3;
    Some(make("walker", glb, &config, 4000.0, 1, true))
}

fn make(
    name: &'static str,
    glb: Vec<u8>,
    config: &ServerConfig,
    points_per_m2: f32,
    seconds: u32,
    takes_pictures: bool,
) -> Prepared {
    let scene = Arc::new(dapple_scene::load("scene.glb", &glb, &NoFiles).expect("a scene"));
    let mut config = *config;
    config.generate.points_per_m2 = points_per_m2;
    let mut server = Server::new(Arc::clone(&scene), &config, &|_| {}).expect("a server");
    let mut client = Client::new(Arc::clone(&scene), Limits::default());
    let header = RecordingHeader {
        scene_hash: scene.hash().0,
        name: name.to_owned(),
        duration_us: u64::from(seconds) * 1_000_000,
    };
    let (mut recorder, mut stream) = Recorder::new(&header).expect("a recorder");

    let mut shots = Vec::new();
    for tick in 0..=seconds * HZ {
        let time_s = f64::from(tick) / f64::from(HZ);
        let frame = server.step(time_s).expect("a step").frame;
        let frame = if tick == 0 { server.join().expect("a snapshot") } else { frame };
        if let Some(frame) = frame {
            let time_us = (time_s * 1e6).round() as u64;
            stream.extend(recorder.frame(time_us, &frame.bytes).expect("frames in order"));
            client.receive(&frame.bytes).expect("a sound frame");
        }
        if tick == 0 && takes_pictures {
            let path = scene.camera_paths().swap_remove(0);
            let camera = path.camera(&scene, &scene.pose(0.0));
            let eye = camera.eye_world();
            let target = eye - Vec3::from(camera.world_from_view.matrix3.z_axis);
            shots.push(take(format!("{name}-start"), &scene, &client, (eye, target), time_s));
        }
    }
    if takes_pictures {
        let time_s = f64::from(seconds);
        let place = before_a_mover(&scene, time_s);
        shots.push(take(format!("{name}-mover"), &scene, &client, place, time_s));
    }
    stream.extend(recorder.finish());
    Prepared { name, glb, stream, shots }
}

fn take(name: String, scene: &Scene, client: &Client, (eye, target): (Vec3, Vec3), time_s: f64) -> Shot {
    let camera = PosedCamera::look_at(eye, target, YFOV_DEGREES.to_radians());
    let shade = ShadeParams { shadow_resolution: SHADOW_RESOLUTION, ..ShadeParams::default() };
    let params = PictureParams { width: WIDTH, height: HEIGHT, supersample: 2, shade };
    let drawn = draw(scene, &camera, time_s, &params).expect("a picture");
    let visibility = client.visibility(&drawn, &Reconstruction::default());
    let [lit, open] = [Some(visibility.as_slice()), None].map(|visibility| {
        let picture = drawn.compose(visibility).expect("a visibility a sample").to_rgb8(&ToneMap::default());
        picture.pixels.into_flattened()
    });
    Shot { name, eye, target, time_s, lit, open }
}

/// Eye and target from where most of something is seen that stands elsewhere than at the start.
fn before_a_mover(scene: &Scene, time_s: f64) -> (Vec3, Vec3) {
    let (start, pose) = (scene.pose(0.0), scene.pose(time_s));
    // Only what is seen is asked.
    let shade = ShadeParams { max_shadowed_lights: 0, ..ShadeParams::default() };
    let params = PictureParams { width: 64, height: 36, supersample: 1, shade };
    let mut best = (0, Vec3::ONE, Vec3::ZERO);
    for index in 0..scene.instances.len() {
        let [before, bounds] = [&start, &pose].map(|pose| scene.instance_bounds_world(pose, index));
        if before == bounds {
            continue;
        }
        let target = 0.5 * (bounds.min + bounds.max);
        for direction in [Vec3::X, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Z] {
            let eye = target + bounds.diagonal() * (1.3 * direction + 0.4 * Vec3::Y);
            let camera = PosedCamera::look_at(eye, target, YFOV_DEGREES.to_radians());
            let Ok(drawn) = draw(scene, &camera, time_s, &params) else { continue };
            let seen = drawn.gbuffer.samples().iter().filter(|sample| sample.instance as usize == index);
            best = std::cmp::max_by_key(best, (seen.count(), eye, target), |candidate| candidate.0);
        }
    }
    assert!(best.0 > 64 * 36 / 50, "nothing that moves is in view: {} samples", best.0);
    (best.1, best.2)
}
