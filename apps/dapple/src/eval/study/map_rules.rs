//! What each departure from the paper's map gives: which surfaces are kept, how often, and where they are looked at.

use anyhow::Result;
use dapple_render::gbuffer::{GuardBand, Layers};
use dapple_render::hbao::{HbaoParams, estimate_visibility_with};
use dapple_render::sdao::{Looks, Lookup, MapParams, StochasticMap};
use serde::Deserialize;

use super::{Errors, Findings, SAMPLES, Study, StudyTable, Subject, column, row, size_of};
use crate::eval::stage::Stage;

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct MapRules {}

/// A way of making and of reading a map.
struct Way {
    name: &'static str,
    map: fn(u32) -> MapParams,
    looks: Looks,
    compensation: f32,
}

fn ways() -> Vec<Way> {
    fn at(alpha: f32, samples: u32) -> MapParams {
        MapParams { alpha, ..MapParams::with_samples(samples) }
    }
    let way = |name, map, looks| Way { name, map, looks, compensation: 1.0 };
    let [far, rises] = [Looks::WhereFirstIsFar, Looks::WhereFirstRises];
    vec![
        way("the paper's", MapParams::paper, far),
        Way { compensation: 2.0, ..way("the paper's, × 2", MapParams::paper, far) },
        way("the paper's, α = 0.5", |samples| MapParams { alpha: 0.5, ..MapParams::paper(samples) }, far),
        way("the paper's, looks where the first rises", MapParams::paper, rises),
        way("first surface left out", |samples| at(0.2, samples), far),
        way("left out, looks where it rises", |samples| at(0.2, samples), rises),
        way("ours", MapParams::with_samples, rises),
        way("ours, α = 1/16", |samples| at(0.0625, samples), rises),
        way("ours, α = 1/8", |samples| at(0.125, samples), rises),
        way("ours, α = 1/4", |samples| at(0.25, samples), rises),
        way("ours, α = 1/2", |samples| at(0.5, samples), rises),
    ]
}

impl Study for MapRules {
    fn title(&self) -> &'static str {
        "Which surfaces a map keeps, and where they are looked at"
    }

    fn work(&self, stage: Option<&Stage<'_>>) -> f64 {
        stage.map_or(1e7, |stage| stage.frame_times_s.len() as f64 * stage.samples() as f64 * 500.0)
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        let stage = subject.stage()?;
        let (scene, size) = (stage.scene(), size_of(stage));
        let params = HbaoParams { radius_m: stage.radius_m, ..HbaoParams::hbao_plus() };
        let (ways, moments) = (ways(), subject.moments()?);
        let (mut single, mut by_rule) = (Errors::default(), Errors::default());
        let mut found = vec![[Errors::default(); SAMPLES.len()]; ways.len()];
        for (number, moment) in moments.iter().enumerate() {
            let (gbuffer, screen) = subject.look(moment, size, GuardBand::default())?;
            let covered: Vec<bool> = gbuffer.samples().iter().map(|sample| sample.is_covered()).collect();
            let layers = Layers::draw(scene, &moment.pose, &moment.camera, size[0], size[1], 1)?;
            let run = |lookup: &Lookup<'_>| estimate_visibility_with(&screen, &params, lookup);
            let limit = run(&Lookup::peeled(&layers))?;
            let rule = Lookup { looks: Looks::WhereFirstRises, ..Lookup::peeled(&layers) };
            single.add_covered(&run(&Lookup::default())?, &limit, &covered);
            by_rule.add_covered(&run(&rule)?, &limit, &covered);
            for (way, found) in ways.iter().zip(&mut found) {
                for (samples, found) in SAMPLES.into_iter().zip(found) {
                    let map = MapParams { seed: stage.settings.seed, ..(way.map)(samples) };
                    let map = StochasticMap::draw(scene, &moment.pose, &moment.camera, &gbuffer, &map)?;
                    let lookup = Lookup {
                        looks: way.looks,
                        compensation: way.compensation,
                        ..Lookup::stochastic(&map)
                    };
                    found.add_covered(&run(&lookup)?, &limit, &covered);
                }
            }
            (subject.progress)((number + 1) as f64 / moments.len() as f64);
        }
        let removed = |errors: &Errors| 100.0 * (1.0 - errors.mean() / single.mean());
        let table = StudyTable {
            title: "Of the single layer's difference from all layers, hbao-plus removes".to_owned(),
            columns: SAMPLES.map(|samples| column(&format!("S = {samples}"), "%", 1)).to_vec(),
            rows: ways
                .iter()
                .zip(&found)
                .map(|(way, found)| row(way.name, found.iter().map(removed)))
                .chain([row("all layers, looked at where the first rises", [removed(&by_rule); 5])])
                .collect(),
        };
        let notes = vec![format!(
            "{} pictures of {} × {} pixels, one sample each, without a guard band. The single layer is {:.4} off all layers on average.",
            moments.len(),
            size[0],
            size[1],
            single.mean()
        )];
        Ok(Findings { notes, tables: vec![table], plots: Vec::new() })
    }
}
