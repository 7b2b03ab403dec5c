//! Measures of the street: where everything is, whatever the detail. Metres; the middle of the roadway is the origin, +X is east along
//! the street, +Z south across it.

use glam::Vec3;

use super::palette::Stuff::{self, *};

/// Length of the animation, seconds.
pub(super) const SECONDS: f32 = 15.0;
/// Frames of a camera path.
pub(super) const FRAMES: u32 = 900;

/// Half the street's length.
pub(super) const LENGTH: f32 = 21.0;
/// The line of the fronts and of the kerbs (z).
pub(super) const FRONTS: f32 = 5.8;
pub(super) const KERB: f32 = 3.5;
/// Height of the pavements above the roadway.
pub(super) const PAVEMENT: f32 = 0.14;
/// Width of a house's front, its ground floor's height, and the height of each storey above.
pub(super) const HOUSE: f32 = 8.4;
pub(super) const GROUND_FLOOR: f32 = 3.7;
pub(super) const STOREY: f32 = 3.1;

/// What a house's front is like.
#[derive(Clone, Copy, Debug)]
pub(super) struct Front {
    /// Windows side by side, and storeys above the ground floor.
    pub(super) bays: u32,
    pub(super) storeys: u32,
    pub(super) wall: Stuff,
    pub(super) base: Stuff,
    /// Colour of shutters; `None` has none.
    pub(super) shutters: Option<Stuff>,
    /// Storeys that have balconies, as bits from the first on.
    pub(super) balconies: u32,
    /// Colour of the woodwork of the shop.
    pub(super) shop: Stuff,
}

/// The fronts.
pub(super) const FRONT: [Front; 5] = [
    Front {
        bays: 4,
        storeys: 3,
        wall: Cream,
        base: Stone,
        shutters: Some(Green),
        balconies: 0b001,
        shop: Green,
    },
    Front { bays: 3, storeys: 3, wall: Brick, base: Stone, shutters: None, balconies: 0b011, shop: Black },
    Front {
        bays: 4,
        storeys: 2,
        wall: Rose,
        base: Cream,
        shutters: Some(White),
        balconies: 0b000,
        shop: Red,
    },
    Front {
        bays: 3,
        storeys: 3,
        wall: Stone,
        base: Brick,
        shutters: Some(Blue),
        balconies: 0b100,
        shop: Blue,
    },
    Front { bays: 4, storeys: 3, wall: Sand, base: Stone, shutters: None, balconies: 0b001, shop: Wood },
];
/// Which front stands where, from west to east: north side, south side.
pub(super) const ROWS: [[usize; 5]; 2] = [[0, 1, 2, 3, 4], [3, 4, 0, 2, 1]];
/// Houses with an awning, by side and place, and the cloth's colour: 0 red, 1 green.
pub(super) const AWNINGS: [(usize, usize, usize); 6] =
    [(0, 0, 0), (0, 2, 1), (0, 3, 0), (1, 1, 1), (1, 2, 0), (1, 4, 1)];

/// Tables (x, z) on the pavements, each with chairs around it.
pub(super) const TABLES: [[f32; 2]; 9] = [
    [-18.6, -4.5],
    [-16.4, -4.6],
    [-1.4, -4.5],
    [0.9, -4.6],
    [7.4, -4.5],
    [9.6, -4.6],
    [-9.4, 4.6],
    [-7.2, 4.5],
    [1.4, 4.6],
];
/// Lanterns on posts (x, z): off.
pub(super) const LANTERNS: [[f32; 2]; 8] = [
    [-17.5, 3.9],
    [-12.8, -3.9],
    [-5.4, 3.9],
    [-3.4, -3.9],
    [4.8, -3.9],
    [5.6, 3.9],
    [13.0, -3.9],
    [15.4, 3.9],
];
/// Bollards along the kerb (x, z).
pub(super) const BOLLARDS: [[f32; 2]; 14] = [
    [-19.6, 3.75],
    [-15.4, 3.75],
    [-14.0, 3.75],
    [-11.2, -3.75],
    [-9.6, -3.75],
    [-8.0, -3.75],
    [3.2, 3.75],
    [8.2, 3.75],
    [9.8, 3.75],
    [11.4, 3.75],
    [15.0, -3.75],
    [16.6, -3.75],
    [18.2, -3.75],
    [19.4, 3.75],
];
/// Tubs with shrubs (x, z) and their scale.
pub(super) const TUBS: [([f32; 2], f32); 10] = [
    ([-20.2, -5.1], 1.0),
    ([-14.4, -5.1], 0.9),
    ([-3.2, -5.2], 1.1),
    ([2.7, -5.2], 1.0),
    ([11.5, -5.1], 1.0),
    ([-11.4, 5.2], 1.0),
    ([-5.1, 5.2], 0.9),
    ([3.3, 5.2], 1.0),
    ([12.4, 5.2], 1.15),
    ([18.8, 5.1], 1.0),
];
/// Bicycles (x, z) and their turn.
pub(super) const BICYCLES: [([f32; 2], f32); 4] =
    [([-13.4, 4.9], 0.25), ([-9.7, -5.0], 3.0), ([12.4, -4.9], 0.2), ([10.1, 4.9], 2.9)];
/// Barrels (x, z) and crates (x, z, lift, turn, scale).
pub(super) const BARRELS: [[f32; 2]; 7] =
    [[-19.9, 5.0], [-19.2, 5.2], [14.6, -5.2], [15.3, -5.1], [15.0, -4.5], [6.9, 5.2], [-6.1, -5.2]];
pub(super) const CRATES: [([f32; 2], f32, f32, f32); 9] = [
    ([-12.6, 5.3], 0.0, 0.1, 1.0),
    ([-15.6, 5.2], 0.0, 0.5, 0.9),
    ([17.3, -5.1], 0.0, 0.2, 1.0),
    ([18.2, -5.2], 0.0, -0.1, 1.1),
    ([17.5, -5.1], 0.55, 0.6, 0.8),
    ([13.7, 5.0], 0.0, 0.3, 1.0),
    ([14.5, 5.1], 0.0, -0.2, 0.9),
    ([13.9, 5.05], 0.55, 0.8, 0.75),
    ([-6.9, -5.0], 0.0, 0.3, 0.8),
];
/// Strings of lamps across the street (x) and the height of their ends: off.
pub(super) const STRINGS: [f32; 5] = [-15.0, -7.6, -0.2, 7.0, 14.4];
pub(super) const STRING_HEIGHT: f32 = 7.4;

/// Wheels of fortune: where their axle is, their turn about the vertical, radius, spokes, rounds in one run.
pub(super) const WHEELS: [(Vec3, f32, f32, u32, f32); 3] = [
    (Vec3::new(-6.2, 1.62, -2.5), 0.12, 1.3, 16, 4.0),
    (Vec3::new(4.4, 1.72, 2.5), -0.1, 1.4, 12, -3.0),
    (Vec3::new(12.6, 1.5, -2.6), 0.5, 1.2, 10, 6.0),
];

/// The carriage: the line it drives on (z), and its ends (x).
pub(super) const DRIVE: [f32; 3] = [0.35, -13.4, -2.4];

/// Radii of the two spheres, half the side of the cube.
pub(super) const SPHERES: [f32; 2] = [0.25, 0.18];
pub(super) const CUBE: f32 = 0.24;
