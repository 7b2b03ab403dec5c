//! The command `dapple`: evaluate, render, bake, show, record and serve scenes.

#[macro_use]
mod say;

mod args;
mod bake;
mod bench;
mod demo;
mod direct_light;
mod eval;
mod exr_file;
mod file;
mod inspect;
mod judge;
mod light;
mod listen;
mod live;
mod page;
mod picture;
mod progress;
mod record;
mod render;
mod scene_command;
mod screen_space;
mod serve;
mod source;
mod transport;
mod view;
mod worker;

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::Parser;

use args::{Cli, Command, LogFormat};

fn main() -> ExitCode {
    let cli = Cli::parse();
    log(&cli.command);
    match run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Lines of the log go to standard error; `DAPPLE_LOG` says which.
fn log(command: &Command) {
    let (level, format) = match command {
        Command::Serve(args) => ("info", args.log_format),
        Command::Worker(_) => ("info", LogFormat::Text),
        _ => ("warn", LogFormat::Text),
    };
    // What the QUIC library warns of is its everyday; this program says itself what matters of it.
    let quiet = [
        "moq_net",
        "moq_noq",
        "moq_noq_proto",
        "moq_sock",
        "moq_tokio",
        "web_transport_moq",
        "web_transport_proto",
    ];
    let level = quiet.iter().fold(level.to_owned(), |level, name| format!("{level},{name}=error"));
    let filter = tracing_subscriber::EnvFilter::try_from_env("DAPPLE_LOG")
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new(level));
    let lines =
        tracing_subscriber::fmt().with_env_filter(filter).with_target(false).with_writer(std::io::stderr);
    match format {
        LogFormat::Json => lines.json().init(),
        LogFormat::Text => lines.with_ansi(std::io::stderr().is_terminal()).without_time().init(),
    }
}

fn run(cli: Cli) -> anyhow::Result<()> {
    // Windows must be opened on the program's first thread.
    if let Command::View(args) = &cli.command {
        return view::run(args);
    }
    // Those that write large files, which takes a while. The others may have drivers of graphics cards at work, which do not
    // like to be ended in order.
    if matches!(cli.command, Command::Bake(_) | Command::Record(_) | Command::Scene(_)) {
        file::watch_interrupts();
    }
    let threads = match &cli.command {
        Command::Eval(args) => match &args.verb {
            Some(args::EvalVerb::Reference(args)) => args.threads,
            _ => args.threads,
        },
        Command::Render(args) => args.threads,
        Command::Record(args) => args.threads,
        Command::Quality(args) => args.threads,
        Command::Bake(args) => args.threads,
        Command::Scene(_) | Command::Inspect(_) | Command::Demo(_) | Command::View(_) => 0,
        // Its light has threads of its own.
        Command::Serve(args) => return serve::run(args),
        Command::Bench(args) => return bench::run(args),
        Command::Worker(args) => return worker::run(args),
    };
    if threads > 1024 {
        anyhow::bail!("--threads is {threads}, must be 0 (one for each core) to 1024");
    }
    // The pool of the whole program, whose threads never end: a thread that has asked an OpenGL driver for something and
    // ends while the program does, as those of a dropped pool do, frees twice what the driver keeps of it.
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    rayon::scope(|_| match cli.command {
        Command::Eval(args) => eval::run(&args),
        Command::Render(args) => render::run(&args),
        Command::Quality(args) => eval::quality::run(&args),
        Command::Bake(args) => bake::run(&args),
        Command::Scene(args) => scene_command::run(&args),
        Command::Record(args) => record::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Demo(args) => demo::run(&args),
        Command::View(args) => view::run(&args),
        Command::Serve(args) => serve::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Worker(args) => worker::run(&args),
    })
}
