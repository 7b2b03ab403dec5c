//! Measures of the hangar: where everything is, whatever the detail. Metres; the middle of the floor is the origin, the doors are east
//! (+X), +Z is south.

use glam::Vec3;

/// Length of the animation, seconds.
pub(super) const SECONDS: f32 = 15.0;
/// Frames of a camera path.
pub(super) const FRAMES: u32 = 900;
/// Half extents of the hall inside (x, z), and its height to the trusses' upper chord.
pub(super) const HALL: [f32; 2] = [20.0, 13.0];
pub(super) const CEILING: f32 = 9.6;
/// Underside of the trusses.
pub(super) const TRUSS: f32 = 8.5;
/// Distance from one truss to the next, and how many there are.
pub(super) const BAYS: (f32, u32) = (4.0, 9);
/// Height of the crane's rails, and their lines (z).
pub(super) const RAILS: [f32; 2] = [7.7, 12.2];

/// What stands along a wall in a bay of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Store {
    Containers,
    Crates,
    Rack,
    Bench,
    Engine,
    Barrels,
    Steps,
}

impl Store {
    /// All of them.
    pub(super) const ALL: [Store; 7] = [
        Store::Containers,
        Store::Crates,
        Store::Rack,
        Store::Bench,
        Store::Engine,
        Store::Barrels,
        Store::Steps,
    ];

    /// Name of its node and mesh.
    pub(super) fn name(self) -> &'static str {
        match self {
            Store::Containers => "containers",
            Store::Crates => "crates",
            Store::Rack => "rack",
            Store::Bench => "bench",
            Store::Engine => "engine",
            Store::Barrels => "barrels",
            Store::Steps => "steps",
        }
    }
}

/// Middles of the bays along X, and the stores' line (z, at the north wall and mirrored at the south).
pub(super) const BAY_X: [f32; 6] = [-15.5, -9.3, -3.1, 3.1, 9.3, 15.5];
pub(super) const BAY_Z: f32 = 9.9;
/// Half extents that a store keeps to.
#[cfg(test)]
pub(super) const BAY_HALF: [f32; 2] = [1.85, 1.35];
/// Stores of the north side and of the south side.
pub(super) const STORES: [[Store; 6]; 2] = [
    [Store::Rack, Store::Containers, Store::Crates, Store::Engine, Store::Containers, Store::Barrels],
    [Store::Crates, Store::Bench, Store::Barrels, Store::Steps, Store::Rack, Store::Containers],
];
/// Pallets and loose things in the aisles (x, z) with their turn.
pub(super) const PALLETS: [([f32; 2], f32); 6] = [
    ([-16.6, -3.2], 0.2),
    ([-16.9, 2.6], -0.3),
    ([-13.9, 0.4], 0.9),
    ([13.8, -4.0], 0.4),
    ([14.6, 3.6], -0.2),
    ([16.9, -0.4], 1.3),
];
/// The fan on its stand: middle (x, y, z), turn, radius of its blades.
pub(super) const FAN: (Vec3, f32, f32) = (Vec3::new(-12.4, 1.75, 4.3), 2.1, 1.15);

/// What a drone carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lamp {
    Sphere,
    Ring,
    Rectangle,
    Disc,
}

/// A drone: its way (an index into the ways of `motion`), where on it it starts (0 … 1), what it carries, and the light's colour.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drone {
    pub(super) way: usize,
    pub(super) start: f32,
    pub(super) lamp: Lamp,
    pub(super) color: usize,
}

/// Ways: six around the stores of each side, then two around the craft.
pub(super) const LOW: usize = 12;
pub(super) const HIGH: usize = 13;

const fn drone(way: usize, start: f32, lamp: Lamp, color: usize) -> Drone {
    Drone { way, start, lamp, color }
}

/// The drones.
pub(super) const DRONES: [Drone; 28] = [
    drone(0, 0.0, Lamp::Sphere, 0),
    drone(1, 0.3, Lamp::Ring, 1),
    drone(2, 0.6, Lamp::Sphere, 2),
    drone(3, 0.1, Lamp::Sphere, 3),
    drone(4, 0.8, Lamp::Ring, 4),
    drone(5, 0.5, Lamp::Sphere, 5),
    drone(6, 0.2, Lamp::Ring, 0),
    drone(7, 0.7, Lamp::Sphere, 4),
    drone(8, 0.4, Lamp::Ring, 3),
    drone(9, 0.9, Lamp::Sphere, 1),
    drone(10, 0.0, Lamp::Ring, 5),
    drone(11, 0.6, Lamp::Sphere, 2),
    drone(LOW, 0.0, Lamp::Rectangle, 0),
    drone(LOW, 0.125, Lamp::Sphere, 4),
    drone(LOW, 0.25, Lamp::Disc, 2),
    drone(LOW, 0.375, Lamp::Ring, 5),
    drone(LOW, 0.5, Lamp::Rectangle, 3),
    drone(LOW, 0.625, Lamp::Sphere, 1),
    drone(LOW, 0.75, Lamp::Disc, 0),
    drone(LOW, 0.875, Lamp::Ring, 2),
    drone(HIGH, 0.0, Lamp::Disc, 5),
    drone(HIGH, 0.125, Lamp::Sphere, 3),
    drone(HIGH, 0.25, Lamp::Rectangle, 4),
    drone(HIGH, 0.375, Lamp::Sphere, 0),
    drone(HIGH, 0.5, Lamp::Disc, 1),
    drone(HIGH, 0.625, Lamp::Ring, 3),
    drone(HIGH, 0.75, Lamp::Rectangle, 2),
    drone(HIGH, 0.875, Lamp::Sphere, 5),
];

/// Radius of a drone's sphere; radii of its ring and of the ring's tube; half extents of its rectangle; radius of its disc.
pub(super) const SPHERE: f32 = 0.12;
pub(super) const RING: [f32; 2] = [0.36, 0.022];
pub(super) const RECTANGLE: [f32; 2] = [0.26, 0.15];
pub(super) const DISC: f32 = 0.22;
/// How far below a drone's middle sphere, rectangle and disc are.
pub(super) const BELOW: f32 = 0.2;
/// Radius of the ball that holds a drone.
#[cfg(test)]
pub(super) const REACH: f32 = 0.5;
