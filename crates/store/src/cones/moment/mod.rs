//! Moment cones: each cone is an energy and the mean of its directions, so that merging is a sum and shrinking is decay.
//!
//! Takes samples of light at one place; keeps up to four cones whose energies add up to the mean of all samples, whatever
//! the cones are.

mod insert;
#[cfg(test)]
mod tests;

use glam::Vec3;

use super::entry::{
    ConeEntry, ConeError, ConeSample, GONE, LEAST_ENERGY, MOST_ENERGY, check_rules, luminance, unit,
};
use super::lights::LightSet;

/// Most cones of a [`MomentEntry`].
pub const MOST_MOMENT_CONES: usize = 4;

/// Mean cosine of a cone's light below which it is taken to be this: keeps what gloss there is of grazing light within bounds.
const LEAST_COSINE: f32 = 1.0 / 4096.0;

/// Samples of a light that an entry should stand for before it tells how much of the light is seen.
const LEAST_TAKEN: f32 = 1.0;

/// Samples of a light that an entry should stand for before it is believed that all were hidden of which none was seen: fewer may have been none.
const LEAST_HIDDEN: f32 = 4.0;

/// How moment cones are kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MomentParams {
    /// Cones of an entry, 1 … 4. Default 3 ([Stadlbauer2023] sec. 4). Where tens of lights matter, one more is worth 0.7 dB, and takes 7 % longer where few do.
    pub cones: u8,
    /// A sample is inside a cone up to this many times its opening angle from the axis, 0.5 … 4. Default 1.6.
    pub inside: f32,
    /// Most samples that an entry stands for, C_max, 1 … 4095. Default 255.
    pub max_samples: u16,
    /// A cone with less than this share of its entry's energy gives up its place, 0 … 0.1. Default 0.001.
    pub least_share: f32,
    /// Whether cones of different lights stay apart where there is room. Default true.
    pub tagged: bool,
    /// With `tagged`, cones without a common light count as this much further from each other, radians, 0 … π. Default 0.5.
    pub apart_rad: f32,
}

impl Default for MomentParams {
    fn default() -> Self {
        MomentParams {
            cones: 3,
            inside: 1.6,
            max_samples: 255,
            least_share: 0.001,
            tagged: true,
            apart_rad: 0.5,
        }
    }
}

impl MomentParams {
    /// Whether all parameters are in range.
    ///
    /// # Errors
    ///
    /// The first that is not.
    pub fn check(&self) -> Result<(), ConeError> {
        let (inside, share, apart) =
            (f64::from(self.inside), f64::from(self.least_share), f64::from(self.apart_rad));
        check_rules([
            ("cones", f64::from(self.cones), (1..=4).contains(&self.cones), "it must be 1 to 4"),
            ("inside", inside, (0.5..=4.0).contains(&inside), "it must be 0.5 to 4"),
            (
                "max_samples",
                f64::from(self.max_samples),
                (1..=4095).contains(&self.max_samples),
                "it must be 1 to 4095",
            ),
            ("least_share", share, (0.0..=0.1).contains(&self.least_share), "it must be 0 to 0.1"),
            (
                "apart_rad",
                apart,
                (0.0..=std::f32::consts::PI).contains(&self.apart_rad),
                "it must be 0 to \u{3c0}",
            ),
        ])
    }
}

/// One cone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MomentCone {
    /// Energy that arrives through the cone: irradiance, W/m² (or fluence, if the samples were).
    pub energy: Vec3,
    /// Luminance of the light that arrives, whatever its cosine, W/m²: not less than the energy's.
    pub fluence: f32,
    /// Mean of that × direction over all samples, W/m². Not longer than `fluence`, but for rounding.
    pub moment: Vec3,
    /// Where the energy came from.
    pub lights: LightSet,
    /// Luminance of what would arrive, too, of its light if nothing stood in the way, W/m²: of samples that something hid.
    pub hidden: f32,
    /// What arrives through it of all that would arrive of its light if nothing stood in the way, above 0 and up to 1: E / (E + what was hidden), which
    /// is certain as soon as nothing hides it, however few samples there are. 0 where that is not known: of cones of several lights, of lights that have
    /// a part in one, and where too few samples were to be of the light.
    pub seen: f32,
}

impl MomentCone {
    /// Unit vector along the cone's axis: the mean direction of its light. +Z where opposite directions cancel.
    #[inline]
    pub fn direction(&self) -> Vec3 {
        unit(self.moment).unwrap_or(Vec3::Z)
    }

