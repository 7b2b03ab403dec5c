//! One host with a changing store, viewers behind faulty links, and the clock that drives them all.

use std::sync::Arc;

use dapple_scene::{Edit, NoFiles, Placement, Scene, builtin};
use dapple_store::points::{Change, PackedNormal, PointLayout, PointSet, PointStore};
use dapple_stream::{Limits, Precision, Publisher, PublisherConfig, Subscriber};

use super::link::{Faults, FaultyLink, Random};
use crate::host::{Arrival, Host, HostConfig, Link, Next, Outgoing};
use crate::{Event, FromViewer, Guest, GuestConfig, GuestError, Held, News, Status};

/// The drill's clock goes in steps of this.
const STEP_US: u64 = 5_000;

/// Updates are this far apart.
const TICK_US: u64 = 50_000;

/// A viewer and its two ways.
pub(super) struct Peer {
    pub(super) guest: Guest,
    pub(super) subscriber: Subscriber,
    pub(super) up: FaultyLink<String>,
    pub(super) down: FaultyLink<Outgoing>,
    link: Option<Link>,
    is_connected: bool,
    retry_us: u64,
    is_ordered: bool,
    /// It takes no messages until then.
    pub(super) stalled_until_us: u64,
    /// It does not tell what it holds: for the control that must fail.
    pub(super) is_mute: bool,
    pub(super) refused: Vec<crate::Refusal>,
    pub(super) light_bytes: u64,
    pub(super) snapshots: u32,
}

pub(super) struct Drill {
    pub(super) scene: Arc<Scene>,
    pub(super) host: Host,
    pub(super) publisher: Publisher,
    /// Of the leaner stream, which has every eighth update.
    pub(super) lean: Publisher,
    ticks: u64,
    pub(super) store: PointStore,
    pub(super) peers: Vec<Peer>,
    pub(super) now_us: u64,
    /// When the host's clock began.
    host_began_us: u64,
    random: Random,
    /// Points that change with each update.
    pub(super) churn: u64,
    hosts: u64,
    host_config: HostConfig,
}

impl Drill {
    pub(super) fn new(points: u32, host_config: HostConfig, seed: u64) -> Drill {
        let glb = builtin::glb("cornell", 0.2).unwrap();
        let scene = Arc::new(dapple_scene::load("cornell.glb", &glb, &NoFiles).unwrap());
        let layout = PointLayout::new(1.0 / 512.0, 1.0 / 32.0, vec![set(points)]).unwrap();
        let store = PointStore::new(layout.into(), vec![255; points as usize]).unwrap();
        let mut drill = Drill {
            host: Host::new(scene.clone(), host_config.clone(), 0),
            publisher: publisher(&scene, 1),
            lean: publisher(&scene, 1),
            ticks: 0,
            scene,
            store,
            peers: Vec::new(),
            now_us: 0,
            host_began_us: 0,
            random: Random(seed),
            churn: 20,
            hosts: 1,
            host_config,
        };
        drill.publisher.publish(&drill.store);
        drill.lean.publish(&drill.store);
        drill
    }

    pub(super) fn add_peer(&mut self, faults: Faults) -> usize {
        let seed = self.random.bits();
        self.peers.push(Peer {
            guest: Guest::new(self.scene.clone(), GuestConfig { seed, ..GuestConfig::default() }),
            subscriber: Subscriber::new(Some(self.scene.hash().0), Limits::default()),
            up: FaultyLink::new(faults, seed ^ 1),
            down: FaultyLink::new(faults, seed ^ 2),
            link: None,
            is_connected: false,
            retry_us: self.now_us,
            is_ordered: faults.is_ordered,
            stalled_until_us: 0,
            is_mute: false,
            refused: Vec::new(),
            light_bytes: 0,
            snapshots: 0,
        });
        self.peers.len() - 1
    }

    /// The connection of a viewer breaks; the host hears of it.
    pub(super) fn cut(&mut self, peer: usize) {
        let host_us = self.host_us();
        let peer = &mut self.peers[peer];
        peer.up.cut();
        peer.down.cut();
        if let Some(link) = peer.link.take() {
            self.host.leave(link, host_us);
        }
        peer.is_connected = false;
        peer.retry_us = self.now_us + peer.guest.disconnected();
    }

