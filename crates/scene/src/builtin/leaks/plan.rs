//! Measures of the gallery: where everything is, whatever the detail. Metres; the middle of the hall's floor is the origin.
//!
//! What touches is written with the same numbers, so that faces and edges meet to the last bit.

/// Length of the animation, seconds.
pub(super) const SECONDS: f32 = 15.0;
/// Frames of a camera path.
pub(super) const FRAMES: u32 = 900;
/// Half extents of the hall inside (x, z).
pub(super) const HALL: [f32; 2] = [9.0, 6.0];
/// The hall's ceiling.
pub(super) const CEILING: f32 = 5.0;
/// Thickness of its walls and floor.
pub(super) const WALL: f32 = 0.3;
/// Opening in the ceiling: smallest and largest x, smallest and largest z.
pub(super) const SKYLIGHT: [[f32; 2]; 2] = [[1.0, 7.5], [-4.5, 2.0]];
/// Basin in the floor: smallest and largest x, smallest and largest z.
pub(super) const BASIN: [[f32; 2]; 2] = [[2.5, 6.5], [-3.0, 0.0]];
/// Heights of the basin's bottom and of its water.
pub(super) const WATER: [f32; 2] = [-0.18, -0.06];

/// Half the thickness of a partition (2 cm).
pub(super) const HALF: f32 = 0.01;
/// Thickness of shelves.
pub(super) const BOARD: f32 = 0.016;
/// Thickness of sheets of steel.
pub(super) const SHEET: f32 = 0.005;

/// The mezzanine: its edges towards the hall (x, z), its underside and its top.
pub(super) const MEZZANINE: ([f32; 2], [f32; 2]) = ([-2.0, -1.0], [2.6, 2.76]);
/// The stair along the north wall: treads, going, rise, and the edge away from the wall (z).
pub(super) const STAIR: (u32, f32, f32, f32) = (15, 0.24, 0.1725, -5.05);
/// Middles of square pillars under the mezzanine (x, z), and half their width.
pub(super) const PILLARS: ([[f32; 2]; 3], f32) = ([[-2.15, -1.15], [-5.5, -1.15], [-2.15, -4.9]], 0.05);

/// The line of the bookcase's partition (z), where it starts at the closet, where it ends.
pub(super) const BOOKCASE: [f32; 3] = [-3.5, -7.4, -3.6];
/// Depth of its shelves, the height of the lowest, and the distance from one to the next.
pub(super) const SHELVES: [f32; 3] = [0.3, 0.12, 0.35];
/// The closet's doorway in the line x = −7.4: smallest and largest z, height.
pub(super) const DOORWAY: [f32; 3] = [-5.6, -4.7, 2.05];
/// Height of the closet's ceiling.
pub(super) const CLOSET: f32 = 2.2;

/// The free-standing slab of onyx: its line (z), ends (x) and height.
pub(super) const ONYX: [f32; 4] = [1.2, -6.6, -3.0, 2.4];
/// The cart's line behind the onyx (z), and where it turns back (x).
pub(super) const CART: [f32; 3] = [0.84, -7.3, -2.3];

/// The cabinet behind the louvre: its front (x), its ends (z) and its height.
pub(super) const CABINET: [f32; 4] = [7.6, 1.5, 4.5, 2.4];
/// The louvre's slats: how many, the height of the lowest axis, and from one to the next.
pub(super) const SLATS: (u32, f32, f32) = (14, 0.12, 0.16);

/// Where pendant lamps hang (x, y, z).
pub(super) const PENDANTS: [[f32; 3]; 6] = [
    [-6.0, 2.9, 3.0],
    [-4.4, 2.9, 3.0],
    [-0.2, 3.2, 3.4],
    [3.0, 3.2, 4.2],
    [6.2, 3.2, 3.6],
    [-0.4, 3.2, -2.6],
];
/// Where lamps lie flat under the mezzanine (x, z).
pub(super) const PANELS: [[f32; 2]; 4] = [[-7.4, -2.2], [-4.0, -2.2], [-5.9, -4.9], [-3.4, -4.9]];

/// Rocks in and around the basin: place (x, y, z) and radius.
pub(super) const ROCKS: [[f32; 4]; 7] = [
    [3.1, -0.05, -2.3, 0.42],
    [3.75, -0.12, -2.62, 0.24],
    [3.2, -0.1, -1.55, 0.2],
    [5.9, -0.02, -0.5, 0.33],
    [6.75, 0.08, -0.85, 0.28],
    [2.1, 0.05, -2.7, 0.22],
    [7.4, 0.2, -4.6, 0.55],
];
