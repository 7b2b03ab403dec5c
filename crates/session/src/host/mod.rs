//! The server's end: who may do what, the scene's state, and what each viewer gets next.

mod access;
mod bucket;
mod groups;
mod ladder;
mod pace;
mod queue;
mod shared;
mod state;
mod types;
mod viewer;

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use dapple_scene::{Edits, Scene};
use dapple_stream::Frame;

pub use access::Access;
pub use groups::{LightGroups, Piece, StateGroups};
use ladder::Rung;
use queue::overtaken;
use state::SceneState;
pub use types::{Arrival, HostConfig, HostCounts, Link, Next, Outgoing, Shared, SharedLight, Tick};
use viewer::Viewer;

use crate::{
    Event, FromHost, FromViewer, Held, Hello, LightHead, LookCamera, MAX_PARTS, PROTOCOL, Reason, Refusal,
    Role, SceneClock, Terms, WIRE, stream_within,
};

/// Most ages kept between two questions.
const MAX_AGES: usize = 1 << 16;

/// Most events that wait for the next step.
const MAX_QUEUED_EVENTS: usize = 4096;

/// Most events that take effect in one step: each place costs a look at all nodes of the scene. The others wait for the next.
const MAX_EVENTS_A_STEP: usize = 256;

/// How a viewer is let in.
struct Admission {
    role: Role,
    rung: usize,
    held: Option<Held>,
    goes_on: bool,
}

/// The server's end of all sessions.
pub struct Host {
    config: HostConfig,
    scene: Arc<Scene>,
    scene_hash: String,
    state: SceneState,
    viewers: BTreeMap<u64, Viewer>,
    next_viewer: u64,
    /// What came since the last step, by viewer and number.
    queue: VecDeque<(u64, u32, Event)>,
    rungs: Vec<Rung>,
    /// Whether somebody else than viewers takes a rung.
    shared: Vec<bool>,
    /// The last step's message for those who get no light with it.
    tick: Option<Arc<[u8]>>,
    closing: Option<Refusal>,
    counts: HostCounts,
    ages_us: Vec<u32>,
    told_version: u64,
}

impl Host {
    /// A host of a scene, at moment `now_us` of its clock.
    pub fn new(scene: Arc<Scene>, mut config: HostConfig, now_us: u64) -> Host {
        // The richest first.
        config.rungs.sort_by_key(|bits| std::cmp::Reverse(bits.unwrap_or(u64::MAX)));
        config.rungs.dedup();
        if config.rungs.is_empty() {
            config.rungs.push(None);
        }
        config.parts.truncate(MAX_PARTS);
        let clock = SceneClock { playing: config.playing, time_us: 0, at_us: now_us };
        Host {
            scene_hash: hex(&scene.hash().0),
            state: SceneState::new(&scene, clock),
            scene,
            viewers: BTreeMap::new(),
            next_viewer: 1,
            queue: VecDeque::new(),
            rungs: (0..config.rungs.len() + config.parts.len()).map(|_| Rung::default()).collect(),
            shared: vec![false; config.rungs.len() + config.parts.len()],
            tick: None,
            closing: None,
            counts: HostCounts::default(),
            ages_us: Vec::new(),
            told_version: 0,
            config,
        }
    }

    /// Its settings; the rungs from the richest to the leanest.
    pub fn config(&self) -> &HostConfig {
        &self.config
    }

    /// Lets a viewer in, or says why not. Then [`Host::next`] gives what it is to be sent.
    ///
    /// # Errors
    /// The refusal to be sent.
    pub fn join(&mut self, hello: &Hello, arrival: Arrival, now_us: u64) -> Result<Link, Refusal> {
        let admitted = self.admit(hello, arrival, now_us);
        if admitted.is_err() {
            self.counts.refused += 1;
        }
        admitted
    }

