//! Results as tables of text and of Markdown.

use super::columns::{Column, Setting, filled, number, settings};
use super::results::{Case, Figure, Results, Row, StudyColumn, StudyResult, StudyRow, StudyTable};

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
        text.push_str(&aligned(&lines(case), 2));
        text.push('\n');
    }
    for study in &results.studies {
        text.push_str(&format!("{}\n", study_title(study)));
        for table in &study.tables {
            text.push_str(&format!("{}\n{}\n", table.title, aligned(&study_lines(table), 1)));
        }
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

/// What a study is of, in a line.
pub(super) fn study_title(study: &StudyResult) -> String {
    match &study.subject {
        Some(subject) => format!("{}: {subject}", study.title),
        None => study.title.clone(),
    }
}

/// Titles and cells of a study's table.
pub(super) fn study_lines(table: &StudyTable) -> Vec<Vec<String>> {
    let title = |column: &StudyColumn| match column.unit.as_str() {
        "" => column.title.clone(),
        unit => format!("{} {unit}", column.title),
    };
    let titles = std::iter::once(String::new()).chain(table.columns.iter().map(title)).collect();
    let cells = |row: &StudyRow| {
        let values = row.values.iter().zip(&table.columns);
        let values =
            values.map(|(value, column)| value.map_or("–".to_owned(), |v| number(v, column.digits)));
        std::iter::once(row.name.clone()).chain(values).collect()
    };
    std::iter::once(titles).chain(table.rows.iter().map(cells)).collect()
}

/// Columns of text; so many at the left are words.
fn aligned(lines: &[Vec<String>], words: usize) -> String {
    let columns = lines.first().map_or(0, Vec::len);
    let width = |column: usize| lines.iter().map(|l| l[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for line in lines {
        for (column, cell) in line.iter().enumerate() {
            let pad = " ".repeat(widths[column] - cell.chars().count());
            // Words left, numbers right.
            let padded = if column < words { format!("{cell}{pad}  ") } else { format!("{pad}{cell}  ") };
            text.push_str(&padded);
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    }
    text
}

/// `results.md`: what to paste into an issue or a paper's notes.
pub(super) fn markdown(results: &Results) -> String {
    let mut text = format!("# {}\n\n`{}`\n", results.title, results.run.command);
    for case in &results.cases {
        text.push_str(&format!("\n## {}\n\n{}\n\n", case.name, conditions(case)));
        text.push_str(&markdown_table(&lines(case), 2));
    }
    for study in &results.studies {
        text.push_str(&format!("\n## {}\n", study_title(study)));
        for note in &study.notes {
            text.push_str(&format!("\n{note}\n"));
        }
        for table in &study.tables {
            text.push_str(&format!("\n### {}\n\n{}", table.title, markdown_table(&study_lines(table), 1)));
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

/// A table whose first columns are words.
fn markdown_table(lines: &[Vec<String>], words: usize) -> String {
    let mut text = String::new();
    for (number, line) in lines.iter().enumerate() {
        let cells: Vec<String> = line.iter().map(|cell| cell.replace('|', "\\|")).collect();
        text.push_str(&format!("| {} |\n", cells.join(" | ")));
        if number == 0 {
            let rules: Vec<&str> =
                (0..line.len()).map(|column| if column < words { "---" } else { "---:" }).collect();
            text.push_str(&format!("| {} |\n", rules.join(" | ")));
        }
    }
    text
}
