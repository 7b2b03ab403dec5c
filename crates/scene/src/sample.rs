//! Values of animation channels at one time (glTF 2.0, Appendix C "Animation Sampler Interpolation Modes").

use glam::{Quat, Vec3};

use crate::{Channel, Interpolation};

/// Two neighbouring keys and where between them a time lies.
struct Span {
    from: usize,
    to: usize,
    /// 0 at `from` … 1 at `to`.
    fraction: f32,
    /// Seconds between the keys.
    seconds: f32,
}

impl Channel {
    /// Numbers of one key: 3, 4, or the number of morph targets.
    fn width(&self) -> usize {
        let per_key = self.values.len() / self.times.len().max(1);
        if self.interpolation == Interpolation::CubicSpline { per_key / 3 } else { per_key }
    }

    /// Before the first key the first holds, after the last the last.
    fn span(&self, time: f64) -> Span {
        let after = self.times.partition_point(|t| f64::from(*t) <= time);
        let last = self.times.len().saturating_sub(1);
        if after == 0 || after > last {
            let key = if after == 0 { 0 } else { last };
            return Span { from: key, to: key, fraction: 0.0, seconds: 0.0 };
        }
        let (t0, t1) = (f64::from(self.times[after - 1]), f64::from(self.times[after]));
        let fraction = ((time - t0) / (t1 - t0)) as f32;
        Span { from: after - 1, to: after, fraction, seconds: (t1 - t0) as f32 }
    }

    /// The numbers of one key; `part` is 0 in-tangent, 1 value, 2 out-tangent for splines, and 1 otherwise.
    fn key(&self, key: usize, part: usize) -> &[f32] {
        let width = self.width();
        let first = match self.interpolation {
            Interpolation::CubicSpline => (3 * key + part) * width,
            Interpolation::Step | Interpolation::Linear => key * width,
        };
        &self.values[first..first + width]
    }

    fn component(&self, span: &Span, c: usize) -> f32 {
        let (from, to, t) = (self.key(span.from, 1)[c], self.key(span.to, 1)[c], span.fraction);
        match self.interpolation {
            Interpolation::Step => from,
            Interpolation::Linear => from + (to - from) * t,
            Interpolation::CubicSpline => {
                let out_tangent = span.seconds * self.key(span.from, 2)[c];
                let in_tangent = span.seconds * self.key(span.to, 0)[c];
                let (t2, t3) = (t * t, t * t * t);
                (2.0 * t3 - 3.0 * t2 + 1.0) * from
                    + (t3 - 2.0 * t2 + t) * out_tangent
                    + (3.0 * t2 - 2.0 * t3) * to
                    + (t3 - t2) * in_tangent
            }
        }
    }

    /// The value of a translation or scale channel at `time` (seconds).
    pub(crate) fn vec3(&self, time: f64) -> Vec3 {
        let span = self.span(time);
        Vec3::new(self.component(&span, 0), self.component(&span, 1), self.component(&span, 2))
    }

    /// The value of a rotation channel at `time` (seconds), a unit quaternion. Linear is spherical, the short way.
    pub(crate) fn quat(&self, time: f64) -> Quat {
        let span = self.span(time);
        let rotation = match self.interpolation {
            Interpolation::Step => Quat::from_slice(self.key(span.from, 1)),
            Interpolation::Linear => {
                let (from, to) = (self.key(span.from, 1), self.key(span.to, 1));
                Quat::from_slice(from).slerp(Quat::from_slice(to), span.fraction)
            }
            Interpolation::CubicSpline => Quat::from_array(std::array::from_fn(|c| self.component(&span, c))),
        };
        let length = rotation.length();
        if length > 0.0 && length.is_finite() { rotation / length } else { Quat::IDENTITY }
    }

    /// The values of a morph weight channel at `time` (seconds).
    pub(crate) fn weights(&self, time: f64) -> Vec<f32> {
        let span = self.span(time);
        (0..self.width()).map(|c| self.component(&span, c)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ChannelTarget;

    fn channel(interpolation: Interpolation, times: &[f32], values: &[f32]) -> Channel {
        let target = ChannelTarget::Translation;
        Channel { node: 0, target, interpolation, times: times.to_vec(), values: values.to_vec() }
    }

    #[test]
    fn step_holds_the_last_key() {
        let c = channel(Interpolation::Step, &[1.0, 2.0], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        for (time, x) in [(0.0, 1.0), (1.0, 1.0), (1.999, 1.0), (2.0, 4.0), (9.0, 4.0)] {
            assert_eq!(c.vec3(time).x, x, "at {time}");
        }
    }

    #[test]
    fn linear_is_straight_and_clamped() {
        let c = channel(Interpolation::Linear, &[1.0, 3.0], &[0.0, 0.0, 0.0, 8.0, -4.0, 2.0]);
        assert_eq!(c.vec3(1.5), Vec3::new(2.0, -1.0, 0.5));
        assert_eq!(c.vec3(0.0), Vec3::ZERO);
        assert_eq!(c.vec3(4.0), Vec3::new(8.0, -4.0, 2.0));
    }

    #[test]
    fn cubic_follows_hermite() {
        // x(t) = t³ on [1, 3]: value and derivative 3t² at the keys determine it completely.
        let key = |t: f32| [3.0 * t * t, 0.0, 0.0, t * t * t, 0.0, 0.0, 3.0 * t * t, 0.0, 0.0];
        let values: Vec<f32> = key(1.0).into_iter().chain(key(3.0)).collect();
        let c = channel(Interpolation::CubicSpline, &[1.0, 3.0], &values);
        for time in [1.0, 1.25, 2.0, 2.9, 3.0] {
            assert!((f64::from(c.vec3(time).x) - time * time * time).abs() < 1e-5, "at {time}");
        }
    }

    #[test]
    fn slerp_takes_the_short_way_at_constant_speed() {
        let (a, b) = (Quat::IDENTITY, -Quat::from_rotation_y(1.2));
        let values: Vec<f32> = a.to_array().into_iter().chain(b.to_array()).collect();
        let c = channel(Interpolation::Linear, &[0.0, 1.0], &values);
        for time in [0.0, 0.25, 0.5, 1.0] {
            let expected = Quat::from_rotation_y(1.2 * time as f32);
            let found = c.quat(time);
            assert!(found.is_normalized());
            assert!(found.dot(expected).abs() > 1.0 - 1e-6, "at {time}: {found} instead of {expected}");
        }
    }

    #[test]
    fn cubic_rotation_is_normalized() {
        let q = Quat::from_rotation_x(0.5).to_array();
        let mut values = vec![0.0; 24];
        values[4..8].copy_from_slice(&Quat::IDENTITY.to_array());
        values[16..20].copy_from_slice(&q);
        let c = channel(Interpolation::CubicSpline, &[0.0, 1.0], &values);
        let middle = c.quat(0.5);
        assert!(middle.is_normalized());
        assert!(middle.angle_between(Quat::from_rotation_x(0.25)) < 1e-3);
    }
}
