//! Builds a [`Tree`]: binned surface-area heuristic, top down, then eight binary children to a node.
//!
//! The result depends on the boxes and their order alone. Both halves of a split are built by `rayon::join` into
//! disjoint slices, and bins are merged by minimum, maximum and integer sums, which no order changes.

use dapple_scene::Aabb;
use dapple_scene::glam::Vec3;
use rayon::prelude::*;

use super::tree::{MAX_LEAF, Node, Tree, WIDTH, half_area};

const BINS: usize = 16;
/// Below this many primitives a range is built by one thread.
const PARALLEL: usize = 4096;
/// Below this many primitives bins are filled by one thread.
const PARALLEL_BINS: usize = 65536;
/// Deeper than this, ranges are halved by count: bounds the depth for spiteful input.
const HEURISTIC_DEPTH: u32 = 40;
/// Cost of a node in units of a triangle test.
const NODE_COST: f64 = 1.0;

#[derive(Clone, Copy)]
struct Primitive {
    min: Vec3,
    max: Vec3,
    index: u32,
}

impl Primitive {
    fn center(&self) -> Vec3 {
        if self.min.cmpgt(self.max).any() { Vec3::ZERO } else { 0.5 * self.min + 0.5 * self.max }
    }
}

/// `count > 0`: a leaf over the primitives from `first`; otherwise children at `first` and `second`.
#[derive(Clone, Copy)]
struct BinaryNode {
    bounds: Aabb,
    first: u32,
    second: u32,
    count: u32,
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: Aabb,
    count: u32,
}

type Bins = [[Bin; BINS]; 3];
const NO_BINS: Bins = [[Bin { bounds: Aabb::EMPTY, count: 0 }; BINS]; 3];

/// A tree over `boxes`; empty boxes (min > max) are kept, but never hit. All finite coordinates are welcome.
pub(crate) fn build(boxes: &[Aabb]) -> Tree {
    if boxes.is_empty() {
        return Tree::default();
    }
    let mut primitives: Vec<Primitive> = boxes
        .iter()
        .enumerate()
        .map(|(i, b)| Primitive { min: b.min, max: b.max, index: i as u32 })
        .collect();
    let unused = BinaryNode { bounds: Aabb::EMPTY, first: 0, second: 0, count: 0 };
    let mut binary = vec![unused; 2 * boxes.len() - 1];
    split(&mut primitives, &mut binary, 0, 0, 0);

    let mut nodes = Vec::with_capacity(boxes.len() / 4 + 1);
    collapse(&binary, 0, &mut nodes);
    Tree { nodes, order: primitives.iter().map(|p| p.index).collect() }
}

/// Builds the subtree of `primitives` (which start at `first` of all) into `nodes` (which start at `base` of all and
/// are exactly `2 n − 1`).
fn split(primitives: &mut [Primitive], nodes: &mut [BinaryNode], first: usize, base: usize, depth: u32) {
    let n = primitives.len();
    let (mut bounds, mut centers) = (Aabb::EMPTY, Aabb::EMPTY);
    for p in primitives.iter() {
        bounds = bounds.union(Aabb { min: p.min, max: p.max });
        centers = centers.with_point(p.center());
    }
    let cut = if n == 1 {
        None
    } else if depth >= HEURISTIC_DEPTH {
        (n > MAX_LEAF).then(|| halve(primitives, &centers))
    } else {
        match best_cut(primitives, &bounds, &centers) {
            Some(cut) if n > MAX_LEAF || cut.cost < n as f64 => Some(partition(primitives, &cut)),
            _ => (n > MAX_LEAF).then(|| halve(primitives, &centers)),
        }
    };
    let Some(cut) = cut else {
        nodes[0] = BinaryNode { bounds, first: first as u32, second: 0, count: n as u32 };
        return;
    };
    let (left, right) = primitives.split_at_mut(cut);
    let (root, below) = nodes.split_at_mut(1);
    let (left_nodes, right_nodes) = below.split_at_mut(2 * cut - 1);
    let (left_base, right_base) = (base + 1, base + 2 * cut);
    root[0] = BinaryNode { bounds, first: left_base as u32, second: right_base as u32, count: 0 };
    if n >= PARALLEL {
        rayon::join(
            || split(left, left_nodes, first, left_base, depth + 1),
            || split(right, right_nodes, first + cut, right_base, depth + 1),
        );
    } else {
        split(left, left_nodes, first, left_base, depth + 1);
        split(right, right_nodes, first + cut, right_base, depth + 1);
    }
}

/// Where to cut: primitives whose bin along `axis` is below `bin` go left.
struct Cut {
    axis: usize,
    bin: usize,
    origin: f32,
    scale: f32,
    /// Expected cost of a ray that enters the box, in triangle tests.
    cost: f64,
}

