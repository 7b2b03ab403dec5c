//! The host's side of workers: steps down, light up, put together.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use dapple_scene::Edits;
use dapple_session::host::{Access, Tick, hex};
use dapple_session::work::{FromWorker, Setup, Step, StepDone, ToWorker, WorkerHello};
use dapple_session::{Assembled, Assembly, LightHead, LookCamera, PROTOCOL, Reason, Refusal};
use dapple_stream::Limits;
use tokio::sync::watch;

use crate::transport::{Inbound, LinkError, Message, Outbound};

/// A hello must come within this time.
const HELLO_TIMEOUT: Duration = Duration::from_secs(5);

/// A worker that says nothing for so long is taken for dead. The first light of a large scene takes its time.
const SILENCE: Duration = Duration::from_secs(600);

/// The part of the program that workers talk to.
pub(crate) struct WorkHub {
    setup: Setup,
    scene_hash: String,
    token: Option<String>,
    steps: watch::Sender<Option<Arc<WorkStep>>>,
    news: Mutex<Sender<(u32, WorkNews)>>,
    /// Counts the connections of each part: the newest counts.
    connections: Mutex<Vec<u64>>,
}

/// A step for all workers.
struct WorkStep {
    tick: Tick,
    /// All edits, for those who have not been told of this version.
    edits: Arc<Edits>,
    looks: Vec<LookCamera>,
}

/// What comes from a worker.
pub(crate) enum WorkNews {
    Joined,
    Light(Vec<u8>),
    Done(StepDone),
    Left,
}

impl WorkHub {
    /// For so many parts; also gives what comes from them.
    pub(crate) fn new(
        setup: Setup,
        scene_hash: &[u8; 32],
        parts: u32,
        token: Option<String>,
    ) -> (WorkHub, Receiver<(u32, WorkNews)>) {
        let (sender, receiver) = channel();
        let hub = WorkHub {
            setup,
            scene_hash: hex(scene_hash),
            token,
            steps: watch::Sender::new(None),
            news: Mutex::new(sender),
            connections: Mutex::new(vec![0; parts as usize]),
        };
        (hub, receiver)
    }

    /// Gives all workers a step.
    pub(crate) fn step(&self, tick: &Tick, edits: Arc<Edits>, looks: Vec<LookCamera>) {
        self.steps.send_replace(Some(Arc::new(WorkStep { tick: tick.clone(), edits, looks })));
    }

    fn tell(&self, shard: u32, news: WorkNews) {
        // The light may have ended already.
        let _ = self.news.lock().unwrap_or_else(PoisonError::into_inner).send((shard, news));
    }

    fn admit(&self, hello: &WorkerHello) -> Result<u64, Refusal> {
        let refuse = |reason, message: String| Err(Refusal { reason, message });
        let wire = dapple_stream::codec::VERSION;
        if (hello.protocol, hello.wire) != (PROTOCOL, wire) {
            return refuse(
                Reason::Version,
                format!("the worker is of another version than this host ({})", env!("CARGO_PKG_VERSION")),
            );
        }
        if let Some(token) = &self.token {
            let access = Access::new(vec![(token.clone(), dapple_session::Role::Interact)]);
            if !access.knows(hello.token.as_deref()) {
                return refuse(
                    Reason::Token,
                    "this host asks workers for a token: give it with --token".to_owned(),
                );
            }
        }
        if hello.scene != self.scene_hash {
            return refuse(
                Reason::Scene,
                "the worker has loaded another scene than this host lights".to_owned(),
            );
        }
        let mut connections = self.connections.lock().unwrap_or_else(PoisonError::into_inner);
        let parts = connections.len() as u32;
        if hello.of != parts || hello.shard >= parts {
            return refuse(
                Reason::Malformed,
                format!(
                    "part {} of {} was offered, this host has {parts}: start workers with --shard 1/{parts} to {parts}/{parts}",
                    hello.shard + 1,
                    hello.of
                ),
            );
        }
        let connection = &mut connections[hello.shard as usize];
        *connection += 1;
        Ok(*connection)
    }

    fn is_newest(&self, shard: u32, connection: u64) -> bool {
        self.connections.lock().unwrap_or_else(PoisonError::into_inner)[shard as usize] == connection
    }
}

