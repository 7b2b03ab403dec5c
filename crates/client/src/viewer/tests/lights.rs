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

#[test]
fn area_lights_are_those_of_the_processor_and_can_be_switched_off() {
    let Some(gpu) = gpu_for_tests() else { return };
    let glb = builtin::glb("street", 0.05).expect("the name is known");
    let scene = Arc::new(dapple_scene::load("street.glb", &glb, &NoFiles).expect("the loader reads it"));
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
    viewer
        .receive(&plain.join().expect("it publishes").expect("as it starts").bytes, 0.0)
        .expect("it is sound");
    work_to_the_end(&mut viewer, usize::MAX);
    let without = picture(&gpu, &mut viewer, 0.0, 0.0, &on);
    assert!(without == picture(&gpu, &mut viewer, 0.0, 0.0, &off));
    viewer.outdate();

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
        let (mean, apart) = differences(&shown, &beauty(&client, &scene, time_s, true));
        println!("{tick}: mean difference {mean}, {apart} of the pixels off");
        assert!(mean < 1.5 && apart < 0.05, "{tick}: mean difference {mean}, {apart} of the pixels off");
        let dark = picture(&gpu, &mut viewer, time_s, time_s, &off);
        let (lit, _) = differences(&dark, &beauty(&client, &scene, time_s, true));
        assert!(lit > 10.0, "{tick}: lights are seen, {lit}");
        let (mean, _) = differences(&dark, &beauty(&client, &scene, time_s, false));
        assert!(mean < 1.5, "{tick}: without lights, {mean}");
    }
    assert_eq!(viewer.problem(), None);
}
