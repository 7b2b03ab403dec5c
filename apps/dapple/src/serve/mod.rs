//! `dapple serve`: a scene, lit for any number of viewers.
//!
//! ```text
//! engine (a thread): step ─► host ◄─► viewer tasks ◄─ transport ─► viewers
//!                                    web: page, scene, health, metrics
//! ```

mod accept;
mod asset;
mod engine;
mod figures;
mod hub;
#[cfg(feature = "moq")]
mod moq;
mod ration;
mod recording;
mod viewer;
mod web;
mod work;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, bail};
use dapple_scene::Scene;
use dapple_server::ServerConfig;
use dapple_server::shards::Shard;
use dapple_session::Role;
use dapple_session::host::{Access, Host, HostConfig};
use dapple_session::work::Setup;
use dapple_stream::PublisherConfig;
use tokio::runtime::Runtime;
use tokio::sync::watch;

use crate::args::{LightArgs, ServeArgs};
use crate::file::{check_writable, wait_for_interrupt};
use crate::light::server_config;
use crate::listen::{bind, url_of};
use crate::page::{MoqJson, built_page};
use crate::progress::Bar;
use asset::Asset;
use engine::Engine;
pub(crate) use engine::MARGIN_M;
pub(crate) use figures::{process_of, threads_of};
use hub::{Hub, Phase};
pub(crate) use ration::Ration;
use recording::LiveRecording;
pub(crate) use web::WORK_PATH;
use work::{WorkHub, Workforce};

/// Updates a second where none are given.
const DEFAULT_HZ: f64 = 30.0;

/// How long viewers have to go once the program is told to stop.
const DRAIN: Duration = Duration::from_secs(5);

/// How long those that only look on have to hear that it ends.
const LAST_WORDS: Duration = Duration::from_secs(2);

/// How the names of threads begin that trace and encode.
pub(crate) const LIGHT_THREADS: &str = "light";

/// How long the light's last step, and the end of a recording, may take.
const LAST_STEP: Duration = Duration::from_secs(5);

/// Connections beside those of viewers: for pages, scenes and figures.
const OTHER_CONNECTIONS: usize = 256;

