//! What each viewer costs, for more and more of them.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use dapple_session::GuestConfig;
use serde::Serialize;
use tokio::sync::watch;

use super::percentile;
use super::served::Served;
use super::swarm::Bot;
use crate::args::ViewersArgs;
use crate::file::write_file;
use crate::progress::Bar;

/// Viewers join so far apart, as a crowd would through a door.
const APART: Duration = Duration::from_millis(2);

/// How long all may take to join.
const JOIN_TIMEOUT: Duration = Duration::from_secs(120);

/// The figures of one number of viewers.
#[derive(Debug, Serialize)]
struct Row {
    viewers: u32,
    /// Seconds of processor that the server takes a second, all of it.
    server_cpu: f64,
    /// Of a step, what tracing and encoding take of all processors together, milliseconds; absent where that cannot be known.
    light_cpu_ms: Option<f64>,
    /// Everything else that the server's processors do, a viewer, microseconds a second.
    viewer_cpu_us: Option<f64>,
    /// Mean length of a step, milliseconds, and steps a second.
    step_ms: f64,
    steps_per_s: f64,
    rays_per_step: f64,
    age_p50_ms: f64,
    age_p99_ms: f64,
    /// Of light, a viewer.
    kbit_per_s: f64,
    /// From connecting to the first light whole, median, milliseconds.
    join_p50_ms: f64,
    frames_per_s: f64,
    memory_mb: f64,
}

pub(crate) fn run(args: &ViewersArgs) -> Result<()> {
    if args.counts.is_empty() || args.counts.iter().any(|count| !(1..=20_000).contains(count)) {
        bail!("--counts must be numbers of viewers, 1 to 20000");
    }
    if !(args.seconds.is_finite() && args.seconds > 0.0) {
        bail!("--seconds is {}, must be above 0", args.seconds);
    }
    let most = args.counts.iter().max().copied().unwrap_or(1);
    // Their sockets, on this side.
    #[cfg(unix)]
    let _ = rlimit::increase_nofile_limit(u64::from(most) + 256);
    let max_viewers = (most + 16).to_string();
    let served = match &args.url {
        Some(url) => Served::running(url, args.served.moq.as_deref())?,
        None => Served::start(&args.served, &["--max-viewers", &max_viewers])?,
    };
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .context("cannot start the threads of viewers")?;
    say!(
        "{:>8} {:>10} {:>13} {:>13} {:>8} {:>8} {:>9} {:>9} {:>8} {:>8} {:>7}",
        "viewers",
        "server CPU",
        "light/step",
        "each viewer",
        "step ms",
        "steps/s",
        "age p50",
        "age p99",
        "kbit/s",
        "join ms",
        "MB"
    );
    let mut rows = Vec::new();
    for count in &args.counts {
        let row = runtime.block_on(measure(&served, args, *count))?;
        say!(
            "{:>8} {:>8.1} % {:>13} {:>13} {:>8.1} {:>8.1} {:>6.1} ms {:>6.1} ms {:>8.1} {:>8.0} {:>7.0}",
            row.viewers,
            100.0 * row.server_cpu,
            row.light_cpu_ms.map_or("–".to_owned(), |ms| format!("{ms:.1} CPU ms")),
            row.viewer_cpu_us.map_or("–".to_owned(), |us| format!("{us:.0} CPU µs/s")),
            row.step_ms,
            row.steps_per_s,
            row.age_p50_ms,
            row.age_p99_ms,
            row.kbit_per_s,
            row.join_p50_ms,
            row.memory_mb
        );
        rows.push(row);
    }
    if let Some(path) = &args.output {
        write_file(path, &serde_json::to_vec_pretty(&rows)?)?;
    }
    Ok(())
}

