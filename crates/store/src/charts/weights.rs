//! Which points a texel's value is made of, and how much each counts: fixed, because neither ever moves.

use std::ops::Range;

use glam::Vec3;

use super::neighbours::{CellBox, PointCells};
use super::{Fit, MovingLeastSquares, Site, Weighed};
use crate::points::{PointLayout, PointSet};

/// Most points of a texel.
pub const MAX_WEIGHTS: usize = 8;

/// Sum of the weights of a texel that has points.
pub const WEIGHT_SUM: u16 = 256;

/// Most candidates of a texel: the heaviest points within the kernel's radius.
pub const MAX_CANDIDATES: usize = 16;

/// How far a point may serve where no other does, in units of the layout's spacing r0.
const FARTHEST: f32 = 8.0;

/// Most points that are looked at for one texel, so that many points in one place cost no more than that.
const MOST_NEAR: usize = 4096;

/// How a texel's points are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightParams {
    /// The kernel of the fit. The default is that of the direct fit, except that `plane` is 512: texels lie on the planes
    /// of triangles, where fragments of curved surfaces need not.
    pub kernel: MovingLeastSquares,
    /// Most points of a texel, 1 … [`MAX_WEIGHTS`].
    pub most: usize,
}

impl Default for WeightParams {
    fn default() -> Self {
        WeightParams { kernel: MovingLeastSquares { plane: 512.0, ..MovingLeastSquares::default() }, most: 6 }
    }
}

/// The points of a texel, ascending, and their weights, each at least 1, which sum to [`WEIGHT_SUM`]. Empty where no
/// point is near: such a texel is open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TexelWeights {
    len: u8,
    points: [u32; MAX_WEIGHTS],
    weights: [u16; MAX_WEIGHTS],
}

impl TexelWeights {
    /// Point (index within its set) and weight, ascending by point.
    pub fn iter(&self) -> impl Iterator<Item = (u32, u16)> + '_ {
        self.points.iter().copied().zip(self.weights.iter().copied()).take(usize::from(self.len))
    }

    /// How many points.
    pub fn len(&self) -> usize {
        usize::from(self.len)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    fn single(point: u32) -> TexelWeights {
        let mut weights = TexelWeights { len: 1, ..TexelWeights::default() };
        (weights.points[0], weights.weights[0]) = (point, WEIGHT_SUM);
        weights
    }
}

/// A point that can count at a texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Index within its set.
    pub point: u32,
    /// In rest space, metres.
    pub position_rest: Vec3,
    /// Unit normal in rest space.
    pub normal_rest: Vec3,
    weighed: Weighed,
}

impl Candidate {
    /// How much it counts before the fit, 0 … 1.
    pub fn weight(&self) -> f32 {
        self.weighed.weight
    }
}

/// The points of one set, ready to be found.
#[derive(Clone, Debug)]
pub struct PointNeighbours {
    quantum_m: f32,
    spacing_m: f32,
    near: PointCells,
    far: PointCells,
    params: WeightParams,
}

impl PointNeighbours {
    /// Sorts nothing: points are in Morton order already. About 5 bytes a point.
    pub fn new(layout: &PointLayout, set: &PointSet, params: &WeightParams) -> PointNeighbours {
        let (quantum_m, spacing_m) = (layout.quantum_m(), layout.spacing_m());
        PointNeighbours {
            quantum_m,
            spacing_m,
            near: PointCells::new(set, quantum_m, params.kernel.radius * spacing_m),
            far: PointCells::new(set, quantum_m, FARTHEST * spacing_m),
            params: *params,
        }
    }

    /// Bytes on the heap.
    pub fn memory_bytes(&self) -> usize {
        self.near.bytes() + self.far.bytes()
    }

    /// A worker over the points of `set`, which must be the set that this was made from. One for each thread.
    pub fn weigher<'a>(&'a self, set: &'a PointSet) -> Weigher<'a> {
        Weigher {
            neighbours: self,
            set,
            cells: None,
            runs: Vec::new(),
            points: Vec::new(),
            candidates: Vec::new(),
        }
    }
}

/// Finds the weights of one texel after the other.
#[derive(Debug)]
pub struct Weigher<'a> {
    neighbours: &'a PointNeighbours,
    set: &'a PointSet,
    /// What `points` holds: neighbouring texels mostly ask for the same cells.
    cells: Option<CellBox>,
    runs: Vec<Range<u32>>,
    points: Vec<(u32, Vec3, Vec3)>,
    candidates: Vec<Candidate>,
}

