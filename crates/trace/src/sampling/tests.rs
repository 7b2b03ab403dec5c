//! Evenness, repeatability and error of the directions.

use dapple_scene::glam::Vec3;
use proptest::prelude::*;

use super::{
    cosine_hemisphere, fixed_pattern, hash, orthonormal_basis, scramble, sin_cos_turns, sobol, unit_interval,
};

#[test]
fn hash_depends_on_every_bit() {
    let base = |i: u32| (u64::from(i) * 3, u64::from(i) << 20, i);
    let changed = |f: &dyn Fn((u64, u64, u32)) -> (u64, u64, u32)| {
        let bits: u32 = (0..512)
            .map(|i| {
                let (a, b) = (base(i), f(base(i)));
                (hash(a.0, a.1, a.2) ^ hash(b.0, b.1, b.2)).count_ones()
            })
            .sum();
        f64::from(bits) / 512.0
    };
    for bit in 0..64 {
        for mean in [
            changed(&|(s, k, n)| (s ^ 1 << bit, k, n)),
            changed(&|(s, k, n)| (s, k ^ 1 << bit, n)),
            changed(&|(s, k, n)| (s, k, n ^ 1 << (bit % 32))),
        ] {
            // 16 of 32 bits, standard deviation of the mean 0.125.
            assert!((mean - 16.0).abs() < 0.65, "bit {bit} changes {mean} bits");
        }
    }
}

#[test]
fn hash_and_pattern_never_change() {
    // What is stored for a site depends on its directions: these are for ever.
    assert_eq!([hash(0, 0, 0), hash(1, 2, 3), hash(u64::MAX, 7, 9)], PINNED_HASHES);
    let mut out = Vec::new();
    fixed_pattern(3, 0x1234_5678, &mut out);
    let bits: Vec<[u32; 3]> = out.iter().map(|d| d.to_array().map(f32::to_bits)).collect();
    assert_eq!(bits, PINNED_DIRECTIONS);
}

const PINNED_HASHES: [u32; 3] = [595_752_380, 3_497_215_824, 2_895_783_672];
const PINNED_DIRECTIONS: [[u32; 3]; 3] = [
    [1_059_063_580, 3_208_146_961, 1_050_263_605],
    [1_053_825_973, 982_417_305, 1_063_904_794],
    [3_198_770_725, 1_059_476_576, 1_060_058_668],
];

#[test]
fn sines_are_close() {
    for i in 0..=100_000 {
        let turns = i as f32 / 100_000.0;
        let (s, c) = sin_cos_turns(turns);
        let angle = f64::from(turns) * std::f64::consts::TAU;
        assert!((f64::from(s) - libm::sin(angle)).abs() < 2.5e-7, "sin at {turns}");
        assert!((f64::from(c) - libm::cos(angle)).abs() < 2.5e-7, "cos at {turns}");
    }
}

#[test]
fn every_elementary_box_holds_one() {
    // The (0,2)-net property: of the first 2^m points exactly one lies in each box of 2^-a by 2^-(m-a).
    for seed in 0..20 {
        for m in [2, 4, 6, 8] {
            let points: Vec<[u32; 2]> = (0..1 << m)
                .map(|i| {
                    let [x, y] = sobol(i);
                    [scramble(x, hash(seed, 0, 0)), scramble(y, hash(seed, 1, 0))]
                })
                .collect();
            for a in 0..=m {
                let mut counts = vec![0; 1 << m];
                for [x, y] in &points {
                    let column = u64::from(*x) >> (32 - a);
                    let row = u64::from(*y) >> (32 - (m - a));
                    counts[(column << (m - a) | row) as usize] += 1;
                }
                assert!(counts.iter().all(|c| *c == 1), "seed {seed}, 2^{m} points, {a} bits of x");
            }
        }
    }
}

