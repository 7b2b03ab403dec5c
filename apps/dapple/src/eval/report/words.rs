//! What the page says in words, without any script: summary, advice, the table, how it was made.

use std::fmt::Write;

use super::advice::errors;
use super::columns::{self, Column, Kind, Setting, bits, bytes, number, rank};
use super::figures::psnr_difference;
use super::results::{Case, Figure, Results, Row};

/// Text as HTML, in an attribute too.
pub(super) fn escape(text: &str) -> String {
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

/// What a case comes down to.
struct Headline<'a> {
    best: Place<'a>,
    /// The next method at the same points and rate, or else the next at any.
    rival: Option<Rival<'a>>,
    /// The best of what needs no stream, `none` not counted.
    traced: Option<Place<'a>>,
    none: Option<Place<'a>>,
}

struct Place<'a> {
    row: &'a Row,
    setting: &'a Setting,
    figure: Figure,
}

struct Rival<'a> {
    place: Place<'a>,
    same_bits: bool,
    /// Of the best over the rival; `None` if one of them is equal to the truth.
    gain_db: Option<f64>,
    /// Whether the pictures tell both apart.
    clear: bool,
}

fn headline<'a>(case: &'a Case, settings: &'a [Setting]) -> Option<Headline<'a>> {
    let places: Vec<Place> = (case.rows.iter().zip(settings))
        .filter_map(|(row, setting)| Some(Place { row, setting, figure: columns::visibility(row)? }))
        .collect();
    // The first of equals, so that a tie does not depend on how a library walks.
    let best_of = |keep: &dyn Fn(&Row) -> bool| {
        let mut best: Option<&Place> = None;
        for place in places.iter().filter(|place| keep(place.row)) {
            if best.is_none_or(|best| rank(place.figure, true) > rank(best.figure, true)) {
                best = Some(place);
            }
        }
        best.map(|place| Place { ..*place })
    };
    let streamed = |row: &Row| row.kbit_per_s.is_some();
    let best = best_of(&streamed).or_else(|| best_of(&|_| true))?;
    let row = best.row;
    let same_bits = |other: &Row| {
        other.params.points_per_m2 == row.params.points_per_m2 && other.params.hz == row.params.hz
    };
    let other = |other: &Row| streamed(other) && other.method != row.method;
    let rival = best_of(&|r| other(r) && same_bits(r)).or_else(|| best_of(&other)).map(|place| {
        let gain = psnr_difference(&errors(case, row), &errors(case, place.row));
        // Picture by picture: that some are harder than others is no doubt about the difference.
        let clear = gain.value.is_none_or(|db| db > gain.ci95.unwrap_or(0.0));
        Rival { same_bits: same_bits(place.row), gain_db: gain.value, clear, place }
    });
    let traced = best_of(&|r| !streamed(r) && r.method != "none" && r.method != row.method);
    let none = best_of(&|r| r.method == "none" && r.method != row.method);
    Some(Headline { best, rival, traced, none })
}

fn decibels(figure: Figure) -> String {
    match (figure.value, figure.ci95) {
        (None, _) => "equal to the truth".to_owned(),
        // Spaces that do not break: a number stays with its unit.
        (Some(value), None) => format!("{}\u{a0}dB", number(value, 1)),
        (Some(value), Some(ci95)) => format!("{}\u{a0}±\u{a0}{}\u{a0}dB", number(value, 1), number(ci95, 1)),
    }
}

fn named(place: &Place) -> String {
    match place.setting.to_string().as_str() {
        "" => format!("<b>{}</b>", escape(&place.row.method)),
        setting => format!("<b>{}</b> ({})", escape(&place.row.method), escape(setting)),
    }
}

/// What was compared, above the title.
pub(super) fn kicker(results: &Results) -> &'static str {
    let of_lights = results.studies.iter().all(|study| study.kind.starts_with("light-"));
    if super::is_of_studies(results) && of_lights {
        "Direct light of area lights against ray-traced truth"
    } else {
        "Ambient visibility against ray-traced truth"
    }
}

