//! Measures of the studio: the box after the data of the Cornell Program of Computer Graphics, ten times as large and squared
//! up, and the stages beside it. Metres; the studio's floor is y = 0.

use glam::Vec3;

/// Length of the animation, seconds.
pub(super) const SECONDS: f32 = 15.0;
/// Frames of a camera path.
pub(super) const FRAMES: u32 = 900;

/// The studio's floor and the walls on three of its sides: smallest and largest x, smallest and largest z, and their height.
pub(super) const STUDIO: ([f32; 2], [f32; 2], f32) = ([-9.0, 9.5], [-4.6, 7.4], 6.6);

/// Middle of the box's floor inside, on the studio's floor.
pub(super) const BOX: Vec3 = Vec3::new(-4.4, THICK, 0.0);
/// Half its width, its height and half its depth, inside.
pub(super) const INSIDE: [f32; 3] = [2.75, 5.5, 2.8];
/// Thickness of its walls.
pub(super) const THICK: f32 = 0.15;
/// Half extents of the light in its ceiling (x, z).
pub(super) const LIGHT: [f32; 2] = [0.65, 0.525];

/// A block on the box's floor: its middle there (x, z), its turn in radians, half its width, its height.
pub(super) struct Block {
    pub(super) at: [f32; 2],
    pub(super) turn: f32,
    pub(super) half: f32,
    pub(super) height: f32,
}

/// The short block, which stands still.
pub(super) const SHORT: Block = Block { at: [0.92, 1.1], turn: -0.29, half: 0.825, height: 1.65 };
/// The tall block, which turns about this place.
pub(super) const TALL: Block = Block { at: [-0.91, -0.72], turn: 0.3, half: 0.825, height: 3.3 };
/// The small cube that slides along X: where it turns back (x), its line (z) and half its width.
pub(super) const CUBE: ([f32; 2], f32, f32) = ([-2.3, -0.75], 1.8, 0.3);

/// A stage: its name and the place on it that has a closed form, normal up.
pub(super) struct Stage {
    pub(super) name: &'static str,
    pub(super) at: Vec3,
}

/// Radius of a stage's round top, and how high it lies above the studio's floor.
pub(super) const TOP: [f32; 2] = [1.3, 0.3];

/// Nothing stands on the first.
pub(super) const OPEN: Stage = Stage { name: "stage-open", at: Vec3::new(1.3, TOP[1], 2.3) };
/// The second has a disc above its place, parallel to it.
pub(super) const DISC: Stage = Stage { name: "stage-disc", at: Vec3::new(3.5, TOP[1], -0.7) };
/// Radius of that disc and its height.
pub(super) const DISC_SIZE: [f32; 2] = [0.4, 0.3];
/// The third has a wall along Z, whose foot towards +X is the place.
pub(super) const WALL: Stage = Stage { name: "stage-wall", at: Vec3::new(6.9, TOP[1], -1.3) };
/// Height, thickness and half the length of that wall.
pub(super) const WALL_SIZE: [f32; 3] = [0.4, 0.1, 1.0];
/// The fourth has a ball above its place.
pub(super) const BALL: Stage = Stage { name: "stage-ball", at: Vec3::new(5.1, TOP[1], 2.8) };
/// Radius of that ball and the height of its middle.
pub(super) const BALL_SIZE: [f32; 2] = [0.25, 0.32];

/// The lamps' truss along X: its ends, its height, its line (z).
pub(super) const TRUSS: ([f32; 2], f32, f32) = ([-0.6, 9.0], 5.2, 1.4);
