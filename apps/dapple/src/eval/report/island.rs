//! What the page's scripts know: the results in fewer bytes, with pictures named by number.

use std::collections::BTreeMap;

use dapple_metrics::magma_srgb8;
use dapple_render::compose::{BACKGROUND_RGB8, ERROR_RANGE, ErrorKind, view_error};
use dapple_render::image::Plane;
use serde::Serialize;

use super::columns::{self, Column, Kind, Setting};
use super::results::{Case, Figure, FrameRow, Params, Results, Row, StudyPlot};

/// Steps of the scale of signed errors.
const ERROR_STEPS: u32 = 65;

/// Numbers of pictures, in the order in which the results name them.
#[derive(Debug, Default)]
pub(super) struct Shelf {
    names: Vec<String>,
    numbers: BTreeMap<String, u32>,
}

impl Shelf {
    /// A picture's number; `None` for a name that is empty or leads out of the folder.
    pub(super) fn number(&mut self, name: &str) -> Option<u32> {
        if !is_inside(name) {
            return None;
        }
        if let Some(number) = self.numbers.get(name) {
            return Some(*number);
        }
        let number = self.names.len() as u32;
        self.names.push(name.to_owned());
        self.numbers.insert(name.to_owned(), number);
        Some(number)
    }

    pub(super) fn name(&self, number: u32) -> &str {
        &self.names[number as usize]
    }
}

/// Whether a name is a plain path below the folder: results may come from anywhere, a page must not carry other files off.
fn is_inside(name: &str) -> bool {
    let plain =
        |part: &str| !part.is_empty() && part != "." && part != ".." && !part.contains([':', '\\', '\0']);
    name.split('/').all(plain)
}

/// Everything but the pictures themselves.
#[derive(Debug, Serialize)]
pub(super) struct Island<'a> {
    title: &'a str,
    columns: Vec<ColumnInfo>,
    cases: Vec<CaseData<'a>>,
    /// Where the files of numbered pictures lie, relative to the page.
    names: Vec<String>,
    /// Numbers of pictures, each with the number of one that has the same pixels and is in the page.
    pub(super) same: Vec<(u32, u32)>,
    /// Numbers of pictures that could not be read.
    pub(super) missing: Vec<u32>,
    /// For each case the pictures along the path that are in the page.
    pub(super) embedded: Vec<Vec<usize>>,
    scales: Scales,
    /// The plots of each study.
    studies: Vec<&'a [StudyPlot]>,
}

#[derive(Debug, Serialize)]
struct ColumnInfo {
    key: &'static str,
    title: &'static str,
    unit: &'static str,
    digits: usize,
    kind: &'static str,
    more_is_better: bool,
    explanation: &'static str,
}

#[derive(Debug, Serialize)]
struct CaseData<'a> {
    name: &'a str,
    path: &'a str,
    seconds: f64,
    width: u32,
    height: u32,
    truth: PictureNumbers,
    time_s: Vec<f32>,
    rows: Vec<RowData<'a>>,
}

#[derive(Debug, Serialize)]
struct RowData<'a> {
    method: &'a str,
    setting: Setting,
    params: &'a Params,
    /// Value and half of the interval of each column that applies; the value is absent where equal to the truth.
    figures: BTreeMap<&'static str, (Option<f64>, Option<f64>)>,
    step_bytes: &'a [u32],
    settling: Option<SettlingData>,
    /// For each metric of single pictures its values along the path; absent where no picture has one.
    frames: BTreeMap<&'static str, Vec<Option<f32>>>,
    pictures: PictureNumbers,
}

#[derive(Debug, Serialize)]
struct SettlingData {
    after_s: Vec<f32>,
    behind_rms: Vec<f32>,
    visibility_psnr_db: Vec<Option<f32>>,
}

/// Numbers of pictures along the path.
#[derive(Debug, Default, Serialize)]
struct PictureNumbers {
    beauty: Vec<Option<u32>>,
    visibility: Vec<Option<u32>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    error: Vec<Option<u32>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    flip: Vec<Option<u32>>,
}

/// The colours that numbers have in pictures, as `rrggbb` one after the other.
#[derive(Debug, Serialize)]
struct Scales {
    /// FLIP 0 … 1.
    flip: String,
    /// Error −range … range.
    error: String,
    error_range: f32,
    /// Where no geometry is.
    background: String,
}

