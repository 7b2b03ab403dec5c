//! Occlusion by hidden surfaces multiplied, for those that a map misses: \[Vermeer2021\] figure 7.

use anyhow::{Result, bail};
use serde::Deserialize;

use super::presets::look;
use super::{
    Errors, Findings, SAMPLES, Study, StudyPlot, StudyTable, Subject, axis, column, line, row, stochastic,
};
use crate::screen_space::{Effort, ScreenSpace};

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Compensation {
    /// What occlusion is multiplied by, 0 … 16.
    factors: Vec<f32>,
    /// Of the map.
    samples: u32,
}

impl Default for Compensation {
    fn default() -> Self {
        Compensation { factors: vec![1.0, 1.5, 2.0], samples: 2 }
    }
}

impl Study for Compensation {
    fn title(&self) -> &'static str {
        "Compensation for what a map misses"
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        if self.factors.is_empty() || !self.factors.iter().all(|factor| (0.0..=16.0).contains(factor)) {
            bail!("factors must be numbers from 0 to 16, at least one");
        }
        if !SAMPLES.contains(&self.samples) {
            bail!("samples is {}, must be 1, 2, 4, 8 or 16", self.samples);
        }
        let stage = subject.stage()?;
        let (methods, count) = (subject.layered()?, stage.frame_times_s.len());
        let ways: Vec<_> =
            methods.iter().flat_map(|method| [false, true].map(|is_paper| (*method, is_paper))).collect();
        let mut found = vec![vec![[Errors::default(); 2]; self.factors.len()]; ways.len()];
        for number in 0..count {
            let frame = stage.frame(number, subject.cache, &|_| ())?;
            let (truth, covered) = (frame.truth.visibility(), frame.truth.covered());
            for ((method, is_paper), found) in ways.iter().zip(&mut found) {
                let (limit, _) = look(subject, &frame, ScreenSpace::Peeled(*method), stage.settings.effort)?;
                for (factor, [to_limit, to_truth]) in self.factors.iter().zip(found) {
                    let effort = Effort { compensation: *factor, ..stage.settings.effort };
                    let method = stochastic(*method, self.samples, *is_paper);
                    let (visibility, _) = look(subject, &frame, method, effort)?;
                    to_limit.add_covered(&visibility, &limit, covered);
                    to_truth.add_covered(&visibility, truth, covered);
                }
            }
            (subject.progress)((number + 1) as f64 / count as f64);
        }
        let name = |number: usize| {
            let (method, is_paper) = ways[number];
            stochastic(method, self.samples, is_paper).name()
        };
        let table = |title: &str, unit: &str, digits, value: fn(&[Errors; 2]) -> f64| StudyTable {
            title: title.to_owned(),
            columns: self.factors.iter().map(|factor| column(&format!("× {factor}"), unit, digits)).collect(),
            rows: found.iter().enumerate().map(|(n, f)| row(name(n), f.iter().map(value))).collect(),
        };
        let tables = vec![
            table("Mean difference from the limit", "", 4, |[limit, _]| limit.mean()),
            table("Bias to the limit", "", 4, |[limit, _]| limit.bias()),
            table("Visibility against the truth", "dB", 2, |[_, truth]| truth.psnr_db()),
        ];
        let lines = found.iter().enumerate().map(|(number, found)| {
            let points = self.factors.iter().zip(found);
            line(name(number), points.map(|(factor, [limit, _])| [f64::from(*factor), limit.mean()]))
        });
        let plot = StudyPlot {
            title: "Difference from the limit by the factor".to_owned(),
            x: axis("factor", "", false),
            y: axis("mean difference", "", false),
            lines: lines.collect(),
        };
        let notes = vec![
            format!(
                "{count} pictures of {} × {} pixels, {} samples of the map. The limit is the method's own over all layers, without a factor. Positive bias is too light.",
                stage.settings.size.width, stage.settings.size.height, self.samples
            ),
            "The paper's figure 7, of San Miguel with 2 samples, is a picture without numbers: there doubling matches all layers better.".to_owned(),
        ];
        Ok(Findings { notes, tables, plots: vec![plot] })
    }
}
