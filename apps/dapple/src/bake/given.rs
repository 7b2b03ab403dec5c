//! Which texture coordinates of a file can carry a bake: those in which no two triangles share a place.

use dapple_scene::glam::{DVec2, Vec2};

use super::layout::{PieceAt, pieces_by_material, uv_area, uv_corners};
use super::plan::{MeshPlan, triangles_of};
use super::surfaces::Surfaces;

/// Samples along each side of the unit square at which overlaps are looked for.
const SIDE: usize = 1024;

/// Part of the covered samples that may be covered twice, and of the surface that may have no place: slips of exporters.
const SLIP: f64 = 2e-3;

/// How far out of its unit square a triangle may reach by rounding.
const OUTSIDE: f32 = 1e-4;

/// The corners of a triangle brought to the unit square by whole numbers, as images repeat; `None` if it needs several
/// repetitions.
pub(crate) fn in_unit_square(corners: [Vec2; 3]) -> Option<[Vec2; 3]> {
    let low = corners[0].min(corners[1]).min(corners[2]);
    let corners = corners.map(|uv| uv - (low + OUTSIDE).floor());
    corners.iter().all(|uv| uv.is_finite() && uv.max_element() <= 1.0 + OUTSIDE).then_some(corners)
}

/// Pieces that lie apart from each other in one set of their own coordinates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Given {
    pub(crate) set: u8,
    pub(crate) pieces: Vec<PieceAt>,
}

/// Which pieces can use coordinates of the file, and which cannot.
#[derive(Clone, Debug, Default)]
pub(crate) struct Found {
    pub(crate) groups: Vec<Given>,
    pub(crate) others: Vec<PieceAt>,
}

/// Looks for coordinates that serve, material by material, as a material has one texture: the first of `sets` in which all that
/// wears it lies apart. Where everything that was found in one set lies apart, it becomes one group.
pub(crate) fn find_given(plans: &[MeshPlan], surfaces: &Surfaces<'_>, sets: &[u8]) -> Found {
    let mut found = Found::default();
    let mut by_set: Vec<Vec<Given>> = vec![Vec::new(); sets.len()];
    for pieces in pieces_by_material(plans, surfaces).into_values() {
        let serving = sets.iter().position(|&set| {
            let mut square = Square::new();
            pieces.iter().all(|at| square.add(plans, surfaces, set, at)) && square.is_clean()
        });
        match serving {
            Some(index) => by_set[index].push(Given { set: sets[index], pieces }),
            None => found.others.extend(pieces),
        }
    }
    for groups in by_set.into_iter().filter(|groups| !groups.is_empty()) {
        let mut square = Square::new();
        let all: Vec<PieceAt> = groups.iter().flat_map(|group| group.pieces.iter().copied()).collect();
        let set = groups[0].set;
        if groups.len() > 1 && all.iter().all(|at| square.add(plans, surfaces, set, at)) && square.is_clean()
        {
            found.groups.push(Given { set, pieces: all });
        } else {
            found.groups.extend(groups);
        }
    }
    found.others.sort_unstable();
    found
}

/// The unit square of texture coordinates, sampled.
struct Square {
    covered: Vec<bool>,
    once: usize,
    again: usize,
    /// Surface with and without a place, m².
    placed_m2: f64,
    lost_m2: f64,
}

impl Square {
    fn new() -> Square {
        Square { covered: vec![false; SIDE * SIDE], once: 0, again: 0, placed_m2: 0.0, lost_m2: 0.0 }
    }

    /// Adds a piece; false if its coordinates cannot serve whatever else there is.
    fn add(&mut self, plans: &[MeshPlan], surfaces: &Surfaces<'_>, set: u8, at: &PieceAt) -> bool {
        let plan = &plans[at.plan];
        let (pool, mesh) = (&plan.pools[at.pool], &surfaces.scene.meshes[plan.mesh]);
        // Copies of a mesh share its coordinates, but are to differ.
        if plan.copies.len() > 1
            || mesh.uvs[usize::from(set)].is_empty()
            || !pool.attributes.has(&format!("TEXCOORD_{set}"))
        {
            return false;
        }
        let instance = plan.copies[0].members[0] as usize;
        for t in triangles_of(mesh, pool.pieces[at.piece].part) {
            let corners = uv_corners(mesh, set, t);
            let Some(corners) = in_unit_square(corners) else { return false };
            let area_m2 = surfaces.area_m2(instance, t);
            if uv_area(mesh, set, t) > 1e-12 {
                self.placed_m2 += area_m2
            } else {
                self.lost_m2 += area_m2
            }
            self.cover(corners.map(|uv| DVec2::new(f64::from(uv.x), f64::from(uv.y)) * SIDE as f64));
        }
        true
    }

    /// Covers the samples strictly inside a triangle.
    fn cover(&mut self, [a, b, c]: [DVec2; 3]) {
        let sign = (b - a).perp_dot(c - a).signum();
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let range = |low: f64, high: f64| {
            let first = (low - 0.5).ceil().max(0.0) as usize;
            first..((high - 0.5).floor() + 1.0).clamp(0.0, SIDE as f64) as usize
        };
        for y in range(low.y, high.y) {
            for x in range(low.x, high.x) {
                let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                // A hundredth of a sample inside, so that neighbours do not both claim their border.
                let inside = |from: DVec2, to: DVec2| {
                    let edge = to - from;
                    sign * edge.perp_dot(p - from) > 1e-2 * edge.length()
                };
                if inside(a, b) && inside(b, c) && inside(c, a) {
                    let sample = &mut self.covered[y * SIDE + x];
                    if std::mem::replace(sample, true) { self.again += 1 } else { self.once += 1 }
                }
            }
        }
    }

    fn is_clean(&self) -> bool {
        self.again as f64 <= SLIP * self.once as f64
            && self.lost_m2 <= SLIP * (self.placed_m2 + self.lost_m2)
            && self.placed_m2 > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_are_brought_to_the_unit_square_by_whole_numbers() {
        let triangle = |x: f32, y: f32, size: f32| [[x, y], [x + size, y], [x, y + size]].map(Vec2::from);
        assert_eq!(in_unit_square(triangle(0.25, 0.5, 0.5)), Some(triangle(0.25, 0.5, 0.5)));
        assert_eq!(in_unit_square(triangle(3.25, -1.5, 0.5)), Some(triangle(0.25, 0.5, 0.5)));
        assert_eq!(in_unit_square(triangle(0.0, 1.0, 1.0)), Some(triangle(0.0, 0.0, 1.0)));
        // A hair below a whole number is that number.
        assert_eq!(in_unit_square(triangle(-0.00005, 0.0, 1.0)), Some(triangle(-0.00005, 0.0, 1.0)));
        assert_eq!(in_unit_square(triangle(0.75, 0.0, 0.5)), None);
        assert_eq!(in_unit_square(triangle(f32::NAN, 0.0, 0.5)), None);
    }
}
