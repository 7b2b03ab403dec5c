//! What a stochastic depth map costs, beside a single layer: \[Vermeer2021\] Tables 1 and 2.

use anyhow::{Result, bail};
use serde::Deserialize;

use super::medians::{Seen, Times, medians};
use super::{
    Findings, SAMPLES, Study, StudyPlot, StudyTable, Subject, axis, column, line, row, size_of, stochastic,
};
use crate::eval::stage::Stage;
use crate::screen_space::{Effort, Layered, ScreenSpace};

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct MapCost {
    /// The middle one of so many counts.
    repeats: u32,
}

impl Default for MapCost {
    fn default() -> Self {
        MapCost { repeats: 5 }
    }
}

/// Table 1, ms: no map, then by samples; the computation of occlusion alone, Sponza.
fn table_1(method: Layered) -> [f64; 6] {
    match method {
        Layered::Ssao => [0.926, 1.192, 1.460, 2.161, 3.557, 5.967],
        Layered::Hbao => [0.734, 1.124, 1.302, 1.762, 2.528, 4.823],
        Layered::HbaoPlus => [0.694, 1.081, 1.372, 1.978, 3.212, 5.527],
    }
}
/// Table 2, ms: HBAO+ in all, Sponza, at full and at half resolution.
const TABLE_2: [[f64; 6]; 2] =
    [[1.042, 1.259, 1.577, 2.313, 3.837, 7.005], [0.226, 0.382, 0.436, 0.622, 1.038, 1.922]];

/// What of each row of a table is run: no map, the maps, all layers.
const ROWS: usize = SAMPLES.len() + 2;

fn row_name(number: usize) -> String {
    match number {
        0 => "no map".to_owned(),
        _ => SAMPLES.get(number - 1).map_or("all layers".to_owned(), |samples| format!("S = {samples}")),
    }
}

fn method_of(method: Layered, number: usize, is_paper: bool) -> ScreenSpace {
    match number {
        0 => method.single(),
        _ => SAMPLES
            .get(number - 1)
            .map_or(ScreenSpace::Peeled(method), |samples| stochastic(method, *samples, is_paper)),
    }
}

/// Of a table's row to its first one.
fn ratio(values: &[f64], number: usize) -> f64 {
    values.get(number).map_or(f64::NAN, |value| value / values[0])
}

/// All times of one method with one set of parameters: at full and at half resolution, by row.
struct OfMethod {
    method: Layered,
    is_paper: bool,
    times: [Vec<Times>; 2],
}

impl OfMethod {
    fn all(&self, resolution: usize) -> Vec<f64> {
        self.times[resolution].iter().map(Times::all).collect()
    }

    fn samples(&self) -> Vec<f64> {
        self.times[0].iter().map(|times| times.pass("samples")).collect()
    }

    /// Table 2 of one method.
    fn table(&self) -> StudyTable {
        let whose = if self.is_paper { ", the paper's parameters" } else { "" };
        let mut columns = vec![
            column("map", "ms", 1),
            column("samples", "ms", 1),
            column("blur", "ms", 1),
            column("all", "ms", 1),
            column("all", "×", 2),
            column("samples", "×", 2),
            column("half: map", "ms", 1),
            column("half: all", "ms", 1),
            column("half: all", "×", 2),
            column("Table 1", "×", 2),
        ];
        let has_table_2 = self.method == Layered::HbaoPlus;
        if has_table_2 {
            columns.extend([column("Table 2", "×", 2), column("half", "×", 2)]);
        }
        let (full, half, samples) = (self.all(0), self.all(1), self.samples());
        let rows = (0..ROWS).map(|number| {
            let map = |resolution: usize| {
                let times = &self.times[resolution][number];
                match number {
                    0 => f64::NAN,
                    _ => times.passes_together(&["map", "layers"]),
                }
            };
            let mut values = vec![
                map(0),
                samples[number],
                self.times[0][number].pass("blur"),
                full[number],
                ratio(&full, number),
                ratio(&samples, number),
                map(1),
                half[number],
                ratio(&half, number),
                ratio(&table_1(self.method), number),
            ];
            if has_table_2 {
                values.extend(TABLE_2.iter().map(|table| ratio(table, number)));
            }
            row(row_name(number), values)
        });
        StudyTable { title: format!("{}{whose}", self.method.name()), columns, rows: rows.collect() }
    }
}

