//! Shading with cones against sums over their directions.

use std::f32::consts::{FRAC_1_PI, TAU};

use dapple_scene::{Reflectance, ShadingPoint};
use dapple_store::cones::{ConeSample, GRAZING_COSINE, MomentParams};
use glam::Vec3;

use super::cap::{Ground, Lanes, Lens, lift};
use super::*;

/// A place on a floor, seen from a height of 45°.
fn floor(diffuse: f32, f0: f32, roughness: f32, specular: bool) -> ShadingPoint {
    ShadingPoint {
        instance: 0,
        position_world: Vec3::ZERO,
        normal_world: Vec3::Y,
        normal_shading_world: Vec3::Y,
        to_viewer_world: Vec3::new(1.0, 1.0, 0.0).normalize(),
        reflectance: Reflectance {
            diffuse: Vec3::splat(diffuse),
            f0: Vec3::splat(f0),
            alpha: (roughness * roughness).max(2e-3),
            specular,
        },
        emitted: Vec3::ZERO,
    }
}

/// Radiance of one cone of an entry with that normal.
#[inline(always)]
fn shade(point: &ShadingPoint, cap: &Cap, normal: Vec3, shading: &SlcShading) -> Vec3 {
    let mut lanes = Lanes::new();
    let mut lens = Lens::of(point, shading, &mut lanes);
    lens.add(cap, &Ground { normal, normal_shading: normal }, 1.0);
    lens.radiance()
}

fn ratio(samples: u32) -> SlcShading {
    SlcShading { samples: Samples::Fixed(samples), ..SlcShading::default() }
}

/// A cap of radiance 1 as the entry of a place with that normal keeps it, by sums over what of it is above the horizon. What grazes the place counts a little more
/// than its cosine.
fn cap(direction: Vec3, angle: f32, normal: Vec3) -> Cap {
    let (mut sum, mut count, mut open, mut moment) = (0.0f64, 0, 0, Vec3::ZERO);
    each_direction(direction, angle, |w| {
        count += 1;
        if normal.dot(w) > 0.0 {
            sum += f64::from(normal.dot(w).max(GRAZING_COSINE));
            open += 1;
            moment += w;
        }
    });
    let (solid_angle, open) = (TAU * (1.0 - angle.cos()), open.max(1) as f32);
    Cap {
        direction: moment.normalize_or(direction),
        cos_angle: 2.0 * moment.length() / open - 1.0,
        energy: Vec3::splat((sum / f64::from(count)) as f32 * solid_angle),
        mean_cosine: sum as f32 / open,
    }
}

/// Irradiance of a cap of radiance 1, by sums.
fn irradiance(direction: Vec3, angle: f32, normal: Vec3) -> f32 {
    let (mut sum, mut count) = (0.0f64, 0);
    each_direction(direction, angle, |w| {
        sum += f64::from(normal.dot(w).max(0.0));
        count += 1;
    });
    (sum / f64::from(count)) as f32 * TAU * (1.0 - angle.cos())
}

/// Many directions evenly in a cap.
fn each_direction(axis: Vec3, angle: f32, mut call: impl FnMut(Vec3)) {
    let (tangent, bitangent) = axis.any_orthonormal_pair();
    for i in 0..4000 {
        let z = 1.0 - (1.0 - angle.cos()) * (i as f32 + 0.5) / 4000.0;
        let turn = i as f32 * 2.399_963_2;
        let r = (1.0 - z * z).max(0.0).sqrt();
        call(axis * z + tangent * (r * turn.cos()) + bitangent * (r * turn.sin()));
    }
}

/// What a cap of radiance 1 leaves towards the viewer, by sums.
fn exact(point: &ShadingPoint, direction: Vec3, angle: f32) -> f32 {
    let (mut sum, mut count) = (0.0f64, 0);
    each_direction(direction, angle, |w| {
        sum += f64::from(point.reflected(w).x);
        count += 1;
    });
    (sum / f64::from(count)) as f32 * TAU * (1.0 - angle.cos())
}

