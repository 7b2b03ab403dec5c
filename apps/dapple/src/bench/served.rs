//! The server that is measured: a process of its own, or one that runs elsewhere.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use dapple_scene::Scene;

use crate::args::ServedArgs;
use crate::live::Address;
use crate::progress::Bar;
use crate::serve::{LIGHT_THREADS, process_of, threads_of};
use crate::view::fetch_scene;

/// How long a server may take until it has light.
const START_TIMEOUT: Duration = Duration::from_secs(300);

/// A server, its scene, and where its sessions are.
pub(crate) struct Served {
    child: Option<Child>,
    pub(crate) url: String,
    pub(crate) live: Address,
    pub(crate) scene: Arc<Scene>,
}

impl Served {
    /// Starts one and waits until it has light.
    pub(crate) fn start(args: &ServedArgs, more: &[&str]) -> Result<Served> {
        if args.moq.as_deref().is_some_and(|relay| !relay.is_empty()) {
            bail!("--moq RELAY: name the server that publishes to the relay with --url");
        }
        let moq: &[&str] = if args.moq.is_some() { &["--moq"] } else { &[] };
        let program = std::env::current_exe().context("cannot find this program")?;
        let mut child = Command::new(program)
            .args(["serve", "--builtin", &args.builtin, "--detail", &args.detail.to_string()])
            .args(["--points", &args.points.to_string(), "--hz", &args.hz.to_string(), "--port", "0"])
            .args(args.area_lights.map(|tolerance| match tolerance {
                Some(tolerance) => format!("--area-lights={tolerance}"),
                None => "--area-lights".to_owned(),
            }))
            .args(more)
            .args(moq)
            .env_remove("DAPPLE_TOKENS")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit())
            .spawn()
            .context("cannot start a server")?;
        let stdout = child.stdout.take().context("the server has no output")?;
        let mut lines = BufReader::new(stdout).lines();
        let url = loop {
            match lines.next() {
                Some(Ok(line)) => {
                    if let Some(url) = line.split_whitespace().find(|word| word.ends_with("health")) {
                        break url.trim_end_matches("health").to_owned();
                    }
                }
                _ => {
                    let _ = child.kill();
                    bail!("the server has ended before it said where it is");
                }
            }
        };
        // What else it says must not block it.
        std::thread::spawn(move || lines.for_each(drop));
        let served = Served::at(&url, Some(child), args.moq.as_deref())?;
        served.wait()?;
        Ok(served)
    }

    /// One that runs already.
    pub(crate) fn running(url: &str, moq: Option<&str>) -> Result<Served> {
        let served = Served::at(url, None, moq)?;
        served.wait()?;
        Ok(served)
    }

    /// What is known of one, for those who view it.
    pub(crate) fn attached(url: String, live: Address, scene: Arc<Scene>) -> Served {
        Served { child: None, url, live, scene }
    }

    fn at(url: &str, child: Option<Child>, moq: Option<&str>) -> Result<Served> {
        let nowhere = Address::Ws(String::new());
        let mut served =
            Served { child, url: url.to_owned(), live: nowhere, scene: Arc::new(Scene::default()) };
        let (scene, live) = fetch_scene(url, moq)?;
        served.live = live.with_context(|| format!("{url} serves no live session"))?;
        served.scene = Arc::new(scene);
        Ok(served)
    }

    fn wait(&self) -> Result<()> {
        let _wheel = Bar::spinner("waiting for the light");
        let start = Instant::now();
        while !self.get("health")?.contains("\"ready\":true") {
            if start.elapsed() > START_TIMEOUT {
                bail!("{} has no light after {} s", self.url, START_TIMEOUT.as_secs());
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        Ok(())
    }

    pub(crate) fn get(&self, path: &str) -> Result<String> {
        let address = format!("{}{path}", self.url);
        let mut response =
            ureq::get(&address).call().with_context(|| format!("{address} does not answer"))?;
        response.body_mut().read_to_string().with_context(|| format!("{address} breaks off"))
    }

    /// A figure of its metrics.
    pub(crate) fn figure(&self, metrics: &str, name: &str) -> f64 {
        let line = metrics.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        line.and_then(|value| value.parse().ok()).unwrap_or(0.0)
    }

    /// Seconds of processor that it has taken and bytes of memory that it holds.
    pub(crate) fn process(&self) -> Result<(f64, u64)> {
        if let Some(child) = &self.child {
            return process_of(&child.id().to_string())
                .context("this system does not tell what a process takes");
        }
        let metrics = self.get("metrics")?;
        let figure = |name| self.figure(&metrics, name);
        Ok((figure("process_cpu_seconds_total"), figure("process_resident_memory_bytes") as u64))
    }

    /// Of it, what tracing and encoding took; `None` for a server that was not started here.
    pub(crate) fn light_cpu(&self) -> Option<f64> {
        threads_of(&self.child.as_ref()?.id().to_string(), LIGHT_THREADS)
    }

    /// Whether a server that was started here still runs.
    pub(crate) fn is_running(&mut self) -> bool {
        self.child.as_mut().is_none_or(|child| matches!(child.try_wait(), Ok(None)))
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
