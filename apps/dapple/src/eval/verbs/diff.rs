//! `dapple eval diff`: two pictures.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use dapple_metrics::{LPIPS_MIN_SIDE, SSIM_MIN_SIDE};
use serde::Serialize;

use super::measure::{Found, Measured, pair_context, write_map};
use super::read::Picture;
use crate::args::{DiffArgs, ErrorMap};
use crate::judge::Judge;

/// What `--json` prints.
#[derive(Serialize)]
struct Report<'a> {
    reference: &'a Path,
    test: &'a Path,
    width: u32,
    height: u32,
    /// Whether any of their pixels is transparent, so that it was compared over black.
    over_black: bool,
    pixels_per_degree: f32,
    #[serde(flatten)]
    measured: &'a Measured,
    maps: Vec<PathBuf>,
}

pub(super) fn run(args: &DiffArgs) -> Result<()> {
    let judge = Judge::new(&args.judge)?;
    let (reference, test) = (Picture::read(&args.reference)?, Picture::read(&args.test)?);
    let context = || pair_context(&args.reference, &args.test);
    let found = judge.measure(&reference, &test).with_context(context)?;

    let mut maps = Vec::new();
    if let Some(output) = &args.output {
        // All are painted before any is written.
        let painted = args.kind.iter().map(|&kind| {
            let pixels = judge.paint(&reference, &test, &found, kind).with_context(context)?;
            Ok((map_path(output, kind, args.kind.len()), kind, pixels))
        });
        for (path, kind, pixels) in painted.collect::<Result<Vec<_>>>()? {
            write_map(&path, &reference, &pixels)?;
            maps.push((path, kind));
        }
    }

    if args.json {
        let report = Report {
            reference: &args.reference,
            test: &args.test,
            width: reference.width,
            height: reference.height,
            over_black: reference.transparent || test.transparent,
            pixels_per_degree: args.judge.ppd,
            measured: &found.measured,
            maps: maps.into_iter().map(|(path, _)| path).collect(),
        };
        say!("{}", serde_json::to_string_pretty(&report)?);
        return Ok(());
    }
    say!(
        "{} against {}, {} x {}\n\n{}",
        args.test.display(),
        args.reference.display(),
        reference.width,
        reference.height,
        table(&found, &reference, args)
    );
    for (path, picture) in [(&args.reference, &reference), (&args.test, &test)] {
        if picture.transparent {
            say!("{} has transparent pixels, which were compared over black", path.display());
        }
    }
    for (path, kind) in maps {
        say!("{}: {}", path.display(), legend(kind));
    }
    Ok(())
}

/// A line a metric: name, value, what it means.
fn table(found: &Found, picture: &Picture, args: &DiffArgs) -> String {
    let measured = &found.measured;
    let psnr = measured.psnr_db.map_or("equal".to_owned(), |db| format!("{db:.2} dB"));
    let peak = if measured.peak == 1.0 { String::new() } else { format!(", peak {}", measured.peak) };
    let mut rows = vec![("PSNR", psnr, format!("higher is better{peak}"))];
    let side = picture.width.min(picture.height);
    let mut unit = |name, value: Option<f64>, meaning: String| {
        rows.extend(value.map(|value| (name, format!("{value:.4}"), meaning)));
    };
    let ppd = args.judge.ppd;
    unit("SSIM", measured.ssim, "1 is equal".to_owned());
    unit("FLIP", measured.flip, format!("0 is equal, at {ppd} pixels a degree"));
    if let Some(exposures) = found.exposures {
        let (count, start, stop) = (exposures.count, exposures.start, exposures.stop);
        let meaning = format!(
            "0 is equal, at {ppd} pixels a degree and {count} exposures from {start:.2} to {stop:.2} stops"
        );
        unit("HDR-FLIP", measured.hdr_flip, meaning);
    }
    let is_linear = measured.flip.is_none();
    unit("LPIPS", measured.lpips, "0 is equal".to_owned());
    if is_linear && measured.hdr_flip.is_none() {
        rows.push(("HDR-FLIP", "-".to_owned(), "needs a reference that is not black".to_owned()));
    }
    if !is_linear && measured.ssim.is_none() {
        rows.push(("SSIM", "-".to_owned(), format!("needs {SSIM_MIN_SIDE} pixels on each side, not {side}")));
    }
    if !is_linear && measured.lpips.is_none() {
        let reason = if side < LPIPS_MIN_SIDE {
            format!("needs {LPIPS_MIN_SIDE} pixels on each side, not {side}")
        } else {
            "needs --lpips-weights FILE or DAPPLE_LPIPS_WEIGHTS".to_owned()
        };
        rows.push(("LPIPS", "-".to_owned(), reason));
    }
    let lines = rows.iter().map(|(name, value, meaning)| format!("{name:<10}{value:<12}{meaning}\n"));
    lines.collect()
}

/// The file of one map: its kind stands in the name where there are several.
fn map_path(output: &Path, kind: ErrorMap, kinds: usize) -> PathBuf {
    if kinds < 2 {
        return output.to_owned();
    }
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    let ending = output.extension().unwrap_or_default().to_string_lossy();
    output.with_file_name(format!("{stem}-{}.{ending}", kind.name()))
}

fn legend(kind: ErrorMap) -> &'static str {
    match kind {
        ErrorMap::Flip => "FLIP, black 0 to pale yellow 1",
        ErrorMap::Signed => "test - reference, blue -0.25 to brown 0.25",
        ErrorMap::Absolute => "absolute error, black 0 to yellow 0.25",
        ErrorMap::Squared => "squared error, black 0 to yellow 0.0625",
        ErrorMap::Ssim => "1 - SSIM, black 0 to pale yellow 1",
        ErrorMap::Lpips => "LPIPS, black 0 to pale yellow 0.5",
    }
}
