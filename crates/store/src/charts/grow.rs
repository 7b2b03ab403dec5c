//! Grows charts over a surface: connected triangles that one direction sees side by side, nowhere behind each other.

use glam::{DVec2, DVec3};

use super::flatten::{Flat, flatten};
use super::raster::touched;
use super::set::TEXEL_FRACTION;
use super::surface::{NONE, Surface};

/// How far, in texels, two places over one texel may be apart along the normal beyond what the cone allows.
const HEIGHT_TOLERANCE: f64 = 0.25;

/// How far apart, in texels, the planes of the triangles over one texel may pass its centre.
const MOST_RANGE: f64 = 2.0;

/// Triangles dropped from charts for each of the mesh; beyond, charts may keep what lies over each other.
const MOST_DROPPED: usize = 8;

/// Edge of the cells that growth tells layers apart by, texels.
const GROWTH_CELL: f64 = 2.0;

/// A mean normal closer to the seed's than this (1.8°) is not worth growing again for.
const SAME_AXIS: f64 = 0.9995;

/// Limits of growth.
#[derive(Clone, Copy, Debug)]
pub(super) struct GrowParams {
    /// Edge of a texel.
    pub(super) texel: f64,
    /// Least cosine between a triangle's normal and the chart's.
    pub(super) least_cosine: f64,
    /// Longest side, texels.
    pub(super) max_side: u16,
}

/// Three axes at right angles; the third is the chart's normal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Frame {
    pub(super) origin: DVec3,
    pub(super) axes: [DVec3; 3],
}

impl Frame {
    /// Some frame with the given normal (unit length).
    pub(super) fn with_normal(origin: DVec3, normal: DVec3) -> Frame {
        let size = normal.abs();
        let away = if size.x <= size.y && size.x <= size.z {
            DVec3::X
        } else if size.y <= size.z {
            DVec3::Y
        } else {
            DVec3::Z
        };
        let tangent = normal.cross(away);
        let tangent = tangent / tangent.length();
        Frame { origin, axes: [tangent, normal.cross(tangent), normal] }
    }

    /// Coordinates in the frame.
    pub(super) fn project(&self, place: DVec3) -> DVec3 {
        let d = place - self.origin;
        DVec3::new(d.dot(self.axes[0]), d.dot(self.axes[1]), d.dot(self.axes[2]))
    }
}

/// A chart before it is laid out.
#[derive(Clone, Debug)]
pub(super) struct Grown {
    /// Seed first.
    pub(super) triangles: Vec<u32>,
    pub(super) frame: Frame,
    /// Edge of its texels: coarser than asked for where one triangle alone would exceed the longest side.
    pub(super) texel: f64,
}

/// Cuts a whole surface into charts, in order of their seeds: largest triangle first. Triangles without area and
/// repeated ones are left out.
#[derive(Debug)]
pub(super) struct Growth {
    grower: Grower,
    seeds: Vec<u32>,
    next_seed: usize,
    charts: Vec<(Grown, Flat)>,
}

impl Growth {
    /// `surface` is to be the same in all calls.
    pub(super) fn new(surface: &Surface, params: GrowParams) -> Growth {
        let mut seeds: Vec<u32> = (0..surface.corners.len() as u32)
            .filter(|&t| !surface.is_degenerate(t as usize) && surface.repeats[t as usize] == NONE)
            .collect();
        // Areas are positive, so their bits are in order.
        seeds.sort_unstable_by_key(|&t| (std::cmp::Reverse(surface.double_areas[t as usize].to_bits()), t));
        let grower = Grower {
            params,
            steepness: (1.0 - params.least_cosine * params.least_cosine).max(0.0).sqrt()
                / params.least_cosine,
            taken: vec![false; surface.corners.len()],
            seen: vec![0; surface.corners.len()],
            stamp: 0,
            cells: Cells::new(),
            dropped: 0,
            most_dropped: MOST_DROPPED * surface.corners.len(),
            visits: 0,
        };
        Growth { grower, seeds, next_seed: 0, charts: Vec::new() }
    }

