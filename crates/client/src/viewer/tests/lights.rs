//! Area lights, as the client on the processor draws them: after updates, switched off, and where the stream has none.

use dapple_render::image::ToneMap;
use dapple_render::shade::ShadeParams;

use super::*;

/// A beauty picture by the processor, with or without area lights; `None` for the background.
fn beauty(client: &Client, scene: &Scene, time_s: f64, lights: bool) -> Vec<Option<[u8; 3]>> {
    // No sun is made up where lights shine.
    let shade = ShadeParams { sun_without_lights: !lights, ..ShadeParams::default() };
    let camera = camera(scene, time_s);
    let params = PictureParams { width: SIZE.0, height: SIZE.1, supersample: 1, shade };
    let mut drawn = client.draw(&camera, time_s, &params).expect("it draws");
    if lights {
        let reflected = client.area_light(&drawn, &camera, &params.shade);
        drawn.shaded.direct.iter_mut().zip(reflected).for_each(|(direct, more)| *direct += more);
    }
    let visibility = client.visibility(&drawn, &Reconstruction::Atlas);
    let picture = drawn.compose(Some(&visibility)).expect("it fits").to_rgb8(&ToneMap::default());
    drawn.gbuffer.samples().iter().zip(picture.pixels).map(|(s, p)| s.is_covered().then_some(p)).collect()
}

/// Mean difference of channels in codes, and the part of pixels off by more than 6 in any.
fn differences(shown: &[[u8; 4]], twin: &[Option<[u8; 3]>]) -> (f64, f64) {
    let (mut sum, mut off, mut count) = (0.0, 0.0, 0.0);
    for (shown, twin) in shown.iter().zip(twin) {
        let Some(twin) = twin else { continue };
        let apart = [0, 1, 2].map(|k| f64::from(shown[k].abs_diff(twin[k])));
        sum += apart.iter().sum::<f64>() / 3.0;
        off += f64::from(u8::from(apart.iter().any(|d| *d > 6.0)));
        count += 1.0;
    }
    assert!(count > 1000.0, "the camera sees the scene");
    (sum / count, off / count)
}

/// A viewer that has joined a server and has its light.
fn viewer_of(gpu: &Gpu, scene: &Arc<Scene>, server: &mut Server) -> Viewer {
    let mut viewer = viewer(gpu, scene);
    let join = server.join().expect("it publishes").expect("as it starts");
    viewer.receive(&join.bytes, 0.0).expect("it is sound");
    work_to_the_end(&mut viewer, usize::MAX);
    viewer
}

#[test]
fn area_lights_are_those_of_the_processor_and_can_be_switched_off() {
    let Some(gpu) = gpu_for_tests() else { return };
    let glb = builtin::glb("street", 0.05).expect("the name is known");
    let mut scene = dapple_scene::load("street.glb", &glb, &NoFiles).expect("the loader reads it");
    // Textures that are far finer than pixels differ where nothing else does.
    for material in &mut scene.materials {
        (material.base_color_texture, material.metallic_roughness_texture) = (None, None);
        material.normal_texture = None;
    }
    let scene = Arc::new(scene);
    let mut config = ServerConfig::default();
    config.generate.points_per_m2 = 4.0;
    config.update.rays = 16;
    config.cuts = false;
    let mut plain = Server::new(scene.clone(), &config, &|_| ()).expect("it is in range");
    config.lights = Some(Default::default());
    let mut server = Server::new(scene.clone(), &config, &|_| ()).expect("it is in range");
    let (mut client, mut viewer) = (Client::new(scene.clone(), Limits::default()), viewer(&gpu, &scene));
    let on = DrawOptions { fade_s: Some(0.0), ..DrawOptions::default() };
    let off = DrawOptions { area_lights: false, ..on };

    // A stream that says nothing of lights shows none.
    let mut other = viewer_of(&gpu, &scene, &mut plain);
    let without = picture(&gpu, &mut other, 0.0, 0.0, &on);
    assert!(without == picture(&gpu, &mut other, 0.0, 0.0, &off));

    let join = server.join().expect("it publishes").expect("as it starts");
    client.receive(&join.bytes).expect("it is sound");
    viewer.receive(&join.bytes, 0.0).expect("it is sound");
    work_to_the_end(&mut viewer, usize::MAX);
    for tick in 0..=4 {
        let time_s = f64::from(tick) / 5.0;
        if let Some(frame) = server.step(time_s).expect("it steps").frame {
            client.receive(&frame.bytes).expect("it is sound");
            viewer.receive(&frame.bytes, time_s).expect("it is sound");
        }
        let shown = picture(&gpu, &mut viewer, time_s, time_s, &on);
        let dark = picture(&gpu, &mut viewer, time_s, time_s, &off);
        let (lit_twin, dark_twin) =
            (beauty(&client, &scene, time_s, true), beauty(&client, &scene, time_s, false));
        let of_dark = differences(&dark, &dark_twin);
        let of_lit = differences(&shown, &lit_twin);
        println!(
            "{tick}: mean difference and part of the pixels off: {of_lit:?}, without lights {of_dark:?}"
        );
        assert!(of_dark.0 < 1.5 && of_dark.1 < 0.05, "{tick}: without lights {of_dark:?}");
        assert!(of_lit.0 < 1.5 && of_lit.1 < 0.05, "{tick}: {of_lit:?}");
        let (apart, _) = differences(&dark, &lit_twin);
        assert!(apart > 3.0, "{tick}: lights are seen, {apart}");
    }
    assert_eq!(viewer.problem(), None);
}
