//! What SAO keeps to: the general rules of screen-space methods, its pyramid, its packing and its quads.

use glam::Vec3;
use proptest::prelude::*;

use super::*;
use crate::testing::failures;
use crate::testing::screen::{
    check_golden_view, check_lenses, check_pictures, check_profile, check_walls, corner_profile, draw, look,
    still_life,
};

fn estimate(params: SaoParams) -> impl Fn(&Screen) -> Vec<f32> + Sync {
    move |screen| estimate_visibility(screen, &params).unwrap()
}

#[test]
fn walls_are_open_pictures_are_pictures_and_lenses_agree() {
    check_walls(&estimate(SaoParams::default()), 75.0, 0.99);
    for filter in MipFilter::ALL {
        check_pictures(&estimate(SaoParams { filter, radius_m: 1.5, ..SaoParams::default() }));
    }
    // A bias by distance is no part of what both lenses see, and packed distances end at 200 m.
    let params = SaoParams { beta: 0.0, farthest_m: 4000.0, sharpness: 40_000.0, ..SaoParams::default() };
    check_lenses(&estimate(params), 0.01);
}

#[test]
fn a_corner_darkens_as_its_estimator_does() {
    for (radius_m, levels) in [(0.6, 5), (0.6, 0), (1.5, 5)] {
        let params = SaoParams { radius_m, levels, ..SaoParams::default() };
        let means = corner_profile(&estimate(params), radius_m);
        check_profile(&means, 0.18);
    }
}

/// Coarser levels are read where places are far apart; what they lead to is nearly what full resolution does.
#[test]
fn levels_change_little() {
    let (_, screen) =
        draw(&still_life(), &look(Vec3::new(3.2, 2.4, 1.8), Vec3::new(0.5, 0.5, 0.0)), [320, 240]);
    let at = |levels: u32, filter: MipFilter| {
        estimate(SaoParams { levels, filter, radius_m: 1.0, ..SaoParams::default() })(&screen)
    };
    let full = at(0, MipFilter::RotatedGrid);
    let mean =
        |other: &[f32]| full.iter().zip(other).map(|(a, b)| (a - b).abs()).sum::<f32>() / full.len() as f32;
    let off: Vec<f32> = MipFilter::ALL.map(|filter| mean(&at(5, filter))).to_vec();
    assert!(off[0] < 0.02, "rotated grid: {off:?}");
    assert!(off.iter().all(|off| (1e-5..0.2).contains(off)), "{off:?}");
    assert!(off[1..].iter().all(|other| off[0] <= *other), "the rotated grid is the nearest: {off:?}");
}

#[test]
fn levels_of_a_pyramid_are_their_filters() {
    let (_, screen) = draw(&still_life(), &look(Vec3::new(2.0, 2.5, 4.0), Vec3::ZERO), [37, 22]);
    let at = |x: usize, y: usize| screen.distances_m()[y.min(21) * 37 + x.min(36)];
    for filter in MipFilter::ALL {
        let pyramid = Pyramid::new(&screen, filter, 12);
        assert_eq!(pyramid.levels(), 7, "37, 19, 10, 5, 3, 2 and 1 columns");
        for (x, y) in (0..37).flat_map(|x| (0..22).map(move |y| (x, y))) {
            assert_eq!(pyramid.read(&screen, 0, [x, y]), (at(x, y), [x as f32 + 0.5, y as f32 + 0.5]));
            let (found, _) = pyramid.read(&screen, 1, [x, y]);
            let (cx, cy) = (x / 2, y / 2);
            let four = [
                at(2 * cx, 2 * cy),
                at(2 * cx + 1, 2 * cy),
                at(2 * cx, 2 * cy + 1),
                at(2 * cx + 1, 2 * cy + 1),
            ];
            let expected = match filter {
                MipFilter::RotatedGrid => at(2 * cx + (1 - cy % 2), 2 * cy + (1 - cx % 2)),
                MipFilter::Mean => four.iter().sum::<f32>() / 4.0,
                MipFilter::HarmonicMean => 4.0 / four.iter().map(|d| 1.0 / d).sum::<f32>(),
                MipFilter::Farthest => four.into_iter().fold(0.0, f32::max),
                MipFilter::Nearest => four.into_iter().fold(f32::INFINITY, f32::min),
            };
            assert!(found == expected || (found - expected).abs() < 1e-5, "{filter:?} at {x}, {y}: {found}");
            for level in 0..7 {
                let (found, [column, row]) = pyramid.read(&screen, level, [x, y]);
                let [column, row] = [column, row].map(|at| at as usize);
                if filter == MipFilter::RotatedGrid {
                    // Values of the picture, each with the sample that it is of, in the texel's square or at the border.
                    assert_eq!(found, at(column, row));
                    assert!(column >> level == x >> level || column == 36, "{x}, {y} at {level}: {column}");
                    assert!(row >> level == y >> level || row == 21, "{x}, {y} at {level}: {row}");
                } else {
                    assert!(column >> level == x >> level && row >> level == y >> level);
                }
            }
        }
    }
    assert_eq!(Pyramid::new(&screen, MipFilter::Mean, 2).levels(), 3);
}

