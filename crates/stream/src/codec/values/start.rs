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
    31, 108, 43, 111, 48, 108, 69, 97,
    46, 147, 29, 138, 35, 177, 59, 170,
    48, 175, 54, 191, 40, 174, 67, 207,
];

/// Stretches of 16 points, by the neighbours' change and the last two.
#[rustfmt::skip]
const LEAVES: [u8; 32] = [
    64, 90, 45, 72, 137, 123, 106, 133, 184, 176, 169, 200, 216, 204, 199, 231,
    236, 237, 231, 245, 248, 250, 242, 253, 254, 255, 252, 255, 252, 255, 255, 255,
];

/// By size of the neighbours' numbers, their change, and the edge that is near.
#[rustfmt::skip]
const SOME: [u8; 108] = [
    22, 1, 3, 55, 20, 12, 94, 42, 24, 131, 92, 14, 147, 86, 15, 169, 78, 12,
    60, 29, 10, 76, 37, 26, 103, 75, 51, 130, 105, 37, 146, 111, 41, 163, 127, 30,
    85, 16, 24, 91, 46, 33, 116, 83, 66, 138, 134, 59, 151, 146, 69, 168, 166, 68,
    95, 81, 31, 132, 54, 41, 143, 127, 98, 156, 132, 91, 165, 167, 82, 178, 193, 94,
    99, 21, 20, 167, 61, 59, 178, 105, 128, 189, 180, 115, 192, 181, 111, 201, 172, 89,
    137, 57, 37, 142, 56, 63, 187, 121, 128, 212, 187, 199, 228, 187, 188, 229, 160, 98,
];

/// By distance from the neighbours, their change, and the edge that is near.
#[rustfmt::skip]
const AGAINST: [u8; 120] = [
    128, 128, 128, 183, 128, 254, 191, 128, 253, 191, 128, 255, 206, 128, 255,
    128, 128, 128, 178, 128, 249, 191, 128, 253, 185, 128, 255, 201, 128, 255,
    128, 128, 128, 160, 249, 243, 182, 128, 250, 177, 128, 255, 194, 128, 254,
    129, 6, 251, 138, 108, 213, 169, 193, 238, 173, 128, 255, 190, 128, 255,
    104, 10, 70, 110, 64, 67, 155, 125, 190, 166, 128, 253, 184, 128, 255,
    77, 3, 128, 77, 24, 13, 116, 113, 77, 141, 9, 199, 171, 128, 254,
    89, 7, 128, 63, 22, 128, 81, 70, 128, 95, 9, 65, 128, 7, 231,
    96, 9, 128, 89, 51, 128, 98, 169, 128, 83, 128, 128, 90, 37, 235,
];

/// By size of the neighbours' numbers and their change: whether it is more than 0, 1, …
#[rustfmt::skip]
const SIZE: [[u8; 8]; 25] = [
    [67, 137, 147, 161, 165, 175, 192, 215],
    [13, 53, 183, 241, 247, 255, 253, 245],
    [21, 36, 73, 172, 193, 235, 217, 243],
    [53, 39, 82, 128, 147, 139, 128, 225],
    [82, 78, 94, 81, 155, 139, 166, 222],
    [24, 49, 104, 241, 241, 203, 238, 243],
    [23, 38, 102, 185, 236, 249, 254, 243],
    [28, 37, 70, 128, 192, 237, 249, 241],
    [53, 39, 55, 80, 140, 184, 218, 240],
    [81, 60, 60, 65, 96, 112, 179, 228],
    [80, 103, 87, 70, 37, 128, 128, 128],
    [74, 71, 91, 114, 118, 166, 226, 241],
    [64, 68, 84, 94, 110, 163, 168, 236],
    [80, 67, 74, 84, 92, 114, 140, 232],
    [106, 87, 82, 77, 82, 105, 123, 220],
    [143, 128, 168, 128, 21, 128, 128, 128],
    [135, 137, 133, 127, 163, 172, 206, 236],
    [131, 133, 124, 108, 104, 130, 155, 205],
    [138, 117, 109, 118, 110, 116, 158, 214],
    [153, 133, 120, 113, 125, 140, 143, 218],
    [94, 57, 128, 128, 128, 128, 128, 128],
    [132, 194, 206, 173, 191, 186, 184, 229],
    [168, 195, 186, 171, 186, 187, 174, 203],
    [205, 195, 163, 163, 155, 199, 195, 217],
    [203, 205, 204, 203, 211, 210, 198, 214],
];
