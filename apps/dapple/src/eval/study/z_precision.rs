//! How exact distances and normals from a depth buffer are, by its format and the far plane: [McGuire2012] figures 3 and 4.

use anyhow::{Result, bail};
use rayon::prelude::*;
use serde::Deserialize;

use super::precision::{DepthFormat, Deviation, Pipeline, deviation};
use super::{Findings, Study, StudyPlot, StudyTable, Subject, axis, column, line, row};
use crate::eval::stage::Stage;

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct ZPrecision {
    /// Metres.
    distances: Vec<f64>,
    /// At each distance.
    triangles: u32,
}

impl Default for ZPrecision {
    fn default() -> Self {
        let distances = vec![0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 20.0, 30.0, 50.0, 70.0, 100.0];
        ZPrecision { distances, triangles: 4000 }
    }
}

/// Far planes, metres.
const FAR_M: [Option<f64>; 4] = [Some(200.0), Some(1000.0), Some(10_000.0), None];

fn far_name(far_m: Option<f64>) -> String {
    far_m.map_or("no far plane".to_owned(), |far_m| format!("far {far_m} m"))
}

fn name(pipeline: &Pipeline) -> String {
    format!("{}, {} z", pipeline.format, if pipeline.reversed { "reversed" } else { "standard" })
}

impl ZPrecision {
    fn measure(&self, pipeline: &Pipeline) -> Vec<Deviation> {
        self.distances.par_iter().map(|&distance_m| deviation(pipeline, distance_m, self.triangles)).collect()
    }
}

fn most(all: &[Deviation], value: fn(&Deviation) -> f64) -> f64 {
    all.iter().map(value).fold(0.0, f64::max)
}

fn mean(all: &[Deviation], value: fn(&Deviation) -> f64) -> f64 {
    all.iter().map(value).sum::<f64>() / all.len().max(1) as f64
}

impl Study for ZPrecision {
    fn title(&self) -> &'static str {
        "Distances and normals from a depth buffer"
    }

    fn has_scene(&self) -> bool {
        false
    }

    fn work(&self, _: Option<&Stage<'_>>) -> f64 {
        40.0 * self.distances.len() as f64 * f64::from(self.triangles)
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        let near_m = Pipeline::default().near_m;
        if self.distances.is_empty() || !self.distances.iter().all(|d| d.is_finite() && *d > near_m) {
            bail!("distances must be numbers above the near plane's {near_m} m, at least one");
        }
        if !(1..=1_000_000).contains(&self.triangles) {
            bail!("triangles is {}, must be 1 to 1000000", self.triangles);
        }
        let far_columns = |digits| FAR_M.map(|far_m| column(&far_name(far_m), "", digits)).to_vec();
        let table = |title: &str, digits| StudyTable {
            title: title.to_owned(),
            columns: far_columns(digits),
            rows: Vec::new(),
        };
        let mut worst_z = table("Distance: most error, mm", 3);
        let mut mean_z = table("Distance: mean error, mm", 4);
        let mut worst_normal = table("Normals: most error, degrees", 3);
        let (mut z_lines, mut normal_lines) = (Vec::new(), Vec::new());
        let kinds: Vec<(DepthFormat, bool)> = DepthFormat::ALL
            .into_iter()
            .flat_map(|format| [false, true].map(|reversed| (format, reversed)))
            .collect();
        for (number, (format, reversed)) in kinds.iter().copied().enumerate() {
            let of = |far_m| Pipeline { format, reversed, far_m, ..Pipeline::default() };
            let measured = FAR_M.map(|far_m| self.measure(&of(far_m)));
            let named = name(&of(None));
            let of_all = |value: fn(&[Deviation]) -> f64| measured.iter().map(move |all| value(all));
            worst_z.rows.push(row(named.clone(), of_all(|all| 1e3 * most(all, |d| d.z_max_m))));
            mean_z.rows.push(row(named.clone(), of_all(|all| 1e3 * mean(all, |d| d.z_mean_m))));
            worst_normal.rows.push(row(named.clone(), of_all(|all| most(all, |d| d.normal_max_degrees))));
            // Figure 3 has standard z; with reversed z only single precision is another buffer.
            for (far_m, all) in FAR_M.iter().zip(&measured) {
                let shown =
                    if reversed { format == DepthFormat::Float } else { format != DepthFormat::Fixed(32) };
                if shown && (far_m.is_none() || *far_m == Some(200.0)) {
                    let named = format!("{named}, {}", far_name(*far_m));
                    let of = |value: fn(&Deviation) -> f64| {
                        all.iter().map(move |d| [d.distance_m, value(d)]).filter(|p| p[1] > 0.0)
                    };
                    z_lines.push(line(named.clone(), of(|d| 1e3 * d.z_max_m)));
                    normal_lines.push(line(named, of(|d| d.normal_max_degrees)));
                }
            }
            (subject.progress)((number + 1) as f64 / (kinds.len() + 1) as f64);
        }
        let mut host = StudyTable {
            title: "What the host and the card do, no far plane".to_owned(),
            columns: vec![
                column("distance, most", "mm", 3),
                column("distance, mean", "mm", 4),
                column("normals, most", "°", 3),
            ],
            rows: Vec::new(),
        };
        for (format, reversed) in [(DepthFormat::Fixed(24), false), (DepthFormat::Float, true)] {
            for (words, host_double, dot_products) in [
                ("double matrices", true, false),
                ("single matrices", false, false),
                ("double matrices, dot products", true, true),
            ] {
                let pipeline =
                    Pipeline { format, reversed, host_double, dot_products, ..Pipeline::default() };
                let all = self.measure(&pipeline);
                let values = [
                    1e3 * most(&all, |d| d.z_max_m),
                    1e3 * mean(&all, |d| d.z_mean_m),
                    most(&all, |d| d.normal_max_degrees),
                ];
                host.rows.push(row(format!("{}, {words}", name(&pipeline)), values));
            }
        }
        let plot = |title: &str, y: &str, unit: &str, lines| StudyPlot {
            title: title.to_owned(),
            x: axis("distance", "m", true),
            y: axis(y, unit, true),
            lines,
        };
        let plots = vec![
            plot("Error of distances", "most error", "mm", z_lines),
            plot("Error of normals", "most error", "°", normal_lines),
        ];
        let notes = vec![format!(
            "{} triangles at each of {} distances from {} to {} m, each with a camera and an object of its own within 20 m of the world's origin, 1920 × 1080 pixels of 60°, near plane at 0.1 m; \
             errors against exact geometry, in the middle of each triangle. The paper's figures: 2 mm at most, normals within 0.2°.",
            self.triangles,
            self.distances.len(),
            self.distances.first().copied().unwrap_or_default(),
            self.distances.last().copied().unwrap_or_default()
        )];
        Ok(Findings { notes, tables: vec![worst_z, mean_z, worst_normal, host], plots })
    }
}
