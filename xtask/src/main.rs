//! The project's own checks: `cargo xtask ci` is the one definition of "checked".

mod markdown;
mod relay;
mod seams;
mod skipped;
mod steps;
mod tidy;
mod wasm;

use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};

use steps::{Runner, Step};

/// Checks and tests of the Dapple workspace.
#[derive(Parser)]
#[command(name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand, Clone, Copy)]
enum Task {
    /// Formatting, lints, the direction of dependencies, tidiness.
    Check,
    /// All tests and documentation examples (by cargo-nextest where it is installed).
    Test,
    /// Tidiness only: file heads and lengths, links, machine paths, golden images ...
    Tidy,
    /// The page, into target/web, and its size.
    Wasm,
    /// A MoQ relay, unmodified, into target/relay: tests run sessions through it.
    Relay,
    /// Everything: check, the page, a relay, the smoke evaluation, test.
    Ci,
}

fn main() -> ExitCode {
    match run(Arguments::parse().task) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(task: Task) -> Result<()> {
    let metadata = cargo_metadata::MetadataCommand::new()
        .no_deps()
        .exec()
        .context("cannot read the workspace: run this inside it, as `cargo xtask ...`")?;
    let mut runner = Runner::new(metadata);
    let check = [Step::Format, Step::Clippy, Step::ThinClient, Step::Seams, Step::Tidy];
    // The test runner's summary comes last, where readers and scripts look for it.
    let test = [Step::DocTests, Step::Tests];
    match task {
        Task::Check => runner.run(&check),
        Task::Test => runner.run(&test),
        Task::Tidy => runner.run(&[Step::Tidy]),
        Task::Wasm => runner.run(&[Step::Page]),
        Task::Relay => runner.run(&[Step::Relay]),
        Task::Ci => {
            runner.run(&check);
            // Before the tests, which open it in a browser.
            if wasm::has_target() {
                runner.run(&[Step::Page]);
            } else {
                runner.skip("skipped: the page, Rust cannot compile for browsers here");
            }
            if let Err(error) = relay::install(runner.target()) {
                runner.skip(&format!("skipped: sessions through relays, {error:#}"));
            }
            runner.run(&[Step::Build, Step::Smoke]);
            runner.run(&test);
        }
    }
    runner.finish()
}