/// Talks to a worker until one of both ends it.
pub(crate) async fn talk(hub: Arc<WorkHub>, mut out: impl Outbound, mut inbound: impl Inbound) {
    let refusal = match hello(&hub, &mut inbound).await {
        Err(refusal) => refusal,
        Ok((hello, connection)) => {
            tracing::info!(part = hello.shard + 1, of = hello.of, "a worker has joined");
            hub.tell(hello.shard, WorkNews::Joined);
            let ended = converse(&hub, hello.shard, connection, &mut out, &mut inbound).await;
            if hub.is_newest(hello.shard, connection) {
                hub.tell(hello.shard, WorkNews::Left);
            }
            tracing::info!(part = hello.shard + 1, "a worker has gone: {}", ended.message);
            Some(ended)
        }
    };
    if let Some(refusal) = refusal {
        let _ = out.send_text(ToWorker::Refused(refusal).to_text().into()).await;
    }
    out.close().await;
}

async fn hello(hub: &WorkHub, inbound: &mut impl Inbound) -> Result<(WorkerHello, u64), Option<Refusal>> {
    let malformed = |message: String| Some(Refusal { reason: Reason::Malformed, message });
    let text = match tokio::time::timeout(HELLO_TIMEOUT, inbound.receive()).await {
        Ok(Ok(Some(Message::Text(text)))) => text,
        Ok(Ok(Some(Message::Bytes(_)))) => {
            return Err(malformed("the first message must be a hello".to_owned()));
        }
        Ok(Err(LinkError::Refused(reason))) => return Err(malformed(reason)),
        Ok(Ok(None) | Err(LinkError::Ended(_))) | Err(_) => return Err(None),
    };
    match FromWorker::parse(&text).map_err(|error| malformed(error.to_string()))? {
        FromWorker::Hello(hello) => {
            let connection = hub.admit(&hello).map_err(Some)?;
            Ok((hello, connection))
        }
        FromWorker::Done(_) => Err(malformed("the first message must be a hello".to_owned())),
    }
}

async fn converse(
    hub: &WorkHub,
    shard: u32,
    connection: u64,
    out: &mut impl Outbound,
    inbound: &mut impl Inbound,
) -> Refusal {
    tokio::select! {
        ended = send_steps(hub, out) => ended,
        ended = receive_light(hub, shard, connection, inbound) => ended,
    }
}

fn ended(message: &str) -> Refusal {
    Refusal { reason: Reason::Closing, message: message.to_owned() }
}

async fn send_steps(hub: &WorkHub, out: &mut impl Outbound) -> Refusal {
    if out.send_text(ToWorker::Setup(hub.setup).to_text().into()).await.is_err() {
        return ended("the connection broke");
    }
    let mut steps = hub.steps.subscribe();
    // What is there already is for the newcomer too.
    steps.mark_changed();
    let mut told = None;
    loop {
        if steps.changed().await.is_err() {
            return ended("the host ends");
        }
        let Some(step) = steps.borrow_and_update().clone() else { continue };
        let Tick { stamp_us, scene_us, state, .. } = step.tick;
        let edits = (told != Some(state)).then(|| (*step.edits).clone());
        told = Some(state);
        let step = Step { stamp_us, scene_us, state, edits, looks: step.looks.clone() };
        if out.send_text(ToWorker::Step(step).to_text().into()).await.is_err() {
            return ended("the connection broke");
        }
    }
}

