//! The steps of a check, run one after the other; a failure is noted and the rest still runs.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use cargo_metadata::Metadata;

use crate::{relay, seams, skipped, tidy, wasm};

/// One thing that can pass or fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    /// `cargo fmt --check`.
    Format,
    /// Clippy on everything, warnings denied.
    Clippy,
    /// Clippy on the thin client with no optional feature: it must build without what only servers need.
    ThinClient,
    /// The dependency tables of `ARCHITECTURE.md` against the manifests.
    Seams,
    /// See [`tidy`].
    Tidy,
    /// The page, with what its tests need.
    Page,
    /// See [`relay`].
    Relay,
    /// Programs and tests, compiled.
    Build,
    /// The whole loop on a small scene, by the command itself.
    Smoke,
    /// Documentation examples.
    DocTests,
    /// All other tests.
    Tests,
}

impl Step {
    fn name(self) -> &'static str {
        match self {
            Step::Format => "format",
            Step::Clippy => "clippy",
            Step::ThinClient => "thin client",
            Step::Seams => "seams",
            Step::Tidy => "tidy",
            Step::Page => "page",
            Step::Relay => "relay",
            Step::Build => "build",
            Step::Smoke => "smoke evaluation",
            Step::DocTests => "documentation examples",
            Step::Tests => "tests",
        }
    }
}

/// Runs steps and remembers how they ended.
pub(crate) struct Runner {
    metadata: Metadata,
    passed: Vec<String>,
    failed: Vec<String>,
    skipped: Vec<String>,
}

impl Runner {
    /// For the workspace that `metadata` describes.
    pub(crate) fn new(metadata: Metadata) -> Self {
        Self { metadata, passed: Vec::new(), failed: Vec::new(), skipped: Vec::new() }
    }

    /// Runs the steps in order.
    pub(crate) fn run(&mut self, steps: &[Step]) {
        for &step in steps {
            println!("\n== {}", step.name());
            let started = Instant::now();
            let outcome = self.run_step(step);
            // Where the time of a check goes is seen in its last lines.
            let ended = format!("{} ({:.0} s)", step.name(), started.elapsed().as_secs_f64());
            match outcome {
                Ok(()) => self.passed.push(ended),
                Err(error) => {
                    eprintln!("{}: {error:#}", step.name());
                    self.failed.push(ended);
                }
            }
        }
    }

    /// Notes that something was left out.
    pub(crate) fn skip(&mut self, line: &str) {
        println!("\n{line}");
        self.skipped.push(line.to_owned());
    }

    /// Prints what was skipped, passed and failed; an error if anything failed.
    pub(crate) fn finish(self) -> Result<()> {
        println!();
        for line in &self.skipped {
            println!("{line}");
        }
        if !self.passed.is_empty() {
            println!("passed: {}", self.passed.join(", "));
        }
        if !self.failed.is_empty() {
            bail!("failed: {}", self.failed.join(", "));
        }
        Ok(())
    }

    fn run_step(&mut self, step: Step) -> Result<()> {
        match step {
            Step::Format => self.cargo(&["fmt", "--all", "--check"]),
            Step::Clippy => self.cargo(&[
                "clippy",
                "--workspace",
                "--all-targets",
                "--all-features",
                "--",
                "--deny=warnings",
            ]),
            Step::ThinClient => self.cargo(&[
                "clippy",
                "--package=dapple-client",
                // What viewers speak, without the server's end.
                "--package=dapple-session",
                "--lib",
                "--no-default-features",
                "--",
                "--deny=warnings",
            ]),
            Step::Seams => seams::check(&self.metadata),
            Step::Tidy => tidy::check(self.root()),
            Step::Page => self.page(),
            Step::Relay => relay::install(self.target()),
            // All at once: tests bring features of their own, and a program built before them would be compiled twice, with half of
            // what it stands on.
            Step::Build => self.cargo(&["test", "--quiet", "--no-run", "--workspace", "--all-features"]),
            Step::Smoke => self.smoke(),
            Step::DocTests => self.cargo(&["test", "--doc", "--workspace", "--all-features"]),
            Step::Tests => self.tests(),
        }
    }

    fn smoke(&self) -> Result<()> {
        let program = self
            .metadata
            .target_directory
            .join("debug/dapple")
            .with_extension(std::env::consts::EXE_EXTENSION);
        println!("{program} eval --smoke");
        let status = Command::new(&program)
            .args(["eval", "--smoke"])
            .current_dir(self.root())
            .stdin(Stdio::null())
            .status()
            .with_context(|| format!("cannot start {program}"))?;
        if !status.success() {
            bail!("`dapple eval --smoke` ended with {status}");
        }
        Ok(())
    }

    fn page(&self) -> Result<()> {
        wasm::install_test_packages(self.root());
        wasm::build(self.root(), self.metadata.target_directory.as_std_path(), |arguments| {
            self.cargo(arguments)
        })
    }

    fn tests(&mut self) -> Result<()> {
        let nextest =
            self.command(&["nextest", "--version"]).stdout(Stdio::null()).stderr(Stdio::null()).status();
        if !nextest.is_ok_and(|status| status.success()) {
            println!("cargo-nextest is not installed: cargo's own runner is used");
            return self.cargo(&[
                "test",
                "--workspace",
                "--all-targets",
                "--all-features",
                "--no-fail-fast",
                "--",
                "--show-output",
            ]);
        }
        // In the workspace whatever the build folder is: `.config/nextest.toml` says so.
        let report = self.root().join("target/nextest/default/junit.xml");
        // Only this run's report counts; that there is none yet is no error.
        let _ = std::fs::remove_file(&report);
        let outcome = self.cargo(&["nextest", "run", "--workspace", "--all-features"]);
        match std::fs::read_to_string(&report) {
            Ok(text) => self.skipped.extend(skipped::skipped_lines(&text)),
            Err(error) => eprintln!("cannot list what was skipped: {}: {error}", report.display()),
        }
        outcome
    }

    /// Where what is built lies.
    pub(crate) fn target(&self) -> &Path {
        self.metadata.target_directory.as_std_path()
    }

    fn root(&self) -> &Path {
        self.metadata.workspace_root.as_std_path()
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let mut command = Command::new(cargo);
        command.args(arguments).current_dir(self.root()).stdin(Stdio::null());
        command
    }

    fn cargo(&self, arguments: &[&str]) -> Result<()> {
        let line = format!("cargo {}", arguments.join(" "));
        println!("{line}");
        let status = self.command(arguments).status().with_context(|| format!("cannot start `{line}`"))?;
        if !status.success() {
            bail!("`{line}` ended with {status}");
        }
        Ok(())
    }
}
