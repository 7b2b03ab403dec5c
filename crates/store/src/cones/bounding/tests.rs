//! Cases of the paper's entry, by hand-made geometry, and its laws.

use glam::Vec3;
use proptest::prelude::*;

use super::super::test_lights::{Light, uniform};
use super::cap::{enclose, turn_towards};
use super::*;

/// Unit vector at an angle from +Z, towards +X.
fn tilted(degrees: f32) -> Vec3 {
    let angle = degrees.to_radians();
    Vec3::new(libm::sinf(angle), 0.0, libm::cosf(angle))
}

fn sample(degrees: f32) -> ConeSample {
    ConeSample { direction: tilted(degrees), value: Vec3::ONE, light: 0, cosine: 1.0 }
}

fn cone(degrees: f32, angle: f32) -> BoundingCone {
    BoundingCone { direction: tilted(degrees), angle: angle.to_radians(), energy: Vec3::ONE }
}

/// Axis and opening angle of each cone, degrees.
fn shape(entry: &BoundingEntry) -> Vec<[f32; 2]> {
    let tilt = |d: Vec3| libm::atan2f(d.x, d.z).to_degrees();
    entry.cones().iter().map(|c| [tilt(c.direction), c.angle.to_degrees()]).collect()
}

#[track_caller]
fn assert_shape(entry: &BoundingEntry, expected: &[[f32; 2]]) {
    let found = shape(entry);
    assert_eq!(found.len(), expected.len(), "{found:?} for {expected:?}");
    for (f, e) in found.iter().zip(expected) {
        assert!((f[0] - e[0]).abs() < 0.1 && (f[1] - e[1]).abs() < 0.1, "{found:?} for {expected:?}");
    }
}

#[test]
fn case_a_a_sample_inside_adds_its_energy_alone() {
    let mut entry = BoundingEntry::from_parts(&[cone(20.0, 10.0), cone(-40.0, 5.0)], 10, 10);
    let cycle = entry.update(&[sample(28.0)], 1, &BoundingParams::default());
    assert_shape(&entry, &[[20.0, 10.0], [-40.0, 5.0]]);
    assert!((entry.cones()[0].energy.y - 1.0).abs() < 1e-6, "10/11 of what was, and 1/11 of the sample");
    assert!((entry.cones()[1].energy.y - 10.0 / 11.0).abs() < 1e-6, "a cone that nothing hit fades");
    assert_eq!((entry.samples(), cycle), (11, Cycle::default()));
}

#[test]
fn case_b_a_sample_outside_is_a_new_cone_while_there_is_room() {
    let mut entry = BoundingEntry::from_parts(&[cone(20.0, 10.0)], 9, 9);
    entry.update(&[sample(31.0)], 1, &BoundingParams::default());
    assert_shape(&entry, &[[20.0, 10.0], [31.0, 0.0]]);
    assert!((entry.cones()[1].energy.y - 0.1).abs() < 1e-6, "its past was misses");
}

#[test]
fn case_c_a_sample_nearer_than_the_cones_to_each_other_extends_one() {
    let params = BoundingParams { cones: 2, ..BoundingParams::default() };
    let mut entry = BoundingEntry::from_parts(&[cone(20.0, 10.0), cone(-40.0, 5.0)], 99, 99);
    let cycle = entry.update(&[sample(50.0)], 1, &params);
    // From 10 to 30 degrees becomes 10 to 50.
    assert_shape(&entry, &[[30.0, 20.0], [-40.0, 5.0]]);
    assert!((cycle.turned_rad.to_degrees() - 10.0).abs() < 0.1 && cycle.reduced);
    // 100 / (1 + 10 · 0.05), rounded down.
    assert_eq!(entry.samples(), 66);
}

#[test]
fn case_d_otherwise_the_closest_cones_merge_and_the_sample_is_a_new_one() {
    let params = BoundingParams { cones: 2, ..BoundingParams::default() };
    let mut entry = BoundingEntry::from_parts(&[cone(20.0, 10.0), cone(0.0, 5.0)], 99, 99);
    entry.update(&[sample(60.0)], 1, &params);
    // From -5 to 30 degrees; the sample was 30 degrees from the nearest rim.
    assert_shape(&entry, &[[12.5, 17.5], [60.0, 0.0]]);
    let [merged, new] = entry.cones() else { panic!("two cones") };
    assert!((merged.energy.y - 2.0 * 0.99).abs() < 1e-5 && (new.energy.y - 0.01).abs() < 1e-6);
}

#[test]
fn one_cone_holds_everything() {
    let params = BoundingParams { cones: 1, ..BoundingParams::default() };
    let mut entry = BoundingEntry::default();
    entry.update(&[sample(0.0), sample(40.0), sample(-20.0)], 8, &params);
    assert_shape(&entry, &[[10.0, 30.0]]);
    assert!((entry.energy().y - 3.0 / 8.0).abs() < 1e-6, "what missed counts");
}