fn tilted(degrees: f32) -> Vec3 {
    let angle = degrees.to_radians();
    Vec3::new(-angle.sin(), angle.cos(), 0.0)
}

#[test]
fn diffuse_light_is_exact_with_any_number_of_directions() {
    let point = floor(0.6, 0.04, 1.0, false);
    // Light that grazes the floor is what of it rings of a few directions say.
    for (direction, angle, tolerance) in [
        (Vec3::Y, 0.3, 1e-4),
        (tilted(50.0), 0.4, 1e-4),
        (tilted(88.0), 0.3, 0.06),
        (tilted(100.0), 0.5, 0.06),
    ] {
        let cap = cap(direction, angle, Vec3::Y);
        let exact = irradiance(direction, angle, Vec3::Y) * 0.6 * FRAC_1_PI;
        for samples in [4, 8, 16, 64] {
            let found = shade(&point, &cap, Vec3::Y, &ratio(samples)).x;
            assert!((found - exact).abs() <= tolerance * exact, "{direction} {samples}: {found}, {exact}");
        }
    }
}

/// The paper's form divides by no cosines: directions have to have the cap's mean themselves.
#[test]
fn the_papers_cones_give_the_irradiance_of_their_caps() {
    let point = floor(0.6, 0.04, 1.0, false);
    for angle in [0.3f32, 0.8, 1.2] {
        let energy = Vec3::splat(TAU * (1.0 - angle.cos()));
        let cap = Cap { direction: Vec3::Y, cos_angle: angle.cos(), energy, mean_cosine: 1.0 };
        // Of radiance 1: π sin² a.
        let exact = 0.6 * angle.sin() * angle.sin();
        for samples in [4, 8, 16, 64] {
            let papers = SlcShading { form: Form::Fluence, ..ratio(samples) };
            let found = shade(&point, &cap, Vec3::Y, &papers).x;
            assert!((found - exact).abs() < 1e-3 * exact, "{angle} {samples}: {found}, {exact}");
        }
    }
}

/// An entry's bump faces away from a light that the floor about it does not: a pixel beside has all of it.
#[test]
fn light_that_an_entry_faces_away_from_is_there_for_pixels_beside() {
    for specular in [false, true] {
        let point = floor(0.6, 0.5, 0.4, specular);
        let direction = tilted(60.0);
        let of =
            |cosine: f32| Cap { direction, cos_angle: 1.0, energy: Vec3::splat(cosine), mean_cosine: cosine };
        let shade = |cosine: f32, normal_shading: Vec3| {
            let mut lanes = Lanes::new();
            let mut lens = Lens::of(&point, &SlcShading::default(), &mut lanes);
            lens.add(&of(cosine), &Ground { normal: Vec3::Y, normal_shading }, 1.0);
            lens.radiance().x
        };
        let (away, facing) = (shade(GRAZING_COSINE, tilted(-45.0)), shade(0.5, Vec3::Y));
        assert!((away - facing).abs() <= 1e-4 * facing, "{away}, {facing}");
    }
}

/// Lights along the horizon, far apart, in one cone: its directions are no higher than they are.
#[test]
fn a_cone_that_reaches_below_the_horizon_is_as_high_as_its_light() {
    for (degrees, apart) in [(2.0f32, 40.0f32), (10.0, 60.0), (20.0, 80.0)] {
        let (low, half) = (degrees.to_radians(), apart.to_radians());
        let lights = [-half, 0.0, half]
            .map(|turn| Vec3::new(turn.cos() * low.cos(), low.sin(), turn.sin() * low.cos()));
        let mean = lights.iter().sum::<Vec3>() / 3.0;
        let cap = Cap {
            direction: mean.normalize(),
            cos_angle: 2.0 * mean.length() - 1.0,
            energy: Vec3::ONE,
            mean_cosine: low.sin(),
        };
        let (mut x, mut y, mut z) = ([0.0f32; 64], [0.0f32; 64], [0.0f32; 64]);
        let mut i = 0;
        each_direction(cap.direction, cap.cos_angle.acos(), |w| {
            if i % 62 == 31 && i / 62 < 64 {
                (x[i / 62], y[i / 62], z[i / 62]) = w.into();
            }
            i += 1;
        });
        assert!(y.iter().any(|height| *height < 0.0), "{degrees}: all above");
        lift::<64>(&mut x, &mut y, &mut z, &cap, Vec3::Y);
        let found = y.iter().sum::<f32>() / 64.0;
        assert!((found - low.sin()).abs() < 1e-3, "{degrees}: {found}, {}", low.sin());
        for i in 0..64 {
            let direction = Vec3::new(x[i], y[i], z[i]);
            assert!(direction.y >= 0.0 && direction.is_normalized(), "{direction}");
        }
    }
}

