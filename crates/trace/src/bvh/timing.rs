//! Speed figures, printed by `cargo test -p dapple-trace -- --ignored --nocapture timing`.

use std::time::Instant;

use dapple_scene::Mesh;
use dapple_scene::glam::{Affine3A, Vec3};

use super::{Tracer, count_blocked, offset_origin};
use crate::sampling::{fixed_pattern, hash, orthonormal_basis};
use crate::test_support::{Random, cube, deform, joined, scene, scene_of, sphere};

/// This thread's CPU time in seconds where the system tells it, so that others on the machine count less.
pub(crate) fn cpu_seconds() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|s| s.split_whitespace().next().and_then(|n| n.parse::<f64>().ok()));
    nanoseconds.map_or_else(|| START.get_or_init(Instant::now).elapsed().as_secs_f64(), |n| n * 1e-9)
}

fn moved(mut mesh: Mesh, scale: Vec3, by: Vec3) -> Mesh {
    for p in &mut mesh.positions {
        *p = *p * scale + by;
    }
    mesh
}

/// 30 × 12 × 20 m: walls, two storeys of columns with round capitals, rails of small balls. About 200k triangles.
fn atrium() -> Vec<Mesh> {
    let mut parts = vec![
        moved(cube(), Vec3::new(30.0, 0.2, 20.0), Vec3::new(-15.0, -0.2, -10.0)),
        moved(cube(), Vec3::new(30.0, 12.0, 0.2), Vec3::new(-15.0, 0.0, -10.2)),
        moved(cube(), Vec3::new(30.0, 12.0, 0.2), Vec3::new(-15.0, 0.0, 10.0)),
        moved(cube(), Vec3::new(0.2, 12.0, 20.0), Vec3::new(-15.2, 0.0, -10.0)),
        moved(cube(), Vec3::new(0.2, 12.0, 20.0), Vec3::new(15.0, 0.0, -10.0)),
    ];
    for floor in 0..2 {
        let y = floor as f32 * 6.0;
        for side in [-1.0, 1.0] {
            for i in 0..14 {
                let at = Vec3::new(-13.0 + 2.0 * i as f32, y + 2.5, side * 6.0);
                parts.push(moved(sphere(Vec3::ZERO, 1.0, 16, 24), Vec3::new(0.35, 2.5, 0.35), at));
                parts.push(sphere(at + Vec3::Y * 2.4, 0.6, 16, 32));
                parts.push(moved(cube(), Vec3::new(0.9, 0.3, 0.9), at - Vec3::new(0.45, 2.5, 0.45)));
            }
            for i in 0..280 {
                let at = Vec3::new(-14.0 + 0.1 * i as f32, y + 5.6, side * 5.5);
                parts.push(sphere(at, 0.06, 8, 9));
            }
        }
    }
    parts
}

/// Points with normals spread over the surface, evenly by area or by triangle, neighbours in space next to each other.
fn points_on(mesh: &Mesh, by_area: bool) -> Vec<(u64, Vec3, Vec3)> {
    let mut random = Random(0);
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        if by_area { f64::from((b - a).cross(c - a).length()) } else { 1.0 }
    };
    let sums: Vec<f64> = mesh
        .triangles
        .iter()
        .scan(0.0, |s, t| {
            *s += area(t);
            Some(*s)
        })
        .collect();
    let total = sums.last().copied().unwrap_or(0.0);
    let mut points: Vec<(u64, Vec3, Vec3)> = (0..20_000)
        .map(|_| {
            let pick = f64::from(random.next()) * total;
            let t = mesh.triangles[sums.partition_point(|s| *s < pick).min(mesh.triangles.len() - 1)];
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            let (mut u, mut v) = (random.next(), random.next());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let p = a + (b - a) * u + (c - a) * v;
            let cell = ((p + 20.0) / 40.0 * 1024.0).to_array().map(|x| x as u32);
            let morton = (0..10).fold(0_u64, |m, bit| {
                let b = |x: u32| u64::from(x >> bit & 1);
                m | (b(cell[0]) | b(cell[1]) << 1 | b(cell[2]) << 2) << (3 * bit)
            });
            (morton, p, (b - a).cross(c - a).normalize())
        })
        .collect();
    points.sort_by_key(|p| p.0);
    points
}