impl<'a> Island<'a> {
    /// Without any picture in the page yet.
    pub(super) fn new(results: &'a Results, shelf: &mut Shelf) -> anyhow::Result<Island<'a>> {
        let filled = columns::filled(&results.cases);
        let cases: Vec<CaseData> = results.cases.iter().map(|case| case_data(case, &filled, shelf)).collect();
        Ok(Island {
            title: &results.title,
            columns: filled.iter().map(|column| column_info(column)).collect(),
            cases,
            names: shelf.names.clone(),
            same: Vec::new(),
            missing: Vec::new(),
            embedded: Vec::new(),
            scales: scales()?,
            studies: results.studies.iter().map(|study| study.plots.as_slice()).collect(),
        })
    }

    /// As JSON that may stand in a script element: markup in it is escaped.
    pub(super) fn json(&self) -> anyhow::Result<String> {
        // In JSON these stand in strings only.
        Ok(serde_json::to_string(self)?
            .replace('<', "\\u003c")
            .replace('>', "\\u003e")
            .replace('&', "\\u0026"))
    }
}

fn column_info(column: &Column) -> ColumnInfo {
    ColumnInfo {
        key: column.key,
        title: column.title,
        unit: column.unit,
        digits: column.digits,
        kind: match column.kind {
            Kind::Quality => "quality",
            Kind::Cost => "cost",
            Kind::Other => "other",
        },
        more_is_better: column.more_is_better,
        explanation: column.explanation,
    }
}

fn case_data<'a>(case: &'a Case, filled: &[&'static Column], shelf: &mut Shelf) -> CaseData<'a> {
    let mut truth = PictureNumbers::default();
    for frame in &case.truth.frames {
        truth.beauty.push(shelf.number(&frame.beauty));
        truth.visibility.push(shelf.number(&frame.visibility));
    }
    let settings = columns::settings(case);
    CaseData {
        name: &case.name,
        path: &case.path,
        seconds: case.seconds,
        width: case.width,
        height: case.height,
        truth,
        time_s: case.truth.frames.iter().map(|frame| frame.time_s as f32).collect(),
        rows: case
            .rows
            .iter()
            .zip(settings)
            .map(|(row, setting)| row_data(row, setting, filled, shelf))
            .collect(),
    }
}

fn row_data<'a>(
    row: &'a Row,
    setting: Setting,
    filled: &[&'static Column],
    shelf: &mut Shelf,
) -> RowData<'a> {
    let pair = |figure: Figure| (figure.value, figure.ci95);
    let mut pictures = PictureNumbers::default();
    for frame in &row.frames {
        pictures.beauty.push(shelf.number(&frame.beauty));
        pictures.visibility.push(shelf.number(&frame.visibility));
        pictures.error.push(shelf.number(&frame.error));
        pictures.flip.push(shelf.number(&frame.flip_map));
    }
    RowData {
        method: &row.method,
        setting,
        params: &row.params,
        figures: filled.iter().filter_map(|column| Some((column.key, pair((column.get)(row)?)))).collect(),
        step_bytes: &row.step_bytes,
        settling: row.settling.as_ref().map(|settling| SettlingData {
            after_s: settling.after_s.iter().map(|&s| s as f32).collect(),
            behind_rms: settling.behind_rms.iter().map(|&rms| rms as f32).collect(),
            visibility_psnr_db: settling.visibility_psnr_db.iter().map(|v| v.map(|v| v as f32)).collect(),
        }),
        frames: frame_metrics(&row.frames),
        pictures,
    }
}

/// Metrics of single pictures, under the keys of their columns. Single precision is more than a plot shows.
fn frame_metrics(frames: &[FrameRow]) -> BTreeMap<&'static str, Vec<Option<f32>>> {
    type Metric = (&'static str, fn(&FrameRow) -> Option<f64>);
    const METRICS: [Metric; 8] = [
        (columns::VISIBILITY, |f| f.visibility_psnr_db),
        ("moving_psnr_db", |f| f.moving_psnr_db),
        ("psnr_db", |f| f.psnr_db),
        ("ssim", |f| Some(f.ssim)),
        ("flip", |f| Some(f.flip)),
        ("hdr_flip", |f| f.hdr_flip),
        ("lpips", |f| f.lpips),
        ("flicker", |f| f.flicker),
    ];
    METRICS
        .iter()
        .map(|(key, get)| (*key, frames.iter().map(|f| get(f).map(|v| v as f32)).collect::<Vec<_>>()))
        .filter(|(_, values)| values.iter().any(Option::is_some))
        .collect()
}

fn scales() -> anyhow::Result<Scales> {
    let ramp: Vec<f32> = (0..=255u8).map(|i| f32::from(i) / 255.0).collect();
    let plane = |values| Plane { width: ERROR_STEPS, height: 1, values };
    let middle = (ERROR_STEPS / 2) as f32;
    let errors = (0..ERROR_STEPS).map(|i| (i as f32 - middle) / middle * ERROR_RANGE).collect();
    let flat = |value| plane(vec![value; ERROR_STEPS as usize]);
    let painted = view_error(&flat(0.0), &plane(errors), &flat(1.0), ErrorKind::Signed)?;
    Ok(Scales {
        flip: hex(&magma_srgb8(&ramp)),
        error: hex(painted.pixels.as_flattened()),
        error_range: ERROR_RANGE,
        background: hex(&BACKGROUND_RGB8),
    })
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
