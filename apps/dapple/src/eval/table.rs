//! Results as tables: of text, of Markdown, and as values separated by commas.

use super::results::{Case, Figure, Params, Results, Row};

/// Columns: titles, and what they mean.
pub(super) const COLUMNS: [(&str, &str); 14] = [
    ("method", "where visibility comes from"),
    ("setting", "points spawned per m² (half are kept) and server rate, or rays a pixel"),
    ("vis. PSNR", "PSNR of visibility against the truth over all pixels that show geometry, dB"),
    ("PSNR", "PSNR of the whole picture, dB"),
    ("SSIM", "mean structural similarity of luma"),
    ("FLIP", "mean FLIP error, 0 is equal"),
    ("LPIPS", "learned perceptual distance (squeeze), 0 is equal"),
    ("flicker", "change of still places from one picture to the next at 60 Hz, root mean square, in 1/255"),
    ("kbit/s", "bits of all updates over the path, snapshot not counted"),
    ("join", "bytes of the snapshot that a new client receives"),
    ("points", "points in the store"),
    ("Mrays", "rays traced in the whole run, millions, the test for points inside geometry not counted"),
    ("server ms", "mean wall time of a server step: pose, trees, rays, encoding"),
    ("client ms", "mean wall time of reconstruction on the CPU and of applying an update"),
];

/// A row's cells; a dash where a column does not apply.
pub(super) fn cells(row: &Row) -> [String; COLUMNS.len()] {
    let dash = || "–".to_owned();
    let number = |value: Option<f64>, digits: usize| value.map_or_else(dash, |v| format!("{v:.digits$}"));
    let equal = |figure: &Figure| match figure.value {
        None => "equal".to_owned(),
        Some(_) => text_of(figure, 2),
    };
    let optional =
        |figure: &Option<Figure>, digits| figure.as_ref().map_or_else(dash, |f| text_of(f, digits));
    let visibility = if row.compared_pixels > 0 { equal(&row.visibility_psnr_db) } else { dash() };
    [
        row.method.clone(),
        setting(&row.params),
        visibility,
        equal(&row.psnr_db),
        text_of(&row.ssim, 4),
        text_of(&row.flip, 4),
        optional(&row.lpips, 4),
        optional(&row.flicker, 2),
        optional(&row.kbit_per_s, 1),
        row.snapshot_bytes.map_or_else(dash, bytes),
        row.points.map_or_else(dash, |p| p.to_string()),
        format!("{:.1}", row.rays as f64 / 1e6),
        number(row.times.server_ms, 2),
        format!("{:.1}", row.times.client_ms),
    ]
}

/// A figure with its interval.
pub(super) fn text_of(figure: &Figure, digits: usize) -> String {
    match (figure.value, figure.ci95) {
        (None, _) => "–".to_owned(),
        (Some(value), None) => format!("{value:.digits$}"),
        (Some(value), Some(ci95)) => format!("{value:.digits$} ± {ci95:.digits$}"),
    }
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

/// A row in a sentence.
pub(super) fn name(row: &Row) -> String {
    match (row.params.points_per_m2, row.params.hz) {
        (Some(_), Some(_)) => format!("{} ({})", row.method, setting(&row.params)),
        _ => row.method.clone(),
    }
}

/// All tables, columns aligned. Columns that nothing fills are left out.
pub(super) fn text(results: &Results) -> String {
    let mut text = String::new();
    for case in &results.cases {
        text.push_str(&format!("{}\n", case.name));
        text.push_str(&format!("{}\n", conditions(case)));
        text.push_str(&aligned(&lines(case)));
        text.push('\n');
    }
    for advice in &results.advice {
        text.push_str(&format!("note: {}\n", sentence(results, advice)));
    }
    text
}

/// How a case was run, in a line.
pub(super) fn conditions(case: &Case) -> String {
    let frames = case.truth.frames.len();
    format!(
        "{} triangles; {frames} picture{} of {} × {} over {:.2} s; truth {} rays a pixel, own noise {:.2} %; radius {:.3} m",
        case.scene.triangles,
        if frames == 1 { "" } else { "s" },
        case.width,
        case.height,
        case.seconds,
        case.reference_rays,
        100.0 * case.truth.noise_rms,
        case.radius_m
    )
}

/// A note with the case that it is about, where there are several.
pub(super) fn sentence(results: &Results, advice: &super::results::Advice) -> String {
    match advice.case.and_then(|index| results.cases.get(index)).filter(|_| results.cases.len() > 1) {
        Some(case) => format!("{}: {}", case.name, advice.text),
        None => advice.text.clone(),
    }
}

/// Titles and cells of the columns that any row fills.
fn lines(case: &Case) -> Vec<Vec<String>> {
    let rows: Vec<[String; COLUMNS.len()]> = case.rows.iter().map(cells).collect();
    let filled = |column: usize| rows.iter().any(|cells| cells[column] != "–");
    let columns: Vec<usize> = (0..COLUMNS.len()).filter(|&c| c < 2 || filled(c)).collect();
    let titles = columns.iter().map(|&c| COLUMNS[c].0.to_owned()).collect();
    let picked = rows.iter().map(|cells| columns.iter().map(|&c| cells[c].clone()).collect());
    std::iter::once(titles).chain(picked).collect()
}

fn aligned(lines: &[Vec<String>]) -> String {
    let columns = lines.first().map_or(0, Vec::len);
    let width = |column: usize| lines.iter().map(|l| l[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for line in lines {
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

/// `results.md`: what to paste into an issue or a paper's notes.
pub(super) fn markdown(results: &Results) -> String {
    let escape = |cell: &str| cell.replace('|', "\\|");
    let mut text = format!("# {}\n\n`{}`\n", results.title, results.run.command);
    for case in &results.cases {
        text.push_str(&format!("\n## {}\n\n{}\n\n", case.name, conditions(case)));
        for (number, line) in lines(case).iter().enumerate() {
            text.push_str(&format!(
                "| {} |\n",
                line.iter().map(|c| escape(c)).collect::<Vec<_>>().join(" | ")
            ));
            if number == 0 {
                let rules = (0..line.len()).map(|c| if c < 2 { "---" } else { "---:" }).collect::<Vec<_>>();
                text.push_str(&format!("| {} |\n", rules.join(" | ")));
            }
        }
    }
    if !results.advice.is_empty() {
        text.push_str("\n## Notes\n\n");
        for advice in &results.advice {
            text.push_str(&format!("- {}\n", sentence(results, advice)));
        }
    }
    text
}
