//! Any bytes as a scene file: what loads can be posed, traced and drawn.

use dapple_client::{PictureParams, draw};
use dapple_render::shade::ShadeParams;
use dapple_scene::glam::Vec3;
use dapple_scene::{NoFiles, Scene};
use dapple_trace::{Ray, Tracer};

/// Most triangles in all instances, and most nodes, of a scene that is also traced and drawn: what a few bytes
/// can ask for by instancing must not slow the search down.
const MAX_TRIANGLES: usize = 1 << 16;

/// Loads `data` as a GLB, a glTF or (any other start) an OBJ file. Nothing may panic; whatever loads twice is the
/// same scene twice, and all that a program does with a scene works on it.
pub fn load_scene(data: &[u8]) {
    let name = if data.starts_with(b"glTF") {
        "x.glb"
    } else if data.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{') {
        "x.gltf"
    } else {
        "x.obj"
    };
    match dapple_scene::load(name, data, &NoFiles) {
        Ok(scene) => use_scene(&scene, &dapple_scene::load(name, data, &NoFiles).expect("it loaded before")),
        Err(error) => assert!(error.to_string().contains(name), "the message names no file: {error}"),
    }
}

fn use_scene(scene: &Scene, again: &Scene) {
    assert_eq!(scene.hash(), again.hash());
    assert!(scene.auto_radius_m().is_finite());
    if scene.triangle_count() > MAX_TRIANGLES {
        return;
    }
    let mut tracer = None;
    for time_s in [0.0, 0.7] {
        let pose = scene.pose(time_s);
        let tracer = tracer.get_or_insert_with(|| Tracer::new(scene, &pose));
        tracer.update(scene, &pose);
        let bounds = scene.bounds_world(&pose);
        let (center, reach) = (bounds.center(), bounds.diagonal());
        let directions = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
        let blocked = tracer.occlusion(center, &directions, reach);
        for (i, &direction_world) in directions.iter().enumerate() {
            let ray = Ray { origin_world: center, direction_world, t_max: reach };
            let occluded = tracer.occluded(&ray);
            assert_eq!(occluded, blocked[0] >> i & 1 == 1, "one ray and a bundle disagree");
            assert_eq!(occluded, tracer.closest_hit(&ray).is_some(), "any hit and closest hit disagree");
        }
        for path in scene.camera_paths() {
            let camera = path.camera(scene, &pose);
            let shade = ShadeParams { shadow_resolution: 16, ..ShadeParams::default() };
            let params = PictureParams { width: 12, height: 9, supersample: 1, shade };
            // A lens may be too strange to draw with; then that is said.
            if let Ok(drawn) = draw(scene, &camera, time_s, &params) {
                drawn.compose(None).expect("as many samples as were drawn");
            }
        }
    }
}
