//! What a cap on points costs: a built-in scene along one of its camera paths, server and client in one process.
//! `cargo run --release --example residency -- station path-deck 2048 1500000 15` (scene, path, points a m², cap, Hz)

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use dapple_client::Client;
use dapple_scene::{NoFiles, builtin};
use dapple_server::{Server, ServerConfig};
use dapple_stream::{FrameKind, Limits};
use dapple_trace::psao::generate::PointLayer;
use dapple_trace::psao::update::{ConvexVolume, StepInput};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, path, points, cap, hz] = &arguments[..] else {
        return Err("give a scene, a path, points a m², a cap and a rate in Hz".into());
    };
    let glb = builtin::glb(name, 1.0)?;
    let scene = Arc::new(dapple_scene::load("scene.glb", &glb, &NoFiles)?);
    let path = scene
        .camera_paths()
        .iter()
        .find(|known| known.name == *path)
        .cloned()
        .ok_or("the scene has no path of that name")?;
    let hz: f64 = hz.parse()?;
    let mut config = ServerConfig { max_resident_points: Some(cap.parse()?), ..ServerConfig::default() };
    config.generate.points_per_m2 = points.parse()?;

    let layer = PointLayer::new(&scene, &config.generate)?;
    let mut sizes: Vec<u64> = (0..scene.instances.len()).map(|i| layer.most_points(i)).collect();
    sizes.sort_unstable_by(|a, b| b.cmp(a));
    println!(
        "at most {} points in all; the largest instances have {:?}",
        sizes.iter().sum::<u64>(),
        &sizes[..sizes.len().min(8)]
    );

    let look = |time_s: f64| {
        let camera = path.camera(&scene, &scene.pose_undeformed(time_s));
        ConvexVolume::frustum(&camera, 16.0 / 9.0, f32::INFINITY, 0.6)
    };
    let start = Instant::now();
    let first = [look(0.0)];
    let input = StepInput { interest: &first, ..StepInput::default() };
    let mut server = Server::watched(scene.clone(), &config, &input, &|_| ())?;
    let snapshot = server.join()?.ok_or("a server has a snapshot from its start")?;
    println!(
        "{} instances; start in {:.1} s: {} points on {} of them, {} too large; join {} kB",
        scene.instances.len(),
        start.elapsed().as_secs_f64(),
        server.store().layout().len(),
        server.store().layout().sets().len(),
        server.too_large().len(),
        snapshot.bytes.len() / 1000
    );
    let mut client = Client::new(scene.clone(), Limits::default());
    client.receive(&snapshot.bytes)?;
    client.atlas();

    let (mut deltas, mut sets) = ((0, 0), (0, 0));
    let (mut spawned, mut evicted, mut most) = (0, 0, 0);
    let (mut step_ms, mut receive_ms) = (Vec::new(), Vec::new());
    let mut memory = (0f64, 0f64, 0u32);
    let ticks = (path.duration_s() * hz) as u32;
    for tick in 1..=ticks {
        let time_s = f64::from(tick) / hz;
        let interest = [look(time_s), look(time_s + 1.0 / hz)];
        let input = StepInput { interest: &interest, ..StepInput::default() };
        let start = Instant::now();
        let report = server.step_with(time_s, &input)?;
        step_ms.push(1e3 * start.elapsed().as_secs_f64());
        spawned += report.spawned;
        evicted += report.evicted;
        most = most.max(report.points);
        let start = Instant::now();
        if let Some(frame) = &report.frame {
            client.receive(&frame.bytes)?;
            let of_kind = if frame.kind == FrameKind::Sets { &mut sets } else { &mut deltas };
            *of_kind = (of_kind.0 + 1, of_kind.1 + frame.bytes.len());
        }
        receive_ms.push(1e3 * start.elapsed().as_secs_f64());
        let held = client.store().map_or(0, |store| store.layout().len()).max(1) as f64;
        let atlas = client.atlas().ok_or("the client has light")?;
        memory.0 = memory.0.max(server.bytes_per_point());
        // The store: three coordinates, a normal and a value.
        memory.1 = memory.1.max(15.0 + atlas.memory_bytes() as f64 / held);
        memory.2 = memory.2.max(atlas.layers());
    }
    assert!(client.store() == Some(server.store()), "both ends hold the same light");
    let seconds = f64::from(ticks) / hz;
    let kbit = |bytes: usize| bytes as f64 * 8e-3 / seconds;
    println!("{spawned} instances came and {evicted} went; at most {most} points");
    println!(
        "deltas {} in {:.1} kbit/s, changes of sets {} in {:.1} kbit/s",
        deltas.0,
        kbit(deltas.1),
        sets.0,
        kbit(sets.1)
    );
    println!("memory: server {:.1} bytes a point, client {:.1}, {} layers", memory.0, memory.1, memory.2);
    for (what, mut ms) in [("step", step_ms), ("receive", receive_ms)] {
        ms.sort_by(f64::total_cmp);
        let at = |part: f64| ms[((ms.len() - 1) as f64 * part) as usize];
        println!("{what}: median {:.1} ms, 95 % {:.1} ms, most {:.1} ms", at(0.5), at(0.95), at(1.0));
    }
    Ok(())
}
