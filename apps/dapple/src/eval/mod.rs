//! `dapple eval`: server and client in one process along a camera path, against ray-traced truth.

pub(crate) mod quality;
#[path = "report.rs"]
mod report;
#[allow(dead_code, reason = "shown by the evaluation of schema 2")]
#[path = "report/mod.rs"]
mod report_2;
mod results;
#[allow(dead_code, reason = "written by the evaluation of schema 2")]
mod results_2;
mod run;
mod samples;
mod settings;
mod smoke;
mod table;
mod thin;

use anyhow::Result;

use crate::args::EvalArgs;
use crate::picture::write_file;
use crate::source;

use settings::Settings;

/// Runs an evaluation and writes results, report and pictures.
pub(crate) fn run(args: &EvalArgs) -> Result<()> {
    let loaded = source::load(&args.scene, Some(settings::DEFAULT_SCENE))?;
    let settings = Settings::new(args, &loaded)?;
    std::fs::create_dir_all(&args.out)
        .map_err(|e| anyhow::anyhow!("cannot create the folder {}: {e}", args.out.display()))?;
    say!("{}", settings.summary(&loaded));

    let results = run::evaluate(&loaded, &settings, &args.out)?;

    say!("\n{}", table::text(&results));
    let json = serde_json::to_vec_pretty(&results)?;
    write_file(&args.out.join("results.json"), &json)?;
    let report = args.out.join("report.html");
    write_file(&report, report::html(&results).as_bytes())?;
    let shown = std::fs::canonicalize(&report).unwrap_or(report);
    say!("report: {}", shown.display());
    if args.smoke {
        smoke::check(&results)?;
        say!("smoke: all bounds hold");
    }
    Ok(())
}
