//! The host's side of workers: steps down, light up, put together.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use dapple_scene::Edits;
use dapple_session::host::{Access, Tick, hex};
use dapple_session::work::{FromWorker, Setup, Step, StepDone, ToWorker, WorkerHello};
use dapple_session::{Assembled, Assembly, LightHead, LookCamera, PROTOCOL, Reason, Refusal};
use dapple_stream::{Limits, ReceiveError};
use tokio::sync::watch;

use crate::transport::{Inbound, LinkError, Message, Outbound};

/// A hello must come within this time.
const HELLO_TIMEOUT: Duration = Duration::from_secs(5);

/// The first light of a large scene takes its time.
const FIRST_LIGHT: Duration = Duration::from_secs(3600);

/// After that a worker answers every step: one that says nothing for so long is taken for dead.
const SILENCE: Duration = Duration::from_secs(20);

/// Workers that nobody needs are given a step this often, microseconds.
const COMPANY_EVERY_US: u64 = 1_000_000;

/// Steps that a worker may miss before the others no longer wait for it.
const MOST_MISSED: u32 = 3;

/// The part of the program that workers talk to.
pub(crate) struct WorkHub {
    setup: Setup,
    scene_hash: String,
    token: Option<String>,
    steps: watch::Sender<Option<Arc<WorkStep>>>,
    news: Mutex<Sender<(u32, WorkNews)>>,
    seats: Mutex<Vec<Seat>>,
}

