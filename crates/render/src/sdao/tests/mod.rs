//! The map has the paper's statistics; hidden occluders are found; methods keep the rules of screen-space methods.

mod failures;
mod hidden;
mod two_cameras;

use dapple_scene::{PosedCamera, Projection};
use glam::{Affine3A, Vec3};

use super::picks::{Chooser, Subsets};
use super::*;
use crate::RenderError;
use crate::gbuffer::{Layers, Screen, rasterize};
use crate::hbao::{self, HbaoParams};
use crate::noise::hash;
use crate::ssao::{self, SsaoParams};
use crate::testing::screen::{draw, look, still_life};
use crate::testing::{Stage, quad, with_threads};

const SIZES: [u32; 5] = [1, 2, 4, 8, 16];

#[test]
fn subsets_have_their_size_and_each_comes_as_often() {
    for samples in SIZES {
        let subsets = Subsets::new(samples);
        for size in 0..=samples {
            let mut counts = vec![0u32; 1 << samples];
            let draws = 1u32 << 20;
            for i in 0..draws {
                // All high words, and low ones that differ.
                let mask = subsets.pick(size, (i << 12) | (hash([i]) & 0xfff));
                assert_eq!(mask.count_ones(), size);
                counts[usize::from(mask)] += 1;
            }
            let sets = counts.iter().filter(|count| **count > 0).count() as u32;
            let all = (0..1u32 << samples).filter(|mask| mask.count_ones() == size).count() as u32;
            assert_eq!(sets, all, "{size} of {samples}");
            let [least, most] = [draws / all, draws.div_ceil(all)];
            let fair = counts.iter().filter(|count| **count > 0).all(|c| (least - 1..=most + 1).contains(c));
            assert!(fair, "{size} of {samples}");
        }
    }
}

/// How often each sample is chosen, and each number of samples, as parts of all fragments.
fn statistics(picks: Picks, samples: u32, alpha: f32, seed: u32) -> (Vec<f64>, Vec<f64>) {
    let chooser = Chooser::new(picks, samples, alpha, seed);
    let (mut chosen, mut sizes) = (vec![0u32; samples as usize], vec![0u32; samples as usize + 1]);
    let fragments = 400 * 300;
    for (column, row) in (0..400).flat_map(|c| (0..300).map(move |r| (c, r))) {
        let mask = chooser.mask([column, row], 0.02 + 1e-5 * column as f32);
        assert!(u32::from(mask) < 1 << samples);
        sizes[mask.count_ones() as usize] += 1;
        for (sample, count) in chosen.iter_mut().enumerate() {
            *count += u32::from(mask >> sample & 1);
        }
    }
    let parts = |counts: Vec<u32>| counts.into_iter().map(|c| f64::from(c) / f64::from(fragments)).collect();
    (parts(chosen), parts(sizes))
}

#[test]
fn every_sample_keeps_alpha_of_all_fragments() {
    for samples in SIZES {
        for (alpha, seed) in [(0.2, 0), (0.2, 77), (0.5, 0), (0.25, 3), (0.07, 0), (1.0, 0)] {
            for picks in [Picks::Stratified, Picks::Independent] {
                let (chosen, sizes) = statistics(picks, samples, alpha, seed);
                for part in &chosen {
                    // 120,000 draws: a standard deviation is at most 0.00144.
                    assert!(
                        (part - f64::from(alpha)).abs() < 0.006,
                        "{picks:?} {samples} {alpha}: {chosen:?}"
                    );
                }
                let expected = f64::from(alpha) * f64::from(samples);
                for (size, part) in sizes.iter().enumerate() {
                    let size = size as f64;
                    let wanted = match picks {
                        // Eq. 1: the two whole numbers about the mean, the nearer the more often.
                        Picks::Stratified => (1.0 - (expected - size).abs()).max(0.0),
                        Picks::Independent => binomial(samples, size as u32, alpha.into()),
                    };
                    assert!((part - wanted).abs() < 0.007, "{picks:?} {samples} {alpha}: {sizes:?}");
                }
            }
        }
    }
}

fn binomial(n: u32, k: u32, p: f64) -> f64 {
    let ways = (0..k).fold(1.0, |ways, i| ways * f64::from(n - i) / f64::from(i + 1));
    ways * p.powi(k as i32) * (1.0 - p).powi((n - k) as i32)
}

/// Walls across the view, at distances 2, 3, 4 … metres.
fn walls(count: u32) -> Stage {
    let mut stage = Stage::new();
    for wall in 0..count {
        let at = |x: f32, y: f32| Vec3::new(x, y, -2.0 - wall as f32);
        let mesh = quad([at(-20.0, -20.0), at(20.0, -20.0), at(20.0, 20.0), at(-20.0, 20.0)]);
        stage.add(mesh, 0, Affine3A::IDENTITY);
    }
    stage
}

fn ahead() -> PosedCamera {
    look(Vec3::ZERO, Vec3::NEG_Z)
}

