//! Truth, laws and cases of moment cones.

use std::f32::consts::PI;

use glam::Vec3;
use proptest::prelude::*;

use super::super::entry::angle_between;
use super::super::test_lights::Light;
use super::*;

fn sample(direction: Vec3, value: Vec3, light: u32) -> ConeSample {
    ConeSample { direction, value, light, cosine: 1.0 }
}

/// Unit vector at an angle from +Z, towards +X.
fn tilted(degrees: f32) -> Vec3 {
    let angle = degrees.to_radians();
    Vec3::new(libm::sinf(angle), 0.0, libm::cosf(angle))
}

fn any_sample() -> impl Strategy<Value = ConeSample> {
    let vector = prop::array::uniform3(-1f32..1.0).prop_map(Vec3::from_array);
    let value = (prop::array::uniform3(0f32..1.0), -3i32..4, any::<bool>());
    (vector, value, 0u32..5).prop_map(|(direction, (value, scale, dark), light)| {
        let value = if dark { Vec3::ZERO } else { Vec3::from_array(value) * libm::powf(10.0, scale as f32) };
        sample(direction.normalize_or(Vec3::X), value, light)
    })
}

fn any_params() -> impl Strategy<Value = MomentParams> {
    (1u8..=4, 0.5f32..4.0, 0f32..0.1, any::<bool>(), 0f32..3.0).prop_map(
        |(cones, inside, least_share, tagged, apart_rad)| MomentParams {
            cones,
            inside,
            max_samples: 4095,
            least_share,
            tagged,
            apart_rad,
        },
    )
}

/// Updates of one to nine samples, in this order.
fn fill(samples: &[ConeSample], params: &MomentParams) -> MomentEntry {
    let mut entry = MomentEntry::default();
    for (i, chunk) in samples.chunks(1 + samples.len() % 9).enumerate() {
        let lit: Vec<_> = chunk.iter().filter(|s| s.value != Vec3::ZERO).copied().collect();
        // What is dark may be given, or only counted.
        let given = if i % 2 == 0 { &lit[..] } else { chunk };
        entry.update(given, chunk.len() as u32, params);
    }
    entry
}

