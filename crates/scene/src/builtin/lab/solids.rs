//! Simplified solids of the laboratory: what walkers and cameras keep away from.

use glam::Vec3;

use super::plan::*;
use crate::builtin::physics::Solid;

impl Kind {
    /// Half extents on the floor (x, z) and height of the box that it and all that moves on it stay in.
    pub(super) fn extent(self) -> [f32; 3] {
        match self {
            Kind::GlassBench | Kind::ScreenBench => [0.92, 0.42, 1.55],
            Kind::Stool => [0.24, 0.24, 0.62],
            Kind::Reactor => [0.66, 0.66, 2.6],
            Kind::Rack => [0.32, 0.42, 2.05],
            Kind::Centrifuge => [0.78, 0.78, 1.55],
            Kind::Coils => [0.95, 0.34, 2.35],
            Kind::Robot => [0.75, 0.75, 2.3],
            Kind::Shelf => [0.85, 0.24, 2.25],
            Kind::Pump => [0.85, 0.36, 0.95],
            Kind::Hood => [0.8, 0.42, 2.4],
            Kind::Console => [0.8, 0.42, 1.35],
        }
    }
}

impl Item {
    /// The box that the thing stays in.
    pub(super) fn solid(&self) -> Solid {
        let [x, z, height] = self.kind.extent();
        let (x, z) = if self.quarters.is_multiple_of(2) { (x, z) } else { (z, x) };
        let half = Vec3::new(x, 0.0, z);
        Solid::Box { min: self.at - half, max: self.at + half + Vec3::Y * height }
    }
}

/// Simplified solids of everything that stands still between floor and ceiling.
pub(super) fn solids() -> Vec<Solid> {
    let boxed = |x0: f32, y0: f32, z0: f32, x1: f32, y1: f32, z1: f32| Solid::Box {
        min: Vec3::new(x0, y0, z0),
        max: Vec3::new(x1, y1, z1),
    };
    let mut solids: Vec<Solid> = ITEMS.iter().map(Item::solid).collect();
    for p in COLUMNS {
        let base = Vec3::new(p.x, 0.0, p.y);
        solids.push(boxed(base.x - 0.15, 0.0, base.z - 0.15, base.x + 0.15, DECK[0], base.z + 0.15));
    }
    let (p, deck) = (PLATFORM, DECK[0]);
    solids.push(boxed(p.x, deck - 0.42, p.y, ROOM.x, deck, ROOM.y));
    // Railings north and west of the platform, up to where the stairs arrive.
    solids.push(boxed(p.x, deck, p.y, ROOM.x, deck + RAIL + 0.05, p.y + 0.12));
    solids.push(boxed(p.x, deck, p.y, p.x + 0.12, deck + RAIL + 0.05, STAIRS[1] - 0.5 * STAIRS[0]));
    let foot = stairs_foot();
    solids.push(boxed(foot - 0.1, 0.0, STAIRS[1] - 0.5 * STAIRS[0] - 0.05, p.x, deck + RAIL + 0.1, ROOM.y));
    solids
}
