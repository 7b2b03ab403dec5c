//! Which cone a sample goes to: cases A to D of [Stadlbauer2023] sec. 3.1.1, over moments.

use glam::Vec3;

use super::super::entry::{GONE, luminance};
use super::{MOST_MOMENT_CONES, MomentCone, MomentEntry, MomentParams};

/// Cones are not taken to be narrower than this, radians, when it is asked what lies inside: samples of a light
/// that is almost a point then share a cone.
const LEAST_ANGLE: f32 = 1e-3;

impl MomentEntry {
    /// Adds a sample, given as a cone of its own.
    pub(super) fn insert(&mut self, sample: &MomentCone, direction: Vec3, light: u32, params: &MomentParams) {
        let most = usize::from(params.cones).clamp(1, MOST_MOMENT_CONES);
        // Case A: inside a cone (of its light): its energy grows. The nearest of several.
        let mut inside: Option<(f32, usize)> = None;
        for (i, cone) in self.cones().iter().enumerate() {
            if params.tagged && !cone.lights.may_hold(light) {
                continue;
            }
            let (axis, cos_angle) = cone.axis();
            let angle = quick_angle(axis.dot(direction));
            if angle <= params.inside * quick_angle(cos_angle).max(LEAST_ANGLE)
                && inside.is_none_or(|(a, _)| angle < a)
            {
                inside = Some((angle, i));
            }
        }
        if let Some((_, i)) = inside {
            self.cones[i].absorb(sample);
            return;
        }
        // Case B: there is room for another cone.
        if usize::from(self.count) < most {
            self.push(sample);
            return;
        }
        while usize::from(self.count) > most {
            self.merge_closest(params);
        }
        let nearest = self
            .cones()
            .iter()
            .enumerate()
            .map(|(i, cone)| (distance(cone, sample, params), i))
            .fold((f32::INFINITY, 0), |best, next| if next.0 < best.0 { next } else { best });
        match self.closest_pair(params) {
            // Case D: two cones are closer to each other than the sample to any.
            Some((apart, _, _)) if apart <= nearest.0 => {
                self.merge_closest(params);
                self.push(sample);
            }
            // Case C: the nearest cone takes it.
            _ => self.cones[nearest.1].absorb(sample),
        }
    }

    /// Frees the places of cones that hardly count. Their energy is not lost: it goes to the nearest cone, which keeps its shape
    /// and its lights.
    pub(super) fn settle(&mut self, params: &MomentParams) {
        self.drop_dark();
        let least = luminance(self.energy()) * params.least_share.clamp(0.0, 0.1);
        let mut i = usize::from(self.count);
        while i > 0 && self.count > 1 {
            i -= 1;
            let cone = self.cones[i];
            if luminance(cone.energy) >= least {
                continue;
            }
            self.remove(i);
            let direction = cone.direction();
            // Of its own light, if there is one: what is seen of the other's would look like more.
            let away = |other: &MomentCone| {
                quick_angle(other.direction().dot(direction))
                    + if other.lights == cone.lights { 0.0 } else { 4.0 }
            };
            let heir = self
                .cones()
                .iter()
                .enumerate()
                .map(|(k, other)| (away(other), k))
                .fold((f32::INFINITY, 0), |best, next| if next.0 < best.0 { next } else { best });
            let heir = &mut self.cones[heir.1];
            let before = heir.fluence;
            heir.energy += cone.energy;
            heir.fluence += cone.fluence;
            heir.moment *= heir.fluence / before;
        }
    }

    /// Leaves out cones that decayed to nothing.
    pub(super) fn drop_dark(&mut self) {
        for i in (0..usize::from(self.count)).rev() {
            if luminance(self.cones[i].energy) < GONE {
                self.remove(i);
            }
        }
    }

    fn push(&mut self, cone: &MomentCone) {
        self.cones[usize::from(self.count)] = *cone;
        self.count += 1;
    }

    /// Takes a cone out; the others keep their order. What was hidden of its light stays with another cone of that.
    fn remove(&mut self, at: usize) {
        let count = usize::from(self.count);
        let gone = self.cones[at];
        let mut others = self.cones[..count]
            .iter_mut()
            .enumerate()
            .filter(|(k, other)| *k != at && other.lights == gone.lights);
        if let Some((_, other)) = others.next() {
            other.hidden += gone.hidden;
        }
        self.cones.copy_within(at + 1..count, at);
        self.cones[count - 1] = MomentCone::default();
        self.count -= 1;
    }

    /// The two cones that are closest, and how far they are apart.
    fn closest_pair(&self, params: &MomentParams) -> Option<(f32, usize, usize)> {
        let mut best: Option<(f32, usize, usize)> = None;
        for (i, a) in self.cones().iter().enumerate() {
            for (k, b) in self.cones().iter().enumerate().skip(i + 1) {
                let apart = distance(a, b, params);
                if best.is_none_or(|(d, _, _)| apart < d) {
                    best = Some((apart, i, k));
                }
            }
        }
        best
    }

    fn merge_closest(&mut self, params: &MomentParams) {
        if let Some((_, i, k)) = self.closest_pair(params) {
            let other = std::mem::take(&mut self.cones[k]);
            self.cones[i].absorb(&other);
            self.remove(k);
        }
    }
}

/// Angle by its cosine, radians, to 7 × 10⁻⁵ and five thousandths of a percent ([Abramowitz1964] 4.4.45): good enough to say which cone is nearer, and which holds a sample.
#[inline]
fn quick_angle(cosine: f32) -> f32 {
    let x = cosine.abs().min(1.0);
    let angle = (1.0 - x).sqrt() * (1.570_728_8 + x * (-0.212_114_4 + x * (0.074_261 - x * 0.018_729_3)));
    if cosine >= 0.0 { angle } else { std::f32::consts::PI - angle }
}

/// Angle between axes, radians, and more for cones without a common light.
fn distance(a: &MomentCone, b: &MomentCone, params: &MomentParams) -> f32 {
    let apart = params.tagged && !a.lights.meets(b.lights);
    quick_angle(a.direction().dot(b.direction())) + if apart { params.apart_rad } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::quick_angle;

    #[test]
    fn a_quick_angle_is_nearly_the_angle() {
        for i in -1000..=1000 {
            let cosine = i as f32 / 1000.0;
            let exact = libm::acosf(cosine);
            assert!((quick_angle(cosine) - exact).abs() < 8e-5, "{cosine}");
        }
        // Small angles by parts of themselves; and what rounding takes out of range.
        for angle in [1e-2f32, 0.1] {
            let miss = 2.0 * libm::sinf(0.5 * angle) * libm::sinf(0.5 * angle);
            assert!((quick_angle(1.0 - miss) / angle - 1.0).abs() < 2e-3, "{angle}");
        }
        assert_eq!((quick_angle(1.000_001), quick_angle(-1.5)), (0.0, std::f32::consts::PI));
    }
}
