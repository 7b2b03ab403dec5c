//! What must come right over bad links, and what must not.

use super::drill::{Drill, moved};
use super::link::Faults;
use crate::Event;
use crate::host::HostConfig;

fn tcp() -> Faults {
    Faults { delay_us: 20_000, is_ordered: true, ..Faults::default() }
}

/// Loss 5 %, reorder, duplicates, 100 ms jitter, 2 Mbit/s.
fn bad() -> Faults {
    Faults {
        loss: 50,
        duplicates: 20,
        delay_us: 20_000,
        jitter_us: 100_000,
        bytes_per_s: 250_000,
        is_ordered: false,
    }
}

/// Lets what is on its way arrive while nothing new happens.
fn settle(drill: &mut Drill) {
    drill.churn = 0;
    drill.run(8.0);
}

#[test]
fn viewers_converge_over_a_good_link() {
    let mut drill = Drill::new(3000, HostConfig::default(), 1);
    let first = drill.add_peer(tcp());
    drill.run(1.0);
    let late = drill.add_peer(tcp());
    drill.run(2.0);
    assert!(drill.peers[first].guest.send(moved(1.0)));
    drill.run(1.0);
    settle(&mut drill);
    for peer in [first, late] {
        drill.check(peer).unwrap();
        // One to begin with, and never again.
        assert_eq!(drill.peers[peer].snapshots, 1);
    }
    assert_eq!(drill.host.counts().events, 1);
}

#[test]
fn viewers_converge_over_bad_links_bit_for_bit() {
    for seed in 0..12 {
        let mut drill = Drill::new(4000, HostConfig::default(), seed);
        let peers = [drill.add_peer(bad()), drill.add_peer(bad()), drill.add_peer(tcp())];
        for round in 0..10 {
            drill.run(1.0);
            let peer = peers[round % 3];
            assert!(drill.peers[peer].guest.send(moved(round as f32)));
            let event = if round % 2 == 0 { Event::Pause } else { Event::Play };
            assert!(drill.peers[peer].guest.send(event));
            if round % 4 == 1 {
                drill.cut(peers[(round / 4) % 3]);
            }
        }
        settle(&mut drill);
        for peer in peers {
            drill.check(peer).unwrap_or_else(|reason| panic!("seed {seed}, viewer {peer}: {reason}"));
        }
        // Every event took effect, and just once.
        assert_eq!(drill.host.counts().events, 20, "seed {seed}");
        let down = drill.peers[0].down.happened;
        assert!(down.lost > 0 && down.twice > 0 && down.overtaken > 0, "the faults happened: {down:?}");
        assert!(drill.peers.iter().any(|peer| peer.down.happened.cut > 0));
    }
}

#[test]
fn who_does_not_tell_what_it_holds_does_not_converge() {
    let mut failed = 0;
    for seed in 0..4 {
        let config = HostConfig { silence_us: u64::MAX, ..HostConfig::default() };
        let mut drill = Drill::new(4000, config, seed);
        let peer = drill.add_peer(bad());
        drill.peers[peer].is_mute = true;
        drill.run(10.0);
        settle(&mut drill);
        failed += u32::from(drill.check(peer).is_err());
    }
    assert_eq!(failed, 4, "the drill would notice if nothing mended losses");
}

#[test]
fn a_viewer_that_stalls_jumps_to_the_present() {
    let mut drill = Drill::new(20_000, HostConfig::default(), 3);
    // So many changes that a few seconds of them are longer than a snapshot.
    drill.churn = 4000;
    let peer = drill.add_peer(tcp());
    drill.run(2.0);
    drill.peers[peer].stalled_until_us = drill.now_us + 8_000_000;
    drill.run(8.0);
    let before = drill.peers[peer].light_bytes;
    drill.run(1.0);
    let came = drill.peers[peer].light_bytes - before;
    let jumps = drill.host.counts().jumps;
    assert!(jumps >= 1, "it got a snapshot instead of the backlog");
    let backlog = 8 * 20 * 4000;
    assert!(came < backlog, "{came} bytes came after the stall");
    settle(&mut drill);
    drill.check(peer).unwrap();
}

#[test]
fn a_slow_viewer_is_never_far_behind_and_nothing_queues() {
    let mut drill = Drill::new(20_000, HostConfig::default(), 4);
    drill.churn = 3000;
    let faults = Faults { bytes_per_s: 60_000, ..tcp() };
    let peer = drill.add_peer(faults);
    for second in 0..30 {
        drill.run(1.0);
        let age = drill.peers[peer].guest.age_s(drill.now_us);
        if second > 10 {
            assert!(age.unwrap() < 4.0, "{age:?} after {second} s");
        }
    }
    settle(&mut drill);
    drill.check(peer).unwrap();
}

