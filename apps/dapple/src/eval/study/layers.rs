//! What a stochastic depth map gains: error to the method's own limit, over all layers, and to the truth. \[Vermeer2021\] figures 4 and 5.

use anyhow::Result;
use serde::Deserialize;

use super::presets::look;
use super::{
    Errors, Findings, SAMPLES, Study, StudyPlot, StudyTable, Subject, axis, column, line, row, stochastic,
};
use crate::eval::stage::Stage;
use crate::screen_space::{Layered, ScreenSpace};

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct LayersStudy {}

/// Errors of one way of looking behind the first surface.
#[derive(Clone, Copy, Default)]
struct Found {
    to_limit: Errors,
    to_truth: Errors,
}

/// Of one method.
#[derive(Clone, Default)]
struct OfMethod {
    single: Found,
    /// By samples.
    ours: [Found; SAMPLES.len()],
    paper: [Found; SAMPLES.len()],
    limit: Found,
}

impl OfMethod {
    /// Part of the single layer's error that is gone, in per cent.
    fn removed(&self, found: &Found) -> f64 {
        100.0 * (1.0 - found.to_limit.mean() / self.single.to_limit.mean())
    }

    fn table(&self, method: Layered) -> StudyTable {
        let values = |found: &Found| {
            let Found { to_limit, to_truth } = found;
            [
                to_limit.mean(),
                to_limit.psnr_db(),
                self.removed(found),
                to_truth.mean(),
                to_truth.bias(),
                to_truth.psnr_db(),
            ]
        };
        let mut rows = vec![row("no map", values(&self.single))];
        for (found, suffix) in [(&self.ours, ""), (&self.paper, ", the paper's")] {
            let found = SAMPLES.iter().zip(found);
            rows.extend(found.map(|(s, found)| row(format!("S = {s}{suffix}"), values(found))));
        }
        rows.push(row("all layers", values(&self.limit)));
        StudyTable {
            title: method.name().to_owned(),
            columns: vec![
                column("off the limit", "", 4),
                column("limit", "dB", 2),
                column("error removed", "%", 1),
                column("off the truth", "", 4),
                column("bias to it", "", 4),
                column("truth", "dB", 2),
            ],
            rows,
        }
    }
}

impl Study for LayersStudy {
    fn title(&self) -> &'static str {
        "What a stochastic depth map gains"
    }

    fn work(&self, stage: Option<&Stage<'_>>) -> f64 {
        stage.map_or(1e7, |stage| stage.frame_times_s.len() as f64 * stage.samples() as f64 * 600.0)
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        let stage = subject.stage()?;
        let (methods, count) = (subject.layered()?, stage.frame_times_s.len());
        let effort = stage.settings.effort;
        let mut all = vec![OfMethod::default(); methods.len()];
        for number in 0..count {
            let frame = stage.frame(number, subject.cache, &|_| ())?;
            let (truth, covered) = (frame.truth.visibility(), frame.truth.covered());
            for (method, all) in methods.iter().zip(&mut all) {
                let (limit, _) = look(subject, &frame, ScreenSpace::Peeled(*method), effort)?;
                let add = |found: &mut Found, visibility: &[f32]| {
                    found.to_limit.add_covered(visibility, &limit, covered);
                    found.to_truth.add_covered(visibility, truth, covered);
                };
                add(&mut all.limit, &limit);
                add(&mut all.single, &look(subject, &frame, method.single(), effort)?.0);
                for (found, is_paper) in [(&mut all.ours, false), (&mut all.paper, true)] {
                    for (samples, found) in SAMPLES.into_iter().zip(found) {
                        let method = stochastic(*method, samples, is_paper);
                        add(found, &look(subject, &frame, method, effort)?.0);
                    }
                }
            }
            (subject.progress)((number + 1) as f64 / count as f64);
        }
        let tables = methods.iter().zip(&all).map(|(method, all)| all.table(*method)).collect();
        let plot = |title: &str, y: &str, unit: &str, lines| StudyPlot {
            title: title.to_owned(),
            x: axis("samples of the map", "", true),
            y: axis(y, unit, false),
            lines,
        };
        let over = |found: &[Found; 5], value: &dyn Fn(&Found) -> f64| -> Vec<[f64; 2]> {
            let points = SAMPLES.iter().zip(found).map(|(s, found)| [f64::from(*s), value(found)]);
            points.filter(|[_, y]| y.is_finite()).collect()
        };
        let (mut removed, mut quality) = (Vec::new(), Vec::new());
        for (method, all) in methods.iter().zip(&all) {
            let name = method.name();
            let db = |found: &Found| found.to_truth.psnr_db();
            removed.push(line(name, over(&all.ours, &|found| all.removed(found))));
            removed.push(line(format!("{name}, the paper's"), over(&all.paper, &|found| all.removed(found))));
            quality.push(line(name, over(&all.ours, &db)));
            quality.push(line(format!("{name}, all layers"), over(&[all.limit; 5], &db)));
        }
        let plots = vec![
            plot("The single layer's error to the limit that is removed", "removed", "%", removed),
            plot("Against the truth", "visibility", "dB", quality),
        ];
        let notes = vec![
            format!(
                "{count} pictures of {} × {} pixels, {n} × {n} samples each, guard band {} of the height. Off: mean absolute difference of visibility over pixels. The limit is the method's own over all layers (depth \
                 peeling); removed is the part of the single layer's mean difference from it. Positive bias is too light.",
                stage.settings.size.width,
                stage.settings.size.height,
                effort.guard_band,
                n = stage.settings.supersample,
            ),
            "The paper's figures 4 and 5 are pictures without numbers. Its parameters: α = 0.2, the first surface among the others, hidden ones looked at where the first is farther than the radius.".to_owned(),
        ];
        Ok(Findings { notes, tables, plots })
    }
}
