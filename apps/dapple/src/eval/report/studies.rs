//! Studies on the page: their words and tables. Plots are drawn by the page's scripts.

use std::fmt::Write;

use super::results::{Results, StudyTable};
use super::table::{study_lines, study_title};
use super::words::escape;

/// The link to the section; nothing if there is none.
pub(super) fn link(results: &Results) -> &'static str {
    if results.studies.is_empty() { "" } else { "<a href=\"#studies\">Studies</a>" }
}

/// The section; nothing without studies.
pub(super) fn section(results: &Results) -> String {
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
        html.push_str("</article>\n");
    }
    html.push_str("</section>");
    html
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
