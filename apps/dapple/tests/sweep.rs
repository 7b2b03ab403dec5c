//! How kernels and texels compare, for choosing defaults: `cargo test -p dapple --test sweep -- --ignored --nocapture`.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::sync::Arc;

use common::{atrium, join, server, shared, truth};
use dapple_client::{Client, Drawn, PictureParams, Reconstruction};
use dapple_render::psao::atlas::{AtlasParams, VisibilityAtlas};
use dapple_render::psao::{Hat, Kernel, MovingLeastSquares};
use dapple_scene::{NoFiles, Scene};
use dapple_server::ServerConfig;
use dapple_trace::psao::generate::GenerateParams;

struct Case {
    name: String,
    scene: Arc<Scene>,
    client: Client,
    views: Vec<(Drawn, Vec<f32>)>,
}

impl Case {
    fn new(name: &str, scene: Arc<Scene>, points_per_m2: f32) -> Case {
        let config = ServerConfig {
            generate: GenerateParams { points_per_m2, ..GenerateParams::default() },
            ..ServerConfig::default()
        };
        let mut server = server(&scene, &config);
        let time_s = 2.0;
        let mut client = join(&mut server);
        if let Some(frame) = server.step(time_s).unwrap().frame {
            client.receive(&frame.bytes).unwrap();
        }
        let params = PictureParams { width: 320, height: 180, supersample: 1, shade: Default::default() };
        let mut views = Vec::new();
        for path in scene.camera_paths().iter().take(2) {
            for t in [2.0, 6.0] {
                let camera = path.camera(&scene, &scene.pose(t));
                let drawn = client.draw(&camera, time_s, &params).unwrap();
                let truth = truth(&scene, &drawn, 256, config.update.radius_m);
                views.push((drawn, truth));
            }
        }
        Case { name: name.into(), scene, client, views }
    }

    fn score(&self, visibility: impl Fn(&Drawn) -> Vec<f32>) -> f64 {
        let errors: Vec<f64> = self
            .views
            .iter()
            .map(|(d, truth)| common::mean_squared_error(d, truth, &visibility(d)))
            .collect();
        -10.0 * (errors.iter().sum::<f64>() / errors.len() as f64).log10()
    }

    fn direct(&self, kernel: Kernel) -> f64 {
        self.score(|d| self.client.visibility(d, &Reconstruction::Direct(kernel)))
    }

    fn atlas(&self, params: AtlasParams, cut: bool) -> (f64, f64) {
        let store = self.client.store().unwrap();
        let cuts = self.client.cuts().filter(|_| cut);
        let mut atlas = VisibilityAtlas::new(store.layout().clone(), &self.scene, cuts, params);
        while !atlas.work(&self.scene, store.visibility(), usize::MAX).is_complete() {}
        assert!(atlas.failed().is_empty());
        let bytes = atlas.memory_bytes() as f64 / store.layout().len() as f64;
        (self.score(|d| atlas.reconstruct(&d.gbuffer, 1.0)), bytes)
    }
}

#[test]
#[ignore = "takes minutes"]
fn sweep() {
    let mut cases = Vec::new();
    cases.push(Case::new("atrium 256", atrium(0.15), 256.0));
    if let Some(path) = shared("scenes/godot-room/room.glb") {
        let bytes = std::fs::read(path).unwrap();
        let scene = Arc::new(dapple_scene::load("room.glb", &bytes, &NoFiles).unwrap());
        cases.push(Case::new("godot-room 256", scene, 256.0));
    }
    for case in &cases {
        println!(
            "{}: {} cut sites; {} points",
            case.name,
            case.client.cuts().unwrap().site_count(),
            case.client.store().unwrap().layout().len()
        );
        println!(
            "  hat {:.2}, direct {:.2}",
            case.direct(Kernel::Hat(Hat::default())),
            case.direct(Kernel::default())
        );
    }
    let mls = MovingLeastSquares::default();
    let mut variants = Vec::new();
    for most in [4, 6, 8] {
        for texel_factor in [1.0f32, 0.8, 0.6667] {
            variants.push((mls, most, texel_factor));
        }
    }
    for radius in [1.5, 1.75, 2.5] {
        variants.push((MovingLeastSquares { radius, ..mls }, 8, 1.0));
    }
    for normal_power in [4, 8] {
        for plane in [32.0, 128.0] {
            variants.push((MovingLeastSquares { normal_power, plane, ..mls }, 8, 1.0));
        }
    }
    for (kernel, most, texel_factor) in variants {
        let mut params = AtlasParams { texel_factor, ..AtlasParams::default() };
        (params.weights.kernel, params.weights.most) = (kernel, most);
        let found: Vec<String> = cases
            .iter()
            .map(|case| (case.atlas(params, false), case.atlas(params, true)))
            .map(|((db, bytes), (cut_db, _))| format!("{db:.2} dB, cut {cut_db:.2}, {bytes:.0} B"))
            .collect();
        println!("{kernel:?} most {most} texel × {texel_factor}: {}", found.join(" | "));
    }
}