impl Weigher<'_> {
    /// The points that can count at `site`, ascending: those that the kernel gives a weight, the heaviest
    /// [`MAX_CANDIDATES`] of them. Both ends of a stream list the same.
    pub fn candidates(&mut self, site: &Site) -> &[Candidate] {
        let kernel = self.neighbours.params.kernel;
        let radius_m = kernel.radius * self.neighbours.spacing_m;
        self.gather(site.position_rest, radius_m);
        let (tangent, bitangent) = site.normal_rest.any_orthonormal_pair();
        self.candidates.clear();
        for &(point, position_rest, normal_rest) in &self.points {
            let d = (position_rest - site.position_rest) / radius_m;
            let weight = kernel.weight(d, site.normal_rest, normal_rest);
            if weight > 0.0 {
                let weighed = Weighed { weight, tangent: [d.dot(tangent), d.dot(bitangent)] };
                self.candidates.push(Candidate { point, position_rest, normal_rest, weighed });
            }
        }
        keep_heaviest(&mut self.candidates, MAX_CANDIDATES);
        &self.candidates
    }

    /// The weights at `site`. Bit i of `cut` rules out candidate i, because something stands in between.
    ///
    /// The fit is that of the candidates that are left, the heaviest [`WeightParams::most`] of them; while it gives a point a
    /// negative coefficient, it is repeated without that point. Where there is nothing to fit the nearest
    /// point on the site's side within 8 spacings counts alone, or if there is none the nearest of all.
    pub fn weigh(&mut self, site: &Site, cut: u16) -> TexelWeights {
        self.candidates(site);
        let mut kept = std::mem::take(&mut self.candidates);
        let mut index = 0;
        kept.retain(|_| {
            index += 1;
            cut >> (index - 1) & 1 == 0
        });
        keep_heaviest(&mut kept, self.neighbours.params.most.clamp(1, MAX_WEIGHTS));
        let weights = fit_weights(&mut kept);
        self.candidates = kept;
        weights.or_else(|| self.nearest(site, cut)).unwrap_or_default()
    }

    fn nearest(&mut self, site: &Site, cut: u16) -> Option<TexelWeights> {
        let ruled_out: Vec<u32> = match cut {
            0 => Vec::new(),
            _ => {
                let candidates = self.candidates(site).iter().enumerate();
                candidates.filter(|(i, _)| cut >> i & 1 == 1).map(|(_, c)| c.point).collect()
            }
        };
        let radius_m = FARTHEST * self.neighbours.spacing_m;
        let far = &self.neighbours.far;
        far.gather(&far.cells_around(site.position_rest, radius_m), &mut self.runs);
        let quantum_m = self.neighbours.quantum_m;
        let points = self.runs.iter().cloned().flatten().take(4 * MOST_NEAR);
        points
            .filter_map(|point| {
                let distance = self.set.position_rest(point as usize, quantum_m).distance(site.position_rest);
                if distance.is_nan() || distance > radius_m {
                    return None;
                }
                let opposed = self.set.normal_rest(point as usize).dot(site.normal_rest) <= 0.0;
                Some((ruled_out.contains(&point), opposed, distance, point))
            })
            .min_by(|a, b| a.0.cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.total_cmp(&b.2)).then(a.3.cmp(&b.3)))
            .map(|(.., point)| TexelWeights::single(point))
    }

    /// Decodes the points around a place into `points`, ascending.
    fn gather(&mut self, position_rest: Vec3, radius_m: f32) {
        let near = &self.neighbours.near;
        let cells = near.cells_around(position_rest, radius_m);
        if self.cells == Some(cells) {
            return;
        }
        self.cells = Some(cells);
        near.gather(&cells, &mut self.runs);
        self.points.clear();
        let quantum_m = self.neighbours.quantum_m;
        for point in self.runs.iter().cloned().flatten().take(MOST_NEAR) {
            let i = point as usize;
            self.points.push((point, self.set.position_rest(i, quantum_m), self.set.normal_rest(i)));
        }
    }
}

/// The `most` heaviest candidates, in the order they have.
fn keep_heaviest(candidates: &mut Vec<Candidate>, most: usize) {
    if candidates.len() <= most {
        return;
    }
    candidates.sort_by(|a, b| b.weighed.weight.total_cmp(&a.weighed.weight).then(a.point.cmp(&b.point)));
    candidates.truncate(most);
    candidates.sort_by_key(|c| c.point);
}

/// Whole weights that sum to [`WEIGHT_SUM`]; `None` if the candidates weigh next to nothing.
fn fit_weights(candidates: &mut Vec<Candidate>) -> Option<TexelWeights> {
    let mut coefficients = [0.0f32; MAX_WEIGHTS];
    loop {
        let fit = Fit::new(candidates.iter().map(|c| c.weighed))?;
        for (coefficient, candidate) in coefficients.iter_mut().zip(candidates.iter()) {
            *coefficient = fit.coefficient(candidate.weighed);
        }
        let least = (0..candidates.len()).min_by(|&a, &b| coefficients[a].total_cmp(&coefficients[b]))?;
        if coefficients[least] >= 0.0 || candidates.len() == 1 {
            break;
        }
        candidates.remove(least);
    }
    let coefficients = &coefficients[..candidates.len()];
    let sum: f32 = coefficients.iter().sum();
    let mut whole = [0u16; MAX_WEIGHTS];
    let mut rest = [(0.0f32, 0usize); MAX_WEIGHTS];
    let mut missing = WEIGHT_SUM;
    for (i, coefficient) in coefficients.iter().enumerate() {
        let exact = (coefficient / sum * f32::from(WEIGHT_SUM)).clamp(0.0, f32::from(WEIGHT_SUM));
        whole[i] = (exact as u16).min(missing); // rounds down; NaN is 0
        missing -= whole[i];
        rest[i] = (exact - f32::from(whole[i]), i);
    }
    // What rounding down left over goes to those that lost most.
    let rest = &mut rest[..coefficients.len()];
    rest.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    for &(_, i) in rest.iter().cycle().take(usize::from(missing)) {
        whole[i] += 1;
    }
    let mut weights = TexelWeights::default();
    for (candidate, &weight) in candidates.iter().zip(&whole).filter(|(_, weight)| **weight > 0) {
        let slot = usize::from(weights.len);
        (weights.points[slot], weights.weights[slot]) = (candidate.point, weight);
        weights.len += 1;
    }
    Some(weights)
}

#[cfg(test)]
mod tests;