#[test]
fn c_is_reduced_as_the_paper_says() {
    for (degrees, divisor) in [(0.0, 1.01), (0.1, 1.01), (2.0, 1.1), (20.0, 2.0), (40.0, 3.0), (170.0, 3.0)] {
        assert!((reduction(degrees) - divisor).abs() < 1e-6);
    }
}

#[test]
fn a_probe_that_misses_shrinks_the_cone_and_turns_it_away() {
    let params = BoundingParams { discard: true, ..BoundingParams::default() };
    let start = BoundingEntry::from_parts(&[cone(0.0, 20.0), cone(70.0, 0.5)], 100, 100);
    let probe = |degrees: f32, cone, hit| Probe { cone, direction: tilted(degrees), hit };
    let mut entry = start;
    let mut cycle = Cycle::default();
    entry.probe(&[probe(18.0, 0, true), probe(70.0, 1, true)], &params, &mut cycle);
    assert_eq!((entry, cycle), (start, Cycle::default()), "there is light: nothing changes");
    // δ = 2 degrees.
    entry.probe(&[probe(18.0, 0, false)], &params, &mut cycle);
    assert_shape(&entry, &[[-1.0, 18.0], [70.0, 0.5]]);
    assert!((cycle.turned_rad.to_degrees() - 1.0).abs() < 0.05);
    assert_eq!((entry.samples(), cycle.reduced), (95, true));
    assert_eq!(entry.energy(), start.energy(), "shrinking costs no energy");
    // Once an update.
    entry.probe(&[probe(-15.0, 0, false)], &params, &mut cycle);
    assert_eq!(entry.samples(), 95);
    // Small ones go, with their energy; and the order of probes does not matter.
    entry = start;
    entry.probe(&[probe(70.0, 1, false), probe(18.0, 0, false), probe(0.0, 7, false)], &params, &mut cycle);
    assert_shape(&entry, &[[-1.0, 18.0]]);
    assert_eq!(entry.energy(), Vec3::ONE);
    // Unless that is switched off.
    entry = start;
    entry.probe(&[probe(70.0, 1, false)], &BoundingParams { discard: false, ..params }, &mut cycle);
    assert_eq!(entry.energy(), start.energy());
}

#[test]
fn probes_go_just_inside_the_rim() {
    let params = BoundingParams::default();
    let entry = BoundingEntry::from_parts(&[cone(30.0, 20.0)], 8, 8);
    for i in 0..16 {
        let direction = entry.probe_direction(0, i as f32 / 16.0, &params).unwrap();
        assert!((angle_between(direction, tilted(30.0)).to_degrees() - 18.0).abs() < 0.05);
    }
    assert_eq!(entry.probe_direction(1, 0.0, &params), None);
}

/// A light that moves away: the cone follows, by growing on one side and shrinking on the other.
#[test]
fn probing_lets_a_cone_follow_a_light() {
    let params = BoundingParams { cones: 1, ..BoundingParams::default() };
    let mut entry = BoundingEntry::default();
    let at = |update: u32| 60.0 * update as f32 / 400.0;
    let shines = |direction: Vec3, update: u32| angle_between(direction, tilted(at(update))) < 0.1;
    for update in 0..400 {
        let lit: Vec<_> =
            (0..8).map(|i| sample(at(update) + 5.0 * (2.0 * uniform(1, update * 8 + i, 0) - 1.0))).collect();
        let mut cycle = entry.update(&lit, 8, &params);
        let direction = entry.probe_direction(0, uniform(2, update, 0), &params).unwrap();
        let hit = shines(direction, update);
        entry.probe(&[Probe { cone: 0, direction, hit }], &params, &mut cycle);
    }
    let cone = entry.cones()[0];
    assert!(angle_between(cone.direction, tilted(60.0)) < 0.15, "{cone:?}");
    assert!(cone.angle.to_degrees() < 20.0, "without probes it would be 35 degrees wide: {cone:?}");
}

/// In the fluence form a sphere's fluence is the closed form of its irradiance, over cos of its centre for a narrow one.
#[test]
fn totals_are_the_fluence_of_a_sphere() {
    let (light, _) = Light::closed_forms()[0];
    // Radiance · solid angle of the cap.
    let exact = 5.0 * std::f32::consts::TAU * (1.0 - (1.0f32 - 1.0 / 16.0).sqrt());
    let mut sum = 0.0;
    for place in 0..100 {
        let mut entry = BoundingEntry::default();
        for update in 0..60 {
            let lit: Vec<_> = (0..8).filter_map(|i| light.sample(place, update * 8 + i, false)).collect();
            entry.update(&lit, 8, &BoundingParams::default());
        }
        sum += entry.energy().y / 100.0;
        let widest = entry.cones().iter().map(|c| c.angle).fold(0.0, f32::max);
        // Wider than the light at times: what encloses a cone and a sample, one after the other, is not the least that
        // holds all samples. Once the light is covered nothing grows any more.
        assert!(widest < 1.5 * libm::asinf(0.25), "{widest}");
    }
    assert!((sum / exact - 1.0).abs() < 0.02, "{sum} for {exact}");
}

