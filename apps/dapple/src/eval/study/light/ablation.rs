//! What each part of light cones is worth, how they converge, and what size and speed of lights do to them ([Stadlbauer2023], supplement).

use std::path::PathBuf;

use anyhow::Result;
use dapple_render::slc::Samples;
use dapple_scene::Scene;
use dapple_scene::glam::Vec3;
use dapple_server::cones::Now;
use dapple_store::cones::{BoundingParams, LookUp, MomentParams};
use dapple_trace::Tracer;
use dapple_trace::slc::PaperParams;
use serde::Deserialize;

use super::super::{Findings, Study, StudyPlot, StudyTable, Subject, axis, column, line, row};
use super::{Lit, Quality, Run};
use crate::direct_light::{OurCones, STEPS_HZ, Sampler, Seen, Technique, charts, truth};
use crate::eval::stage::Stage;

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct LightAblation {
    /// Updates of a still picture.
    updates: u32,
    /// Of the truth, a pixel.
    truth_samples: u32,
    /// Factors on the width of lights, whose power stays.
    sizes: Vec<f32>,
    /// Factors on the speed of everything.
    speeds: Vec<f64>,
    /// Light from all around: an equirectangular Radiance picture.
    environment: Option<PathBuf>,
}

impl Default for LightAblation {
    fn default() -> Self {
        let (sizes, speeds) = (vec![0.5, 1.0, 2.0], vec![0.5, 1.0, 2.0, 4.0]);
        LightAblation { updates: 64, truth_samples: 512, sizes, speeds, environment: None }
    }
}

fn ours(change: impl FnOnce(&mut OurCones)) -> Technique {
    Technique::cones().changed(change)
}

fn papers(change: impl FnOnce(&mut PaperParams, &mut LookUp)) -> Technique {
    let (mut params, mut look_up) = (PaperParams::default(), LookUp { blend: false, ..LookUp::default() });
    change(&mut params, &mut look_up);
    Technique::PaperCones { params, look_up, reuse_finer: false }
}

fn variants() -> Vec<(String, Technique)> {
    let mut all = vec![("slc".to_owned(), Technique::cones())];
    for cones in [1, 2, 4] {
        let moment = MomentParams { cones, ..MomentParams::default() };
        all.push((format!("slc, {cones} cones"), ours(|c| c.params.moment = moment)));
    }
    for inside in [1.0, 1.3, 2.0] {
        let moment = MomentParams { inside, ..MomentParams::default() };
        all.push((format!("slc, inside {inside}"), ours(|c| c.params.moment = moment)));
    }
    all.push(("slc by cones alone".to_owned(), ours(|c| c.shapes = false)));
    let untagged = MomentParams { tagged: false, ..MomentParams::default() };
    all.push(("slc, without tags".to_owned(), ours(|c| c.params.moment = untagged)));
    all.push(("slc, power sampler".to_owned(), Technique::cones().with_sampler(Sampler::Power)));
    for bias in [0.5, 2.0, 4.0, 8.0] {
        all.push((format!("slc, bias {bias}"), Technique::cones().with_texels(bias)));
    }
    for bias in [0.5, 1.0, 2.0, 4.0] {
        let one = Technique::cones().without_blending().with_texels(bias);
        all.push((format!("slc, one texel, bias {bias}"), one));
    }
    for (together, whose) in [(0, "of its own"), (1, "of all"), (4, "of every fourth")] {
        all.push((format!("slc, places {whose}"), ours(|c| c.params.together = together)));
    }
    for (samples, updates, then) in [(8, 8, 1), (16, 1, 2), (16, 4, 3)] {
        let young = |c: &mut OurCones| {
            (c.params.first_samples, c.params.first_updates, c.params.samples) = (samples, updates, then);
        };
        all.push((format!("slc, {updates} × {samples} samples at first, then {then}"), ours(young)));
    }
    for samples in [1, 4, 8, 16, 64] {
        let fixed = Samples::Fixed(samples);
        let cones = |c: &mut OurCones| (c.shading.samples, c.shapes) = (fixed, false);
        all.push((format!("slc by cones alone, {samples} directions"), ours(cones)));
    }
    for cones in [1, 2, 3, 8] {
        let bounding = BoundingParams { cones, ..BoundingParams::default() };
        all.push((format!("slc-paper, {cones} cones"), papers(|p, _| p.bounding = bounding)));
    }
    let kept = BoundingParams { discard: false, ..BoundingParams::default() };
    all.push(("slc-paper, nothing discarded".to_owned(), papers(|p, _| p.bounding = kept)));
    all.push(("slc-paper, no probes".to_owned(), papers(|p, _| p.probes = false)));
    all.push(("slc-paper, best sampler".to_owned(), Technique::paper_cones(Sampler::Best)));
    all
}

