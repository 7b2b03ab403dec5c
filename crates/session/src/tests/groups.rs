//! Shared streams in groups: whoever joins at a group, goes on or misses some ends with the same bytes.

use std::sync::Arc;

use dapple_stream::{Limits, Subscriber};

use super::drill::{Drill, moved};
use crate::host::{Arrival, HostConfig, LightGroups, Next, Outgoing, Piece, StateGroups};
use crate::{FromViewer, Guest, GuestConfig, GuestError, Held, News};

/// One group as a relay keeps it.
#[derive(Default)]
struct Group {
    snapshot: Vec<Arc<[u8]>>,
    light: Vec<Arc<[u8]>>,
}

fn arrival() -> Arrival {
    let key = "not told".to_owned();
    Arrival { key, is_reliable: true, is_foreign: false, shares: true, unix_us: 7 }
}

/// What a host has written, group by group.
struct Written {
    light: LightGroups,
    state: StateGroups,
    groups: Vec<Group>,
    texts: Vec<Vec<Arc<str>>>,
}

impl Written {
    fn new() -> Written {
        let (groups, texts) = (Vec::new(), Vec::new());
        Written { light: LightGroups::new(0), state: StateGroups::default(), groups, texts }
    }

    /// Writes all that there is; true if the host has ended.
    fn write(&mut self, drill: &mut Drill) -> bool {
        let now_us = drill.host_us();
        loop {
            match self.state.next(&mut drill.host, &arrival(), now_us) {
                Piece::Begin(text) => self.texts.push(vec![text]),
                Piece::More(text) => self.texts.last_mut().unwrap().push(text),
                Piece::Wait => break,
                Piece::End(text) => {
                    self.texts.last_mut().unwrap().push(text);
                    return true;
                }
            }
        }
        loop {
            match self.light.next(&mut drill.host, now_us) {
                Piece::Begin(snapshot) => self.groups.push(Group { snapshot, ..Group::default() }),
                Piece::More(light) => self.groups.last_mut().unwrap().light.extend(light),
                Piece::Wait => return false,
                Piece::End(_) => return true,
            }
        }
    }
}

/// A watcher that takes groups, with the snapshot of those that do not follow what it took before.
struct Watcher {
    guest: Guest,
    subscriber: Subscriber,
    broken: u32,
    bytes: usize,
}

impl Watcher {
    fn new(drill: &Drill) -> Watcher {
        let mut guest = Guest::new(drill.scene.clone(), GuestConfig::default());
        guest.connected(0);
        let subscriber = Subscriber::new(Some(drill.scene.hash().0), Limits::default());
        Watcher { guest, subscriber, broken: 0, bytes: 0 }
    }

    fn take(&mut self, messages: &[Arc<[u8]>], now_us: u64) {
        for message in messages {
            self.bytes += message.len();
            if let News::Light { frame, .. } = self.guest.receive_bytes(message, now_us).unwrap()
                && !frame.is_empty()
            {
                let result = self.subscriber.receive(&frame);
                self.broken += u32::from(result.is_err());
                let held = self.subscriber.group().zip(self.subscriber.epoch());
                let held = held.map(|(group, epoch)| Held { group, epoch });
                self.guest.applied(held, result.is_ok());
            }
        }
    }

    fn hear(&mut self, texts: &[Arc<str>]) {
        for text in texts {
            if let News::Welcome(goes_on) = self.guest.receive_text(text).unwrap() {
                assert!(!goes_on, "what is shared goes on with nothing of before");
                self.subscriber.outdate();
            }
        }
    }

    fn check(&self, drill: &Drill) {
        let (held, published) = (self.subscriber.store().unwrap(), drill.publisher.store().unwrap());
        assert!(held.visibility() == published.visibility(), "its light differs");
        let (version, clock, edits) = drill.host.state();
        assert_eq!((self.guest.version(), self.guest.clock()), (version, clock));
        assert_eq!(self.guest.edits(), edits);
    }
}

/// A host that is watched for some seconds, with events of a viewer.
fn written(seconds: u32) -> (Drill, Written) {
    let mut drill = Drill::new(3000, HostConfig { rungs: vec![None], ..HostConfig::default() }, 5);
    let peer = drill.add_peer(super::link::Faults { is_ordered: true, ..Default::default() });
    drill.churn = 150;
    let mut written = Written::new();
    drill.host.set_shared(0, true);
    for step in 0..seconds * 20 {
        drill.run(0.05);
        if step % 30 == 7 {
            assert!(drill.peers[peer].guest.send(moved(step as f32)));
        }
        assert!(!written.write(&mut drill));
    }
    drill.churn = 0;
    for _ in 0..20 {
        drill.run(0.05);
        written.write(&mut drill);
    }
    (drill, written)
}

#[test]
fn a_watcher_that_joins_at_any_group_ends_with_the_same_bytes() {
    let (drill, written) = written(12);
    assert!(written.groups.len() >= 4, "{} groups", written.groups.len());
    for first in 0..written.groups.len() {
        let mut watcher = Watcher::new(&drill);
        watcher.hear(&written.texts[0]);
        watcher.take(&written.groups[first].snapshot, 1);
        let joined = watcher.bytes;
        for group in &written.groups[first..] {
            watcher.take(&group.light, 1);
        }
        assert_eq!(watcher.broken, 0);
        watcher.hear(written.texts.last().unwrap());
        watcher.check(&drill);
        // What joining costs beyond the snapshot is bounded: what a second brings, where the bound is less.
        let group: usize = written.groups[first].light.iter().map(|message| message.len()).sum();
        assert!(group <= joined / 4 + 4096 + 21 * 400, "{group} bytes after {joined}");
        assert!(written.groups[first].light.len() <= 512);
    }
}

