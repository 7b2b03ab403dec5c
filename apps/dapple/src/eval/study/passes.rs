//! Times of each pass, on this machine's processor: [McGuire2012] Tables 2 and 3.

use std::time::Instant;

use anyhow::{Result, bail};
use dapple_render::gbuffer::GuardBand;
use serde::Deserialize;

use super::medians::{Seen, medians};
use super::{Findings, Study, StudyTable, Subject, column, row, size_of};
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
        let quiet = Subject { progress: &|_| (), ..*subject };
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
            let seen = Seen::new(&quiet, moment, size, effort.guard_band)?;
            let z0_ms = (0..self.repeats).map(|_| {
                let start = Instant::now();
                std::hint::black_box(seen.distances_m());
                1e3 * start.elapsed().as_secs_f64()
            });
            let z0_ms = z0_ms.fold(f64::INFINITY, f64::min);
            let sao_effort = Effort { half_resolution: Some(false), ..effort };
            let times = medians(&quiet, &seen, &[(ScreenSpace::Sao, sao_effort)], self.repeats)?;
            let passes = ["levels", "samples", "quads", "bilateral"]
                .map(|pass| times.iter().map(|times| times.least(pass)).sum::<f64>());
            let net = z0_ms + passes.iter().sum::<f64>();
            let visible = f64::from(size[0]) * f64::from(size[1]);
            let values = [f64::from(band.pixels()), seen.samples() as f64, z0_ms]
                .into_iter()
                .chain(passes)
                .chain([net, 1e6 * net / visible]);
            by_size.rows.push(row(format!("{} × {}", size[0], size[1]), values));
            // One table of all methods, of a size in the middle: the paper's 1080 lines.
            if number == (sizes.len() - 1) / 2 {
                by_method.push(self.all_methods(&quiet, &seen, &methods, size)?);
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
        seen: &Seen,
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
        let runs: Vec<(ScreenSpace, Effort)> = methods
            .iter()
            .flat_map(|method| {
                [false, true].map(|half| (*method, Effort { half_resolution: Some(half), ..effort }))
            })
            .collect();
        let times = medians(subject, seen, &runs, self.repeats)?;
        for (method, times) in methods.iter().zip(times.chunks_exact(2)) {
            let (full, half) = (&times[0], &times[1]);
            let sum = |passes: &[&str]| passes.iter().map(|pass| full.least(pass)).sum::<f64>();
            let seen_or_none = |ms: f64| if ms > 0.0 { ms } else { f64::NAN };
            let half_samples = half.least("samples");
            let values = [
                seen_or_none(full.least("levels")),
                seen_or_none(sum(&["map", "second map", "layers"])),
                full.least("samples"),
                sum(&["blur", "quads", "bilateral"]),
                full.least_of_all(),
                half_samples,
                half.least_of_all() - half_samples,
                half.least_of_all(),
            ];
            table.rows.push(row(method.name(), values));
        }
        Ok(table)
    }
}