fn bin_of(center: f32, origin: f32, scale: f32) -> usize {
    // The cast saturates, and NaN (a range too large to subtract) becomes 0.
    (((center - origin) * scale) as usize).min(BINS - 1)
}

fn best_cut(primitives: &[Primitive], bounds: &Aabb, centers: &Aabb) -> Option<Cut> {
    let extent = centers.max - centers.min;
    let scale = extent.map(|e| if e > 0.0 && e < f32::MAX { BINS as f32 * 0.999_99 / e } else { 0.0 });
    let scale = scale.map(|s| if s.is_finite() { s } else { 0.0 });
    let fill = |chunk: &[Primitive]| {
        let mut bins = NO_BINS;
        for p in chunk {
            let center = p.center();
            for axis in 0..3 {
                let bin = &mut bins[axis][bin_of(center[axis], centers.min[axis], scale[axis])];
                bin.bounds = bin.bounds.union(Aabb { min: p.min, max: p.max });
                bin.count += 1;
            }
        }
        bins
    };
    let bins = if primitives.len() >= PARALLEL_BINS {
        primitives.par_chunks(PARALLEL_BINS / 4).map(fill).reduce(|| NO_BINS, merge)
    } else {
        fill(primitives)
    };

    let area = half_area(bounds);
    let mut best: Option<Cut> = None;
    for axis in (0..3).filter(|&a| scale[a] > 0.0) {
        // Costs of everything right of each boundary, then a sweep from the left.
        let mut right_cost = [0.0; BINS];
        let (mut b, mut n) = (Aabb::EMPTY, 0);
        for i in (1..BINS).rev() {
            b = b.union(bins[axis][i].bounds);
            n += bins[axis][i].count;
            right_cost[i] = if n == 0 { f64::INFINITY } else { half_area(&b) * f64::from(n) };
        }
        let (mut b, mut n) = (Aabb::EMPTY, 0);
        for (i, &right) in right_cost.iter().enumerate().skip(1) {
            b = b.union(bins[axis][i - 1].bounds);
            n += bins[axis][i - 1].count;
            if n == 0 || right == f64::INFINITY {
                continue;
            }
            let both = half_area(&b) * f64::from(n) + right;
            let cost = NODE_COST + if area > 0.0 { both / area } else { 0.0 };
            if best.as_ref().is_none_or(|c| cost < c.cost) {
                best = Some(Cut { axis, bin: i, origin: centers.min[axis], scale: scale[axis], cost });
            }
        }
    }
    best
}

fn merge(mut a: Bins, b: Bins) -> Bins {
    for (x, y) in a.iter_mut().flatten().zip(b.iter().flatten()) {
        x.bounds = x.bounds.union(y.bounds);
        x.count += y.count;
    }
    a
}

/// Brings the left side to the front and returns its length (both sides are non-empty: their bins were counted).
fn partition(primitives: &mut [Primitive], cut: &Cut) -> usize {
    let mut end = 0;
    for i in 0..primitives.len() {
        if bin_of(primitives[i].center()[cut.axis], cut.origin, cut.scale) < cut.bin {
            primitives.swap(i, end);
            end += 1;
        }
    }
    end
}

/// Halves by count along the longest axis of the centres.
fn halve(primitives: &mut [Primitive], centers: &Aabb) -> usize {
    let extent = 0.5 * centers.max - 0.5 * centers.min;
    let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
    let middle = primitives.len() / 2;
    primitives.select_nth_unstable_by(middle, |a, b| {
        a.center()[axis].total_cmp(&b.center()[axis]).then(a.index.cmp(&b.index))
    });
    middle
}

/// Appends the 8-wide form of the binary subtree and returns its index.
fn collapse(binary: &[BinaryNode], root: usize, nodes: &mut Vec<Node>) -> u32 {
    let mut slots = [0; WIDTH];
    let mut used = 1;
    slots[0] = root;
    while used < WIDTH {
        // Open the child that a ray meets most often; the first of equals.
        let mut widest: Option<(f64, usize)> = None;
        for (i, &slot) in slots[..used].iter().enumerate().filter(|(_, slot)| binary[**slot].count == 0) {
            let area = half_area(&binary[slot].bounds);
            if widest.is_none_or(|(a, _)| area > a) {
                widest = Some((area, i));
            }
        }
        let Some((_, i)) = widest else { break };
        let opened = &binary[slots[i]];
        slots[i] = opened.first as usize;
        slots[used] = opened.second as usize;
        used += 1;
    }
    let index = nodes.len();
    let mut node = Node::empty();
    nodes.push(Node::empty());
    for (i, &slot) in slots[..used].iter().enumerate() {
        let child = &binary[slot];
        node.set_bounds(i, &child.bounds);
        if child.count > 0 {
            node.set_leaf(i, child.first, child.count as usize);
        } else {
            node.set_inner(i, collapse(binary, slot, nodes));
        }
    }
    nodes[index] = node;
    index as u32
}
