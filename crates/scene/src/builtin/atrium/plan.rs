//! Measures of the atrium: where everything stands, whatever the detail. Metres; the hall's centre is the origin, +X is east, +Z south.

use glam::{Vec2, Vec3};

use crate::builtin::physics::Solid;

/// Half extents of the room (x, z).
pub(super) const ROOM: Vec2 = Vec2::new(9.72, 5.85);
/// Distance between neighbouring columns.
pub(super) const BAY: f32 = 2.34;
/// Half extents of the rectangle on whose outline columns stand: six bays by three.
pub(super) const COLUMNS: Vec2 = Vec2::new(7.02, 3.51);
/// Half extents of the opening in the gallery's floor.
pub(super) const WELL: Vec2 = Vec2::new(6.67, 3.16);
/// Half extents of the opening in the roof.
pub(super) const SKYLIGHT: Vec2 = Vec2::new(5.94, 2.43);
/// Where the arches of the lower arcade begin.
pub(super) const SPRING: f32 = 2.4;
/// Radius of the arches.
pub(super) const ARCH_RADIUS: f32 = 0.92;
/// Thickness of the arcade's wall.
pub(super) const ARCADE_THICKNESS: f32 = 0.42;
/// Underside of the gallery's floor.
pub(super) const SLAB_BOTTOM: f32 = 3.64;
/// The gallery's floor.
pub(super) const GALLERY: f32 = 3.88;
/// Underside of the beam on the upper columns.
pub(super) const BEAM_BOTTOM: f32 = 6.6;
/// The ceiling.
pub(super) const CEILING: f32 = 7.3;
/// Top of the curb around the roof's opening.
pub(super) const CURB_TOP: f32 = 7.85;
/// Steps of a flight; the gallery's floor is one riser above the last.
pub(super) const STEPS: u32 = 24;
/// Height of a step.
pub(super) const RISER: f32 = GALLERY / (STEPS + 1) as f32;
/// Depth of a step.
pub(super) const TREAD: f32 = 0.25;
/// Width of a flight.
pub(super) const STAIR_WIDTH: f32 = 1.7;
/// The east flight's axis (z); the west flight is the east one turned by 180° about the vertical.
pub(super) const STAIR_Z: f32 = 2.34;
/// Where the east flight starts (x).
pub(super) const STAIR_FOOT_X: f32 = WELL.x - TREAD * STEPS as f32;
/// Height of railings.
pub(super) const RAIL_HEIGHT: f32 = 1.02;
/// Radius and height of the fountain's basin in the middle of the hall.
pub(super) const FOUNTAIN: [f32; 2] = [0.92, 0.46];

/// Positions (x, z) of the columns of one storey, clockwise from the north-west.
pub(super) fn column_places() -> Vec<Vec2> {
    let mut places = Vec::new();
    for i in 0..=6 {
        for z in [-COLUMNS.y, COLUMNS.y] {
            places.push(Vec2::new(-COLUMNS.x + BAY * i as f32, z));
        }
    }
    for i in 1..3 {
        for x in [-COLUMNS.x, COLUMNS.x] {
            places.push(Vec2::new(x, -COLUMNS.y + BAY * i as f32));
        }
    }
    places
}

/// A bay between two columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bay {
    /// Middle between the columns.
    pub(super) center: Vec2,
    /// Turn about the vertical that brings +Z to the direction away from the hall, radians.
    pub(super) turn: f32,
    /// Unit direction away from the hall.
    pub(super) outward: Vec2,
    /// Whether a flight of stairs arrives here.
    pub(super) stairs: bool,
}

/// All bays of one storey: south, north, east, west.
pub(super) fn bays() -> Vec<Bay> {
    use std::f32::consts::{FRAC_PI_2, PI};
    let mut bays = Vec::new();
    for (side, turn) in [(1.0, 0.0), (-1.0, PI)] {
        for i in 0..6 {
            let center = Vec2::new(-COLUMNS.x + BAY * (i as f32 + 0.5), side * COLUMNS.y);
            bays.push(Bay { center, turn, outward: Vec2::new(0.0, side), stairs: false });
        }
    }
    for (side, turn) in [(1.0, FRAC_PI_2), (-1.0, -FRAC_PI_2)] {
        for i in 0..3 {
            let center = Vec2::new(side * COLUMNS.x, -COLUMNS.y + BAY * (i as f32 + 0.5));
            let stairs = (center.y - side * STAIR_Z).abs() < 0.1;
            bays.push(Bay { center, turn, outward: Vec2::new(side, 0.0), stairs });
        }
    }
    bays
}

/// A piece of furniture or decoration: where it stands, how it is turned (radians) and scaled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) at: Vec3,
    pub(super) turn: f32,
    pub(super) scale: f32,
}

const fn place(x: f32, y: f32, z: f32, turn: f32, scale: f32) -> Place {
    Place { at: Vec3::new(x, y, z), turn, scale }
}

