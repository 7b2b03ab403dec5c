//! Which cone a sample goes to: cases A to D ([Stadlbauer2023] sec. 3.1.1, figure 5).

use super::cap::{enclose, gap};
use super::{BoundingCone, BoundingEntry, BoundingParams, MOST_BOUNDING_CONES, angle_between};

/// A sample this little outside a cone, radians, is inside it: more than cosines in single precision tell apart.
const ROUNDING: f32 = 1e-3;

impl BoundingEntry {
    /// Adds a sample, given as a cone without width; returns how far an axis turned, radians.
    pub(super) fn insert(&mut self, sample: &BoundingCone, params: &BoundingParams) -> f32 {
        let most = usize::from(params.cones).clamp(1, MOST_BOUNDING_CONES);
        let nearest = self
            .cones()
            .iter()
            .enumerate()
            .map(|(i, cone)| (gap(cone, sample), i))
            .fold((f32::INFINITY, 0), |best, next| if next.0 < best.0 { next } else { best });
        // A: inside a cone, of several the one whose rim is furthest.
        if nearest.0 <= ROUNDING {
            self.cones[nearest.1].energy += sample.energy;
            return 0.0;
        }
        // B: there is room for another cone.
        if usize::from(self.count) < most {
            self.push(sample);
            return 0.0;
        }
        let mut turned = 0.0f32;
        while usize::from(self.count) > most {
            turned = turned.max(self.merge_closest());
        }
        match self.closest_pair() {
            // D: two cones are closer to each other than the sample to any.
            Some((apart, _, _)) if apart <= nearest.0 => {
                turned = turned.max(self.merge_closest());
                self.push(sample);
                turned
            }
            // C: the nearest cone is extended.
            _ => {
                let at = if nearest.1 < usize::from(self.count) { nearest.1 } else { 0 };
                turned.max(self.absorb(at, sample))
            }
        }
    }

    /// Extends a cone to hold another and its energy; returns how far the axis turned, radians.
    fn absorb(&mut self, at: usize, other: &BoundingCone) -> f32 {
        let cone = &mut self.cones[at];
        let (direction, angle) = enclose(cone, other);
        let turned = angle_between(cone.direction, direction);
        *cone = BoundingCone { direction, angle, energy: cone.energy + other.energy };
        turned
    }

    /// The two cones with the least gap, and the gap.
    fn closest_pair(&self) -> Option<(f32, usize, usize)> {
        let mut best: Option<(f32, usize, usize)> = None;
        for (i, a) in self.cones().iter().enumerate() {
            for (k, b) in self.cones().iter().enumerate().skip(i + 1) {
                let apart = gap(a, b);
                if best.is_none_or(|(least, _, _)| apart < least) {
                    best = Some((apart, i, k));
                }
            }
        }
        best
    }

    fn merge_closest(&mut self) -> f32 {
        let Some((_, i, k)) = self.closest_pair() else { return 0.0 };
        let other = self.cones[k];
        let turned = self.absorb(i, &other);
        self.remove(k);
        turned
    }
}