    /// The host is gone, and another takes its place: it knows nothing of before.
    pub(super) fn replace_host(&mut self) {
        for peer in 0..self.peers.len() {
            self.cut(peer);
        }
        self.hosts += 1;
        // Its clock begins anew; the drill's goes on.
        self.host_began_us = self.now_us;
        self.host = Host::new(self.scene.clone(), self.host_config.clone(), 0);
        self.publisher = publisher(&self.scene, self.hosts * 1000);
        self.publisher.publish(&self.store);
        self.lean = publisher(&self.scene, self.hosts * 1000);
        self.lean.publish(&self.store);
    }

    /// Lets time pass until the next update, and makes it.
    pub(super) fn step(&mut self) {
        self.now_us += TICK_US;
        self.tick();
    }

    pub(super) fn run(&mut self, seconds: f64) {
        let until_us = self.now_us + (seconds * 1e6) as u64;
        while self.now_us < until_us {
            self.now_us += STEP_US;
            if self.now_us.is_multiple_of(TICK_US) {
                self.tick();
            }
            for peer in 0..self.peers.len() {
                self.serve(peer);
            }
        }
    }

    /// The host's clock.
    pub(super) fn host_us(&self) -> u64 {
        self.now_us - self.host_began_us
    }

    fn tick(&mut self) {
        let host_us = self.host_us();
        let tick = self.host.begin_step(host_us);
        let points = self.store.layout().len() as u64;
        let changes: Vec<Change> = (0..self.churn)
            .map(|_| Change {
                point: self.random.below(points) as u32,
                visibility: self.random.below(256) as u8,
            })
            .collect();
        self.store.apply(&changes).unwrap();
        let frame = self.publisher.publish(&self.store);
        self.host.publish(0, &tick, frame.as_ref(), host_us);
        self.ticks += 1;
        let has_lean = self.host.config().rungs.len() > 1;
        if has_lean && self.ticks.is_multiple_of(8) {
            let frame = self.lean.publish(&self.store);
            self.host.publish(1, &tick, frame.as_ref(), host_us);
        }
        for (rung, publisher) in
            [&self.publisher, &self.lean].into_iter().enumerate().take(1 + usize::from(has_lean))
        {
            if self.host.wants_snapshot(rung) {
                self.host.put_snapshot(rung, &tick, &publisher.join().unwrap(), host_us);
            }
        }
        self.host.end_step(&tick, host_us, Status::default());
    }

