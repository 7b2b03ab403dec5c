//! Bent normals through the whole loop: light of two colours comes from where it is open, and without them nothing differs.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::sync::Arc;

use common::{atrium, config, join, made, server, small, truth};
use dapple_client::{Client, Drawn, PictureParams, Reconstruction};
use dapple_metrics::psnr;
use dapple_render::image::ToneMap;
use dapple_render::shade::{Ambient, Gathering, Openings, shade_gathered};
use dapple_scene::glam::Vec3;
use dapple_scene::{NoFiles, PosedCamera, Scene};
use dapple_server::{Server, ServerConfig};
use dapple_trace::Tracer;
use dapple_trace::rtao::{BentVisibility, RtaoParams, Site, SmoothSite, trace_bent};

/// Warm light from above, blue from below.
const TWO_COLOURS: Ambient =
    Ambient::Hemisphere { sky: Vec3::new(0.9, 0.8, 0.6), ground: Vec3::new(0.1, 0.15, 0.4) };

fn picture(ambient: Ambient) -> PictureParams {
    let mut params = small(160, 120);
    params.shade.ambient = ambient;
    params.shade.sun_without_lights = false;
    params
}

fn bent(mut config: ServerConfig) -> ServerConfig {
    config.update.bent_normals = true;
    config
}

/// A floor and two walls, facing inwards.
fn corner() -> Arc<Scene> {
    let obj = "v 0 0 0\nv 2 0 0\nv 2 0 2\nv 0 0 2\nv 0 2 0\nv 2 2 0\nv 0 2 2\n\
        f 1 4 3 2\nf 1 2 6 5\nf 1 5 7 4\n";
    Arc::new(dapple_scene::load("corner.obj", obj.as_bytes(), &NoFiles).unwrap())
}

/// Mean open direction of every sample by rays, in the world, blocked ones as zero.
fn open_directions(scene: &Scene, drawn: &Drawn, rays: &RtaoParams) -> Vec<Vec3> {
    let tracer = Tracer::new(scene, &drawn.pose);
    let sites = drawn.gbuffer.map_surfaces(scene, &drawn.pose, |index, surface| {
        let site = surface.map(|s| Site {
            position_world: s.position_world,
            normal_world: s.normal_world,
            key: index as u64,
        });
        let site = site.unwrap_or(Site { position_world: Vec3::ZERO, normal_world: Vec3::ZERO, key: 0 });
        SmoothSite { site, shading_normal_world: site.normal_world, first_ray: 0, axes_world: None }
    });
    let mut traced = vec![BentVisibility::default(); sites.len()];
    trace_bent(&tracer, &sites, rays, &mut traced);
    traced.iter().map(|traced| traced.open_world).collect()
}

/// The picture whose ambient light is gathered from the directions that rays find open.
fn true_picture(scene: &Scene, drawn: &Drawn, camera: &PosedCamera, params: &PictureParams) -> Vec<f32> {
    let rays = RtaoParams { rays: 256, radius_m: 0.6, seed: 1 };
    let visibility = truth(scene, drawn, rays.rays, rays.radius_m);
    let open_world = open_directions(scene, drawn, &rays);
    let gathering = Gathering { visibility: &visibility, openings: Openings::Traced(&open_world) };
    let ambient = shade_gathered(scene, &drawn.pose, camera, &drawn.gbuffer, &params.shade, gathering);
    bytes(drawn, Some(&ambient), &visibility)
}

/// The picture as a screen gets it, 0 … 1.
fn bytes(drawn: &Drawn, ambient: Option<&[Vec3]>, visibility: &[f32]) -> Vec<f32> {
    let picture = drawn.compose_with(ambient, Some(visibility)).unwrap().to_rgb8(&ToneMap::default());
    picture.pixels.as_flattened().iter().map(|byte| f32::from(*byte) / 255.0).collect()
}

/// PSNR of a client's picture in dB: about the surface's own normals, and about bent ones.
fn compare(client: &Client, scene: &Scene, camera: &PosedCamera, time_s: f64) -> [f64; 2] {
    let params = picture(TWO_COLOURS);
    let drawn = client.draw(camera, time_s, &params).unwrap();
    let expected = true_picture(scene, &drawn, camera, &params);
    let visibility = client.visibility(&drawn, &Reconstruction::default());
    let ambient = client.ambient(&drawn, camera, &params.shade, &visibility).unwrap();
    let found = [None, Some(&ambient[..])]
        .map(|ambient| psnr(&expected, &bytes(&drawn, ambient, &visibility), 1.0).unwrap());
    eprintln!("{}: plain {:.2} dB, bent {:.2} dB", scene.name, found[0], found[1]);
    found
}

#[test]
fn in_a_corner_light_of_two_colours_comes_from_where_it_is_open() {
    let scene = corner();
    let mut server = server(&scene, &bent(config(600.0, 64)));
    let client = join(&mut server);
    let camera = PosedCamera::look_at(Vec3::new(1.7, 1.3, 1.5), Vec3::new(0.2, 0.3, 0.2), 0.8);
    let [plain, bent] = compare(&client, &scene, &camera, 0.0);
    assert!(bent > plain + 2.0, "plain {plain:.2} dB, bent {bent:.2} dB");
}

