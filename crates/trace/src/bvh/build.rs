//! Builds a [`Tree`]: binned surface-area heuristic, top down, then eight binary children to a node.
//!
//! The result depends on the boxes and their order alone. Both halves of a split are built by `rayon::join` into
//! disjoint slices, and bins are merged by minimum, maximum and integer sums, which no order changes.

use dapple_scene::Aabb;
use dapple_scene::glam::Vec3;
use rayon::prelude::*;

use super::tree::{MAX_LEAF, Node, Tree, WIDTH, half_area};

const BINS: usize = 16;
/// So many primitives are sorted to find the best cut; more are put in bins.
const FEW: usize = 8;
/// Below this many primitives a range is built by one thread.
const PARALLEL: usize = 4096;
/// Below this many primitives bins are filled by one thread.
const PARALLEL_BINS: usize = 65536;
/// Deeper than this, ranges are halved by count: bounds the depth for spiteful input.
const HEURISTIC_DEPTH: u32 = 40;

/// What leaves cost and how large they get.
pub(crate) struct Leaves {
    /// Most primitives in one, 1 … [`MAX_LEAF`].
    pub(crate) max: usize,
    /// Cost of a leaf in units of a node's child.
    pub(crate) fixed: f64,
    /// Cost of each primitive in it.
    pub(crate) each: f64,
}

/// Leaves of triangles: a block costs about the same however full it is.
pub(crate) const MESH_LEAVES: Leaves = Leaves { max: MAX_LEAF, fixed: 1.0, each: 0.05 };
/// Leaves of instances: each is looked at by itself.
pub(crate) const TOP_LEAVES: Leaves = Leaves { max: 1, fixed: 1.0, each: 1.0 };

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

