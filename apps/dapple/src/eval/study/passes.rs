//! Times of each pass, on this machine's processor: [McGuire2012] Tables 2 and 3.

use std::time::Instant;

use anyhow::{Result, bail};
use dapple_render::gbuffer::{GBuffer, GuardBand, Screen};
use serde::Deserialize;

use super::{Findings, Moment, Study, StudyTable, Subject, column, row, size_of};
use crate::args::Size;
use crate::eval::stage::Stage;
use crate::screen_space::{Effort, ScreenSpace};

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Passes {
    /// Of pictures, without their guard band; the study's own where there are none.
    sizes: Vec<Size>,
    /// The best of so many counts.
    repeats: u32,
}

impl Default for Passes {
    fn default() -> Self {
        Passes { sizes: Vec::new(), repeats: 3 }
    }
}

/// Milliseconds of each pass of a method, in order; the best of some.
fn times_ms(
    subject: &Subject<'_>,
    (moment, gbuffer, screen): (&Moment, &GBuffer, &Screen),
    method: ScreenSpace,
    effort: Effort,
    repeats: u32,
) -> Result<Vec<(&'static str, f64)>> {
    let sight = subject.sight(moment, gbuffer)?;
    let mut best: Vec<(&'static str, f64)> = Vec::new();
    for repeat in 0..repeats.max(1) {
        let mut number = 0;
        let mut last = Instant::now();
        method.on_screen(screen, &sight, effort, &mut |pass| {
            let ms = 1e3 * last.elapsed().as_secs_f64();
            if repeat == 0 {
                best.push((pass, ms));
            } else if let Some(best) = best.get_mut(number) {
                best.1 = best.1.min(ms);
            }
            number += 1;
            last = Instant::now();
        })?;
    }
    Ok(best)
}

fn of(times: &[(&str, f64)], pass: &str) -> f64 {
    times.iter().filter(|(name, _)| *name == pass).map(|(_, ms)| ms).sum()
}

impl Study for Passes {
    fn title(&self) -> &'static str {
        "Time by pass"
    }

    fn work(&self, stage: Option<&Stage<'_>>) -> f64 {
        let own = stage.map(|stage| stage.settings.size);
        let sizes = self.sizes.iter().copied().chain(own.filter(|_| self.sizes.is_empty()));
        sizes.map(|size| 400.0 * f64::from(size.width) * f64::from(size.height)).sum()
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        if !(1..=100).contains(&self.repeats) {
            bail!("repeats is {}, must be 1 to 100", self.repeats);
        }
        let stage = subject.stage()?;
        let effort = stage.settings.effort;
        let sizes: Vec<[u32; 2]> = match self.sizes.as_slice() {
            [] => vec![size_of(stage)],
            sizes => sizes.iter().map(|size| [size.width, size.height]).collect(),
        };
        let moments = subject.moments()?;
        let moment = &moments[moments.len() / 2];
        let methods = subject.methods()?;
        let mut by_size = StudyTable {
            title: "SAO by size of the picture".to_owned(),
            columns: vec![
                column("guard band", "px", 0),
                column("samples with it", "", 0),
                column("depth to z", "ms", 2),
                column("levels", "ms", 2),
                column("samples", "ms", 2),
                column("quads", "ms", 2),
                column("bilateral", "ms", 2),
                column("net", "ms", 2),
                column("a visible pixel", "ns", 2),
            ],
            rows: Vec::new(),
        };
        let mut by_method = Vec::new();
        for (number, &size) in sizes.iter().enumerate() {
            let band = GuardBand::of_height(effort.guard_band, size[1])?;
            let camera = band.camera(&moment.camera, size[1]);
            let (gbuffer, screen) = subject.look(moment, size, band)?;
            let z0_ms = (0..self.repeats.max(1)).map(|_| {
                let start = Instant::now();
                std::hint::black_box(gbuffer.distances_m(&camera));
                1e3 * start.elapsed().as_secs_f64()
            });
            let z0_ms = z0_ms.fold(f64::INFINITY, f64::min);
            // Methods that draw more than the G-buffer draw it for the same camera.
            let wide = Moment { pose: moment.pose.clone(), camera };
            let seen = (&wide, &gbuffer, &screen);
            let sao_effort = Effort { half_resolution: Some(false), ..effort };
            let times = times_ms(subject, seen, ScreenSpace::Sao, sao_effort, self.repeats)?;
            let passes = ["levels", "samples", "quads", "bilateral"].map(|pass| of(&times, pass));
            let net = z0_ms + passes.iter().sum::<f64>();
            let visible = f64::from(size[0]) * f64::from(size[1]);
            let values = [f64::from(band.pixels()), screen.distances_m().len() as f64, z0_ms]
                .into_iter()
                .chain(passes)
                .chain([net, 1e6 * net / visible]);
            by_size.rows.push(row(format!("{} × {}", size[0], size[1]), values));
            // One table of all methods, of a size in the middle: the paper's 1080 lines.
            if number == (sizes.len() - 1) / 2 {
                by_method.push(self.all_methods(subject, seen, &methods, size)?);
            }
            (subject.progress)((number + 1) as f64 / sizes.len() as f64);
        }
        let notes = vec![
            format!(
                "One picture at {:.2} s of the path, one sample a pixel, guard band {} of the height; the best of {} runs, on {} threads of {}. Normals are not counted in \"depth to z\", which is what SAO alone needs.",
                moment.pose.time,
                effort.guard_band,
                self.repeats,
                rayon::current_num_threads(),
                crate::eval::results::Machine::here().cpu
            ),
            "The paper's Table 3, GeForce GTX 680, guard band a tenth of the width: 1920 × 1080 takes 0.14 + 0.24 + 0.78 + 0.41 = 1.59 ms, 0.77 ns a visible pixel; 0.74 to 0.88 over all sizes.".to_owned(),
        ];
        let tables = std::iter::once(by_size).chain(by_method).collect();
        Ok(Findings { notes, tables, plots: Vec::new() })
    }
}

