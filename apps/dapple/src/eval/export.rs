//! `results.csv`, a line a row, and `frames.csv`, a line a picture: for other programs, every figure in full.

use anyhow::Result;

use super::results::{Figure, FrameRow, Results};

/// One line a row of the results.
pub(super) fn rows_csv(results: &Results) -> Result<Vec<u8>> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    let figures = [
        "visibility_psnr_db",
        "moving_psnr_db",
        "psnr_db",
        "ssim",
        "flip",
        "hdr_flip",
        "lpips",
        "flicker",
        "kbit_per_s",
    ];
    let mut titles: Vec<String> =
        ["case", "scene", "path", "method", "points_per_m2", "hz", "rays_per_pixel"]
            .map(str::to_owned)
            .to_vec();
    titles.extend(figures.iter().flat_map(|name| [(*name).to_owned(), format!("{name}_ci95")]));
    titles.extend(
        ["snapshot_bytes", "cut_bytes", "points", "rays", "settled_s", "server_ms", "client_ms"]
            .map(str::to_owned),
    );
    csv.write_record(&titles)?;
    for case in &results.cases {
        for row in &case.rows {
            let mut line =
                vec![case.name.clone(), case.scene.name.clone(), case.path.clone(), row.method.clone()];
            line.push(text(row.params.points_per_m2));
            line.push(text(row.params.hz));
            line.push(text(row.params.rays_per_pixel));
            for figure in [
                Some(row.visibility_psnr_db),
                Some(row.moving_psnr_db),
                Some(row.psnr_db),
                Some(row.ssim),
                Some(row.flip),
                row.hdr_flip,
                row.lpips,
                row.flicker,
                row.kbit_per_s,
            ] {
                let figure: Figure = figure.unwrap_or_default();
                line.extend([text(figure.value), text(figure.ci95)]);
            }
            line.push(text(row.snapshot_bytes));
            line.push(text(row.cut_bytes));
            line.push(text(row.points));
            line.push(row.rays.to_string());
            line.push(text(row.settling.as_ref().and_then(|s| s.settled_s)));
            line.push(text(row.times.server_ms));
            line.push(row.times.client_ms.to_string());
            csv.write_record(&line)?;
        }
    }
    Ok(csv.into_inner()?)
}

/// One line a picture of each row.
pub(super) fn frames_csv(results: &Results) -> Result<Vec<u8>> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record([
        "case",
        "method",
        "points_per_m2",
        "hz",
        "time_s",
        "visibility_psnr_db",
        "moving_psnr_db",
        "psnr_db",
        "ssim",
        "flip",
        "hdr_flip",
        "lpips",
        "flicker",
        "beauty",
        "visibility",
        "error",
        "flip_map",
    ])?;
    for case in &results.cases {
        for row in &case.rows {
            for frame in &row.frames {
                let FrameRow { time_s, ssim, flip, beauty, visibility, error, flip_map, .. } = frame;
                csv.write_record([
                    &case.name,
                    &row.method,
                    &text(row.params.points_per_m2),
                    &text(row.params.hz),
                    &time_s.to_string(),
                    &text(frame.visibility_psnr_db),
                    &text(frame.moving_psnr_db),
                    &text(frame.psnr_db),
                    &ssim.to_string(),
                    &flip.to_string(),
                    &text(frame.hdr_flip),
                    &text(frame.lpips),
                    &text(frame.flicker),
                    beauty,
                    visibility,
                    error,
                    flip_map,
                ])?;
            }
        }
    }
    Ok(csv.into_inner()?)
}

/// Empty where there is nothing.
fn text<T: ToString>(value: Option<T>) -> String {
    value.map_or_else(String::new, |v| v.to_string())
}
