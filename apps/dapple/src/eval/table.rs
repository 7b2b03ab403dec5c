//! Results as a table of text.

use super::results::{Params, Results, Row};

/// Column titles, in the order of [`cells`].
pub(super) const COLUMNS: [&str; 12] = [
    "method",
    "setting",
    "vis. PSNR",
    "PSNR",
    "SSIM",
    "FLIP",
    "kbit/s",
    "join",
    "points",
    "Mrays",
    "server ms",
    "client ms",
];

/// What the columns mean, for the report.
pub(super) const EXPLANATIONS: [&str; 12] = [
    "where visibility comes from",
    "points spawned per m² (half are kept) and server rate, or rays a pixel",
    "PSNR of visibility against the truth over all pixels that show geometry, dB",
    "PSNR of the whole picture, dB",
    "mean structural similarity of luma",
    "mean FLIP error, 0 is equal",
    "bits of all updates over the path, snapshot not counted",
    "bytes of the snapshot that a new client receives",
    "points in the store",
    "rays traced in the whole run, millions, the test for points inside geometry not counted",
    "mean wall time of a server step: pose, trees, rays, encoding",
    "mean wall time of reconstruction on the CPU and of applying an update",
];

/// A row's cells; a dash where a column does not apply.
pub(super) fn cells(row: &Row) -> [String; 12] {
    let dash = || "–".to_owned();
    let number = |value: Option<f64>, digits: usize| value.map_or_else(dash, |v| format!("{v:.digits$}"));
    let psnr = |value: Option<f64>| value.map_or_else(|| "equal".to_owned(), |v| format!("{v:.2}"));
    let visibility = if row.compared_pixels > 0 { psnr(row.visibility_psnr_db) } else { dash() };
    [
        row.method.clone(),
        setting(&row.params),
        visibility,
        psnr(row.psnr_db),
        format!("{:.4}", row.ssim),
        format!("{:.4}", row.flip),
        number(row.kbit_per_s, 1),
        row.snapshot_bytes.map_or_else(dash, bytes),
        row.points.map_or_else(dash, |p| p.to_string()),
        format!("{:.1}", row.rays as f64 / 1e6),
        number(row.server_ms, 2),
        format!("{:.1}", row.client_ms),
    ]
}

fn bytes(count: u64) -> String {
    if count < 1000 { format!("{count} B") } else { format!("{:.0} kB", count as f64 / 1e3) }
}

/// What distinguishes rows of one method.
pub(super) fn setting(params: &Params) -> String {
    match (params.points_per_m2, params.hz, params.rays_per_pixel) {
        (Some(n), Some(hz), _) => format!("N {n}, {hz} Hz"),
        (_, _, Some(rays)) => format!("{rays} rays"),
        _ => "–".to_owned(),
    }
}

/// The whole table, columns aligned.
pub(super) fn text(results: &Results) -> String {
    let mut lines: Vec<[String; 12]> = vec![COLUMNS.map(str::to_owned)];
    lines.extend(results.rows.iter().map(cells));
    let width = |column: usize| lines.iter().map(|l| l[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..COLUMNS.len()).map(width).collect();
    let mut text = String::new();
    for line in &lines {
        for (column, cell) in line.iter().enumerate() {
            let pad = " ".repeat(widths[column] - cell.chars().count());
            // Words left, numbers right.
            let padded = if column < 2 { format!("{cell}{pad}  ") } else { format!("{pad}{cell}  ") };
            text.push_str(&padded);
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    }
    text
}
