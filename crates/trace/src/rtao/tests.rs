//! Closed forms of visibility, and independence of threads and of other sites.

use std::f64::consts::PI;
use std::sync::Mutex;

use dapple_scene::Mesh;
use dapple_scene::glam::{Affine3A, DVec3, Quat, Vec3};

use super::{
    BentVisibility, RtaoParams, Site, SmoothSite, trace_bent, trace_visibility,
    trace_visibility_with_progress,
};
use crate::Tracer;
use crate::test_support::{Random, cube, disc, joined, mesh, quad, scene, scene_of, sphere};

const UNLIMITED: f32 = f32::INFINITY;

fn site(position_world: Vec3, normal_world: Vec3, key: u64) -> Site {
    Site { position_world, normal_world, key }
}

fn visibility(mesh: Mesh, sites: &[Site], rays: u32, radius_m: f32) -> Vec<f32> {
    let (scene, pose) = scene_of(mesh);
    let tracer = Tracer::new(&scene, &pose);
    let mut visibility = vec![f32::NAN; sites.len()];
    trace_visibility(&tracer, sites, &RtaoParams { rays, radius_m, seed: 3 }, &mut visibility);
    visibility
}

/// The pattern misjudges only the strata that the outline of the occluder crosses: of `n` about √n, each by a random
/// part, so that the error is of order n^(−3/4). One and a half of these, and 0.02 % for the lift off the ground and flat facets.
fn tolerance(rays: u32) -> f64 {
    1.5 * libm::pow(f64::from(rays), -0.75) + 2e-4
}

/// Sites at the origin, normal up, with eight keys.
fn at_origin() -> Vec<Site> {
    (0..8).map(|key| site(Vec3::ZERO, Vec3::Y, key)).collect()
}

fn expect(values: &[f32], exact: f64, rays: u32, what: &str) {
    for v in values {
        let error = (f64::from(*v) - exact).abs();
        assert!(error <= tolerance(rays), "{what}: {v} instead of {exact}, {rays} rays");
    }
}

#[test]
fn nothing_above_is_open() {
    let floor = quad(
        Vec3::new(-9.0, 0.0, 9.0),
        Vec3::new(9.0, 0.0, 9.0),
        Vec3::new(9.0, 0.0, -9.0),
        Vec3::new(-9.0, 0.0, -9.0),
    );
    for radius_m in [0.6, UNLIMITED] {
        assert_eq!(visibility(floor.clone(), &at_origin(), 512, radius_m), [1.0; 8]);
        assert_eq!(visibility(Mesh::default(), &at_origin(), 512, radius_m), [1.0; 8]);
    }
}

#[test]
fn disc_above() {
    for rays in [64, 1024, 65536] {
        for (r, h) in [(1.0, 1.0), (0.3, 1.0), (4.0, 1.0), (0.02, 0.1), (50.0, 30.0)] {
            let d = disc(Vec3::Y * h, r, 512);
            let (r2, h2) = (f64::from(r * r), f64::from(h * h));
            // The lift of 0.1 mm is seen by a disc 10 cm up.
            expect(&visibility(d.clone(), &at_origin(), rays, UNLIMITED), h2 / (r2 + h2), rays, "disc");
            // Cut rays: longer than the height, the part of the disc within reach counts.
            for cut in [0.5_f64, 1.05, 1.2, 3.0] {
                let length = cut * h2.sqrt();
                let exact = if cut <= 1.0 { 1.0 } else { h2 / (length * length).min(r2 + h2) };
                // dV/dh of the cut form doubles the effect of the lift.
                let v = visibility(d.clone(), &at_origin(), rays, length as f32);
                let lift = 2.0 * 1.2e-4 / h2.sqrt();
                for v in v {
                    let error = (f64::from(v) - exact).abs();
                    assert!(
                        error <= tolerance(rays) + lift,
                        "disc {r} at {h} cut {length}: {v}, not {exact}"
                    );
                }
            }
        }
    }
}

#[test]
fn endless_wall() {
    let height = 3.0;
    for (d, rays) in [(1e-3, 4096), (0.5, 4096), (1.0, 65536), (3.0, 65536), (20.0, 1024)] {
        // Long enough to seem endless, and no longer: f32 blurs a triangle's edges by 1e-7 of its size.
        let half = (1e4_f32 * d).max(100.0);
        let wall = quad(
            Vec3::new(d, 0.0, -half),
            Vec3::new(d, 0.0, half),
            Vec3::new(d, height, half),
            Vec3::new(d, height, -half),
        );
        let (d, h) = (f64::from(d), f64::from(height));
        let exact = 1.0 - 0.5 * (1.0 - d / (d * d + h * h).sqrt());
        expect(&visibility(wall, &at_origin(), rays, UNLIMITED), exact, rays, "wall");
    }
}

