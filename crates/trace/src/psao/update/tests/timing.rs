//! Speed figures of steps, printed by
//! `DAPPLE_TIMING_SCENE=atrium.glb cargo test --release -p dapple-trace -- --ignored --nocapture step_timing`.

use super::*;
use crate::bvh::timing::cpu_seconds;
use crate::psao::generate::GenerateParams;

#[test]
#[ignore = "prints, asserts nothing"]
fn step_timing() {
    let Some(file) = std::env::var_os("DAPPLE_TIMING_SCENE") else { return };
    let number = |name: &str, otherwise: f64| {
        std::env::var(name).ok().and_then(|value| value.parse().ok()).unwrap_or(otherwise)
    };
    let (hz, steps) = (number("HZ", 30.0), number("STEPS", 60.0) as u32);
    let bytes = std::fs::read(&file).expect("a file");
    let scene = dapple_scene::load(&file.to_string_lossy(), &bytes, &dapple_scene::NoFiles).expect("a scene");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| {
        let pose = scene.pose(0.0);
        let mut tracer = Tracer::new(&scene, &pose);
        let generate =
            GenerateParams { points_per_m2: number("POINTS", 512.0) as f32, ..Default::default() };
        let points = generate_points(&scene, &pose, &tracer, &generate, &|_| ()).unwrap();
        let begin = cpu_seconds();
        let updater = Updater::new(&scene, &pose, &tracer, points, UpdateParams::default(), &|_| ()).unwrap();
        println!("{} points, first trace {:.1} s", updater.store().layout().len(), cpu_seconds() - begin);
        for forgetful in [false, true] {
            let mut updater = updater.clone();
            let mut seconds = [0.0; 4];
            let mut counts = StepCounts::default();
            for step in 1..=steps {
                let mut marks = [cpu_seconds(); 5];
                let pose = scene.pose(f64::from(step) / hz);
                marks[1] = cpu_seconds();
                tracer.update(&scene, &pose);
                marks[2] = cpu_seconds();
                updater.select(&scene, &pose, &mut tracer, &FREE);
                marks[3] = cpu_seconds();
                if forgetful {
                    updater.clusters.iter_mut().for_each(|c| c.forget(u64::MAX));
                }
                counts.add(&updater.trace_selected(&scene, &pose, &tracer).counts);
                marks[4] = cpu_seconds();
                seconds.iter_mut().zip(marks.windows(2)).for_each(|(sum, w)| *sum += w[1] - w[0]);
            }
            let [pose, tree, select, trace] = seconds.map(|s| 1e3 * s / f64::from(steps));
            let per_step = |count: u64| count / u64::from(steps);
            println!(
                "{}: pose {pose:.2} ms, trees {tree:.2} ms, select {select:.2} ms, trace {trace:.2} ms; a step has \
                 {} points in full, {} against movers; {} and {} rays; {:.1} bytes a point",
                if forgetful { "nothing remembered" } else { "remembering" },
                per_step(counts.traced_full.into()),
                per_step(counts.traced_movers.into()),
                per_step(counts.rays_full),
                per_step(counts.rays_movers),
                updater.bytes_per_point(),
            );
        }
    });
}
