//! The places around a sample that are looked at, and how they are turned from sample to sample.

use glam::Vec3;

use crate::noise::hash;

/// Side of the tile of turns, samples of the picture.
pub(super) const NOISE_SIDE: usize = 16;

/// Places in the unit hemisphere about +z, and a tile of unit vectors in the plane z = 0 that they are turned to.
pub(super) struct Pattern {
    pub(super) offsets: Vec<Vec3>,
    pub(super) turns: Vec<Vec3>,
}

impl Pattern {
    /// `samples` is at least 1.
    pub(super) fn new(samples: u32, seed: u32) -> Pattern {
        let offset = |i: u32| {
            let [x, y, z] = [0, 1, 2].map(|axis| random(seed, 0, 3 * i + axis));
            let part = i as f32 / samples as f32;
            direction(Vec3::new(2.0 * x - 1.0, 2.0 * y - 1.0, z), Vec3::Z) * (0.1 + 0.9 * part * part)
        };
        let turn = |i: u32| {
            let [x, y] = [0, 1].map(|axis| 2.0 * random(seed, 1, 2 * i + axis) - 1.0);
            direction(Vec3::new(x, y, 0.0), Vec3::X)
        };
        Pattern {
            offsets: (0..samples).map(offset).collect(),
            turns: (0..(NOISE_SIDE * NOISE_SIDE) as u32).map(turn).collect(),
        }
    }

    /// Of a sample of the picture.
    pub(super) fn turn(&self, column: usize, row: usize) -> Vec3 {
        self.turns[row % NOISE_SIDE * NOISE_SIDE + column % NOISE_SIDE]
    }
}

fn direction(v: Vec3, otherwise: Vec3) -> Vec3 {
    v.try_normalize().unwrap_or(otherwise)
}

/// A number in [0, 1) that depends on every bit of a seed, a list and a place in it.
fn random(seed: u32, list: u32, place: u32) -> f32 {
    (hash([seed, list, place]) >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_lie_in_the_hemisphere_nearest_first_and_turns_in_the_plane() {
        for (samples, seed) in [(1, 0), (16, 0), (16, 7), (256, u32::MAX)] {
            let pattern = Pattern::new(samples, seed);
            assert_eq!(pattern.offsets.len(), samples as usize);
            for (i, offset) in pattern.offsets.iter().enumerate() {
                let part = i as f32 / samples as f32;
                assert!((offset.length() - (0.1 + 0.9 * part * part)).abs() < 1e-6, "{i}: {offset}");
                assert!(offset.z >= 0.0, "{i}: {offset}");
            }
            for turn in &pattern.turns {
                assert!(turn.z == 0.0 && (turn.length() - 1.0).abs() < 1e-6, "{turn}");
            }
        }
    }

    #[test]
    fn random_numbers_are_spread_evenly_and_differ_by_seed_and_list() {
        let list = |seed, list| (0..4096).map(|i| random(seed, list, i)).collect::<Vec<f32>>();
        let (numbers, others) = (list(3, 0), [list(4, 0), list(3, 1)]);
        assert!(numbers.iter().all(|x| (0.0..1.0).contains(x)));
        for eighth in 0..8 {
            let from = eighth as f32 / 8.0;
            let count = numbers.iter().filter(|&&x| x >= from && x < from + 0.125).count();
            // 512 expected, standard deviation 21.
            assert!((426..598).contains(&count), "{eighth}: {count}");
        }
        for other in others {
            assert!(numbers.iter().zip(&other).filter(|(a, b)| a == b).count() < 4);
        }
    }
}
