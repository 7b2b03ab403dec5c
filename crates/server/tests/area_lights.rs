//! A server whose points say how much of each light they see: what clients hold, what a still scene sends, and what a budget of rays does.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

#[path = "common/slide.rs"]
mod slide;

use std::sync::Arc;

use dapple_scene::area_lights::AreaLights;
use dapple_scene::glam::{Mat4, Vec3, Vec4};
use dapple_scene::{Instance, LocalTransform, Material, NoFiles, Node, Scene, builtin};
use dapple_server::{Server, ServerConfig};
use dapple_store::light_visibility::OPEN;
use dapple_stream::{Applied, Limits, Subscriber};
use dapple_trace::Tracer;
use dapple_trace::psao::generate::GenerateParams;
use dapple_trace::psao::update::{ConvexVolume, StepInput};
use dapple_trace::slc::TrackerParams;

fn scene(name: &str) -> Arc<Scene> {
    let glb = builtin::glb(name, 0.05).unwrap();
    Arc::new(dapple_scene::load(&format!("{name}.glb"), &glb, &NoFiles).unwrap())
}

fn config(points_per_m2: f32) -> ServerConfig {
    let generate = GenerateParams { points_per_m2, inside_rays: 16, ..GenerateParams::default() };
    let mut config = ServerConfig { cuts: false, generate, ..ServerConfig::default() };
    config.update.rays = 16;
    config.lights = Some(TrackerParams::default());
    config
}

fn server(scene: &Arc<Scene>, config: &ServerConfig) -> Server {
    Server::new(scene.clone(), config, &|_| ()).unwrap()
}

#[test]
fn clients_hold_what_is_traced_to_within_what_one_sees() {
    let scene = scene("street");
    let mut server = server(&scene, &config(2.0));
    let mut client = Subscriber::new(Some(scene.hash().0), Limits::default());
    client.receive(&server.join().unwrap().unwrap().bytes).unwrap();
    let lights = AreaLights::new(&scene, &scene.pose(0.0)).len() as u32;
    assert_eq!(client.lights().unwrap().lights(), lights);
    assert!(lights >= 3);
    let (mut sent, mut traced) = (0, 0);
    for step in 1..=12 {
        let report = server.step(f64::from(step) / 15.0).unwrap();
        assert_eq!(report.lights_due, 0, "without a budget nothing waits");
        traced += report.lights.traced;
        if let Some(frame) = report.frame {
            client.receive(&frame.bytes).unwrap();
            sent += client.light_changes().len();
        }
        assert_eq!(client.store(), Some(server.store()));
        let pose = scene.pose(f64::from(step) / 15.0);
        let tracked = server.lights().unwrap();
        let held = client.lights().unwrap();
        let tolerances = tracked.tolerances(held, &scene, &pose);
        let off = |&(index, steps): &(u32, u8)| {
            let (a, b) = (held.values()[index as usize], tracked.values().values()[index as usize]);
            a.abs_diff(b) > steps
        };
        assert!(!tolerances.iter().any(off));
    }
    assert!(sent > 50 && traced > 1000, "{sent} of {traced}");
    // Time stands still: nothing is looked at, and nothing sent.
    let report = server.step(12.0 / 15.0).unwrap();
    assert_eq!((report.lights.traced, report.lights.rays, report.frame), (0, 0, None));
    let held = client.lights().unwrap();
    assert!(held.values().contains(&0) && held.values().contains(&OPEN));
}

#[test]
fn a_budget_of_rays_leaves_work_that_is_done_once_things_stand_still() {
    let scene = scene("street");
    let config = config(2.0);
    let mut few = server(&scene, &config);
    let input = StepInput { ray_budget: Some(3000), ..StepInput::default() };
    let mut waited = 0;
    for step in 1..=8 {
        let time_s = f64::from(step) / 15.0;
        let report = few.step_with(time_s, &input).unwrap();
        waited = waited.max(report.lights_due);
        // A budget is passed by what is begun at most: 64 pairs of 16 rays.
        assert!(report.lights.rays <= 3000 + 1024, "{}", report.lights.rays);
    }
    assert!(waited > 500, "{waited}");
    let mut steps = 0;
    while few.lights().unwrap().due() > 0 {
        few.step_with(8.0 / 15.0, &input).unwrap();
        steps += 1;
        assert!(steps < 400);
    }
    // Points draw the same places of a light at all times, so it does not matter when; what no light reaches stays as it was.
    let pose = scene.pose(8.0 / 15.0);
    let tracer = Tracer::new(&scene, &pose);
    let tracked = few.lights().unwrap();
    let (fresh, _) = tracked.traced_afresh(&scene, &pose, &tracer);
    assert!(&fresh == tracked.values());
    assert!(steps > 1, "{steps}");
}