    /// Goes on until about `budget` triangles and texels were looked at (one chart at least); gives how many were. Charts are
    /// the same however the work is cut.
    pub(super) fn work(&mut self, surface: &Surface, budget: usize) -> usize {
        let before = self.grower.visits;
        while let Some(&seed) = self.seeds.get(self.next_seed) {
            if self.grower.visits - before >= budget {
                break;
            }
            self.next_seed += 1;
            self.grower.visits += 1;
            if !self.grower.taken[seed as usize] {
                let chart = self.grower.grow_best(surface, seed);
                let chart = self.grower.settle(surface, chart);
                for &t in &chart.0.triangles {
                    self.grower.taken[t as usize] = true;
                }
                self.charts.push(chart);
            }
        }
        self.grower.visits - before
    }

    pub(super) fn is_complete(&self) -> bool {
        self.next_seed == self.seeds.len()
    }

    /// Seeds that are left, and of how many.
    pub(super) fn seeds(&self) -> (usize, usize) {
        (self.seeds.len() - self.next_seed, self.seeds.len())
    }

    /// The charts so far; all of them once growth is complete.
    pub(super) fn take_charts(&mut self) -> Vec<(Grown, Flat)> {
        std::mem::take(&mut self.charts)
    }
}

#[derive(Debug)]
struct Grower {
    params: GrowParams,
    /// Tangent of the cone's half angle: how steep a chart may be.
    steepness: f64,
    taken: Vec<bool>,
    /// Growth that last looked at a triangle.
    seen: Vec<u32>,
    stamp: u32,
    cells: Cells,
    /// Triangles dropped from charts so far, and when to stop, which bounds the time taken.
    dropped: usize,
    most_dropped: usize,
    /// Triangles and texels looked at so far.
    visits: usize,
}

impl Grower {
    /// Grows about the seed's normal to learn the mean normal, then about that. Keeps the first if the second came out at
    /// less than half its size, which also bounds the time spent on what is not kept.
    fn grow_best(&mut self, surface: &Surface, seed: u32) -> Grown {
        let seed_normal = surface.normals[seed as usize];
        let first = self.grow(surface, seed, seed_normal);
        let sum: DVec3 = first.triangles.iter().fold(DVec3::ZERO, |sum, &t| {
            sum + surface.normals[t as usize] * surface.double_areas[t as usize]
        });
        let mean = sum / sum.length();
        if !mean.is_finite() || mean.dot(seed_normal) > SAME_AXIS {
            return first;
        }
        let second = self.grow(surface, seed, mean);
        if second.triangles.len() * 2 < first.triangles.len() { first } else { second }
    }

    fn grow(&mut self, surface: &Surface, seed: u32, normal: DVec3) -> Grown {
        let frame = Frame::with_normal(surface.corner_places(seed as usize)[0], normal);
        let corners = surface.corner_places(seed as usize).map(|p| frame.project(p));
        let [mut low, mut high] = bounds(corners);
        let steps = f64::from(self.params.max_side - 1);
        let texel = self.params.texel.max((high - low).max_element() / steps);
        let longest = texel * steps;
        self.stamp += 1;
        self.cells.clear();
        let mut triangles = vec![seed];
        self.seen[seed as usize] = self.stamp;
        self.claim_cells(surface, seed, corners, &frame, texel);
        let mut next = 0;
        while next < triangles.len() {
            for neighbour in surface.neighbours[triangles[next] as usize] {
                let n = neighbour as usize;
                if neighbour == NONE || self.taken[n] || self.seen[n] == self.stamp {
                    continue;
                }
                self.seen[n] = self.stamp;
                if surface.normals[n].dot(normal) < self.params.least_cosine {
                    continue;
                }
                let corners = surface.corner_places(n).map(|p| frame.project(p));
                let [own_low, own_high] = bounds(corners);
                let (new_low, new_high) = (low.min(own_low), high.max(own_high));
                if (new_high - new_low).max_element() > longest
                    || !self.claim_cells(surface, neighbour, corners, &frame, texel)
                {
                    continue;
                }
                (low, high) = (new_low, new_high);
                triangles.push(neighbour);
            }
            next += 1;
        }
        Grown { triangles, frame, texel }
    }

