//! What the tests across crates share: small scenes, one server with its settings, the folder of shared files.
#![allow(dead_code, reason = "each test binary uses its own part")]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

pub(crate) mod baked;
pub(crate) mod command;
pub(crate) mod http;
pub(crate) mod live;
pub(crate) mod made;
#[cfg(all(unix, feature = "moq"))]
pub(crate) mod moq;
pub(crate) mod relay;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use dapple_client::{Client, Drawn, PictureParams};
use dapple_metrics::psnr_masked;
use dapple_render::shade::ShadeParams;
use dapple_scene::{Files, NoFiles, Scene, builtin};
use dapple_server::{Server, ServerConfig};
use dapple_store::points::PointStore;
use dapple_stream::{Limits, Publisher, PublisherConfig};
use dapple_trace::Tracer;
use dapple_trace::rtao::{RtaoParams, Site, trace_visibility};

/// The built-in atrium.
pub(crate) fn atrium(detail: f32) -> Arc<Scene> {
    let glb = builtin::glb("atrium", detail).unwrap();
    Arc::new(dapple_scene::load("atrium.glb", &glb, &NoFiles).unwrap())
}

/// Defaults, but for the density and the rays of a point.
pub(crate) fn config(points_per_m2: f32, rays: u32) -> ServerConfig {
    let mut config = ServerConfig::default();
    config.generate.points_per_m2 = points_per_m2;
    config.generate.inside_rays = 16;
    config.update.rays = rays;
    config
}

pub(crate) fn server(scene: &Arc<Scene>, config: &ServerConfig) -> Server {
    Server::new(scene.clone(), config, &|_| ()).unwrap()
}

/// A client that has joined `server`.
pub(crate) fn join(server: &mut Server) -> Client {
    let mut client = Client::new(server.scene().clone(), Limits::default());
    let snapshot = server.join().unwrap().unwrap();
    client.receive(&snapshot.bytes).unwrap();
    client
}

/// A small picture with one sample a pixel.
pub(crate) fn small(width: u32, height: u32) -> PictureParams {
    let shade = ShadeParams { shadow_resolution: 256, ..ShadeParams::default() };
    PictureParams { width, height, supersample: 1, shade }
}

/// The frame that would carry a store: equal bytes mean stores that are equal to the bit.
pub(crate) fn fingerprint(store: &PointStore) -> Arc<[u8]> {
    let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
    publisher.publish(store).unwrap().bytes
}

/// Runs `work` in a pool of so many threads.
pub(crate) fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

/// Ray-traced visibility of every sample, 1 where there is no surface.
pub(crate) fn truth(scene: &Scene, drawn: &Drawn, rays: u32, radius_m: f32) -> Vec<f32> {
    let tracer = Tracer::new(scene, &drawn.pose);
    let (indices, sites): (Vec<usize>, Vec<Site>) = drawn
        .gbuffer
        .map_surfaces(scene, &drawn.pose, |index, surface| {
            let s = surface?;
            let key = index as u64;
            Some((index, Site { position_world: s.position_world, normal_world: s.normal_world, key }))
        })
        .into_iter()
        .flatten()
        .unzip();
    let mut traced = vec![1.0; sites.len()];
    trace_visibility(&tracer, &sites, &RtaoParams { rays, radius_m, seed: 1 }, &mut traced);
    let mut visibility = vec![1.0; drawn.gbuffer.samples().len()];
    for (index, value) in indices.into_iter().zip(traced) {
        visibility[index] = value;
    }
    visibility
}

/// Which samples show a surface.
pub(crate) fn covered(drawn: &Drawn) -> Vec<bool> {
    drawn.gbuffer.samples().iter().map(|s| s.is_covered()).collect()
}

/// PSNR in dB of visibility over the samples that show a surface.
pub(crate) fn visibility_psnr_db(drawn: &Drawn, truth: &[f32], test: &[f32]) -> f64 {
    psnr_masked(truth, test, &covered(drawn), 1.0).unwrap()
}

/// The files beside a scene.
struct Folder(PathBuf);

impl Files for Folder {
    fn read(&self, uri: &str, _limit_bytes: u64) -> std::io::Result<Vec<u8>> {
        std::fs::read(self.0.join(uri))
    }
}

/// A scene of the shared test files; says so where it is absent.
pub(crate) fn shared_scene(path: &str) -> Option<Scene> {
    let file = shared(path)?;
    let folder = Folder(file.parent().unwrap_or(Path::new("")).to_owned());
    let name = file.file_name().unwrap().to_string_lossy();
    Some(dapple_scene::load(&name, &std::fs::read(&file).unwrap(), &folder).unwrap())
}

/// A file of the shared test files; says so where it is absent.
pub(crate) fn shared(path: &str) -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared");
    let found = PathBuf::from(std::env::var("DAPPLE_SHARED").unwrap_or(default.to_owned())).join(path);
    if !found.is_file() {
        eprintln!("skipped: {} not found", found.display());
        return None;
    }
    Some(found)
}

/// Mean squared error of visibility over the samples that show a surface.
pub(crate) fn mean_squared_error(drawn: &Drawn, truth: &[f32], test: &[f32]) -> f64 {
    let pairs = covered(drawn).into_iter().zip(truth.iter().zip(test)).filter(|(covered, _)| *covered);
    let squares: Vec<f64> = pairs.map(|(_, (a, b))| f64::from(a - b) * f64::from(a - b)).collect();
    squares.iter().sum::<f64>() / squares.len().max(1) as f64
}
