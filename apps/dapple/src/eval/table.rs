//! Results as tables of text and of Markdown.

use super::columns::{Column, Setting, filled, number, settings};
use super::results::{Case, Figure, Results, Row};

/// A row's cells: method, setting, and the columns given; a dash where one does not apply.
fn cells(row: &Row, setting: &Setting, columns: &[&Column]) -> Vec<String> {
    let figures = columns.iter().map(|column| match (column.get)(row) {
        None => "–".to_owned(),
        // Only PSNR has no finite value, of equal pictures.
        Some(Figure { value: None, .. }) => "equal".to_owned(),
        Some(Figure { value: Some(value), ci95: None }) => number(value, column.digits),
        Some(Figure { value: Some(value), ci95: Some(ci95) }) => {
            format!("{} ± {}", number(value, column.digits), number(ci95, column.digits))
        }
    });
    [row.method.clone(), setting.to_string()].into_iter().chain(figures).collect()
}

/// A column's title with its unit.
fn title(column: &Column) -> String {
    if column.unit.is_empty() { column.title.to_owned() } else { format!("{} {}", column.title, column.unit) }
}

/// A row in a sentence.
pub(super) fn name(row: &Row) -> String {
    match (row.params.points_per_m2, row.params.hz) {
        (Some(n), Some(hz)) => format!("{} (N {n}, {hz} Hz)", row.method),
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

/// Titles and cells of the columns that any row of the case fills.
fn lines(case: &Case) -> Vec<Vec<String>> {
    let columns = filled(std::slice::from_ref(case));
    let named = ["method", "setting"].map(str::to_owned);
    let titles = named.into_iter().chain(columns.iter().map(|column| title(column))).collect();
    let rows = case.rows.iter().zip(settings(case));
    std::iter::once(titles).chain(rows.map(|(row, setting)| cells(row, &setting, &columns))).collect()
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
