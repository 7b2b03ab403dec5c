//! Which light to look at.

use std::f32::consts::PI;

use glam::Vec3;

use super::{AreaLights, luminance, shape::Shape};

/// How the light of a sample is picked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pick {
    /// All alike.
    Uniform,
    /// In proportion to their power, wherever one is ([Stadlbauer2023]'s).
    Power,
    /// In proportion to an estimate of the irradiance that would arrive at the place if nothing stood between, and in a quarter to a half of cases any
    /// of those that can arrive: what of a weak light arrives may be mirrored, and outshine the rest.
    #[default]
    Fluence,
}

/// Share of picks by fluence that may be any of so many lights: a half of few, a quarter of many, of which most hardly matter.
fn any_of(count: u32) -> f32 {
    (0.25 + 1.0 / count as f32).min(0.5)
}

/// How a place faces the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facing {
    /// Unit normal that light is by the cosine to. Zero in the open: all around is seen, with a cosine of 1.
    pub normal_world: Vec3,
    /// Unit normal of the surface itself, which may lie otherwise under its bumps.
    pub ground_world: Vec3,
    /// Cosine that light above the surface counts with at least, 0 … 1. 0: what `normal_world` faces away from does not count.
    pub least_cosine: f32,
}

impl From<Vec3> for Facing {
    /// By the cosine to a unit normal alone.
    fn from(normal_world: Vec3) -> Facing {
        Facing { normal_world, ground_world: normal_world, least_cosine: 0.0 }
    }
}

impl Facing {
    /// What light from a direction (unit vector) counts with; not above 0 if the place faces away from it.
    #[inline]
    pub fn cosine(&self, to_light_world: Vec3) -> f32 {
        if self.normal_world == Vec3::ZERO {
            return 1.0;
        }
        let cosine = self.normal_world.dot(to_light_world);
        let is_above = cosine < self.least_cosine && self.ground_world.dot(to_light_world) > 0.0;
        if is_above { self.least_cosine } else { cosine }
    }

    /// The largest of any direction within a ball at an offset, both in metres: 0 … 1.
    pub fn largest_cosine(&self, offset: Vec3, radius: f32) -> f32 {
        self.within(offset, offset.length(), radius)
    }

    #[inline]
    fn within(&self, offset: Vec3, distance: f32, radius: f32) -> f32 {
        let cosine = cosine_within(self.normal_world, offset, distance, radius);
        let is_above = cosine < self.least_cosine && self.ground_world.dot(offset) > -radius;
        if is_above { self.least_cosine } else { cosine }
    }
}

/// Picks lights for one place. Made once and aimed at one place after the other.
#[derive(Clone, Debug, Default)]
pub struct Chooser {
    pick: Pick,
    /// Running sums of weights, one a light; [`Pick::Power`] keeps none.
    sums: Vec<f32>,
    /// Weights while they are gathered ([`Chooser::aim_among`]).
    own: Vec<f32>,
}

impl Chooser {
    /// One that picks so. Aim it before it is used.
    pub fn new(pick: Pick) -> Chooser {
        Chooser { pick, ..Chooser::default() }
    }

    /// Prepares for samples at a place on a surface that faces the light so, or with that unit normal.
    pub fn aim(&mut self, lights: &AreaLights<'_>, position_world: Vec3, facing: impl Into<Facing>) {
        let facing = facing.into();
        self.sums.clear();
        let mut sum = 0.0f32;
        match self.pick {
            Pick::Power => {}
            Pick::Uniform => self.sums.extend((1..=lights.len()).map(|n| n as f32)),
            Pick::Fluence => {
                self.sums.extend((0..lights.len()).map(|i| lights.arriving(i, position_world, facing)));
                let (all, count) = self.sums.iter().fold((0.0f32, 0u32), |(all, count), arriving| {
                    (all + arriving, count + u32::from(*arriving > 0.0))
                });
                let count = count.max(1);
                let any = any_of(count) / (1.0 - any_of(count)) * all / count as f32;
                for weight in &mut self.sums {
                    sum += if *weight > 0.0 { *weight + any } else { 0.0 };
                    *weight = sum;
                }
            }
        }
    }

    /// Prepares for samples that several places share, each given as of [`Chooser::aim`]: the mean of the probabilities that each would have. A light that can
    /// arrive at any of them may be picked.
    pub fn aim_among<F: Into<Facing>>(
        &mut self,
        lights: &AreaLights<'_>,
        places_world: impl IntoIterator<Item = (Vec3, F)>,
    ) {
        if self.pick != Pick::Fluence {
            self.aim(lights, Vec3::ZERO, Vec3::ZERO);
            return;
        }
        let mut own = std::mem::take(&mut self.own);
        own.clear();
        own.resize(lights.len(), 0.0);
        for (position, facing) in places_world {
            self.aim(lights, position, facing);
            let Some(scale) =
                self.sums.last().filter(|sum| **sum > 0.0 && sum.is_finite()).map(|sum| 1.0 / sum)
            else {
                continue;
            };
            for (light, weight) in own.iter_mut().enumerate() {
                *weight += weight_of(&self.sums, light) * scale;
            }
        }
        let mut sum = 0.0f32;
        self.sums.clear();
        self.sums.extend(own.iter().map(|weight| {
            sum += weight;
            sum
        }));
        self.own = own;
    }

