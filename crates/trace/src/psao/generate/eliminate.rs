//! Weighted sample elimination [Yuksel2015]: thins a set of samples to half so that the rest are evenly spread.

use dapple_store::points::CellGrid;
use glam::Vec3;

/// A sample that may be eliminated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    /// The distance that it should keep, relative to that of the rest: 1 for all where density is uniform, else
    /// 1/√(relative density).
    pub(super) scale: f32,
}

/// [Yuksel2015] eq. 5: β and γ of weight limiting.
const BETA: f32 = 0.65;
const GAMMA: f32 = 1.5;

/// The greatest radius that `kept` samples can have on an area in two dimensions ([Yuksel2015] eq. 2).
pub(super) fn maximum_radius(area: f64, kept: f64) -> f64 {
    (area / (2.0 * 3.0_f64.sqrt() * kept)).sqrt()
}

/// Which candidates stay: ascending indices, exactly `keep` of them.
///
/// Candidates whose normals point into opposite half-spaces do not see each other, so the two sides of a thin
/// panel are thinned apart. `r_max` is in the unit of the positions.
pub(super) fn eliminate(candidates: &[Candidate], keep: usize, r_max: f32) -> Vec<u32> {
    let count = candidates.len();
    if keep >= count {
        return (0..count as u32).collect();
    }
    let reach = 2.0 * r_max;
    let widest = candidates.iter().map(|c| c.scale).fold(0.0, f32::max);
    let ratio = keep as f32 / count as f32;
    let r_min = r_max * (1.0 - libm::powf(ratio, GAMMA)) * BETA;

    let positions: Vec<Vec3> = candidates.iter().map(|c| c.position).collect();
    let grid = CellGrid::new(&positions, reach * widest);
    // Pairs are found again when one is eliminated instead of being kept: coincident surfaces have too many.
    let mut near = Near { grid: &grid, cell: None, indices: Vec::new() };
    let weights = candidates
        .iter()
        .enumerate()
        .map(|(i, _)| near.neighbors(candidates, i, reach, r_min).map(|(_, weight)| weight).sum())
        .collect();
    let mut heap = MaxHeap::new(weights);
    for _ in keep..count {
        let worst = heap.pop();
        for (j, weight) in near.neighbors(candidates, worst as usize, reach, r_min) {
            heap.lower(j, weight);
        }
    }
    let mut kept: Vec<u32> = heap.remaining().to_vec();
    kept.sort_unstable();
    kept
}

/// Finds the candidates around one; remembers the last cell.
struct Near<'a> {
    grid: &'a CellGrid,
    cell: Option<[i32; 3]>,
    indices: Vec<u32>,
}

impl Near<'_> {
    /// Neighbours of candidate `i` and the weight of each pair ([Yuksel2015] eq. 3, limited below by r_min).
    fn neighbors<'c>(
        &'c mut self,
        candidates: &'c [Candidate],
        i: usize,
        reach: f32,
        r_min: f32,
    ) -> impl Iterator<Item = (u32, f32)> + 'c {
        let a = candidates[i];
        let cell = self.grid.cell_of(a.position);
        if self.cell != Some(cell) {
            self.cell = Some(cell);
            self.indices.clear();
            self.grid.gather(cell, 1, &mut self.indices);
        }
        self.indices.iter().filter_map(move |&j| {
            let b = &candidates[j as usize];
            // Distances are measured in what both should keep; dividing by 1 changes no bit.
            let distance = a.position.distance(b.position) / (0.5 * (a.scale + b.scale));
            if j as usize == i || distance >= reach || a.normal.dot(b.normal) <= 0.0 {
                return None;
            }
            let base = (1.0 - distance.max(2.0 * r_min) / reach).max(0.0);
            // The eighth power by squaring: `powi` may round differently from machine to machine.
            let squared = base * base;
            let fourth = squared * squared;
            Some((j, fourth * fourth))
        })
    }
}

/// A binary heap of samples with the heaviest on top, whose weights can be lowered. Ties go to the lower index.
struct MaxHeap {
    weights: Vec<f32>,
    order: Vec<u32>,
    /// Position in `order`, or `GONE`.
    place: Vec<u32>,
}