/// Boxes every two metres along x, and a lamp over each end of the row.
fn row() -> Arc<Scene> {
    let mut scene = (*slide::scene()).clone();
    let glowing = Material { emissive_factor: Vec3::splat(40.0), ..Material::default() };
    scene.materials.push(glowing);
    let mut lamp = scene.meshes[scene.instances[1].mesh as usize].clone();
    lamp.parts.iter_mut().for_each(|part| part.material = scene.materials.len() as u32 - 1);
    scene.meshes.push(lamp);
    let place = |scene: &mut Scene, mesh: u32, at: Vec3| {
        let local = LocalTransform::Matrix(Mat4::from_translation(at));
        scene.nodes.push(Node { local, ..Node::default() });
        let node = scene.nodes.len() as u32 - 1;
        scene.instances.push(Instance { node, mesh, ..scene.instances[1].clone() });
    };
    let (stone, lamp) = (scene.instances[1].mesh, scene.meshes.len() as u32 - 1);
    (0..10).for_each(|i| place(&mut scene, stone, Vec3::new(4.0 + 2.0 * i as f32, 0.0, 0.0)));
    [4.0, 22.0].into_iter().for_each(|x| place(&mut scene, lamp, Vec3::new(x, 3.0, 0.5)));
    Arc::new(scene)
}

#[test]
fn points_that_come_and_go_bring_their_lights() {
    let scene = row();
    let mut config = ServerConfig { max_resident_points: Some(260), ..config(100.0) };
    config.generate.inside_rays = 0;
    let look = |x: f32| {
        let planes = vec![Vec4::new(1.0, 0.0, 0.0, 2.0 - x), Vec4::new(-1.0, 0.0, 0.0, 2.0 + x)];
        [ConvexVolume { planes, eye_world: Some(Vec3::new(x, 1.0, 2.0)) }]
    };
    let first = look(5.0);
    let input = StepInput { interest: &first, ray_budget: None };
    let mut server = Server::watched(scene.clone(), &config, &input, &|_| ()).unwrap();
    let mut client = Subscriber::new(Some(scene.hash().0), Limits::default());
    client.receive(&server.join().unwrap().unwrap().bytes).unwrap();
    let mut sets = 0;
    for tick in 1..=300u32 {
        let time_s = f64::from(tick) / 30.0;
        let interest = look(5.0 + 18.0 * (1.0 - (f32::from(tick as u16) / 150.0 - 1.0).abs()));
        let input = StepInput { interest: &interest, ray_budget: None };
        if let Some(frame) = server.step_with(time_s, &input).unwrap().frame {
            sets += u32::from(matches!(client.receive(&frame.bytes).unwrap(), Applied::Sets { .. }));
        }
        assert_eq!(client.store(), Some(server.store()), "tick {tick}");
        if tick % 60 == 0 {
            // What was carried along is what one would trace now.
            let pose = scene.pose(time_s);
            let tracer = Tracer::new(&scene, &pose);
            let tracked = server.lights().unwrap();
            let (fresh, _) = tracked.traced_afresh(&scene, &pose, &tracer);
            let differ = fresh.values().iter().zip(tracked.values().values()).filter(|(a, b)| a != b).count();
            assert_eq!(differ, 0, "tick {tick}: of {}", fresh.values().len());
        }
    }
    assert!(sets > 5, "{sets}");
}

#[test]
fn a_scene_without_lights_has_none_to_tell_of() {
    let scene = slide::scene();
    assert!(AreaLights::new(&scene, &scene.pose(0.0)).is_empty());
    let server = server(&scene, &config(20.0));
    assert!(server.lights().is_none() && server.store().lights().is_none());
}