proptest! {
    #[test]
    fn cones_add_up_to_the_mean_of_the_samples_in_any_order(
        (samples, shuffled) in prop::collection::vec(any_sample(), 1..150)
            .prop_flat_map(|s| (Just(s.clone()), Just(s).prop_shuffle())),
        params in any_params(),
    ) {
        let mut mean = Vec3::ZERO.as_dvec3();
        let mut mean_moment = Vec3::ZERO.as_dvec3();
        for s in &samples {
            mean += s.value.as_dvec3() / samples.len() as f64;
            mean_moment += (s.direction * luminance(s.value)).as_dvec3() / samples.len() as f64;
        }
        for order in [&samples, &shuffled] {
            let entry = fill(order, &params);
            prop_assert!(entry.cones().len() <= usize::from(params.cones));
            prop_assert_eq!(usize::from(entry.samples()), samples.len());
            let error = (entry.energy().as_dvec3() - mean).abs();
            prop_assert!(error.cmple(mean * 2e-5 + 1e-12).all(), "{entry:?}: {mean} is off by {error}");
            // What gives up its place takes on the direction of its heir.
            if params.least_share < 1e-9 {
                let moment = entry.cones().iter().fold(Vec3::ZERO, |sum, cone| sum + cone.moment);
                prop_assert!((moment.as_dvec3() - mean_moment).length() <= mean.length() * 2e-5 + 1e-12);
            }
        }
    }

    #[test]
    fn with_c_at_its_limit_the_total_is_the_mean_that_forgets(
        samples in prop::collection::vec(any_sample(), 1..300),
        params in any_params(),
        max_samples in 1u16..40,
    ) {
        let params = MomentParams { max_samples, ..params };
        let mut entry = MomentEntry::default();
        let (mut mean, mut c) = (0f64, 0f64);
        for chunk in samples.chunks(3) {
            entry.update(chunk, chunk.len() as u32, &params);
            let n = chunk.len() as f64;
            let sum: f64 = chunk.iter().map(|s| f64::from(s.value.y)).sum();
            mean = mean * c / (c + n) + sum / (c + n);
            c = (c + n).min(f64::from(max_samples));
            let error = (f64::from(entry.energy().y) - mean).abs();
            prop_assert!(error <= mean * 1e-4 + 1e-12, "{mean} is off by {error}");
        }
    }

    #[test]
    fn nothing_is_ever_nan_or_negative(
        bits in prop::collection::vec((prop::array::uniform8(any::<u32>()), 0u32..20), 1..60),
        params in any_params(),
    ) {
        let mut entry = MomentEntry::default();
        for (bits, drawn) in bits {
            let f = bits.map(f32::from_bits);
            let light = bits[6] % 4;
            let hostile = sample(Vec3::new(f[0], f[1], f[2]), Vec3::new(f[3], f[4], f[5]), light);
            let plain = sample(Vec3::new(f[0], f[1], f[2]).normalize_or(Vec3::X), Vec3::splat(f[6].abs()), light);
            entry.update(&[hostile, plain], drawn, &params);
            let [from, to] = [Vec3::new(f[0], f[1], f[2]), Vec3::new(f[3], f[4], f[5])];
            let (energy_ratio, fluence_ratio, size_ratio, most_cosine) = (f[6], f[5], f[7], f[4]);
            entry.re_aim(LightSet::one(light), &ReAim { from, to, energy_ratio, fluence_ratio, most_cosine, size_ratio });
            for cone in entry.cones() {
                prop_assert!(cone.energy.is_finite() && cone.energy.min_element() >= 0.0, "{cone:?}");
                prop_assert!(cone.moment.is_finite() && cone.angle().is_finite(), "{cone:?}");
                prop_assert!((cone.direction().length() - 1.0).abs() < 1e-5, "{cone:?}");
                prop_assert!(cone.moment.length() <= cone.fluence * 1.0001 + 1e-18, "{cone:?}");
            }
        }
    }

    #[test]
    fn a_cap_has_its_angle(angle in 0f32..PI, x in -1f32..1.0, y in -1f32..1.0) {
        let axis = Vec3::new(x, y, 0.7).normalize();
        let cone = MomentCone::from_cap(axis, libm::cosf(angle), Vec3::new(0.2, 3.0, 1.0), 1.0, LightSet::one(1));
        prop_assert!((libm::cosf(cone.angle()) - libm::cosf(angle)).abs() < 1e-6);
        prop_assert!(angle > 3.13 || cone.direction().distance(axis) < 1e-3);
    }
}

/// The closed forms: sphere overhead and grazing, disc, rectangle. What the ratio form shades a diffuse place with is
/// the total of the cones.
#[test]
fn totals_are_the_irradiance_of_lights_with_a_closed_form() {
    for (light, exact) in Light::closed_forms() {
        let mut sum = 0.0;
        let entries = 200;
        for place in 0..entries {
            let mut entry = MomentEntry::default();
            for update in 0..100 {
                let samples: Vec<_> =
                    (0..8).filter_map(|i| light.sample(place, update * 8 + i, true)).collect();
                entry.update(&samples, 8, &MomentParams::default());
            }
            sum += entry.energy().y / entries as f32;
        }
        assert!((sum / exact - 1.0).abs() < 0.02, "{light:?}: {sum} for {exact}");
    }
}

#[test]
fn a_cone_has_the_angle_of_the_cap_that_lights_it() {
    // The sphere of radius 0.5 at 2 m is a cap of asin(1/4), nearly evenly bright under the cosine.
    let (sphere, _) = Light::closed_forms()[0];
    let one = MomentParams { cones: 1, ..MomentParams::default() };
    let mut entry = MomentEntry::default();
    for i in 0..4000 {
        let samples: Vec<_> = sphere.sample(0, i, true).into_iter().collect();
        entry.update(&samples, 1, &MomentParams { max_samples: 4095, ..one });
    }
    let [cone] = entry.cones() else { panic!("one cone") };
    assert!((cone.angle() - libm::asinf(0.25)).abs() < 0.01, "{}", cone.angle());
    assert!(angle_between(cone.direction(), Vec3::Z) < 0.02);
}