async fn receive_light(hub: &WorkHub, shard: u32, connection: u64, inbound: &mut impl Inbound) -> Refusal {
    let malformed = |message: String| Refusal { reason: Reason::Malformed, message };
    let mut assembly = Assembly::default();
    let most = Limits::default().max_frame_bytes;
    loop {
        let message = match tokio::time::timeout(SILENCE, inbound.receive()).await {
            Ok(Ok(Some(message))) => message,
            Ok(Ok(None)) => return ended("it closed the connection"),
            Ok(Err(error)) => return ended(&error.to_string()),
            Err(_) => return ended("it said nothing for too long"),
        };
        if !hub.is_newest(shard, connection) {
            let message = "another worker lights this part now".to_owned();
            return Refusal { reason: Reason::Replaced, message };
        }
        match message {
            Message::Bytes(bytes) => {
                let (head, piece) = match LightHead::parse(&bytes) {
                    Ok(parsed) => parsed,
                    Err(error) => return malformed(error.to_string()),
                };
                match assembly.push(head, piece, most) {
                    Assembled::Whole(_, frame) if frame.is_empty() => {}
                    Assembled::Whole(_, frame) => hub.tell(shard, WorkNews::Light(frame)),
                    Assembled::Part => {}
                    Assembled::Never => return malformed("light of an impossible length".to_owned()),
                }
            }
            Message::Text(text) => match FromWorker::parse(&text) {
                Ok(FromWorker::Done(done)) => hub.tell(shard, WorkNews::Done(done)),
                Ok(FromWorker::Hello(_)) => return malformed("a second hello".to_owned()),
                Err(error) => return malformed(error.to_string()),
            },
        }
    }
}

/// What workers have said, as the light sees it.
pub(crate) struct Workforce {
    hub: Arc<WorkHub>,
    news: Receiver<(u32, WorkNews)>,
    edits: Arc<Edits>,
    /// Of each part, whether a worker is there and its last step.
    parts: Vec<Option<StepDone>>,
}

/// What a step of all workers came to.
#[derive(Default)]
pub(crate) struct Work {
    pub(crate) light: Vec<(u32, Vec<u8>)>,
    pub(crate) rays: u64,
    pub(crate) changed: u32,
    pub(crate) waiting: u32,
    pub(crate) points: u32,
}

impl Workforce {
    pub(crate) fn new(hub: Arc<WorkHub>, news: Receiver<(u32, WorkNews)>, edits: Edits) -> Workforce {
        let parts = hub.connections.lock().unwrap_or_else(PoisonError::into_inner).len();
        Workforce { hub, news, edits: Arc::new(edits), parts: vec![None; parts] }
    }

    pub(crate) fn set_edits(&mut self, edits: Edits) {
        self.edits = Arc::new(edits);
    }

    /// How many parts there are.
    pub(crate) fn parts(&self) -> usize {
        self.parts.len()
    }

    /// Takes what has come while no step is made.
    pub(crate) fn idle(&mut self) -> Vec<(u32, Vec<u8>)> {
        let mut work = Work::default();
        while let Ok((shard, news)) = self.news.try_recv() {
            self.take(shard, news, &mut work);
        }
        work.light
    }

    fn take(&mut self, shard: u32, news: WorkNews, work: &mut Work) {
        let part = &mut self.parts[shard as usize];
        match news {
            WorkNews::Joined => *part = Some(StepDone::default()),
            WorkNews::Left => *part = None,
            WorkNews::Light(frame) => work.light.push((shard, frame)),
            WorkNews::Done(done) => {
                work.rays += done.rays;
                work.changed += done.changed;
                *part = Some(done);
            }
        }
    }

    /// Whether all workers that are there have light.
    pub(crate) fn is_warm(&self) -> bool {
        self.parts.iter().flatten().all(|done| done.stamp_us > 0)
    }

    /// How many workers are there.
    pub(crate) fn present(&self) -> usize {
        self.parts.iter().flatten().count()
    }

    /// Has all workers make a step, and waits for those that are in time. What comes later counts for a later step.
    pub(crate) fn step(&mut self, tick: &Tick, looks: Vec<LookCamera>, patience: Duration) -> Work {
        self.hub.step(tick, self.edits.clone(), looks);
        let until = Instant::now() + patience;
        let mut work = Work::default();
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let is_due = |done: &StepDone| done.stamp_us < tick.stamp_us;
            // Without anyone to wait for, what has come is taken all the same.
            let waits = self.parts.iter().flatten().any(is_due);
            let news = if waits { self.news.recv_timeout(left).ok() } else { self.news.try_recv().ok() };
            let Some((shard, news)) = news else { break };
            self.take(shard, news, &mut work);
        }
        for done in self.parts.iter().flatten() {
            work.waiting += done.waiting;
            work.points += done.points;
        }
        work
    }
}
