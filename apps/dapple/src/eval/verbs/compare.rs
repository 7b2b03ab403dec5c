//! `dapple eval compare`: folders of pictures, picture by picture and over time.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use dapple_metrics::StillFlicker;
use serde::Serialize;

use super::super::figures::{FrameError, mean, pooled_psnr};
use super::super::results::Figure;
use super::folder::Names;
use super::measure::{Measured, heat, pair_context, write_map};
use super::read::Picture;
use crate::args::CompareArgs;
use crate::file::write_file;
use crate::judge::Judge;
use crate::progress::Bar;

/// Flicker of the error at which its map is palest, in 1/255.
const FLICKER_RANGE: f32 = 25.0;

/// Codes from black to white: what flicker is counted in.
const CODES: f64 = 255.0;

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    reference: PathBuf,
    pictures: usize,
    /// Names that not every folder has.
    left_out: Vec<String>,
    /// Whether any pixel is transparent, so that it was compared over black.
    over_black: bool,
    pixels_per_degree: f32,
    /// Root mean square change of the reference's luma from picture to picture, in 1/255.
    reference_flicker: Option<f64>,
    tests: Vec<Test>,
}

/// One folder. Figures are means over its pictures; PSNR is that of the mean square error of all their pixels.
#[derive(Serialize)]
struct Test {
    folder: PathBuf,
    equal_pictures: usize,
    psnr_db: Figure,
    ssim: Figure,
    flip: Figure,
    hdr_flip: Figure,
    lpips: Figure,
    /// Root mean square change of luma from picture to picture, in 1/255.
    flicker: Option<f64>,
    /// The same of the difference to the reference's luma.
    error_flicker: Option<f64>,
    /// Names, the worst first, by FLIP.
    worst: Vec<String>,
    maps: Vec<PathBuf>,
    pictures: Vec<Line>,
}

/// One picture.
#[derive(Serialize)]
struct Line {
    name: String,
    #[serde(flatten)]
    measured: Measured,
    #[serde(skip)]
    error: FrameError,
}

pub(super) fn run(args: &CompareArgs) -> Result<()> {
    let judge = Judge::new(&args.judge)?;
    let folders: Vec<&Path> =
        std::iter::once(args.reference.as_path()).chain(args.tests.iter().map(PathBuf::as_path)).collect();
    let names = Names::of(&folders)?;

    let mut over_black = false;
    let mut reference_flicker = StillFlicker::new();
    let mut tests = Vec::new();
    let bar = Bar::new("comparing", (names.common.len() * args.tests.len()) as u64);
    for (number, folder) in args.tests.iter().enumerate() {
        let (mut flicker, mut error_flicker) = (StillFlicker::new(), StillFlicker::new());
        let mut pictures: Vec<Line> = Vec::new();
        for name in &names.common {
            bar.set((number * names.common.len() + pictures.len()) as u64);
            let (reference_file, test_file) = (args.reference.join(name), folder.join(name));
            let (reference, test) = (Picture::read(&reference_file)?, Picture::read(&test_file)?);
            over_black |= reference.transparent || test.transparent;
            let context = || pair_context(&reference_file, &test_file);
            let measured = judge.measure(&reference, &test).with_context(context)?.measured;
            if args.still_camera {
                let (reference, test) = (reference.luma(), test.luma());
                let error: Vec<f32> = test.iter().zip(&reference).map(|(t, r)| t - r).collect();
                let context = || format!("{name} beside the picture before, as --still-camera asks");
                if number == 0 {
                    reference_flicker.add(&reference).with_context(context)?;
                }
                flicker.add(&test).with_context(context)?;
                error_flicker.add(&error).with_context(context)?;
            }
            let weight = f64::from(reference.width) * f64::from(reference.height);
            let mse = measured.mse / (f64::from(measured.peak) * f64::from(measured.peak));
            pictures.push(Line { name: name.clone(), measured, error: FrameError { mse, weight } });
        }
        let mut test = Test::new(folder, pictures, args.worst);
        (test.flicker, test.error_flicker) = (codes(&flicker), codes(&error_flicker));
        if let Some(maps) = &args.maps {
            // Folders may have one name.
            let own = match args.tests.len() {
                1 => maps.clone(),
                _ => maps.join(format!("{}-{}", number + 1, last_name(folder))),
            };
            test.write_maps(&own, args, &judge, &names.common, error_flicker.map())?;
        }
        tests.push(test);
    }
    drop(bar);

    let report = Report {
        reference: args.reference.clone(),
        pictures: names.common.len(),
        left_out: names.left_out,
        over_black,
        pixels_per_degree: args.judge.ppd,
        reference_flicker: codes(&reference_flicker),
        tests,
    };
    if let Some(file) = &args.csv {
        write_file(file, &csv(&report)?)?;
    }
    if args.json {
        say!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        say!("{}", text(&report));
    }
    Ok(())
}

