//! Bent normals: the mean direction of a point's open rays, in rest space.

use dapple_store::points::{BentNormal, PackedNormal};
use glam::Vec3;

use super::trace::Context;
use crate::psao::generate::{Anchor, rest_axes};
use crate::{BlockedMask, count_blocked};

impl Context<'_> {
    /// The bent normal of the point that sits at `anchor`, from which of its first directions (`local`, about its surface frame in the
    /// world) are blocked. Nothing of the pose goes into it but that, so what is carried along by its surface keeps its bytes.
    pub(super) fn bent_normal(
        &self,
        anchor: &Anchor,
        (instance, normal): (u32, PackedNormal),
        blocked: &BlockedMask,
        local: &[Vec3],
    ) -> BentNormal {
        let mean = mean_open(local, blocked);
        let mirrored = self.pose.instances[instance as usize].world_from_mesh.matrix3.determinant() < 0.0;
        match rest_axes(anchor, self.scene, instance as usize, mirrored) {
            Some([tangent, bitangent, up]) => {
                BentNormal::pack(tangent * mean.x + bitangent * mean.y + up * mean.z, normal)
            }
            None => BentNormal::UNBENT,
        }
    }
}

/// The sum of the open directions around +Z, in proportion, less what the pattern itself leans to: along +Z if all are open, zero if none is.
///
/// With N directions dᵢ of cosine density, whose mean is ⅔ z but for the pattern's noise, and the open share V, it is
/// Σ open dᵢ − V (Σ dᵢ − ⅔ N z). The bracket is zero in expectation, so nothing is biased by it; it takes away all noise where
/// everything is open, and adds none where nothing is.
fn mean_open(local: &[Vec3], blocked: &BlockedMask) -> Vec3 {
    let rays = local.len() as f32;
    let open_share = (local.len() as u32 - count_blocked(blocked)) as f32 / rays;
    let (mut open, mut all) = (Vec3::ZERO, Vec3::ZERO);
    for (i, direction) in local.iter().enumerate() {
        all += *direction;
        if blocked[i / 64] >> (i % 64) & 1 == 0 {
            open += *direction;
        }
    }
    let lean = all - Vec3::Z * (2.0 / 3.0 * rays);
    match open_share {
        // What is left of both sums would differ by rounding alone.
        1.0 => Vec3::Z,
        share => open - lean * share,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::fixed_pattern;

    #[test]
    fn all_open_is_straight_up_and_none_open_is_nothing() {
        let mut local = Vec::new();
        for site in 0..50 {
            for rays in [1, 24, 64, 100, 256] {
                fixed_pattern(rays, site, &mut local);
                assert_eq!(mean_open(&local, &BlockedMask::default()), Vec3::Z);
                let mut all = BlockedMask::default();
                (0..rays as usize).for_each(|i| all[i / 64] |= 1 << (i % 64));
                assert_eq!(mean_open(&local, &all), Vec3::ZERO);
            }
        }
    }

    /// The quarter of the hemisphere with x > 0 has the mean direction (4 / (3 π), 0, 2/3), 32.5° off the normal.
    #[test]
    fn a_quarter_bends_by_its_closed_form_and_the_lean_is_taken_off() {
        let exact = Vec3::new(4.0 / (3.0 * std::f32::consts::PI), 0.0, 2.0 / 3.0).normalize();
        let mut local = Vec::new();
        let (mut error, mut plain) = (0.0, 0.0);
        for site in 0..200 {
            fixed_pattern(64, site, &mut local);
            let mut blocked = BlockedMask::default();
            let behind = local.iter().enumerate().filter(|(_, d)| d.x <= 0.0);
            behind.for_each(|(i, _)| blocked[i / 64] |= 1 << (i % 64));
            let open: Vec3 = local.iter().filter(|d| d.x > 0.0).sum();
            error += mean_open(&local, &blocked).normalize().distance_squared(exact);
            plain += open.normalize().distance_squared(exact);
        }
        let [error, plain] = [error, plain].map(|sum| (sum / 200.0).sqrt());
        assert!(error < 0.03 && error < plain, "{error} against {plain}");
    }
}
