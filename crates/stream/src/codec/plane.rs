//! What a point's normal and its neighbours say about where it lies: on the plane through one of them.
//!
//! All in whole numbers, so both ends agree on every machine.

use dapple_store::points::PackedNormal;

/// How many points back a neighbour with the same normal is looked for.
const REACH: usize = 16;

/// A point's axes: `across` is the one that its normal points along most; `along` are the next two in the
/// cyclic order x, y, z.
pub(crate) struct Plane {
    pub(crate) across: usize,
    pub(crate) along: [usize; 2],
    normal: [i64; 3],
}

impl Plane {
    pub(crate) fn new(normal: PackedNormal) -> Plane {
        let normal = direction(normal);
        let size = normal.map(i64::abs);
        let across = if size[0] >= size[1] && size[0] >= size[2] {
            0
        } else if size[1] >= size[2] {
            1
        } else {
            2
        };
        Plane { across, along: [(across + 1) % 3, (across + 2) % 3], normal }
    }

    /// Coordinate `across` of the plane through `reference`, above the two coordinates `along`.
    /// Wraps modulo 2³²; only the low bits matter.
    pub(crate) fn predict(&self, reference: [u32; 3], at: [u32; 2]) -> u32 {
        let step = |k: usize| {
            let axis = self.along[k];
            self.normal[axis] * (i64::from(at[k]) - i64::from(reference[axis]))
        };
        let (mut rise, mut run) = (-(step(0) + step(1)), self.normal[self.across]);
        if run < 0 {
            (rise, run) = (-rise, -run);
        }
        // Rounded to the nearest, halves upward. `run` is at least 43, a third of 127.
        let offset = (2 * rise + run).div_euclid(2 * run);
        reference[self.across].wrapping_add(offset as u32)
    }
}

/// The point that the prediction for the point after those given starts from: the last of up to [`REACH`] with its normal, else
/// the last one, else the origin.
pub(crate) fn reference(positions: &[[u32; 3]], normals: &[PackedNormal], normal: PackedNormal) -> [u32; 3] {
    let first = normals.len().saturating_sub(REACH);
    let same = normals[first..].iter().rposition(|other| *other == normal).map(|at| first + at);
    same.or(normals.len().checked_sub(1)).map_or([0; 3], |at| positions[at])
}

/// The direction of a packed normal, scaled so that the sum of its components' sizes is 127.
pub(crate) fn direction(normal: PackedNormal) -> [i64; 3] {
    let component = |b: u8| i64::from(b.min(254)) - 127;
    let (x, y) = (component(normal.0[0]), component(normal.0[1]));
    let z = 127 - x.abs() - y.abs();
    let sign = |v: i64| if v < 0 { -1 } else { 1 };
    if z < 0 { [(127 - y.abs()) * sign(x), (127 - x.abs()) * sign(y), z] } else { [x, y, z] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn directions_are_those_of_the_unpacked_normals() {
        for a in 0..=255 {
            for b in 0..=255 {
                let normal = PackedNormal([a, b]);
                let d = direction(normal);
                assert_eq!(d.iter().map(|c| c.abs()).sum::<i64>(), 127);
                let unit = Vec3::from_array(d.map(|c| c as f32)).normalize();
                assert!(unit.distance(normal.unpack()) < 1e-5, "{normal:?}");
                assert!(d[Plane::new(normal).across].abs() >= 43);
            }
        }
    }

    #[test]
    fn points_of_a_plane_are_predicted() {
        let up = Vec3::new(0.3, 0.9, -0.2).normalize();
        let normal = PackedNormal::pack(up);
        let plane = Plane::new(normal);
        assert_eq!((plane.across, plane.along), (1, [2, 0]));
        let exact = normal.unpack();
        let (x, z) = (1040u32, 970u32);
        let y = 500.0 - (exact.x * 40.0 + exact.z * -30.0) / exact.y;
        let predicted = plane.predict([1000, 500, 1000], [z, x]);
        assert!((f64::from(predicted) - f64::from(y)).abs() <= 0.51, "{predicted} {y}");
    }
}