    /// Cosine of the opening angle (axis to rim), −1 … 1: that of the cap which, evenly bright, has the same moment, for which
    /// |m| / Φ = (1 + cos a) / 2.
    #[inline]
    pub fn cos_angle(&self) -> f32 {
        if self.fluence < GONE {
            return 1.0;
        }
        (2.0 * self.moment.length() / self.fluence - 1.0).clamp(-1.0, 1.0)
    }

    /// [`MomentCone::direction`] and [`MomentCone::cos_angle`], with one root.
    #[inline]
    pub fn axis(&self) -> (Vec3, f32) {
        let length = self.moment.length();
        if self.fluence < GONE || !(1e-17..1e17).contains(&length) {
            return (self.direction(), self.cos_angle());
        }
        (self.moment / length, (2.0 * length / self.fluence - 1.0).clamp(-1.0, 1.0))
    }

    /// Opening angle, axis to rim, radians, 0 … π.
    pub fn angle(&self) -> f32 {
        libm::acosf(self.cos_angle())
    }

    /// A cone with a given axis (unit vector), cosine of the opening angle, energy, and mean cosine of its light: luminance of the energy ÷
    /// fluence, above 0 (less than 2⁻¹² counts as that) and up to 1.
    pub fn from_cap(
        direction: Vec3,
        cos_angle: f32,
        energy: Vec3,
        mean_cosine: f32,
        lights: LightSet,
    ) -> MomentCone {
        let fluence = luminance(energy) / mean_cosine.clamp(LEAST_COSINE, 1.0);
        let length = fluence * 0.5 * (1.0 + cos_angle.clamp(-1.0, 1.0));
        MomentCone { energy, fluence, moment: direction * length, lights, ..MomentCone::default() }
    }

    /// Luminance of the energy ÷ fluence, 2⁻¹² … 1: with irradiance, the mean cosine of the light.
    #[inline]
    pub fn mean_cosine(&self) -> f32 {
        if self.fluence < GONE {
            return 1.0;
        }
        (luminance(self.energy) / self.fluence).clamp(LEAST_COSINE, 1.0)
    }

    fn scale(&mut self, factor: f32) {
        self.energy *= factor;
        self.fluence *= factor;
        self.moment *= factor;
        self.hidden *= factor;
    }

    /// Turns and scales it after its lights. Returns whether it did.
    fn follow(&mut self, aim: &ReAim) -> bool {
        let (Some(from), Some(to)) = (unit(aim.from), unit(aim.to)) else { return false };
        let valid = |ratio: f32| ratio.is_finite() && ratio >= 0.0;
        if ![aim.energy_ratio, aim.fluence_ratio, aim.size_ratio, aim.most_cosine].into_iter().all(valid) {
            return false;
        }
        let (axis, cos_angle) = self.axis();
        let direction = turn(axis, from, to);
        // The solid angle goes with the square of the size.
        let cos_angle = 1.0 - ((1.0 - cos_angle) * aim.size_ratio * aim.size_ratio).min(2.0);
        let fluence = (self.fluence * aim.fluence_ratio).min(MOST_ENERGY);
        let most = fluence * aim.most_cosine.min(1.0);
        let factor = aim.energy_ratio.min(most / luminance(self.energy).max(LEAST_ENERGY));
        let energy = (self.energy * factor).min(Vec3::splat(MOST_ENERGY));
        let cosine = if fluence > 0.0 { luminance(energy) / fluence } else { 1.0 };
        let hidden = (self.hidden * factor).min(MOST_ENERGY);
        *self = MomentCone {
            hidden,
            seen: self.seen,
            ..MomentCone::from_cap(direction, cos_angle, energy, cosine, self.lights)
        };
        true
    }

    fn absorb(&mut self, other: &MomentCone) {
        self.energy += other.energy;
        self.fluence += other.fluence;
        self.moment += other.moment;
        self.hidden += other.hidden;
        self.lights = self.lights.union(other.lights);
    }
}

/// A sample that something hid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HiddenSample {
    /// Index of the light.
    pub light: u32,
    /// Luminance of what the sample would have been worth, W/m².
    pub value: f32,
}

/// New places of lights as seen from an entry: see [`MomentEntry::re_aim`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReAim {
    /// Unit vector towards their centre before.
    pub from: Vec3,
    /// Unit vector towards their centre now.
    pub to: Vec3,
    /// Unoccluded energy now ÷ before, ≥ 0.
    pub energy_ratio: f32,
    /// The same of fluence.
    pub fluence_ratio: f32,
    /// Largest cosine of their light to the entry's surface now, 0 … 1: more of its fluence is never irradiance. 1 where energies are fluence.
    pub most_cosine: f32,
    /// Their apparent radius now ÷ before, ≥ 0: a cone's solid angle goes with the square.
    pub size_ratio: f32,
}