#[test]
fn gloss_is_that_of_the_reflectance() {
    for (roughness, angle) in [(0.15f32, 0.1f32), (0.3, 0.25), (0.6, 0.4), (1.0, 0.6)] {
        let point = floor(0.3, 0.5, roughness, true);
        for direction in [tilted(45.0), tilted(20.0), tilted(70.0)] {
            let cap = cap(direction, angle, Vec3::Y);
            let exact = exact(&point, direction, angle);
            let found = |samples| shade(&point, &cap, Vec3::Y, &samples).x;
            let (many, adaptive) = (found(ratio(64)), found(SlcShading::default()));
            assert!((many - exact).abs() <= 0.03 * exact, "{roughness} {direction}: {many}, {exact}");
            assert!((adaptive - exact).abs() <= 0.12 * exact, "{roughness} {direction}: {adaptive}, {exact}");
        }
    }
}

/// Sixteen directions of a wide cone on a polished floor, seen from many sides: as points of light they are nearly all or nothing, which is what the
/// paper's form has.
#[test]
fn a_wide_cone_on_a_smooth_surface_is_no_swarm_of_points() {
    let (direction, angle) = (tilted(45.0), 0.4f32);
    let fluence = Cap {
        mean_cosine: 1.0,
        energy: Vec3::splat(TAU * (1.0 - angle.cos())),
        ..cap(direction, angle, Vec3::Y)
    };
    let papers = SlcShading { form: Form::Fluence, ..ratio(16) };
    let (mut ours, mut theirs, mut all) = (0.0f32, 0.0f32, 0.0f32);
    for step in -20..=20 {
        let lean = (45.0 + step as f32).to_radians();
        let to_viewer_world = Vec3::new(lean.sin(), lean.cos(), 0.1).normalize();
        let point = ShadingPoint { to_viewer_world, ..floor(0.0, 0.5, 0.15, true) };
        let exact = exact(&point, direction, angle);
        let found = |cap: &Cap, shading: &SlcShading| shade(&point, cap, Vec3::Y, shading).x;
        ours += (found(&cap(direction, angle, Vec3::Y), &ratio(16)) - exact).abs();
        theirs += (found(&fluence, &papers) - exact).abs();
        all += exact;
    }
    println!("{} and {}", ours / all, theirs / all);
    assert!(ours < 0.8 * theirs, "{} and {}", ours / all, theirs / all);
}

#[test]
fn fluence_and_irradiance_are_the_same_light() {
    let point = floor(0.5, 0.04, 0.5, true);
    let (direction, angle) = (tilted(40.0), 0.2);
    let irradiance = cap(direction, angle, Vec3::Y);
    let fluence = Cap { energy: Vec3::splat(TAU * (1.0 - angle.cos())), mean_cosine: 1.0, ..irradiance };
    let a = shade(&point, &irradiance, Vec3::Y, &ratio(64)).x;
    let b = shade(&point, &fluence, Vec3::Y, &SlcShading { form: Form::Fluence, ..ratio(64) }).x;
    assert!((a - b).abs() <= 5e-3 * a, "{a}, {b}");
}

