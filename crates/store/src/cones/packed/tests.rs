//! Error bounds of packed entries, and that any bits are one.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::Vec3;
use proptest::prelude::*;

use super::super::entry::{ConeEntry, angle_between, luminance};
use super::super::test_lights::{Light, uniform};
use super::super::{BoundingCone, BoundingEntry, LightSet, MomentCone, MomentEntry, MomentParams};
use super::*;

/// A unit vector from a seed.
fn direction(seed: u32, i: u32) -> Vec3 {
    let z = 2.0 * uniform(seed, i, 0) - 1.0;
    let (r, turn) = ((1.0 - z * z).max(0.0).sqrt(), std::f32::consts::TAU * uniform(seed, i, 1));
    Vec3::new(r * libm::cosf(turn), r * libm::sinf(turn), z).normalize()
}

/// Energy over twelve decades, sometimes of one colour.
fn energy(seed: u32, i: u32) -> Vec3 {
    let channel = |d| libm::powf(10.0, 12.0 * uniform(seed, i, d) - 6.0);
    let one = if uniform(seed, i, 20) < 0.2 { 0.0 } else { 1.0 };
    Vec3::new(channel(10), one * channel(11), one * channel(12))
}

fn assert_energy(back: Vec3, energy: Vec3) {
    let bound = energy / 8192.0 + Vec3::splat(1e-12);
    assert!((back - energy).abs().cmple(bound).all(), "{back} for {energy}");
}

#[test]
fn sizes_are_as_promised() {
    assert_eq!((PAPER_BITS, size_of::<PackedPaper>()), (286, 36));
    assert_eq!((size_of::<PackedMoment<3>>(), size_of::<PackedMoment<4>>()), (61, 80));
    // The two bits beyond stay free.
    let cones = [BoundingCone { direction: -Vec3::Y, angle: PI, energy: Vec3::splat(1e30) }; 3];
    let full = PackedPaper::pack(&BoundingEntry::from_parts(&cones, 255, 0), Vec3::Z).unwrap();
    assert_eq!(full.0[35] >> 6, 0);
    assert_eq!(full.0[35], 0xff >> 2, "the last of C, and three cones");
}

#[test]
fn the_papers_entry_is_within_its_bounds() {
    let (mut worst, mut worst_angle) = (0.0f32, 0.0f32);
    for seed in 0..20_000 {
        let normal = direction(seed, 99);
        let count = (uniform(seed, 50, 0) * 4.0) as u32;
        let cones: Vec<_> = (0..count)
            .map(|i| BoundingCone {
                direction: direction(seed, i),
                angle: uniform(seed, i, 2) * FRAC_PI_2,
                energy: energy(seed, i),
            })
            .collect();
        let samples = (uniform(seed, 51, 0) * 256.0) as u16;
        let entry = BoundingEntry::from_parts(&cones, samples, 0);
        let packed = PackedPaper::pack(&entry, normal).unwrap();
        let back = packed.unpack(normal);
        assert_eq!((back.samples(), back.cones().len()), (samples, cones.len()));
        for (back, cone) in back.cones().iter().zip(&cones) {
            // The chord is precise where an arc cosine is not.
            worst = worst.max(back.direction.distance(cone.direction));
            worst_angle = worst_angle.max((back.angle - cone.angle).abs());
            assert_energy(back.energy, cone.energy);
        }
        // What was packed once is packed the same again, or as its neighbour.
        let again = PackedPaper::pack(&back, normal).unwrap().unpack(normal);
        assert!(
            again.cones().iter().zip(back.cones()).all(|(a, b)| a.energy == b.energy && a.angle == b.angle)
        );
        assert!(
            again.cones().iter().zip(back.cones()).all(|(a, b)| a.direction.distance(b.direction) < 0.002)
        );
    }
    assert!(worst < 0.0015 && worst > 0.001, "direction: {worst}");
    assert!(worst_angle.to_degrees() < 0.72 && worst_angle.to_degrees() > 0.7, "angle: {worst_angle}");
    // Wider than it can say, more than it can hold.
    let wide = BoundingCone { direction: Vec3::Z, angle: 2.0, energy: Vec3::ONE };
    let entry = BoundingEntry::from_parts(&[wide], 300, 0);
    let back = PackedPaper::pack(&entry, Vec3::Z).unwrap().unpack(Vec3::Z);
    assert_eq!((back.cones()[0].angle, back.samples()), (FRAC_PI_2, 255));
    assert_eq!(PackedPaper::pack(&BoundingEntry::from_parts(&[wide; 4], 1, 0), Vec3::Z), None);
}