fn time_queries(tracer: &Tracer, points: &[(u64, Vec3, Vec3)]) {
    for (rays, t_max, step) in
        [(64, 0.6, 1), (256, 0.6, 4), (64, 9.0, 4), (64, f32::INFINITY, 8), (16, 0.6, 1)]
    {
        let start = cpu_seconds();
        let chosen: Vec<_> = points.iter().enumerate().step_by(step).collect();
        let mut patterns = Vec::with_capacity(chosen.len());
        for &(i, &(_, _, n)) in &chosen {
            let mut directions = Vec::new();
            fixed_pattern(rays, hash(1, i as u64, 0), &mut directions);
            let (t, b) = orthonormal_basis(n);
            directions.iter_mut().for_each(|d| *d = t * d.x + b * d.y + n * d.z);
            patterns.push(directions);
        }
        let middle = cpu_seconds();
        let mut blocked = 0;
        for (&(_, &(_, p, n)), directions) in chosen.iter().zip(&patterns) {
            blocked += u64::from(count_blocked(&tracer.occlusion(offset_origin(p, n), directions, t_max)));
        }
        let (patterns, seconds) = (middle - start, cpu_seconds() - middle);
        let traced = u64::from(rays) * chosen.len() as u64;
        println!(
            "{rays} rays of {t_max} m a point: {:.2} Mrays/s, {:.1} % blocked (patterns: {:.1} M directions/s)",
            traced as f64 / seconds / 1e6,
            100.0 * blocked as f64 / traced as f64,
            traced as f64 / patterns / 1e6
        );
    }
}

#[test]
#[ignore = "timing, run by hand"]
fn timing_occlusion() {
    let parts = atrium();
    let whole = joined(parts.iter().cloned());
    let points = [true, false].map(|by_area| points_on(&whole, by_area));
    let instances: Vec<_> = (0..parts.len()).map(|i| (i as u32, Affine3A::IDENTITY)).collect();
    for (name, (scene, pose)) in [("one mesh", scene_of(whole)), ("in instances", scene(parts, &instances))] {
        let start = Instant::now();
        let tracer = Tracer::new(&scene, &pose);
        let triangles: usize = scene.meshes.iter().map(|m| m.triangles.len()).sum();
        let ms = start.elapsed().as_secs_f64() * 1e3;
        println!("{name}: {triangles} triangles, {} instances, built in {ms:.0} ms", scene.instances.len());
        println!("points by area (mostly walls)");
        time_queries(&tracer, &points[0]);
        println!("points by triangle (mostly balls)");
        time_queries(&tracer, &points[1]);
    }
}

#[test]
#[ignore = "timing, run by hand"]
fn timing_update() {
    let ball = sphere(Vec3::Y, 0.5, 60, 84);
    let balls: Vec<_> = (0..1000).map(|i| (0, Affine3A::from_translation(Vec3::X * i as f32))).collect();
    let (scene, mut pose) = scene(vec![ball], &balls);
    let mut tracer = Tracer::new(&scene, &pose);
    let mesh = &scene.meshes[0];
    for frame in 0..4 {
        let wave = |p: &Vec3| *p + Vec3::X * (0.05 * frame as f32 * p.y);
        deform(&mut pose, 500, mesh.positions.iter().map(wave).collect());
        let start = Instant::now();
        tracer.update(&scene, &pose);
        let ms = start.elapsed().as_secs_f64() * 1e3;
        println!("{} deformed triangles and 1000 instances updated in {ms:.2} ms", mesh.triangles.len());
    }
}
