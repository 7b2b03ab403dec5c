//! Measures of the laboratory: where everything stands and who walks where, whatever the detail.
//! Metres; the floor's middle is the origin, +X is east, +Z south.

use glam::{Vec2, Vec3};

use super::route::Route;

/// Length of the animation, seconds.
pub(super) const SECONDS: f32 = 15.0;
/// Frames of a camera path.
pub(super) const FRAMES: u32 = 900;
/// Half extents of the room (x, z).
pub(super) const ROOM: Vec2 = Vec2::new(14.0, 8.5);
/// The ceiling.
pub(super) const CEILING: f32 = 6.0;
/// The platform's corner towards the hall (x, z); it fills the room's south-east beyond it.
pub(super) const PLATFORM: Vec2 = Vec2::new(6.9, 1.5);
/// Top of the platform, and its thickness.
pub(super) const DECK: [f32; 2] = [2.72, 0.2];
/// Columns under the platform (x, z).
pub(super) const COLUMNS: [Vec2; 5] = [
    Vec2::new(7.05, 1.65),
    Vec2::new(10.4, 1.65),
    Vec2::new(13.7, 1.65),
    Vec2::new(7.05, 6.9),
    Vec2::new(7.05, 4.3),
];
/// Steps of the stairs; the platform is one riser above the last.
pub(super) const STEPS: u32 = 15;
/// Height and depth of a step.
pub(super) const STEP: [f32; 2] = [DECK[0] / (STEPS + 1) as f32, 0.28];
/// Width of the stairs, which run along the south wall up to the platform, and their axis (z).
pub(super) const STAIRS: [f32; 2] = [1.1, 7.85];
/// Height of railings.
pub(super) const RAIL: f32 = 1.05;

/// A closed way that some walk on: a rectangle with round corners, its long sides bent a little.
pub(super) struct Loop {
    center: Vec2,
    half: Vec2,
    /// How far the middles of the north and south side bend outward.
    bend: [f32; 2],
    /// Whether it is walked anticlockwise as seen from above.
    back: bool,
    pub(super) floor: f32,
    pub(super) walkers: u32,
}

#[allow(clippy::too_many_arguments)] // a row of a table
const fn walk(x: f32, z: f32, hx: f32, hz: f32, north: f32, south: f32, back: bool, walkers: u32) -> Loop {
    let (center, half) = (Vec2::new(x, z), Vec2::new(hx, hz));
    Loop { center, half, bend: [north, south], back, floor: 0.0, walkers }
}

/// All loops: 23 walkers.
pub(super) const LOOPS: &[Loop] = &[
    walk(-9.7, -5.2, 2.7, 1.7, 0.0, 0.1, false, 2),
    walk(-3.1, -5.2, 3.1, 1.75, 0.1, -0.1, true, 2),
    walk(4.0, -5.2, 2.9, 1.7, -0.1, 0.1, false, 2),
    walk(10.5, -5.2, 2.5, 1.7, 0.0, 0.0, true, 1),
    walk(-10.0, -0.4, 2.5, 1.65, 0.1, 0.0, true, 1),
    walk(-3.2, -0.4, 3.1, 1.7, 0.0, 0.1, false, 2),
    walk(3.7, -0.5, 2.9, 1.65, -0.1, 0.0, true, 2),
    walk(10.4, -0.6, 2.7, 1.55, 0.0, 0.0, false, 2),
    walk(-9.6, 4.4, 2.9, 1.7, 0.0, 0.1, false, 2),
    walk(-3.0, 4.4, 2.8, 1.75, -0.1, 0.0, true, 2),
    walk(3.4, 4.4, 2.5, 1.65, 0.0, 0.0, false, 1),
    walk(10.4, 4.5, 2.4, 1.7, 0.0, 0.0, true, 1),
    Loop { floor: DECK[0], ..walk(10.35, 4.6, 2.7, 2.2, 0.0, 0.0, false, 3) },
];

impl Loop {
    /// The way around.
    pub(super) fn route(&self) -> Route {
        let h = self.half;
        let round = h.min_element().min(1.5);
        let mut control = Vec::new();
        // From the north-west corner clockwise; a corner is three points.
        for (corner, along) in [
            (Vec2::new(-1.0, -1.0), Vec2::X),
            (Vec2::new(1.0, -1.0), Vec2::Y),
            (Vec2::new(1.0, 1.0), Vec2::NEG_X),
            (Vec2::new(-1.0, 1.0), Vec2::NEG_Y),
        ] {
            let across = along.perp();
            let tip = corner * h;
            control.push(tip + across * (0.75 * round));
            control.push(tip + (across + along) * (0.22 * round));
            control.push(tip + along * (0.75 * round));
            if along.x != 0.0 {
                let out = self.bend[usize::from(corner.y > 0.0)];
                control.push(Vec2::new(0.0, corner.y * (h.y + out)));
            }
        }
        if self.back {
            control.reverse();
        }
        let control: Vec<Vec2> = control.into_iter().map(|p| self.center + p).collect();
        Route::new(&control)
    }
}

/// What stands on a floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    /// A bench with racks of test tubes and flasks.
    GlassBench,
    /// A bench with screens.
    ScreenBench,
    /// A stool.
    Stool,
    /// A vessel with domed ends on legs.
    Reactor,
    /// A cabinet of instruments.
    Rack,
    /// A drum whose rotor turns.
    Centrifuge,
    /// Glass columns with coils.
    Coils,
    /// An arm on a pedestal.
    Robot,
    /// A shelf with bottles and boxes.
    Shelf,
    /// A motor with a pump.
    Pump,
    /// A cupboard with a window, along a wall.
    Hood,
    /// A desk with slanted panels.
    Console,
}

