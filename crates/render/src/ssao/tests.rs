//! Open planes stay open, corners darken as far as the closed form lets them, and nothing depends on size or threads.

use dapple_scene::{PosedCamera, Projection};
use glam::{Affine3A, Vec3};
use proptest::prelude::*;

use super::*;
use crate::testing::failures;
use crate::testing::screen::{beside_a_wall, check_golden_view, check_walls, corner, draw, look, still_life};
use crate::testing::{Stage, cube, ground, sphere, turned, with_threads};

/// With defaults.
fn estimate(screen: &Screen) -> Vec<f32> {
    estimate_visibility(screen, &SsaoParams::default()).unwrap()
}

#[test]
fn a_wall_is_open_at_any_angle() {
    check_walls(&estimate, 90.0, 0.999);
}

#[test]
fn without_a_bias_a_wall_blocks_itself() {
    // What the bias is there for: rounding alone decides about places near the plane.
    let mut stage = Stage::new();
    stage.add(ground(60.0), 0, Affine3A::IDENTITY);
    let (_, screen) = draw(&stage, &look(Vec3::new(5.9, 1.0, 0.1), Vec3::ZERO), [97, 61]);
    let params = SsaoParams { bias: 0.0, ..SsaoParams::default() };
    let visibility = estimate_visibility(&screen, &params).unwrap();
    assert!(visibility.iter().any(|&v| v < 1.0));
}

#[test]
fn a_corner_darkens_towards_its_edge_and_is_lighter_than_the_truth() {
    let (stage, side, radius) = (corner(), 240, 0.6);
    let camera = look(Vec3::new(3.0, 2.5, 0.0), Vec3::new(0.5, 0.0, 0.0));
    let (gbuffer, screen) = draw(&stage, &camera, [side, side]);
    let params = SsaoParams { radius_m: radius, ..SsaoParams::default() };
    let visibility = estimate_visibility(&screen, &params).unwrap();
    // Means over strips of the ground, a tenth of the radius wide.
    let mut strips = [(0.0f64, 0.0f64, 0u32); 12];
    for (i, &v) in visibility.iter().enumerate() {
        let surface = gbuffer.surface(&stage.scene, &stage.pose, i);
        let Some(surface) = surface.filter(|s| s.instance == 0) else { continue };
        let x = surface.position_world.x;
        if let Some(strip) = strips.get_mut((x / radius * 10.0) as usize).filter(|_| x > 0.0) {
            strip.0 += f64::from(v);
            strip.1 += beside_a_wall(f64::from(x), 3.0, f64::from(radius));
            strip.2 += 1;
        }
    }
    let means: Vec<[f64; 2]> = strips.map(|(v, truth, n)| [v, truth].map(|sum| sum / f64::from(n))).to_vec();
    for (i, [found, truth]) in means.iter().enumerate() {
        assert!(strips[i].2 > 200, "strip {i}: {} samples", strips[i].2);
        // Most places lie near: what is farther away hides few of them.
        assert!((-0.01..0.22).contains(&(found - truth)), "strip {i}: {found}, the truth is {truth}");
    }
    for pair in means.windows(2) {
        assert!(pair[0][0] <= pair[1][0] + 1e-3, "{means:?}");
    }
    assert!(means[0][0] < 0.75 && means[11][0] == 1.0, "{means:?}");
}

#[test]
fn what_hangs_farther_away_than_the_radius_casts_no_halo() {
    let mut stage = Stage::new();
    stage.add(ground(40.0), 0, Affine3A::IDENTITY);
    let small =
        Affine3A::from_scale_rotation_translation(Vec3::splat(0.4), glam::Quat::IDENTITY, Vec3::Y * 1.5);
    stage.add(cube(), 0, small);
    let (gbuffer, screen) = draw(&stage, &look(Vec3::new(0.0, 6.0, 0.1), Vec3::ZERO), [90, 90]);
    let ground_of = |radius_m: f32| {
        let params = SsaoParams { radius_m, blur_width: 1, ..SsaoParams::default() };
        let visibility = estimate_visibility(&screen, &params).unwrap();
        let on_ground = visibility.iter().zip(gbuffer.samples()).filter(|(_, s)| s.instance == 0);
        on_ground.map(|(v, _)| *v).fold(1.0, f32::min)
    };
    assert_eq!(ground_of(0.6), 1.0);
    assert!(ground_of(3.0) < 0.8, "it would with a longer one");
}

