//! What more viewers cost, in one place, turned apart, in places of their own, and with two eyes ([Stadlbauer2023] figures 11, 13, 14, 16).

use std::path::PathBuf;

use anyhow::Result;
use dapple_scene::PosedCamera;
use dapple_scene::glam::{Affine3A, Vec3};
use serde::Deserialize;

use super::super::{Findings, Study, StudyPlot, StudyTable, Subject, axis, column, line, row};
use super::{Lit, Quality, Run};
use crate::direct_light::{STEPS_HZ, Sampler, Seen, Technique, truth};
use crate::eval::stage::Stage;

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct LightViewers {
    /// How many viewers there are.
    viewers: Vec<u32>,
    /// Steps of the server before it is watched.
    steps: u32,
    /// Of the truth, a pixel.
    truth_samples: u32,
    /// Light from all around: an equirectangular Radiance picture.
    environment: Option<PathBuf>,
}

impl Default for LightViewers {
    fn default() -> Self {
        LightViewers { viewers: vec![1, 2, 4, 8, 16], steps: 9, truth_samples: 64, environment: None }
    }
}

/// Steps that are timed.
const WATCHED: u32 = 3;
/// Between neighbours who are turned.
const TURN_DEGREES: f32 = 28.0;
/// Distance of a viewer's eyes, metres.
const EYES_M: f32 = 0.064;

/// Where viewers are.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Crowd {
    /// In one place, each turned by a degree.
    Together,
    /// In one place, each turned by 28°: of a view 92° wide, as cameras of built-in scenes have, neighbours share 69 %, and the 14th sees what the first does.
    Turned,
    /// Each somewhere else along the path.
    Apart,
    /// As `Apart`, with two eyes.
    Stereo,
}

impl Crowd {
    const ALL: [Crowd; 4] = [Crowd::Together, Crowd::Turned, Crowd::Apart, Crowd::Stereo];

    fn name(self) -> &'static str {
        match self {
            Crowd::Together => "in one place",
            Crowd::Turned => "turned by 28°",
            Crowd::Apart => "apart",
            Crowd::Stereo => "apart, two eyes",
        }
    }

    fn cameras(self, stage: &Stage<'_>, viewers: u32, time_s: f64) -> Vec<PosedCamera> {
        let turned = |degrees: f32| {
            let mut posed = stage.camera(time_s);
            let eye = posed.world_from_view.translation;
            let turn = Affine3A::from_rotation_y(degrees.to_radians());
            posed.world_from_view.matrix3 = turn.matrix3 * posed.world_from_view.matrix3;
            posed.world_from_view.translation = eye;
            posed
        };
        // Golden parts of the path: places far from each other however many there are.
        let apart =
            |i: u32| stage.camera((time_s + f64::from(i) * 0.618_033_988_75 * stage.seconds) % stage.seconds);
        (0..viewers)
            .flat_map(|i| match self {
                Crowd::Together => vec![turned(i as f32)],
                Crowd::Turned => vec![turned(TURN_DEGREES * i as f32)],
                Crowd::Apart => vec![apart(i)],
                Crowd::Stereo => [-0.5, 0.5]
                    .map(|side: f32| {
                        let mut eye = apart(i);
                        let aside = eye.world_from_view.transform_vector3(Vec3::X) * (side * EYES_M);
                        eye.world_from_view.translation += dapple_scene::glam::Vec3A::from(aside);
                        eye
                    })
                    .to_vec(),
            })
            .collect()
    }
}

fn techniques() -> Vec<(&'static str, Technique)> {
    vec![
        ("rt-16", Technique::rays(16, Sampler::Power)),
        ("rt-48", Technique::rays(48, Sampler::Power)),
        ("restir-di", Technique::Restir { sampler: Sampler::Power, unbiased: false }),
        ("slc-paper", Technique::paper_cones(Sampler::Power)),
        ("slc, texels twice as wide", Technique::cones().with_texels(2.0)),
        ("slc-fast", Technique::fast_cones()),
        ("slc-quick", Technique::quick_cones()),
        ("slc", Technique::cones()),
    ]
}

/// What one technique did for one crowd.
struct Line {
    name: String,
    ms: f64,
    /// Without what clients can do themselves.
    server_ms: f64,
    quality: Quality,
    entries: f64,
    megabytes: f64,
}

