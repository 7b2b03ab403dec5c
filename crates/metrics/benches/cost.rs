//! What each metric costs: the fastest of some runs on one thread and on all, at two sizes of picture.
//!
//! `DAPPLE_LPIPS_WEIGHTS` names the file of weights of LPIPS; without it that metric is left out.

use std::time::Instant;

use dapple_metrics::{Lpips, PIXELS_PER_DEGREE, flip, psnr, ssim};

const SIZES: [(u32, u32); 2] = [(480, 270), (1920, 1080)];
const RUNS: u32 = 3;

fn main() {
    // As a test (`cargo test --all-targets`) it has nothing to say.
    if !std::env::args().any(|a| a == "--bench") {
        println!("skipped: a bench, run by `cargo bench -p dapple-metrics`");
        return;
    }
    let lpips = std::env::var("DAPPLE_LPIPS_WEIGHTS").ok().map(|file| {
        let bytes = std::fs::read(&file).unwrap_or_else(|error| panic!("{file}: {error}"));
        Lpips::from_safetensors(&bytes).unwrap_or_else(|error| panic!("{file}: {error}"))
    });
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    println!("| metric | picture | ms on 1 thread | ms on {threads} |\n|---|---|---|---|");
    for (width, height) in SIZES {
        let reference = picture(width, height, 0);
        let test = picture(width, height, 1);
        let unit = |bytes: &[u8]| bytes.iter().map(|b| f32::from(*b) / 255.0).collect::<Vec<f32>>();
        let (reference_unit, test_unit) = (unit(&reference), unit(&test));
        let gray = |unit: &[f32]| unit.iter().step_by(3).copied().collect::<Vec<f32>>();
        let (reference_gray, test_gray) = (gray(&reference_unit), gray(&test_unit));
        let row = |name: &str, work: &(dyn Fn() -> f64 + Sync)| {
            let [one, all] = [1, threads].map(|threads| fastest_ms(threads, work));
            println!("| {name} | {width} × {height} | {one:.1} | {all:.1} |");
        };
        row("PSNR", &|| psnr(&reference_unit, &test_unit, 1.0).expect("one size"));
        row("SSIM", &|| ssim(width, height, &reference_gray, &test_gray).expect("one size"));
        row("FLIP", &|| flip(width, height, &reference, &test, PIXELS_PER_DEGREE).expect("one size").mean);
        if let Some(lpips) = &lpips {
            row("LPIPS", &|| lpips.distance(width, height, &reference, &test).expect("one size"));
        }
    }
}

/// Blocks of colour on ramps, and noise that `seed` makes.
fn picture(width: u32, height: u32, seed: u32) -> Vec<u8> {
    let values = (0..height).flat_map(|y| (0..width).flat_map(move |x| (0..3).map(move |c| (x, y, c))));
    values
        .map(|(x, y, c)| {
            let block = (x / 16).wrapping_mul(0x9E37_79B1) ^ (y / 16).wrapping_mul(0x85EB_CA77) ^ c;
            let noise = (x ^ (y << 12) ^ (seed << 28)).wrapping_mul(0x2C1B_3C6D) >> 28;
            ((block.wrapping_mul(0xC2B2_AE3D) >> 25) + ((c + 1) * x + y) % 97 + noise) as u8
        })
        .collect()
}

fn fastest_ms(threads: usize, work: &(dyn Fn() -> f64 + Sync)) -> f64 {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let run = |_| {
        let start = Instant::now();
        std::hint::black_box(pool.install(work));
        start.elapsed().as_secs_f64() * 1e3
    };
    (0..RUNS).map(run).fold(f64::INFINITY, f64::min)
}