#[test]
fn light_from_behind_the_surface_reaches_nothing_and_nothing_breaks() {
    let mut point = floor(0.5, 0.04, 0.3, true);
    // The shading normal leans to the light, which the true surface does not see.
    point.normal_shading_world = tilted(60.0);
    let behind = Cap { direction: tilted(100.0), cos_angle: 0.999, energy: Vec3::ONE, mean_cosine: 0.5 };
    assert_eq!(shade(&point, &behind, tilted(60.0), &ratio(16)), Vec3::ZERO);
    for alpha in [2e-3, 1.0] {
        for cos_angle in [-1.0, 0.0, 1.0] {
            for direction in [Vec3::Y, -Vec3::Y, Vec3::X, point.to_viewer_world, -point.to_viewer_world] {
                for normal in [Vec3::Y, -Vec3::Y, Vec3::ZERO] {
                    for viewer in [Vec3::Y, Vec3::X, -Vec3::Y] {
                        point.to_viewer_world = viewer;
                        point.reflectance.alpha = alpha;
                        let cap = Cap { direction, cos_angle, energy: Vec3::splat(1e3), mean_cosine: 1e-3 };
                        for samples in [1, 16] {
                            let found = shade(&point, &cap, normal, &ratio(samples));
                            assert!(found.is_finite() && found.min_element() >= 0.0, "{found}");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn irradiance_on_a_turned_surface_is_by_its_own_cosine() {
    let direction = tilted(60.0);
    let mut entry = MomentEntry::default();
    let sample = ConeSample { direction, value: Vec3::new(0.5, 0.25, 1.0), light: 0, cosine: 0.5 };
    entry.update(&[sample], 1, &MomentParams::default());
    for (normal, times) in [(Vec3::Y, 1.0), (direction, 2.0), (tilted(-60.0), 0.0), (-direction, 0.0)] {
        let (mut found, exact) = (Vec3::ZERO, sample.value * times);
        entry.each_cap(|cap, _, _| found += cap.irradiance(normal));
        assert!(found.distance(exact) < 1e-5 + 0.02 * exact.length(), "{normal}: {found}, {exact}");
    }
}

/// Two lights of equal fluence in one cone, one overhead and one near the horizon: a smooth surface shows as much of both as of one that
/// has a cone of its own, but for where the highlight is.
#[test]
fn gloss_is_by_fluence() {
    let point = floor(0.0, 1.0, 0.9, true);
    let one = |degrees: f32| {
        let direction = tilted(degrees);
        let cosine = direction.y;
        Cap { direction, cos_angle: 0.9999, energy: Vec3::splat(cosine), mean_cosine: cosine }
    };
    let (a, b) = (one(10.0), one(80.0));
    let apart = [a, b].map(|cap| shade(&point, &cap, Vec3::Y, &ratio(64)).x);
    let mean = (a.direction + b.direction) * 0.5;
    let together = Cap {
        direction: mean.normalize(),
        cos_angle: 2.0 * mean.length() - 1.0,
        energy: a.energy + b.energy,
        mean_cosine: 0.5 * (a.energy.x + b.energy.x),
    };
    let found = shade(&point, &together, Vec3::Y, &ratio(64)).x;
    let sum = apart[0] + apart[1];
    assert!((found / sum - 1.0).abs() < 0.35, "{found}, {sum}");
}

/// With wide vectors and without, to the bit.
#[test]
fn wide_vectors_change_no_number() {
    for i in 0..40 {
        let point = floor(0.5, 0.3, 0.05 + 0.02 * i as f32, i % 3 > 0);
        let direction = Vec3::new(libm::sinf(i as f32), 0.6, libm::cosf(2.0 * i as f32)).normalize();
        let cap = cap(direction, 0.02 + 0.05 * i as f32, Vec3::Y);
        let shading = if i % 2 == 0 { SlcShading::default() } else { ratio(16) };
        let plain = shade(&point, &cap, Vec3::Y, &shading);
        let wide = vectorized(
            #[inline(always)]
            || shade(&point, &cap, Vec3::Y, &shading),
        );
        assert_eq!(plain, wide, "{i}");
    }
}