#[test]
fn cases_a_to_d() {
    let params = MomentParams { cones: 2, tagged: false, ..MomentParams::default() };
    let one = Vec3::ONE;
    let mut entry = MomentEntry::default();
    let mut add = |degrees: f32| {
        entry.update(&[sample(tilted(degrees), one, 0)], 1, &params);
        entry.cones().iter().map(|c| tilt(c.direction())).collect::<Vec<_>>()
    };
    // B: there is room.
    assert_near(&add(0.0), &[0.0]);
    assert_near(&add(10.0), &[0.0, 10.0]);
    // A: the same place again.
    assert_near(&add(10.0), &[0.0, 10.0]);
    // C: 4 degrees from a cone, and the cones are 10 apart.
    assert_near(&add(14.0), &[0.0, 34.0 / 3.0]);
    // D: 70 degrees from the nearest, and the cones are only 11 apart: they become one.
    assert_near(&add(80.0), &[34.0 / 4.0, 80.0]);
    // What is inside it from now on.
    let spread = 1.6 * entry.cones()[0].angle().to_degrees();
    assert!((8.0..14.0).contains(&spread), "{spread}");
}

fn tilt(direction: Vec3) -> f32 {
    libm::atan2f(direction.x, direction.z).to_degrees()
}

fn assert_near(found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{found:?} for {expected:?}");
    assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 0.1), "{found:?} for {expected:?}");
}

#[test]
fn lights_stay_apart_while_there_is_room_and_merge_last() {
    let params = MomentParams { cones: 2, ..MomentParams::default() };
    let mut entry = MomentEntry::default();
    // A wide cone of light 0 with light 1 in its midst.
    let wide = [-30.0, 30.0, -15.0, 15.0].map(|d| sample(tilted(d), Vec3::ONE, 0));
    entry.update(&wide, 4, &params);
    entry.update(&[sample(tilted(0.0), Vec3::ONE, 1)], 1, &params);
    let tags: Vec<_> = entry.cones().iter().map(|c| c.lights.single()).collect();
    assert_eq!(tags, [Some(0), Some(1)], "{entry:?}");
    // Without tags it falls into the wide cone.
    let mut blind = MomentEntry::default();
    let params = MomentParams { tagged: false, cones: 1, ..params };
    blind.update(&wide, 4, &params);
    blind.update(&[sample(tilted(0.0), Vec3::ONE, 1)], 1, &params);
    assert_eq!(blind.cones().len(), 1);
    assert!(blind.may_hold(0) && blind.may_hold(1) && blind.cones()[0].lights.single().is_none());
}

#[test]
fn a_light_that_leaves_is_forgotten_at_a_known_rate() {
    let params = MomentParams::default();
    let mut entry = MomentEntry::default();
    for _ in 0..300 {
        entry.update(&[sample(Vec3::Z, Vec3::ONE, 0)], 1, &params);
    }
    assert_eq!(entry.samples(), 255);
    // Where movers are known C is cut to 8; with 8 samples an update half is left after each, then 8/16, 16/24 ...
    entry.cut_confidence(8);
    for (update, left) in [8.0 / 16.0, 8.0 / 24.0, 8.0 / 32.0, 8.0 / 40.0].into_iter().enumerate() {
        entry.update(&[], 8, &params);
        assert!((entry.energy().y - left).abs() < 1e-5, "update {update}: {}", entry.energy().y);
    }
    for _ in 0..60_000 {
        entry.update(&[], 1, &params);
    }
    assert!(entry.cones().is_empty(), "what decayed to nothing is gone");
}

