//! What the stages of the on-surface cache cost without rays, for one viewer and for sixteen: `cargo bench -p dapple-store`.

use std::sync::Arc;
use std::time::Instant;

use dapple_store::charts::{ChartParams, ChartSet};
use dapple_store::cones::{
    BoundingEntry, CacheParams, Charting, ConeCache, ConeSample, LookUp, MomentEntry, MomentParams,
    PackedMoment, PixelPlace, Reader, Requests, View,
};
use glam::Vec3;
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;

const WIDTH: usize = 320;
const ROWS: usize = 180;
const RUNS: usize = 7;

fn main() {
    // As a test (`cargo test --all-targets`) it has nothing to say.
    if !std::env::args().any(|a| a == "--bench") {
        println!("skipped: a bench, run by `cargo bench -p dapple-store`");
        return;
    }
    let hall = Hall::new();
    println!(
        "{} x {ROWS} pixels a view; a block is {} bytes with moment cones, {} with bounding cones, {} packed",
        WIDTH,
        ConeCache::<MomentEntry>::block_bytes(),
        ConeCache::<BoundingEntry>::block_bytes(),
        ConeCache::<PackedMoment<3>>::block_bytes(),
    );
    println!(
        "| viewers | threads | blend | entries | MiB | gather | admit, first | admit, then | update | read |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for viewers in [1, 16] {
        let views: Vec<_> = (0..viewers).map(|i| hall.view(i as f32 * 0.12, 2.0 + i as f32 * 0.3)).collect();
        for threads in [1, 2] {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            for blend in [false, true] {
                pool.install(|| row(&views, threads, LookUp { bias: 1.0, blend }));
            }
        }
    }
}

fn row(views: &[Vec<Option<PixelPlace>>], threads: usize, look_up: LookUp) {
    let views: Vec<_> = views.iter().map(|pixels| View { width: WIDTH, pixels }).collect();
    let (gather, requests) = fastest(|| Requests::gather(&views, &look_up));
    let (first, (mut cache, _)) = fastest(|| {
        let mut cache = ConeCache::<MomentEntry>::new(CacheParams::default()).expect("defaults");
        let queue = cache.admit(&requests);
        (cache, queue)
    });
    let (then, queue) = fastest(|| cache.admit(&requests));
    let params = MomentParams::default();
    let (update, _) = fastest(|| {
        cache.update(&queue, |i, queued, entry| {
            // One sample of one of four lights.
            let light = (i as u32 + u32::from(queued.is_new)) % 4;
            let direction = Vec3::new(light as f32 - 1.5, 2.0, (i % 7) as f32 * 0.1).normalize();
            entry.update(&[ConeSample { direction, value: Vec3::ONE, light, cosine: 1.0 }], 1, &params);
            true
        })
    });
    let (read, _) = fastest(|| {
        let rows = views.par_iter().flat_map(|view| view.pixels.par_chunks(16 * WIDTH));
        let found = rows.map(|pixels| {
            let mut reader = Reader::new(&cache, look_up);
            pixels.iter().flatten().map(|pixel| reader.read(pixel).entries().len()).sum::<usize>()
        });
        found.sum::<usize>()
    });
    let counts = cache.counts();
    println!(
        "| {} | {threads} | {} | {} | {:.1} | {gather:.1} | {first:.1} | {then:.1} | {update:.1} | {read:.1} |",
        views.len(),
        if look_up.blend { "yes" } else { "no" },
        counts.entries,
        counts.bytes as f64 / f64::from(1 << 20),
    );
}

/// The least of some times, in ms, and the last result.
fn fastest<T>(mut work: impl FnMut() -> T) -> (f64, T) {
    let mut best = f64::INFINITY;
    loop {
        for run in 0..RUNS {
            let start = Instant::now();
            let result = work();
            best = best.min(start.elapsed().as_secs_f64() * 1e3);
            if run == RUNS - 1 {
                return (best, result);
            }
        }
    }
}

/// A hall of 24 × 12 × 7 m with 40 boxes, each wall and each side of a box an instance of two triangles.
struct Hall {
    quads: Vec<[Vec3; 3]>,
    charting: Charting,
}

impl Hall {
    fn new() -> Hall {
        let mut quads = Vec::new();
        let mut add_box = |low: Vec3, size: Vec3| {
            for axis in 0..3 {
                let unit = |k: usize| Vec3::AXES[k] * size[k];
                let (u, v) = (unit((axis + 1) % 3), unit((axis + 2) % 3));
                quads.push([low, u, v]);
                quads.push([low + unit(axis), u, v]);
            }
        };
        add_box(Vec3::ZERO, Vec3::new(24.0, 7.0, 12.0));
        for i in 0..40u32 {
            let random =
                |k: u32| (i * 7 + k + 1).wrapping_mul(0x9e37_79b1).rotate_left(9) as f32 / u32::MAX as f32;
            let low = Vec3::new(4.0 + 19.0 * random(0), 0.0, 11.0 * random(1));
            add_box(low, Vec3::new(0.2 + 0.6 * random(2), 0.3 + 2.5 * random(3), 0.2 + 0.6 * random(4)));
        }
        let params = ChartParams::for_spacing(0.07, false);
        let sets = quads.iter().map(|&[p, u, v]| {
            let set = ChartSet::new(&[p, p + u, p + u + v, p + v], &[[0, 1, 2], [0, 2, 3]], &params);
            Some(Arc::new(set.expect("two triangles")))
        });
        let charting = Charting::new(sets.collect());
        Hall { quads, charting }
    }

    /// What a viewer near one end sees, turned by an angle.
    fn view(&self, turn: f32, along: f32) -> Vec<Option<PixelPlace>> {
        let eye = Vec3::new(along, 1.7, 6.0);
        let (forward, right) =
            (Vec3::new(turn.cos(), -0.1, turn.sin()), Vec3::new(-turn.sin(), 0.0, turn.cos()));
        let pixel = |i: usize| {
            let x = ((i % WIDTH) as f32 + 0.5) / WIDTH as f32 * 2.0 - 1.0;
            let y = 1.0 - ((i / WIDTH) as f32 + 0.5) / ROWS as f32 * 2.0;
            let ray = forward + right * x + Vec3::Y * (y * ROWS as f32 / WIDTH as f32);
            let mut best: Option<(f32, u32, f32, f32)> = None;
            for (quad, &[p, u, v]) in self.quads.iter().enumerate() {
                let normal = u.cross(v);
                let distance = (p - eye).dot(normal) / ray.dot(normal);
                let at = eye + ray * distance - p;
                let (a, b) = (at.dot(u) / u.length_squared(), at.dot(v) / v.length_squared());
                let inside = (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b);
                if distance > 0.0 && inside && best.is_none_or(|(d, ..)| distance < d) {
                    best = Some((distance, quad as u32, a, b));
                }
            }
            let (distance, instance, a, b) = best?;
            // Corners p, p + u, p + u + v and p, p + u + v, p + v.
            let (triangle, barycentrics) = if a >= b { (0, [a - b, b]) } else { (1, [a, b - a]) };
            let place = self.charting.place(instance, triangle, barycentrics, Vec3::ZERO, Vec3::Y)?;
            let footprint_m = distance * ray.length() * 2.0 / WIDTH as f32;
            Some(PixelPlace { instance, triangle, barycentrics, place, footprint_m, lean: [0.0; 2] })
        };
        (0..WIDTH * ROWS).into_par_iter().map(pixel).collect()
    }
}