#[test]
fn pictures_of_any_size_have_values_and_an_open_background() {
    let mut stage = Stage::new();
    stage.add(cube(), 0, turned(0.4, Vec3::new(0.0, 0.0, 0.0)));
    stage.add(sphere(12, 17), 0, Affine3A::from_translation(Vec3::new(1.1, 0.6, 0.3)));
    let camera = look(Vec3::new(2.0, 2.5, 4.0), Vec3::ZERO);
    for size in [[1, 1], [3, 7], [7, 3], [1, 40], [33, 1], [65, 47]] {
        let (gbuffer, screen) = draw(&stage, &camera, size);
        for blur_width in [1, 5, MAX_BLUR_WIDTH] {
            let params = SsaoParams { blur_width, ..SsaoParams::default() };
            let visibility = estimate_visibility(&screen, &params).unwrap();
            assert_eq!(visibility.len(), (size[0] * size[1]) as usize);
            for (value, sample) in visibility.iter().zip(gbuffer.samples()) {
                assert!((0.0..=1.0).contains(value), "{size:?}: {value}");
                assert!(sample.is_covered() || *value == 1.0, "{size:?}: background {value}");
            }
        }
    }
    let (_, screen) = draw(&Stage::new(), &camera, [5, 4]);
    assert_eq!(estimate_visibility(&screen, &SsaoParams::default()).unwrap(), [1.0; 20]);
}

#[test]
fn a_far_camera_with_a_narrow_lens_is_a_parallel_one() {
    let stage = still_life();
    let (direction, far_m, half_height) = (Vec3::new(0.5, 0.6, 1.0).normalize(), 2000.0, 2.0f64);
    let yfov = (2.0 * libm::atan(half_height / f64::from(far_m))) as f32;
    let perspective = PosedCamera {
        projection: Projection::Perspective { yfov, near: 1.0 },
        ..look(direction * far_m, Vec3::ZERO)
    };
    let parallel = PosedCamera {
        projection: Projection::Orthographic { half_height: half_height as f32, near: 0.0, far: 20.0 },
        ..look(direction * 10.0, Vec3::ZERO)
    };
    let [a, b] = [perspective, parallel].map(|camera| {
        let (_, screen) = draw(&stage, &camera, [120, 90]);
        estimate_visibility(&screen, &SsaoParams::default()).unwrap()
    });
    // Samples at silhouettes may see another surface.
    let differences: Vec<f32> = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).collect();
    let mean = differences.iter().sum::<f32>() / differences.len() as f32;
    let far_off = differences.iter().filter(|d| **d > 0.1).count();
    assert!(mean < 0.005 && far_off < 60, "{mean}, {far_off}");
    assert!(b.iter().any(|&v| v < 0.7));
}

#[test]
fn places_of_samples_fall_on_their_samples() {
    let stage = still_life();
    for projection in [
        Projection::Perspective { yfov: 0.8, near: 0.02 },
        Projection::Orthographic { half_height: 2.0, near: -3.0, far: 20.0 },
    ] {
        let camera = PosedCamera { projection, ..look(Vec3::new(1.5, 2.0, 3.0), Vec3::ZERO) };
        let (gbuffer, screen) = draw(&stage, &camera, [61, 37]);
        let world_from_view = camera.world_from_view;
        let mut seen = 0;
        for i in 0..gbuffer.samples().len() {
            let surface = gbuffer.surface(&stage.scene, &stage.pose, i);
            let Some(position) = screen.position_view(i) else {
                assert!(surface.is_none());
                continue;
            };
            assert_eq!(screen.sample_at(position), Some(i));
            let surface = surface.unwrap();
            let position_world = world_from_view.transform_point3(position);
            assert!((position_world - surface.position_world).length() < 1e-4, "{i}: {position_world}");
            let normal_world = world_from_view.transform_vector3(screen.normals_view()[i]);
            assert!((normal_world - surface.normal_world).length() < 1e-5, "{i}: {normal_world}");
            seen += 1;
        }
        assert!(seen > 1000);
        assert_eq!(screen.position_view(gbuffer.samples().len()), None);
        assert_eq!(screen.sample_at(Vec3::new(90.0, 0.0, -2.0)), None, "outside of the picture");
        assert_eq!(screen.sample_at(Vec3::splat(f32::NAN)), None);
    }
    let (_, screen) = draw(&stage, &look(Vec3::new(0.0, 2.0, 3.0), Vec3::ZERO), [61, 37]);
    assert_eq!(screen.sample_at(Vec3::new(0.0, 0.0, 0.1)), None, "behind the camera");
}