#[test]
fn small_cones_give_up_their_place_but_not_their_energy() {
    let params = MomentParams::default();
    let mut entry = MomentEntry::default();
    entry.update(
        &[sample(tilted(60.0), Vec3::ONE, 0), sample(tilted(0.0), Vec3::splat(0.000_9), 1)],
        2,
        &params,
    );
    assert_eq!(entry.cones().len(), 1);
    let cone = entry.cones()[0];
    assert!((entry.energy() - Vec3::splat(0.500_45)).abs().max_element() < 1e-6);
    assert_eq!(cone.lights.single(), Some(0));
    assert!(cone.angle() < 1e-3, "its shape stays: {}", cone.angle());
}

#[test]
fn a_cone_of_one_light_follows_it() {
    let params = MomentParams { cones: 2, ..MomentParams::default() };
    let mut entry = MomentEntry::default();
    let near = [sample(tilted(8.0), Vec3::ONE, 3), sample(tilted(12.0), Vec3::ONE, 3)];
    for _ in 0..4 {
        entry.update(&near, 2, &MomentParams { cones: 1, ..params });
    }
    entry.update(&[sample(tilted(-50.0), Vec3::ONE, 4)], 2, &params);
    let before = entry;
    let aim = ReAim {
        from: tilted(10.0),
        to: tilted(40.0),
        energy_ratio: 0.5,
        fluence_ratio: 0.5,
        most_cosine: 1.0,
        size_ratio: 2.0,
    };
    assert_eq!(entry.re_aim(LightSet::one(3), &aim), 1);
    let [turned, other] = entry.cones() else { panic!("two cones") };
    assert!((tilt(turned.direction()) - 40.0).abs() < 0.1);
    assert!((turned.angle() / before.cones()[0].angle() - 2.0).abs() < 0.02);
    assert!((turned.energy.y / before.cones()[0].energy.y - 0.5).abs() < 1e-6);
    assert_eq!(other, &before.cones()[1]);
    // Opposite: half a turn about whatever axis, and back again.
    let aim = ReAim {
        from: tilted(40.0),
        to: -tilted(40.0),
        energy_ratio: 1.0,
        fluence_ratio: 1.0,
        size_ratio: 1.0,
        ..aim
    };
    entry.re_aim(LightSet::one(3), &aim);
    assert!(entry.cones()[0].direction().distance(-tilted(40.0)) < 1e-2);
    // Gone dark.
    assert_eq!(entry.re_aim(LightSet::one(3), &ReAim { energy_ratio: 0.0, fluence_ratio: 0.0, ..aim }), 1);
    assert_eq!(entry.cones().len(), 1);
    // Of several lights: those that have just these.
    let mut shared = MomentEntry::default();
    shared.update(&near, 2, &MomentParams { cones: 1, ..params });
    shared.update(&[sample(tilted(-50.0), Vec3::ONE, 4)], 1, &MomentParams { cones: 1, ..params });
    let both = LightSet::one(3).union(LightSet::one(4));
    let half = ReAim { energy_ratio: 0.5, fluence_ratio: 0.5, ..aim };
    assert_eq!([3, 4].map(|light| shared.re_aim(LightSet::one(light), &half)), [0, 0]);
    let had = shared.energy().y;
    assert_eq!(shared.re_aim(both, &half), 1);
    assert!((shared.energy().y / had - 0.5).abs() < 1e-6);
    // No number: nothing happens.
    let still = entry;
    let unknown = ReAim { energy_ratio: f32::NAN, fluence_ratio: f32::NAN, ..aim };
    assert_eq!(entry.re_aim(LightSet::one(4), &unknown), 0);
    assert_eq!(entry, still);
}