#[test]
fn inside_is_dark() {
    // A box seen from its faces, up to a millimetre from edges and corners.
    let mut sites = Vec::new();
    let mut random = Random(0);
    for axis in 0..3 {
        for side in [0.0, 1.0] {
            for _ in 0..40 {
                let mut p = Vec3::new(random.next(), random.next(), random.next());
                if random.next() < 0.5 {
                    p = p.map(|x| if x < 0.5 { 0.001 } else { 0.999 });
                }
                let mut n = Vec3::ZERO;
                (p[axis], n[axis]) = (side, 1.0 - 2.0 * side);
                sites.push(site(p, n, sites.len() as u64));
            }
        }
    }
    assert_eq!(visibility(cube(), &sites, 512, UNLIMITED), vec![0.0; sites.len()]);
    assert_eq!(visibility(cube(), &sites, 512, 1.75), vec![0.0; sites.len()]);

    let center = Vec3::new(10.0, -4.0, 2.0);
    let ball = sphere(center, 2.0, 40, 60);
    let from_inside: Vec<Site> = (0..100)
        .map(|key| site(center + 1.9 * random.next() * random.direction(), random.direction(), key))
        .collect();
    assert_eq!(visibility(ball, &from_inside, 1024, UNLIMITED), vec![0.0; 100]);
}

#[test]
fn placed_anywhere_and_in_parts() {
    // The disc of one instance, far away, turned, stretched to its size, beside others that do not matter.
    let map = Affine3A::from_scale_rotation_translation(
        Vec3::new(-2.0, 0.5, 2.0),
        Quat::from_axis_angle(Vec3::new(0.8, 0.0, 0.6), 2.0),
        Vec3::new(400.0, -120.0, 90.0),
    );
    let elsewhere = Affine3A::from_translation(Vec3::new(300.0, 0.0, 0.0));
    let (scene, pose) = scene(
        vec![disc(Vec3::Y * 3.0, 1.0, 256), cube()],
        &[(1, elsewhere), (0, map), (1, Affine3A::IDENTITY)],
    );
    let tracer = Tracer::new(&scene, &pose);
    // In mesh space (0, 1, 0) looks up at the disc 2 above, radius 1: in the world 1 above, radius 2.
    let position_world = map.transform_point3(Vec3::Y);
    let normal_world = map.transform_vector3(Vec3::Y).normalize();
    let sites: Vec<Site> = (0..8).map(|key| site(position_world, normal_world, key)).collect();
    let mut v = [0.0; 8];
    trace_visibility(&tracer, &sites, &RtaoParams { rays: 4096, radius_m: UNLIMITED, seed: 0 }, &mut v);
    for v in v {
        // The lift is 3 mm here, of 1 m.
        assert!((f64::from(v) - 0.2).abs() < tolerance(4096) + 2.0 * 0.2 * 0.8 * 3.2e-3, "{v}");
    }
}

#[test]
fn same_bits_on_any_number_of_threads() {
    let mut random = Random(4);
    let balls = (0..60).map(|_| sphere(random.vector() * 2.0, 0.1 + 0.3 * random.next(), 10, 16));
    let (scene, pose) = scene_of(joined(balls));
    let sites: Vec<Site> =
        (0..700).map(|i| site(2.0 * random.vector(), random.direction(), i * 7919)).collect();
    let params = RtaoParams { rays: 300, radius_m: 1.0, seed: 11 };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let tracer = Tracer::new(&scene, &pose);
            let mut v = vec![f32::NAN; sites.len()];
            let seen = Mutex::new(Vec::new());
            trace_visibility_with_progress(&tracer, &sites, &params, &mut v, &|n| {
                seen.lock().unwrap().push(n)
            });
            let mut seen = seen.into_inner().unwrap();
            seen.sort_unstable();
            assert_eq!(seen.last(), Some(&700));
            v.into_iter().map(f32::to_bits).collect::<Vec<_>>()
        })
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert!(one.iter().any(|v| f32::from_bits(*v) < 0.9));

    // One site alone, and in another order, is the same; another seed or key is not.
    let tracer = Tracer::new(&scene, &pose);
    let value = |s: &Site, params: &RtaoParams| {
        let mut v = [0.0];
        trace_visibility(&tracer, std::slice::from_ref(s), params, &mut v);
        v[0].to_bits()
    };
    for i in [699, 0, 300] {
        assert_eq!(value(&sites[i], &params), one[i]);
    }
    let differs = |f: &dyn Fn(&mut Site, &mut RtaoParams)| {
        (0..50).any(|i| {
            let (mut s, mut p) = (sites[i], params);
            f(&mut s, &mut p);
            value(&s, &p) != one[i]
        })
    };
    assert!(differs(&|s, _| s.key += 1));
    assert!(differs(&|_, p| p.seed += 1));
}

