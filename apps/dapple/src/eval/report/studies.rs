//! Studies on the page: their words and tables. Plots are drawn by the page's scripts.

use std::fmt::Write;
use std::io::Cursor;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::ImageReader;

use super::pictures::{media_type, shrink};
use super::results::{Results, StudyPicture, StudyTable};
use super::table::{study_lines, study_title};
use super::words::escape;

/// The link to the section; nothing if there is none.
pub(super) fn link(results: &Results) -> &'static str {
    if results.studies.is_empty() { "" } else { "<a href=\"#studies\">Studies</a>" }
}

/// The section; nothing without studies.
///
/// Pictures are read from `folder`, as many as fit into `budget_bytes`; of the others only their names are there.
pub(super) fn section(results: &Results, folder: &Path, mut budget_bytes: usize) -> String {
    let mut html = String::new();
    if results.studies.is_empty() {
        return html;
    }
    html.push_str(
        "<section id=\"studies\" aria-labelledby=\"studies-title\">\n<h2 id=\"studies-title\">Studies</h2>\n",
    );
    for (number, study) in results.studies.iter().enumerate() {
        let _ = writeln!(html, "<article class=\"study\">\n<h3>{}</h3>", escape(&study_title(study)));
        for note in &study.notes {
            let _ = writeln!(html, "<p class=\"note\">{}</p>", escape(note));
        }
        if !study.plots.is_empty() {
            let _ = writeln!(html, "<div id=\"study-{number}\" class=\"multiples scripted\"></div>");
        } else {
            // A script looks for it.
            let _ = writeln!(html, "<div id=\"study-{number}\" hidden></div>");
        }
        for table in &study.tables {
            write_table(&mut html, table);
        }
        if !study.pictures.is_empty() {
            html.push_str("<div class=\"shots\">\n");
            for picture in &study.pictures {
                write_picture(&mut html, picture, folder, &mut budget_bytes);
            }
            html.push_str("</div>\n");
        }
        html.push_str("</article>\n");
    }
    html.push_str("</section>");
    html
}

fn write_picture(html: &mut String, picture: &StudyPicture, folder: &Path, budget_bytes: &mut usize) {
    let (title, file) = (escape(&picture.title), escape(&picture.file));
    let bytes = std::fs::read(folder.join(&picture.file)).ok().and_then(|bytes| shrink(&bytes));
    let shown = match bytes.filter(|bytes| bytes.len() <= *budget_bytes) {
        Some(bytes) => {
            *budget_bytes -= bytes.len();
            let data = STANDARD.encode(&bytes);
            // Their size is known before they are, so that nothing below moves while they are decoded.
            let size = ImageReader::new(Cursor::new(&bytes)).with_guessed_format().ok();
            let size = size.and_then(|reader| reader.into_dimensions().ok());
            let size = size
                .map_or(String::new(), |(width, height)| format!(" width=\"{width}\" height=\"{height}\""));
            format!("<img src=\"data:{};base64,{data}\" alt=\"{title}\"{size}>", media_type(&bytes))
        }
        None => format!("<p class=\"empty\">{file}</p>"),
    };
    let _ = writeln!(html, "<figure>{shown}<figcaption>{title}</figcaption></figure>");
}

fn write_table(html: &mut String, table: &StudyTable) {
    let title = escape(&table.title);
    let _ = write!(
        html,
        "<h4>{title}</h4>\n<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{title}\"><table>\n"
    );
    for (number, line) in study_lines(table).iter().enumerate() {
        html.push_str(if number == 0 { "<thead><tr>" } else { "<tr>" });
        for (column, cell) in line.iter().enumerate() {
            let (tag, scope) = match (number, column) {
                (0, _) => ("th", " scope=\"col\""),
                (_, 0) => ("th", " scope=\"row\""),
                _ => ("td", ""),
            };
            let class = if column > 0 { " class=\"n\"" } else { "" };
            let _ = write!(html, "<{tag}{scope}{class}>{}</{tag}>", escape(cell));
        }
        html.push_str(if number == 0 { "</tr></thead>\n<tbody>\n" } else { "</tr>\n" });
    }
    html.push_str("</tbody></table></div>\n");
}
