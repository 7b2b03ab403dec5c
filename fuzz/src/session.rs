//! Any list of calls on a publisher and its subscribers: they converge.

use dapple_store::points::{BentChange, BentNormal, Change, PointLayout, PointStore};
use dapple_stream::{Applied, Frame, Limits, Precision, Publisher, PublisherConfig, Subscriber};

use crate::input::{Input, fingerprint};

/// Most calls of one run.
const MAX_CALLS: usize = 200;

/// One publisher, one subscriber that hears everything, two that hear what the bytes choose.
struct Session {
    publisher: Publisher,
    tolerance: u8,
    store: PointStore,
    live: Subscriber,
    lossy: [Subscriber; 2],
    sent: Vec<Frame>,
}

/// Reads `data` as a first store and a list of calls, makes them, and checks that whoever holds a state holds the
/// right one, that damage is noticed, and that a join brings everyone up to date.
pub fn session_ops(data: &[u8]) {
    let mut input = Input(data);
    let (first_group, deltas_per_group) = (u64::from(input.byte()), u32::from(input.byte()) % 8);
    let precision = Precision { tolerance: input.byte() % 16, step: input.byte() % 20 };
    let config = PublisherConfig { first_group, deltas_per_group, precision, bent_precision: precision };
    let subscriber = Subscriber::new(Some([3; 32]), Limits::default());
    let mut session = Session {
        publisher: Publisher::new([3; 32], config),
        tolerance: config.precision.tolerance,
        store: input.store(),
        live: subscriber.clone(),
        lossy: [subscriber.clone(), subscriber],
        sent: Vec::new(),
    };
    assert!(session.publisher.join().is_none());
    session.publish();
    for _ in 0..MAX_CALLS {
        if input.is_empty() {
            break;
        }
        session.call(&mut input);
    }
    for which in 0..2 {
        session.rejoin(which);
        for frame in &session.sent {
            let applied = session.lossy[which].receive(&frame.bytes);
            assert!(matches!(applied, Ok(Applied::Ignored(_))), "after a join, {applied:?}");
        }
    }
}

impl Session {
    fn call(&mut self, input: &mut Input<'_>) {
        match input.byte() % 9 {
            0 | 1 => {
                let points = self.store.visibility().len();
                let changes: Vec<Change> = (0..if points > 0 { input.below(16) } else { 0 })
                    .map(|_| Change { point: input.below(points) as u32, visibility: input.byte() })
                    .collect();
                self.store.apply(&changes).expect("the points exist");
                let bend = |change: &Change| {
                    let old = self.store.bent_of(change.point as usize)?;
                    let new = BentNormal([change.visibility, old.0[1] ^ change.visibility >> 5]);
                    Some(BentChange { point: change.point, old, new })
                };
                let bent: Vec<BentChange> = changes.iter().filter_map(bend).collect();
                self.store.apply_bent(&bent).expect("they have some");
                self.publish();
            }
            2 => {
                let frame = self.publisher.publish(&self.store);
                assert!(frame.is_none(), "a still scene sends nothing");
            }
            3 => {
                self.store = input.store();
                self.publish();
            }
            4 => {
                let frame = self.publisher.start_group();
                self.send(frame);
            }
            5 => {
                let which = input.below(2);
                let frame = &self.sent[input.below(self.sent.len())];
                // A gap is an error here, and no harm.
                let _ = self.lossy[which].receive(&frame.bytes);
            }
            6 => {
                let which = input.below(2);
                let mut bytes = self.sent[input.below(self.sent.len())].bytes.to_vec();
                let at = input.below(bytes.len());
                bytes[at] ^= input.byte().max(1);
                let before = self.lossy[which].store().cloned();
                assert!(self.lossy[which].receive(&bytes).is_err(), "damage went unnoticed");
                assert!(self.lossy[which].store() == before.as_ref());
            }
            7 => {
                self.change_sets(input);
                self.publish();
            }
            _ => self.rejoin(input.below(2)),
        }
    }

    /// Some sets go, those of another store come where there are none.
    fn change_sets(&mut self, input: &mut Input<'_>) {
        let keep = input.byte();
        let layout = self.store.layout().clone();
        let instances = layout.sets().iter().map(|set| set.instance);
        let gone: Vec<u32> = instances
            .zip(0..8)
            .filter(|(_, bit)| keep >> bit & 1 == 0)
            .map(|(instance, _)| instance)
            .collect();
        let left = self.store.with_sets(&gone, &PointStore::default()).expect("they are there");
        let other = input.store();
        let sets =
            other.layout().sets().iter().filter(|set| left.layout().set_of_instance(set.instance).is_none());
        let sets = sets.cloned().collect();
        let added =
            PointLayout::new(layout.quantum_m(), layout.spacing_m(), sets).expect("points were sorted");
        let added = PointStore::default().carried(added.into(), &other);
        self.store = left.with_sets(&[], &added).expect("they are not there");
    }

    fn publish(&mut self) {
        let frame = self.publisher.publish(&self.store);
        self.send(frame);
    }

    fn send(&mut self, frame: Option<Frame>) {
        if let Some(frame) = frame {
            self.live.receive(&frame.bytes).expect("it hears everything");
            assert_eq!((self.live.group(), self.live.epoch()), (Some(frame.group), Some(frame.epoch)));
            self.sent.push(frame);
        }
        self.check(&self.live);
    }

    fn rejoin(&mut self, which: usize) {
        let frame = self.publisher.join().expect("something is published");
        self.lossy[which].receive(&frame.bytes).expect("a snapshot is always welcome");
        self.check(&self.lossy[which]);
    }

    /// `subscriber` is up to date.
    fn check(&self, subscriber: &Subscriber) {
        let held = subscriber.store().expect("it has a snapshot");
        let published = self.publisher.store().expect("something is published");
        assert!(fingerprint(held) == fingerprint(published), "the stores differ");
        let planes = |store: &PointStore| -> Vec<u8> {
            let bent = store.bent().into_iter().flatten().flatten();
            store.visibility().iter().chain(bent).copied().collect()
        };
        let (held, wanted) = (planes(held), planes(&self.store));
        let pairs = held.iter().zip(&wanted);
        assert!(
            held.len() == wanted.len() && pairs.clone().all(|(a, b)| a.abs_diff(*b) <= self.tolerance),
            "a value is too far off"
        );
        assert_eq!(
            (subscriber.group(), subscriber.epoch()),
            (self.publisher.group(), self.publisher.epoch())
        );
    }
}