#[test]
fn parameters_out_of_range() {
    let lid = disc(Vec3::Y, 100.0, 16);
    let sites = [site(Vec3::ZERO, Vec3::Y, 0), site(Vec3::ZERO, Vec3::ZERO, 1), site(Vec3::NAN, Vec3::Y, 2)];
    assert_eq!(visibility(lid.clone(), &sites[1..], 16, UNLIMITED), [1.0, 1.0]);
    for radius_m in [0.0, -1.0, f32::NAN] {
        assert_eq!(visibility(lid.clone(), &sites, 16, radius_m), [1.0; 3]);
    }
    // No rays are one ray; too many are the most there may be.
    let one = visibility(lid.clone(), &sites[..1], 0, UNLIMITED)[0];
    assert!(one == 0.0 || one == 1.0);
    let most = visibility(lid, &sites[..1], u32::MAX, UNLIMITED)[0];
    assert_eq!(most, (most * 65536.0).round() / 65536.0);
    assert!(visibility(mesh(vec![], vec![]), &[], 16, 1.0).is_empty());
}

fn bent(mesh: Mesh, sites: &[Site], rays: u32, radius_m: f32) -> Vec<BentVisibility> {
    let (scene, pose) = scene_of(mesh);
    let tracer = Tracer::new(&scene, &pose);
    let params = RtaoParams { rays, radius_m, seed: 3 };
    let mut bent = vec![BentVisibility::default(); sites.len()];
    let smooth: Vec<SmoothSite> = sites
        .iter()
        .map(|s| SmoothSite {
            site: *s,
            shading_normal_world: s.normal_world,
            first_ray: 0,
            axes_world: None,
        })
        .collect();
    trace_bent(&tracer, &smooth, &params, &mut bent);
    let mut plain = vec![f32::NAN; sites.len()];
    trace_visibility(&tracer, sites, &params, &mut plain);
    assert_eq!(bent.iter().map(|b| b.visibility).collect::<Vec<_>>(), plain, "the same rays");
    bent
}

/// Open directions are those outside of the cone of half angle α about the normal: their mean is 2/3 cos³ α along it.
#[test]
fn bent_normal_under_a_disc() {
    for (r, h) in [(1.0_f64, 1.0_f64), (0.3, 1.0), (4.0, 1.0)] {
        let expected = 2.0 / 3.0 * (h / (r * r + h * h).sqrt()).powi(3);
        for b in bent(disc(Vec3::Y * h as f32, r as f32, 512), &at_origin(), 16384, UNLIMITED) {
            let error = (b.open_world.as_dvec3() - DVec3::new(0.0, expected, 0.0)).length();
            assert!(error < tolerance(16384), "disc {r} at {h}: {}, not {expected} upwards", b.open_world);
        }
    }
    for b in bent(Mesh::default(), &at_origin(), 4096, UNLIMITED) {
        assert!(b.open_world.distance(Vec3::new(0.0, 2.0 / 3.0, 0.0)) < 1e-3, "{}", b.open_world);
    }
    for b in bent(cube(), &[site(Vec3::splat(0.5), Vec3::Y, 0)], 64, UNLIMITED) {
        assert_eq!(b, BentVisibility { visibility: 0.0, open_world: Vec3::ZERO });
    }
}

