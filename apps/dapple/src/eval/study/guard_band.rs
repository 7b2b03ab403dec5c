//! What seeing beyond the picture gains and takes.

use anyhow::Result;
use serde::Deserialize;

use super::presets::look;
use super::{Errors, Findings, Study, StudyPlot, StudyTable, Subject, axis, column, line, row};
use crate::screen_space::Effort;

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct GuardBands {
    /// Of the picture's height.
    parts: Vec<f32>,
}

impl Default for GuardBands {
    fn default() -> Self {
        GuardBands { parts: vec![0.0, 0.05, 0.1, 0.2, 0.3] }
    }
}

/// Pixels nearer to the picture's border than this part of its height are counted apart.
const BORDER: f32 = 0.1;

impl Study for GuardBands {
    fn title(&self) -> &'static str {
        "Guard band"
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        let stage = subject.stage()?;
        let (methods, count) = (subject.methods()?, stage.frame_times_s.len());
        let (width, height) = (stage.settings.size.width as usize, stage.settings.size.height as usize);
        let border = (BORDER * height as f32).ceil() as usize;
        let is_near = |pixel: usize| {
            let (x, y) = (pixel % width, pixel / width);
            x.min(width - 1 - x).min(y).min(height - 1 - y) < border
        };
        let mut found =
            vec![vec![(Errors::default(), Errors::default(), 0.0); self.parts.len()]; methods.len()];
        for number in 0..count {
            let frame = stage.frame(number, subject.cache, &|_| ())?;
            for (method, found) in methods.iter().zip(&mut found) {
                for (part, (all, near, ms)) in self.parts.iter().zip(found) {
                    let effort = Effort { guard_band: *part, ..stage.settings.effort };
                    let (visibility, time) = look(subject, &frame, *method, effort)?;
                    let truth = frame.truth.visibility();
                    for pixel in (0..visibility.len()).filter(|pixel| frame.truth.covered()[*pixel]) {
                        all.add(visibility[pixel], truth[pixel]);
                        if is_near(pixel) {
                            near.add(visibility[pixel], truth[pixel]);
                        }
                    }
                    *ms += 1e3 * time.as_secs_f64() / count as f64;
                }
            }
            (subject.progress)((number + 1) as f64 / count as f64);
        }
        let columns = |unit: &str, digits| {
            self.parts.iter().map(|part| column(&part.to_string(), unit, digits)).collect::<Vec<_>>()
        };
        type Value = fn(&(Errors, Errors, f64)) -> f64;
        let table = |title: &str, unit: &str, digits, value: Value| StudyTable {
            title: title.to_owned(),
            columns: columns(unit, digits),
            rows: methods
                .iter()
                .zip(&found)
                .map(|(m, found)| row(m.name(), found.iter().map(value)))
                .collect(),
        };
        let tables = vec![
            table("Visibility against the truth", "dB", 2, |found| found.0.psnr_db()),
            table("The same within a tenth of the height of the border", "dB", 2, |found| found.1.psnr_db()),
            table("Time here, a picture", "ms", 1, |found| found.2),
        ];
        let lines = methods.iter().zip(&found).map(|(method, found)| {
            let points = self.parts.iter().zip(found);
            line(method.name(), points.map(|(part, found)| [f64::from(*part), found.1.psnr_db()]))
        });
        let plot = StudyPlot {
            title: "Quality near the border by the width of the guard band".to_owned(),
            x: axis("guard band, part of the height", "", false),
            y: axis("visibility", "dB", false),
            lines: lines.collect(),
        };
        let notes =
            vec![format!("{count} pictures of {width} × {height} pixels; columns are parts of the height.")];
        Ok(Findings { notes, tables, plots: vec![plot] })
    }
}
