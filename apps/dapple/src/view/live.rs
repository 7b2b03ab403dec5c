//! The server's half on threads of its own: asked for times, it sends frames.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use dapple_scene::{PosedCamera, Scene};
use dapple_server::{Progress, Server, ServerConfig};
use dapple_trace::psao::update::{ConvexVolume, StepInput};

/// What is asked of the server.
enum Request {
    /// Bring the scene to this time, seconds, as the viewer looks at it.
    Time(f64, Option<ConvexVolume>),
    /// Send a snapshot, for a viewer that joins.
    Join,
}

/// Wider than pictures are, so that the server need not know their shape.
const ASPECT: f32 = 2.4;

/// What it answers.
enum Reply {
    Progress(Progress),
    Frame(Arc<[u8]>),
    Stepped { seconds: f64, traced: u32, busy: bool },
    Failed(String),
}

/// How far the start has come.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Start {
    /// What is being done, and the part of it that is done.
    Doing(&'static str, f32),
    Done,
    Failed(String),
}

/// A server that lights the scene while it is shown.
pub(super) struct Live {
    requests: Sender<Request>,
    replies: Receiver<Reply>,
    hz: f64,
    start: Start,
    /// The tick that the server was last asked for.
    tick: Option<i64>,
    /// Ticks that it was asked for and has not answered.
    in_flight: u32,
    /// The server spends, or keeps points, by what is looked at.
    is_steered: bool,
    /// The last step did something, so the next one may as well, although nothing moves.
    is_busy: bool,
    /// As the viewer looks, and as it looked when the server was last asked.
    look: Option<ConvexVolume>,
    asked_look: Option<ConvexVolume>,
    /// What the last step took, seconds, and the points it traced.
    pub(super) step_seconds: f64,
    pub(super) traced: u32,
}

impl Live {
    /// Starts a server. It ends by itself once this is dropped.
    pub(super) fn start(
        scene: Arc<Scene>,
        config: ServerConfig,
        hz: f64,
        ray_budget: Option<u64>,
    ) -> Result<Live> {
        let is_steered =
            config.max_resident_points.is_some() || config.bits_per_s.is_some() || ray_budget.is_some();
        let (requests, asked) = channel();
        let (answers, replies) = channel();
        // One core is left to the picture.
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(cores.saturating_sub(1).max(1))
            .build()
            .context("cannot start the server's threads")?;
        std::thread::Builder::new()
            .name("light".to_owned())
            .spawn(move || pool.install(move || serve(&scene, &config, ray_budget, &asked, &answers)))
            .context("cannot start the server's thread")?;
        Ok(Live {
            requests,
            replies,
            hz,
            start: Start::Doing("laying points", 0.0),
            tick: None,
            in_flight: 0,
            is_steered,
            is_busy: false,
            look: None,
            asked_look: None,
            step_seconds: 0.0,
            traced: 0,
        })
    }

    pub(super) fn progress(&self) -> &Start {
        &self.start
    }

    /// Says how the viewer looks from now on.
    pub(super) fn look(&mut self, camera: &PosedCamera) {
        if self.is_steered {
            self.look = Some(ConvexVolume::frustum(camera, ASPECT, f32::INFINITY, 0.0));
        }
    }

    /// Asks for a snapshot.
    pub(super) fn join(&self) {
        // One that has ended has said why.
        let _ = self.requests.send(Request::Join);
    }

    /// What has come by now; asks for the tick at `time_s` unless the server is busy.
    pub(super) fn poll(&mut self, time_s: f64) -> Vec<Arc<[u8]>> {
        let mut frames = Vec::new();
        loop {
            match self.replies.try_recv() {
                Ok(reply) => frames.extend(self.take(reply)),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => {
                    if !matches!(self.start, Start::Failed(_)) {
                        self.start = Start::Failed("the server has ended".to_owned());
                    }
                    break;
                }
            }
        }
        let tick = self.tick_at(time_s);
        let differs =
            self.tick != Some(tick) || self.look != self.asked_look || self.is_steered && self.is_busy;
        if self.start == Start::Done && self.in_flight == 0 && differs {
            self.ask(tick);
        }
        frames
    }

