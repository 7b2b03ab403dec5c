//! `dapple eval`: server and client in one process along camera paths, against ray-traced truth.
//!
//! A [`plan`] of scenes and settings is run case by case (a scene along a path: [`stage`]) and job by job (one server with all
//! methods that look it up: [`job`]). Truth is kept in files ([`truth`]), finished jobs in a [`journal`], so that a stopped run continues.

mod advice;
mod columns;
mod ends;
mod export;
mod figures;
mod job;
mod journal;
mod pair;
mod plan;
pub(crate) mod quality;
mod reference;
mod report;
mod results;
mod run;
mod samples;
#[cfg(feature = "sas")]
mod sas;
mod settle;
mod smoke;
mod stage;
mod still;
mod study;
mod table;
mod thin;
mod truth;
mod verbs;
mod work;

use std::path::Path;

use anyhow::{Result, bail};

use crate::args::EvalArgs;
use crate::picture::write_file;

use plan::Plan;
use results::Results;

/// Runs an evaluation and writes results, report and pictures.
pub(crate) fn run(args: &EvalArgs) -> Result<()> {
    if let Some(verb) = &args.verb {
        return verbs::run(verb);
    }
    let plan = Plan::new(&args.scenes, &args.options)?;
    let (results, _lock) = run::evaluate(&plan, args)?;
    say!("{}", table::text(&results));
    write(&results, &args.out)?;
    if args.smoke {
        smoke::check(&results)?;
        say!("smoke: all bounds hold");
    }
    match results.failures.as_slice() {
        [] => Ok(()),
        failures => {
            let scenes: Vec<&str> = failures.iter().map(|f| f.scene.as_str()).collect();
            bail!("could not be evaluated, for the reasons above: {}", scenes.join(", "))
        }
    }
}

/// Writes everything but the pictures, and says where the report lies.
fn write(results: &Results, out: &Path) -> Result<()> {
    write_tables(results, out)?;
    let report = out.join("report.html");
    write_file(&report, report::html(results, out)?.as_bytes())?;
    let shown = std::fs::canonicalize(&report).unwrap_or(report);
    say!("report: {}", shown.display());
    Ok(())
}

/// Writes the figures alone.
fn write_tables(results: &Results, out: &Path) -> Result<()> {
    write_file(&out.join("results.json"), &serde_json::to_vec_pretty(results)?)?;
    write_file(&out.join("results.csv"), &export::rows_csv(results)?)?;
    write_file(&out.join("frames.csv"), &export::frames_csv(results)?)?;
    write_file(&out.join("results.md"), table::markdown(results).as_bytes())
}