/// The first sentences: what a reader takes home.
pub(super) fn lead(results: &Results) -> String {
    let settings: Vec<_> = results.cases.iter().map(columns::settings).collect();
    let headlines: Vec<_> = (results.cases.iter().zip(&settings))
        .filter_map(|(case, settings)| Some((case, headline(case, settings)?)))
        .collect();
    match headlines.as_slice() {
        [] if super::is_of_studies(results) => "Studies alone: what each of them found is below.".to_owned(),
        [] => "Nothing was compared: no row has a pixel that shows geometry.".to_owned(),
        [(_, one)] => lead_of_one(one),
        many => lead_of_many(many),
    }
}

fn lead_of_one(headline: &Headline) -> String {
    let best = &headline.best;
    let mut text = format!("{} reaches <b>{}</b> of visibility", named(best), decibels(best.figure));
    match (best.row.kbit_per_s.and_then(|f| f.value), best.row.snapshot_bytes) {
        (Some(kbit), Some(join)) => {
            let _ = write!(text, " at <b>{}</b>, after {} to join", bits(kbit), bytes(join));
        }
        (Some(kbit), None) => {
            let _ = write!(text, " at <b>{}</b>", bits(kbit));
        }
        (None, _) => text.push_str(", without a stream"),
    }
    if let Some(rival) = &headline.rival {
        let than = match rival.same_bits {
            true => format!("<b>{}</b> from the same points", escape(&rival.place.row.method)),
            false => named(&rival.place),
        };
        match rival.gain_db {
            Some(gain) if rival.clear => {
                let _ = write!(text, "; that is <b>{} dB</b> above {than}", number(gain, 1));
            }
            Some(gain) => {
                let _ = write!(
                    text,
                    "; {than} is {} dB below, less than the pictures tell apart",
                    number(gain, 1)
                );
            }
            None => {}
        }
    }
    text.push('.');
    let others: Vec<String> = [&headline.traced, &headline.none]
        .into_iter()
        .flatten()
        .map(|place| match place.row.method.as_str() {
            "none" => format!("no occlusion at all {}", decibels(place.figure)),
            method => format!("{} {}", escape(method), decibels(place.figure)),
        })
        .collect();
    if !others.is_empty() {
        let _ = write!(text, " For comparison: {}.", others.join(", "));
    }
    text
}

fn lead_of_many(headlines: &[(&Case, Headline)]) -> String {
    // How often each method is best, in the order in which they first are.
    let mut wins: Vec<(&str, usize)> = Vec::new();
    for (_, headline) in headlines {
        let method = headline.best.row.method.as_str();
        match wins.iter_mut().find(|(name, _)| *name == method) {
            Some((_, count)) => *count += 1,
            None => wins.push((method, 1)),
        }
    }
    wins.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let (winner, count) = wins[0];
    let of_winner = || headlines.iter().map(|(_, h)| h).filter(|h| h.best.row.method == winner);
    let share = match (count, headlines.len()) {
        (2, 2) => "both cases".to_owned(),
        (count, all) if count == all => format!("all {all} cases"),
        (count, all) => format!("{count} of {all} cases"),
    };
    let mut text = format!("<b>{}</b> is nearest to the truth in {share}", escape(winner));
    if let Some((low, high)) = range(of_winner().filter_map(|h| h.best.figure.value)) {
        let _ = write!(text, ", with {} of visibility", between(low, high, 1, "dB"));
    }
    let kbit = of_winner().filter_map(|h| h.best.row.kbit_per_s?.value);
    if let Some((low, high)) = range(kbit) {
        let _ = write!(text, " at {}", between(low, high, 0, "kbit/s"));
    }
    if let Some((low, high)) = range(of_winner().filter_map(|h| h.rival.as_ref()?.gain_db)) {
        let _ = write!(text, "; the next method is {} below", between(low, high, 1, "dB"));
    }
    text.push('.');
    text
}

fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |range, v| {
        let (low, high) = range.unwrap_or((v, v));
        Some((low.min(v), high.max(v)))
    })
}

fn between(low: f64, high: f64, digits: usize, unit: &str) -> String {
    match (number(low, digits), number(high, digits)) {
        (low, high) if low == high => format!("<b>{low}\u{a0}{unit}</b>"),
        (low, high) => format!("<b>{low} to {high}\u{a0}{unit}</b>"),
    }
}

/// A small table with one line a case.
pub(super) fn headlines(results: &Results) -> String {
    if results.cases.len() < 2 {
        return String::new();
    }
    let mut html = "<div class=\"scroll\"><table class=\"headlines\">\n<caption class=\"hidden\">The best method of each \
        case</caption>\n<thead><tr><th scope=\"col\">case</th><th scope=\"col\">best from points</th>\
        <th scope=\"col\">visibility</th><th scope=\"col\">updates</th><th scope=\"col\">next method</th>\
        <th scope=\"col\">gain</th><th scope=\"col\">without a stream</th><th scope=\"col\">no occlusion</th></tr></thead>\n<tbody>\n"
        .to_owned();
    for case in &results.cases {
        let settings = columns::settings(case);
        let _ = write!(html, "<tr><th scope=\"row\">{}</th>", escape(&case.name));
        let Some(found) = headline(case, &settings) else {
            html.push_str("<td colspan=\"7\">nothing compared</td></tr>\n");
            continue;
        };
        let dash = || "–".to_owned();
        let short = |place: &Option<Place>, with_name: bool| {
            place.as_ref().map_or_else(dash, |p| {
                let value = decibels(Figure { ci95: None, ..p.figure });
                if with_name { format!("{} <i>{}</i>", value, escape(&p.row.method)) } else { value }
            })
        };
        let cells = [
            named(&found.best),
            decibels(found.best.figure),
            found.best.row.kbit_per_s.and_then(|f| f.value).map_or_else(dash, bits),
            found.rival.as_ref().map_or_else(dash, |r| match r.same_bits {
                true => escape(&r.place.row.method),
                false => named(&r.place),
            }),
            found.rival.as_ref().and_then(|r| Some((r.gain_db?, r.clear))).map_or_else(
                dash,
                |(gain, clear)| {
                    let sign = if gain > 0.0 { "+" } else { "" };
                    let doubt =
                        if clear { "" } else { " <i title=\"less than the pictures tell apart\">(?)</i>" };
                    format!("{sign}{}\u{a0}dB{doubt}", number(gain, 1))
                },
            ),
            short(&found.traced, true),
            short(&found.none, false),
        ];
        for cell in cells {
            let _ = write!(html, "<td>{cell}</td>");
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody></table></div>\n");
    html
}

/// What the figures cannot tell; nothing where there is nothing to say.
pub(super) fn advice(results: &Results) -> String {
    if results.advice.is_empty() {
        return String::new();
    }
    let mut html =
        "<aside class=\"advice\" aria-labelledby=\"advice-title\"><h2 id=\"advice-title\">Before you trust \
        these figures</h2><ul>\n"
            .to_owned();
    for advice in &results.advice {
        let case = advice.case.and_then(|case| results.cases.get(case));
        let about =
            case.filter(|_| results.cases.len() > 1).map(|case| format!("<b>{}</b>: ", escape(&case.name)));
        let _ = writeln!(html, "<li>{}{}</li>", about.unwrap_or_default(), with_flags(&advice.text));
    }
    html.push_str("</ul></aside>\n");
    html
}

/// What the truth's own noise means for figures.
fn noise(rms: f64) -> String {
    if rms <= 0.0 {
        return String::new();
    }
    let limit_db = number(-20.0 * rms.log10(), 1);
    format!(
        "; its own noise is {} (root mean square): no method can be seen above {limit_db} dB",
        number(rms, 4)
    )
}

/// Text with its command-line flags set apart.
fn with_flags(text: &str) -> String {
    let word = |word: &str| match word.starts_with("--") && word.len() > 2 {
        true => format!("<code class=\"word\">{}</code>", escape(word)),
        false => escape(word),
    };
    text.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

/// Text whose lines break between words alone.
fn whole_words(text: &str) -> String {
    let word = |word: &str| format!("<span class=\"word\">{}</span>", escape(word));
    text.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

/// All rows of all cases; scripts make it sortable.
pub(super) fn table(results: &Results) -> String {
    let columns = columns::filled(&results.cases);
    let many = results.cases.len() > 1;
    let mut html = "<div class=\"scroll tall\" tabindex=\"0\" role=\"region\" aria-label=\"Table of all figures\"><table \
        id=\"figures\">\n<thead><tr>"
        .to_owned();
    let names = [("case", "one scene along one camera path")].into_iter().filter(|_| many).chain([
        ("method", "where visibility comes from"),
        ("setting", "points spawned per m² (half are kept) and server rate, or rays a pixel"),
    ]);
    for (name, explanation) in names {
        let _ = write!(
            html,
            "<th scope=\"col\" data-key=\"{name}\" title=\"{}\">{name}</th>",
            escape(explanation)
        );
    }
    for column in &columns {
        let _ = write!(
            html,
            "<th scope=\"col\" class=\"n\" data-key=\"{}\" title=\"{}\">{}{}</th>",
            column.key,
            escape(column.explanation),
            escape(column.title),
            unit(column)
        );
    }
    html.push_str("</tr></thead>\n<tbody>\n");
    for (case_index, case) in results.cases.iter().enumerate() {
        let best: Vec<Option<f64>> = columns.iter().map(|column| best_rank(column, &case.rows)).collect();
        for (row_index, (row, setting)) in case.rows.iter().zip(columns::settings(case)).enumerate() {
            let _ = write!(html, "<tr data-case=\"{case_index}\" data-row=\"{row_index}\">");
            if many {
                let _ = write!(html, "<td>{}</td>", escape(&case.name));
            }
            let setting = Some(setting.to_string()).filter(|text| !text.is_empty()).unwrap_or("–".to_owned());
            let _ =
                write!(html, "<th scope=\"row\">{}</th><td>{}</td>", escape(&row.method), escape(&setting));
            for (column, best) in columns.iter().zip(&best) {
                cell(&mut html, column, (column.get)(row), *best);
            }
            html.push_str("</tr>\n");
        }
    }
    html.push_str(
        "</tbody></table></div>\n<details><summary>What the columns mean</summary><dl class=\"meanings\">\n",
    );
    for column in &columns {
        let _ = writeln!(
            html,
            "<dt>{}{}</dt><dd>{}</dd>",
            escape(column.title),
            unit(column),
            escape(column.explanation)
        );
    }
    html.push_str(
        "<dt>±</dt><dd>half of the 95 % interval, for other pictures of the same path; bold is the best of a case</dd>\n\
         </dl></details>\n",
    );
    html
}

fn unit(column: &Column) -> String {
    if column.unit.is_empty() { String::new() } else { format!(" <i>{}</i>", escape(column.unit)) }
}

/// The best of several rows; `None` where there is nothing to compare.
fn best_rank(column: &Column, rows: &[Row]) -> Option<f64> {
    let ranks = rows.iter().filter_map(|row| Some(rank((column.get)(row)?, column.more_is_better)));
    let ranks: Vec<f64> = ranks.collect();
    (column.kind == Kind::Quality && ranks.len() > 1)
        .then(|| ranks.into_iter().fold(f64::NEG_INFINITY, f64::max))
}

fn cell(html: &mut String, column: &Column, figure: Option<Figure>, best: Option<f64>) {
    let Some(figure) = figure else {
        html.push_str("<td class=\"n\">–</td>");
        return;
    };
    let is_best = best.is_some_and(|best| rank(figure, column.more_is_better) >= best);
    let class = if is_best { "n best" } else { "n" };
    match figure.value {
        None => {
            let _ = write!(html, "<td class=\"{class}\" data-v=\"Infinity\">equal</td>");
        }
        Some(value) => {
            let text = number(value, column.digits);
            let _ = write!(html, "<td class=\"{class}\" data-v=\"{value}\"><span>{text}</span>");
            if let Some(ci95) = figure.ci95 {
                let _ = write!(html, "<i>± {}</i>", number(ci95, column.digits));
            }
            html.push_str("</td>");
        }
    }
}

/// Whether times come from elsewhere.
fn elsewhere(results: &Results) -> &'static str {
    let mut rows = results.cases.iter().flat_map(|case| &case.rows);
    match rows.any(|row| row.times.machine != results.machine) {
        true => {
            "; some times were taken on another machine or with other threads, before the run continued here"
        }
        false => "",
    }
}

fn judge(results: &Results) -> String {
    let flip = format!("FLIP at {} pixels a degree", number(f64::from(results.judge.pixels_per_degree), 1));
    match &results.judge.lpips_weights {
        None => flip,
        Some(hash) => format!("{flip}; LPIPS (squeeze) with weights {hash}"),
    }
}

/// Command, machine, scenes: what it takes to get these figures again.
pub(super) fn made(results: &Results) -> String {
    let (run, machine) = (&results.run, &results.machine);
    let mut html = format!(
        "<div class=\"command\"><pre><code id=\"command\">{}</code></pre></div>\n<dl class=\"facts\">\n",
        whole_words(&run.command)
    );
    let commit = run.commit.as_deref().unwrap_or("unknown");
    let threads =
        if machine.threads == 1 { "1 thread".to_owned() } else { format!("{} threads", machine.threads) };
    for (name, value) in [
        ("program", format!("dapple {}, commit {commit}, file {}", run.dapple_version, run.program)),
        ("machine", format!("{}, {threads}, {}{}", machine.cpu, machine.os, elsewhere(results))),
        ("metrics", judge(results)),
    ] {
        let _ = writeln!(html, "<dt>{name}</dt><dd>{}</dd>", escape(&value));
    }
    html.push_str("</dl>\n");
    for case in &results.cases {
        let scene = &case.scene;
        let _ = write!(
            html,
            "<details class=\"case\"{}><summary>{}</summary>\n<dl class=\"facts\">\n",
            if results.cases.len() == 1 { " open" } else { "" },
            escape(&case.name)
        );
        let pictures = match case.truth.frames.len() {
            1 => "1 picture".to_owned(),
            count => format!("{} pictures", number(count as f64, 0)),
        };
        for (name, value) in [
            (
                "scene",
                format!(
                    "{}: {} triangles, {} instances",
                    scene.name,
                    number(scene.triangles as f64, 0),
                    number(scene.instances as f64, 0)
                ),
            ),
            ("scene hash", scene.hash.clone()),
            (
                "path",
                match &case.animation {
                    None => format!("{}, {} s", case.path, number(case.seconds, 2)),
                    Some(name) => format!("{}, {} s of animation {name}", case.path, number(case.seconds, 2)),
                },
            ),
            (
                "pictures",
                format!(
                    "{pictures} of {} × {}, {} samples a pixel",
                    case.width,
                    case.height,
                    case.supersample * case.supersample
                ),
            ),
            (
                "truth",
                format!(
                    "{} rays a pixel within {} m{}",
                    number(f64::from(case.reference_rays), 0),
                    case.radius_m,
                    noise(case.truth.noise_rms)
                ),
            ),
            ("seed", case.seed.to_string()),
        ] {
            let _ = writeln!(html, "<dt>{name}</dt><dd>{}</dd>", escape(&value));
        }
        html.push_str("</dl>\n");
        if !scene.warnings.is_empty() {
            html.push_str("<h3>Warnings of the loader</h3>\n<ul>\n");
            for warning in &scene.warnings {
                let _ = writeln!(html, "<li>{}</li>", escape(warning));
            }
            html.push_str("</ul>\n");
        }
        html.push_str("</details>\n");
    }
    html
}
