//! What the visibility bitmask keeps to: the general rules of screen-space methods, and a corner.

use glam::Vec3;

use super::*;
use crate::testing::failures;
use crate::testing::screen::{
    check_golden_view, check_lenses, check_pictures, check_walls, corner_profile, look, still_life,
};

fn estimate(params: GtaoParams) -> impl Fn(&Screen) -> Vec<f32> + Sync {
    move |screen| estimate_visibility(screen, &params).unwrap()
}

#[test]
fn walls_are_open_pictures_are_pictures_and_lenses_agree() {
    check_walls(&estimate(GtaoParams::default()), 75.0, 0.99);
    check_pictures(&estimate(GtaoParams { radius_m: 1.5, ..GtaoParams::default() }));
    check_lenses(&estimate(GtaoParams::default()), 0.01);
}

#[test]
fn a_corner_is_near_the_truth() {
    let params = GtaoParams { slices: 8, steps: 16, thickness_of_radius: 16.0, ..GtaoParams::default() };
    let means = corner_profile(&estimate(params), 0.6);
    for (i, [found, truth]) in means.iter().enumerate() {
        assert!((found - truth).abs() < 0.06, "strip {i}: {found}, the truth is {truth}");
    }
}

/// Light that comes through a slice is what its integral says.
#[test]
fn sectors_share_the_light_evenly() {
    let normal = Vec3::new(0.5, 0.2, 0.8).normalize();
    let slice = Slice::new(Vec3::Z, normal, Vec3::X).unwrap();
    let (low, high) = (slice.normal - FRAC_PI_2, slice.normal + FRAC_PI_2);
    let count = 20_000;
    let mut sum = 0.0f64;
    for i in 0..count {
        let angle = low + (i as f32 + 0.5) * PI / count as f32;
        sum += f64::from(libm::cosf(angle - slice.normal) * libm::sinf(angle).abs()) * f64::from(PI)
            / f64::from(count);
        if i % 1000 == 999 {
            let edge = low + (i + 1) as f32 * PI / count as f32;
            assert!((f64::from(slice.gathered(edge) - slice.least) - sum).abs() < 1e-4, "{edge}: {sum}");
        }
    }
    assert!((f64::from(slice.all) - sum).abs() < 1e-4);
    let toward = |angle: f32| Vec3::new(libm::sinf(angle), 0.0, libm::cosf(angle));
    assert_eq!(
        slice.sectors(toward(high), toward(0.0), 1.0) | slice.sectors(toward(low), toward(0.0), -1.0),
        u32::MAX
    );
    assert_eq!(slice.sectors(toward(0.3), toward(0.3), 1.0), 0, "what is thin blocks nothing");
}

/// What is thin blocks what is behind it, and not what is above.
#[test]
fn thickness_lets_light_pass_behind_what_is_thin() {
    let stage = still_life();
    let camera = look(Vec3::new(3.2, 2.4, 1.8), Vec3::new(0.5, 0.5, 0.0));
    let (_, screen) = crate::testing::screen::draw(&stage, &camera, [120, 90]);
    let mean = |thickness_of_radius: f32| {
        let visibility = estimate(GtaoParams { thickness_of_radius, ..GtaoParams::default() })(&screen);
        visibility.iter().sum::<f32>() / visibility.len() as f32
    };
    let (thin, usual, thick) = (mean(0.03), mean(0.5), mean(16.0));
    assert!(thin > usual + 0.01 && usual >= thick, "{thin}, {usual}, {thick}");
}

#[test]
fn parameters_out_of_range_are_named() {
    let good = GtaoParams::default();
    for (params, says) in [
        (GtaoParams { radius_m: 0.0, ..good }, "radius_m is 0,"),
        (GtaoParams { slices: 0, ..good }, "slices is 0"),
        (GtaoParams { steps: 65, ..good }, "1 to 64"),
        (GtaoParams { thickness_of_radius: 0.0, ..good }, "thickness_of_radius is 0"),
        (GtaoParams { bias: 1.0, ..good }, "0 to 0.9"),
    ] {
        let error = params.check().unwrap_err().to_string();
        assert!(error.contains("gtao") && error.contains(says), "{error}");
    }
}

#[test]
fn golden_views() {
    check_golden_view("gtao", "still-life", &estimate(GtaoParams::default()));
}

#[test]
fn failures_are_as_they_are_told() {
    let [truth, found] =
        failures::check("gtao", "gtao", &|shot| estimate(GtaoParams::default())(shot.screen));
    assert!(found.halo > 0.99, "{found:?}: an end at the radius");
    assert!(truth.thin - found.thin > 0.1, "{found:?}: as thick as half of the radius");
}