#[test]
fn what_folds_takes_its_bent_normals_along() {
    let scene = Arc::new(dapple_scene::load("sheet.glb", &made::folding_sheet(), &NoFiles).unwrap());
    let mut server = server(&scene, &bent(config(1000.0, 128)));
    let mut client = join(&mut server);
    for tick in 1..=15 {
        if let Some(frame) = server.step(f64::from(tick) / 15.0).unwrap().frame {
            client.receive(&frame.bytes).unwrap();
        }
    }
    let path = scene.camera_paths().into_iter().find(|p| p.name == "front").unwrap();
    let camera = path.camera(&scene, &scene.pose(1.0));
    let drawn = client.draw(&camera, 1.0, &small(120, 90)).unwrap();
    let open = open_directions(&scene, &drawn, &RtaoParams { rays: 256, radius_m: 0.6, seed: 1 });
    let bent = client.atlas().unwrap().reconstruct_bent(&scene, &drawn.pose, &drawn.gbuffer);
    let normals = drawn
        .gbuffer
        .map_surfaces(&scene, &drawn.pose, |_, surface| surface.map_or(Vec3::ZERO, |s| s.normal_world));
    // Where the surface is bent away from what is open.
    let (mut plain, mut found, mut count) = (0.0, 0.0, 0);
    for ((open, bent), normal) in open.iter().zip(&bent).zip(&normals) {
        if *open == Vec3::ZERO || normal.angle_between(*open).to_degrees() < 10.0 {
            continue;
        }
        plain += normal.angle_between(*open).to_degrees();
        found += bent.angle_between(*open).to_degrees();
        count += 1;
    }
    let [plain, found] = [plain, found].map(|sum| sum / count as f32);
    eprintln!("sheet: normals {plain:.1}°, bent normals {found:.1}° off at {count} samples");
    assert!(count > 200 && found < 0.4 * plain, "normals {plain:.1}°, bent normals {found:.1}° of {count}");
}

/// Steps a server through boulders that roll; a client follows.
fn follow(server: &mut Server, client: &mut Client) {
    for time_s in [0.2, 0.4, 0.45, 1.0, 3.0] {
        if let Some(frame) = server.step(time_s).unwrap().frame {
            client.receive(&frame.bytes).unwrap();
        }
        assert!(client.store() == Some(server.store()));
    }
}

#[test]
fn who_follows_and_who_joins_late_draw_the_same_to_the_bit() {
    let scene = atrium(0.05);
    let mut server = server(&scene, &bent(config(24.0, 32)));
    let mut client = join(&mut server);
    let camera = scene.camera_paths()[0].camera(&scene, &scene.pose(3.0));
    let params = picture(TWO_COLOURS);
    let drawn = client.draw(&camera, 3.0, &params).unwrap();
    let ambient = |client: &Client, drawn: &Drawn, params: &PictureParams| {
        let visibility = client.visibility(drawn, &Reconstruction::default());
        client.ambient(drawn, &camera, &params.shade, &visibility)
    };
    // Made now, so that all changes are applied to it.
    let first = ambient(&client, &drawn, &params).unwrap();
    follow(&mut server, &mut client);
    let late = join(&mut server);
    assert!(late.store() == client.store() && late.store().unwrap().bent().is_some());
    let followed = ambient(&client, &drawn, &params).unwrap();
    assert!(followed == ambient(&late, &drawn, &params).unwrap());
    assert!(followed != first, "something moved");
    // Under light of one colour it does not matter from where it comes.
    let params = picture(Ambient::Constant(Vec3::new(0.3, 0.4, 0.5)));
    let drawn = client.draw(&camera, 3.0, &params).unwrap();
    assert!(ambient(&client, &drawn, &params).unwrap() == drawn.shaded.ambient);
}

#[test]
fn without_them_nothing_differs_and_with_them_visibility_is_the_same() {
    let scene = atrium(0.05);
    let mut plain = server(&scene, &config(24.0, 32));
    let mut more = server(&scene, &bent(config(24.0, 32)));
    let [mut client, mut bent_client] = [join(&mut plain), join(&mut more)];
    follow(&mut plain, &mut client);
    follow(&mut more, &mut bent_client);
    assert!(plain.store().bent().is_none());
    assert!(plain.store().visibility() == more.store().visibility());
    assert!(plain.join().unwrap().unwrap().bytes.len() < more.join().unwrap().unwrap().bytes.len());
    let camera = scene.camera_paths()[0].camera(&scene, &scene.pose(3.0));
    let params = picture(TWO_COLOURS);
    let drawn = client.draw(&camera, 3.0, &params).unwrap();
    let visibility = [&client, &bent_client].map(|c| c.visibility(&drawn, &Reconstruction::default()));
    assert!(client.ambient(&drawn, &camera, &params.shade, &visibility[0]).is_none());
    assert!(visibility[0] == visibility[1]);
}
