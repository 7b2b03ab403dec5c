//! `dapple worker`: traces some instances of a scene for a server elsewhere.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, bail};
use dapple_scene::Scene;
use dapple_server::shards::Shard;
use dapple_server::{Progress, Server, ServerConfig};
use dapple_session::work::{FromWorker, Setup, Step, StepDone, ToWorker, WorkerHello};
use dapple_session::{LightHead, PROTOCOL};
use dapple_stream::{Precision, PublisherConfig};
use dapple_trace::psao::generate::GenerateParams;
use dapple_trace::psao::update::{ConvexVolume, StepInput, UpdateParams};
use dapple_trace::slc::TrackerParams;
use tokio::sync::{mpsc, watch};

use crate::args::WorkerArgs;
use crate::file::wait_for_interrupt;
use crate::page::resolve;
use crate::serve::{MARGIN_M, Ration, WORK_PATH};
use crate::transport::{Inbound, Message, Outbound, ws};
use crate::view::fetch_scene;

/// Waits between two tries to connect, the shortest and the longest.
const RETRY: (Duration, Duration) = (Duration::from_millis(500), Duration::from_secs(10));

/// A host says something every second.
const SILENCE: Duration = Duration::from_secs(15);

/// Works until told to stop.
pub(crate) fn run(args: &WorkerArgs) -> Result<()> {
    if args.threads > 1024 {
        bail!("--threads is {}, must be 0 (one for each core) to 1024", args.threads);
    }
    let (scene, _) = fetch_scene(&args.connect, None)?;
    let scene = Arc::new(scene);
    let address = resolve(&args.connect, WORK_PATH)?.replacen("http://", "ws://", 1);
    let shard = args.shard.0;
    let hello = WorkerHello {
        protocol: PROTOCOL,
        wire: dapple_stream::codec::VERSION,
        scene: dapple_session::host::hex(&scene.hash().0),
        shard: shard.number,
        of: shard.of,
        token: args.token.clone(),
    };
    let mut light = Light::start(scene, shard, args.threads)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .context("cannot start the thread that talks")?;
    say!("lights part {} of {} for {}; Ctrl-C ends it", shard.number + 1, shard.of, args.connect);
    let outcome = runtime.block_on(async {
        tokio::select! {
            outcome = work(&address, &hello, &mut light) => outcome,
            signal = wait_for_interrupt() => signal.map(drop).context("cannot wait for signals"),
        }
    });
    // The thread that lights may be in the middle of a long start: the program's end is its end.
    outcome
}

/// Connects again and again.
async fn work(address: &str, hello: &WorkerHello, light: &mut Light) -> Result<()> {
    let mut wait = RETRY.0;
    loop {
        let began = Instant::now();
        let reason = converse(address, hello, light).await?;
        // A connection that held a while was a good one.
        wait = if began.elapsed() > RETRY.1 { RETRY.0 } else { (2 * wait).min(RETRY.1) };
        tracing::warn!("{reason}; trying again in {:.1} s", wait.as_secs_f64());
        tokio::time::sleep(wait).await;
    }
}

/// One connection; gives the reason for its end, or the error that makes another one useless.
async fn converse(address: &str, hello: &WorkerHello, light: &mut Light) -> Result<String> {
    let limit = dapple_session::MAX_FROM_HOST_BYTES;
    let (mut out, mut inbound) = match ws::connect(address, limit).await {
        Ok(halves) => halves,
        Err(error) => return Ok(error.to_string()),
    };
    if let Err(error) = out.send_text(FromWorker::Hello(hello.clone()).to_text().into()).await {
        return Ok(error.to_string());
    }
    light.begin();
    loop {
        tokio::select! {
            message = tokio::time::timeout(SILENCE, inbound.receive()) => match message {
                Err(_) => return Ok(format!("the host has said nothing for {} s", SILENCE.as_secs())),
                Ok(message) => match message {
                Ok(Some(Message::Text(text))) => match ToWorker::parse(&text).context("the host says what this worker does not know")? {
                    ToWorker::Setup(setup) => light.set_up(setup),
                    ToWorker::Step(step) => light.ask(step),
                    ToWorker::Refused(refusal) if refusal.reason.may_retry() => return Ok(refusal.message),
                    ToWorker::Refused(refusal) => bail!("{refusal}"),
                },
                Ok(Some(Message::Bytes(_))) => bail!("the host sends light to a worker: it is none"),
                Ok(None) => return Ok("the host closed the connection".to_owned()),
                Err(error) => return Ok(error.to_string()),
                },
            },
            answer = light.answers.recv() => match answer.ok_or_else(|| anyhow!("the light ended in a panic"))? {
                Answer::Failed(reason) => bail!("{reason}"),
                // Made for a connection before this one.
                Answer::Stepped(round, ..) if round != light.round => {}
                Answer::Stepped(_, light, done) => {
                    for message in light {
                        if let Err(error) = out.send_bytes(message).await {
                            return Ok(error.to_string());
                        }
                    }
                    if let Err(error) = out.send_text(FromWorker::Done(done).to_text().into()).await {
                        return Ok(error.to_string());
                    }
                }
            },
        }
    }
}

/// The thread that lights, from outside.
struct Light {
    asked: watch::Sender<Asked>,
    answers: mpsc::UnboundedReceiver<Answer>,
    round: u64,
    _wake: Sender<()>,
}

/// The newest of everything that is asked of it.
#[derive(Clone, Default)]
struct Asked {
    /// Counts connections: each begins with a snapshot.
    round: u64,
    setup: Option<Setup>,
    step: Option<Step>,
    /// Edits of steps that were replaced before they were begun.
    edits: Option<dapple_scene::Edits>,
}