#[test]
fn a_slow_viewer_gets_a_leaner_stream_and_the_richer_one_when_its_link_is_wide_again() {
    let rungs = vec![None, Some(100_000)];
    let mut drill = Drill::new(20_000, HostConfig { rungs, ..HostConfig::default() }, 4);
    drill.churn = 3000;
    let slow = drill.add_peer(Faults { bytes_per_s: 60_000, ..tcp() });
    let fast = drill.add_peer(tcp());
    let bits = |drill: &Drill, peer: usize| drill.peers[peer].guest.welcome().unwrap().bits_per_s;
    drill.run(3.0);
    assert_eq!((bits(&drill, slow), bits(&drill, fast)), (None, None));
    drill.run(27.0);
    assert_eq!((bits(&drill, slow), bits(&drill, fast)), (Some(100_000), None));
    assert!(drill.peers[slow].guest.age_s(drill.now_us).unwrap() < 2.0);
    assert!(drill.peers[slow].guest.send(moved(1.0)));
    drill.run(2.0);
    drill.peers[slow].down.set_width(0);
    drill.run(70.0);
    assert_eq!((bits(&drill, slow), bits(&drill, fast)), (None, None));
    settle(&mut drill);
    for peer in [slow, fast] {
        drill.check(peer).unwrap();
    }
    assert_eq!(drill.peers[fast].snapshots, 1, "the other notices nothing");
    assert_eq!(drill.host.counts().events, 1);
}

#[test]
fn a_viewer_that_comes_back_goes_on_where_it_was() {
    let mut drill = Drill::new(20_000, HostConfig::default(), 5);
    let peer = drill.add_peer(tcp());
    drill.run(2.0);
    assert!(drill.peers[peer].guest.send(moved(2.0)));
    drill.cut(peer);
    drill.run(3.0);
    settle(&mut drill);
    drill.check(peer).unwrap();
    assert_eq!(drill.peers[peer].snapshots, 1, "deltas brought it up to date");
    let counts = drill.host.counts();
    assert_eq!((counts.resumed, counts.events, counts.viewers), (1, 1, 1));
}

#[test]
fn another_host_in_the_place_of_one_that_died_is_taken_on() {
    let mut drill = Drill::new(4000, HostConfig::default(), 6);
    let peers = [drill.add_peer(tcp()), drill.add_peer(bad())];
    drill.run(2.0);
    assert!(drill.peers[peers[0]].guest.send(moved(3.0)));
    drill.run(1.0);
    drill.replace_host();
    assert!(drill.peers[peers[1]].guest.send(moved(4.0)));
    drill.run(5.0);
    settle(&mut drill);
    for peer in peers {
        drill.check(peer).unwrap();
    }
    assert_eq!(drill.host.counts().events, 1, "what the dead host had done is gone");
}

#[test]
fn a_way_of_more_than_a_second_is_no_reason_to_part() {
    let mut drill = Drill::new(4000, HostConfig::default(), 8);
    let peer = drill.add_peer(Faults { delay_us: 700_000, ..tcp() });
    drill.run(4.0);
    assert!(drill.peers[peer].guest.send(moved(1.0)));
    drill.run(6.0);
    settle(&mut drill);
    drill.check(peer).unwrap();
    assert!(drill.peers[peer].refused.is_empty(), "{:?}", drill.peers[peer].refused);
    assert_eq!((drill.host.counts().joined, drill.host.counts().events), (1, 1));
}

#[test]
fn after_another_host_ages_and_times_are_right_again() {
    let mut drill = Drill::new(4000, HostConfig::default(), 9);
    let peer = drill.add_peer(tcp());
    drill.run(20.0);
    drill.replace_host();
    drill.run(3.0);
    let guest = &drill.peers[peer].guest;
    let host_s = drill.host.state().1.time_us(drill.host_us()) as f64 * 1e-6;
    let behind_s = host_s - guest.scene_time_s(drill.now_us);
    assert!((0.0..0.2).contains(&behind_s), "{behind_s} s behind");
    assert!(guest.age_s(drill.now_us).unwrap() < 0.3);
    assert!(!drill.host.take_ages().is_empty(), "the new host hears how old its light is");
}

#[test]
fn time_is_the_same_for_everyone() {
    let mut drill = Drill::new(100, HostConfig::default(), 7);
    let peers = [drill.add_peer(tcp()), drill.add_peer(Faults { delay_us: 80_000, ..tcp() })];
    drill.run(4.0);
    let times = peers.map(|peer| drill.peers[peer].guest.scene_time_s(drill.now_us));
    let host_s = drill.host.state().1.time_us(drill.host_us()) as f64 * 1e-6;
    for (time, delay) in times.into_iter().zip([0.02, 0.08]) {
        let behind = host_s - time;
        assert!((delay - 0.01..delay + 0.06).contains(&behind), "{behind} s behind");
    }
    assert!(drill.peers[0].guest.send(Event::Seek { time_s: 100.0 }));
    assert!(drill.peers[0].guest.send(Event::Pause));
    drill.run(1.0);
    for peer in peers {
        assert_eq!(drill.peers[peer].guest.scene_time_s(drill.now_us), 100.0);
    }
}