#[test]
fn parameters_out_of_range_are_named() {
    let good = BoundingParams::default();
    assert_eq!(good.check(), Ok(()));
    let bad = [
        ("cones", BoundingParams { cones: 9, ..good }),
        ("max_samples", BoundingParams { max_samples: 256, ..good }),
        ("probe_inset", BoundingParams { probe_inset: 0.0, ..good }),
        ("small_rad", BoundingParams { small_rad: f32::NAN, ..good }),
    ];
    for (name, params) in bad {
        let error = params.check().unwrap_err().to_string();
        assert!(error.contains(name), "{error}");
    }
}

fn any_cone() -> impl Strategy<Value = BoundingCone> {
    let vector = prop::array::uniform3(-1f32..1.0).prop_map(|v| Vec3::from_array(v).normalize_or(Vec3::X));
    (vector, 0f32..2.0).prop_map(|(direction, angle)| BoundingCone { direction, angle, energy: Vec3::ONE })
}

proptest! {
    #[test]
    fn the_least_cap_holds_both(a in any_cone(), b in any_cone(), turn in 0f32..1.0, towards in 0f32..1.0) {
        let (direction, angle) = enclose(&a, &b);
        prop_assert!((direction.length() - 1.0).abs() < 1e-5);
        for cone in [a, b] {
            let entry = BoundingEntry::from_parts(&[cone], 1, 1);
            let params = BoundingParams { probe_inset: towards, ..BoundingParams::default() };
            let inside = entry.probe_direction(0, turn, &params).unwrap();
            prop_assert!(angle_between(direction, inside) <= angle + 2e-3);
        }
        let between = angle_between(a.direction, b.direction);
        let least = (0.5 * (a.angle + b.angle + between)).min(std::f32::consts::PI).max(a.angle).max(b.angle);
        prop_assert!((angle - least).abs() < 2e-3, "{angle} for {least}");
    }

    #[test]
    fn turning_keeps_to_the_angle(a in any_cone(), b in any_cone(), angle in -3f32..3.0) {
        let turned = turn_towards(a.direction, b.direction, angle);
        prop_assert!((angle_between(turned, a.direction) - angle.abs()).abs() < 2e-3);
    }

    #[test]
    fn cones_add_up_to_the_mean_of_the_samples(
        samples in prop::collection::vec((any_cone(), 0f32..9.0), 1..200),
        cones in 1u8..=8,
    ) {
        let params = BoundingParams { cones, least_turn_rad: 3.2, ..BoundingParams::default() };
        let mut entry = BoundingEntry::default();
        let mut mean = 0.0;
        for (cone, value) in &samples {
            let value = Vec3::splat(*value);
            entry.update(&[ConeSample { direction: cone.direction, value, light: 0, cosine: 1.0 }], 1, &params);
            mean += value.y / samples.len() as f32;
        }
        prop_assert!((entry.energy().y - mean).abs() <= mean * 2e-5 + 1e-12);
        prop_assert!(entry.cones().len() <= usize::from(cones));
        // Every sample lies in a cone.
        for (cone, value) in &samples {
            let holds = |c: &BoundingCone| angle_between(c.direction, cone.direction) <= c.angle + 1e-2;
            prop_assert!(*value == 0.0 || entry.cones().iter().any(holds));
        }
    }

    #[test]
    fn nothing_is_ever_nan(
        bits in prop::collection::vec((prop::array::uniform8(any::<u32>()), 0u32..20, 0usize..9), 1..60),
    ) {
        let mut entry = BoundingEntry::default();
        let params = BoundingParams { discard: false, ..BoundingParams::default() };
        for (bits, drawn, cone) in bits {
            let f = bits.map(f32::from_bits);
            let direction = Vec3::new(f[0], f[1], f[2]);
            let hostile = ConeSample { direction, value: Vec3::new(f[3], f[4], f[5]), light: 0, cosine: 1.0 };
            let plain = ConeSample { direction: direction.normalize_or(Vec3::X), value: Vec3::splat(f[6].abs()), light: 1, cosine: 1.0 };
            let mut cycle = entry.update(&[hostile, plain], drawn, &params);
            entry.probe(&[Probe { cone, direction, hit: false }], &params, &mut cycle);
            for cone in entry.cones() {
                prop_assert!(cone.energy.is_finite() && cone.energy.min_element() >= 0.0, "{cone:?}");
                prop_assert!((0.0..=std::f32::consts::PI).contains(&cone.angle), "{cone:?}");
                prop_assert!((cone.direction.length() - 1.0).abs() < 1e-4, "{cone:?}");
            }
        }
    }
}
