//! What HBAO, and HBAO+, keeps to: the general rules of screen-space methods, and a corner.

use super::*;
use crate::testing::failures;
use crate::testing::screen::{
    check_golden_view, check_lenses, check_pictures, check_profile, check_walls, corner_profile,
};

fn estimate(params: HbaoParams) -> impl Fn(&Screen) -> Vec<f32> + Sync {
    move |screen| estimate_visibility(screen, &params).unwrap()
}

#[test]
fn walls_are_open_pictures_are_pictures_and_lenses_agree() {
    for params in [HbaoParams::hbao(), HbaoParams::hbao_plus()] {
        check_walls(&estimate(params), 75.0, 0.99);
        check_pictures(&estimate(HbaoParams { radius_m: 1.5, ..params }));
        check_lenses(&estimate(params), 0.01);
    }
}

#[test]
fn a_corner_darkens_towards_its_edge() {
    for params in [HbaoParams::hbao(), HbaoParams::hbao_plus()] {
        let means = corner_profile(&estimate(params), 0.6);
        check_profile(&means, 0.22);
    }
}

#[test]
fn parameters_out_of_range_are_named() {
    let good = HbaoParams::hbao();
    for (params, says) in [
        (HbaoParams { radius_m: f32::NAN, ..good }, "radius_m is NaN"),
        (HbaoParams { directions: 0, ..good }, "directions is 0"),
        (HbaoParams { steps: 65, ..good }, "1 to 64"),
        (HbaoParams { bias_degrees: 90.0, ..good }, "0 to 89"),
        (HbaoParams { strength: -1.0, ..good }, "strength is -1"),
    ] {
        let error = params.check().unwrap_err().to_string();
        assert!(error.contains("hbao") && error.contains(says), "{error}");
    }
}

#[test]
fn golden_views() {
    check_golden_view("hbao", "hbao", &estimate(HbaoParams::hbao()));
    check_golden_view("hbao", "hbao-plus", &estimate(HbaoParams::hbao_plus()));
}

#[test]
fn failures_are_as_they_are_told() {
    let check = |name, params| failures::check("hbao", name, &|shot| estimate(params)(shot.screen));
    let [[truth, hbao], [_, plus]] =
        [check("hbao", HbaoParams::hbao()), check("hbao-plus", HbaoParams::hbao_plus())];
    assert!(hbao.halo > 0.99 && plus.halo > 0.99, "an end at the radius: {hbao:?}, {plus:?}");
    assert!(truth.thin - hbao.thin > 0.08, "{hbao:?}: all under the horizon is taken for solid");
    assert!((0.03..0.08).contains(&(truth.thin - plus.thin)), "{plus:?}");
}