enum Answer {
    Stepped(u64, Vec<Arc<[u8]>>, StepDone),
    Failed(String),
}

impl Light {
    fn start(scene: Arc<Scene>, shard: Shard, threads: usize) -> Result<Light> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .context("cannot start the threads that trace")?;
        let (asked, asks) = watch::channel(Asked::default());
        let (answer, answers) = mpsc::unbounded_channel();
        let (wake, ended) = channel();
        std::thread::Builder::new()
            .name("light".to_owned())
            .spawn(move || {
                pool.install(move || {
                    if let Err(error) = light(&scene, shard, asks, &answer, &ended) {
                        let _ = answer.send(Answer::Failed(format!("{error:#}")));
                    }
                });
            })
            .context("cannot start the thread that lights")?;
        Ok(Light { asked, answers, round: 0, _wake: wake })
    }

    /// A new connection: what was made for the one before is of no use to it.
    fn begin(&mut self) {
        self.round += 1;
        let round = self.round;
        self.asked.send_modify(|asked| *asked = Asked { round, setup: asked.setup, ..Asked::default() });
    }

    fn set_up(&self, setup: Setup) {
        self.asked.send_modify(|asked| asked.setup = Some(setup));
    }

    fn ask(&self, step: Step) {
        self.asked.send_modify(|asked| {
            asked.edits = step.edits.clone().or(asked.edits.take());
            asked.step = Some(step);
        });
    }
}

/// Lights whatever is asked last, until nobody asks any more.
fn light(
    scene: &Arc<Scene>,
    shard: Shard,
    mut asks: watch::Receiver<Asked>,
    answers: &mpsc::UnboundedSender<Answer>,
    ended: &Receiver<()>,
) -> Result<()> {
    let waiting = tokio::runtime::Builder::new_current_thread().build().context("cannot wait for steps")?;
    let mut lit: Option<(Setup, Server, Ration)> = None;
    let mut round = 0;
    loop {
        if waiting.block_on(asks.changed()).is_err()
            || !matches!(ended.try_recv(), Err(std::sync::mpsc::TryRecvError::Empty))
        {
            return Ok(());
        }
        let asked = asks.borrow_and_update().clone();
        let (Some(setup), Some(step)) = (asked.setup, asked.step) else { continue };
        if lit.as_ref().is_none_or(|(known, ..)| *known != setup) {
            let server = Server::new(scene.clone(), &config(&setup, shard), &|progress| {
                let (Progress::Laying(done, of) | Progress::Tracing(done, of) | Progress::Cutting(done, of)) =
                    progress;
                tracing::debug!("start: {progress:?} {done} of {of}");
            })?;
            tracing::info!(points = server.store().layout().len(), "the light is there");
            lit = Some((setup, server, Ration::new(setup.step_s, setup.ray_budget)));
        }
        let Some((_, server, ration)) = &mut lit else { continue };
        if let Some(edits) = asked.edits.filter(|edits| edits != server.edits()) {
            edits.check(scene).context("the host changes what the scene does not have")?;
            server.set_edits(edits);
        }
        let interest: Vec<ConvexVolume> = step
            .looks
            .iter()
            .map(|look| ConvexVolume::frustum(&look.posed(), look.aspect, f32::INFINITY, MARGIN_M))
            .collect();
        let start = Instant::now();
        let input = StepInput { ray_budget: ration.rays(), interest: &interest };
        let (scene_s, sent_s) = (step.scene_us as f64 * 1e-6, step.stamp_us as f64 * 1e-6);
        let report = server.step_at(scene_s, sent_s, &input)?;
        let took = start.elapsed();
        ration.note(report.rays, took.as_secs_f64());
        let frame = if round == asked.round { report.frame } else { server.join()? };
        round = asked.round;
        let head = LightHead {
            part: None,
            stamp_us: step.stamp_us,
            made_us: step.stamp_us + took.as_micros() as u64,
            scene_us: step.scene_us,
            state: step.state,
            total: 0,
            offset: 0,
        };
        let messages = frame.map_or_else(Vec::new, |frame| head.messages(&frame.bytes));
        let done = StepDone {
            stamp_us: step.stamp_us,
            rays: report.rays,
            changed: report.changed,
            waiting: report.counts.backlog,
            points: report.points,
        };
        if answers.send(Answer::Stepped(round, messages, done)).is_err() {
            return Ok(());
        }
    }
}

fn config(setup: &Setup, shard: Shard) -> ServerConfig {
    let since_1970 = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    // Exact: how exactly viewers are told is the host's affair.
    let precision = Precision { tolerance: 0, step: 0 };
    ServerConfig {
        generate: GenerateParams {
            points_per_m2: setup.points_per_m2,
            seed: setup.seed,
            radius_m: setup.radius_m,
            ..GenerateParams::default()
        },
        update: UpdateParams {
            rays: setup.rays,
            rays_still: setup.rays_still,
            radius_m: setup.radius_m,
            ..UpdateParams::default()
        },
        // Groups of an earlier worker of this part must not be taken for this one's.
        publish: PublisherConfig {
            first_group: since_1970.map_or(0, |since| since.as_millis() as u64),
            precision,
            ..PublisherConfig::default()
        },
        cuts: setup.cuts,
        // Exact but for what nobody sees: the host sends on what it gets.
        lights: setup.area_lights.then(|| {
            let defaults = TrackerParams::default();
            TrackerParams { tolerance: setup.light_tolerance.unwrap_or(defaults.tolerance), ..defaults }
        }),
        shard: Some(shard),
        ..ServerConfig::default()
    }
}
