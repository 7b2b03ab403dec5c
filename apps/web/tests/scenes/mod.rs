//! What the browser is shown, and the twin's pictures of the same.

use std::path::Path;
use std::sync::{Arc, LazyLock};

use dapple_client::{Client, PictureParams, Reconstruction, draw};
use dapple_render::image::ToneMap;
use dapple_render::shade::ShadeParams;
use dapple_scene::glam::Vec3;
use dapple_scene::{NoFiles, PosedCamera, Scene, builtin};
use dapple_server::{Server, ServerConfig};
use dapple_stream::{Limits, Recorder, RecordingHeader};

/// Size of the pictures, pixels.
pub const WIDTH: u32 = 640;
/// Size of the pictures, pixels.
pub const HEIGHT: u32 = 360;
/// Length of the stream, seconds, and its updates a second.
const SECONDS: u32 = 1;
const HZ: u32 = 15;

/// One picture, as the twin draws it.
pub struct Shot {
    /// Name of the picture.
    pub name: &'static str,
    /// Where it is taken from, metres.
    pub eye: Vec3,
    /// What is in its middle, metres.
    pub target: Vec3,
    /// Vertical field of view, degrees.
    pub yfov_degrees: f32,
    /// Time of the scene, seconds.
    pub time_s: f64,
    /// sRGB bytes with visibility.
    pub lit: Vec<u8>,
    /// sRGB bytes with all open.
    pub open: Vec<u8>,
}

/// A scene, its stream, and pictures of both.
pub struct Prepared {
    glb: Vec<u8>,
    stream: Vec<u8>,
    /// The hall at the start, and walkers at the end.
    pub shots: Vec<Shot>,
}

/// Writes `scene.glb` and `stream.dapple` into a folder.
pub fn prepare(folder: &Path) -> &'static Prepared {
    // All tests of a run show the same.
    static PREPARED: LazyLock<Prepared> = LazyLock::new(make);
    std::fs::write(folder.join("scene.glb"), &PREPARED.glb).expect("the scene is written");
    std::fs::write(folder.join("stream.dapple"), &PREPARED.stream).expect("the stream is written");
    &PREPARED
}

fn make() -> Prepared {
    let glb = builtin::glb("atrium", 0.1).expect("a built-in scene");
    let scene = Arc::new(dapple_scene::load("scene.glb", &glb, &NoFiles).expect("a scene"));
    let mut config = ServerConfig::default();
    config.generate.points_per_m2 = 128.0;
    let mut server = Server::new(Arc::clone(&scene), &config, &|_| {}).expect("a server");
    let mut client = Client::new(Arc::clone(&scene), Limits::default());
    let header = RecordingHeader {
        scene_hash: scene.hash().0,
        name: "the tests' stream".into(),
        duration_us: u64::from(SECONDS) * 1_000_000,
    };
    let (mut recorder, mut stream) = Recorder::new(&header).expect("a recorder");

    let mut shots = Vec::new();
    for tick in 0..=SECONDS * HZ {
        let time_s = f64::from(tick) / f64::from(HZ);
        let frame = server.step(time_s).expect("a step").frame;
        let frame = if tick == 0 { server.join().expect("a snapshot") } else { frame };
        if let Some(frame) = frame {
            let time_us = (time_s * 1e6).round() as u64;
            stream.extend(recorder.frame(time_us, &frame.bytes).expect("frames in order"));
            client.receive(&frame.bytes).expect("a sound frame");
        }
        if tick == 0 {
            let path = scene.camera_paths().swap_remove(0);
            let camera = path.camera(&scene, &scene.pose(0.0));
            let eye = camera.eye_world();
            let target = eye - 4.0 * Vec3::from(camera.world_from_view.matrix3.z_axis);
            shots.push(take("hall", &scene, &client, eye, target, time_s));
        }
    }
    let time_s = f64::from(SECONDS);
    let (eye, target) = before_a_walker(&scene, time_s);
    shots.push(take("walkers", &scene, &client, eye, target, time_s));
    stream.extend(recorder.finish());
    Prepared { glb, stream, shots }
}

fn take(name: &'static str, scene: &Scene, client: &Client, eye: Vec3, target: Vec3, time_s: f64) -> Shot {
    let yfov_degrees = 60.0;
    let camera = PosedCamera::look_at(eye, target, f32::to_radians(yfov_degrees));
    let params =
        PictureParams { width: WIDTH, height: HEIGHT, supersample: 2, shade: ShadeParams::default() };
    let drawn = draw(scene, &camera, time_s, &params).expect("a picture");
    let visibility = client.visibility(&drawn, &Reconstruction::default());
    let [lit, open] = [Some(visibility.as_slice()), None].map(|visibility| {
        let picture = drawn.compose(visibility).expect("a visibility a sample").to_rgb8(&ToneMap::default());
        picture.pixels.into_flattened()
    });
    Shot { name, eye, target, yfov_degrees, time_s, lit, open }
}

/// Eye and target from where most of something with a skin is seen.
fn before_a_walker(scene: &Scene, time_s: f64) -> (Vec3, Vec3) {
    let pose = scene.pose(time_s);
    let params = PictureParams { width: 64, height: 36, supersample: 1, shade: ShadeParams::default() };
    let mut best = (0, Vec3::ONE, Vec3::ZERO);
    for (index, instance) in scene.instances.iter().enumerate().filter(|(_, i)| i.skin.is_some()) {
        let bounds = scene.instance_bounds_world(&pose, index);
        let target = 0.5 * (bounds.min + bounds.max);
        for direction in [Vec3::X, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Z] {
            let eye = target + 3.0 * direction + 0.7 * Vec3::Y;
            let camera = PosedCamera::look_at(eye, target, f32::to_radians(60.0));
            let Ok(drawn) = draw(scene, &camera, time_s, &params) else { continue };
            let seen = drawn.gbuffer.samples().iter().filter(|sample| {
                scene.instances.get(sample.instance as usize).is_some_and(|seen| seen.skin == instance.skin)
            });
            best = std::cmp::max_by_key(best, (seen.count(), eye, target), |candidate| candidate.0);
        }
    }
    assert!(best.0 > 64 * 36 / 50, "no walker is in view: {} samples", best.0);
    (best.1, best.2)
}