impl Study for MapCost {
    fn title(&self) -> &'static str {
        "What a stochastic depth map costs"
    }

    fn work(&self, stage: Option<&Stage<'_>>) -> f64 {
        stage.map_or(1e7, |stage| {
            1500.0
                * f64::from(self.repeats)
                * f64::from(stage.settings.size.width)
                * f64::from(stage.settings.size.height)
        })
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        if !(1..=100).contains(&self.repeats) {
            bail!("repeats is {}, must be 1 to 100", self.repeats);
        }
        let stage = subject.stage()?;
        let (size, effort) = (size_of(stage), stage.settings.effort);
        let moments = subject.moments()?;
        let moment = &moments[moments.len() / 2];
        let seen = Seen::new(subject, moment, size, effort.guard_band)?;
        let ways: Vec<(Layered, bool)> =
            subject.layered()?.into_iter().flat_map(|method| [(method, false), (method, true)]).collect();
        let run = |(method, is_paper): (Layered, bool), half: bool| {
            let effort = Effort { half_resolution: Some(half), ..effort };
            (0..ROWS).map(move |number| (method_of(method, number, is_paper), effort))
        };
        // All in turn.
        let runs: Vec<(ScreenSpace, Effort)> = ways
            .iter()
            .flat_map(|way| [false, true].into_iter().flat_map(move |half| run(*way, half)))
            .collect();
        let mut times = medians(subject, &seen, &runs, self.repeats)?.into_iter();
        let mut next = || times.by_ref().take(ROWS).collect();
        let found: Vec<OfMethod> = ways
            .iter()
            .map(|(method, is_paper)| OfMethod {
                method: *method,
                is_paper: *is_paper,
                times: [next(), next()],
            })
            .collect();
        let over = |values: Vec<f64>| {
            let points: Vec<[f64; 2]> = SAMPLES
                .iter()
                .enumerate()
                .map(|(number, samples)| [f64::from(*samples), ratio(&values, number + 1)])
                .collect();
            points
        };
        let mut lines = Vec::new();
        for found in &found {
            let whose = if found.is_paper { ", the paper's" } else { "" };
            lines.push(line(format!("{}{whose}", found.method.name()), over(found.all(0))));
        }
        lines.push(line("hbao-plus, Table 2 on a card", over(TABLE_2[0].to_vec())));
        let plot = StudyPlot {
            title: "Time in all, as many times that of a single layer".to_owned(),
            x: axis("samples of the map", "", true),
            y: axis("to no map", "×", false),
            lines,
        };
        let notes = vec![
            format!(
                "One picture of {} × {} pixels at {:.2} s of the path, {} samples with the guard band; medians of {} runs in turn, on {} threads of {}. All is the map, the samples and the blur, × as many times those of no map; the G-buffer and its \
                 normals, which every method needs, are not counted. At half resolution the map is drawn at full resolution and every fourth of its samples kept.",
                size[0],
                size[1],
                moment.pose.time,
                seen.samples(),
                self.repeats,
                rayon::current_num_threads(),
                crate::eval::results::Machine::here().cpu
            ),
            "The paper's ratios are of its Tables 1 (occlusion alone, without map and blur) and 2 (HBAO+ in all, 1920 × 1080 and 960 × 540), Sponza, on a Titan V: 4 samples take 2.85 and 2.22 times a single layer.".to_owned(),
        ];
        Ok(Findings { notes, tables: found.iter().map(OfMethod::table).collect(), plots: vec![plot] })
    }
}