#[test]
fn normals_from_depth_are_those_of_faces() {
    let camera = look(Vec3::new(3.0, 2.5, 0.3), Vec3::new(0.5, 0.0, 0.0));
    let (_, screen) = draw(&crate::testing::screen::corner(), &camera, [201, 151]);
    let mut off: Vec<f32> = Vec::new();
    for (i, normal) in screen.normals_view().iter().enumerate().filter(|(_, normal)| **normal != Vec3::ZERO) {
        let found = sample::normal_view(&screen, [i % 201, i / 201]);
        off.push(libm::acosf(found.dot(*normal).clamp(-1.0, 1.0)).to_degrees());
    }
    off.sort_by(f32::total_cmp);
    // The paper measures at most 0.2 degrees within a face; edges are anyone's.
    let most = off[off.len() * 98 / 100];
    assert!(most < 0.2, "{most} degrees");
}

#[test]
fn at_half_resolution_normals_are_the_geometrys() {
    let (_, screen) =
        draw(&still_life(), &look(Vec3::new(3.2, 2.4, 1.8), Vec3::new(0.5, 0.5, 0.0)), [160, 120]);
    let half = screen.half();
    let mut differ = 0;
    for (i, normal) in half.normals_view().iter().enumerate().filter(|(_, normal)| **normal != Vec3::ZERO) {
        let at = [i % 80, i / 80];
        assert_eq!(sample::normal_seen(&half, at), *normal);
        differ += usize::from(sample::normal_view(&half, at).dot(*normal) < 0.99);
        assert_eq!(sample::normal_seen(&screen, at), sample::normal_view(&screen, at));
    }
    assert!(differ > 100, "{differ} by eq. 4 are others'");
}

#[test]
fn quads_are_averaged_but_not_over_edges() {
    let numbers: Vec<f32> = (0..25).map(|i| i as f32).collect();
    let quad = |values: &[f32], columns: usize, x: usize, y: usize| {
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| values[(y + j) * columns + x + i])
    };
    // Straight down on flat ground.
    let (_, flat) =
        draw(&crate::testing::screen::corner(), &look(Vec3::new(3.0, 2.0, 0.001), Vec3::X * 3.0), [5, 5]);
    let mut averaged = numbers.clone();
    filter_quads(&flat, &mut averaged);
    for (x, y) in [(0, 0), (2, 0), (0, 2), (2, 2)] {
        let mean = quad(&numbers, 5, x, y).iter().sum::<f32>() / 4.0;
        assert_eq!(quad(&averaged, 5, x, y), [mean; 4]);
    }
    assert_eq!(averaged[24], 24.0, "the last of an odd row and column has no quad");
    // Along the ground each row is much farther away than the one below it, and rows are level.
    let (_, far) =
        draw(&crate::testing::screen::corner(), &look(Vec3::new(20.0, 3.0, 0.0), Vec3::X * 10.0), [4, 4]);
    let mut kept = numbers[..16].to_vec();
    filter_quads(&far, &mut kept);
    for (i, value) in kept.iter().enumerate().filter(|(i, _)| far.distances_m()[*i].is_finite()) {
        let row_mean = (i / 2 * 2) as f32 + 0.5;
        assert_eq!(*value, row_mean, "sample {i}: rows are averaged, not across");
    }
}

#[test]
fn parameters_out_of_range_are_named() {
    let good = SaoParams::default();
    for (params, says) in [
        (SaoParams { radius_m: 0.0, ..good }, "radius_m is 0,"),
        (SaoParams { sigma_m: Some(-1.0), ..good }, "sigma_m is -1"),
        (SaoParams { beta: f32::NAN, ..good }, "beta is NaN"),
        (SaoParams { samples: 257, ..good }, "1 to 256"),
        (SaoParams { levels: 13, ..good }, "0 to 12"),
        (SaoParams { blur_stride: 0, ..good }, "blur_stride is 0"),
        (SaoParams { farthest_m: 0.0, ..good }, "farthest_m"),
    ] {
        let error = params.check().unwrap_err().to_string();
        assert!(error.contains("sao") && error.contains(says), "{error}");
    }
}

proptest! {
    #[test]
    fn packed_samples_come_back(value in 0.0f32..=1.0, part in 0.0f32..=1.2) {
        let (_, screen) = draw(&still_life(), &look(Vec3::new(3.0, 2.0, 1.0), Vec3::ZERO), [1, 1]);
        let distance = screen.distances_m()[0];
        // The sample's distance is this part of the farthest.
        let farthest_m = distance / part.max(1e-3);
        let [packed] = pack(&screen, &[value], farthest_m)[..] else { panic!("one sample") };
        let (found, key) = unpack(packed);
        prop_assert!((found - value).abs() <= 0.5 / 255.0 + 1e-6);
        prop_assert!((key - part.clamp(1e-3, 1.0)).abs() <= 0.51 / 255.0 / 256.0, "{key}, {part}");
    }
}

#[test]
fn golden_views() {
    check_golden_view("sao", "still-life", &estimate(SaoParams::default()));
}

#[test]
fn failures_are_as_they_are_told() {
    let [truth, found] = failures::check("sao", "sao", &|shot| estimate(SaoParams::default())(shot.screen));
    assert!(found.halo < 0.93, "{found:?}: no end at the radius");
    assert!((0.04..0.1).contains(&(truth.thin - found.thin)), "{found:?}");
}
