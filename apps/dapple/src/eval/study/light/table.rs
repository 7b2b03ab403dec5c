//! Every method for direct light on the same pictures: time and quality ([Stadlbauer2023] Table 1).

use std::path::PathBuf;

use anyhow::Result;
use serde::Deserialize;

use super::super::{Findings, Study, StudyLine, StudyPlot, StudyTable, Subject, axis, column, line, row};
use super::{Lit, Quality, Run, shown};
use crate::direct_light::{STEPS_HZ, Sampler, Seen, Technique, truth};
use crate::eval::stage::Stage;

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct LightMethods {
    /// Steps of the server, at 15 Hz, before a picture is compared.
    steps: u32,
    /// Of the truth, a pixel.
    truth_samples: u32,
    /// Light from all around: an equirectangular Radiance picture.
    environment: Option<PathBuf>,
}

impl Default for LightMethods {
    fn default() -> Self {
        LightMethods { steps: 16, truth_samples: 2048, environment: None }
    }
}

/// Steps at the end that are timed.
const WATCHED: u32 = 4;

fn techniques() -> Vec<(&'static str, Technique)> {
    let (power, best) = (Sampler::Power, Sampler::Best);
    vec![
        ("rt-16", Technique::rays(16, power)),
        ("rt-16, best sampler", Technique::rays(16, best)),
        ("rt-48", Technique::rays(48, power)),
        ("rt-48, best sampler", Technique::rays(48, best)),
        ("ris", Technique::Ris { sampler: power }),
        ("ris, best sampler", Technique::Ris { sampler: best }),
        ("restir-di", Technique::Restir { sampler: power, unbiased: false }),
        ("restir-di, best sampler", Technique::Restir { sampler: best, unbiased: false }),
        ("restir-di unbiased, best sampler", Technique::Restir { sampler: best, unbiased: true }),
        ("slc-paper", Technique::paper_cones(power)),
        ("slc-paper, best sampler", Technique::paper_cones(best)),
        ("slc, power", Technique::cones().with_sampler(power)),
        ("slc by cones alone", Technique::cones().changed(|cones| cones.shapes = false)),
        ("slc, one texel", Technique::cones().without_blending()),
        ("slc, texels twice as wide", Technique::cones().with_texels(2.0)),
        ("slc-fast", Technique::fast_cones()),
        ("slc-quick", Technique::quick_cones()),
        ("slc-fine", Technique::fine_cones()),
        ("slc", Technique::cones()),
    ]
}

/// Whether a method's first picture is kept: the paper's table, and ours.
fn is_shown(name: &str) -> bool {
    ["rt-16", "rt-48", "rt-48, best sampler", "restir-di", "slc-paper", "slc"].contains(&name)
}

/// What a method gave: name, quality, milliseconds, of them shading, rays a pixel.
type Found = (String, Quality, f64, f64, f64);

/// One line for rays of either sampler, and a point for each other method.
fn lines(rows: &[Found]) -> Vec<StudyLine> {
    let points = |wanted: &dyn Fn(&str) -> bool| {
        let found = rows.iter().filter(|(name, ..)| wanted(name));
        found.map(|(_, q, ms, ..)| [*ms, q.psnr_db()]).collect::<Vec<_>>()
    };
    let is_rays = |name: &str| name.starts_with("rt-");
    let is_best = |name: &str| name.ends_with("best sampler");
    let mut lines = vec![
        line("rt-16 and 48", points(&|name| is_rays(name) && !is_best(name))),
        line("rt-16 and 48, best sampler", points(&|name| is_rays(name) && is_best(name))),
    ];
    let others = rows.iter().filter(|(name, ..)| !is_rays(name));
    lines.extend(others.map(|(name, q, ms, ..)| line(name.clone(), [[*ms, q.psnr_db()]])));
    lines
}

