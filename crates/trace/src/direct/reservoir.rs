//! Resampling: one choice of many candidates, with a weight that makes it stand for the integral.

use dapple_scene::ShadingPoint;
use dapple_scene::area_lights::{AreaLights, Chooser, luminance};
use dapple_scene::glam::Vec3;

use super::{contribution, sequence::Draws};
use crate::sampling::{hash, unit_interval};

/// A place on a light by the numbers that choose it: where it lies is asked of the lights anew wherever it is used, so that it moves,
/// turns and shines as its light does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Choice {
    pub(super) light: u32,
    /// As [`AreaLights::sample_light`] takes them.
    pub(super) u: [f32; 3],
}

/// What a choice is at one point, if nothing stands between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    /// Radiance that goes to the viewer, over the density by which numbers choose the place: what is integrated over (light, numbers).
    pub(super) value: Vec3,
    /// Its luminance, > 0: what choices are made in proportion to.
    pub(super) target: f32,
    /// Along which nothing may stand, from the point's origin.
    pub(super) reach: Vec3,
}

impl Choice {
    /// `None` if nothing of it can arrive.
    pub(super) fn seen(&self, lights: &AreaLights<'_>, point: &ShadingPoint, origin: Vec3) -> Option<Seen> {
        let sample = lights.sample_light(self.light, origin, self.u)?;
        let value = contribution(point, &sample)?;
        let target = luminance(value);
        (target > 0.0 && target.is_finite()).then_some(Seen { value, target, reach: sample.reach() })
    }
}

/// The outcome of resampling at a point: a choice, and what it stands for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Reservoir {
    pub(super) choice: Option<Choice>,
    /// W of \[Bitterli2020\]: an unbiased estimate of one over the density that the choice was made with; 0 without one.
    pub(super) weight: f32,
    /// M: how many candidates it was chosen of, at the most that history may count.
    pub(super) candidates: f32,
}

/// Chooses one of a stream of items in proportion to their weights (\[Bitterli2020\] algorithm 2).
pub(super) struct Stream<T> {
    /// Sum of weights; in doubles, for they span all sizes.
    pub(super) sum: f64,
    pub(super) chosen: Option<T>,
    seed: u64,
    offered: u32,
}

impl<T> Stream<T> {
    pub(super) fn new(seed: u64) -> Stream<T> {
        Stream { sum: 0.0, chosen: None, seed, offered: 0 }
    }

    /// Weights that are not above 0, or no numbers, never win.
    pub(super) fn offer(&mut self, item: T, weight: f64) {
        let u = unit_interval(hash(self.seed, u64::from(self.offered), 0));
        self.offered += 1;
        if weight > 0.0 && weight.is_finite() {
            self.sum += weight;
            if f64::from(u) * self.sum < weight {
                self.chosen = Some(item);
            }
        }
    }
}

/// Resampled importance sampling of `count` candidates (\[Talbot2005\]), visibility aside. The chooser must have been aimed at the point.
pub(super) fn resample(
    lights: &AreaLights<'_>,
    chooser: &Chooser,
    point: &ShadingPoint,
    origin: Vec3,
    draws: &Draws,
    count: u32,
    seed: u64,
) -> (Reservoir, Option<Seen>) {
    let mut stream = Stream::new(seed);
    for index in 0..count {
        let u = draws.at(index);
        if let Some((light, probability, rest)) = chooser.pick(lights, u[0]) {
            let choice = Choice { light, u: [rest, u[1], u[2]] };
            if let Some(seen) = choice.seen(lights, point, origin) {
                stream.offer((choice, seen), f64::from(seen.target) / f64::from(probability));
            }
        }
    }
    let candidates = count as f32;
    let Some((choice, seen)) = stream.chosen else {
        return (Reservoir { candidates, ..Default::default() }, None);
    };
    let weight = (stream.sum / (f64::from(seen.target) * f64::from(count))) as f32;
    (Reservoir { choice: Some(choice), weight, candidates }, Some(seen))
}