async fn measure(served: &Served, args: &ViewersArgs, count: u32) -> Result<Row> {
    let (stop, stopped) = watch::channel(false);
    let bar = Bar::new("joining", u64::from(count));
    let mut bots: Vec<Arc<Bot>> = Vec::new();
    let mut tasks = Vec::new();
    for number in 0..count {
        let config = GuestConfig {
            bits_per_s: args.budget.map(|rate| rate.0),
            seed: u64::from(number),
            ..GuestConfig::default()
        };
        let bot = Bot::new(served, config, number < args.checked);
        bots.push(bot.clone());
        let (address, stopped) = (served.live.clone(), stopped.clone());
        tasks.push(tokio::spawn(async move { bot.view(&address, stopped).await }));
        bar.set(u64::from(number));
        tokio::time::sleep(APART).await;
    }
    let start = Instant::now();
    while bots.iter().any(|bot| bot.log().first_s.is_none()) {
        if start.elapsed() > JOIN_TIMEOUT {
            let missing = bots.iter().filter(|bot| bot.log().first_s.is_none()).count();
            let state =
                bots.iter().find(|bot| bot.log().first_s.is_none()).map(|bot| bot.state.borrow().clone());
            bail!("{missing} of {count} viewers have no light after {} s: {state:?}", JOIN_TIMEOUT.as_secs());
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    // What the joining left behind is over.
    tokio::time::sleep(Duration::from_secs(2)).await;
    drop(bar);
    let sum = |field: fn(&super::swarm::Log) -> u64| bots.iter().map(|bot| field(&bot.log())).sum::<u64>();
    let (bytes, frames) = (sum(|log| log.bytes), sum(|log| log.frames));
    for bot in &bots {
        bot.log().keeps_ages = true;
    }
    let before = served.get("metrics")?;
    let ((cpu, _), light, start) = (served.process()?, served.light_cpu(), Instant::now());
    tokio::time::sleep(Duration::from_secs_f64(args.seconds)).await;
    let light = served.light_cpu().zip(light).map(|(after, before)| after - before);
    let ((cpu_after, memory), seconds) = (served.process()?, start.elapsed().as_secs_f64());
    let after = served.get("metrics")?;
    let (bytes, frames) = (sum(|log| log.bytes) - bytes, sum(|log| log.frames) - frames);
    let mut ages: Vec<f64> = bots.iter().flat_map(|bot| std::mem::take(&mut bot.log().ages_s)).collect();
    ages.sort_by(f64::total_cmp);
    let mut joins: Vec<f64> = bots.iter().filter_map(|bot| bot.log().first_s).collect();
    joins.sort_by(f64::total_cmp);
    stop.send_replace(true);
    for task in tasks {
        task.await.context("a viewer ended in a panic")?;
    }
    check(&bots)?;
    let grown = |name| served.figure(&after, name) - served.figure(&before, name);
    let steps = grown("dapple_steps_total");
    let cpu = cpu_after - cpu;
    Ok(Row {
        viewers: count,
        server_cpu: cpu / seconds,
        light_cpu_ms: light.map(|light| 1e3 * light / steps.max(1.0)),
        viewer_cpu_us: light.map(|light| 1e6 * (cpu - light).max(0.0) / seconds / f64::from(count)),
        rays_per_step: grown("dapple_rays_total") / steps.max(1.0),
        step_ms: 1e3 * grown("dapple_stepping_seconds_total") / steps.max(1.0),
        steps_per_s: steps / seconds,
        age_p50_ms: 1e3 * percentile(&ages, 0.5),
        age_p99_ms: 1e3 * percentile(&ages, 0.99),
        kbit_per_s: bytes as f64 * 8e-3 / seconds / f64::from(count),
        join_p50_ms: 1e3 * percentile(&joins, 0.5),
        frames_per_s: frames as f64 / seconds / f64::from(count),
        memory_mb: memory as f64 * 1e-6,
    })
}

/// No viewer missed anything, and those that decode hold the same where they hold the same epoch.
fn check(bots: &[Arc<Bot>]) -> Result<()> {
    let mut held: std::collections::BTreeMap<(u64, u64), Vec<u8>> = std::collections::BTreeMap::new();
    for bot in bots {
        let log = bot.log();
        if let Some(failure) = log.failures.first() {
            bail!("a viewer could not take {} frames: {failure}", log.failures.len());
        }
        let Some(subscriber) = &log.subscriber else { continue };
        let (Some(store), Some(group), Some(epoch)) =
            (subscriber.store(), subscriber.group(), subscriber.epoch())
        else {
            bail!("a viewer holds nothing");
        };
        let known = held.entry((group, epoch)).or_insert_with(|| store.visibility().to_vec());
        if known != store.visibility() {
            bail!("two viewers hold different light of epoch {epoch}");
        }
    }
    Ok(())
}
