//! `dapple serve --moq` and viewers of it, directly and through relays nobody here wrote.
#![cfg(all(unix, feature = "moq"))]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::sync::Arc;
use std::time::{Duration, Instant};

use common::command::fail;
use common::live::{Served, Viewer};
use common::moq::{At, MoqViewer, config, place, runtime};
use common::relay::Relay;
use dapple_moq::Names;
use dapple_moq::moq_net::{Timestamp, origin};
use dapple_session::{Event, GuestConfig, GuestError, Reason, Role};
use tempfile::TempDir;

/// Lets all talk until they hold the same light as the one over WebSocket, and for a while nothing new comes.
async fn settle(oracle: &mut Viewer, viewers: &mut [&mut MoqViewer]) {
    let start = Instant::now();
    let mut still_since = Instant::now();
    let mut last = None;
    while still_since.elapsed() < Duration::from_millis(700) {
        oracle.run(Duration::from_millis(20));
        for viewer in viewers.iter_mut() {
            for _ in 0..20 {
                viewer.talk().await;
            }
        }
        let now = (oracle.held().map(|(group, epoch, _)| (group, epoch)), oracle.guest.version());
        let all: Vec<_> = viewers
            .iter()
            .map(|v| (v.held().map(|(group, epoch, _)| (group, epoch)), v.guest.version()))
            .collect();
        assert!(start.elapsed() < Duration::from_secs(60), "they hold different things: {now:?}, {all:?}");
        if last != Some(now) || now.0.is_none() || all.iter().any(|of| *of != now) {
            still_since = Instant::now();
        }
        last = Some(now);
    }
    for viewer in viewers {
        assert!(viewer.held() == oracle.held(), "they hold the same epoch and different light");
        assert_eq!(viewer.guest.edits(), oracle.guest.edits());
    }
}

/// One viewer at each address: moves things, joins late, and holds to the bit what one over WebSocket holds.
async fn converge(served: &Served, at: &[At]) {
    let scene = served.scene();
    let mut oracle = Viewer::join(served.port, &scene, config(1));
    oracle.until("the first light", Viewer::has_light);
    let mut viewers = Vec::new();
    for (seed, at) in at.iter().enumerate() {
        let mut viewer = MoqViewer::join(at, &scene, config(10 + seed as u64)).await;
        viewer.until("the first light", MoqViewer::has_light).await;
        viewers.push(viewer);
    }
    let node = scene.instances[1].node;
    for (index, viewer) in viewers.iter_mut().enumerate() {
        viewer.until("it may change things", |v| v.guest.role() == Some(Role::Interact)).await;
        assert!(viewer.guest.send(place(node, 0.1 * index as f32)));
        viewer.until("its event is answered", |v| !v.guest.has_pending()).await;
    }
    // Long enough that groups begin while they watch.
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(3) {
        oracle.run(Duration::from_millis(10));
        for viewer in &mut viewers {
            viewer.talk().await;
        }
    }
    assert!(oracle.guest.send(Event::Pause));
    oracle.until("the event is answered", |v| !v.guest.has_pending());
    // Who comes now gets a group that began before.
    for at in at {
        let mut viewer = MoqViewer::join(at, &scene, config(99)).await;
        viewer.until("the light of one who joins late", MoqViewer::has_light).await;
        viewers.push(viewer);
    }
    settle(&mut oracle, &mut viewers.iter_mut().collect::<Vec<_>>()).await;
    for viewer in &viewers {
        assert!(
            viewer.refused.is_none() && viewer.ended.is_none(),
            "{:?} {:?}",
            viewer.refused,
            viewer.ended
        );
        assert_eq!(viewer.snapshots, 1, "one to begin with, and never again");
    }
    assert_eq!(served.figure("dapple_events_total"), at.len() as f64 + 1.0);
}

