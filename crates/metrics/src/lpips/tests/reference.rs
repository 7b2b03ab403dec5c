//! The trained weights, and what others get with them. They are not part of this repository.

use std::path::PathBuf;

use super::*;

/// The folder of weights and example pictures, if it is there.
fn folder() -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared");
    let shared = PathBuf::from(std::env::var("DAPPLE_SHARED").unwrap_or(default.to_owned()));
    let folder = shared.join("metrics/lpips-squeeze");
    if !folder.is_dir() {
        eprintln!("skipped: LPIPS with trained weights, because {} is not there", folder.display());
        return None;
    }
    Some(folder)
}

fn trained(folder: &std::path::Path) -> Lpips {
    Lpips::from_safetensors(&std::fs::read(folder.join("lpips_v0.1_squeeze.safetensors")).unwrap()).unwrap()
}

/// The example pictures of the LPIPS repository. The expected values were computed with numpy from the same weights.
#[test]
fn agrees_on_the_examples_of_its_authors() {
    let Some(folder) = folder() else { return };
    let lpips = trained(&folder);
    let picture = |name: &str| {
        let picture = image::open(folder.join(name)).unwrap().into_rgb8();
        assert_eq!(picture.dimensions(), (64, 64));
        picture.into_raw()
    };
    let reference = picture("ex_ref.png");
    for (name, expected) in [("ex_p0.png", 0.71105), ("ex_p1.png", 0.14790), ("ex_ref.png", 0.0)] {
        let distance = lpips.distance(64, 64, &reference, &picture(name)).unwrap();
        println!("{name}: {distance:.6}");
        assert!((distance - expected).abs() < 1e-4, "{name}: {distance} instead of {expected}");
    }
}

/// The example in the documentation of torchmetrics' `LearnedPerceptualImagePatchSimilarity`, `net_type="squeeze"`: two
/// batches of two pictures each, of numbers from a Mersenne twister of seed 42; it prints 0.1024 for the mean over the
/// second argument's first batch and 0.0938 for another. Both, to five digits, from numpy.
#[test]
fn agrees_with_torchmetrics_on_noise() {
    let Some(folder) = folder() else { return };
    let lpips = trained(&folder);
    let mut twister = Twister::new(42);
    const SIDE: usize = 100;
    // Channels first, as torch draws them; then interleaved.
    let mut picture = || {
        let planes: Vec<f32> = (0..3 * SIDE * SIDE).map(|_| twister.unit() * 2.0 - 1.0).collect();
        (0..SIDE * SIDE).flat_map(|i| [0, 1, 2].map(|c| planes[c * SIDE * SIDE + i])).collect::<Vec<f32>>()
    };
    let pictures = [0; 4].map(|_| picture());
    for (pair, expected) in [(0, 0.10238), (1, 0.09377)] {
        let side = SIDE as u32;
        let taps = lpips.taps(side, side, &pictures[pair], &pictures[2 + pair], |v| v).unwrap();
        let distance = sum(&taps).unwrap();
        println!("pair {pair}: {distance:.6}");
        assert!((distance - expected).abs() < 1e-4, "pair {pair}: {distance} instead of {expected}");
    }
}

/// MT19937 ([Matsumoto1998]): M. Matsumoto, T. Nishimura: *Mersenne Twister*, ACM Transactions on Modeling and
/// Computer Simulation 8(1), 1998.
struct Twister {
    state: [u32; 624],
    next: usize,
}

impl Twister {
    fn new(seed: u32) -> Twister {
        let mut state = [seed; 624];
        for i in 1..624 {
            let last = state[i - 1];
            state[i] = (last ^ last >> 30).wrapping_mul(1_812_433_253).wrapping_add(i as u32);
        }
        Twister { state, next: 624 }
    }

    fn bits(&mut self) -> u32 {
        if self.next == 624 {
            for i in 0..624 {
                let joined = self.state[i] & 0x8000_0000 | self.state[(i + 1) % 624] & 0x7FFF_FFFF;
                let twist = if joined & 1 == 1 { 0x9908_B0DF } else { 0 };
                self.state[i] = self.state[(i + 397) % 624] ^ joined >> 1 ^ twist;
            }
            self.next = 0;
        }
        let mut y = self.state[self.next];
        self.next += 1;
        y ^= y >> 11;
        y ^= y << 7 & 0x9D2C_5680;
        y ^= y << 15 & 0xEFC6_0000;
        y ^ y >> 18
    }

    /// 0 … 1 in steps of 2⁻²⁴.
    fn unit(&mut self) -> f32 {
        (self.bits() & 0xFF_FFFF) as f32 / (1 << 24) as f32
    }
}

/// The tenth thousandth number of seed 5489 is given by the C++ standard ([rand.predef]).
#[test]
fn the_twister_is_the_twister() {
    let mut twister = Twister::new(5489);
    let bits: Vec<u32> = (0..10_000).map(|_| twister.bits()).collect();
    assert_eq!(bits[9999], 4_123_659_995);
}