impl Study for LightMethods {
    fn title(&self) -> &'static str {
        "Direct light, every method"
    }

    fn work(&self, stage: Option<&Stage<'_>>) -> f64 {
        stage.map_or(1e7, |stage| {
            let rays =
                f64::from(self.truth_samples) + 150.0 * f64::from(WATCHED) + 20.0 * f64::from(self.steps);
            stage.frame_times_s.len() as f64 * stage.samples() as f64 * rays
        })
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        let lit = Lit::new(subject, self.environment.as_deref())?;
        let stage = lit.stage;
        let size = lit.size();
        let count = stage.frame_times_s.len();
        let mut rows: Vec<Found> = Vec::new();
        for (number, &time_s) in stage.frame_times_s.iter().enumerate() {
            let mut runs = techniques()
                .into_iter()
                .map(|(name, technique)| Run::new(name, technique))
                .collect::<Result<Vec<_>>>()?;
            let mut pictures = Vec::new();
            for step in 0..self.steps {
                let at_s = time_s - f64::from(self.steps - 1 - step) / STEPS_HZ;
                let pose = stage.scene().pose(at_s);
                let watched = step + WATCHED >= self.steps;
                lit.at(&pose, |now, lights| {
                    let seen = [Seen::new(now, stage.camera(at_s.max(0.0)), size)?];
                    for run in &mut runs {
                        // Rays remember nothing.
                        if watched || !run.lighter.is_stateless() {
                            pictures.push(run.step(now, lights, &seen, &lit.charting, watched)?.remove(0));
                        }
                    }
                    if step + 1 == self.steps {
                        let truth = truth(now, lights, &seen[0], self.truth_samples);
                        let last = pictures.split_off(pictures.len() - runs.len());
                        if number == 0 {
                            subject.show("truth", shown(size, &truth));
                            for (run, picture) in
                                runs.iter().zip(&last).filter(|(run, _)| is_shown(&run.name))
                            {
                                subject.show(run.name.clone(), shown(size, picture));
                            }
                        }
                        for ((i, run), picture) in runs.iter().enumerate().zip(&last) {
                            if rows.len() <= i {
                                rows.push((run.name.clone(), Quality::default(), 0.0, 0.0, 0.0));
                            }
                            let row = &mut rows[i];
                            row.1.add(size, &truth, picture)?;
                            row.2 += run.ms() / count as f64;
                            row.3 += run.stage_ms(&["shading"]) / count as f64;
                            row.4 += run.cost.rays as f64 / seen[0].points.len() as f64 / count as f64;
                        }
                    }
                    pictures.clear();
                    Ok(())
                })?;
                (subject.progress)(
                    (number as f64 + f64::from(step + 1) / f64::from(self.steps)) / count as f64,
                );
            }
        }
        let columns = vec![
            column("time", "ms", 1),
            column("of it shading", "ms", 1),
            column("rays", "a pixel", 2),
            column("FLIP", "", 4),
            column("PSNR", "dB", 2),
            column("SSIM", "", 4),
            column("bias", "%", 2),
        ];
        let table = StudyTable {
            title: "Time and quality".to_owned(),
            columns,
            rows: rows
                .iter()
                .map(|(name, q, ms, shading, rays)| {
                    row(
                        name.clone(),
                        [*ms, *shading, *rays, q.mean_flip(), q.psnr_db(), q.mean_ssim(), q.bias_percent()],
                    )
                })
                .collect(),
        };
        let plot = StudyPlot {
            title: "Quality by time".to_owned(),
            x: axis("time here", "ms", true),
            y: axis("PSNR", "dB", false),
            lines: lines(&rows),
        };
        let notes = vec![format!(
            "{count} pictures of {} × {} pixels, each after {} steps of a server at 15 Hz along the path; truth {} samples a pixel. Times of lighting alone, the median of the last {WATCHED} steps, methods in turn.",
            size[0], size[1], self.steps, self.truth_samples
        )];
        Ok(Findings { notes, tables: vec![table], plots: vec![plot] })
    }
}