    /// All frames up to the tick at `time_s`, every tick on the way included if it lies ahead.
    pub(super) fn wait_until(&mut self, time_s: f64, progress: &dyn Fn(&Start)) -> Result<Vec<Arc<[u8]>>> {
        let last = self.tick_at(time_s);
        let first = match self.tick {
            Some(tick) if tick <= last => tick + 1,
            _ => last,
        };
        for tick in first..=last {
            self.ask(tick);
        }
        let mut frames = Vec::new();
        while self.start != Start::Done || self.in_flight > 0 {
            let reply = self.replies.recv().context("the server has ended")?;
            frames.extend(self.take(reply));
            progress(&self.start);
            if let Start::Failed(reason) = &self.start {
                bail!("{reason}");
            }
        }
        Ok(frames)
    }

    fn ask(&mut self, tick: i64) {
        if self.requests.send(Request::Time(tick as f64 / self.hz, self.look.clone())).is_ok() {
            self.in_flight += 1;
            self.tick = Some(tick);
            self.asked_look.clone_from(&self.look);
        }
    }

    fn tick_at(&self, time_s: f64) -> i64 {
        // A time that is a tick must not lose it to rounding.
        (time_s * self.hz + 1e-9).floor() as i64
    }

    fn take(&mut self, reply: Reply) -> Option<Arc<[u8]>> {
        let part = |done: usize, of: usize| done as f32 / of.max(1) as f32;
        match reply {
            Reply::Progress(Progress::Laying(done, of)) => {
                self.start = Start::Doing("laying points", part(done, of));
            }
            Reply::Progress(Progress::Tracing(done, of)) => {
                self.start = Start::Doing("tracing points", part(done, of));
            }
            Reply::Progress(Progress::Cutting(done, of)) => {
                self.start = Start::Doing("cutting points", part(done, of));
            }
            Reply::Frame(bytes) => {
                self.start = Start::Done;
                return Some(bytes);
            }
            Reply::Stepped { seconds, traced, busy } => {
                self.in_flight = self.in_flight.saturating_sub(1);
                self.is_busy = busy;
                (self.step_seconds, self.traced) = (seconds, traced);
            }
            Reply::Failed(reason) => self.start = Start::Failed(reason),
        }
        None
    }
}

/// The server's thread: until nobody asks or listens any more.
fn serve(
    scene: &Arc<Scene>,
    config: &ServerConfig,
    ray_budget: Option<u64>,
    asked: &Receiver<Request>,
    answers: &Sender<Reply>,
) {
    let progress = |progress| {
        let _ = answers.send(Reply::Progress(progress));
    };
    // Who listens no more is no error.
    let input = StepInput { ray_budget, ..StepInput::default() };
    let ended = run(Server::new(scene.clone(), config, &progress), &input, asked, answers);
    if let Err(error) = ended {
        let _ = answers.send(Reply::Failed(format!("{error:#}")));
    }
}

fn run(
    server: Result<Server, dapple_server::ServerError>,
    input: &StepInput<'_>,
    asked: &Receiver<Request>,
    answers: &Sender<Reply>,
) -> Result<()> {
    let mut server = server?;
    let began = Instant::now();
    if let Some(frame) = server.join()? {
        let _ = answers.send(Reply::Frame(frame.bytes));
    }
    while let Ok(request) = asked.recv() {
        let frame = match request {
            Request::Join => server.join()?,
            Request::Time(time_s, look) => {
                let start = Instant::now();
                let input = StepInput { interest: look.as_slice(), ..*input };
                // A budget of bits goes by the clock: the scene's time may stand still or go back.
                let report = server.step_at(time_s, began.elapsed().as_secs_f64(), &input)?;
                let (seconds, busy) = (
                    start.elapsed().as_secs_f64(),
                    report.frame.is_some()
                        || report.rays > 0
                        || report.held_back > 0
                        || report.lights_due > 0,
                );
                let stepped = Reply::Stepped { seconds, traced: report.traced, busy };
                if let Some(frame) = report.frame {
                    let _ = answers.send(Reply::Frame(frame.bytes));
                }
                if answers.send(stepped).is_err() {
                    break;
                }
                None
            }
        };
        if let Some(frame) = frame
            && answers.send(Reply::Frame(frame.bytes)).is_err()
        {
            break;
        }
    }
    Ok(())
}
