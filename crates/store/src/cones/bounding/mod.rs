//! The paper's entry: bounding cones, grown by samples, shrunk and discarded by probes ([Stadlbauer2023] sec. 3.1).
//!
//! Takes samples of light at one place and what probes along the rims of its cones met; keeps up to eight cones. It is the
//! measured baseline; [`MomentEntry`](super::MomentEntry) is what Dapple itself uses.

mod cap;
mod insert;
mod probe;
#[cfg(test)]
mod tests;

use glam::Vec3;

use super::entry::{
    ConeEntry, ConeError, ConeSample, GONE, LEAST_ENERGY, angle_between, check_rules, luminance, unit,
};
pub use probe::Probe;

/// Most cones of a [`BoundingEntry`].
pub const MOST_BOUNDING_CONES: usize = 8;

/// How bounding cones are kept. What the paper gives no number for is marked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingParams {
    /// Cones of an entry, 1 … 8. Default 3 ([Stadlbauer2023] sec. 4).
    pub cones: u8,
    /// Most samples that an entry stands for, C_max, 1 … 255 (sec. 3.3: 8 bits). Default 255.
    pub max_samples: u16,
    /// C is only reduced where a cone turned by more than this, radians, 0 … π. Default 0.01 (no number in the paper).
    pub least_turn_rad: f32,
    /// C is only reduced where it is larger than this, 1 … 255. Default 8: the first update (no number in the paper).
    pub least_samples: u16,
    /// How far inside the rim a probe goes, as a share of the opening angle: ε, 0.001 … 1. Default 0.1 (no number in the paper).
    pub probe_inset: f32,
    /// Whether cones whose probe meets no light are dropped, with their energy, if they are small. Default true, as in sec. 3.1.2;
    /// it costs 2 % of all light.
    pub discard: bool,
    /// What is small, radians, 0 … π. Default 0.02 (no number in the paper).
    pub small_rad: f32,
}

impl Default for BoundingParams {
    fn default() -> Self {
        BoundingParams {
            cones: 3,
            max_samples: 255,
            least_turn_rad: 0.01,
            least_samples: 8,
            probe_inset: 0.1,
            discard: true,
            small_rad: 0.02,
        }
    }
}

impl BoundingParams {
    /// Whether all parameters are in range.
    ///
    /// # Errors
    ///
    /// The first that is not.
    pub fn check(&self) -> Result<(), ConeError> {
        let angles = 0.0..=std::f32::consts::PI;
        let counts = 1..=255;
        check_rules([
            ("cones", f64::from(self.cones), (1..=8).contains(&self.cones), "it must be 1 to 8"),
            (
                "max_samples",
                f64::from(self.max_samples),
                counts.contains(&self.max_samples),
                "it must be 1 to 255",
            ),
            (
                "least_turn_rad",
                f64::from(self.least_turn_rad),
                angles.contains(&self.least_turn_rad),
                "it must be 0 to \u{3c0}",
            ),
            (
                "least_samples",
                f64::from(self.least_samples),
                counts.contains(&self.least_samples),
                "it must be 1 to 255",
            ),
            (
                "probe_inset",
                f64::from(self.probe_inset),
                (0.001..=1.0).contains(&self.probe_inset),
                "it must be 0.001 to 1",
            ),
            (
                "small_rad",
                f64::from(self.small_rad),
                angles.contains(&self.small_rad),
                "it must be 0 to \u{3c0}",
            ),
        ])
    }
}

/// One cone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoundingCone {
    /// Unit vector along the axis: D.
    pub direction: Vec3,
    /// Opening angle, axis to rim, radians, 0 … π: α.
    pub angle: f32,
    /// Energy that arrives through the cone: fluence, W/m². It is what makes the sum of sec. 3.2 hold: there, the
    /// cone's size cancels.
    pub energy: Vec3,
}

/// What happened to the axes in one update, and whether C was reduced for it: that happens once an update.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cycle {
    /// Largest turn of an axis so far, radians.
    pub turned_rad: f32,
    /// Whether C was reduced.
    pub reduced: bool,
}

/// What one place holds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoundingEntry {
    cones: [BoundingCone; MOST_BOUNDING_CONES],
    count: u8,
    samples: u16,
    taken: u32,
}