#[test]
fn viewers_over_quic_hold_what_those_over_websocket_hold() {
    let folder = TempDir::new().unwrap();
    let served = Served::start(folder.path(), 0, &["--moq", "--threshold", "0"]);
    let at = At::of(&served);
    assert!(
        at.url.starts_with("https://") && !at.url.contains("{host}") && at.certificate.is_some(),
        "{}",
        at.url
    );
    runtime().block_on(async {
        converge(&served, &[at.clone(), at.clone()]).await;
        // Another has the same scene file, and not the same scene.
        let mut other = (*served.scene()).clone();
        other.add_spares(&[dapple_scene::Spare { instance: 1, count: 1 }]).unwrap();
        let mut stranger = MoqViewer::join(&at, &Arc::new(other), config(3)).await;
        stranger.until("it is refused", |v| v.refused.is_some()).await;
        assert!(
            matches!(&stranger.refused, Some(GuestError::Refused(r)) if r.reason == Reason::Scene),
            "{:?}",
            stranger.refused
        );
    });
}

#[test]
fn pages_of_others_do_not_learn_where_the_session_is() {
    let folder = TempDir::new().unwrap();
    let served = Served::start(folder.path(), 0, &["--moq"]);
    let (_, _, body) = served.get("/viewer.json", "Origin: http://elsewhere.example\r\n");
    let json: serde_json::Value = serde_json::from_slice(&body).unwrap();
    assert!(json["moq"].is_null() && json["live"].is_string(), "{json}");
    // Two hosts of one scene have different names.
    let other = Served::start(folder.path(), 0, &["--moq"]);
    assert_ne!(At::of(&served).name, At::of(&other).name);
}