/// Who lights a part.
#[derive(Clone, Default)]
struct Seat {
    /// Counts its connections: the newest counts.
    connection: u64,
    /// Why the newest must go.
    refusal: Option<Refusal>,
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
            seats: Mutex::new(vec![Seat::default(); parts as usize]),
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
        let mut seats = self.seats();
        let parts = seats.len() as u32;
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
        let seat = &mut seats[hello.shard as usize];
        *seat = Seat { connection: seat.connection + 1, refusal: None };
        Ok(seat.connection)
    }

    fn seats(&self) -> MutexGuard<'_, Vec<Seat>> {
        self.seats.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_newest(&self, shard: u32, connection: u64) -> bool {
        self.seats()[shard as usize].connection == connection
    }

    fn let_go(&self, shard: u32, refusal: Refusal) {
        self.seats()[shard as usize].refusal = Some(refusal);
    }

    /// Why a connection must end, if it must.
    fn end_of(&self, shard: u32, connection: u64) -> Option<Refusal> {
        let seat = self.seats()[shard as usize].clone();
        if seat.connection == connection {
            return seat.refusal;
        }
        let message = "another worker lights this part now".to_owned();
        Some(Refusal { reason: Reason::Replaced, message })
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
    let mut patience = FIRST_LIGHT;
    loop {
        let message = match tokio::time::timeout(patience, inbound.receive()).await {
            Ok(Ok(Some(message))) => message,
            Ok(Ok(None)) => return ended("it closed the connection"),
            Ok(Err(error)) => return ended(&error.to_string()),
            Err(_) => return ended("it said nothing for too long"),
        };
        if let Some(refusal) = hub.end_of(shard, connection) {
            return refusal;
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
                Ok(FromWorker::Done(done)) => {
                    patience = SILENCE;
                    hub.tell(shard, WorkNews::Done(done));
                }
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
    parts: Vec<Part>,
    /// When workers that nobody needs were last given a step.
    kept_company_us: u64,
}

/// One part of the scene.
#[derive(Clone, Copy, Default)]
struct Part {
    is_present: bool,
    /// Whether it has ever had light.
    has_begun: bool,
    /// Its worker's last step; none before the first.
    done: Option<StepDone>,
    /// Steps that its worker did not make in time, in a row.
    missed: u32,
}

/// What a worker has sent.
pub(crate) enum Sent {
    /// It begins: what it sends next builds on nothing.
    Anew,
    Frame(Vec<u8>),
}

/// What a step of all workers came to.
#[derive(Default)]
pub(crate) struct Work {
    pub(crate) light: Vec<(u32, Sent)>,
    pub(crate) rays: u64,
    pub(crate) changed: u32,
    pub(crate) waiting: u32,
    pub(crate) points: u32,
}

impl Workforce {
    pub(crate) fn new(hub: Arc<WorkHub>, news: Receiver<(u32, WorkNews)>, edits: Edits) -> Workforce {
        let parts = hub.seats().len();
        Workforce {
            hub,
            news,
            edits: Arc::new(edits),
            parts: vec![Part::default(); parts],
            kept_company_us: 0,
        }
    }

    pub(crate) fn set_edits(&mut self, edits: Edits) {
        self.edits = Arc::new(edits);
    }

    /// How many parts there are.
    pub(crate) fn parts(&self) -> usize {
        self.parts.len()
    }

    /// How many workers are there.
    pub(crate) fn present(&self) -> usize {
        self.parts.iter().filter(|part| part.is_present).count()
    }

    /// How many parts have had light.
    pub(crate) fn begun(&self) -> usize {
        self.parts.iter().filter(|part| part.has_begun).count()
    }

    /// Whether all workers that are there have light.
    pub(crate) fn is_warm(&self) -> bool {
        self.parts.iter().all(|part| !part.is_present || part.done.is_some())
    }

    /// Ends a worker's connection, because what it sends does not fit.
    pub(crate) fn let_go(&self, shard: u32, error: &ReceiveError) {
        // Other points than the host expects will not fit the next time either.
        let reason = match error {
            ReceiveError::Misfit(_) => Reason::Scene,
            _ => Reason::Closing,
        };
        let message = format!("the light of part {} does not fit that of the others: {error}", shard + 1);
        self.hub.let_go(shard, Refusal { reason, message });
    }

    /// Takes what has come while nobody needs light. Workers hear of the host now and then all the same, and keep up with it.
    pub(crate) fn idle(&mut self, tick: &Tick) -> Vec<(u32, Sent)> {
        if tick.stamp_us.saturating_sub(self.kept_company_us) >= COMPANY_EVERY_US {
            self.kept_company_us = tick.stamp_us;
            self.hub.step(tick, self.edits.clone(), Vec::new());
        }
        let mut work = Work::default();
        while let Ok((shard, news)) = self.news.try_recv() {
            self.take(shard, news, &mut work);
        }
        work.light
    }

    /// Has all workers make a step, and waits for those that are in time. What comes later counts for a later step.
    pub(crate) fn step(&mut self, tick: &Tick, looks: Vec<LookCamera>, patience: Duration) -> Work {
        self.kept_company_us = tick.stamp_us;
        self.hub.step(tick, self.edits.clone(), looks);
        let until = Instant::now() + patience;
        let mut work = Work::default();
        // One that makes its first light, or is late again and again, is not waited for.
        let is_due = |part: &Part| {
            let is_behind = part.done.is_some_and(|done| done.stamp_us < tick.stamp_us);
            part.is_present && is_behind && part.missed < MOST_MISSED
        };
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let waits = self.parts.iter().any(is_due);
            let news = if waits { self.news.recv_timeout(left).ok() } else { self.news.try_recv().ok() };
            let Some((shard, news)) = news else { break };
            self.take(shard, news, &mut work);
        }
        for part in &mut self.parts {
            let Some(done) = part.done else { continue };
            if part.is_present && done.stamp_us < tick.stamp_us {
                part.missed = part.missed.saturating_add(1);
            }
            work.waiting = work.waiting.saturating_add(done.waiting);
            work.points = work.points.saturating_add(done.points);
        }
        work
    }

    fn take(&mut self, shard: u32, news: WorkNews, work: &mut Work) {
        let part = &mut self.parts[shard as usize];
        match news {
            WorkNews::Joined => {
                *part = Part { is_present: true, has_begun: part.has_begun, ..Part::default() };
                work.light.push((shard, Sent::Anew));
            }
            WorkNews::Left => part.is_present = false,
            WorkNews::Light(frame) => work.light.push((shard, Sent::Frame(frame))),
            WorkNews::Done(done) => {
                work.rays = work.rays.saturating_add(done.rays);
                work.changed = work.changed.saturating_add(done.changed);
                (part.done, part.has_begun, part.missed) = (Some(done), true, 0);
            }
        }
    }
}