    /// Probability of picking a light.
    pub fn probability(&self, lights: &AreaLights<'_>, light: usize) -> f32 {
        let sums = self.sums(&lights.power);
        let Some(total) = sums.last().filter(|t| **t > 0.0) else { return 0.0 };
        weight_of(sums, light) / total
    }

    /// The light that `u` in `[0, 1)` picks, its probability, and what is left of `u`, again in `[0, 1)`, for
    /// [`AreaLights::sample_light`]; `None` if nothing can arrive.
    pub fn pick(&self, lights: &AreaLights<'_>, u: f32) -> Option<(u32, f32, f32)> {
        self.choose(&lights.power, u)
    }

    fn sums<'s>(&'s self, power: &'s [f32]) -> &'s [f32] {
        if self.pick == Pick::Power { power } else { &self.sums }
    }

    /// The light that `u` in `[0, 1)` picks, its probability, and what is left of `u`, again in `[0, 1)`.
    pub(super) fn choose(&self, power: &[f32], u: f32) -> Option<(u32, f32, f32)> {
        let sums = self.sums(power);
        let total = *sums.last().filter(|t| **t > 0.0 && t.is_finite())?;
        let at = u.clamp(0.0, 1.0) * total;
        let mut light = sums.partition_point(|sum| *sum <= at);
        if light == sums.len() {
            // Rounded up to the end: the last that has weight.
            light = sums.partition_point(|sum| *sum < total);
        }
        let weight = weight_of(sums, light);
        let rest = ((at - (sums[light] - weight)) / weight).clamp(0.0, ONE_BELOW);
        Some((light as u32, weight / total, rest))
    }
}

/// Largest number below 1.
const ONE_BELOW: f32 = 1.0 - f32::EPSILON / 2.0;

fn weight_of(sums: &[f32], light: usize) -> f32 {
    match (sums.get(light), light.checked_sub(1).and_then(|before| sums.get(before))) {
        (Some(sum), Some(before)) => sum - before,
        (Some(sum), None) => *sum,
        _ => 0.0,
    }
}

/// Largest cosine of a unit normal to a direction within a ball at an offset: 1 inside it or without a normal, 0 below the horizon.
#[inline]
fn cosine_within(normal: Vec3, offset: Vec3, distance: f32, radius: f32) -> f32 {
    let height = normal.dot(offset);
    if distance <= radius || normal == Vec3::ZERO {
        return 1.0;
    }
    // Of many lights, half are here.
    if height <= -radius {
        return 0.0;
    }
    let inverse = 1.0 / distance;
    let cos_angle = (height * inverse).clamp(-1.0, 1.0);
    let sin_spread = radius * inverse;
    let cos_spread = (1.0 - sin_spread * sin_spread).max(0.0).sqrt();
    if cos_angle >= cos_spread {
        return 1.0;
    }
    // Cosine of the difference of the two angles.
    (cos_angle * cos_spread + (1.0 - cos_angle * cos_angle).max(0.0).sqrt() * sin_spread).max(0.0)
}

impl AreaLights<'_> {
    /// Estimate of the irradiance (luminance, W/m²) of a light at a place that faces it so, or with that unit normal, if nothing stands between: what its
    /// ball or plane would give, with cosines at the most that its extent allows. Greater than 0 wherever any of it can arrive.
    pub fn arriving(&self, light: usize, position_world: Vec3, facing: impl Into<Facing>) -> f32 {
        let facing = facing.into();
        let Some(l) = self.lights.get(light) else {
            return self.environment.map_or(0.0, |(_, mean, _)| PI * luminance(mean).max(0.0));
        };
        let radiance = l.brightness;
        let (center, radius) = l.shape.ball();
        if radius <= 0.0 || radiance <= 0.0 {
            return 0.0;
        }
        let offset = center - position_world;
        let distance2 = offset.length_squared();
        if !distance2.is_finite() {
            return 0.0;
        }
        let distance = distance2.sqrt();
        let cosine = |normal: Vec3, to: Vec3| cosine_within(normal, to, distance, radius);
        let on_surface = facing.within(offset, distance, radius);
        if on_surface <= 0.0 {
            return 0.0;
        }
        let solid_angle = match &l.shape {
            Shape::Nothing => 0.0,
            Shape::Sphere { .. } if distance <= radius => 0.0,
            Shape::Sphere { .. } => {
                let sin2 = radius * radius / distance2;
                2.0 * PI * sin2 / (1.0 + (1.0 - sin2).max(0.0).sqrt())
            }
            Shape::Disc { normal, .. } | Shape::Rectangle { normal, .. } => {
                let height = -normal.dot(offset);
                let facing = if l.two_sided { height.abs() } else { height };
                // Of the plane itself: behind it nothing arrives.
                if facing <= 0.0 {
                    return 0.0;
                }
                let area = l.area;
                area * cosine(*normal * if height < 0.0 { -1.0 } else { 1.0 }, -offset)
                    / (distance2 + area / PI)
            }
            // Seen from outside, bodies show a quarter of their surface (Cauchy).
            Shape::Triangles(_) => {
                let area = l.area * if l.two_sided { 0.5 } else { 0.25 };
                area / (distance2 + area / PI)
            }
        };
        radiance * solid_angle.min(2.0 * PI) * on_surface
    }
}