/// Variants whose way is plotted.
const PLOTTED: [&str; 5] =
    ["slc", "slc by cones alone", "slc, power sampler", "slc-paper, 3 cones", "slc-paper, nothing discarded"];

impl LightAblation {
    fn still(&self, lit: &Lit<'_>, subject: &Subject<'_>) -> Result<(StudyTable, StudyPlot)> {
        let (stage, size) = (lit.stage, lit.size());
        let time_s = stage.frame_times_s[0];
        let pose = stage.scene().pose(time_s);
        let (mut rows, mut lines) = (Vec::new(), Vec::new());
        lit.at(&pose, |now, lights| {
            let seen = [Seen::new(now, stage.camera(time_s), size)?];
            let truth = truth(now, lights, &seen[0], self.truth_samples);
            let all = variants();
            for (i, (name, technique)) in all.iter().enumerate() {
                let mut run = Run::new(name.clone(), *technique)?;
                let mut way = Vec::new();
                let mut last = Quality::default();
                for update in 1..=self.updates {
                    let watched = update + 4 > self.updates;
                    let picture = run.step(now, lights, &seen, &lit.charting, watched)?.remove(0);
                    if update == self.updates
                        || (PLOTTED.contains(&name.as_str()) && update.is_power_of_two())
                    {
                        let mut quality = Quality::default();
                        quality.add(size, &truth, &picture)?;
                        way.push([f64::from(update), quality.psnr_db()]);
                        last = quality;
                    }
                }
                if PLOTTED.contains(&name.as_str()) {
                    lines.push(line(name.clone(), way));
                }
                let entries = run.cost.step.map_or(f64::NAN, |step| step.wanted as f64);
                let shading = run.stage_ms(&["shading"]);
                rows.push(row(
                    name.clone(),
                    [
                        last.psnr_db(),
                        last.mean_ssim(),
                        last.mean_flip(),
                        last.bias_percent(),
                        entries,
                        run.ms(),
                        shading,
                    ],
                ));
                (subject.progress)(0.7 * (i + 1) as f64 / all.len() as f64);
            }
            Ok(())
        })?;
        let columns = vec![
            column("PSNR", "dB", 2),
            column("SSIM", "", 4),
            column("FLIP", "", 4),
            column("bias", "%", 2),
            column("entries", "", 0),
            column("time", "ms", 1),
            column("of it shading", "ms", 1),
        ];
        let table =
            StudyTable { title: format!("A still picture after {} updates", self.updates), columns, rows };
        let plot = StudyPlot {
            title: "Convergence of a still picture".to_owned(),
            x: axis("updates", "", true),
            y: axis("PSNR", "dB", false),
            lines,
        };
        Ok((table, plot))
    }

    fn sizes(&self, lit: &Lit<'_>) -> Result<StudyTable> {
        let (stage, size) = (lit.stage, lit.size());
        let time_s = stage.frame_times_s[0];
        let mut rows = Vec::new();
        for &factor in &self.sizes {
            let scene = resized(stage.scene(), factor);
            let pose = scene.pose(time_s);
            let tracer = Tracer::new(&scene, &pose);
            let now =
                Now { scene: &scene, pose: &pose, tracer: &tracer, environment: lit.environment.as_ref() };
            let lights = now.lights(&pose);
            let seen = [Seen::new(&now, stage.camera(time_s), size)?];
            let truth = truth(&now, &lights, &seen[0], self.truth_samples);
            let charting = charts(&scene);
            for (name, technique) in
                [("rt-48", Technique::rays(48, Sampler::Power)), ("slc", Technique::cones())]
            {
                let mut run = Run::new(name, technique)?;
                let steps = if run.lighter.is_stateless() { 1 } else { 16 };
                let mut picture = Vec::new();
                for _ in 0..steps {
                    picture = run.step(&now, &lights, &seen, &charting, false)?.remove(0);
                }
                let mut q = Quality::default();
                q.add(size, &truth, &picture)?;
                rows.push(row(
                    format!("{factor} × as wide, {name}"),
                    [q.psnr_db(), q.mean_ssim(), q.bias_percent()],
                ));
            }
        }
        let columns = vec![column("PSNR", "dB", 2), column("SSIM", "", 4), column("bias", "%", 2)];
        Ok(StudyTable { title: "Size of lights, after 16 updates".to_owned(), columns, rows })
    }