/// Serves until told to stop.
pub(crate) fn run(args: &ServeArgs) -> Result<()> {
    let began = Instant::now();
    check(args)?;
    let tls = match (&args.tls_cert, &args.tls_key) {
        (Some(certificates), Some(key)) => Some(accept::tls(certificates, key)?),
        _ => None,
    };
    let socket = bind(&args.host, args.port)?;
    let page = match &args.page {
        Some(_) => Some(built_page(args.page.as_deref())?),
        None => built_page(None).ok(),
    };
    let asset = Arc::new(load(args)?);
    let light = LightArgs { hz: Some(args.light.hz.unwrap_or(DEFAULT_HZ)), ..args.light.clone() };
    let hz = light.hz();
    let mut config = server_config(&asset.scene, &light)?;
    // Groups of an earlier run of this server must not be taken for this one's.
    let since_1970 = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let first_group = since_1970.map_or(0, |since| since.as_millis() as u64);
    config.publish = PublisherConfig { first_group, ..config.publish };
    config.check(&asset.scene)?;
    let recording = match &args.record {
        Some(path) => Some(LiveRecording::create(path, asset.scene.hash().0, &asset.scene.name)?),
        None => None,
    };
    let host_config = HostConfig {
        hz,
        max_viewers: args.max_viewers,
        events_per_s: args.max_events,
        access: access(args),
        rungs: rungs(config.bits_per_s, args),
        parts: parts(&asset.scene, &config, args)?,
        playing: !args.paused,
        ..HostConfig::default()
    };
    let scene = asset.scene.clone();
    let access = host_config.access.clone();
    let hub = Arc::new(Hub::new(|now_us| Host::new(scene, host_config, now_us), began));

    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .context("cannot start the server's threads")?;
    let address = socket.local_addr().context("the listener has no address")?;
    let listener = {
        let _guard = runtime.enter();
        accept::listener(socket)?
    };
    let has_page = page.is_some();
    let step_s = args.load / hz;
    let (work, workers) = match args.workers {
        Some(parts) => {
            let (work, news) = WorkHub::new(
                setup(&config, step_s, &light),
                &asset.scene.hash().0,
                parts,
                args.worker_token.clone(),
            );
            let work = Arc::new(work);
            let edits = hub.host().state().2.clone();
            let workforce = Workforce::new(work.clone(), news, edits);
            (Some(work), Some((workforce, Duration::from_secs_f64(step_s))))
        }
        None => (None, None),
    };
    let (stop_accepting, stop) = watch::channel(false);
    let most = args.max_viewers as usize + OTHER_CONNECTIONS;
    let (moq, publishing) = start_moq(args, &hub, &runtime, first_group, most)?.unzip();
    let router = web::router(hub.clone(), asset.clone(), work, page, moq, config.update.radius_m);
    raise_file_limit(most as u64 + 64);
    let is_secure = tls.is_some();
    runtime.spawn(accept::accept(listener, router, tls, most, stop));

    let stop_light = Arc::new(AtomicBool::new(false));
    let ration = Ration::new(step_s, light.step.ray_budget);
    let engine =
        Engine { hub: hub.clone(), config, hz, ration, recording, workers, stop: stop_light.clone() };
    let engine = start(engine, args.threads)?;
    let url = url_of(address, if is_secure { "https" } else { "http" });
    announce(&url, &asset, has_page, is_secure, publishing.is_some());
    if let Some(parts) = args.workers {
        say!("It waits for workers: dapple worker --connect {url} --shard 1/{parts}, to {parts}/{parts}\n");
    }
    if !address.ip().is_loopback() && access.open_role() == Some(Role::Interact) {
        tracing::warn!(
            "whoever reaches this address may change the scene: --token interact=SECRET keeps that to some"
        );
    }
    let ended = wait(&runtime, &hub);

    drain(&runtime, &hub, &stop_accepting, publishing);
    stop_light.store(true, Ordering::Relaxed);
    let until = Instant::now() + LAST_STEP;
    while !engine.is_finished() && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(10));
    }
    if !engine.is_finished() {
        // In the middle of its start, which the program's end ends. There is nothing in its recording yet.
        if let Some(path) = &args.record {
            recording::discard(path);
        }
        runtime.shutdown_timeout(Duration::from_millis(500));
        return ended;
    }
    let light = engine.join().map_err(|_| anyhow!("the light ended in a panic"))?;
    runtime.shutdown_timeout(Duration::from_millis(500));
    light.and(ended)
}

/// What viewers are told of a session over MoQ, and the task that publishes it.
type Published = (MoqJson, tokio::task::JoinHandle<()>);

/// Serves over MoQ where that is wanted.
#[cfg(feature = "moq")]
fn start_moq(
    args: &ServeArgs,
    hub: &hub::SharedHub,
    runtime: &Runtime,
    first_group: u64,
    most: usize,
) -> Result<Option<Published>> {
    let scene = hub.host().scene().hash().0;
    let Some(moq) = moq::Moq::open(args, &scene, runtime)? else { return Ok(None) };
    let json = moq.json.clone();
    Ok(Some((json, moq.start(hub, runtime, first_group, most)?)))
}

#[cfg(not(feature = "moq"))]
fn start_moq(
    args: &ServeArgs,
    _: &hub::SharedHub,
    _: &Runtime,
    _: u64,
    _: usize,
) -> Result<Option<Published>> {
    if args.moq.is_some() || !args.relay.is_empty() {
        bail!("--moq, --relay: this program was built without MoQ: cargo build --release --features moq");
    }
    Ok(None)
}