#[test]
fn parameters_out_of_range_are_named() {
    let good = MomentParams::default();
    assert_eq!(good.check(), Ok(()));
    let bad = [
        ("cones", MomentParams { cones: 5, ..good }),
        ("inside", MomentParams { inside: f32::NAN, ..good }),
        ("max_samples", MomentParams { max_samples: 0, ..good }),
        ("least_share", MomentParams { least_share: 0.5, ..good }),
        ("apart_rad", MomentParams { apart_rad: -1.0, ..good }),
    ];
    for (name, params) in bad {
        let error = params.check().unwrap_err().to_string();
        assert!(error.contains(name), "{error}");
    }
}

fn hidden(light: u32, value: f32) -> HiddenSample {
    HiddenSample { light, value }
}

#[test]
fn what_nothing_hides_is_seen_whole_from_the_first_sample() {
    let mut entry = MomentEntry::default();
    // Values of samples differ, as those of a wide light do.
    for (degrees, value) in [(10.0, 0.2), (14.0, 3.0), (12.0, 0.7)] {
        let one = sample(tilted(degrees), Vec3::splat(value), 4);
        entry.update_seen(&[one], &[], 1, |_| 1.0, &MomentParams::default());
        let seen: f32 = entry.cones().iter().map(|cone| cone.seen).sum();
        assert!((seen - 1.0).abs() < 1e-6, "{entry:?}");
    }
}

#[test]
fn what_is_seen_is_the_mean_of_seen_and_hidden_samples() {
    let params = MomentParams::default();
    let mut entry = MomentEntry::default();
    for i in 0..400u32 {
        let (light, value) = (i % 2, if i % 2 == 0 { 2.0 } else { 0.5 });
        let direction = tilted(if light == 0 { 20.0 } else { -50.0 });
        // Of light 0 one of four is hidden, of light 1 three of four.
        let is_hidden = if light == 0 { i / 2 % 4 == 0 } else { i / 2 % 4 != 0 };
        let shown = [sample(direction, Vec3::splat(value), light)];
        let (lit, dark): (&[_], Vec<_>) = if is_hidden {
            (&[], vec![hidden(light, luminance(Vec3::splat(value)))])
        } else {
            (&shown, Vec::new())
        };
        entry.update_seen(lit, &dark, 1, |_| 0.5, &params);
    }
    let of = |light| {
        entry.cones().iter().filter(|c| c.lights.single() == Some(light)).map(|c| c.seen).sum::<f32>()
    };
    assert!((of(0) - 0.75).abs() < 0.01 && (of(1) - 0.25).abs() < 0.02, "{} {}", of(0), of(1));
    let aim = ReAim {
        from: tilted(20.0),
        to: tilted(30.0),
        energy_ratio: 0.5,
        fluence_ratio: 0.5,
        most_cosine: 1.0,
        size_ratio: 1.0,
    };
    let before = of(0);
    let mut moved = entry;
    assert_eq!(moved.re_aim(LightSet::one(0), &aim), 1);
    let cone = moved.cones().iter().find(|c| c.lights.single() == Some(0)).unwrap();
    assert!((luminance(cone.energy) / (luminance(cone.energy) + cone.hidden) - before).abs() < 1e-3);
    assert_eq!(cone.seen, before, "a light that moves is hidden as much as before until samples tell");
}

/// Light that grazed a surface which turned towards it: by cosines alone its energy would grow without bound, turn after turn.
#[test]
fn a_cone_that_follows_its_light_has_no_more_than_its_fluence_allows() {
    let mut entry = MomentEntry::default();
    let grazing = ConeSample { cosine: 0.1, ..sample(tilted(84.0), Vec3::new(0.1, 0.2, 0.1), 2) };
    entry.update_seen(
        &[grazing],
        &[HiddenSample { light: 2, value: 0.4 }],
        2,
        |_| 1.0,
        &MomentParams::default(),
    );
    let before = entry.cones()[0];
    let aim = ReAim {
        from: tilted(84.0),
        to: tilted(60.0),
        energy_ratio: 1e6,
        fluence_ratio: 1.0,
        most_cosine: 0.5,
        size_ratio: 1.0,
    };
    for _ in 0..2 {
        assert_eq!(entry.re_aim(LightSet::one(2), &aim), 1);
        let after = entry.cones()[0];
        assert!((after.fluence / before.fluence - 1.0).abs() < 1e-5, "{after:?}");
        assert!((luminance(after.energy) / after.fluence - 0.5).abs() < 1e-5, "{after:?}");
        let seen = |cone: &MomentCone| luminance(cone.energy) / (luminance(cone.energy) + cone.hidden);
        assert!((seen(&after) - seen(&before)).abs() < 1e-5, "{after:?}");
    }
}

