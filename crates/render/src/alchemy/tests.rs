//! What AlchemyAO keeps to: the general rules of screen-space methods, and a corner.

use super::*;
use crate::testing::failures;
use crate::testing::screen::{
    check_golden_view, check_lenses, check_pictures, check_profile, check_walls, corner_profile,
};

fn estimate(params: AlchemyParams) -> impl Fn(&Screen) -> Vec<f32> + Sync {
    move |screen| estimate_visibility(screen, &params).unwrap()
}

#[test]
fn walls_are_open_pictures_are_pictures_and_lenses_agree() {
    check_walls(&estimate(AlchemyParams::default()), 75.0, 0.99);
    check_pictures(&estimate(AlchemyParams { radius_m: 1.5, ..AlchemyParams::default() }));
    // A bias by distance is no part of what both lenses see.
    check_lenses(&estimate(AlchemyParams { beta: 0.0, ..AlchemyParams::default() }), 0.01);
}

#[test]
fn a_corner_darkens_as_its_estimator_does() {
    let means = corner_profile(&estimate(AlchemyParams::default()), 0.6);
    check_profile(&means, 0.15);
}

#[test]
fn parameters_out_of_range_are_named() {
    let good = AlchemyParams::default();
    for (params, says) in [
        (AlchemyParams { radius_m: 0.0, ..good }, "radius_m is 0,"),
        (AlchemyParams { sigma_of_radius: -1.0, ..good }, "sigma_of_radius is -1"),
        (AlchemyParams { samples: 0, ..good }, "1 to 256"),
        (AlchemyParams { exponent: 0.0, ..good }, "exponent is 0"),
        (AlchemyParams { blur_taps: 17, ..good }, "0 to 16"),
    ] {
        let error = params.check().unwrap_err().to_string();
        assert!(error.contains("alchemy") && error.contains(says), "{error}");
    }
}

#[test]
fn golden_views() {
    check_golden_view("alchemy", "still-life", &estimate(AlchemyParams::default()));
}

#[test]
fn failures_are_as_they_are_told() {
    let [truth, found] =
        failures::check("alchemy", "alchemy", &|shot| estimate(AlchemyParams::default())(shot.screen));
    assert!(found.halo < 0.93, "{found:?}: no end at the radius");
    assert!((0.01..0.06).contains(&(truth.thin - found.thin)), "{found:?}");
}