    fn speeds(&self, lit: &Lit<'_>) -> Result<StudyTable> {
        let (stage, size) = (lit.stage, lit.size());
        let end_s = stage.frame_times_s[0];
        let mut rows = Vec::new();
        for &speed in &self.speeds {
            let techniques = [
                ("rt-48", Technique::rays(48, Sampler::Power)),
                ("slc-paper", Technique::paper_cones(Sampler::Power)),
                ("slc without re-aiming", ours(|c| c.params.re_aim = false)),
                ("slc", Technique::cones()),
            ];
            let mut runs = techniques.into_iter().map(|(n, t)| Run::new(n, t)).collect::<Result<Vec<_>>>()?;
            const STEPS: u32 = 16;
            for step in 0..STEPS {
                let pose = stage.scene().pose(end_s - f64::from(STEPS - 1 - step) * speed / STEPS_HZ);
                let last = step + 1 == STEPS;
                lit.at(&pose, |now, lights| {
                    let seen = [Seen::new(now, stage.camera(end_s), size)?];
                    let truth = last.then(|| truth(now, lights, &seen[0], self.truth_samples));
                    for run in runs.iter_mut().filter(|run| last || !run.lighter.is_stateless()) {
                        let watched = step + 4 >= STEPS;
                        let picture = run.step(now, lights, &seen, &lit.charting, watched)?.remove(0);
                        if let Some(truth) = &truth {
                            let mut q = Quality::default();
                            q.add(size, truth, &picture)?;
                            let rays = run.cost.rays as f64 / picture.len() as f64;
                            rows.push(row(
                                format!("{speed} × as fast, {}", run.name),
                                [q.psnr_db(), q.mean_ssim(), q.bias_percent(), rays, run.ms()],
                            ));
                        }
                    }
                    Ok(())
                })?;
            }
        }
        let columns = vec![
            column("PSNR", "dB", 2),
            column("SSIM", "", 4),
            column("bias", "%", 2),
            column("rays", "a pixel", 2),
            column("time", "ms", 1),
        ];
        Ok(StudyTable { title: "Speed of what moves, after 16 updates".to_owned(), columns, rows })
    }
}

/// A scene with lights so many times as wide and as much dimmer.
fn resized(scene: &Scene, factor: f32) -> Scene {
    let mut scene = scene.clone();
    let emits = |scene: &Scene, mesh: u32| {
        let parts = &scene.meshes[mesh as usize].parts;
        parts.iter().any(|p| scene.materials[p.material as usize].emissive_factor != Vec3::ZERO)
    };
    let mut meshes: Vec<u32> = scene.instances.iter().map(|i| i.mesh).filter(|m| emits(&scene, *m)).collect();
    meshes.sort_unstable();
    meshes.dedup();
    for mesh in meshes {
        let mesh = &mut scene.meshes[mesh as usize];
        let center =
            mesh.positions.iter().fold(Vec3::ZERO, |sum, p| sum + *p) / mesh.positions.len().max(1) as f32;
        for position in &mut mesh.positions {
            *position = center + (*position - center) * factor;
        }
    }
    for material in &mut scene.materials {
        material.emissive_factor /= factor * factor;
    }
    scene
}

impl Study for LightAblation {
    fn title(&self) -> &'static str {
        "Light cones, part by part"
    }

    fn work(&self, stage: Option<&Stage<'_>>) -> f64 {
        stage.map_or(1e7, |stage| stage.samples() as f64 * f64::from(self.updates) * 150.0)
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        let lit = Lit::new(subject, self.environment.as_deref())?;
        let (still, convergence) = self.still(&lit, subject)?;
        let sizes = self.sizes(&lit)?;
        (subject.progress)(0.85);
        let speeds = self.speeds(&lit)?;
        let size = lit.size();
        let notes = vec![format!(
            "One picture of {} × {} pixels; truth {} samples a pixel. Times of the last steps, on a machine that does nothing else.",
            size[0], size[1], self.truth_samples
        )];
        Ok(Findings { notes, tables: vec![still, sizes, speeds], plots: vec![convergence] })
    }
}