impl Passes {
    fn all_methods(
        &self,
        subject: &Subject<'_>,
        seen: (&Moment, &GBuffer, &Screen),
        methods: &[ScreenSpace],
        size: [u32; 2],
    ) -> Result<StudyTable> {
        let effort = subject.stage()?.settings.effort;
        let mut table = StudyTable {
            title: format!("All methods, {} × {}", size[0], size[1]),
            columns: vec![
                column("levels", "ms", 2),
                column("hidden surfaces", "ms", 2),
                column("samples", "ms", 2),
                column("blur", "ms", 2),
                column("net", "ms", 2),
                column("half: samples", "ms", 2),
                column("half: rest", "ms", 2),
                column("half: net", "ms", 2),
            ],
            rows: Vec::new(),
        };
        for &method in methods {
            let run = |half| {
                let effort = Effort { half_resolution: Some(half), ..effort };
                times_ms(subject, seen, method, effort, self.repeats)
            };
            let (full, half) = (run(false)?, run(true)?);
            let net = |times: &[(&str, f64)]| times.iter().map(|(_, ms)| ms).sum::<f64>();
            let (samples, half_samples) = (of(&full, "samples"), of(&half, "samples"));
            let sum = |passes: &[&str]| passes.iter().map(|pass| of(&full, pass)).sum::<f64>();
            let levels = of(&full, "levels");
            let hidden = sum(&["map", "second map", "layers"]);
            let rest = net(&half) - half_samples;
            let values = [
                if levels > 0.0 { levels } else { f64::NAN },
                if hidden > 0.0 { hidden } else { f64::NAN },
                samples,
                sum(&["blur", "quads", "bilateral"]),
                net(&full),
                half_samples,
                rest,
                net(&half),
            ];
            table.rows.push(row(method.name(), values));
        }
        Ok(table)
    }
}