/// Slender vases (mesh height 0.9, radius 0.27).
pub(super) const VASES: &[Place] = &[
    place(-9.18, 0.0, -5.31, 0.3, 1.15),
    place(9.18, 0.0, 5.31, 1.2, 1.2),
    place(-4.68, 0.0, 5.4, 0.0, 1.0),
    place(0.0, 0.0, -5.4, 2.0, 1.1),
    place(6.3, 0.0, -2.7, 2.5, 0.85),
    place(-6.3, 0.0, 2.7, 0.8, 0.9),
    place(9.225, GALLERY, -3.51, 0.4, 1.0),
    place(-9.225, GALLERY, 1.17, 1.4, 1.05),
    place(2.34, GALLERY, -5.445, 0.0, 0.9),
    place(-2.34, GALLERY, 5.445, 0.6, 1.0),
];

/// Wide pots (mesh height 0.55, radius 0.42).
pub(super) const POTS: &[Place] = &[
    place(9.135, 0.0, -5.265, 0.3, 1.1),
    place(-9.18, 0.0, 5.265, 0.9, 1.0),
    place(4.68, 0.0, -5.4, 0.0, 0.9),
    place(6.165, 0.0, -1.98, 0.7, 0.75),
    place(9.135, GALLERY, 5.22, 0.2, 1.0),
    place(-9.135, GALLERY, -5.22, 1.9, 1.0),
];

/// Crates (mesh 0.8 m cubes about the middle of their underside), some stacked.
pub(super) const CRATES: &[Place] = &[
    place(8.91, 0.0, 2.61, 0.12, 1.0),
    place(8.955, 0.0, 1.755, -0.2, 0.9),
    place(8.928, 0.8, 2.295, 0.5, 0.75),
    place(-3.06, 0.0, -5.4, 0.06, 0.95),
    place(-2.25, 0.0, -5.445, -0.3, 0.8),
    place(-8.9, GALLERY, 4.0, 0.25, 0.8),
];

/// Tables (mesh 1.8 × 0.8 m, 0.76 high).
pub(super) const TABLES: &[Place] = &[
    place(5.67, 0.0, 5.175, 0.0, 1.0),
    place(-8.955, 0.0, -0.36, std::f32::consts::FRAC_PI_2, 1.0),
    place(-5.85, GALLERY, -5.31, 0.0, 1.0),
];

/// Benches (mesh 1.7 × 0.42 m, 0.45 high).
pub(super) const BENCHES: &[Place] = &[
    place(1.17, 0.0, 5.49, 0.0, 1.0),
    place(5.85, 0.0, 4.455, 0.0, 0.9),
    place(-5.76, 0.0, -5.49, 0.0, 1.0),
    place(-8.2, 0.0, -0.36, std::f32::consts::FRAC_PI_2, 0.9),
    place(3.51, GALLERY, 5.49, 0.0, 1.0),
    place(9.36, GALLERY, 0.0, std::f32::consts::FRAC_PI_2, 1.0),
];