#[test]
fn an_entry_that_is_cut_to_nothing_begins_anew() {
    let params = MomentParams::default();
    let of = |degrees: f32, light| sample(tilted(degrees), Vec3::ONE, light);
    let mut entry = MomentEntry::default();
    entry.update_seen(&[of(60.0, 0), of(0.0, 1), of(-60.0, 2)], &[hidden(0, 1.0)], 4, |_| 0.3, &params);
    entry.cut_confidence(0);
    let mut fresh = MomentEntry::default();
    for entry in [&mut entry, &mut fresh] {
        entry.update_seen(&[of(-40.0, 0), of(10.0, 3)], &[], 2, |_| 0.5, &params);
    }
    assert_eq!(entry.cones(), fresh.cones());
}

#[test]
fn a_light_that_comes_out_was_hidden_until_then() {
    let params = MomentParams::default();
    let mut entry = MomentEntry::default();
    for _ in 0..30 {
        entry.update_seen(&[], &[hidden(3, 1.0)], 1, |_| 1.0, &params);
    }
    assert!(entry.cones().is_empty());
    let ten = [sample(Vec3::Z, Vec3::ONE, 3); 10];
    entry.update_seen(&ten, &[], 10, |_| 1.0, &params);
    assert!((entry.cones()[0].seen - 0.25).abs() < 1e-3, "{:?}", entry.cones()[0]);
    assert!((luminance(entry.energy()) - 0.25).abs() < 1e-3, "as its energy says");
}

#[test]
fn what_is_not_known_is_not_told() {
    let params = MomentParams { cones: 1, ..MomentParams::default() };
    let [a, b] = [sample(tilted(20.0), Vec3::ONE, 0), sample(tilted(-20.0), Vec3::ONE, 1)];
    let mut mixed = MomentEntry::default();
    mixed.update_seen(&[a, b], &[], 2, |_| 1.0, &params);
    assert!(mixed.cones().iter().all(|cone| cone.seen == 0.0), "several lights in a cone");
    let mut rare = MomentEntry::default();
    rare.update_seen(&[a], &[], 8, |_| 0.1, &params);
    assert!(rare.cones()[0].seen == 0.0, "less than one sample of it was to be");
    let mut plain = MomentEntry::default();
    plain.update(&[a], 8, &params);
    assert!(plain.cones()[0].seen == 0.0, "nothing is said of what was hidden");
}

proptest! {
    #[test]
    fn parts_that_are_seen_are_parts(
        draws in prop::collection::vec((any_sample(), any::<bool>()), 1..120),
        params in any_params(),
    ) {
        let mut entry = MomentEntry::default();
        for chunk in draws.chunks(7) {
            let lit: Vec<_> = chunk.iter().filter(|d| !d.1).map(|d| d.0).collect();
            let dark: Vec<_> = chunk.iter().filter(|d| d.1).map(|d| hidden(d.0.light, luminance(d.0.value))).collect();
            entry.update_seen(&lit, &dark, chunk.len() as u32, |_| 0.2, &params);
            for light in 0..5 {
                let of = entry.cones().iter().filter(|c| c.lights.single() == Some(light));
                let sum: f32 = of.map(|c| c.seen).sum();
                prop_assert!((0.0..1.0001).contains(&sum), "{sum}");
            }
            prop_assert!(entry.cones().iter().all(|c| c.hidden.is_finite() && c.hidden >= 0.0));
        }
    }
}