    /// Takes the cells under a triangle, of [`GROWTH_CELL`] texels a side, in the frame that a chart grows in. Tells
    /// layers apart at little cost; [`Grower::settle`] looks closer.
    fn claim_cells(
        &mut self,
        surface: &Surface,
        triangle: u32,
        corners: [DVec3; 3],
        frame: &Frame,
        texel: f64,
    ) -> bool {
        let normal = surface.normals[triangle as usize];
        let normal = DVec3::from_array(frame.axes.map(|axis| axis.dot(normal)));
        let cell = GROWTH_CELL * texel;
        let claim = Claim { step: DVec2::splat(cell), reach: 0.5, range: f64::INFINITY, texel };
        self.claim(corners.map(|p| (p.truncate() / cell).extend(p.z)), normal, &claim)
    }

    /// Takes the texels of a triangle; false, and nothing is taken, if one of them is at another height already.
    ///
    /// `corners` are x and y in texels, and height. Two places of a surface inside the cone can differ in height by no
    /// more than its steepness times their distance; and one texel cannot stand for places that lie far apart, be they
    /// ever so close to each other seen from above.
    fn claim(&mut self, corners: [DVec3; 3], normal: DVec3, claim: &Claim) -> bool {
        let &Claim { step, reach, range: most_range, texel } = claim;
        // Height gained by one texel along x and y.
        let slope = -normal.truncate() * step / normal.z;
        let height_at = |p: DVec2| corners[0].z + slope.dot(p - corners[0].truncate());
        self.cells.begin();
        let (cells, visits) = (&mut self.cells, &mut self.visits);
        *visits += 1;
        let steepness_squared = self.steepness * self.steepness;
        let fits = touched(corners.map(|c| c.truncate()), reach, |x, y, closest| {
            *visits += 1;
            let height = height_at(closest);
            let over_centre = height_at(DVec2::new(f64::from(x), f64::from(y)));
            let Some(slot) = cells.find_or_insert((x, y), Cell { closest, height, range: [over_centre; 2] })
            else {
                return true;
            };
            let cell = cells.values[slot];
            let range = [cell.range[0].min(over_centre), cell.range[1].max(over_centre)];
            let apart = (height - cell.height).abs() - HEIGHT_TOLERANCE * texel;
            let distance_squared = ((closest - cell.closest) * step).length_squared();
            let is_near = apart <= 0.0 || apart * apart <= steepness_squared * distance_squared;
            let fits = is_near && range[1] - range[0] <= most_range;
            if fits && range != cell.range {
                cells.replace(slot, Cell { range, ..cell });
            }
            fits
        });
        if !fits {
            self.cells.roll_back();
        }
        fits
    }

    /// Lays a chart flat, and drops from it the triangles that the turned grid brings over others.
    fn settle(&mut self, surface: &Surface, mut chart: Grown) -> (Grown, Flat) {
        let flat = flatten(surface, &chart, self.params.max_side);
        self.cells.clear();
        let before = chart.triangles.len();
        let claim =
            Claim { step: flat.step, reach: 1.0, range: MOST_RANGE * chart.texel, texel: chart.texel };
        let mut triangles = std::mem::take(&mut chart.triangles);
        triangles.retain(|&t| {
            let normal = surface.normals[t as usize];
            let normal = DVec3::from_array(flat.frame.axes.map(|axis| axis.dot(normal)));
            let corners = surface.corner_places(t as usize).map(|place| {
                let [x, y] = flat.snapped_texel_of(place);
                let offset = DVec2::new(f64::from(x), f64::from(y)) / f64::from(TEXEL_FRACTION) - 0.5;
                offset.extend(flat.frame.project(place).z)
            });
            self.claim(corners, normal, &claim) || self.dropped >= self.most_dropped
        });
        self.dropped += before - triangles.len();
        chart.triangles = triangles;
        (chart, flat)
    }
}