fn check(args: &ServeArgs) -> Result<()> {
    if args.moq.is_none() && args.relay.is_empty() && (args.moq_name.is_some() || args.moq_at.is_some()) {
        bail!("--moq-name and --moq-at say where a session is over MoQ: it needs --moq or --relay too");
    }
    if args.moq.is_some() && access(args).open_role().is_none() {
        bail!(
            "--moq: over QUIC whoever knows the session's name may look, without a token. Leave out --moq or --token view=…, or publish to a \
             --relay that asks for tokens itself"
        );
    }
    if !(args.load > 0.0 && args.load <= 1.0) {
        bail!("--load is {}, must be above 0 to 1", args.load);
    }
    if !(1..=100_000).contains(&args.max_viewers) {
        bail!("--max-viewers is {}, must be 1 to 100000", args.max_viewers);
    }
    if !(1..=10_000).contains(&args.max_events) {
        bail!("--max-events is {}, must be 1 to 10000", args.max_events);
    }
    if args.rungs.len() > 8 {
        bail!("--rungs names {} streams, at most 8 are made", args.rungs.len());
    }
    if args.workers.is_some_and(|parts| !(1..=Shard::MOST).contains(&parts)) {
        bail!("--workers must be 1 to {}", Shard::MOST);
    }
    if args.workers.is_some() && args.light.visibility.adaptive > 0.0 {
        bail!(
            "--adaptive weighs density over the whole scene, which no worker sees: leave it out with --workers"
        );
    }
    if args.workers.is_some() && args.tls_cert.is_some() {
        bail!("workers speak plain HTTP: leave out --tls-cert, and put a proxy with TLS before the viewers");
    }
    if args.worker_token.as_deref() == Some("") {
        bail!("--worker-token is empty: give a secret, or leave it out");
    }
    let is_open =
        args.host.parse().is_ok_and(|ip: std::net::IpAddr| ip.is_loopback()) || args.host == "localhost";
    if args.workers.is_some() && args.worker_token.is_none() && (!is_open || !args.token.is_empty()) {
        bail!(
            "whoever reaches {} could light the scene: --worker-token SECRET keeps that to workers",
            args.host
        );
    }
    if args.threads > 1024 {
        bail!("--threads is {}, must be 0 (one for each core) to 1024", args.threads);
    }
    if let Some(path) = &args.record {
        if !path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("dapple")) {
            bail!("--record {} would hold a recording: name it .dapple", path.display());
        }
        check_writable(path).context("--record")?;
    }
    Ok(())
}

/// Who may do what.
fn access(args: &ServeArgs) -> Access {
    Access::new(args.token.iter().map(|token| (token.secret.clone(), token.role)).collect())
}

/// The instances of each part that viewers can take by itself: those of the workers, where streams are shared.
fn parts(scene: &Scene, config: &ServerConfig, args: &ServeArgs) -> Result<Vec<Vec<u32>>> {
    // Every viewer is told of all of them as it comes.
    const MOST_INSTANCES: usize = 20_000;
    const { assert!(Shard::MOST as usize <= dapple_session::MAX_PARTS) };
    let is_shared = args.moq.is_some() || !args.relay.is_empty();
    // A budget is that of all of it.
    let is_offered = is_shared && config.bits_per_s.is_none();
    let Some(of) = args.workers.filter(|of| is_offered && *of > 1) else { return Ok(Vec::new()) };
    if scene.instances.len() > MOST_INSTANCES {
        tracing::warn!(
            "the scene has more than {MOST_INSTANCES} instances: viewers take its light as one, not in parts"
        );
        return Ok(Vec::new());
    }
    Ok(Shard::all(of, scene, &config.generate)?)
}

/// What workers are told.
fn setup(config: &ServerConfig, step_s: f64, light: &LightArgs) -> Setup {
    Setup {
        points_per_m2: config.generate.points_per_m2,
        seed: config.generate.seed,
        rays: config.update.rays,
        rays_still: config.update.rays_still,
        radius_m: config.update.radius_m,
        cuts: config.cuts,
        area_lights: config.lights.is_some(),
        light_tolerance: config.lights.map(|lights| lights.tolerance),
        step_s,
        ray_budget: light.step.ray_budget,
    }
}

