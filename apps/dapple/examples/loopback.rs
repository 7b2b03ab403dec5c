//! Every stage from scene to picture, in one process: `cargo run --example loopback -- loopback.png`

use std::error::Error;
use std::sync::Arc;

use dapple_client::{Client, PictureParams, Reconstruction};
use dapple_render::image::{Rgb8Image, ToneMap};
use dapple_render::shade::ShadeParams;
use dapple_scene::{NoFiles, builtin};
use dapple_server::{Server, ServerConfig};
use dapple_stream::Limits;

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or("loopback.png".to_owned());

    // Both ends load the same scene; its hash opens the session.
    let glb = builtin::glb("atrium", 0.1)?;
    let scene = Arc::new(dapple_scene::load("atrium.glb", &glb, &NoFiles)?);
    println!("{}: {} triangles, hash {}", scene.name, scene.triangle_count(), scene.hash());

    // The server lays points on all surfaces and traces what each of them sees of its surroundings.
    let mut config = ServerConfig::default();
    config.generate.points_per_m2 = 128.0;
    let mut server = Server::new(scene.clone(), &config, &|_| ())?;
    println!("{} points", server.store().layout().len());

    // A client joins with one snapshot: where the points are, and their visibility.
    let mut client = Client::new(scene.clone(), Limits::default());
    let snapshot = server.join()?.ok_or("a server has a snapshot from its start")?;
    client.receive(&snapshot.bytes)?;
    println!("snapshot of {} bytes", snapshot.bytes.len());

    // From then on it receives only what changed.
    let mut now_s = 0.0;
    for tick in 1..=5 {
        now_s = f64::from(tick) / 15.0;
        let report = server.step(now_s)?;
        let update = report.frame.map_or(Arc::default(), |frame| frame.bytes);
        if !update.is_empty() {
            client.receive(&update)?;
        }
        println!("{now_s:.3} s: {} points changed, update of {} bytes", report.changed, update.len());
    }
    assert_eq!(client.store(), Some(server.store()), "both ends hold the same light");

    // The client draws, looks visibility up at every sample, and darkens the ambient light with it.
    let path = &scene.camera_paths()[0];
    let camera = path.camera(&scene, &scene.pose(now_s));
    let params = PictureParams { width: 640, height: 360, supersample: 2, shade: ShadeParams::default() };
    let drawn = client.draw(&camera, now_s, &params)?;
    let visibility = client.visibility(&drawn, &Reconstruction::default());
    let Rgb8Image { width, height, pixels } = drawn.compose(Some(&visibility))?.to_rgb8(&ToneMap::default());

    image::save_buffer(&output, pixels.as_flattened(), width, height, image::ColorType::Rgb8)?;
    println!("wrote {output}: camera path {} at {now_s:.3} s", path.name);
    Ok(())
}