    fn admit(&mut self, hello: &Hello, arrival: Arrival, now_us: u64) -> Result<Link, Refusal> {
        if let Some(refusal) = &self.closing {
            return Err(refusal.clone());
        }
        let host = Terms { protocol: PROTOCOL, wire: WIRE, scene: &self.scene_hash };
        let viewer = Terms { protocol: hello.protocol, wire: hello.wire, scene: &hello.scene };
        if let Some(refusal) = viewer.refusal(host) {
            return Err(refusal);
        }
        let role = self.config.access.role(hello.token.as_deref(), arrival.is_foreign)?;
        let known = hello.key.as_deref().and_then(|key| {
            let has_key = |viewer: &Viewer| !viewer.is_observer && access::equal(&viewer.key, key);
            self.viewers.iter().find(|(_, viewer)| has_key(viewer)).map(|(id, _)| *id)
        });
        let id = match known {
            Some(id) => {
                self.counts.resumed += 1;
                id
            }
            None => {
                let viewers = self.viewers.values().filter(|viewer| !viewer.is_observer).count();
                if viewers >= self.config.max_viewers as usize {
                    self.forget_one_that_left()?;
                }
                let id = self.next_viewer;
                self.next_viewer += 1;
                self.viewers.insert(id, Viewer::new(arrival.key.clone(), &self.config, now_us));
                id
            }
        };
        let rung = stream_within(&self.config.rungs, hello.bits_per_s);
        let is_same = known.is_some_and(|id| self.viewers[&id].rung == rung);
        // Light of another stream, or of another host, has epochs of its own. What is shared goes on whoever comes.
        let goes_on = is_same || arrival.shares;
        self.counts.joined += 1;
        let admission = Admission { role, rung, held: hello.held.filter(|_| goes_on), goes_on };
        Ok(self.welcome(id, admission, &arrival, now_us))
    }

    /// Connects a viewer that is known, and tells it so.
    fn welcome(&mut self, id: u64, admission: Admission, arrival: &Arrival, now_us: u64) -> Link {
        let Admission { role, rung, held, goes_on } = admission;
        let viewer = self.viewers.get_mut(&id).expect("whoever is admitted has a place");
        viewer.connect(role, rung, held, arrival, now_us);
        viewer.welcome(id, goes_on, &self.config, now_us);
        Link { viewer: id, connection: viewer.connection }
    }

    /// Makes room by forgetting who left first.
    fn forget_one_that_left(&mut self) -> Result<(), Refusal> {
        let gone = self.viewers.iter().filter_map(|(id, viewer)| Some((viewer.left_us?, *id))).min();
        let Some((_, id)) = gone else {
            let most = self.config.max_viewers;
            let message = format!("{most} viewers are here already, which is the most: try again later");
            return Err(Refusal::new(Reason::Full, message));
        };
        self.viewers.remove(&id);
        Ok(())
    }

    /// Takes a text of a viewer: [`Host::announce`], reading and [`Host::hear`] in one.
    ///
    /// # Errors
    /// The refusal to be sent before its connection is closed; the viewer has left then.
    pub fn receive(&mut self, link: Link, text: &str, now_us: u64) -> Result<(), Refusal> {
        self.announce(link, now_us)?;
        let message = FromViewer::parse(text);
        self.hear(link, message.map_err(|error| malformed(&error)), now_us)
    }

    /// A message has come that has not been read yet: it counts whatever it is.
    ///
    /// # Errors
    /// As [`Host::receive`].
    pub fn announce(&mut self, link: Link, now_us: u64) -> Result<(), Refusal> {
        let counted = self.count(link, now_us);
        self.expel_unless(counted, link, now_us)
    }

    /// Takes a message that was read ([`FromViewer::parse`]), or could not be.
    ///
    /// # Errors
    /// As [`Host::receive`].
    pub fn hear(
        &mut self,
        link: Link,
        message: Result<FromViewer, Refusal>,
        now_us: u64,
    ) -> Result<(), Refusal> {
        if connected(&mut self.viewers, link).is_none() {
            // What still comes from one that has gone is nobody's.
            return Ok(());
        }
        let taken = message.and_then(|message| self.take(link, message, now_us));
        self.expel_unless(taken, link, now_us)
    }

    fn expel_unless(&mut self, taken: Result<(), Refusal>, link: Link, now_us: u64) -> Result<(), Refusal> {
        if taken.is_err() {
            self.counts.expelled += 1;
            self.leave(link, now_us);
        }
        taken
    }

    fn count(&mut self, link: Link, now_us: u64) -> Result<(), Refusal> {
        let Some(viewer) = connected(&mut self.viewers, link) else { return Ok(()) };
        viewer.last_message_us = now_us;
        if viewer.messages.take(now_us) {
            return Ok(());
        }
        let most = self.config.messages_per_s;
        let message = format!("more than {most} messages a second: send less often");
        Err(Refusal::new(Reason::TooMany, message))
    }

