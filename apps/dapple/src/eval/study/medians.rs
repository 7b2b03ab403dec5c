//! Times of several runs done in turn, so that what slows the machine for a while slows all of them.

use std::time::Instant;

use anyhow::Result;
use dapple_render::gbuffer::{GBuffer, GuardBand, Screen};

use super::{Moment, Subject};
use crate::screen_space::{Effort, ScreenSpace};

/// A picture with its guard band, drawn.
pub(super) struct Seen {
    /// With the guard band's camera.
    moment: Moment,
    gbuffer: GBuffer,
    screen: Screen,
}

impl Seen {
    pub(super) fn new(subject: &Subject<'_>, moment: &Moment, size: [u32; 2], part: f32) -> Result<Seen> {
        let band = GuardBand::of_height(part, size[1])?;
        let (gbuffer, screen) = subject.look(moment, size, band)?;
        let moment = Moment { pose: moment.pose.clone(), camera: band.camera(&moment.camera, size[1]) };
        Ok(Seen { moment, gbuffer, screen })
    }

    /// Distances from depths: what SAO alone needs of the geometry.
    pub(super) fn distances_m(&self) -> Vec<f32> {
        self.gbuffer.distances_m(&self.moment.camera)
    }

    /// Samples with the guard band.
    pub(super) fn samples(&self) -> usize {
        self.screen.distances_m().len()
    }
}

/// Milliseconds of a run.
#[derive(Debug, Default)]
pub(super) struct Times {
    /// Of each pass in its order, over all repeats.
    passes: Vec<(&'static str, Vec<f64>)>,
    /// Of all together.
    sums: Vec<f64>,
}

/// The middle one; of an even number the upper of two.
pub(super) fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn least(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

impl Times {
    /// Median milliseconds of the passes of a name; 0 where there is none.
    pub(super) fn pass(&self, name: &str) -> f64 {
        self.passes_together(&[name])
    }

    /// Median over repeats of what the passes of these names took together; so never more than the median of all.
    pub(super) fn passes_together(&self, names: &[&str]) -> f64 {
        let of_repeat = |repeat: usize| {
            let passes = self.passes.iter().filter(|(pass, _)| names.contains(pass));
            passes.filter_map(|(_, ms)| ms.get(repeat)).sum::<f64>()
        };
        median(&(0..self.sums.len()).map(of_repeat).collect::<Vec<_>>())
    }

    /// Least milliseconds of the passes of a name; 0 where there is none.
    pub(super) fn least(&self, name: &str) -> f64 {
        self.passes.iter().filter(|(pass, _)| *pass == name).map(|(_, ms)| least(ms)).sum()
    }

    /// Least milliseconds of each pass, together.
    pub(super) fn least_of_all(&self) -> f64 {
        self.passes.iter().map(|(_, ms)| least(ms)).sum()
    }

    /// Median milliseconds of all passes together.
    pub(super) fn all(&self) -> f64 {
        median(&self.sums)
    }
}

/// Runs each method so often, in turn.
pub(super) fn medians(
    subject: &Subject<'_>,
    seen: &Seen,
    runs: &[(ScreenSpace, Effort)],
    repeats: u32,
) -> Result<Vec<Times>> {
    let sight = subject.sight(&seen.moment, &seen.gbuffer)?;
    let mut times: Vec<Times> = runs.iter().map(|_| Times::default()).collect();
    for repeat in 0..repeats {
        for ((method, effort), times) in runs.iter().zip(&mut times) {
            let (mut number, mut sum, mut last) = (0, 0.0, Instant::now());
            method.on_screen(&seen.screen, &sight, *effort, &mut |pass| {
                let ms = 1e3 * last.elapsed().as_secs_f64();
                if number == times.passes.len() {
                    times.passes.push((pass, Vec::new()));
                }
                times.passes[number].1.push(ms);
                number += 1;
                sum += ms;
                last = Instant::now();
            })?;
            times.sums.push(sum);
        }
        (subject.progress)(f64::from(repeat + 1) / f64::from(repeats));
    }
    Ok(times)
}
