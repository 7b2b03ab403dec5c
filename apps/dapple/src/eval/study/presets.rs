//! What each preset of each method gives and takes.

use std::time::Duration;

use anyhow::Result;
use dapple_render::Preset;
use dapple_render::compose::resolve_plane;
use serde::Deserialize;

use super::{Errors, Findings, Study, StudyPlot, StudyTable, Subject, axis, column, line, row};
use crate::eval::stage::Frame;
use crate::screen_space::{Effort, ScreenSpace};

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Presets {}

/// Visibility of a picture's pixels by a method, and what it took.
pub(super) fn look(
    subject: &Subject<'_>,
    frame: &Frame,
    method: ScreenSpace,
    effort: Effort,
) -> Result<(Vec<f32>, Duration)> {
    let stage = subject.stage()?;
    let drawn = &frame.drawn;
    let camera = stage.camera_at(drawn);
    let sight = stage.sight(stage.scene(), &drawn.pose, &camera, &drawn.gbuffer);
    let estimate = method.estimate(&sight, effort)?;
    Ok((resolve_plane(&drawn.gbuffer, &estimate.visibility, 1.0)?.values.values, estimate.time))
}

impl Study for Presets {
    fn title(&self) -> &'static str {
        "Presets"
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        let stage = subject.stage()?;
        let (methods, count) = (subject.methods()?, stage.frame_times_s.len());
        let mut found = vec![[(Errors::default(), 0.0); 4]; methods.len()];
        for number in 0..count {
            let frame = stage.frame(number, subject.cache, &|_| ())?;
            for (method, found) in methods.iter().zip(&mut found) {
                for (preset, (errors, ms)) in Preset::ALL.into_iter().zip(found) {
                    let effort = Effort { preset, half_resolution: None, ..stage.settings.effort };
                    let (visibility, time) = look(subject, &frame, *method, effort)?;
                    errors.add_covered(&visibility, frame.truth.visibility(), frame.truth.covered());
                    *ms += 1e3 * time.as_secs_f64() / count as f64;
                }
            }
            (subject.progress)((number + 1) as f64 / count as f64);
        }
        let columns =
            |unit: &str, digits| Preset::ALL.map(|preset| column(preset.name(), unit, digits)).to_vec();
        let table = |title: &str, unit: &str, digits, value: fn(&(Errors, f64)) -> f64| StudyTable {
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
            table("Time here, a picture", "ms", 1, |found| found.1),
        ];
        let lines = methods.iter().zip(&found).map(|(method, found)| {
            line(method.name(), found.iter().map(|(errors, ms)| [*ms, errors.psnr_db()]))
        });
        let plot = StudyPlot {
            title: "Quality by time".to_owned(),
            x: axis("time here", "ms", true),
            y: axis("visibility", "dB", false),
            lines: lines.collect(),
        };
        let samples = stage.samples();
        let notes = vec![format!(
            "{count} pictures of {} × {} pixels, {samples} samples each; low and medium look at a quarter of them. Times have the guard band's part of drawing, normals and all passes.",
            stage.settings.size.width, stage.settings.size.height
        )];
        Ok(Findings { notes, tables, plots: vec![plot] })
    }
}