/// An endless wall of height H at distance d blocks a wedge of angle β = atan(H / d) about the line at its foot. With ψ the
/// angle to that line, ∫ ω (n · ω) dω over the wedge is 4/3 (sin² β / 2, β / 2 − sin 2β / 4): across and up.
#[test]
fn bent_normal_beside_an_endless_wall() {
    let height = 3.0_f64;
    for d in [1e-3_f64, 0.5, 3.0, 20.0] {
        let half = (1e4 * d).max(100.0) as f32;
        let (x, top) = (d as f32, height as f32);
        let wall = quad(
            Vec3::new(x, 0.0, -half),
            Vec3::new(x, 0.0, half),
            Vec3::new(x, top, half),
            Vec3::new(x, top, -half),
        );
        let angle = libm::atan(height / d);
        let across = 4.0 / 3.0 / PI * 0.5 * libm::sin(angle) * libm::sin(angle);
        let up = 4.0 / 3.0 / PI * (0.5 * angle - 0.25 * libm::sin(2.0 * angle));
        let expected = DVec3::new(-across, 2.0 / 3.0 - up, 0.0);
        for b in bent(wall, &at_origin(), 16384, UNLIMITED) {
            let error = (b.open_world.as_dvec3() - expected).length();
            assert!(error < 2.0 * tolerance(16384), "wall at {d}: {}, not {expected}", b.open_world);
        }
    }
}

/// About a tilted normal: 1 in the open, 0 in a box, and beside a wall what quadrature of the definition gives.
#[test]
fn visibility_about_shading_normals() {
    let trace = |mesh: Mesh, at: Vec3, shading_normal_world: Vec3, rays: u32| {
        let (scene, pose) = scene_of(mesh);
        let tracer = Tracer::new(&scene, &pose);
        let sites: Vec<SmoothSite> = (0..8)
            .map(|key| SmoothSite {
                site: site(at, Vec3::Y, key),
                shading_normal_world,
                first_ray: 0,
                axes_world: None,
            })
            .collect();
        let mut bent = vec![BentVisibility::default(); 8];
        let params = RtaoParams { rays, radius_m: UNLIMITED, seed: 3 };
        trace_bent(&tracer, &sites, &params, &mut bent);
        bent.into_iter().map(|b| b.visibility).collect::<Vec<f32>>()
    };
    let floor = quad(
        Vec3::new(-9.0, 0.0, 9.0),
        Vec3::new(9.0, 0.0, 9.0),
        Vec3::new(9.0, 0.0, -9.0),
        Vec3::new(-9.0, 0.0, -9.0),
    );
    let wall = quad(
        Vec3::new(1.0, 0.0, -1e4),
        Vec3::new(1.0, 0.0, 1e4),
        Vec3::new(1.0, 1.0, 1e4),
        Vec3::new(1.0, 1.0, -1e4),
    );
    for tilt in [0.0_f64, 0.2, -0.5, 0.9] {
        let shading = DVec3::new(libm::sin(tilt), libm::cos(tilt), 0.0);
        assert_eq!(trace(floor.clone(), Vec3::ZERO, shading.as_vec3(), 256), [1.0; 8], "{tilt}");
        assert_eq!(trace(cube(), Vec3::splat(0.5), shading.as_vec3(), 256), [0.0; 8], "{tilt}");
        // The wall hides what is less steep than its top seen along x.
        let (mut open, mut all) = (0.0, 0.0);
        let steps = 1000;
        for i in 0..steps {
            let y = (f64::from(i) + 0.5) / f64::from(steps);
            for j in 0..2 * steps {
                let around = (f64::from(j) + 0.5) / f64::from(steps) * PI;
                let r = (1.0 - y * y).sqrt();
                let d = DVec3::new(r * libm::cos(around), y, r * libm::sin(around));
                let weight = d.dot(shading).max(0.0);
                all += weight;
                open += if d.x > 0.0 && d.y < d.x { 0.0 } else { weight };
            }
        }
        expect(&trace(wall.clone(), Vec3::ZERO, shading.as_vec3(), 16384), open / all, 4096, "tilted wall");
    }
}

/// The parts of a sequence, averaged, are the whole.
#[test]
fn sites_that_share_a_sequence_are_as_good_as_one() {
    let (scene, pose) = scene_of(disc(Vec3::Y, 1.0, 512));
    let tracer = Tracer::new(&scene, &pose);
    let trace = |first_ray: u32, rays: u32| {
        let site = site(Vec3::ZERO, Vec3::Y, 5);
        let mut bent = [BentVisibility::default()];
        let smooth = SmoothSite { site, shading_normal_world: Vec3::Y, first_ray, axes_world: None };
        trace_bent(&tracer, &[smooth], &RtaoParams { rays, radius_m: UNLIMITED, seed: 3 }, &mut bent);
        bent[0].visibility
    };
    let parts: f32 = (0..4).map(|part| trace(part * 64, 64)).sum();
    assert_eq!(parts / 4.0, trace(0, 256));
}