#[test]
fn our_entry_is_within_its_bounds() {
    let mut worst = 0.0f32;
    for seed in 0..20_000 {
        let count = (uniform(seed, 50, 0) * 5.0) as u32;
        let cones: Vec<_> = (0..count)
            .map(|i| {
                let u = uniform(seed, i, 2);
                let lights = LightSet::from_bits((f64::from(uniform(seed, i, 3)) * 4_294_967_296.0) as u32);
                // Narrow ones most.
                let (cos_angle, cosine) = (libm::cosf(3.0 * u * u), 0.01 + 0.99 * u);
                let cone =
                    MomentCone::from_cap(direction(seed, i), cos_angle, energy(seed, i), cosine, lights);
                MomentCone { seen: [0.0, 1.0, 0.3 * u + 0.1][i as usize % 3], ..cone }
            })
            .collect();
        let samples = (uniform(seed, 51, 0) * 4096.0) as u16;
        let entry = MomentEntry::from_parts(&cones, samples, seed << 10);
        let back = PackedMoment::<4>::pack(&entry).unwrap().unpack();
        assert_eq!((back.samples(), back.cones().len()), (samples, cones.len()));
        assert_eq!(back.taken(), (seed << 10) & 0x1_ffff);
        for (back, cone) in back.cones().iter().zip(&cones) {
            worst = worst.max(back.direction().distance(cone.direction()));
            let (a, error) = (cone.angle(), (back.angle() - cone.angle()).abs());
            // 4e-4 is what an arc cosine near 1 tells apart; a sum of energies rounds, too.
            let rounding = 4e-4 + 4e-4 / (a + 0.5);
            assert!(error <= (PI * a).sqrt() / 4095.0 + 1e-6 + rounding, "{a} is off by {error}");
            assert_eq!(back.lights, cone.lights);
            assert_energy(back.energy, cone.energy);
            assert!((back.seen - cone.seen).abs() < 0.5001 / 4095.0);
            let all = luminance(back.energy) + back.hidden;
            assert!(cone.seen == 0.0 || (luminance(back.energy) / all - back.seen).abs() < 1e-5);
        }
        assert_eq!(PackedMoment::<3>::pack(&entry).is_none(), count > 3);
    }
    assert!(worst < 6e-4 && worst > 3e-4, "direction: {worst}");
}

/// Energy and angle survive when an entry is packed after every update of one sample.
#[test]
fn packing_after_every_update_does_not_drift() {
    let params = MomentParams::default();
    let [(sphere, exact), _, (disc, exact_disc), _] = Light::closed_forms();
    for (light, exact) in [(sphere, exact), (disc, exact_disc)] {
        let (mut plain_sum, mut packed_sum, mut angles) = (0.0, 0.0, [0.0f32; 2]);
        for place in 0..60 {
            let mut plain = MomentEntry::default();
            let mut packed = PackedMoment::<3>::default();
            for update in 0..800 {
                let lit: Vec<_> = light.sample(place, update, true).into_iter().collect();
                plain.update(&lit, 1, &params);
                let mut entry = packed.unpack();
                entry.update(&lit, 1, &params);
                packed = PackedMoment::pack(&entry).unwrap();
            }
            let packed = packed.unpack();
            plain_sum += plain.energy().y / 60.0;
            packed_sum += packed.energy().y / 60.0;
            for (sum, entry) in angles.iter_mut().zip([&plain, &packed]) {
                let weighed = entry.cones().iter().map(|c| c.angle() * luminance(c.energy));
                *sum += weighed.sum::<f32>() / luminance(entry.energy()) / 60.0;
            }
        }
        assert!((packed_sum / exact - 1.0).abs() < 0.02, "{light:?}: {packed_sum} for {exact}");
        assert!((packed_sum / plain_sum - 1.0).abs() < 0.01, "{light:?}: {packed_sum} for {plain_sum}");
        assert!((angles[1] / angles[0] - 1.0).abs() < 0.05, "{light:?}: {angles:?}");
    }
}

#[test]
fn confidence_is_cut_in_place() {
    let cone = MomentCone::from_cap(Vec3::X, 0.9, Vec3::ONE, 1.0, LightSet::one(9));
    let entry = MomentEntry::from_parts(&[cone], 200, 77);
    let mut packed = PackedMoment::<3>::pack(&entry).unwrap();
    let before = packed.unpack();
    packed.cut_confidence(9);
    assert_eq!(
        (packed.confidence(), packed.unpack().cones(), packed.unpack().taken()),
        (9, before.cones(), 77)
    );
    let cone = BoundingCone { direction: Vec3::X, angle: 0.2, energy: Vec3::ONE };
    let mut packed = PackedPaper::pack(&BoundingEntry::from_parts(&[cone; 3], 201, 0), Vec3::Y).unwrap();
    let before = packed.unpack(Vec3::Y);
    assert_eq!(packed.confidence(), 201);
    packed.cut_confidence(250);
    assert_eq!(packed.confidence(), 201);
    packed.cut_confidence(17);
    assert_eq!((packed.confidence(), packed.unpack(Vec3::Y).cones()), (17, before.cones()));
}

proptest! {
    #[test]
    fn any_bits_are_an_entry(
        paper in prop::collection::vec(any::<u8>(), 36),
        header: [u8; 4],
        cones in prop::array::uniform4(prop::array::uniform19(any::<u8>())),
        normal in any::<u32>(),
    ) {
        let normal = direction(normal, 0);
        let entry = PackedPaper(paper.try_into().unwrap()).unpack(normal);
        for cone in entry.cones() {
            prop_assert!(cone.energy.is_finite() && cone.energy.min_element() >= 0.0);
            prop_assert!((cone.direction.length() - 1.0).abs() < 1e-4 && (0.0..=FRAC_PI_2).contains(&cone.angle));
        }
        let entry = PackedMoment::from_parts(header, cones).unpack();
        for cone in entry.cones() {
            prop_assert!(cone.energy.is_finite() && cone.energy.min_element() >= 0.0);
            prop_assert!(cone.moment.is_finite() && (0.0..=PI).contains(&cone.angle()));
            prop_assert!((cone.direction().length() - 1.0).abs() < 1e-4);
            prop_assert!(angle_between(cone.direction(), cone.direction()) < 2e-3);
        }
        prop_assert!(usize::from(entry.samples()) < 4096 && entry.cones().len() <= 4);
    }
}