    fn take(&mut self, link: Link, message: FromViewer, now_us: u64) -> Result<(), Refusal> {
        let Some(viewer) = connected(&mut self.viewers, link) else { return Ok(()) };
        match message {
            // Said again because the welcome took its time.
            FromViewer::Hello(_) => Ok(()),
            FromViewer::Look(look) => {
                if let Some(age_us) = viewer.look(&look, now_us)
                    && self.ages_us.len() < MAX_AGES
                {
                    self.ages_us.push(age_us);
                }
                Ok(())
            }
            FromViewer::Event { number, event } => {
                // What was heard before needs no answer but that; what does not follow comes again.
                if number != viewer.events_taken.wrapping_add(1) {
                    viewer.answer_events_again();
                    return Ok(());
                }
                let refused = if viewer.role < Role::Interact {
                    Some("events need the role interact: connect with its token".to_owned())
                } else if !viewer.events.take(now_us) {
                    let most = self.config.events_per_s;
                    Some(format!("more than {most} events a second: send less often"))
                } else if self.queue.len() >= MAX_QUEUED_EVENTS {
                    Some("too many events of all viewers wait for the next step: try again".to_owned())
                } else {
                    None
                };
                viewer.events_taken = number;
                let Some(message) = refused else {
                    viewer.waiting += 1;
                    self.queue.push_back((link.viewer, number, event));
                    return Ok(());
                };
                self.counts.rejected += 1;
                viewer.tell(&FromHost::Rejected { number, message });
                viewer.deal(None);
                Ok(())
            }
            FromViewer::Bye => {
                self.viewers.remove(&link.viewer);
                Ok(())
            }
        }
    }

    /// The connection has ended, for whatever reason.
    pub fn leave(&mut self, link: Link, now_us: u64) {
        let Some(viewer) = connected(&mut self.viewers, link) else { return };
        viewer.left_us = Some(now_us);
        if viewer.is_observer {
            self.viewers.remove(&link.viewer);
        }
    }

    /// What a connection is to do now.
    pub fn next(&mut self, link: Link, now_us: u64) -> Next {
        let closing = self.closing.clone();
        let Some(viewer) = self.viewers.get_mut(&link.viewer).filter(|v| v.connection == link.connection)
        else {
            let message = "the viewer came again over another connection, or said goodbye";
            return Next::Close(Refusal::new(Reason::Replaced, message));
        };
        if let Some(refusal) = viewer.expelled.take().or(closing) {
            self.leave(link, now_us);
            return Next::Close(refusal);
        }
        if let Some(text) = viewer.control.pop_front() {
            self.counts.bytes += text.len() as u64;
            return Next::Send(Outgoing::Text(text));
        }
        if viewer.is_told_state()
            && let Some(message) = self.state.news(viewer.state_sent)
        {
            viewer.state_sent = self.state.version();
            self.counts.bytes += message.len() as u64;
            return Next::Send(Outgoing::Text(message));
        }
        if viewer.change_stream(self.config.rungs.len() - 1, now_us) {
            viewer.welcome(link.viewer, false, &self.config, now_us);
            return self.next(link, now_us);
        }
        let rung = &mut self.rungs[viewer.rung];
        let Some(bytes) = viewer.next_light(rung, self.tick.as_ref(), &mut self.counts, &self.config, now_us)
        else {
            return Next::Wait;
        };
        self.counts.bytes += bytes.len() as u64;
        Next::Send(Outgoing::Bytes(bytes))
    }

    /// Begins a step: events that have come take effect, and who is gone is forgotten.
    pub fn begin_step(&mut self, now_us: u64) -> Tick {
        let (silence_us, resume_us) = (self.config.silence_us, self.config.resume_us);
        self.viewers.retain(|_, viewer| {
            viewer.left_us.is_none_or(|left_us| now_us.saturating_sub(left_us) <= resume_us)
        });
        for viewer in self.viewers.values_mut().filter(|viewer| viewer.is_here()) {
            if now_us.saturating_sub(viewer.last_message_us) > silence_us && viewer.expelled.is_none() {
                self.counts.expelled += 1;
                let message = format!("no message for {} s", silence_us / 1_000_000);
                viewer.expel(Refusal::new(Reason::Silent, message), now_us);
            }
        }
        let mut batch = self.state.batch(now_us);
        let mut left = MAX_EVENTS_A_STEP;
        let overtaken = overtaken(&self.queue);
        for is_overtaken in overtaken {
            if left == 0 {
                break;
            }
            let Some((id, number, event)) = self.queue.pop_front() else { break };
            let applied = if is_overtaken {
                Ok(())
            } else {
                left -= 1;
                batch.apply(&self.scene, event)
            };
            match &applied {
                Ok(()) => self.counts.events += 1,
                Err(_) => self.counts.rejected += 1,
            }
            if let Some(viewer) = self.viewers.get_mut(&id) {
                viewer.deal(Some(number));
                if let Err(message) = applied {
                    viewer.tell(&FromHost::Rejected { number, message });
                }
            }
        }
        batch.end();
        for viewer in self.viewers.values_mut() {
            viewer.answer_events();
        }
        let version = self.state.version();
        let edits = (version != self.told_version).then(|| self.state.edits().clone());
        self.told_version = version;
        let scene_us = self.state.clock().time_us(now_us);
        Tick { stamp_us: now_us, scene_us, state: version, edits }
    }