/// What one place holds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MomentEntry {
    cones: [MomentCone; MOST_MOMENT_CONES],
    count: u8,
    samples: u16,
    taken: u32,
}

impl MomentEntry {
    /// An entry of given cones (the first four count; those without energy, or whose numbers are not finite, are left out) that
    /// stands for `samples` samples and has taken `taken` in its life.
    pub fn from_parts(cones: &[MomentCone], samples: u16, taken: u32) -> MomentEntry {
        let mut entry = MomentEntry { samples, taken, ..MomentEntry::default() };
        for cone in cones.iter().take(MOST_MOMENT_CONES) {
            let valid = cone.energy.is_finite()
                && cone.moment.is_finite()
                && (0.0..=MOST_ENERGY).contains(&cone.hidden)
                && (0.0..=1.0).contains(&cone.seen)
                && cone.fluence.is_finite()
                && cone.energy.min_element() >= 0.0;
            if valid && luminance(cone.energy) >= LEAST_ENERGY {
                entry.cones[usize::from(entry.count)] = *cone;
                entry.count += 1;
            }
        }
        entry
    }

    /// Its cones; none where it is dark.
    #[inline]
    pub fn cones(&self) -> &[MomentCone] {
        &self.cones[..usize::from(self.count)]
    }

    /// How much is seen of the light of a cone through all of its cones, up to 1; 0 where that is not known.
    #[inline]
    pub fn seen_of(&self, lights: LightSet) -> f32 {
        self.cones().iter().filter(|cone| cone.lights == lights).map(|cone| cone.seen).sum()
    }

    /// Samples that it stands for: C.
    pub fn samples(&self) -> u16 {
        self.samples
    }

    /// Samples drawn in its life, modulo 2³²: the index of its next one in a low-discrepancy sequence. Cutting C leaves it.
    pub fn taken(&self) -> u32 {
        self.taken
    }

    /// Energy of all cones.
    pub fn energy(&self) -> Vec3 {
        self.cones().iter().fold(Vec3::ZERO, |sum, cone| sum + cone.energy)
    }

    /// [`MomentEntry::update_seen`] where nothing is known of what was hidden.
    pub fn update(&mut self, samples: &[ConeSample], drawn: u32, params: &MomentParams) {
        self.update_seen(samples, &[], drawn, |_| 0.0, params);
    }

    /// Takes the samples of one update: `drawn` were drawn, of which those in `samples` reached a light; the others are zeros, among them those
    /// that something `hidden` from the place. With N drawn, β = N / (C + N) and
    ///
    /// E ← (1 − β) E + β/N Σ x, Φ ← (1 − β) Φ + β/N Σ φ, m ← (1 − β) m + β/N Σ φ w with φ = lum(x) / cosine, C ← min(C + N, C_max)
    ///
    /// for every cone, over the samples that went to it. So the energies of all cones add up to the mean of all samples (with
    /// C at its limit, a mean that forgets), to rounding, in whatever order they come. What was hidden is kept in the same way beside E.
    ///
    /// `picked` is how likely a sample is to be one of a light: where one or more of those that the entry stands for should be, it is known how much of it
    /// is seen. It must not go by how many were: that would leave out the darkest.
    ///
    /// Parameters out of range act as the nearest that is not. `drawn` is at least the number of samples, hidden ones too.
    pub fn update_seen(
        &mut self,
        samples: &[ConeSample],
        hidden: &[HiddenSample],
        drawn: u32,
        picked: impl Fn(u32) -> f32,
        params: &MomentParams,
    ) {
        let drawn = drawn.max(u32::try_from(samples.len() + hidden.len()).unwrap_or(u32::MAX));
        if drawn == 0 {
            return;
        }
        let weight = 1.0 / (f32::from(self.samples) + drawn as f32);
        let kept = f32::from(self.samples) * weight;
        for cone in &mut self.cones[..usize::from(self.count)] {
            cone.scale(kept);
        }
        let before: [LightSet; MOST_MOMENT_CONES] = std::array::from_fn(|i| self.cones[i].lights);
        // Those that nothing is left of take no samples in: they have no direction, and are of lights that were.
        self.drop_dark();
        for sample in samples {
            if let Some((value, direction)) = sample.usable() {
                let value = value * weight;
                let fluence = luminance(value) / sample.cosine.clamp(LEAST_COSINE, 1.0);
                let moment = direction * fluence;
                let lights = LightSet::one(sample.light);
                let cone = MomentCone { energy: value, fluence, moment, lights, ..MomentCone::default() };
                self.insert(&cone, direction, sample.light, params);
            }
        }
        for i in 0..usize::from(self.count) {
            let lights = self.cones[i].lights;
            // Of several cones of a light, the first keeps what was hidden of it.
            let is_first = self.cones[..i].iter().all(|cone| cone.lights != lights);
            let Some(light) = lights.single().filter(|_| is_first) else { continue };
            let of_light = hidden.iter().filter(|sample| sample.light == light && sample.value.is_finite());
            let now = of_light.map(|sample| sample.value.clamp(0.0, MOST_ENERGY)).sum::<f32>() * weight;
            self.cones[i].hidden += now;
            let likely = picked(light) * f32::from(self.samples);
            if likely >= LEAST_HIDDEN && !before.iter().any(|lights| lights.may_hold(light)) {
                // Some of the samples before were of it, and none was seen: all were hidden, and worth what these are.
                let mine = |of: u32| u32::from(of == light);
                let seen = samples
                    .iter()
                    .filter(|s| s.light == light)
                    .map(|s| luminance(s.value))
                    .filter(|v| v.is_finite());
                let seen: f32 = seen.map(|value| value.clamp(0.0, MOST_ENERGY)).sum::<f32>() * weight;
                let count = samples.iter().map(|s| mine(s.light)).chain(hidden.iter().map(|s| mine(s.light)));
                self.cones[i].hidden += likely * (seen + now) / count.sum::<u32>().max(1) as f32;
            }
        }
        let most = u32::from(params.max_samples.max(1));
        self.samples = (u32::from(self.samples).saturating_add(drawn)).min(most) as u16;
        self.taken = self.taken.wrapping_add(drawn);
        self.settle(params);
        for i in 0..usize::from(self.count) {
            self.cones[i].seen = self.seen(&self.cones[i], &picked).unwrap_or(0.0);
        }
    }