/// Over `count` primitives from `start`; if they are more than one, with children at `first` and `second`.
#[derive(Clone, Copy)]
struct BinaryNode {
    bounds: Aabb,
    first: u32,
    second: u32,
    start: u32,
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
pub(crate) fn build(boxes: &[Aabb], leaves: &Leaves) -> Tree {
    if boxes.is_empty() {
        return Tree::default();
    }
    let mut primitives: Vec<Primitive> = boxes
        .iter()
        .enumerate()
        .map(|(i, b)| Primitive { min: b.min, max: b.max, index: i as u32 })
        .collect();
    let unused = BinaryNode { bounds: Aabb::EMPTY, first: 0, second: 0, start: 0, count: 0 };
    let mut binary = vec![unused; 2 * boxes.len() - 1];
    split(&mut primitives, &mut binary, 0, 0, 0);
    let nodes = collapse(&binary, leaves);
    Tree { nodes, order: primitives.iter().map(|p| p.index).collect() }
}

/// Builds the subtree of `primitives` (which start at `first` of all) into `nodes` (which start at `base` of all and
/// are exactly `2 n − 1`), down to single primitives.
fn split(primitives: &mut [Primitive], nodes: &mut [BinaryNode], first: usize, base: usize, depth: u32) {
    let n = primitives.len();
    let (mut bounds, mut centers) = (Aabb::EMPTY, Aabb::EMPTY);
    for p in primitives.iter() {
        bounds = bounds.union(Aabb { min: p.min, max: p.max });
        centers = centers.with_point(p.center());
    }
    let (start, count) = (first as u32, n as u32);
    if n == 1 {
        nodes[0] = BinaryNode { bounds, first: 0, second: 0, start, count };
        return;
    }
    let cut = if depth >= HEURISTIC_DEPTH {
        halve(primitives, &centers)
    } else if n <= FEW {
        sweep(primitives)
    } else {
        match best_cut(primitives, &centers) {
            Some(cut) => partition(primitives, &cut),
            None => halve(primitives, &centers),
        }
    };
    let (left, right) = primitives.split_at_mut(cut);
    let (root, below) = nodes.split_at_mut(1);
    let (left_nodes, right_nodes) = below.split_at_mut(2 * cut - 1);
    let (left_base, right_base) = (base + 1, base + 2 * cut);
    root[0] = BinaryNode { bounds, first: left_base as u32, second: right_base as u32, start, count };
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

/// Sorts a few primitives along the axis of the best cut and returns where to cut.
fn sweep(primitives: &mut [Primitive]) -> usize {
    let n = primitives.len();
    let mut best = (f64::INFINITY, 0, n / 2);
    for axis in 0..3 {
        sort_along(primitives, axis);
        let mut right_cost = [0.0; FEW + 1];
        let mut b = Aabb::EMPTY;
        for i in (1..n).rev() {
            b = b.union(Aabb { min: primitives[i].min, max: primitives[i].max });
            right_cost[i] = half_area(&b) * (n - i) as f64;
        }
        let mut b = Aabb::EMPTY;
        for i in 1..n {
            b = b.union(Aabb { min: primitives[i - 1].min, max: primitives[i - 1].max });
            let cost = half_area(&b) * i as f64 + right_cost[i];
            if cost < best.0 {
                best = (cost, axis, i);
            }
        }
    }
    if best.1 != 2 {
        sort_along(primitives, best.1);
    }
    best.2
}

/// By centre, then index: an order that does not depend on the order before.
fn sort_along(primitives: &mut [Primitive], axis: usize) {
    primitives
        .sort_unstable_by(|a, b| a.center()[axis].total_cmp(&b.center()[axis]).then(a.index.cmp(&b.index)));
}

/// Where to cut: primitives whose bin along `axis` is below `bin` go left.
struct Cut {
    axis: usize,
    bin: usize,
    origin: f32,
    scale: f32,
    cost: f64,
}

fn bin_of(center: f32, origin: f32, scale: f32) -> usize {
    // The cast saturates, and NaN (a range too large to subtract) becomes 0.
    (((center - origin) * scale) as usize).min(BINS - 1)
}

fn best_cut(primitives: &[Primitive], centers: &Aabb) -> Option<Cut> {
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
            let cost = half_area(&b) * f64::from(n) + right;
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

/// The least expected cost of a binary subtree in 8-wide form (\[Ylitie2017\] sec. 3.1): as 1 … 7 children of one node.
#[derive(Clone, Copy)]
struct Cost {
    /// `forest[i]`: as at most `i + 1` children.
    forest: [f64; WIDTH - 1],
    /// As a leaf it costs no more than as a node.
    leaf: bool,
}

/// The 8-wide form of a binary tree: which subtrees become leaves, and which nodes are opened, by least expected cost.
///
/// \[Ylitie2017\]: H. Ylitie, T. Karras, S. Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
/// BVHs", HPG 2017.
fn collapse(binary: &[BinaryNode], leaves: &Leaves) -> Vec<Node> {
    let mut costs = vec![Cost { forest: [0.0; WIDTH - 1], leaf: true }; binary.len()];
    // Children lie behind their parents.
    for index in (0..binary.len()).rev() {
        let node = &binary[index];
        let (area, n) = (half_area(&node.bounds), node.count as usize);
        let as_leaf =
            if n <= leaves.max { area * (leaves.fixed + leaves.each * n as f64) } else { f64::INFINITY };
        if n == 1 {
            costs[index].forest = [as_leaf; WIDTH - 1];
            continue;
        }
        let (a, b) = (costs[node.first as usize].forest, costs[node.second as usize].forest);
        let shared = |children: usize| {
            (0..children - 1).map(|i| a[i.min(WIDTH - 2)] + b[children - 2 - i]).fold(f64::INFINITY, f64::min)
        };
        let as_node = area + shared(WIDTH);
        let mut cost = Cost { forest: [as_leaf.min(as_node); WIDTH - 1], leaf: as_leaf <= as_node };
        for children in 2..WIDTH {
            cost.forest[children - 1] = cost.forest[children - 2].min(shared(children));
        }
        costs[index] = cost;
    }
    let mut nodes = Vec::with_capacity(binary.len() / 16 + 1);
    if costs[0].leaf {
        let mut node = Node::empty();
        node.set_bounds(0, &binary[0].bounds);
        node.set_leaf(0, 0, binary[0].count as usize);
        nodes.push(node);
    } else {
        open(binary, &costs, 0, &mut nodes);
    }
    nodes.shrink_to_fit();
    nodes
}

/// Appends the binary subtree as a node and what is below it; returns the node's index.
fn open(binary: &[BinaryNode], costs: &[Cost], root: usize, nodes: &mut Vec<Node>) -> u32 {
    let mut slots = [0; WIDTH];
    let mut used = 0;
    let top = &binary[root];
    share(binary, costs, [top.first as usize, top.second as usize], WIDTH, &mut |child| {
        slots[used] = child;
        used += 1;
    });
    let index = nodes.len();
    nodes.push(Node::empty());
    let mut node = Node::empty();
    for (slot, &child) in slots[..used].iter().enumerate() {
        let below = &binary[child];
        node.set_bounds(slot, &below.bounds);
        if costs[child].leaf {
            node.set_leaf(slot, below.start, below.count as usize);
        } else {
            node.set_inner(slot, open(binary, costs, child, nodes));
        }
    }
    nodes[index] = node;
    index as u32
}

/// Calls `keep` with the at most `slots` subtrees that two subtrees are best kept as.
fn share(
    binary: &[BinaryNode],
    costs: &[Cost],
    [left, right]: [usize; 2],
    slots: usize,
    keep: &mut impl FnMut(usize),
) {
    let (a, b) = (&costs[left].forest, &costs[right].forest);
    let both = |i: usize| a[i.min(WIDTH - 2)] + b[slots - 2 - i];
    let best = (0..slots - 1).fold(0, |best, i| if both(i) < both(best) { i } else { best });
    for (child, slots) in [(left, best + 1), (right, slots - 1 - best)] {
        // Fewer slots are as good wherever opening it further saves nothing.
        let forest = &costs[child].forest;
        let mut wanted = slots.min(WIDTH - 1);
        while wanted > 1 && forest[wanted - 2] <= forest[wanted - 1] {
            wanted -= 1;
        }
        if wanted == 1 {
            keep(child);
        } else {
            let node = &binary[child];
            share(binary, costs, [node.first as usize, node.second as usize], wanted, keep);
        }
    }
}