impl Kind {
    /// All kinds.
    pub(super) const ALL: [Kind; 12] = [
        Kind::GlassBench,
        Kind::ScreenBench,
        Kind::Stool,
        Kind::Reactor,
        Kind::Rack,
        Kind::Centrifuge,
        Kind::Coils,
        Kind::Robot,
        Kind::Shelf,
        Kind::Pump,
        Kind::Hood,
        Kind::Console,
    ];

    /// What its node and mesh are called.
    pub(super) fn name(self) -> &'static str {
        match self {
            Kind::GlassBench => "glass-bench",
            Kind::ScreenBench => "screen-bench",
            Kind::Stool => "stool",
            Kind::Reactor => "reactor",
            Kind::Rack => "rack",
            Kind::Centrifuge => "centrifuge",
            Kind::Coils => "coils",
            Kind::Robot => "robot",
            Kind::Shelf => "shelf",
            Kind::Pump => "pump",
            Kind::Hood => "hood",
            Kind::Console => "console",
        }
    }
}

/// A thing on a floor: turned by a number of quarter turns about the vertical, anticlockwise from above.
pub(super) struct Item {
    pub(super) kind: Kind,
    pub(super) at: Vec3,
    pub(super) quarters: u8,
}

const fn item(kind: Kind, x: f32, z: f32, quarters: u8) -> Item {
    Item { kind, at: Vec3::new(x, 0.0, z), quarters }
}

const fn above(kind: Kind, x: f32, z: f32, quarters: u8) -> Item {
    Item { kind, at: Vec3::new(x, DECK[0], z), quarters }
}

/// Everything that stands: fronts face +Z at no turn, +X at one.
pub(super) const ITEMS: &[Item] = &[
    // Inside the northern loops, from west to east.
    item(Kind::GlassBench, -10.65, -5.64, 2),
    item(Kind::GlassBench, -8.75, -5.64, 2),
    item(Kind::ScreenBench, -10.65, -4.76, 0),
    item(Kind::GlassBench, -8.75, -4.76, 0),
    item(Kind::Reactor, -4.6, -5.2, 0),
    item(Kind::Reactor, -3.1, -5.2, 1),
    item(Kind::Reactor, -1.6, -5.2, 0),
    item(Kind::Rack, 2.75, -5.2, 0),
    item(Kind::Rack, 3.40, -5.2, 0),
    item(Kind::Rack, 4.05, -5.2, 2),
    item(Kind::Rack, 4.70, -5.2, 0),
    item(Kind::Rack, 5.35, -5.2, 0),
    item(Kind::Robot, 10.5, -5.2, 0),
    // Inside the middle ones.
    item(Kind::Console, -10.8, -0.4, 1),
    item(Kind::Pump, -9.4, -0.4, 0),
    item(Kind::Centrifuge, -4.6, -0.4, 0),
    item(Kind::Centrifuge, -2.9, -0.4, 1),
    item(Kind::Console, -1.6, -0.4, 1),
    item(Kind::Coils, 2.7, -0.5, 0),
    item(Kind::Coils, 4.7, -0.5, 0),
    item(Kind::ScreenBench, 9.45, -1.02, 2),
    item(Kind::ScreenBench, 11.35, -1.02, 2),
    item(Kind::GlassBench, 9.45, -0.16, 0),
    item(Kind::ScreenBench, 11.35, -0.16, 0),
    // Inside the southern ones.
    item(Kind::Reactor, -10.8, 4.4, 1),
    item(Kind::Coils, -9.1, 4.4, 0),
    item(Kind::GlassBench, -3.95, 3.96, 2),
    item(Kind::ScreenBench, -2.05, 3.96, 2),
    item(Kind::ScreenBench, -3.95, 4.84, 0),
    item(Kind::GlassBench, -2.05, 4.84, 0),
    item(Kind::Robot, 3.4, 4.4, 1),
    item(Kind::Pump, 9.6, 4.1, 0),
    item(Kind::Pump, 11.3, 4.1, 2),
    item(Kind::Pump, 10.4, 4.9, 0),
    // Along the north wall.
    item(Kind::Shelf, -12.6, -8.24, 0),
    item(Kind::Shelf, -10.85, -8.24, 0),
    item(Kind::Hood, -6.5, -8.06, 0),
    item(Kind::Hood, -4.85, -8.06, 0),
    item(Kind::Shelf, 0.4, -8.24, 0),
    item(Kind::Shelf, 2.15, -8.24, 0),
    item(Kind::Hood, 4.6, -8.06, 0),
    item(Kind::Shelf, 8.0, -8.24, 0),
    // Along the west wall.
    item(Kind::Hood, -13.56, -4.3, 1),
    item(Kind::Shelf, -13.74, -0.4, 1),
    item(Kind::Rack, -13.56, 4.4, 1),
    item(Kind::Rack, -13.56, 5.05, 1),
    // Along the south wall.
    item(Kind::Shelf, -11.4, 8.24, 2),
    item(Kind::Shelf, -9.65, 8.24, 2),
    item(Kind::Hood, -6.6, 8.06, 2),
    item(Kind::Shelf, -4.1, 8.24, 2),
    item(Kind::Stool, -2.6, 8.1, 0),
    // On the platform.
    above(Kind::Reactor, 9.7, 4.6, 0),
    above(Kind::Reactor, 11.3, 4.6, 1),
    above(Kind::Console, 10.5, 8.06, 2),
    above(Kind::Shelf, 13.74, 4.6, 3),
];

/// Where the stairs start (x).
pub(super) fn stairs_foot() -> f32 {
    PLATFORM.x - STEP[1] * STEPS as f32
}