impl LightViewers {
    fn crowd(&self, lit: &Lit<'_>, crowd: Crowd, viewers: u32) -> Result<Vec<Line>> {
        let stage = lit.stage;
        let size = lit.size();
        let mut runs: Vec<Run> =
            techniques().into_iter().map(|(n, t)| Run::new(n, t)).collect::<Result<_>>()?;
        let mut lines = Vec::new();
        let steps = self.steps + WATCHED;
        for step in 0..steps {
            let time_s = f64::from(step) / STEPS_HZ;
            let pose = stage.scene().pose(time_s);
            let watched = step >= self.steps;
            let cameras = crowd.cameras(stage, viewers, time_s);
            lit.at(&pose, |now, lights| {
                let seen =
                    cameras.into_iter().map(|c| Seen::new(now, c, size)).collect::<Result<Vec<_>>>()?;
                let mut pictures = Vec::new();
                for run in &mut runs {
                    // Rays remember nothing: the last step is enough.
                    pictures.push(match run.lighter.is_stateless() && step + 1 < steps {
                        true => Vec::new(),
                        false => run.step(now, lights, &seen, &lit.charting, watched)?,
                    });
                }
                if step + 1 < steps {
                    return Ok(());
                }
                let truths: Vec<Vec<Vec3>> =
                    seen.iter().map(|seen| truth(now, lights, seen, self.truth_samples)).collect();
                for (run, pictures) in runs.iter().zip(&pictures) {
                    let mut quality = Quality::default();
                    for (truth, picture) in truths.iter().zip(pictures) {
                        quality.add(size, truth, picture)?;
                    }
                    let memory = run.cost.memory.unwrap_or_default();
                    lines.push(Line {
                        name: run.name.clone(),
                        ms: run.ms(),
                        server_ms: run.stage_ms(&["requests", "queue", "places", "rays"]),
                        quality,
                        entries: run.cost.step.map_or(f64::NAN, |step| step.wanted as f64),
                        megabytes: run.cost.memory.map_or(f64::NAN, |_| memory.bytes as f64 / 1e6),
                    });
                }
                Ok(())
            })?;
        }
        Ok(lines)
    }
}

impl Study for LightViewers {
    fn title(&self) -> &'static str {
        "Direct light, many viewers"
    }

    fn work(&self, stage: Option<&Stage<'_>>) -> f64 {
        let views: u32 = self.viewers.iter().sum::<u32>() * 5;
        stage.map_or(1e7, |stage| {
            f64::from(views) * stage.samples() as f64 * (200.0 + f64::from(self.truth_samples))
        })
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        let lit = Lit::new(subject, self.environment.as_deref())?;
        let size = lit.size();
        let mut findings = Findings::default();
        let total = (Crowd::ALL.len() * self.viewers.len()) as f64;
        let mut done = 0.0;
        for crowd in Crowd::ALL {
            let mut found: Vec<(u32, Vec<Line>)> = Vec::new();
            for &viewers in &self.viewers {
                found.push((viewers, self.crowd(&lit, crowd, viewers)?));
                done += 1.0;
                (subject.progress)(done / total);
            }
            let columns = vec![
                column("time", "ms", 1),
                column("of it the server's", "ms", 1),
                column("entries", "", 0),
                column("memory", "MB", 1),
                column("PSNR", "dB", 2),
                column("SSIM", "", 4),
                column("FLIP", "", 4),
            ];
            let rows = found.iter().flat_map(|(viewers, lines)| {
                lines.iter().map(move |l| {
                    let q = &l.quality;
                    row(
                        format!("{viewers} × {}", l.name),
                        [
                            l.ms,
                            l.server_ms,
                            l.entries,
                            l.megabytes,
                            q.psnr_db(),
                            q.mean_ssim(),
                            q.mean_flip(),
                        ],
                    )
                })
            });
            findings.tables.push(StudyTable {
                title: format!("Viewers {}", crowd.name()),
                columns,
                rows: rows.collect(),
            });
            let names: Vec<String> =
                found.first().map_or(Vec::new(), |(_, l)| l.iter().map(|l| l.name.clone()).collect());
            findings.plots.push(StudyPlot {
                title: format!("Time, viewers {}", crowd.name()),
                x: axis("viewers", "", true),
                y: axis("time here", "ms", true),
                lines: names
                    .iter()
                    .enumerate()
                    .map(|(i, name)| line(name.clone(), found.iter().map(|(n, l)| [f64::from(*n), l[i].ms])))
                    .collect(),
            });
        }
        findings.notes.push(format!(
            "Each view has {} × {} pixels; {} steps of a server at 15 Hz come before the {WATCHED} that are timed (of rays the last alone). What is the server's leaves out reading the charts and shading, which clients do for themselves.",
            size[0], size[1], self.steps
        ));
        Ok(findings)
    }
}