const GONE: u32 = u32::MAX;

impl MaxHeap {
    fn new(weights: Vec<f32>) -> MaxHeap {
        let order: Vec<u32> = (0..weights.len() as u32).collect();
        let place = order.clone();
        let mut heap = MaxHeap { weights, order, place };
        for at in (0..heap.order.len() / 2).rev() {
            heap.sink(at);
        }
        heap
    }

    fn remaining(&self) -> &[u32] {
        &self.order
    }

    fn pop(&mut self) -> u32 {
        let top = self.order.swap_remove(0);
        self.place[top as usize] = GONE;
        if let Some(&first) = self.order.first() {
            self.place[first as usize] = 0;
            self.sink(0);
        }
        top
    }

    fn lower(&mut self, sample: u32, by: f32) {
        let at = self.place[sample as usize];
        if at != GONE {
            self.weights[sample as usize] -= by;
            self.sink(at as usize);
        }
    }

    fn above(&self, a: u32, b: u32) -> bool {
        let (wa, wb) = (self.weights[a as usize], self.weights[b as usize]);
        wa > wb || (wa == wb && a < b)
    }

    fn sink(&mut self, mut at: usize) {
        let sample = self.order[at];
        loop {
            let mut child = 2 * at + 1;
            if child >= self.order.len() {
                break;
            }
            if child + 1 < self.order.len() && self.above(self.order[child + 1], self.order[child]) {
                child += 1;
            }
            if self.above(sample, self.order[child]) {
                break;
            }
            self.order[at] = self.order[child];
            self.place[self.order[at] as usize] = at as u32;
            at = child;
        }
        self.order[at] = sample;
        self.place[sample as usize] = at as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash;

    fn unit_square(count: u32, seed: u64) -> Vec<Candidate> {
        let unit = |i: u32, d: u32| hash(seed, u64::from(i), d) as f32 / 4_294_967_296.0;
        (0..count)
            .map(|i| Candidate {
                position: Vec3::new(unit(i, 0), 0.0, unit(i, 1)),
                normal: Vec3::Y,
                scale: 1.0,
            })
            .collect()
    }

    fn smallest_distance(points: &[Candidate]) -> f32 {
        let mut least = f32::INFINITY;
        for (i, a) in points.iter().enumerate() {
            for b in &points[i + 1..] {
                least = least.min(a.position.distance(b.position));
            }
        }
        least
    }

    #[test]
    fn half_is_kept_and_evenly_spread() {
        let all = unit_square(2000, 7);
        let r_max = maximum_radius(1.0, 1000.0) as f32;
        let kept: Vec<Candidate> = eliminate(&all, 1000, r_max).iter().map(|&i| all[i as usize]).collect();
        assert_eq!(kept.len(), 1000);
        // From half of the samples the paper's sets reach 0.4–0.6 of the greatest possible distance; random ones 0.02.
        let spread = smallest_distance(&kept) / (2.0 * r_max);
        assert!(spread > 0.4, "nearest pair at {spread} of the greatest possible distance");
        assert!(smallest_distance(&all) / (2.0 * r_max) < 0.1);
    }

    #[test]
    fn opposite_sides_do_not_thin_each_other() {
        let mut both = unit_square(200, 3);
        both.extend(unit_square(200, 3).iter().map(|c| Candidate { normal: -c.normal, ..*c }));
        let r_max = maximum_radius(1.0, 100.0) as f32;
        let kept = eliminate(&both, 200, r_max);
        let front: Vec<u32> = kept.iter().copied().filter(|&i| i < 200).collect();
        let back: Vec<u32> = kept.iter().filter(|&&i| i >= 200).map(|i| i - 200).collect();
        assert_eq!(front, back);
    }

    #[test]
    fn keeps_everything_when_asked_for_more() {
        assert_eq!(eliminate(&unit_square(3, 1), 5, 0.1), [0, 1, 2]);
        assert!(eliminate(&[], 0, 0.1).is_empty());
    }
}