fn bounds(corners: [DVec3; 3]) -> [DVec2; 2] {
    let [a, b, c] = corners.map(|c| c.truncate());
    [a.min(b).min(c), a.max(b).max(c)]
}

/// How texels are taken.
struct Claim {
    /// Edges of a texel along x and y.
    step: DVec2,
    /// How far beyond a triangle texels are taken, in texels.
    reach: f64,
    /// Most that heights over one centre may differ.
    range: f64,
    /// Edge of a texel that tolerances are measured in.
    texel: f64,
}

/// What lies over a texel.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// Place of the first triangle closest to the texel's centre, in texels.
    closest: DVec2,
    /// Its height.
    height: f64,
    /// Least and greatest height over the centre of all triangles' planes.
    range: [f64; 2],
}

/// Cells by texel: open addressing, emptied in no time by a new generation.
#[derive(Debug)]
struct Cells {
    /// Generation and texel of each slot; a slot of another generation is free.
    keys: Vec<(u32, (i32, i32))>,
    values: Vec<Cell>,
    generation: u32,
    /// Slots in use, in order of insertion.
    used: Vec<u32>,
    /// Where the current triangle's begin in `used`.
    begun: usize,
    /// What the current triangle replaced.
    replaced: Vec<(u32, Cell)>,
}

impl Cells {
    fn new() -> Cells {
        Cells {
            keys: vec![(0, (0, 0)); 64],
            values: vec![Cell::default(); 64],
            generation: 1,
            used: vec![],
            begun: 0,
            replaced: vec![],
        }
    }

    fn clear(&mut self) {
        self.generation += 1;
        self.used.clear();
        self.begun = 0;
    }

    /// From here on insertions can be rolled back.
    fn begin(&mut self) {
        self.begun = self.used.len();
        self.replaced.clear();
    }

    /// Undoes what was done since [`Cells::begin`]. The last in go first, so no chain of slots is broken.
    fn roll_back(&mut self) {
        for (slot, cell) in self.replaced.drain(..).rev() {
            self.values[slot as usize] = cell;
        }
        for slot in self.used.drain(self.begun..).rev() {
            self.keys[slot as usize].0 = 0;
        }
    }

    /// The slot of a texel that is there; otherwise inserts it.
    fn find_or_insert(&mut self, texel: (i32, i32), cell: Cell) -> Option<usize> {
        if self.used.len() * 2 >= self.keys.len() {
            self.double();
        }
        let slot = self.slot_of(texel);
        if self.keys[slot].0 == self.generation {
            return Some(slot);
        }
        self.keys[slot] = (self.generation, texel);
        self.values[slot] = cell;
        self.used.push(slot as u32);
        None
    }

    /// Replaces the cell of a slot in use.
    fn replace(&mut self, slot: usize, cell: Cell) {
        self.replaced.push((slot as u32, std::mem::replace(&mut self.values[slot], cell)));
    }

    fn slot_of(&self, texel: (i32, i32)) -> usize {
        let mixed =
            (u64::from(texel.0 as u32) << 32 | u64::from(texel.1 as u32)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mask = self.keys.len() - 1;
        let mut slot = (mixed >> 32) as usize & mask;
        while self.keys[slot].0 == self.generation && self.keys[slot].1 != texel {
            slot = (slot + 1) & mask;
        }
        slot
    }

    fn double(&mut self) {
        let entries: Vec<((i32, i32), Cell)> =
            self.used.iter().map(|&slot| (self.keys[slot as usize].1, self.values[slot as usize])).collect();
        let size = self.keys.len() * 2;
        self.keys = vec![(0, (0, 0)); size];
        self.values = vec![Cell::default(); size];
        self.used.clear();
        for (texel, cell) in entries {
            let slot = self.slot_of(texel);
            self.keys[slot] = (self.generation, texel);
            self.values[slot] = cell;
            self.used.push(slot as u32);
        }
    }
}
