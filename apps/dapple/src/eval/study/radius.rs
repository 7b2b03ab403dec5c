//! Memory traffic and time of the sampling passes by radius: [McGuire2012] figure 5, and the traffic of Table 2.

use std::time::Instant;

use anyhow::{Result, bail};
use dapple_render::alchemy::{self, AlchemyParams};
use dapple_render::gbuffer::{GuardBand, Screen};
use dapple_render::sao::{Pyramid, SaoParams, sample_obscurance};
use rayon::prelude::*;
use serde::Deserialize;

use super::traffic::{Card, Traffic, of_alchemy, of_sao};
use super::{Findings, Study, StudyPlot, StudyTable, Subject, axis, column, line, row, size_of};
use crate::eval::stage::Stage;

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct Radius {
    /// Metres.
    radii: Vec<f32>,
    /// Of the caches.
    line_bytes: usize,
}

impl Default for Radius {
    fn default() -> Self {
        Radius { radii: vec![0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0], line_bytes: 64 }
    }
}

/// In the order of the tables.
const PASSES: [&str; 3] = ["alchemy", "sao without levels", "sao"];

/// Bytes of a packed sample that the blurs read: visibility and distance.
const PACKED_BYTES: f64 = 3.0;

fn alchemy_params(radius_m: f32) -> AlchemyParams {
    AlchemyParams { radius_m, ..AlchemyParams::default() }
}

fn sao_params(radius_m: f32, with_levels: bool) -> SaoParams {
    let params = SaoParams { radius_m, ..SaoParams::default() };
    if with_levels { params } else { SaoParams { levels: 0, ..params } }
}

fn traffic(card: &Card, screen: &Screen, pass: usize, radius_m: f32) -> Traffic {
    match pass {
        0 => of_alchemy(card, screen, &alchemy_params(radius_m)),
        1 => of_sao(card, screen, &sao_params(radius_m, false)),
        _ => of_sao(card, screen, &sao_params(radius_m, true)),
    }
}

/// Milliseconds of a sampling pass here: the better of two.
fn time_ms(screen: &Screen, pass: usize, radius_m: f32) -> Result<f64> {
    let mut best = f64::INFINITY;
    for _ in 0..2 {
        let ms = match pass {
            0 => {
                let mut ms = 0.0;
                let start = Instant::now();
                let params = AlchemyParams { blur_taps: 0, ..alchemy_params(radius_m) };
                alchemy::estimate_by_passes(screen, &params, &mut |pass| {
                    if pass == "samples" {
                        ms = 1e3 * start.elapsed().as_secs_f64();
                    }
                })?;
                ms
            }
            _ => {
                let params = sao_params(radius_m, pass == 2);
                let pyramid = Pyramid::new(screen, params.filter, params.levels);
                let start = Instant::now();
                std::hint::black_box(sample_obscurance(screen, &pyramid, &params));
                1e3 * start.elapsed().as_secs_f64()
            }
        };
        best = best.min(ms);
    }
    Ok(best)
}

impl Study for Radius {
    fn title(&self) -> &'static str {
        "Memory traffic and time by radius"
    }

    fn work(&self, stage: Option<&Stage<'_>>) -> f64 {
        let samples =
            stage.map_or(0.0, |stage| f64::from(stage.settings.size.width * stage.settings.size.height));
        60.0 * samples * self.radii.len() as f64
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        let positive = |radius: &f32| *radius > 0.0 && radius.is_finite();
        if self.radii.is_empty() || !self.radii.iter().all(positive) {
            bail!("radii must be lengths in metres above 0, at least one");
        }
        if ![32, 64, 128].contains(&self.line_bytes) {
            bail!("line-bytes is {}, must be 32, 64 or 128", self.line_bytes);
        }
        let stage = subject.stage()?;
        let moments = subject.moments()?;
        // One picture in the middle of the path: addresses say the same for each.
        let moment = &moments[moments.len() / 2];
        let size = size_of(stage);
        let (_, screen) = subject.look(moment, size, GuardBand::default())?;
        let card = Card::gtx_580(self.line_bytes);
        let jobs: Vec<(usize, f32)> =
            self.radii.iter().flat_map(|radius| (0..3).map(move |pass| (pass, *radius))).collect();
        let counted: Vec<Traffic> =
            jobs.par_iter().map(|(pass, radius_m)| traffic(&card, &screen, *pass, *radius_m)).collect();
        (subject.progress)(0.6);
        let mut times = Vec::new();
        for (number, (pass, radius_m)) in jobs.iter().enumerate() {
            times.push(time_ms(&screen, *pass, *radius_m)?);
            (subject.progress)(0.6 + 0.4 * (number + 1) as f64 / jobs.len() as f64);
        }
        let of = |pass: usize| (0..self.radii.len()).map(move |radius| 3 * radius + pass);
        let columns = |unit: &str, digits| PASSES.map(|name| column(name, unit, digits)).to_vec();
        let table = |title: &str, unit: &str, digits, value: &dyn Fn(usize) -> f64| {
            let rows = self.radii.iter().enumerate();
            let rows = rows.map(|(number, radius)| {
                row(format!("{radius} m"), (0..3).map(|pass| value(3 * number + pass)))
            });
            StudyTable { title: title.to_owned(), columns: columns(unit, digits), rows: rows.collect() }
        };
        let tables = vec![
            table("Sampling pass: bytes from memory, a sample", "B", 1, &|i| counted[i].memory),
            table("Sampling pass: bytes into the processors' own caches, a sample", "B", 1, &|i| {
                counted[i].second
            }),
            table("Sampling pass: bytes asked for, a sample", "B", 1, &|i| counted[i].asked),
            table("Sampling pass: time here", "ms", 1, &|i| times[i]),
            self.whole(&counted),
        ];
        let plot = |title: &str, y: &str, unit: &str, value: &dyn Fn(usize) -> f64| {
            let lines = (0..3).map(|pass| {
                let points = of(pass).zip(&self.radii).map(|(i, radius)| [f64::from(*radius), value(i)]);
                line(PASSES[pass], points.collect::<Vec<_>>())
            });
            let (x, y) = (axis("radius", "m", false), axis(y, unit, false));
            StudyPlot { title: title.to_owned(), x, y, lines: lines.collect() }
        };
        let plots = vec![
            plot("Sampling pass, from memory", "bytes a sample", "", &|i| counted[i].memory),
            plot("Sampling pass, into the processors' own caches", "bytes a sample", "", &|i| {
                counted[i].second
            }),
            plot("Sampling pass here", "time", "ms", &|i| times[i]),
        ];
        let notes = vec![
            format!(
                "{} × {} samples at {:.2} s of the path, without a guard band. Counted with the texels that the passes read here, by a model of a GeForce GTX 580: 16 processors of 48 KiB (6 ways) and 1536 threads \
                 each, 768 KiB (16 ways) together, lines of {} bytes of which each holds a square block; groups of 16 × 16 samples, all that fit at a time do each read together. Texels: 16 bytes of position and 4 of \
                 normal for AlchemyAO, 4 of distance for SAO.",
                size[0],
                size[1],
                moment.pose.time,
                self.line_bytes
            ),
            self.summary(&counted, &times),
            "The paper's figure 5: SAO is flat, 2.5 times faster than AlchemyAO without levels and another 3 times with them; Table 2: 293 and 135 bytes a pixel, 7.1 times in time.".to_owned(),
        ];
        Ok(Findings { notes, tables, plots })
    }
}