#[test]
fn tokens_and_places_are_counted_as_over_websocket() {
    let folder = TempDir::new().unwrap();
    let more = ["--moq", "--token", "interact=secret", "--max-viewers", "1"];
    let served = Served::start(folder.path(), 0, &more);
    let (at, scene) = (At::of(&served), served.scene());
    runtime().block_on(async {
        let mut plain = MoqViewer::join(&at, &scene, config(1)).await;
        plain.until("the first light", MoqViewer::has_light).await;
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(1) {
            plain.talk().await;
        }
        assert_eq!(plain.guest.role(), Some(Role::View));
        assert_eq!(served.figure("dapple_viewers"), 1.0);
        // There is no place among those who are heard: it looks on, and its light goes on.
        let token = Some("secret".to_owned());
        let mut more = MoqViewer::join(&at, &scene, GuestConfig { token: token.clone(), ..config(2) }).await;
        more.until("light that changes", |v| v.held().is_some_and(|(_, epoch, _)| epoch > 3)).await;
        assert_eq!((more.guest.role(), served.figure("dapple_viewers")), (Some(Role::View), 1.0));
        drop((plain, more));
        // The place is free once its viewer is gone.
        let start = Instant::now();
        while served.figure("dapple_viewers") > 0.0 {
            assert!(start.elapsed() < Duration::from_secs(40), "it is still there");
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
        let mut wrong =
            MoqViewer::join(&at, &scene, GuestConfig { token: Some("no".to_owned()), ..config(3) }).await;
        wrong.until("it is refused", |v| v.refused.is_some()).await;
        assert!(matches!(&wrong.refused, Some(GuestError::Refused(r)) if r.reason == Reason::Token));
        let mut right = MoqViewer::join(&at, &scene, GuestConfig { token, ..config(4) }).await;
        right.until("it may change things", |v| v.guest.role() == Some(Role::Interact)).await;
    });
}

#[test]
fn who_breaks_rules_is_not_heard_and_nobody_else_notices() {
    let folder = TempDir::new().unwrap();
    let served = Served::start(folder.path(), 0, &["--moq"]);
    let (at, scene) = (At::of(&served), served.scene());
    runtime().block_on(async {
        let mut steady = MoqViewer::join(&at, &scene, config(1)).await;
        steady.until("the first light", MoqViewer::has_light).await;
        let names = Names::new(&at.name).unwrap();
        let name = |number: usize| format!("{number:032x}");
        // Random bytes, a huge message, words without a hello, another version, nothing at all.
        let huge = vec![b' '; 8 << 20];
        let said: [&[u8]; 5] = [
            &[0xff; 100],
            &huge,
            br#"{"type":"bye"}"#,
            br#"{"type":"hello","protocol":999,"wire":1,"scene":"00"}"#,
            b"",
        ];
        let mut kept = Vec::new();
        for (number, said) in said.into_iter().enumerate() {
            let (connection, from, to) = at.connect(&name(number)).await;
            let own = to.create_broadcast(names.from_viewer(&name(number)).as_str()).unwrap();
            let tracks = ["talk", "looks"].map(|track| own.create_track(track, None).unwrap());
            let mut group = tracks[0].append_group().unwrap();
            if !said.is_empty() {
                let _ = group.write_frame(Timestamp::now(), said.to_vec());
            }
            own.announce(origin::Route::default()).unwrap();
            // In the name of others, and of the host.
            let others =
                [names.from_viewer(&name(77)), names.to_viewer(&name(77)), names.shared().to_owned()];
            let forged = others.map(|path| {
                let broadcast = to.create_broadcast(path.as_str()).unwrap();
                let state = broadcast.create_track("state", None).unwrap();
                let mut group = state.append_group().unwrap();
                let refused = r#"{"type":"refused","reason":"closing","message":"forged"}"#;
                group.write_frame(Timestamp::now(), refused).unwrap();
                let _ = broadcast.announce(origin::Route::default());
                (broadcast, state, group)
            });
            // It hears of nobody but the host and itself.
            let mut announced = from.consume().with_hidden(true).announced();
            let own_out = names.to_viewer(&name(number));
            let until = Instant::now() + Duration::from_millis(500);
            while let Ok(Some(update)) = tokio::time::timeout_at(until.into(), announced.next()).await {
                let path = update.prefix.as_str();
                assert!(path == names.shared() || path == own_out, "it hears of {path}");
            }
            kept.push((connection, from, to, own, tracks, group, forged));
        }
        // Whoever does not know the name learns nothing.
        let stranger = At { url: at.url.replace(&at.name, "dapple/other"), ..at.clone() };
        if let Ok((connection, from, _to)) = stranger.try_connect(&name(9)).await {
            let mut announced = from.consume().announced();
            let heard = tokio::time::timeout(Duration::from_secs(1), announced.next()).await;
            assert!(!matches!(heard, Ok(Some(_))), "a stranger hears of what there is");
            drop(connection);
        }
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(7) {
            steady.talk().await;
        }
        assert!(
            steady.refused.is_none() && steady.ended.is_none(),
            "{:?} {:?}",
            steady.refused,
            steady.ended
        );
        assert_eq!(served.figure("dapple_viewers"), 1.0);
        let mut late = MoqViewer::join(&at, &scene, config(2)).await;
        late.until("the light of one who joins late", MoqViewer::has_light).await;
        late.until("it may change things", |v| v.guest.role() == Some(Role::Interact)).await;
        drop(kept);
    });
}

#[test]
fn a_host_that_ends_says_so() {
    let folder = TempDir::new().unwrap();
    let served = Served::start(folder.path(), 0, &["--moq"]);
    let (at, scene) = (At::of(&served), served.scene());
    let runtime = runtime();
    let mut viewer = runtime.block_on(async {
        let mut viewer = MoqViewer::join(&at, &scene, config(1)).await;
        viewer.until("the first light", MoqViewer::has_light).await;
        viewer.until("it may change things", |v| v.guest.role() == Some(Role::Interact)).await;
        viewer
    });
    served.signal("-TERM");
    runtime.block_on(viewer.until("it hears of the end", |v| v.refused.is_some() || v.ended.is_some()));
    assert!(
        matches!(&viewer.refused, Some(GuestError::Refused(r)) if r.reason == Reason::Closing),
        "{:?} {:?}",
        viewer.refused,
        viewer.ended
    );
    assert!(served.wait().0, "it ended well");
}

#[test]
fn a_host_that_dies_is_noticed_and_its_successor_found() {
    let folder = TempDir::new().unwrap();
    let served = Served::start(folder.path(), 0, &["--moq"]);
    let (at, scene, port) = (At::of(&served), served.scene(), served.port);
    let runtime = runtime();
    let mut viewer = runtime.block_on(MoqViewer::join(&at, &scene, config(1)));
    runtime.block_on(viewer.until("the first light", MoqViewer::has_light));
    served.signal("-KILL");
    assert!(!served.wait().0);
    runtime.block_on(viewer.until("it is noticed", |v| v.ended.is_some()));
    let served = Served::start(folder.path(), port, &["--moq"]);
    let next = At::of(&served);
    assert_ne!(at.name, next.name);
    let mut viewer = runtime.block_on(MoqViewer::join(&next, &scene, config(1)));
    runtime.block_on(viewer.until("the light of the next", MoqViewer::has_light));
}

#[test]
fn what_cannot_be_is_said_clearly() {
    let folder = TempDir::new().unwrap();
    let serve = ["serve", "--builtin", "cornell", "--port", "0"];
    let with = |more: &[&'static str]| [&serve[..], more].concat();
    fail(folder.path(), &with(&["--moq-name", "x"]), &["--moq"]);
    fail(folder.path(), &with(&["--moq", "--moq-name", "a b"]), &["a b", "letters"]);
    fail(folder.path(), &with(&["--moq", "--token", "view=a"]), &["--moq", "--token view"]);
    fail(folder.path(), &with(&["--relay", "nowhere"]), &["--relay", "nowhere"]);
    fail(folder.path(), &with(&["--relay", "ftp://host/"]), &["--relay", "https://"]);
    let taken = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let message = fail(folder.path(), &[&serve[..], &["--moq", &port]].concat(), &["--moq", &port]);
    assert!(message.contains("in use"), "{message}");
    // What is not served over MoQ cannot be viewed over it.
    let served = Served::start(folder.path(), 0, &[]);
    let url = format!("http://127.0.0.1:{}/", served.port);
    fail(folder.path(), &["view", "--url", &url, "--moq", "--headless"], &["--moq", "dapple serve --moq"]);
}

/// A way for datagrams that loses, doubles, delays and overtakes them, and carries only so much: from a seed.
struct BadWay {
    port: u16,
    lost: Arc<std::sync::atomic::AtomicU32>,
    task: tokio::task::JoinHandle<()>,
}

impl BadWay {
    /// Loss 5 %, 2 % twice, 20 to 120 ms, 2 Mbit/s with a queue of 200 ms, in both directions; for one viewer.
    async fn to(target: u16, seed: u64) -> BadWay {
        use std::sync::atomic::{AtomicU32, Ordering};
        let near = Arc::new(tokio::net::UdpSocket::bind("127.0.0.1:0").await.unwrap());
        let far = Arc::new(tokio::net::UdpSocket::bind("127.0.0.1:0").await.unwrap());
        far.connect(("127.0.0.1", target)).await.unwrap();
        let port = near.local_addr().unwrap().port();
        let lost = Arc::new(AtomicU32::new(0));
        let count = lost.clone();
        let task = tokio::spawn(async move {
            let mut state = seed;
            let mut viewer = None;
            let mut free_at = [Instant::now(); 2];
            let (mut up, mut down) = (vec![0; 2048], vec![0; 2048]);
            loop {
                let (way, bytes) = tokio::select! {
                    came = near.recv_from(&mut up) => {
                        let Ok((length, from)) = came else { continue };
                        viewer = Some(from);
                        (0, up[..length].to_vec())
                    }
                    came = far.recv(&mut down) => match came {
                        Ok(length) => (1, down[..length].to_vec()),
                        Err(_) => continue,
                    }
                };
                let mut random = || {
                    state =
                        state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    (state >> 33) as u32 % 100
                };
                let now = Instant::now();
                let free = free_at[way].max(now);
                if random() < 5 || free > now + Duration::from_millis(200) {
                    count.fetch_add(1, Ordering::Relaxed);
                    continue;
                }
                free_at[way] = free + Duration::from_secs_f64(bytes.len() as f64 / 250_000.0);
                for _ in 0..1 + u32::from(random() < 2) {
                    let due = free_at[way] + Duration::from_millis(u64::from(20 + random()));
                    let (near, far, bytes, viewer) = (near.clone(), far.clone(), bytes.clone(), viewer);
                    tokio::spawn(async move {
                        tokio::time::sleep_until(due.into()).await;
                        let _ = match (way, viewer) {
                            (0, _) => far.send(&bytes).await,
                            (_, Some(viewer)) => near.send_to(&bytes, viewer).await,
                            _ => Ok(0),
                        };
                    });
                }
            }
        });
        BadWay { port, lost, task }
    }
}

impl Drop for BadWay {
    fn drop(&mut self) {
        self.task.abort();
    }
}

#[test]
fn over_a_bad_way_and_after_a_stall_the_light_is_the_same() {
    let folder = TempDir::new().unwrap();
    let served = Served::start(folder.path(), 0, &["--moq", "--threshold", "0"]);
    let (at, scene) = (At::of(&served), served.scene());
    let port = at.url.parse::<url::Url>().unwrap().port().unwrap();
    let mut oracle = Viewer::join(served.port, &scene, config(1));
    oracle.until("the first light", Viewer::has_light);
    runtime().block_on(async {
        let way = BadWay::to(port, 7).await;
        let bad = At { url: at.url.replace(&format!(":{port}/"), &format!(":{}/", way.port)), ..at.clone() };
        let mut shaky = MoqViewer::join(&bad, &scene, config(2)).await;
        let mut stalled = MoqViewer::join(&at, &scene, config(3)).await;
        for viewer in [&mut shaky, &mut stalled] {
            viewer.until("the first light", MoqViewer::has_light).await;
            viewer.until("it may change things", |v| v.guest.role() == Some(Role::Interact)).await;
        }
        assert!(shaky.guest.send(place(scene.instances[1].node, 0.3)));
        // One takes nothing, while the other goes on.
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(6) {
            oracle.run(Duration::from_millis(10));
            shaky.talk().await;
        }
        shaky.until("its event is answered", |v| !v.guest.has_pending()).await;
        assert!(oracle.guest.send(Event::Pause));
        oracle.until("the event is answered", |v| !v.guest.has_pending());
        settle(&mut oracle, &mut [&mut shaky, &mut stalled]).await;
        let lost = way.lost.load(std::sync::atomic::Ordering::Relaxed);
        assert!(lost > 10, "the way was bad: {lost} datagrams lost");
    });
}

#[test]
fn two_relays_in_a_chain_carry_the_same_bytes() {
    let folder = TempDir::new().unwrap();
    let Some(first) = Relay::start(folder.path(), None) else { return };
    let Some(second) = Relay::start(folder.path(), Some(&first.url)) else { return };
    let served = Served::start(
        folder.path(),
        0,
        &["--relay", &first.url, "--moq-name", "test/one", "--threshold", "0"],
    );
    let at = |relay: &Relay| At { url: relay.url.clone(), name: "test/one".to_owned(), certificate: None };
    runtime().block_on(async {
        converge(&served, &[at(&first), at(&second)]).await;
        // The second goes away: who was connected to it is told, and comes to the light by the first.
        let scene = served.scene();
        let mut viewer = MoqViewer::join(&at(&second), &scene, config(7)).await;
        viewer.until("light", MoqViewer::has_light).await;
        drop(second);
        viewer.until("it is noticed", |v| v.ended.is_some()).await;
        let mut viewer = MoqViewer::join(&at(&first), &scene, config(7)).await;
        viewer.until("light by the other", MoqViewer::has_light).await;
    });
}
