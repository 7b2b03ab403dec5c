//! Chances that a delta begins with: how choices fell in recordings of the built-in scenes, in 256ths (README.md).

use super::delta::Flags;
use crate::codec::entropy::{Chance, Number};

/// What is learned while a delta is coded.
#[derive(Clone, Debug)]
pub(super) struct Chances {
    /// Whether a stretch has changes.
    pub(super) flags: Flags,
    /// Whether a point's number is other than 0.
    pub(super) some: [Chance; 108],
    /// Whether it goes against the neighbours.
    pub(super) against: [Chance; 120],
    /// Its size − 1.
    pub(super) size: [Number; 25],
}

impl Chances {
    /// At the beginning of a delta.
    pub(super) const START: Chances = Chances {
        flags: flags(),
        some: chances(SOME),
        against: chances(AGAINST),
        size: {
            let mut size = [Number::starting_at([128; 8]); 25];
            let mut at = 0;
            while at < size.len() {
                size[at] = Number::starting_at(SIZE[at]);
                at += 1;
            }
            size
        },
    };
}

/// The numbers that `docs/wire.md` lists, in its order: where the chances of a delta begin, in 256ths.
pub fn first_chances() -> Vec<u8> {
    let flat = SIZE.as_flattened();
    [&STRETCHES[..], &LEAVES, &SOME, &AGAINST, flat].concat()
}

const fn chances<const N: usize>(shares: [u8; N]) -> [Chance; N] {
    let mut out = [Chance::EVEN; N];
    let mut at = 0;
    while at < N {
        out[at] = Chance::of((shares[at] as u16) << 8);
        at += 1;
    }
    out
}

const fn flags() -> Flags {
    let mut out = [[Chance::EVEN; 32]; 4];
    let mut at = 0;
    while at < 24 {
        out[at / 8][at % 8] = Chance::of((STRETCHES[at] as u16) << 8);
        at += 1;
    }
    out[3] = chances(LEAVES);
    out
}

/// Stretches of 4096, 512 and 64 points, by the last three of their level.
#[rustfmt::skip]
const STRETCHES: [u8; 24] = [
    32, 136, 46, 110, 49, 101, 50, 80,
    49, 155, 44, 135, 38, 167, 60, 175,
    50, 177, 54, 179, 39, 180, 62, 209,
];

/// Stretches of 16 points, by the neighbours' change and the last two.
#[rustfmt::skip]
const LEAVES: [u8; 32] = [
    66, 88, 49, 77, 145, 129, 114, 147, 199, 184, 177, 206, 218, 212, 201, 233,
    241, 242, 236, 249, 249, 251, 244, 253, 254, 255, 250, 254, 252, 255, 238, 254,
];

/// By size of the neighbours' numbers, their change, and the edge that is near.
#[rustfmt::skip]
const SOME: [u8; 108] = [
    31, 6, 4, 67, 11, 14, 106, 38, 35, 138, 61, 27, 156, 59, 24, 175, 74, 13,
    85, 10, 17, 92, 24, 27, 110, 49, 45, 132, 69, 50, 147, 103, 56, 163, 128, 31,
    109, 15, 31, 116, 31, 43, 129, 55, 59, 142, 59, 64, 153, 106, 84, 168, 163, 75,
    136, 4, 29, 148, 30, 45, 154, 61, 74, 164, 45, 63, 173, 75, 82, 178, 162, 110,
    172, 5, 31, 185, 42, 36, 189, 71, 66, 197, 53, 53, 204, 57, 71, 208, 107, 111,
    191, 20, 14, 211, 65, 37, 223, 95, 67, 235, 90, 67, 234, 105, 76, 233, 115, 120,
];

/// By distance from the neighbours, their change, and the edge that is near.
#[rustfmt::skip]
const AGAINST: [u8; 120] = [
    128, 128, 128, 168, 128, 247, 168, 128, 251, 162, 128, 254, 164, 128, 255,
    128, 128, 128, 181, 128, 252, 179, 128, 252, 170, 128, 255, 162, 128, 255,
    128, 128, 128, 176, 215, 244, 174, 128, 251, 165, 128, 254, 158, 128, 255,
    124, 6, 248, 142, 65, 231, 163, 203, 240, 159, 128, 254, 157, 128, 255,
    85, 9, 66, 97, 45, 86, 137, 67, 203, 151, 128, 245, 152, 128, 255,
    67, 4, 128, 69, 30, 10, 96, 91, 66, 121, 119, 210, 140, 128, 253,
    98, 7, 128, 75, 56, 128, 81, 148, 128, 95, 183, 63, 110, 7, 238,
    108, 5, 128, 94, 97, 128, 97, 168, 128, 101, 215, 128, 93, 37, 237,
];

/// By size of the neighbours' numbers and their change: whether it is more than 0, 1, …
#[rustfmt::skip]
const SIZE: [[u8; 8]; 25] = [
    [72, 141, 160, 167, 171, 182, 195, 229],
    [21, 60, 126, 182, 206, 233, 237, 240],
    [35, 62, 121, 157, 186, 208, 235, 232],
    [64, 66, 122, 153, 177, 195, 209, 230],
    [98, 103, 140, 155, 178, 164, 195, 194],
    [40, 56, 95, 165, 208, 222, 239, 241],
    [37, 54, 95, 146, 190, 216, 229, 236],
    [43, 61, 95, 136, 171, 198, 214, 230],
    [59, 54, 81, 118, 158, 183, 209, 232],
    [82, 62, 65, 86, 127, 147, 176, 221],
    [84, 97, 108, 98, 157, 216, 196, 206],
    [83, 84, 105, 130, 158, 182, 196, 222],
    [80, 91, 113, 140, 164, 183, 202, 221],
    [101, 100, 123, 140, 154, 174, 187, 215],
    [110, 97, 100, 114, 129, 154, 167, 206],
    [144, 162, 157, 142, 157, 160, 221, 207],
    [150, 163, 169, 172, 168, 167, 171, 202],
    [141, 163, 169, 168, 167, 172, 173, 193],
    [154, 142, 162, 166, 170, 176, 177, 202],
    [172, 164, 156, 160, 167, 172, 176, 196],
    [196, 202, 188, 204, 232, 176, 174, 199],
    [205, 225, 222, 220, 206, 207, 196, 206],
    [200, 218, 219, 217, 214, 204, 200, 202],
    [212, 193, 203, 207, 205, 204, 202, 205],
    [212, 209, 203, 201, 201, 206, 207, 210],
];
