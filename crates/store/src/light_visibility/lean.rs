//! Where on a light lies what is seen of it: two steps across it, in a frame that both ends make.

use glam::Vec3;

use super::OPEN;

/// Steps from the middle of a light to its rim.
pub const LEAN_STEPS: i8 = 4;

/// Where the middle of what is seen of a light lies, from the middle of all of it: along the two vectors of [`lean_frame`], in steps of a
/// [`LEAN_STEPS`]th of the sine of its angular radius, −[`LEAN_STEPS`] … [`LEAN_STEPS`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lean(pub [i8; 2]);

impl Lean {
    /// In the middle, or not known.
    pub const NONE: Lean = Lean([0, 0]);

    /// The nearest step of an offset in angular radii; what is no number counts as 0.
    pub fn quantized(radii: [f32; 2]) -> Lean {
        let most = f32::from(LEAN_STEPS);
        Lean(radii.map(|offset| (offset * most).round().clamp(-most, most) as i8))
    }

    /// In angular radii.
    pub fn radii(self) -> [f32; 2] {
        self.0.map(|step| f32::from(step) / f32::from(LEAN_STEPS))
    }

    /// As it may be beside a value: within its range, and nothing where all or nothing is seen.
    pub fn of_value(self, value: u8) -> Lean {
        if value == 0 || value >= OPEN {
            return Lean::NONE;
        }
        Lean(self.0.map(|step| step.clamp(-LEAN_STEPS, LEAN_STEPS)))
    }

    /// Whether the other is farther off than its neighbouring steps.
    pub fn is_far_from(self, other: Lean) -> bool {
        self.0.iter().zip(other.0).any(|(a, b)| a.abs_diff(b) > 1)
    }
}

/// What is seen of a light from a place between points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenLight {
    /// Share of the irradiance that arrives, 0 … 1.
    pub fraction: f32,
    /// Where the middle of it lies, as [`Lean::radii`].
    pub lean: [f32; 2],
}

impl SeenLight {
    /// All of it.
    pub const ALL: SeenLight = SeenLight::of(1.0);

    /// A share of it, with no side.
    pub const fn of(fraction: f32) -> SeenLight {
        SeenLight { fraction, lean: [0.0; 2] }
    }
}

/// Two unit vectors across a unit vector towards a light, which turn as little as can be while it turns: those across straight up, turned
/// with it the shortest way. So points beside each other have nearly the same, but for those straight above a light.
pub fn lean_frame(to_light: Vec3) -> [Vec3; 2] {
    let Vec3 { x, y, z } = to_light;
    let k = 1.0 / (1.0 + y).max(1e-4);
    [Vec3::new(1.0 - x * x * k, -x, -x * z * k), Vec3::new(-x * z * k, -z, 1.0 - z * z * k)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_stand_across_and_turn_with_the_light() {
        for i in 0..3990u32 {
            let (turn, y) = (i as f32 * 2.4, i as f32 / 2000.0 - 0.999);
            let r = (1.0 - y * y).sqrt();
            let axis = Vec3::new(r * turn.cos(), y, r * turn.sin());
            let [a, b] = lean_frame(axis);
            for (found, wanted) in [
                (a.length(), 1.0),
                (b.length(), 1.0),
                (a.dot(axis), 0.0),
                (b.dot(axis), 0.0),
                (a.dot(b), 0.0),
            ] {
                assert!((found - wanted).abs() < 2e-3, "{axis}: {found}, {wanted}");
            }
            assert!(y < 0.0 || (a - lean_frame((axis + Vec3::X * 0.01).normalize())[0]).length() < 0.02);
        }
        assert_eq!(lean_frame(Vec3::Y), [Vec3::X, Vec3::Z]);
        assert!(lean_frame(Vec3::NEG_Y).iter().all(|v| v.is_finite()));
    }

    #[test]
    fn offsets_are_rounded_and_bounded() {
        let of = |x, y| Lean::quantized([x, y]).0;
        assert_eq!([of(0.13, -0.12), of(0.9, -7.0), of(f32::NAN, 1.0)], [[1, 0], [4, -4], [0, 4]]);
        assert_eq!(Lean([2, -4]).radii(), [0.5, -1.0]);
        assert!(Lean([0, 2]).is_far_from(Lean([0, 0])) && !Lean([1, 1]).is_far_from(Lean([0, 2])));
    }
}
