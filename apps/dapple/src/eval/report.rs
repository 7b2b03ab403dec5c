//! `report.html`: the table and the pictures side by side.

use std::fmt::Write;

use super::results::{FrameRow, Results};
use super::table;

/// The page; its pictures lie beside it.
pub(super) fn html(results: &Results) -> String {
    let mut page = String::new();
    let title = format!("{}: visibility against ray-traced truth", results.scene.name);
    let _ = write!(
        page,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n<h1>{}</h1>\n",
        escape(&title),
        escape(&title)
    );
    summary(&mut page, results);
    numbers(&mut page, results);
    for (number, &time_s) in results.run.frame_times_s.iter().enumerate() {
        frame(&mut page, results, number, time_s);
    }
    facts(&mut page, results);
    page.push_str("</main>\n</body>\n</html>\n");
    page
}

fn summary(page: &mut String, results: &Results) {
    let run = &results.run;
    let best =
        results.rows.iter().filter(|r| r.kbit_per_s.is_some() && r.compared_pixels > 0).max_by(|a, b| {
            a.visibility_psnr_db.unwrap_or(f64::MAX).total_cmp(&b.visibility_psnr_db.unwrap_or(f64::MAX))
        });
    if let Some(row) = best {
        let _ = writeln!(
            page,
            "<p class=\"lead\">Best from points: <b>{}</b> ({}), visibility {} at <b>{:.1} kbit/s</b>.</p>",
            escape(&row.method),
            escape(&table::setting(&row.params)),
            row.visibility_psnr_db.map_or("equal to the truth".to_owned(), |v| format!("{v:.2} dB")),
            row.kbit_per_s.unwrap_or(0.0),
        );
    }
    let _ = writeln!(
        page,
        "<p>{} pictures of {} × {} pixels ({}× supersampled) along the path {} ({:.2} s), compared with {} rays a pixel \
         within {:.3} m.</p>",
        run.frame_times_s.len(),
        run.width,
        run.height,
        run.supersample * run.supersample,
        escape(&run.path),
        run.seconds,
        run.reference_rays,
        run.radius_m,
    );
}

fn numbers(page: &mut String, results: &Results) {
    page.push_str("<div class=\"scroll\"><table>\n<thead><tr>");
    for (column, explanation) in table::COLUMNS.iter().zip(table::EXPLANATIONS) {
        let _ = write!(page, "<th title=\"{}\">{}</th>", escape(explanation), escape(column));
    }
    page.push_str("</tr></thead>\n<tbody>\n");
    for row in &results.rows {
        page.push_str("<tr>");
        for cell in table::cells(row) {
            let _ = write!(page, "<td>{}</td>", escape(&cell));
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</tbody></table></div>\n<details><summary>What the columns mean</summary><dl>\n");
    for (column, explanation) in table::COLUMNS.iter().zip(table::EXPLANATIONS) {
        let _ = writeln!(page, "<dt>{}</dt><dd>{}</dd>", escape(column), escape(explanation));
    }
    page.push_str("</dl></details>\n");
}

fn frame(page: &mut String, results: &Results, number: usize, time_s: f64) {
    let _ = writeln!(page, "<h2>Picture {} at {time_s:.2} s</h2>\n<div class=\"pictures\">", number + 1);
    let stem = format!("{number:03}-truth");
    card(
        page,
        "truth",
        &format!("{} rays a pixel", results.run.reference_rays),
        &[("picture", &format!("{stem}-beauty.png")), ("visibility", &format!("{stem}-visibility.png"))],
    );
    for row in &results.rows {
        let Some(frame) = row.frames.get(number) else { continue };
        let psnr = frame.visibility_psnr_db.map_or("equal".to_owned(), |v| format!("{v:.2} dB"));
        let name = match table::setting(&row.params).as_str() {
            "–" => row.method.clone(),
            setting => format!("{} ({setting})", row.method),
        };
        let FrameRow { beauty, visibility, error, .. } = frame;
        let caption = format!("visibility {psnr}, FLIP {:.4}", frame.flip);
        card(
            page,
            &name,
            &caption,
            &[
                ("picture", beauty),
                ("visibility", visibility),
                ("error of visibility: blue too dark, orange too bright, full color at 0.25", error),
            ],
        );
    }
    page.push_str("</div>\n");
}

fn card(page: &mut String, name: &str, caption: &str, pictures: &[(&str, &str)]) {
    let _ = writeln!(page, "<section><h3>{}</h3><p>{}</p>", escape(name), escape(caption));
    for (what, file) in pictures {
        let _ = writeln!(
            page,
            "<figure><a href=\"{0}\"><img src=\"{0}\" alt=\"{1}: {2}\" loading=\"lazy\"></a><figcaption>{2}</figcaption></figure>",
            escape(file),
            escape(name),
            escape(what),
        );
    }
    page.push_str("</section>\n");
}

fn facts(page: &mut String, results: &Results) {
    let (scene, run, machine) = (&results.scene, &results.run, &results.machine);
    let facts = [
        ("command", run.command.clone()),
        ("scene", format!("{}, {} triangles, {} instances", scene.name, scene.triangles, scene.instances)),
        ("scene hash", scene.hash.clone()),
        ("seed", run.seed.to_string()),
        (
            "program",
            format!("dapple {}, commit {}", run.dapple_version, run.commit.as_deref().unwrap_or("unknown")),
        ),
        ("machine", format!("{}, {} threads, {}", machine.cpu, machine.threads, machine.os)),
    ];
    page.push_str("<h2>How this was made</h2>\n<dl>\n");
    for (name, value) in facts {
        let _ = writeln!(page, "<dt>{name}</dt><dd><code>{}</code></dd>", escape(&value));
    }
    page.push_str("</dl>\n");
    if !scene.warnings.is_empty() {
        page.push_str("<h3>Warnings of the loader</h3>\n<ul>\n");
        for warning in &scene.warnings {
            let _ = writeln!(page, "<li>{}</li>", escape(warning));
        }
        page.push_str("</ul>\n");
    }
}

fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c => escaped.push(c),
        }
    }
    escaped
}

const STYLE: &str = "\
:root { color-scheme: light dark; font: 15px/1.5 system-ui, sans-serif; }
body { margin: 0; }
main { max-width: 110rem; margin: 0 auto; padding: 1rem 1.5rem 3rem; }
h1 { font-size: 1.5rem; overflow-wrap: anywhere; } h2 { font-size: 1.2rem; margin-top: 2.5rem; } h3 { font-size: 1rem; margin: 0; }
.lead { font-size: 1.1rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .3rem .8rem; text-align: right; white-space: nowrap; border-bottom: 1px solid #8884; }
th:nth-child(-n+2), td:nth-child(-n+2) { text-align: left; }
th { cursor: help; }
.pictures { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(26rem, 100%), 1fr)); gap: 1.5rem; }
section p { margin: 0 0 .3rem; opacity: .75; }
figure { margin: 0 0 .7rem; }
img { width: 100%; height: auto; display: block; border-radius: 4px; background: #8883; }
figcaption { font-size: .85rem; opacity: .75; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1rem; }
dd { margin: 0; } code { overflow-wrap: anywhere; }
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_become_markup() {
        assert_eq!(escape("<a href='x'>\"&"), "&lt;a href=&#39;x&#39;&gt;&quot;&amp;");
    }
}
