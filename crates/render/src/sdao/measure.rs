//! Figures of `README.md`, printed by `cargo test -p dapple-render -- --ignored --nocapture sdao::measure`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use dapple_scene::{Files, NoFiles, Pose, PosedCamera, Scene, builtin};

use super::*;
use crate::gbuffer::{GBuffer, Layers, Screen, rasterize};
use crate::hbao::{self, HbaoParams};
use crate::ssao::{self, SsaoParams};

/// Files of a folder.
struct Folder(PathBuf);

impl Files for Folder {
    fn read(&self, uri: &str, _: u64) -> std::io::Result<Vec<u8>> {
        std::fs::read(self.0.join(uri))
    }
}

/// A scene, with a name of the camera path that is followed.
fn scenes() -> Vec<(String, Scene, String)> {
    let mut scenes = Vec::new();
    for (name, path) in [("lab", "path-aisle"), ("atrium", "path-walk"), ("station", "path-deck")] {
        let glb = builtin::glb(name, 1.0).unwrap();
        scenes.push((name.into(), dapple_scene::load(name, &glb, &NoFiles).unwrap(), path.into()));
    }
    let shared: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../../shared/scenes"].iter().collect();
    for file in
        ["sponza-dabrovic/sponza.obj", "godot-room/room.glb", "webxr-garage/garage.gltf", "zdm2/zdm2.glb"]
    {
        let path = shared.join(file);
        let Ok(bytes) = std::fs::read(&path) else {
            println!("SKIPPED: {} is not there", path.display());
            continue;
        };
        let folder = Folder(path.parent().unwrap_or(Path::new(".")).into());
        let scene = dapple_scene::load(file, &bytes, &folder).unwrap();
        let name = file.split(['/', '-']).next().unwrap_or(file);
        let name = if name == "godot" {
            "room"
        } else if name == "webxr" {
            "garage"
        } else {
            name
        };
        scenes.push((name.into(), scene, "orbit".into()));
    }
    scenes
}

/// Visibility by a method.
type Method = fn(&Screen, &Lookup<'_>) -> Vec<f32>;

/// One picture of a scene with all that is known of it.
struct View<'a> {
    scene: &'a Scene,
    pose: Pose,
    camera: PosedCamera,
    gbuffer: GBuffer,
    screen: Screen,
    layers: Layers,
}