impl BoundingEntry {
    /// An entry of given cones (the first eight count; those without energy, without direction, or whose numbers are not finite, are left
    /// out) that stands for `samples` samples and has taken `taken` in its life.
    pub fn from_parts(cones: &[BoundingCone], samples: u16, taken: u32) -> BoundingEntry {
        let mut entry = BoundingEntry { samples, taken, ..BoundingEntry::default() };
        for cone in cones.iter().take(MOST_BOUNDING_CONES) {
            let valid = cone.energy.is_finite() && cone.energy.min_element() >= 0.0 && cone.angle.is_finite();
            if let Some(direction) = unit(cone.direction)
                && valid
                && luminance(cone.energy) >= LEAST_ENERGY
            {
                let angle = cone.angle.clamp(0.0, std::f32::consts::PI);
                entry.push(&BoundingCone { direction, angle, energy: cone.energy });
            }
        }
        entry
    }

    /// Its cones; none where it is dark.
    pub fn cones(&self) -> &[BoundingCone] {
        &self.cones[..usize::from(self.count)]
    }

    /// Samples that it stands for: C.
    pub fn samples(&self) -> u16 {
        self.samples
    }

    /// Samples drawn in its life, modulo 2³². Reducing C leaves it.
    pub fn taken(&self) -> u32 {
        self.taken
    }

    /// Energy of all cones.
    pub fn energy(&self) -> Vec3 {
        self.cones().iter().fold(Vec3::ZERO, |sum, cone| sum + cone.energy)
    }

    /// Takes the samples of one update (sec. 3.1.1): `drawn` were drawn, of which those in `samples` reached a light. With N drawn
    /// and C counting them, L_new = L_old · (1 − N/C) + N/C · (sum of a cone's samples) / N for every cone. Then C is reduced, if
    /// a cone turned.
    ///
    /// Parameters out of range act as the nearest that is not. `drawn` is at least the number of samples.
    pub fn update(&mut self, samples: &[ConeSample], drawn: u32, params: &BoundingParams) -> Cycle {
        let mut cycle = Cycle::default();
        let drawn = drawn.max(u32::try_from(samples.len()).unwrap_or(u32::MAX));
        if drawn == 0 {
            return cycle;
        }
        let weight = 1.0 / (f32::from(self.samples) + drawn as f32);
        let kept = f32::from(self.samples) * weight;
        for cone in &mut self.cones[..usize::from(self.count)] {
            cone.energy *= kept;
        }
        for sample in samples {
            if let Some((value, direction)) = sample.usable() {
                let cone = BoundingCone { direction, angle: 0.0, energy: value * weight };
                cycle.turned_rad = cycle.turned_rad.max(self.insert(&cone, params));
            }
        }
        let most = u32::from(params.max_samples.max(1));
        self.samples = (u32::from(self.samples).saturating_add(drawn)).min(most) as u16;
        self.taken = self.taken.wrapping_add(drawn);
        self.drop_dark();
        self.reduce(&mut cycle, params);
        cycle
    }

    /// Reduces C once an update, if an axis turned: C / min(max(1 + a · 0.05, 1.01), 3), a in degrees (sec. 3.1.1).
    fn reduce(&mut self, cycle: &mut Cycle, params: &BoundingParams) {
        if cycle.reduced || cycle.turned_rad <= params.least_turn_rad || self.samples <= params.least_samples
        {
            return;
        }
        let divisor = reduction(cycle.turned_rad.to_degrees());
        self.samples = ((f32::from(self.samples) / divisor) as u16).max(1);
        cycle.reduced = true;
    }

    fn push(&mut self, cone: &BoundingCone) {
        self.cones[usize::from(self.count)] = *cone;
        self.count += 1;
    }

    /// Takes a cone out; the others keep their order.
    fn remove(&mut self, at: usize) {
        let count = usize::from(self.count);
        self.cones.copy_within(at + 1..count, at);
        self.cones[count - 1] = BoundingCone::default();
        self.count -= 1;
    }

    fn drop_dark(&mut self) {
        for i in (0..usize::from(self.count)).rev() {
            if luminance(self.cones[i].energy) < GONE {
                self.remove(i);
            }
        }
    }
}

/// What C is divided by when a cone turned by so many degrees ([Stadlbauer2023] sec. 3.1.1).
pub fn reduction(turned_degrees: f32) -> f32 {
    (1.0 + turned_degrees * 0.05).clamp(1.01, 3.0)
}

impl ConeEntry for BoundingEntry {
    fn confidence(&self) -> u16 {
        self.samples
    }

    fn cut_confidence(&mut self, most: u16) {
        self.samples = self.samples.min(most);
    }
}