#[test]
fn a_watcher_that_misses_groups_jumps() {
    let (drill, written) = written(12);
    let mut watcher = Watcher::new(&drill);
    watcher.hear(&written.texts[0]);
    let last = written.groups.len() - 1;
    watcher.take(&written.groups[0].snapshot, 1);
    // The tail of the first, and all of the second, are missing.
    let light = &written.groups[0].light;
    watcher.take(&light[..light.len() / 2], 1);
    watcher.take(&written.groups[2].snapshot, 1);
    for group in &written.groups[2..=last] {
        watcher.take(&group.light, 1);
    }
    watcher.hear(written.texts.last().unwrap());
    assert_eq!(watcher.broken, 0);
    watcher.check(&drill);
}

#[test]
fn without_its_snapshot_a_group_is_of_no_use_to_who_missed_one() {
    let (drill, written) = written(8);
    let mut watcher = Watcher::new(&drill);
    watcher.hear(&written.texts[0]);
    watcher.take(&written.groups[0].snapshot, 1);
    watcher.take(&written.groups[2].light, 1);
    assert!(watcher.broken > 0, "it must be told that something is missing");
    let held = watcher.subscriber.store().unwrap();
    assert!(held.visibility() != drill.publisher.store().unwrap().visibility());
}

#[test]
fn an_observer_is_no_viewer_and_never_silent() {
    let mut drill = Drill::new(100, HostConfig { max_viewers: 1, ..HostConfig::default() }, 3);
    let mut written = Written::new();
    for _ in 0..30 * 20 {
        drill.step();
        written.write(&mut drill);
    }
    assert_eq!(drill.host.counts().viewers, 0);
    assert!(!drill.host.is_watched(0), "an observer takes no light");
    assert_eq!(drill.host.counts().expelled, 0);
    drill.host.set_shared(0, true);
    assert!(drill.host.is_watched(0));
    // It takes nobody's place, and its empty key is no key.
    let peer = drill.add_peer(super::link::Faults { is_ordered: true, ..Default::default() });
    drill.run(1.0);
    assert_eq!(drill.host.counts().viewers, 1);
    assert!(drill.peers[peer].guest.welcome().is_some());
    drill.host.close();
    assert!(written.write(&mut drill), "it ends");
    let last = written.texts.last().unwrap().last().unwrap().clone();
    let mut guest = Guest::new(drill.scene.clone(), GuestConfig::default());
    assert!(matches!(guest.receive_text(&last), Err(GuestError::Refused(_))), "{last}");
}

#[test]
fn an_event_that_was_lost_with_its_connection_comes_once_where_state_is_shared() {
    let mut drill = Drill::new(100, HostConfig::default(), 4);
    let mut guest = Guest::new(drill.scene.clone(), GuestConfig::default());
    let said = |guest: &mut Guest, now_us: u64| {
        std::iter::from_fn(|| guest.next(now_us))
            .map(|text| FromViewer::parse(&text).unwrap())
            .collect::<Vec<_>>()
    };
    let is_event = |message: &FromViewer| matches!(message, FromViewer::Event { .. });
    for connection in 0..2 {
        let now_us = drill.host_us();
        guest.connected(now_us);
        let hello = said(&mut guest, now_us).remove(0);
        let FromViewer::Hello(hello) = hello else { panic!("{hello:?}") };
        // What all are told comes first, and says nothing of this viewer's events.
        let observer = drill.host.observe(arrival(), now_us);
        let Next::Send(Outgoing::Text(welcome)) = drill.host.next(observer, now_us) else { panic!() };
        assert_eq!(guest.receive_text(&welcome).unwrap(), News::Welcome(false));
        assert!(!said(&mut guest, now_us).iter().any(is_event), "before the host knows who says it");
        let key = format!("key {connection}");
        let link = drill.host.join(&hello, Arrival { key, ..arrival() }, now_us).unwrap();
        let Next::Send(Outgoing::Text(welcome)) = drill.host.next(link, now_us) else { panic!() };
        assert_eq!(guest.receive_text(&welcome).unwrap(), News::Welcome(true));
        if connection == 0 {
            // One that is answered, so that numbers go on from there, and one that is lost.
            assert!(guest.send(moved(1.0)));
        }
        for message in said(&mut guest, now_us) {
            drill.host.hear(link, Ok(message), now_us).unwrap();
        }
        drill.step();
        while let Next::Send(Outgoing::Text(text)) = drill.host.next(link, drill.host_us()) {
            guest.receive_text(&text).unwrap();
        }
        if connection == 0 {
            assert!(!guest.has_pending());
            assert!(guest.send(moved(2.0)));
            assert!(said(&mut guest, drill.host_us()).iter().any(is_event));
            drill.host.leave(link, drill.host_us());
            guest.disconnected();
        }
    }
    assert!(!guest.has_pending(), "it was answered");
    assert_eq!((drill.host.counts().events, drill.host.counts().resumed), (2, 1));
}