impl Test {
    fn new(folder: &Path, pictures: Vec<Line>, worst: usize) -> Test {
        let figure = |of: &dyn Fn(&Measured) -> Option<f64>| {
            mean(&pictures.iter().filter_map(|line| of(&line.measured)).collect::<Vec<f64>>())
        };
        let mut by_flip: Vec<&Line> = pictures.iter().collect();
        // Stable: equal ones stay in the order of their names.
        by_flip.sort_by(|a, b| b.measured.any_flip().total_cmp(&a.measured.any_flip()));
        Test {
            folder: folder.to_owned(),
            equal_pictures: pictures.iter().filter(|line| line.measured.psnr_db.is_none()).count(),
            psnr_db: pooled_psnr(&pictures.iter().map(|line| line.error).collect::<Vec<_>>()),
            ssim: figure(&|m| m.ssim),
            flip: figure(&|m| m.flip),
            hdr_flip: figure(&|m| m.hdr_flip),
            lpips: figure(&|m| m.lpips),
            flicker: None,
            error_flicker: None,
            worst: by_flip.iter().take(worst).map(|line| line.name.clone()).collect(),
            maps: Vec::new(),
            pictures,
        }
    }

    /// Writes into the folder `own` what FLIP sees in the worst pictures, and where errors flicker.
    fn write_maps(
        &mut self,
        own: &Path,
        args: &CompareArgs,
        judge: &Judge,
        names: &[String],
        flicker: Option<Vec<f32>>,
    ) -> Result<()> {
        let Some(first) = self.pictures.first() else { return Ok(()) };
        let like = Picture::read(&args.reference.join(&first.name))?;
        for name in &self.worst {
            let (reference, test) =
                (Picture::read(&args.reference.join(name))?, Picture::read(&self.folder.join(name))?);
            let found = judge.measure(&reference, &test)?;
            if let Some(map) = found.flip_map {
                let path = own.join(map_name(name, names));
                write_map(&path, &reference, &heat(&map))?;
                self.maps.push(path);
            }
        }
        if let Some(mut flicker) = flicker {
            ensure!(flicker.len() == like.luma().len(), "pictures changed while they were read");
            flicker.iter_mut().for_each(|v| *v *= CODES as f32 / FLICKER_RANGE);
            let path = own.join("flicker.png");
            write_map(&path, &like, &heat(&flicker))?;
            self.maps.push(path);
        }
        Ok(())
    }
}

fn last_name(folder: &Path) -> String {
    let whole = std::fs::canonicalize(folder);
    let whole = whole.as_deref().unwrap_or(folder);
    whole.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// What FLIP's map of a picture is called: by its stem, or by its whole name where that would be the name of another one's.
fn map_name(name: &str, all: &[String]) -> String {
    let stem = |name: &str| Path::new(name).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let own = stem(name);
    let is_same = |other: &String| other != name && (stem(other) == own || *other == own);
    format!("{}-flip.png", if all.iter().any(is_same) { name } else { &own })
}

/// A root mean square change in 1/255, as an evaluation gives it.
fn codes(flicker: &StillFlicker) -> Option<f64> {
    flicker.rms().map(|rms| CODES * rms)
}

/// One line a picture.
fn csv(report: &Report) -> Result<Vec<u8>> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(["folder", "picture", "mse", "psnr_db", "ssim", "flip", "hdr_flip", "lpips"])?;
    let text = |value: Option<f64>| value.map(|v| v.to_string()).unwrap_or_default();
    for test in &report.tests {
        for Line { name, measured, .. } in &test.pictures {
            csv.write_record([
                &test.folder.display().to_string(),
                name,
                &measured.mse.to_string(),
                &text(measured.psnr_db),
                &text(measured.ssim),
                &text(measured.flip),
                &text(measured.hdr_flip),
                &text(measured.lpips),
            ])?;
        }
    }
    Ok(csv.into_inner()?)
}

