//! Slow servers and fast clients: light is late, and never in the wrong place.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::sync::Arc;

use common::{config, covered, join, server, small};
use dapple_client::{Client, Drawn, Reconstruction};
use dapple_scene::glam::Vec3;
use dapple_scene::{NoFiles, PosedCamera, Scene, builtin};
use dapple_server::{Server, ServerConfig};

const CLIENT_HZ: f64 = 60.0;
const SLOW_HZ: f64 = 5.0;
/// When the clock stops: a fraction of a slow step after one.
const STOP_FRAME: u32 = 67;

fn stop_s() -> f64 {
    f64::from(STOP_FRAME) / CLIENT_HZ
}

/// A server at a rate, and a client that draws every picture.
struct Pair {
    server: Server,
    client: Client,
    hz: f64,
    ticks: u32,
}

impl Pair {
    fn new(scene: &Arc<Scene>, config: &ServerConfig, hz: f64) -> Pair {
        let mut server = server(scene, config);
        let client = join(&mut server);
        Pair { server, client, hz, ticks: 0 }
    }

    /// All ticks up to the clock's `now_s`, of a scene whose time stands still from the stop on.
    fn follow(&mut self, now_s: f64) {
        while f64::from(self.ticks + 1) / self.hz <= now_s + 1e-9 {
            self.ticks += 1;
            let scene_s = (f64::from(self.ticks) / self.hz).min(stop_s());
            if let Some(frame) = self.server.step(scene_s).unwrap().frame {
                self.client.receive(&frame.bytes).unwrap();
            }
        }
    }

    fn look(&self, drawn: &Drawn) -> Vec<f32> {
        self.client.visibility(drawn, &Reconstruction::default())
    }
}

/// Samples that neither move nor have, within the radius, anything that moves between the two times.
fn out_of_reach(scene: &Scene, drawn: &Drawn, from_s: f64, to_s: f64, radius_m: f32) -> Vec<usize> {
    let moving = scene.moving_instances();
    let movers: Vec<usize> = (0..moving.len()).filter(|&i| moving[i] && scene.instances[i].casts).collect();
    let mut reach = Vec::new();
    for step in 0..=8 {
        let pose = scene.pose(from_s + (to_s - from_s) * f64::from(step) / 8.0);
        // What lies between these times, and the reconstruction's width.
        reach.extend(movers.iter().map(|&i| scene.instance_bounds_world(&pose, i).inflated(radius_m + 0.4)));
    }
    let samples = drawn.gbuffer.samples();
    let still = drawn.gbuffer.map_surfaces(scene, &drawn.pose, |index, surface| {
        let place = surface?.position_world;
        let away = reach.iter().all(|bounds| bounds.distance_squared(place) > 0.0);
        (away && !moving[samples[index].instance as usize]).then_some(index)
    });
    still.into_iter().flatten().collect()
}

#[test]
fn a_server_at_5_hz_is_late_and_leaves_no_ghosts() {
    let scene: Arc<Scene> =
        Arc::new(dapple_scene::load("lab.glb", &builtin::glb("lab", 0.1).unwrap(), &NoFiles).unwrap());
    let mut config = config(150.0, 32);
    // So that what is sent is what is traced.
    config.publish.precision.tolerance = 0;
    let (mut slow, mut fast) = (Pair::new(&scene, &config, SLOW_HZ), Pair::new(&scene, &config, CLIENT_HZ));
    for frame in 1..=STOP_FRAME {
        slow.follow(f64::from(frame) / CLIENT_HZ);
        fast.follow(f64::from(frame) / CLIENT_HZ);
    }
    let served_s = (stop_s() * SLOW_HZ).floor() / SLOW_HZ;
    assert!(stop_s() - served_s > 0.1, "the picture is {} s late", stop_s() - served_s);

    // A picture of a walker from near, at the time at which the clock stops.
    let pose = scene.pose(stop_s());
    let walker = (0..scene.instances.len()).find(|&i| scene.is_deformable(i)).unwrap();
    let bounds = scene.instance_bounds_world(&pose, walker);
    let camera = PosedCamera::look_at(bounds.center() + Vec3::new(1.5, 1.0, 3.0), bounds.center(), 0.9);
    let drawn = slow.client.draw(&camera, stop_s(), &small(160, 120)).unwrap();
    let late = slow.look(&drawn);

    // Nothing of the past is mixed in: who joins now, and has seen no frame before, sees the same.
    let newcomer = join(&mut slow.server);
    assert!(late == newcomer.visibility(&drawn, &Reconstruction::default()), "a trace of earlier frames");
    // It is the light of the server's last time, on surfaces where they are now.
    let mut then = Pair::new(&scene, &config, CLIENT_HZ);
    then.follow(served_s);
    assert!(late == then.look(&drawn), "not the light of {served_s} s");

    // Where nothing moved since, nothing differs from the fast server's; elsewhere something does.
    let now = fast.look(&drawn);
    let still = out_of_reach(&scene, &drawn, served_s, stop_s(), config.update.radius_m);
    assert!(still.len() > 1000, "{} samples", still.len());
    assert!(still.iter().all(|&i| late[i] == now[i]), "a ghost");
    let seen = covered(&drawn);
    let differs = (0..late.len()).filter(|&i| seen[i] && late[i] != now[i]).count();
    assert!(differs > 100, "{differs} samples are late");

    // The clock goes on, the scene does not: after one slow step both show the same for ever.
    slow.follow(served_s + 1.0 / SLOW_HZ);
    fast.follow(stop_s() + 1.0 / CLIENT_HZ);
    let settled = slow.look(&drawn);
    assert!(settled == now && settled == fast.look(&drawn));
    for pair in [&mut slow, &mut fast] {
        let silent = (0..3).all(|_| pair.server.step(stop_s()).unwrap().frame.is_none());
        assert!(silent, "a scene that stands still sends nothing");
    }
    assert!(slow.look(&drawn) == now);
}