fn load(args: &ServeArgs) -> Result<Asset> {
    let _wheel = Bar::spinner("loading the scene");
    Asset::load(&args.scene, &args.spare)
}

/// The full stream and leaner ones.
fn rungs(full: Option<u64>, args: &ServeArgs) -> Vec<Option<u64>> {
    let leaner = args.rungs.iter().map(|rate| rate.0).filter(|bits| full.is_none_or(|full| *bits < full));
    std::iter::once(full).chain(leaner.map(Some)).collect()
}

/// Starts the light on threads of its own.
fn start(engine: Engine, threads: usize) -> Result<JoinHandle<Result<()>>> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|number| format!("{LIGHT_THREADS}-{number}"))
        .build()
        .context("cannot start the threads that trace")?;
    std::thread::Builder::new()
        .name(LIGHT_THREADS.to_owned())
        .spawn(move || pool.install(move || engine.run()))
        .context("cannot start the thread that lights")
}

/// Says where what is to be found.
fn announce(url: &str, asset: &Asset, has_page: bool, is_secure: bool, has_moq: bool) {
    say!("\n{} is lit here:", asset.title);
    if has_page {
        say!("  in a browser   {url}");
    } else {
        say!("  in a browser   not yet: build the page with `cargo xtask wasm`, then start again");
    }
    if !is_secure {
        say!("  in a window    dapple view --url {url}");
    }
    if has_moq {
        say!("  over QUIC      dapple view --url {url} --moq");
    }
    say!("  figures        {url}health  {url}metrics\nCtrl-C ends it\n");
}

/// Waits for a signal, or for the light to fail; meanwhile shows how the start goes on.
fn wait(runtime: &Runtime, hub: &Hub) -> Result<()> {
    let mut phases = hub.watch_phase();
    runtime.block_on(async {
        let mut bar = None;
        let interrupt = wait_for_interrupt();
        tokio::pin!(interrupt);
        loop {
            match &*phases.borrow_and_update() {
                Phase::Starting(what, mille) => {
                    let bar = bar.get_or_insert_with(|| Bar::new(what, 1000));
                    bar.message(what);
                    bar.set(u64::from(*mille));
                }
                Phase::Failed(reason) => bail!("{reason}"),
                Phase::Serving | Phase::Draining => bar = None,
            }
            tokio::select! {
                signal = &mut interrupt => {
                    signal.context("cannot wait for signals")?;
                    return Ok(());
                }
                changed = phases.changed() => changed.context("the light has ended")?,
            }
        }
    })
}

/// Tells viewers that it ends, and gives them time to hear it.
fn drain(
    runtime: &Runtime,
    hub: &Hub,
    stop_accepting: &watch::Sender<bool>,
    publishing: Option<tokio::task::JoinHandle<()>>,
) {
    tracing::info!("ending");
    hub.set_phase(Phase::Draining);
    hub.host().close();
    let until = Instant::now() + DRAIN;
    runtime.block_on(async {
        while hub.host().counts().viewers > 0 && Instant::now() < until {
            hub.step_done();
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        if let Some(publishing) = publishing {
            hub.step_done();
            let _ = tokio::time::timeout(LAST_WORDS, publishing).await;
        }
        // The last goodbyes are on their way.
        tokio::time::sleep(Duration::from_millis(50)).await;
    });
    stop_accepting.send_replace(true);
}

/// Allows as many open files as there may be connections, as far as the system does.
fn raise_file_limit(wanted: u64) {
    #[cfg(unix)]
    match rlimit::increase_nofile_limit(wanted) {
        Ok(allowed) if allowed >= wanted => {}
        Ok(allowed) => tracing::warn!(
            "the system allows {allowed} open files, so fewer than {wanted} connections: raise it with ulimit -n"
        ),
        Err(error) => tracing::warn!("the limit of open files stays as it is: {error}"),
    }
    #[cfg(not(unix))]
    let _ = wanted;
}
