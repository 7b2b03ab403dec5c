//! `report.html`: one file with everything in it, which needs neither a network nor the files it was made from.
//!
//! Words and the table are made here and read well without scripts; plots and the viewer of pictures are the page's own
//! scripts over one island of JSON. Pictures are elements of their own, so that only those looked at are decoded.

mod island;
mod pictures;
mod studies;
#[cfg(test)]
mod tests;
mod words;

use std::fmt::Write;
use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::Deserialize;

use super::{advice, columns, figures, results, table};
use crate::picture::write_file;
use results::Results;
use words::escape;

const PAGE: &str = include_str!("page.html");
const STYLE: [&str; 3] =
    [include_str!("vendor/uPlot.min.css"), include_str!("page.css"), include_str!("viewer.css")];
/// In the order in which they build on each other; they share one scope.
const SCRIPTS: [&str; 12] = [
    include_str!("script/data.js"),
    include_str!("script/theme.js"),
    include_str!("script/plot.js"),
    include_str!("script/marks.js"),
    include_str!("script/quality.js"),
    include_str!("script/timelines.js"),
    include_str!("script/studies.js"),
    include_str!("script/table.js"),
    include_str!("script/stage.js"),
    include_str!("script/viewer.js"),
    include_str!("script/gestures.js"),
    include_str!("script/main.js"),
];
const PLOT_LIBRARY: &str = include_str!("vendor/uPlot.iife.min.js");
const PLOT_LICENSE: &str = include_str!("vendor/LICENSE");

/// The page of `results`, whose pictures lie in `folder`. A picture that cannot be read is a word on the page, no error.
pub(crate) fn html(results: &Results, folder: &Path) -> Result<String> {
    html_within(results, folder, pictures::BUDGET_BYTES)
}

fn html_within(results: &Results, folder: &Path, picture_bytes: usize) -> Result<String> {
    let mut shelf = island::Shelf::default();
    let mut island = island::Island::new(results, &mut shelf)?;
    let embedded = pictures::embed(results, folder, &mut shelf, picture_bytes);
    let left_out = left_out(results, &embedded);
    island.same = embedded.same;
    island.missing = embedded.missing;
    island.embedded = embedded.frames;
    let island = island.json()?;
    let scripts = SCRIPTS.join("\n");
    fill(&[
        ("title", &escape(&results.title)),
        ("style", &STYLE.join("\n")),
        ("body_class", if is_of_studies(results) { " class=\"of-studies\"" } else { "" }),
        ("kicker", words::kicker(results)),
        ("lead", &words::lead(results)),
        ("headlines", &words::headlines(results)),
        ("advice", &words::advice(results)),
        ("table", &words::table(results)),
        ("studies_link", studies::link(results)),
        ("studies", &studies::section(results, folder, picture_bytes / 4)),
        ("left_out", &left_out),
        ("made", &words::made(results)),
        ("island", &island),
        ("license", PLOT_LICENSE),
        ("library", PLOT_LIBRARY),
        ("scripts", &scripts),
        ("pictures", &embedded.elements),
    ])
}

/// Whether there are studies, and no cases.
fn is_of_studies(results: &Results) -> bool {
    results.cases.is_empty() && !results.studies.is_empty()
}

/// Puts values in the places that the page names; what values look like does not matter.
fn fill(values: &[(&str, &str)]) -> Result<String> {
    let mut html =
        String::with_capacity(PAGE.len() + values.iter().map(|(_, value)| value.len()).sum::<usize>());
    let mut rest = PAGE;
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, after) =
            after.split_once("}}").context("the page's template has a place without an end")?;
        let value = values.iter().find(|(key, _)| *key == name);
        html.push_str(before);
        html.push_str(
            value.with_context(|| format!("the page's template names {name}, which nothing fills"))?.1,
        );
        rest = after;
    }
    html.push_str(rest);
    Ok(html)
}

/// What is not in the page, in words; nothing if all is.
fn left_out(results: &Results, embedded: &pictures::Embedded) -> String {
    let mut html = String::new();
    if embedded.left_out > 0 {
        let here: usize = embedded.frames.iter().map(Vec::len).sum();
        let all: usize = results.cases.iter().map(|case| case.truth.frames.len()).sum();
        let _ = write!(
            html,
            "<p class=\"note\">This file holds the pictures of {here} of {all} moments: the worst of each method, and others \
             spread evenly along the paths. The rest ({} pictures) lie beside <code>results.json</code>; they are shown \
             too as long as this page lies there.</p>",
            embedded.left_out
        );
    }
    if !embedded.missing.is_empty() {
        let count = embedded.missing.len();
        let _ = write!(
            html,
            "<p class=\"note\">{} could not be read when this page was made.</p>",
            if count == 1 { "1 picture".to_owned() } else { format!("{count} pictures") }
        );
    }
    html
}

/// Writes the page of a `results.json` again, without tracing anything: to `out`, or beside the results.
pub(crate) fn rebuild(results: &Path, out: Option<&Path>) -> Result<()> {
    #[derive(Deserialize)]
    struct Head {
        schema: u32,
    }
    let shown = results.display();
    let bytes = std::fs::read(results).with_context(|| format!("cannot read {shown}"))?;
    let head: Head = serde_json::from_slice(&bytes)
        .with_context(|| format!("{shown} is not the results.json of an evaluation"))?;
    if head.schema != results::SCHEMA {
        bail!(
            "{shown} has schema {}, this program reads {}: evaluate again, or use the program that wrote it",
            head.schema,
            results::SCHEMA
        );
    }
    let parsed: Results =
        serde_json::from_slice(&bytes).with_context(|| format!("{shown} is damaged, or written by hand"))?;
    let folder = results.parent().unwrap_or(Path::new(""));
    let beside = folder.join("report.html");
    let out = out.unwrap_or(&beside);
    write_file(out, html(&parsed, folder)?.as_bytes())?;
    say!("report: {}", std::fs::canonicalize(out).unwrap_or_else(|_| out.to_owned()).display());
    Ok(())
}