impl Radius {
    /// What the best of SAO comes to, in a sentence.
    fn summary(&self, counted: &[Traffic], times: &[f64]) -> String {
        let range = |pass: usize, value: &dyn Fn(usize) -> f64| {
            let values = (0..self.radii.len()).map(|radius| value(3 * radius + pass));
            let (low, high) = values.fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
            high / low
        };
        let memory = |i: usize| counted[i].memory;
        let at = self.radii.iter().enumerate().min_by(|a, b| (a.1 - 1.0).abs().total_cmp(&(b.1 - 1.0).abs()));
        let at = at.map_or(0, |(number, _)| 3 * number);
        format!(
            "From the smallest radius to the largest the most is {:.1} times the least of bytes from memory for alchemy, {:.1} for sao without levels, {:.2} for sao; of time {:.2}, {:.2} and {:.2}. At {} m \
             alchemy takes {:.1} times sao's bytes from memory and {:.2} times its time.",
            range(0, &memory),
            range(1, &memory),
            range(2, &memory),
            range(0, &|i| times[i]),
            range(1, &|i| times[i]),
            range(2, &|i| times[i]),
            self.radii[at / 3],
            counted[at].memory / counted[at + 2].memory,
            times[at] / times[at + 2],
        )
    }

    /// Table 2: all passes, where the others read each texel of a picture once from memory, as sweeps do.
    fn whole(&self, counted: &[Traffic]) -> StudyTable {
        let (alchemy, sao) = (AlchemyParams::default(), SaoParams::default());
        // A sample written, and two passes that read and write it.
        let blur = |taps: u32| {
            let reads = 2.0 * f64::from(2 * taps + 1) * PACKED_BYTES;
            [reads + 3.0 * PACKED_BYTES, 5.0 * PACKED_BYTES]
        };
        // Depth read, the first level written; each next reads what it takes of the one below (a quarter of the texels, whole lines) and writes a quarter.
        let depth = 8.0;
        let levels = (1..=sao.levels).map(|level| libm::pow(0.25, f64::from(level))).sum::<f64>();
        let levels = [levels * 8.0, levels * 20.0];
        let rows = self.radii.iter().enumerate().map(|(number, radius)| {
            let [own, other] = [&counted[3 * number], &counted[3 * number + 2]];
            let ([asked_a, memory_a], [asked_s, memory_s]) = (blur(alchemy.blur_taps), blur(sao.blur_taps));
            let of_alchemy = [own.asked + asked_a, own.memory + memory_a];
            let of_sao =
                [other.asked + asked_s + depth + levels[0], other.memory + memory_s + depth + levels[1]];
            let values = [
                of_alchemy[0],
                of_sao[0],
                of_alchemy[0] / of_sao[0],
                of_alchemy[1],
                of_sao[1],
                of_alchemy[1] / of_sao[1],
            ];
            row(format!("{radius} m"), values)
        });
        StudyTable {
            title: "All passes: bytes a sample, asked for and from memory".to_owned(),
            columns: vec![
                column("alchemy asks", "B", 0),
                column("sao asks", "B", 0),
                column("ratio", "", 2),
                column("alchemy from memory", "B", 0),
                column("sao from memory", "B", 0),
                column("ratio", "", 2),
            ],
            rows: rows.collect(),
        }
    }
}
