//! Where the points lie: fixed while a group lasts.

use glam::Vec3;

use super::{PackedNormal, morton_code};

/// Largest integer coordinate of a point along one axis (21 bits).
pub const MAX_COORDINATE: u32 = (1 << 21) - 1;

/// Most points a layout may hold. Bounds what a decoder allocates.
pub const MAX_POINTS: u32 = 1 << 24;

/// All points of a store, grouped by instance.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointLayout {
    /// Edge of one integer step in rest space, metres.
    quantum_m: f32,
    /// Spacing radius r0 = 2 r_max of the kept points, metres: the kernels' unit of length.
    spacing_m: f32,
    sets: Vec<PointSet>,
    len: u32,
}

/// The points of one instance, in order of [`morton_code`], then packed normal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointSet {
    /// Index into the scene's instances; strictly increasing from set to set.
    pub instance: u32,
    /// Index of the set's first point in the store.
    pub first: u32,
    /// Rest-space position of integer coordinate (0, 0, 0).
    pub origin_rest: Vec3,
    /// Integer positions, each coordinate at most [`MAX_COORDINATE`].
    pub positions: Vec<[u32; 3]>,
    /// One normal a point, rest space.
    pub normals: Vec<PackedNormal>,
}

/// Why a layout was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LayoutError {
    /// A length is not a positive finite number.
    #[error("layout: {name} is {value}, must be positive and finite")]
    BadLength {
        /// Which.
        name: &'static str,
        /// What it was.
        value: f32,
    },
    /// Too many points.
    #[error("layout: {0} points, at most {MAX_POINTS} fit; lower the density")]
    TooManyPoints(u64),
    /// A set breaks a rule of [`PointSet`].
    #[error("layout: set {set}: {reason}")]
    BadSet {
        /// Position in the list of sets.
        set: usize,
        /// What is wrong.
        reason: &'static str,
    },
    /// Sets that come are laid by other lengths.
    #[error("layout: sets that come have another quantum or spacing; lay them with the same density")]
    OtherLengths,
    /// A set that is to go is not there.
    #[error("layout: instance {0} has no set that could go")]
    NoSuchSet(u32),
    /// A set that comes is there already.
    #[error("layout: instance {0} has a set already")]
    SetExists(u32),
    /// Points that come with values of more or fewer lights than those that are there.
    #[error("layout: points with values of {found} lights do not go with others that have {held}")]
    OtherLights {
        /// Lights of the points that are there.
        held: u32,
        /// Of those that come.
        found: u32,
    },
}

impl PointLayout {
    /// Checks and joins sets; fills in each set's `first`.
    pub fn new(quantum_m: f32, spacing_m: f32, sets: Vec<PointSet>) -> Result<PointLayout, LayoutError> {
        for (name, value) in [("quantum_m", quantum_m), ("spacing_m", spacing_m)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(LayoutError::BadLength { name, value });
            }
        }
        let total: u64 = sets.iter().map(|s| s.positions.len() as u64).sum();
        if total > u64::from(MAX_POINTS) {
            return Err(LayoutError::TooManyPoints(total));
        }
        let mut last_instance = None;
        for (index, set) in sets.iter().enumerate() {
            let bad = |reason| LayoutError::BadSet { set: index, reason };
            if last_instance.is_some_and(|last| last >= set.instance) {
                return Err(bad("instances must increase"));
            }
            last_instance = Some(set.instance);
            if set.positions.len() != set.normals.len() {
                return Err(bad("positions and normals differ in number"));
            }
            if !set.origin_rest.is_finite() {
                return Err(bad("origin is not finite"));
            }
            if set.positions.iter().flatten().any(|&c| c > MAX_COORDINATE) {
                return Err(bad("a coordinate exceeds 21 bits"));
            }
            let key = |i: usize| (morton_code(set.positions[i]), set.normals[i]);
            if (1..set.positions.len()).any(|i| key(i - 1) > key(i)) {
                return Err(bad("points are not in Morton order"));
            }
        }
        Ok(PointLayout::joined(quantum_m, spacing_m, sets))
    }

    /// Fills in each set's `first`; the rest has been checked.
    pub(super) fn joined(quantum_m: f32, spacing_m: f32, mut sets: Vec<PointSet>) -> PointLayout {
        let mut len = 0;
        for set in &mut sets {
            set.first = len;
            len += set.positions.len() as u32;
        }
        PointLayout { quantum_m, spacing_m, sets, len }
    }

    /// Edge of one integer step in rest space, metres.
    pub fn quantum_m(&self) -> f32 {
        self.quantum_m
    }

    /// Spacing radius r0 of the kept points, metres.
    pub fn spacing_m(&self) -> f32 {
        self.spacing_m
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.len as usize
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The sets, in order of instance.
    pub fn sets(&self) -> &[PointSet] {
        &self.sets
    }

    /// The set of an instance, if it has points.
    pub fn set_of_instance(&self, instance: u32) -> Option<&PointSet> {
        self.sets.binary_search_by_key(&instance, |s| s.instance).ok().map(|i| &self.sets[i])
    }
}

impl PointSet {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Rest-space position of the set's point `i`, metres.
    pub fn position_rest(&self, i: usize, quantum_m: f32) -> Vec3 {
        let [x, y, z] = self.positions[i];
        self.origin_rest + Vec3::new(x as f32, y as f32, z as f32) * quantum_m
    }

    /// Rest-space normal of the set's point `i`.
    pub fn normal_rest(&self, i: usize) -> Vec3 {
        self.normals[i].unpack()
    }
}
