//! The paper's scheme from server to picture: cells of posed space hold what points at rest hold, and are late, not misplaced.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::sync::Arc;

use common::command::succeed;
use common::{config, join, server, small};
use dapple_client::Reconstruction;
use dapple_client::paper::PaperClient;
use dapple_render::psao::paper::reconstruct;
use dapple_render::psao::{Hat, Kernel};
use dapple_scene::glam::Vec3;
use dapple_scene::{NoFiles, PosedCamera, Scene, builtin};
use dapple_server::paper::{PaperConfig, PaperServer};
use dapple_stream::cells::CellLimits;
use dapple_trace::psao::update::StepInput;
use tempfile::TempDir;

fn lab() -> Arc<Scene> {
    let glb = builtin::glb("lab", 0.1).unwrap();
    Arc::new(dapple_scene::load("lab.glb", &glb, &NoFiles).unwrap())
}

/// Root mean square difference at those samples.
fn rms(a: &[f32], b: &[f32], of: &[usize]) -> f64 {
    let sum: f64 = of.iter().map(|&i| f64::from(a[i] - b[i]).powi(2)).sum();
    (sum / of.len() as f64).sqrt()
}

#[test]
fn a_picture_between_two_updates_shows_walkers_with_the_light_of_the_last_one() {
    let scene = lab();
    let config = config(300.0, 32);
    let mut own = server(&scene, &config);
    let mut paper = PaperServer::new(own.clone(), &PaperConfig::default()).unwrap();
    let mut own_client = join(&mut own);
    let mut client = PaperClient::new(scene.clone(), CellLimits::default());
    client.receive(&paper.join().unwrap().bytes).unwrap();
    // A server at 5 Hz steps once; the picture is 0.19 s later.
    let (server_s, picture_s) = (0.4, 0.59);
    own_client.receive(&own.step(server_s).unwrap().frame.unwrap().bytes).unwrap();
    let report = paper.step(server_s, None, &StepInput::default()).unwrap();
    client.receive(&report.frame.unwrap().bytes).unwrap();
    assert_eq!(client.server_time_s(), Some(server_s));
    assert_eq!(report.paper.outside_box, 0);

    let pose = scene.pose(picture_s);
    let walker = (0..scene.instances.len()).find(|&i| scene.is_deformable(i)).unwrap();
    let bounds = scene.instance_bounds_world(&pose, walker);
    let eye = bounds.center() + Vec3::new(0.4, 0.3, 2.0);
    let camera = PosedCamera::look_at(eye, bounds.center(), 0.9);
    let drawn = own_client.draw(&camera, picture_s, &small(160, 120)).unwrap();
    let samples = drawn.gbuffer.samples();
    let bending: Vec<usize> = (0..samples.len())
        .filter(|&i| samples[i].is_covered() && scene.is_deformable(samples[i].instance as usize))
        .collect();
    assert!(bending.len() > 500, "{} samples show walkers", bending.len());

    // The same points, the same values and the same fit, at rest and in posed cells: only packing differs.
    let kernel = Kernel::default();
    let rest = own_client.visibility(&drawn, &Reconstruction::Direct(kernel));
    let posed = client.visibility(&drawn, &kernel);
    let fragments = drawn.gbuffer.map_surfaces_local(&scene, &pose, |_, surface| surface.copied());
    let misplaced = reconstruct(client.table().unwrap(), &kernel, &fragments);
    let (kept, lost) = (rms(&posed, &rest, &bending), rms(&misplaced, &rest, &bending));
    eprintln!("walkers: {kept:.4} from the look-up at rest; {lost:.4} if looked up where they are now");
    assert!(kept < 0.09, "{kept}");
    assert!(lost > 2.0 * kept, "{lost}");

    // Elsewhere too: what stands still has the same values in both.
    let still: Vec<usize> = (0..samples.len())
        .filter(|&i| samples[i].is_covered() && !scene.is_deformable(samples[i].instance as usize))
        .collect();
    let kept = rms(&posed, &rest, &still);
    eprintln!("elsewhere: {kept:.4}");
    assert!(kept < 0.09, "{kept}");
    let hat = Kernel::Hat(Hat::default());
    let rest = own_client.visibility(&drawn, &Reconstruction::Direct(hat));
    let kept = rms(&client.visibility(&drawn, &hat), &rest, &still);
    eprintln!("elsewhere, hat: {kept:.4}");
    // Full cells lose points, and where none is left near enough eq. 4 says open.
    assert!(kept < 0.17, "{kept}");
}

#[test]
fn before_the_first_frame_all_is_open() {
    let scene = common::atrium(0.05);
    let client = PaperClient::new(scene.clone(), CellLimits::default());
    let camera = PosedCamera::look_at(Vec3::new(0.0, 1.5, 0.0), Vec3::new(1.0, 1.0, 0.0), 0.9);
    let drawn = dapple_client::draw(&scene, &camera, 0.0, &small(32, 24)).unwrap();
    let open = client.visibility(&drawn, &Kernel::default());
    assert!(open.len() == 32 * 24 && open.iter().all(|v| *v == 1.0));
}

#[test]
fn both_rows_of_the_paper_are_evaluated_beside_ours_and_repeat() {
    let folder = TempDir::new().unwrap();
    let run = |out: &str, threads: &str| {
        let methods = ["--methods", "psao,psao-paper,psao-paper-mls", "--points", "32", "--point-rays", "16"];
        let scene = ["eval", "--builtin", "atrium", "--detail", "0.05", "--size", "64x48", "--supersample=1"];
        let times = ["--frames", "1", "--seconds", "1", "--reference-rays", "16"];
        let out_args = ["--out", out, "--threads", threads, "--record", "kept.dapple"];
        succeed(folder.path(), &[&scene[..], &times, &methods, &out_args].concat());
        let bytes = std::fs::read(folder.path().join(out).join("results.json")).unwrap();
        let results: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
        results["cases"][0]["rows"].as_array().unwrap().clone()
    };
    let rows = run("a", "2");
    let names: Vec<&str> = rows.iter().map(|row| row["method"].as_str().unwrap()).collect();
    assert_eq!(names, ["psao", "psao-paper", "psao-paper-mls"]);
    let kbit = |i: usize| rows[i]["kbit_per_s"]["value"].as_f64().unwrap();
    assert_eq!(kbit(1), kbit(2), "one stream serves both");
    // Which of them is more depends on what is in view, for the paper's server sends nothing else.
    assert!(kbit(1) > 0.0 && kbit(0) > 0.0, "{} and {} kbit/s", kbit(1), kbit(0));
    assert_eq!(rows[0]["points"], rows[1]["points"], "the same points");
    for row in &rows[1..] {
        assert!(row["snapshot_bytes"].as_u64().unwrap() > 1000);
        assert!(row["visibility_psnr_db"]["value"].as_f64().unwrap() > 10.0);
        assert_eq!(row["cut_bytes"], 0);
    }
    // Only ours can be recorded, and it alone takes the name as it stands.
    assert!(folder.path().join("kept.dapple").is_file());
    let again = run("b", "1");
    for (row, again) in rows.iter().zip(&again) {
        for field in ["step_bytes", "snapshot_bytes", "visibility_psnr_db", "rays", "points"] {
            assert_eq!(row[field], again[field], "{field}");
        }
    }
}