#[test]
fn patterns_are_prefixes_of_each_other() {
    let (mut short, mut long) = (vec![Vec3::ONE; 3], Vec::new());
    for site in [0, 1, 0xffff_ffff] {
        fixed_pattern(256, site, &mut long);
        for k in [0, 1, 16, 64, 100, 256] {
            fixed_pattern(k, site, &mut short);
            assert_eq!(short, long[..k as usize]);
        }
    }
    let mut other = Vec::new();
    fixed_pattern(256, 0, &mut other);
    assert_ne!(other, long);
}

#[test]
fn density_is_the_cosine() {
    let mut out = Vec::new();
    let (mut sum, mut squares, n) = (Vec3::ZERO, Vec3::ZERO, 4096.0);
    for site in 0..64 {
        fixed_pattern(64, site * 31, &mut out);
        for d in &out {
            assert!((d.length() - 1.0).abs() < 3e-7 && d.z >= 0.0);
            sum += *d / n;
            squares += *d * *d / n;
        }
    }
    // Means of cosine density: z 2/3, z² 1/2, x² and y² 1/4.
    assert!(sum.abs_diff_eq(Vec3::new(0.0, 0.0, 2.0 / 3.0), 2e-3), "{sum}");
    assert!(squares.abs_diff_eq(Vec3::new(0.25, 0.25, 0.5), 2e-3), "{squares}");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn directions_are_unit(u in 0.0_f32..1.0, v in 0.0_f32..1.0) {
        let d = cosine_hemisphere([u, v]);
        prop_assert!((d.length() - 1.0).abs() < 3e-7 && d.z > 0.0);
    }

    #[test]
    fn bases_are_orthonormal(x in -1.0_f32..1.0, y in -1.0_f32..1.0, z in -1.0_f32..1.0, axis in 0_usize..6) {
        let axes = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
        for n in [Vec3::new(x, y, z), Vec3::new(x, y, -0.0), axes[axis], axes[axis] + 1e-6 * Vec3::new(x, y, z)] {
            let n = n.normalize_or(Vec3::X);
            let (t, b) = orthonormal_basis(n);
            prop_assert!((t.length() - 1.0).abs() < 1e-6 && (b.length() - 1.0).abs() < 1e-6);
            prop_assert!(t.dot(b).abs() < 1e-6 && t.dot(n).abs() < 1e-6 && b.dot(n).abs() < 1e-6);
            prop_assert!(t.cross(b).abs_diff_eq(n, 1e-6));
        }
    }
}

/// Mean absolute error of the visibility of hemispheres half hidden by a plane through the normal, at a random turn,
/// over many sites: with the pattern and with independent random directions.
fn errors(rays: u32) -> (f64, f64) {
    let (mut pattern, mut random) = (0.0, 0.0);
    let mut directions = Vec::new();
    let sites = 2000_u32;
    for site in 0..sites {
        let (sin, cos) = sin_cos_turns(unit_interval(hash(9, u64::from(site), 0)));
        let edge = Vec3::new(cos, sin, 0.0);
        let error = |directions: &[Vec3]| {
            let open = directions.iter().filter(|d| d.dot(edge) > 0.0).count();
            (open as f64 / f64::from(rays) - 0.5).abs() / f64::from(sites)
        };
        fixed_pattern(rays, hash(1, u64::from(site), 0), &mut directions);
        pattern += error(&directions);
        let number = |i| unit_interval(hash(2, u64::from(site), i));
        directions = (0..rays).map(|i| cosine_hemisphere([number(2 * i), number(2 * i + 1)])).collect();
        random += error(&directions);
    }
    (pattern, random)
}

#[test]
fn patterns_err_less_than_chance() {
    // Chance errs by 0.4 / sqrt(k) on average.
    for (rays, bound) in [(16, 0.05), (64, 0.02), (256, 0.008)] {
        let (pattern, random) = errors(rays);
        println!(
            "{rays} rays: mean error {pattern:.5} instead of {random:.5}, ratio {:.2}",
            random / pattern
        );
        assert!((random * f64::from(rays).sqrt() - 0.4).abs() < 0.03, "{random}");
        assert!(pattern < bound, "{rays} rays: {pattern}");
    }
}
