//! What all kinds of entries have in common: samples of light, luminance, confidence.

use glam::Vec3;

/// Largest component of a sample that is believed, in the sample's unit; what is brighter counts as this.
pub const MOST_ENERGY: f32 = 1e15;

/// An entry whose energy is below this, in the samples' unit, is dark. It is what keeps squares in the range of a float.
pub(super) const LEAST_ENERGY: f32 = 1e-12;

/// Cosine that light above the surface of an entry counts with at least in its irradiance ([`ConeSample::cosine`]). Pixels that read the entry may face light
/// which its own bump faces away from; and what grazes it would weigh as little as it is bright in a mirror.
pub const GRAZING_COSINE: f32 = 0.05;

/// A cone that decayed below this is gone.
pub(super) const GONE: f32 = 1e-14;

/// A sample of light that reached a place: x_i, with its direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConeSample {
    /// Unit vector towards the light, in the space that the entry's directions are in.
    pub direction: Vec3,
    /// The sample's estimate, red, green and blue, ≥ 0: radiance × visibility ÷ density per steradian, W/m² (*fluence*), and
    /// for the ratio form × the cosine at the surface (*irradiance*). What is not finite counts as nothing.
    pub value: Vec3,
    /// Index of the light.
    pub light: u32,
    /// Cosine that is in `value`, 0 … 1 (above 0); 1 where that is fluence.
    pub cosine: f32,
}

impl ConeSample {
    /// The value and the unit direction, or nothing where there is no light in the sample or it has no direction.
    pub(super) fn usable(&self) -> Option<(Vec3, Vec3)> {
        let value = self.value.max(Vec3::ZERO).min(Vec3::splat(MOST_ENERGY));
        if !self.value.is_finite() || luminance(value) < LEAST_ENERGY {
            return None;
        }
        Some((value, unit(self.direction)?))
    }
}

/// An entry of the cache, of any kind.
pub trait ConeEntry: Clone + Default + Send + Sync {
    /// Samples that the entry stands for: C. 0 for one that was never updated.
    fn confidence(&self) -> u16;

    /// Brings C down to `most`, so that what comes next counts for more.
    fn cut_confidence(&mut self, most: u16);
}

/// Why there are no cones.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConeError {
    /// A parameter is out of range.
    #[error("cones: {name} is {value}; {rule}")]
    BadParameter {
        /// Which.
        name: &'static str,
        /// What it was.
        value: f64,
        /// What it must be.
        rule: &'static str,
    },
}

/// A parameter, its value, whether its rule holds, and the rule.
pub(super) type Rule = (&'static str, f64, bool, &'static str);

/// The first rule that does not hold, as an error.
pub(super) fn check_rules(rules: impl IntoIterator<Item = Rule>) -> Result<(), ConeError> {
    match rules.into_iter().find(|(_, _, holds, _)| !holds) {
        Some((name, value, _, rule)) => Err(ConeError::BadParameter { name, value, rule }),
        None => Ok(()),
    }
}

/// Luminance of linear red, green and blue (Rec. 709).
#[inline]
pub fn luminance(colour: Vec3) -> f32 {
    0.2126 * colour.x + 0.7152 * colour.y + 0.0722 * colour.z
}

/// A vector's direction, unless its length is out of all measure: squares of very small numbers lose their bits.
pub(super) fn unit(v: Vec3) -> Option<Vec3> {
    let length_squared = v.length_squared();
    (1e-34..1e34).contains(&length_squared).then(|| v / length_squared.sqrt())
}

/// Angle between unit vectors, radians.
#[inline]
pub(super) fn angle_between(a: Vec3, b: Vec3) -> f32 {
    libm::acosf(a.dot(b).clamp(-1.0, 1.0))
}