/// Simplified solids of everything that stands still: what boulders collide with and cameras keep away from.
pub(super) fn solids() -> Vec<Solid> {
    let boxed = |x0: f32, y0: f32, z0: f32, x1: f32, y1: f32, z1: f32| Solid::Box {
        min: Vec3::new(x0.min(x1), y0, z0.min(z1)),
        max: Vec3::new(x0.max(x1), y1, z0.max(z1)),
    };
    let mut solids = vec![boxed(-12.0, -1.0, -8.0, 12.0, 0.0, 8.0)];
    for s in [-1.0, 1.0] {
        solids.push(boxed(s * ROOM.x, -1.0, -8.0, s * 12.0, 9.0, 8.0));
        solids.push(boxed(-12.0, -1.0, s * ROOM.y, 12.0, 9.0, s * 8.0));
        // The gallery's floor, the arcade above the arches' crowns, the beam on the upper columns.
        solids.push(boxed(-ROOM.x, SLAB_BOTTOM, s * WELL.y, ROOM.x, GALLERY, s * ROOM.y));
        solids.push(boxed(s * WELL.x, SLAB_BOTTOM, -WELL.y, s * ROOM.x, GALLERY, WELL.y));
        let half = 0.5 * ARCADE_THICKNESS;
        let crown = SPRING + ARCH_RADIUS;
        let (x, z) = (COLUMNS.x, COLUMNS.y);
        for [y0, y1] in [[crown, SLAB_BOTTOM], [BEAM_BOTTOM, CEILING]] {
            solids.push(boxed(-x, y0, s * (z - half), x, y1, s * (z + half)));
            solids.push(boxed(s * (x - half), y0, -z, s * (x + half), y1, z));
        }
    }
    for p in column_places() {
        let base = Vec3::new(p.x, 0.0, p.y);
        solids.push(Solid::Cylinder { base, radius: 0.27, height: SLAB_BOTTOM });
        solids.push(boxed(p.x - 0.31, 0.0, p.y - 0.31, p.x + 0.31, 0.2, p.y + 0.31));
        let base = Vec3::new(p.x, GALLERY, p.y);
        solids.push(Solid::Cylinder { base, radius: 0.2, height: BEAM_BOTTOM - GALLERY });
    }
    for bay in bays().iter().filter(|b| !b.stairs) {
        let along =
            Vec2::new(bay.outward.y.abs(), bay.outward.x.abs()) * (0.5 * BAY) + bay.outward.abs() * 0.04;
        let (lo, hi) = (bay.center - along, bay.center + along);
        solids.push(boxed(lo.x, GALLERY, lo.y, hi.x, GALLERY + RAIL_HEIGHT, hi.y));
    }
    for s in [-1.0, 1.0] {
        let (z0, z1) = (STAIR_Z - 0.5 * STAIR_WIDTH, STAIR_Z + 0.5 * STAIR_WIDTH);
        for i in 0..STEPS {
            let x = STAIR_FOOT_X + TREAD * i as f32;
            let y = RISER * (i + 1) as f32;
            let under = (y - RISER - 0.4).max(0.0);
            solids.push(boxed(s * x, under, s * z0, s * (x + TREAD), y, s * z1));
            if i > 0 {
                for z in [z0 + 0.05, z1 - 0.05] {
                    solids.push(boxed(s * x, y, s * (z - 0.03), s * (x + TREAD), y + 0.95, s * (z + 0.03)));
                }
            }
        }
    }
    solids.push(Solid::Cylinder { base: Vec3::ZERO, radius: FOUNTAIN[0], height: FOUNTAIN[1] });
    solids.push(Solid::Cylinder { base: Vec3::ZERO, radius: 0.45, height: 1.35 });
    for (places, radius, height) in [(VASES, 0.28, 0.9), (POTS, 0.43, 0.55)] {
        for p in places {
            solids.push(Solid::Cylinder { base: p.at, radius: radius * p.scale, height: height * p.scale });
        }
    }
    for (places, half, height) in [
        (CRATES, Vec2::new(0.44, 0.44), 0.8),
        (TABLES, Vec2::new(0.92, 0.42), 0.78),
        (BENCHES, Vec2::new(0.87, 0.22), 0.46),
    ] {
        for p in places {
            let turned = p.turn.abs() > 0.8;
            let h = if turned { Vec2::new(half.y, half.x) } else { half } * p.scale;
            let (a, b) = (p.at, p.scale * height);
            solids.push(boxed(a.x - h.x, a.y, a.z - h.y, a.x + h.x, a.y + b, a.z + h.y));
        }
    }
    for screen in SCREENS {
        let thin = Vec2::new(
            if screen.turn == 0.0 { 0.92 } else { 0.06 },
            if screen.turn == 0.0 { 0.06 } else { 0.92 },
        );
        let a = screen.at;
        solids.push(boxed(a.x - thin.x, a.y, a.z - thin.y, a.x + thin.x, a.y + 2.0, a.z + thin.y));
    }
    solids
}

/// Lattice screens (mesh 2.1 × 2.3 m, standing along X).
pub(super) const SCREENS: &[Place] = &[
    place(-5.85, 0.0, 3.51, 0.0, 0.85),
    place(5.85, 0.0, -3.51, 0.0, 0.85),
    place(7.515, GALLERY, 0.0, std::f32::consts::FRAC_PI_2, 0.85),
    place(-7.515, GALLERY, 0.0, std::f32::consts::FRAC_PI_2, 0.85),
];

/// Curtains: bay index (of [`bays`]), which side of the bay (−1 or 1, 0 in the middle), colour (0 red, 1 green, 2 blue), mesh 0 or 1.
pub(super) const CURTAINS: &[(usize, f32, usize, usize)] = &[
    (0, -1.0, 0, 0),
    (1, 1.0, 0, 1),
    (1, -1.0, 0, 0),
    (3, -1.0, 1, 1),
    (5, 1.0, 2, 0),
    (6, 1.0, 2, 1),
    (6, -1.0, 2, 0),
    (8, 1.0, 1, 0),
    (9, -1.0, 1, 1),
    (9, 1.0, 1, 0),
    (11, -1.0, 0, 1),
    (12, 1.0, 2, 0),
    (17, -1.0, 0, 1),
];

/// Lanterns: the hook's position; the light is 0.95 m below.
pub(super) const LANTERNS: &[Vec3] = &[
    Vec3::new(-8.37, SLAB_BOTTOM, 4.68),
    Vec3::new(-2.34, SLAB_BOTTOM, 4.68),
    Vec3::new(3.51, SLAB_BOTTOM, 4.68),
    Vec3::new(8.37, SLAB_BOTTOM, 0.0),
    Vec3::new(2.34, SLAB_BOTTOM, -4.68),
    Vec3::new(-4.68, SLAB_BOTTOM, -4.68),
    Vec3::new(8.37, CEILING, -4.68),
    Vec3::new(-8.37, CEILING, 4.68),
];