/// The table and what belongs to it.
fn text(report: &Report) -> String {
    let cell = |figure: Figure, digits: usize| match figure {
        Figure { value: Some(value), ci95: Some(half) } => format!("{value:.digits$} ± {half:.digits$}"),
        Figure { value: Some(value), ci95: None } => format!("{value:.digits$}"),
        Figure { value: None, .. } => "-".to_owned(),
    };
    let steady = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.3}"));
    let titles =
        ["folder", "PSNR dB", "SSIM", "FLIP", "HDR-FLIP", "LPIPS", "flicker 1/255", "flicker of error 1/255"]
            .map(str::to_owned);
    let rows = report.tests.iter().map(|test| {
        let psnr = if test.psnr_db.value.is_none() { "equal".to_owned() } else { cell(test.psnr_db, 2) };
        [
            test.folder.display().to_string(),
            psnr,
            cell(test.ssim, 4),
            cell(test.flip, 4),
            cell(test.hdr_flip, 4),
            cell(test.lpips, 4),
            steady(test.flicker),
            steady(test.error_flicker),
        ]
    });
    let rows: Vec<[String; 8]> = std::iter::once(titles).chain(rows).collect();
    // Columns that apply to no folder are left out.
    let shown: Vec<usize> = (0..8).filter(|&column| rows[1..].iter().any(|row| row[column] != "-")).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let lines = rows.iter().map(|row| {
        let cells: Vec<String> =
            shown.iter().map(|&column| format!("{:<w$}", row[column], w = width(column))).collect();
        cells.join("  ").trim_end().to_owned()
    });
    let mut out = vec![format!("{} pictures against {}\n", report.pictures, report.reference.display())];
    out.extend(lines);
    out.push(String::new());
    for test in &report.tests {
        let folder = test.folder.display();
        let worst = test.worst.iter().filter_map(|name| {
            let line = test.pictures.iter().find(|line| line.name == *name)?;
            Some(format!("{name} {:.4}", line.measured.any_flip()))
        });
        let worst: Vec<String> = worst.collect();
        if !worst.is_empty() {
            out.push(format!("worst in {folder} by FLIP: {}", worst.join(", ")));
        }
        if test.equal_pictures > 0 && test.psnr_db.value.is_some() {
            out.push(format!("equal in {folder}: {} of {}", test.equal_pictures, test.pictures.len()));
        }
        let maps = test.maps.iter().map(|path| path.display().to_string());
        out.extend(maps.map(|path| format!("written: {path}")));
    }
    if let Some(flicker) = report.reference_flicker {
        out.push(format!(
            "flicker is the RMS change of luma from picture to picture in 1/255, {flicker:.3} in {}; maps end at {FLICKER_RANGE}",
            report.reference.display()
        ));
    }
    if report.tests.iter().any(|test| test.flip.ci95.or(test.hdr_flip.ci95).is_some()) {
        out.push("± is half of the 95 % interval of a mean over independent pictures".to_owned());
    }
    if report.over_black {
        out.push("transparent pixels were compared over black".to_owned());
    }
    if !report.left_out.is_empty() {
        let (count, first) =
            (report.left_out.len(), report.left_out[..report.left_out.len().min(5)].join(", "));
        let more = if count > 5 { ", …" } else { "" };
        out.push(format!("left out, because not in every folder: {count} ({first}{more})"));
    }
    out.join("\n")
}
