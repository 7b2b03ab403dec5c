//! The 8-wide box tree that both levels of the tracer share: its layout, refit and cost.

use dapple_scene::Aabb;
use dapple_scene::glam::Vec3;

/// Children of a node.
pub(crate) const WIDTH: usize = 8;
/// Most primitives in a leaf: one block of vectors.
pub(crate) const MAX_LEAF: usize = 8;

/// Boxes grow by this factor of the distance along the ray, which covers the rounding of the box test and of the
/// triangle test (\[Ize2013\] derives 1 + 2 gamma(3) for the former).
pub(crate) const CONSERVATIVE: f32 = 1.0 + 1.0 / (1 << 20) as f32;

/// Added to the end of a ray in a box: more than products below the smallest normal number are off by.
pub(crate) const TINY: f32 = 1e-37;

/// All coordinates of an empty box: a corner of the world that neither rays nor their reach touch, whichever way boxes are
/// tested (inverted boxes would let single rays in).
const NOWHERE: f32 = f32::MAX;

const INNER: u8 = 0;
const EMPTY: u8 = 0xff;

/// Eight children side by side, so that one box test covers them all.
#[derive(Clone)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// Smallest x, y, z, then largest x, y, z of each child; [`NOWHERE`] for children that hold nothing.
    pub(crate) bounds: [[f32; WIDTH]; 6],
    /// Index of the child node, or of the leaf's first primitive.
    child: [u32; WIDTH],
    /// Primitives in the leaf, or [`INNER`], or [`EMPTY`].
    count: [u8; WIDTH],
}

/// What a slot of a node holds.
pub(crate) enum Child {
    /// Nothing.
    Empty,
    /// The node of that index.
    Inner(u32),
    /// Primitives in leaf order.
    Leaf(std::ops::Range<usize>),
}

impl Node {
    pub(crate) fn empty() -> Node {
        Node { bounds: [[NOWHERE; WIDTH]; 6], child: [0; WIDTH], count: [EMPTY; WIDTH] }
    }

    #[inline(always)]
    pub(crate) fn child(&self, slot: usize) -> Child {
        match self.count[slot] {
            EMPTY => Child::Empty,
            INNER => Child::Inner(self.child[slot]),
            n => {
                let first = self.child[slot] as usize;
                Child::Leaf(first..first + usize::from(n))
            }
        }
    }

    pub(crate) fn set_inner(&mut self, slot: usize, node: u32) {
        (self.child[slot], self.count[slot]) = (node, INNER);
    }

    pub(crate) fn set_leaf(&mut self, slot: usize, first: u32, count: usize) {
        debug_assert!((1..=MAX_LEAF).contains(&count));
        (self.child[slot], self.count[slot]) = (first, count as u8);
    }

    pub(crate) fn set_bounds(&mut self, slot: usize, b: &Aabb) {
        let nowhere = b.is_empty();
        for axis in 0..3 {
            self.bounds[axis][slot] = if nowhere { NOWHERE } else { b.min[axis] };
            self.bounds[axis + 3][slot] = if nowhere { NOWHERE } else { b.max[axis] };
        }
    }

    pub(crate) fn child_bounds(&self, slot: usize) -> Aabb {
        let b = &self.bounds;
        if b[0][slot] == NOWHERE {
            return Aabb::EMPTY;
        }
        Aabb {
            min: Vec3::new(b[0][slot], b[1][slot], b[2][slot]),
            max: Vec3::new(b[3][slot], b[4][slot], b[5][slot]),
        }
    }

    /// Around all children.
    pub(crate) fn union(&self) -> Aabb {
        (0..WIDTH).fold(Aabb::EMPTY, |b, slot| b.union(self.child_bounds(slot)))
    }
}

/// A tree over boxes. Nodes lie parents first; leaves name ranges of `order`.
#[derive(Clone, Default)]
pub(crate) struct Tree {
    /// Root first; empty without primitives.
    pub(crate) nodes: Vec<Node>,
    /// Primitive indices in leaf order.
    pub(crate) order: Vec<u32>,
}

impl Tree {
    /// Around everything.
    pub(crate) fn bounds(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, Node::union)
    }

    /// Computes all boxes again from the boxes of leaf ranges, without changing who is whose child.
    pub(crate) fn refit(&mut self, mut leaf_bounds: impl FnMut(std::ops::Range<usize>) -> Aabb) {
        for index in (0..self.nodes.len()).rev() {
            for slot in 0..WIDTH {
                let b = match self.nodes[index].child(slot) {
                    Child::Empty => continue,
                    Child::Inner(node) => self.nodes[node as usize].union(),
                    Child::Leaf(range) => leaf_bounds(range),
                };
                self.nodes[index].set_bounds(slot, &b);
            }
        }
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>() + self.order.capacity() * size_of::<u32>()
    }

    /// Expected cost of a long random ray, in box and triangle tests (surface area heuristic). Finite, ≥ 0.
    pub(crate) fn cost(&self) -> f64 {
        let root = half_area(&self.bounds());
        if root == 0.0 {
            return 0.0;
        }
        let mut sum = 0.0;
        for node in &self.nodes {
            for slot in 0..WIDTH {
                let weight = match node.child(slot) {
                    Child::Empty => continue,
                    Child::Inner(_) => 1.0,
                    Child::Leaf(range) => range.len() as f64,
                };
                sum += weight * half_area(&node.child_bounds(slot));
            }
        }
        sum / root
    }
}

/// Half the surface area of a box in `f64`, which no finite box overflows; 0 if empty.
pub(crate) fn half_area(b: &Aabb) -> f64 {
    if b.is_empty() {
        return 0.0;
    }
    let side = |axis: usize| f64::from(b.max[axis]) - f64::from(b.min[axis]);
    let (x, y, z) = (side(0), side(1), side(2));
    x * y + y * z + z * x
}