#[test]
fn parameters_out_of_range_are_named() {
    let (_, screen) = draw(&still_life(), &look(Vec3::new(0.0, 2.0, 3.0), Vec3::ZERO), [4, 4]);
    let good = SsaoParams::default();
    for (params, says) in [
        (SsaoParams { radius_m: 0.0, ..good }, "radius_m is 0,"),
        (SsaoParams { radius_m: f32::INFINITY, ..good }, "radius_m is inf"),
        (SsaoParams { radius_m: f32::NAN, ..good }, "radius_m is NaN"),
        (SsaoParams { samples: 0, ..good }, "samples is 0,"),
        (SsaoParams { samples: MAX_SAMPLES + 1, ..good }, "must be 1 to 256"),
        (SsaoParams { bias: -0.1, ..good }, "bias is -0.1"),
        (SsaoParams { blur_width: 4, ..good }, "blur_width is 4, must be odd"),
        (SsaoParams { blur_width: MAX_BLUR_WIDTH + 2, ..good }, "1 to 63"),
        (SsaoParams { blur_sigma: 0.0, ..good }, "blur_sigma"),
    ] {
        let error = estimate_visibility(&screen, &params).unwrap_err().to_string();
        assert!(error.contains("ssao") && error.contains(says), "{error}");
    }
    let flat = Projection::Perspective { yfov: 0.0, near: 0.02 };
    let camera = PosedCamera { projection: flat, ..look(Vec3::Z, Vec3::ZERO) };
    let gbuffer = draw(&still_life(), &look(Vec3::Z, Vec3::ZERO), [4, 4]).0;
    assert!(gbuffer.screen(&still_life().scene, &still_life().pose, &camera).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn values_are_visibilities_whatever_the_parameters(
        radius_exponent in -30i32..30,
        samples in 1u32..40,
        bias in 0.0f32..=1.0,
        blur in 0u32..8,
        sigma_exponent in -30i32..30,
        seed: u32,
        eye in prop::array::uniform3(-4.0f32..4.0),
    ) {
        let stage = still_life();
        let params = SsaoParams {
            radius_m: 2f32.powi(radius_exponent),
            samples,
            bias,
            blur_width: 2 * blur + 1,
            blur_sigma: 2f32.powi(sigma_exponent),
            seed,
        };
        let (_, screen) = draw(&stage, &look(Vec3::from_array(eye), Vec3::ZERO), [23, 19]);
        let one = with_threads(1, || estimate_visibility(&screen, &params)).unwrap();
        prop_assert!(one.iter().all(|v| (0.0..=1.0).contains(v)));
        prop_assert_eq!(&one, &with_threads(3, || estimate_visibility(&screen, &params)).unwrap());
    }
}

#[test]
fn golden_view() {
    check_golden_view("ssao", "still-life", &estimate);
}

#[test]
fn failures_are_as_they_are_told() {
    let [truth, found] = failures::check("ssao", "ssao", &|shot| estimate(shot.screen));
    assert!(found.halo > 0.99, "{found:?}: an end at the radius");
    assert!(
        (0.0..0.04).contains(&(truth.thin - found.thin)),
        "{found:?}: only what is near a place blocks it"
    );
}