    /// [`MomentCone::seen`] of one of the cones.
    fn seen(&self, cone: &MomentCone, picked: impl Fn(u32) -> f32) -> Option<f32> {
        let light = cone.lights.single()?;
        let mut all = 0.0;
        for other in self.cones() {
            if other.lights == cone.lights {
                all += luminance(other.energy) + other.hidden;
            } else if other.lights.may_hold(light) {
                return None;
            }
        }
        let is_known = picked(light) * f32::from(self.samples) >= LEAST_TAKEN && all > 0.0;
        is_known.then(|| (luminance(cone.energy) / all).min(1.0))
    }

    /// Moves on in its sequence to sample `taken`, of a group of entries that take theirs together from there on.
    pub fn skip_to(&mut self, taken: u32) {
        self.taken = taken;
    }

    /// Brings C down to `most`, so that what comes next counts for more.
    pub fn cut_confidence(&mut self, most: u16) {
        self.samples = self.samples.min(most);
    }

    /// Whether a light may have a part in it.
    pub fn may_hold(&self, light: u32) -> bool {
        self.cones().iter().any(|cone| cone.lights.may_hold(light))
    }

    /// Follows lights that moved: cones of just these turn with them and take their new energy and size. What is hidden of them is taken to stay the same
    /// share. Returns how many cones did; the others stay. Arguments that are not finite, or negative, change nothing.
    ///
    /// The ratio of energies of a light that comes up from the horizon has no bound, and what the cone has of it may have been light of another part of
    /// it than the ratio is of: E is at most Φ × [`ReAim::most_cosine`].
    pub fn re_aim(&mut self, lights: LightSet, aim: &ReAim) -> usize {
        let mut turned = 0;
        for cone in &mut self.cones[..usize::from(self.count)] {
            if cone.lights == lights {
                turned += usize::from(cone.follow(aim));
            }
        }
        self.drop_dark();
        turned
    }
}

impl ConeEntry for MomentEntry {
    #[inline]
    fn confidence(&self) -> u16 {
        self.samples
    }

    fn cut_confidence(&mut self, most: u16) {
        MomentEntry::cut_confidence(self, most);
    }
}

/// Turns a unit vector as the shortest turn takes `from` to `to` (unit vectors).
fn turn(v: Vec3, from: Vec3, to: Vec3) -> Vec3 {
    let cosine = from.dot(to);
    if cosine < -0.9999 {
        // Any axis across will do: half a turn about it.
        let axis = from.any_orthonormal_vector();
        return axis * (2.0 * axis.dot(v)) - v;
    }
    let axis = from.cross(to);
    (v * cosine + axis.cross(v) + axis * (axis.dot(v) / (1.0 + cosine))).normalize_or(to)
}