    /// Gives out what a step made for a rung; nothing where it changed nothing.
    pub fn publish(&mut self, rung: usize, tick: &Tick, frame: Option<&Frame>, made_us: u64) {
        if let Some(frame) = frame {
            let head = self.head(rung, tick, made_us);
            self.rungs[rung].publish(head, frame);
        }
    }

    /// Whether someone waits for a snapshot of a rung.
    pub fn wants_snapshot(&self, rung: usize) -> bool {
        self.rungs[rung].is_wanted()
    }

    /// Gives a snapshot of what a rung's viewers hold who are up to date.
    pub fn put_snapshot(&mut self, rung: usize, tick: &Tick, frame: &Frame, made_us: u64) {
        let head = self.head(rung, tick, made_us);
        self.rungs[rung].put_snapshot(head, frame);
    }

    fn head(&self, rung: usize, tick: &Tick, made_us: u64) -> LightHead {
        let part = rung.checked_sub(self.config.rungs.len()).and_then(|part| u8::try_from(part).ok());
        LightHead { part, ..tick.head(made_us) }
    }

    /// How many rungs there are: those of the whole light, then those of its parts.
    pub fn rungs(&self) -> usize {
        self.rungs.len()
    }

    /// Ends a step: who has nothing else to hear learns that the light is still right.
    pub fn end_step(&mut self, tick: &Tick, made_us: u64, mut status: crate::Status) {
        self.tick = tick.head(made_us).messages(&[]).pop();
        status.viewers = self.viewers.values().filter(|viewer| viewer.is_here()).count() as u32;
        status.step_us = made_us.saturating_sub(tick.stamp_us);
        for viewer in self.viewers.values_mut().filter(|viewer| viewer.left_us.is_none()) {
            viewer.tell_status(&status, made_us);
        }
    }

    /// Whether somebody takes the light of a rung now.
    pub fn is_watched(&self, rung: usize) -> bool {
        self.shared[rung] || self.viewers.values().any(|viewer| viewer.takes_light() && viewer.rung == rung)
    }

    /// The cameras of viewers, at most so many: where there are more, others each time.
    pub fn looks(&self, most: usize, turn: u64) -> Vec<LookCamera> {
        let all: Vec<LookCamera> = self
            .viewers
            .values()
            .filter(|viewer| viewer.is_here())
            .filter_map(|viewer| viewer.camera)
            .collect();
        if all.len() <= most {
            return all;
        }
        let start = (turn as usize).wrapping_mul(most) % all.len();
        all.iter().cycle().skip(start).take(most).copied().collect()
    }

    /// What has happened since the start.
    pub fn counts(&self) -> HostCounts {
        let viewers = self.viewers.values().filter(|viewer| viewer.is_here()).count() as u32;
        HostCounts { viewers, ..self.counts.clone() }
    }

    /// Ages of light (microseconds) as viewers have told them since this was last asked for: from the step's start to its coming, and back.
    pub fn take_ages(&mut self) -> Vec<u32> {
        std::mem::take(&mut self.ages_us)
    }

    /// Ends all sessions, and lets nobody in any more.
    pub fn close(&mut self) {
        let message = "the host has been stopped: it may come back";
        self.closing = Some(Refusal::new(Reason::Closing, message));
    }

    /// The scene's state now: version, clock, and what was changed.
    pub fn state(&self) -> (u64, SceneClock, &Edits) {
        (self.state.version(), self.state.clock(), self.state.edits())
    }

    /// The scene.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }
}

fn malformed(error: &crate::MessageError) -> Refusal {
    Refusal::new(Reason::Malformed, error.to_string())
}

fn connected(viewers: &mut BTreeMap<u64, Viewer>, link: Link) -> Option<&mut Viewer> {
    viewers
        .get_mut(&link.viewer)
        .filter(|viewer| viewer.connection == link.connection && viewer.left_us.is_none())
}

/// Bytes as hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