impl<'a> View<'a> {
    fn new(scene: &'a Scene, path: &str, time_s: f64, [width, height]: [u32; 2]) -> View<'a> {
        let pose = scene.pose(time_s);
        let path = scene.camera_paths().into_iter().find(|p| p.name == path).unwrap();
        let camera = path.camera(scene, &pose);
        let gbuffer = rasterize(scene, &pose, &camera, width, height, 1).unwrap();
        let screen = gbuffer.screen(scene, &pose, &camera).unwrap();
        let layers = Layers::draw(scene, &pose, &camera, width, height, 1).unwrap();
        View { scene, pose, camera, gbuffer, screen, layers }
    }

    fn map(&self, params: &MapParams) -> StochasticMap {
        StochasticMap::draw(self.scene, &self.pose, &self.camera, &self.gbuffer, params).unwrap()
    }

    /// Mean absolute difference over samples that see a surface.
    fn difference(&self, a: &[f32], b: &[f32]) -> f64 {
        let seen = self.gbuffer.samples().iter().zip(a.iter().zip(b)).filter(|(s, _)| s.is_covered());
        let (sum, count) =
            seen.fold((0.0, 0u32), |(sum, n), (_, (a, b))| (sum + f64::from((a - b).abs()), n + 1));
        sum / f64::from(count.max(1))
    }
}

fn times(scene: &Scene, path: &str) -> Vec<f64> {
    let path = scene.camera_paths().into_iter().find(|p| p.name == path).unwrap();
    (0..3).map(|i| path.duration_s() * (f64::from(i) + 0.5) / 3.0).collect()
}

/// Way of making and of reading a map.
struct Way {
    name: &'static str,
    map: fn(u32) -> MapParams,
    looks: Looks,
    compensation: f32,
}

fn ways() -> Vec<Way> {
    fn at(alpha: f32, samples: u32) -> MapParams {
        MapParams { alpha, ..MapParams::with_samples(samples) }
    }
    let way = |name, map, looks| Way { name, map, looks, compensation: 1.0 };
    let [far, rises] = [Looks::WhereFirstIsFar, Looks::WhereFirstRises];
    vec![
        way("paper", MapParams::paper, far),
        Way { compensation: 2.0, ..way("paper, doubled", MapParams::paper, far) },
        way("paper, alpha 0.5", |samples| MapParams { alpha: 0.5, ..MapParams::paper(samples) }, far),
        way("paper, rises", MapParams::paper, rises),
        way("no first", |samples| at(0.2, samples), far),
        way("no first, rises", |samples| at(0.2, samples), rises),
        way("ours", MapParams::with_samples, rises),
        way("ours, alpha 1/16", |samples| at(0.0625, samples), rises),
        way("ours, alpha 1/8", |samples| at(0.125, samples), rises),
        way("ours, alpha 1/4", |samples| at(0.25, samples), rises),
        way("ours, alpha 1/2", |samples| at(0.5, samples), rises),
    ]
}

#[test]
#[ignore = "prints, asserts nothing"]
fn error_to_the_depth_peeled_limit() {
    let methods: [(&str, Method); 3] = [
        ("hbao-plus", |s, l| hbao::estimate_visibility_with(s, &HbaoParams::hbao_plus(), l).unwrap()),
        ("hbao", |s, l| hbao::estimate_visibility_with(s, &HbaoParams::hbao(), l).unwrap()),
        ("ssao", |s, l| ssao::estimate_visibility_with(s, &SsaoParams::default(), l).unwrap()),
    ];
    let wanted = std::env::var("METHOD").unwrap_or_else(|_| "hbao-plus".into());
    let ways: Vec<Way> =
        ways().into_iter().filter(|way| wanted == "hbao-plus" || way.name.len() < 6).collect();
    for (name, scene, path) in scenes() {
        for (method, estimate) in methods.iter().filter(|(method, _)| *method == wanted) {
            let views: Vec<View<'_>> =
                times(&scene, &path).into_iter().map(|t| View::new(&scene, &path, t, [480, 270])).collect();
            let peeled: Vec<Vec<f32>> =
                views.iter().map(|v| estimate(&v.screen, &Lookup::peeled(&v.layers))).collect();
            let mean = |of: &dyn Fn(&View<'_>) -> Vec<f32>| {
                let sum: f64 = views.iter().zip(&peeled).map(|(v, p)| v.difference(&of(v), p)).sum();
                sum / views.len() as f64
            };
            let fragments: f64 = views.iter().map(|v| v.layers.fragments() as f64).sum::<f64>()
                / (480 * 270 * views.len()) as f64;
            let single = mean(&|v| estimate(&v.screen, &Lookup::default()));
            let rule = mean(&|v| {
                estimate(&v.screen, &Lookup { looks: Looks::WhereFirstRises, ..Lookup::peeled(&v.layers) })
            });
            println!(
                "{name} {method}: {fragments:.1} layers, single {single:.4}, peeled by the rule {rule:.4}"
            );
            for way in &ways {
                let found = [1, 2, 4, 8, 16].map(|samples| {
                    mean(&|v| {
                        let map = v.map(&(way.map)(samples));
                        let lookup = Lookup {
                            looks: way.looks,
                            compensation: way.compensation,
                            ..Lookup::stochastic(&map)
                        };
                        estimate(&v.screen, &lookup)
                    })
                });
                let removed = found.map(|f| 100.0 * (1.0 - f / single));
                println!("  {:22} {found:.4?} {removed:3.0?} %", way.name);
            }
        }
    }
}

/// Median seconds of things done in turn.
fn medians<const N: usize>(turns: usize, things: [&dyn Fn(); N]) -> [f64; N] {
    let mut seconds = [const { Vec::new() }; N];
    for _ in 0..turns {
        for (thing, seconds) in things.iter().zip(&mut seconds) {
            let start = Instant::now();
            thing();
            seconds.push(start.elapsed().as_secs_f64());
        }
    }
    seconds.map(|mut seconds| {
        seconds.sort_by(f64::total_cmp);
        seconds[turns / 2]
    })
}

#[test]
#[ignore = "measures time"]
fn cost_beside_a_single_layer() {
    let params = HbaoParams { blur_taps: 0, ..HbaoParams::hbao_plus() };
    for (name, scene, path) in scenes() {
        let time = times(&scene, &path)[1];
        let view = View::new(&scene, &path, time, [960, 540]);
        let estimate = |lookup: &Lookup<'_>| {
            std::hint::black_box(hbao::estimate_visibility_with(&view.screen, &params, lookup).unwrap());
        };
        let [paper, ours] = [MapParams::paper(4), MapParams::with_samples(4)];
        let maps = [paper, ours].map(|params| view.map(&params));
        let found = medians(
            9,
            [
                &|| estimate(&Lookup::default()),
                &|| {
                    std::hint::black_box(view.map(&paper));
                },
                &|| estimate(&Lookup::paper(&maps[0])),
                &|| {
                    std::hint::black_box(view.map(&ours));
                },
                &|| estimate(&Lookup::stochastic(&maps[1])),
                &|| {
                    let blurred = HbaoParams::hbao_plus();
                    std::hint::black_box(hbao::estimate_visibility(&view.screen, &blurred).unwrap());
                },
            ],
        );
        let [single, paper_map, paper, our_map, ours, blurred] = found.map(|seconds| 1e3 * seconds);
        let ratio = |map: f64, estimate: f64| (map + estimate) / single;
        println!(
            "{name}: single {single:.0} ms (with blur {blurred:.0}); paper {paper_map:.0} + {paper:.0}, {:.2} x; ours {our_map:.0} + {ours:.0}, {:.2} x",
            ratio(paper_map, paper),
            ratio(our_map, ours),
        );
    }
}