    fn serve(&mut self, index: usize) {
        let (now_us, host_us) = (self.now_us, self.host_us());
        let peer = &mut self.peers[index];
        if !peer.is_connected && now_us >= peer.retry_us {
            peer.is_connected = true;
            peer.guest.connected(now_us);
        }
        if !peer.is_connected {
            return;
        }
        while let Some(text) = peer.guest.next(now_us) {
            if peer.is_mute && matches!(FromViewer::parse(&text), Ok(FromViewer::Look(_))) {
                continue;
            }
            let bytes = text.len();
            peer.up.put(text, bytes, now_us);
        }
        while let Some(text) = peer.up.take(now_us) {
            let hello = match FromViewer::parse(&text).unwrap() {
                FromViewer::Hello(hello) => hello,
                _ => {
                    if let Some(link) = peer.link {
                        self.host.receive(link, &text, host_us).unwrap();
                    }
                    continue;
                }
            };
            // Said again: over an ordered link the host hears it like anything else, over others the welcome may have been lost.
            if let Some(link) = peer.link {
                if peer.is_ordered {
                    self.host.receive(link, &text, host_us).unwrap();
                    continue;
                }
                self.host.leave(link, host_us);
            }
            let key = format!("{:032x}", self.random.bits());
            let arrival =
                Arrival { key, is_reliable: peer.is_ordered, is_foreign: false, shares: false, unix_us: 0 };
            match self.host.join(&hello, arrival, host_us) {
                Ok(link) => peer.link = Some(link),
                Err(refusal) => peer.refused.push(refusal),
            }
        }
        while let Some(link) = peer.link
            && peer.down.has_room(now_us)
            && now_us >= peer.stalled_until_us
        {
            match self.host.next(link, host_us) {
                Next::Send(message) => {
                    let bytes = match &message {
                        Outgoing::Text(text) => text.len(),
                        Outgoing::Bytes(bytes) => bytes.len(),
                    };
                    peer.down.put(message, bytes, now_us);
                }
                Next::Wait => break,
                Next::Close(refusal) => {
                    peer.refused.push(refusal);
                    peer.link = None;
                }
            }
        }
        if now_us < peer.stalled_until_us {
            return;
        }
        while let Some(message) = peer.down.take(now_us) {
            let news = match message {
                Outgoing::Text(text) => peer.guest.receive_text(&text),
                Outgoing::Bytes(bytes) => {
                    peer.light_bytes += bytes.len() as u64;
                    peer.guest.receive_bytes(&bytes, now_us)
                }
            };
            match news {
                Ok(News::Light { frame, .. }) if !frame.is_empty() => peer.apply(&frame),
                Ok(News::Welcome(false)) => peer.subscriber.outdate(),
                Ok(_) => {}
                // A change that was built on another state than the one held cannot be told from a right one by a viewer alone.
                Err(GuestError::Refused(refusal)) => peer.refused.push(refusal),
                Err(error) => panic!("{error}"),
            }
        }
    }

    /// What every viewer must hold after the links have been quiet for a while.
    pub(super) fn check(&self, peer: usize) -> Result<(), String> {
        let peer = &self.peers[peer];
        let is_lean = peer.guest.welcome().is_some_and(|welcome| welcome.bits_per_s.is_some());
        let publisher = if is_lean { &self.lean } else { &self.publisher };
        let published = publisher.store().unwrap();
        let Some(held) = peer.subscriber.store() else { return Err("it holds nothing".into()) };
        if held.visibility() != published.visibility() {
            let epochs = (peer.subscriber.group(), peer.subscriber.epoch());
            let newest = (publisher.group(), publisher.epoch());
            return Err(format!("its light differs: {epochs:?} of {newest:?}"));
        }
        let (version, clock, edits) = self.host.state();
        if peer.guest.version() != version || peer.guest.edits() != edits || peer.guest.clock() != clock {
            return Err(format!("its state differs: version {} of {version}", peer.guest.version()));
        }
        if peer.guest.has_pending() {
            return Err("events have not been answered".into());
        }
        Ok(())
    }
}

impl Peer {
    fn apply(&mut self, frame: &[u8]) {
        let result = self.subscriber.receive(frame);
        let held =
            self.subscriber.group().zip(self.subscriber.epoch()).map(|(group, epoch)| Held { group, epoch });
        if matches!(result, Ok(dapple_stream::Applied::NewLayout)) {
            self.snapshots += 1;
        }
        if let Err(error) = &result {
            assert!(error.snapshot_helps(), "{error}");
        }
        self.guest.applied(held, result.is_ok());
    }
}

/// An event that any scene takes: node 1 goes somewhere.
pub(super) fn moved(to: f32) -> Event {
    let placement =
        Placement { translation: [to, 0.0, 0.0], rotation: [0.0, 0.0, 0.0, 1.0], scale: [1.0; 3] };
    Event::Edit { change: Edit::Place { node: 1, placement } }
}

fn publisher(scene: &Scene, first_group: u64) -> Publisher {
    let precision = Precision { tolerance: 0, step: 0 };
    Publisher::new(scene.hash().0, PublisherConfig { first_group, precision, ..PublisherConfig::default() })
}

fn set(points: u32) -> PointSet {
    PointSet {
        instance: 0,
        positions: (0..points).map(|i| [i * 16, 0, 0]).collect(),
        normals: vec![PackedNormal([127, 127]); points as usize],
        ..PointSet::default()
    }
}
