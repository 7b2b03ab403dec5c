//! What each filter of SAO's levels does to the picture: [McGuire2012] Table 1.

use anyhow::Result;
use dapple_render::gbuffer::GuardBand;
use dapple_render::sao::{MipFilter, SaoParams, estimate_visibility};
use serde::Deserialize;

use super::{Errors, Findings, Study, StudyTable, Subject, column, row, size_of};

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct MipFilters {}

fn name(filter: MipFilter) -> &'static str {
    match filter {
        MipFilter::RotatedGrid => "rotated grid",
        MipFilter::Mean => "arithmetic mean",
        MipFilter::HarmonicMean => "harmonic mean",
        MipFilter::Farthest => "farthest (min of z)",
        MipFilter::Nearest => "nearest (max of z)",
    }
}

impl Study for MipFilters {
    fn title(&self) -> &'static str {
        "Filters of the hierarchical depth"
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        let stage = subject.stage()?;
        let (size, moments) = (size_of(stage), subject.moments()?);
        let band = GuardBand::of_height(stage.settings.effort.guard_band, size[1])?;
        let params = SaoParams { radius_m: stage.radius_m, ..stage.settings.effort.preset.sao().params };
        let mut errors = MipFilter::ALL.map(|filter| (filter, Errors::default(), 0u64));
        let mut count = 0u64;
        for (number, moment) in moments.iter().enumerate() {
            let (gbuffer, screen) = subject.look(moment, size, band)?;
            let estimate = |levels, filter| -> Result<Vec<f32>> {
                let all = estimate_visibility(&screen, &SaoParams { levels, filter, ..params })?;
                Ok(band.crop(&all, size, 1)?)
            };
            let covered: Vec<bool> =
                band.crop(gbuffer.samples(), size, 1)?.iter().map(|sample| sample.is_covered()).collect();
            let full = estimate(0, MipFilter::RotatedGrid)?;
            count += covered.iter().filter(|covered| **covered).count() as u64;
            for (filter, errors, far_off) in &mut errors {
                let found = estimate(params.levels, *filter)?;
                for i in (0..found.len()).filter(|i| covered[*i]) {
                    errors.add(found[i], full[i]);
                    *far_off += u64::from((found[i] - full[i]).abs() > 0.1);
                }
            }
            (subject.progress)((number + 1) as f64 / moments.len() as f64);
        }
        let rows = errors.iter().map(|(filter, errors, far_off)| {
            let part = 100.0 * *far_off as f64 / count.max(1) as f64;
            row(name(*filter), [errors.psnr_db(), errors.bias(), part])
        });
        let table = StudyTable {
            title: "Visibility by SAO with levels, against SAO without".to_owned(),
            columns: vec![
                column("PSNR", "dB", 2),
                column("bias", "", 4),
                column("more than 0.1 off", "%", 2),
            ],
            rows: rows.collect(),
        };
        let notes = vec![
            "Bias is positive where visibility is lighter than without levels. The paper shows pictures of the differences, no numbers; it finds the rotated grid best."
                .to_owned(),
        ];
        Ok(Findings { notes, tables: vec![table], plots: Vec::new() })
    }
}