#[test]
fn layers_are_kept_as_often_as_chance_says_and_no_oftener() {
    let (stage, camera) = (walls(5), ahead());
    let (gbuffer, _) = draw(&stage, &camera, [120, 100]);
    for (samples, picks, alpha) in
        SIZES.into_iter().flat_map(|s| [(s, Picks::Stratified, 0.2), (s, Picks::Independent, 0.4)])
    {
        for is_first_left_out in [false, true] {
            let params = MapParams { picks, alpha, is_first_left_out, ..MapParams::paper(samples) };
            let map = StochasticMap::draw(&stage.scene, &stage.pose, &camera, &gbuffer, &params).unwrap();
            let mut kept = [0u32; 6];
            for distance in (0..120 * 100).flat_map(|i| map.distances_m(i)) {
                let layer = (2..=6).find(|d| (distance - *d as f32).abs() < 1e-3);
                assert_eq!(layer.is_none(), distance.is_infinite(), "{distance}");
                kept[layer.map_or(5, |d| d - 2)] += 1;
            }
            // A sample shows the first surface that is kept: geometric, whatever the samples beside it show.
            let first = usize::from(is_first_left_out);
            let mut left = 1.0f64;
            for (layer, count) in kept.iter().enumerate() {
                let expected = match layer {
                    5 => left,
                    _ if layer < first => 0.0,
                    _ => left * f64::from(alpha),
                };
                left -= expected;
                let found = f64::from(*count) / f64::from(120 * 100 * samples);
                assert!((found - expected).abs() < 0.015, "{params:?} layer {layer}: {found}, {expected}");
            }
        }
    }
}

#[test]
fn drawing_is_choosing_from_all_layers() {
    let stage = still_life();
    let parallel = Projection::Orthographic { half_height: 2.0, near: -3.0, far: 20.0 };
    let eye = look(Vec3::new(2.0, 1.0, 3.0), Vec3::new(0.5, 0.3, 0.0));
    for (camera, n) in [(eye, 2), (PosedCamera { projection: parallel, ..eye }, 1)] {
        let gbuffer = rasterize(&stage.scene, &stage.pose, &camera, 47, 33, n).unwrap();
        let layers = Layers::draw(&stage.scene, &stage.pose, &camera, 47, 33, n).unwrap();
        for (samples, is_first_left_out) in SIZES.into_iter().flat_map(|s| [(s, false), (s, true)]) {
            let params = MapParams { is_first_left_out, alpha: 0.4, seed: 9, ..MapParams::paper(samples) };
            let drawn =
                || StochasticMap::draw(&stage.scene, &stage.pose, &camera, &gbuffer, &params).unwrap();
            let map = with_threads(1, drawn);
            assert_eq!(map, StochasticMap::of_layers(&layers, &camera.projection, &params).unwrap());
            assert_eq!(map, with_threads(3, drawn));
            let kept = (0..gbuffer.samples().len()).flat_map(|i| map.distances_m(i));
            assert!(kept.filter(|d| d.is_finite()).count() > 10);
            assert!(map.distances_m(gbuffer.samples().len()).is_empty());
            assert_eq!((map.columns(), map.rows(), map.samples()), (47 * n, 33 * n, samples));
        }
    }
}

#[test]
fn parameters_out_of_range_are_named() {
    let good = MapParams::default();
    for (params, says) in [
        (MapParams { samples: 3, ..good }, "samples is 3, must be 1, 2, 4, 8 or 16"),
        (MapParams { samples: 0, ..good }, "samples is 0"),
        (MapParams { samples: 32, ..good }, "samples is 32"),
        (MapParams { alpha: 0.0, ..good }, "alpha is 0, must be above 0 to 1"),
        (MapParams { alpha: f32::NAN, ..good }, "alpha is NaN"),
        (MapParams { alpha: 1.5, ..good }, "alpha is 1.5"),
    ] {
        let error = params.check().unwrap_err().to_string();
        assert!(error.contains("sdao") && error.contains(says), "{error}");
    }
    let (stage, camera) = (still_life(), look(Vec3::new(2.0, 2.5, 4.0), Vec3::ZERO));
    let (gbuffer, screen) = draw(&stage, &camera, [16, 12]);
    let map = StochasticMap::draw(&stage.scene, &stage.pose, &camera, &gbuffer, &good).unwrap();
    let (_, other) = draw(&stage, &camera, [12, 16]);
    let lookup = Lookup::stochastic(&map);
    let hbao = |screen: &Screen, lookup: &Lookup<'_>| {
        hbao::estimate_visibility_with(screen, &HbaoParams::hbao(), lookup)
    };
    let ssao = |screen: &Screen, lookup: &Lookup<'_>| {
        ssao::estimate_visibility_with(screen, &SsaoParams::default(), lookup)
    };
    assert!(hbao(&screen, &lookup).is_ok() && ssao(&screen, &lookup).is_ok());
    for error in [hbao(&other, &lookup), ssao(&other, &lookup)] {
        assert!(matches!(error, Err(RenderError::Length { .. })), "{error:?}");
    }
    for compensation in [-1.0, f32::NAN, 17.0] {
        let lookup = Lookup { compensation, ..lookup };
        for error in [hbao(&screen, &lookup), ssao(&screen, &lookup)] {
            assert!(matches!(error, Err(RenderError::Parameter { name: "sdao: compensation", .. })));
        }
    }
}
