//! `dapple serve` and viewers of it, over real sockets.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

use common::command::{fail, succeed};
use common::live::{SMALL, Served, Viewer, socket};
use dapple_scene::{Edit, Edits, Placement, Scene};
use dapple_server::{Server, ServerConfig};
use dapple_session::{Event, GuestConfig, GuestError, Reason, Role};
use dapple_stream::{Limits, Recording};
use dapple_trace::psao::generate::GenerateParams;
use dapple_trace::psao::update::UpdateParams;
use tempfile::TempDir;
use tokio_tungstenite::tungstenite::Message;

fn place(node: u32, x: f32) -> Event {
    let placement = Placement { translation: [x, 0.4, 0.2], rotation: [0.0, 0.0, 0.0, 1.0], scale: [0.5; 3] };
    Event::Edit { change: Edit::Place { node, placement } }
}

fn config(seed: u64) -> GuestConfig {
    GuestConfig { seed, ..GuestConfig::default() }
}

/// Lets all talk until they hold the same light, and for a while nothing new comes.
fn settle(viewers: &mut [&mut Viewer]) {
    let start = Instant::now();
    let mut still_since = Instant::now();
    let mut last = Vec::new();
    while still_since.elapsed() < Duration::from_millis(700) {
        assert!(start.elapsed() < Duration::from_secs(60), "viewers hold different things: {last:?}");
        for viewer in viewers.iter_mut() {
            viewer.run(Duration::from_millis(20));
        }
        let now: Vec<_> =
            viewers.iter().map(|v| (v.held().map(|(g, e, _)| (g, e)), v.guest.version())).collect();
        if now != last || now.windows(2).any(|pair| pair[0] != pair[1]) || now[0].0.is_none() {
            still_since = Instant::now();
        }
        last = now;
    }
    for pair in viewers.windows(2) {
        assert!(pair[0].held() == pair[1].held(), "they hold the same epoch and different light");
        assert_eq!(pair[0].guest.edits(), pair[1].guest.edits());
    }
}

/// What a server in this process holds of the scene at rest, at a time.
fn oracle(scene: &Arc<Scene>, edits: &Edits, time_s: f64) -> Vec<u8> {
    let config = ServerConfig {
        generate: GenerateParams { points_per_m2: 60.0, radius_m: 0.6, seed: 1, ..GenerateParams::default() },
        update: UpdateParams { radius_m: 0.6, ..UpdateParams::default() },
        ..ServerConfig::default()
    };
    let mut server = Server::new(scene.clone(), &config, &|_| ()).unwrap();
    server.set_edits(edits.clone());
    server.step(time_s).unwrap();
    server.traced().visibility().to_vec()
}

#[test]
fn what_one_moves_everyone_sees_and_the_light_is_the_servers() {
    let folder = TempDir::new().unwrap();
    let served = Served::start(folder.path(), 0, &["--threshold", "0"]);
    let scene = served.scene();
    let mut first = Viewer::join(served.port, &scene, config(1));
    first.until("the first light", Viewer::has_light);
    first.run(Duration::from_millis(500));
    let mut late = Viewer::join(served.port, &scene, config(2));
    late.until("the light of one who joins late", Viewer::has_light);

    let node = scene.instances[1].node;
    assert!(first.guest.send(place(node, 0.3)));
    assert!(first.guest.send(Event::Pause));
    assert!(first.guest.send(Event::Seek { time_s: 1.25 }));
    first.until("the events are answered", |v| !v.guest.has_pending() && !v.guest.clock().playing);
    settle(&mut [&mut first, &mut late]);
    assert!(late.guest.edits().placed.contains_key(&node));
    assert_eq!((late.guest.clock().playing, late.guest.clock().time_us), (false, 1_250_000));
    assert_eq!((first.snapshots, late.snapshots), (1, 1));
    let truth = oracle(&scene, late.guest.edits(), 1.25);
    assert!(late.held().unwrap().2 == truth, "the light differs from that of a server without a network");

    // Removed, put back, and back to the file.
    for event in [
        Event::Edit { change: Edit::Remove { instance: 1 } },
        Event::Add {
            like: 1,
            placement: Placement { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0], scale: [1.0; 3] },
        },
        Event::Edit { change: Edit::Reset },
    ] {
        assert!(late.guest.send(event));
        late.until("the event is answered", |v| !v.guest.has_pending());
        settle(&mut [&mut first, &mut late]);
    }
    assert_eq!(first.guest.edits(), &Edits::new(&scene));
    // What is not there cannot be moved, and the viewer learns why.
    assert!(late.guest.send(place(99_999, 0.0)));
    late.until("the event is rejected", |v| !v.rejected.is_empty());
    assert!(late.rejected[0].contains("99999"), "{}", late.rejected[0]);
    assert!(served.figure("dapple_events_total") >= 6.0);
    assert_eq!(served.figure("dapple_viewers"), 2.0);
}

#[test]
fn who_stalls_or_loses_the_connection_or_the_server_comes_back() {
    let folder = TempDir::new().unwrap();
    let served = Served::start(folder.path(), 0, &[]);
    let (port, scene) = (served.port, served.scene());
    let (mut steady, mut shaky) =
        (Viewer::join(port, &scene, config(1)), Viewer::join(port, &scene, config(2)));
    steady.until("the first light", Viewer::has_light);
    shaky.until("the first light", Viewer::has_light);
    // It reads nothing, while the other goes on.
    steady.run(Duration::from_secs(2));
    // It breaks off, asks for something meanwhile, and goes on where it was.
    shaky.cut();
    assert!(shaky.guest.send(place(scene.instances[1].node, 0.1)));
    steady.run(Duration::from_millis(500));
    assert!(shaky.connect(port));
    shaky.until("its event is answered", |v| !v.guest.has_pending());
    assert_eq!(shaky.snapshots, 1, "deltas brought it up to date");
    assert_eq!(
        (served.figure("dapple_viewers_resumed_total"), served.figure("dapple_events_total")),
        (1.0, 1.0)
    );
    assert!(steady.guest.send(Event::Pause));
    settle(&mut [&mut steady, &mut shaky]);

    served.signal("-KILL");
    assert!(!served.wait().0);
    steady.until("the connection is broken", |v| !v.is_connected());
    shaky.until("the connection is broken", |v| !v.is_connected());
    assert!(steady.held().is_some(), "what was held stays");
    let _again = Served::start(folder.path(), port, &[]);
    for viewer in [&mut steady, &mut shaky] {
        viewer.until("it is connected again", |_| true);
        assert!(viewer.connect(port));
        let group = viewer.held().unwrap().0;
        viewer.until("the new server's light", |v| v.held().unwrap().0 > group);
    }
    assert!(steady.guest.send(Event::Pause));
    settle(&mut [&mut steady, &mut shaky]);
    assert_eq!(steady.guest.edits(), &Edits::new(&scene), "the new server knows nothing of the edit");
}

#[test]
fn roles_go_by_tokens() {
    let folder = TempDir::new().unwrap();
    let served = Served::start(
        folder.path(),
        0,
        &["--token", "view=look", "--token", "interact=touch-it", "--rungs", "20k"],
    );
    let scene = served.scene();
    let with = |token: &str, bits_per_s: Option<u64>| GuestConfig {
        token: Some(token.to_owned()),
        bits_per_s,
        ..GuestConfig::default()
    };
    let mut none = Viewer::join(served.port, &scene, config(1));
    none.until("it is refused", |v| v.refused.is_some());
    let Some(GuestError::Refused(refusal)) = &none.refused else { panic!("{:?}", none.refused) };
    assert_eq!(refusal.reason, Reason::Token);
    assert!(refusal.message.contains("token"), "{refusal}");
    let mut wrong = Viewer::join(served.port, &scene, with("Look", None));
    wrong.until("it is refused", |v| v.refused.is_some());

    let mut looks = Viewer::join(served.port, &scene, with("look", Some(25_000)));
    looks.until("the light", Viewer::has_light);
    assert_eq!(looks.guest.role(), Some(Role::View));
    assert_eq!(looks.guest.welcome().unwrap().bits_per_s, Some(20_000), "the stream that fits its wish");
    assert!(looks.guest.send(Event::Pause));
    looks.until("its event is rejected", |v| !v.rejected.is_empty());
    assert!(looks.guest.clock().playing && looks.rejected[0].contains("interact"), "{:?}", looks.rejected);
    let mut touches = Viewer::join(served.port, &scene, with("touch-it", None));
    assert!(touches.guest.send(Event::Pause));
    touches.until("time stands still", |v| v.guest.version() > 0 && !v.guest.clock().playing);
    looks.until("time stands still here too", |v| !v.guest.clock().playing);
    assert!(!served.text("/metrics").contains("touch"));
}

#[test]
fn hostile_connections_are_refused_and_nobody_else_notices() {
    let folder = TempDir::new().unwrap();
    let served = Served::start(folder.path(), 0, &["--max-viewers", "40"]);
    let (port, scene) = (served.port, served.scene());
    let mut quiet = Viewer::join(port, &scene, config(1));
    quiet.until("the first light", Viewer::has_light);

    // Ten thousand who only knock, some hundred of whom stay.
    let mut staying = Vec::new();
    for number in 0..10_000 {
        if let Ok(stream) = TcpStream::connect(("127.0.0.1", port))
            && number % 50 == 0
        {
            staying.push(stream);
        }
        if number % 500 == 0 {
            quiet.run(Duration::from_millis(10));
        }
    }
    // Some say a request a byte at a time, or something else altogether.
    for (index, stream) in staying.iter_mut().enumerate() {
        let text: &[u8] = match index % 3 {
            0 => b"GET /live HTT",
            1 => b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
            _ => b"",
        };
        let _ = stream.write_all(text);
    }
    let epoch = quiet.guest.newest().unwrap().stamp_us;
    quiet.until("light goes on", |v| v.guest.newest().is_some_and(|head| head.stamp_us > epoch + 500_000));

    // Over a WebSocket: what is said first, and whether the answer names the reason.
    let huge = format!(r#"{{"type":"hello","pad":"{}"}}"#, "x".repeat(100_000));
    let first_words = [
        (Message::text("hello"), "malformed"),
        (Message::text(r#"{"type":"bye"}"#), "malformed"),
        (Message::text(r#"{"type":"hello","protocol":9,"wire":4,"scene":""}"#), "version"),
        (Message::text(r#"{"type":"hello","protocol":1,"wire":4,"scene":"00"}"#), "scene"),
        (Message::binary(vec![0u8; 1000]), "malformed"),
        (Message::text(huge), "malformed"),
    ];
    drop(staying);
    for (message, reason) in first_words {
        let shown: String = message.to_string().chars().take(60).collect();
        let mut socket = (0..200)
            .find_map(|_| {
                std::thread::sleep(Duration::from_millis(50));
                socket(port)
            })
            .expect("there is room again");
        // Too long a message may be cut off while it is sent.
        let _ = socket.send(message);
        let start = Instant::now();
        let answer = loop {
            match socket.read() {
                Ok(Message::Text(text)) => break Some(text.as_str().to_owned()),
                Ok(_) => {}
                Err(tokio_tungstenite::tungstenite::Error::Io(error))
                    if error.kind() == std::io::ErrorKind::WouldBlock =>
                {
                    assert!(start.elapsed() < Duration::from_secs(30), "{shown}: no answer");
                }
                Err(_) => break None,
            }
        };
        match answer {
            Some(answer) => assert!(
                answer.contains("refused") && answer.contains(&format!("\"{reason}\"")),
                "{shown}: {answer}"
            ),
            // What was still being sent can take the answer along.
            None => assert!(shown.contains("pad"), "{shown}: closed without a reason"),
        }
    }
    // Who says nothing is let go.
    let mut silent = socket(port).unwrap();
    let start = Instant::now();
    loop {
        match silent.read() {
            Ok(Message::Text(text)) => {
                assert!(text.as_str().contains("silent"), "{text}");
                break;
            }
            Ok(_) => {}
            Err(_) => assert!(start.elapsed() < Duration::from_secs(30), "a silent one stays"),
        }
    }
    // And who knocks with half a request is let go too.
    let mut slow = TcpStream::connect(("127.0.0.1", port)).unwrap();
    slow.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    slow.write_all(b"GET /health HTTP/1.1\r\nX-Slow: ").unwrap();
    let mut rest = Vec::new();
    assert!(slow.read_to_end(&mut rest).is_ok(), "a slow one stays");

    quiet.until("the quiet one still has its connection", Viewer::is_connected);
    assert_eq!((quiet.snapshots, quiet.rejected.len()), (1, 0));
    assert!(served.figure("dapple_viewers_refused_total") >= 2.0);
    assert!(served.text("/health").contains("\"serving\""));
}

#[test]
fn it_ends_in_order_and_leaves_a_recording() {
    let folder = TempDir::new().unwrap();
    let served = Served::start(folder.path(), 0, &["--record", "live.dapple", "--log-format", "json"]);
    let scene = served.scene();
    let mut viewer = Viewer::join(served.port, &scene, config(1));
    viewer.until("the light", Viewer::has_light);
    viewer.run(Duration::from_secs(2));
    served.signal("-TERM");
    viewer.until("it hears of the end", |v| v.refused.is_some());
    let Some(GuestError::Refused(refusal)) = &viewer.refused else { panic!("{:?}", viewer.refused) };
    assert_eq!(refusal.reason, Reason::Closing);
    assert!(refusal.reason.may_retry());
    let (ended_well, _) = served.wait();
    assert!(ended_well);
    let bytes = std::fs::read(folder.path().join("live.dapple")).unwrap();
    let recording = Recording::parse(bytes, &Limits::default()).unwrap();
    let header = recording.header().unwrap();
    assert_eq!(header.scene_hash, scene.hash().0);
    assert!((1_000_000..60_000_000).contains(&header.duration_us), "{}", header.duration_us);
    let out = succeed(folder.path(), &["inspect", "live.dapple", "--builtin", "cornell", "--detail", "0.2"]);
    assert!(out.contains("whole"), "{out}");
    assert_eq!(common::command::partial_files(folder.path()), Vec::<std::path::PathBuf>::new());
}

#[test]
fn it_serves_what_viewers_need_to_begin() {
    let folder = TempDir::new().unwrap();
    let served = Served::start(folder.path(), 0, &["--paused"]);
    let json: serde_json::Value = serde_json::from_str(&served.text("/viewer.json")).unwrap();
    let path = format!("/{}", json["scene"].as_str().unwrap());
    let (status, head, plain) = served.get(&path, "");
    assert_eq!(status, 200);
    assert!(head.contains("immutable") && head.contains("model/gltf-binary"), "{head}");
    let (_, head, packed) = served.get(&path, "Accept-Encoding: br, gzip\r\n");
    assert!(head.contains("content-encoding: gzip") && packed.len() < plain.len(), "{head}");
    assert_eq!(served.get("/scene/00.glb", "").0, 404);
    assert_eq!(served.get("/../Cargo.toml", "").0, 404);
    assert!(served.text("/health").contains("cornell"));
    assert_eq!(served.figure("dapple_viewers"), 0.0);
    // Without a WebSocket there is no session.
    assert!((400..500).contains(&served.get("/live", "").0));
}

#[test]
fn spares_can_be_added() {
    let folder = TempDir::new().unwrap();
    let first = Served::start(folder.path(), 0, &[]);
    let scene = first.scene();
    let name = scene.nodes[scene.instances[1].node as usize].name.clone();
    drop(first);
    let spare = format!("{name}=2");
    let served = Served::start(folder.path(), 0, &["--spare", &spare]);
    let scene = served.scene();
    let mut viewer = Viewer::join(served.port, &scene, config(1));
    let placement =
        Placement { translation: [0.1, 1.0, 0.1], rotation: [0.0, 0.0, 0.0, 1.0], scale: [0.3; 3] };
    for _ in 0..3 {
        assert!(viewer.guest.send(Event::Add { like: 1, placement }));
    }
    viewer.until("the third is one too many", |v| !v.guest.has_pending() && v.rejected.len() == 1);
    viewer.until("both spares are there", |v| v.guest.edits().removed.is_empty());
    assert!(viewer.rejected[0].contains("--spare"), "{}", viewer.rejected[0]);
}

/// Workers light parts of the scene; the host puts them together.
#[test]
fn workers_light_what_one_server_would() {
    let folder = TempDir::new().unwrap();
    let served = Served::start(
        folder.path(),
        0,
        &["--workers", "2", "--worker-token", "w", "--threshold", "0", "--load", "1"],
    );
    let (port, scene) = (served.port, served.scene());
    let url = format!("http://127.0.0.1:{port}/");
    let worker = |part: &str, token: &str| {
        let arguments = ["worker", "--connect", &url, "--shard", part, "--token", token];
        let mut command = common::command::dapple(folder.path(), &arguments);
        Killed(command.stdout(std::process::Stdio::null()).spawn().unwrap())
    };
    // One that may not, and one of a part that does not exist.
    fail(folder.path(), &["worker", "--connect", &url, "--shard", "1/2", "--token", "x"], &["token"]);
    fail(folder.path(), &["worker", "--connect", &url, "--shard", "1/3", "--token", "w"], &["1/2"]);
    let mut viewer = Viewer::join(port, &scene, config(1));
    viewer.run(Duration::from_millis(300));
    assert!(!viewer.has_light() && served.text("/health").contains("waiting for workers"));
    let _first = worker("1/2", "w");
    viewer.until("the first part's light", Viewer::has_light);
    let of_first = viewer.held().unwrap().2.len();
    let second = worker("2/2", "w");
    viewer.until("the second part's light", |v| v.held().unwrap().2.len() > of_first);
    assert!(viewer.guest.send(place(scene.instances[1].node, 0.3)));
    assert!(viewer.guest.send(Event::Seek { time_s: 0.75 }));
    assert!(viewer.guest.send(Event::Pause));
    viewer.until("time stands still", |v| !v.guest.has_pending() && !v.guest.clock().playing);
    // One dies while things change, and another takes its place.
    drop(second);
    assert!(viewer.guest.send(Event::Seek { time_s: 1.25 }));
    viewer.until("the clock is set", |v| !v.guest.has_pending());
    assert!(viewer.held().unwrap().2.len() > of_first, "the dead worker's light stays as it was");
    let _second = worker("2/2", "w");
    let mut late = Viewer::join(port, &scene, config(2));
    late.until("the light", Viewer::has_light);
    let truth = oracle(&scene, viewer.guest.edits(), 1.25);
    viewer.until("the light is that of one server", |v| v.held().unwrap().2 == truth);
    settle(&mut [&mut viewer, &mut late]);
}

/// A program that does not outlive its test.
struct Killed(std::process::Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn what_cannot_be_served_is_said_before_anything_takes_time() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let with =
        |more: &[&str]| [&SMALL[..], more].concat().iter().map(|s| (*s).to_owned()).collect::<Vec<_>>();
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = listener.local_addr().unwrap().port().to_string();
    std::fs::write(at.join("broken.pem"), "no certificate").unwrap();
    std::fs::create_dir(at.join("folder.dapple")).unwrap();
    for (more, names) in [
        (&["--port", &taken][..], &["in use", "--port"][..]),
        (&["--load", "0"], &["--load"]),
        (&["--max-viewers", "0"], &["--max-viewers"]),
        (&["--spare", "nothing=1"], &["nothing", "no such object"]),
        (&["--record", "x.txt"], &[".dapple"]),
        (&["--record", "folder.dapple"], &["folder"]),
        (&["--page", "."], &["there is no page"]),
        (&["--tls-cert", "broken.pem", "--tls-key", "broken.pem"], &["--tls-cert", "PEM"]),
        (&["--points", "0"], &["--points"]),
        (&["--workers", "0"], &["--workers"]),
        (&["--workers", "2", "--adaptive", "1"], &["--adaptive"]),
    ] {
        let arguments = with(more);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        fail(at, &arguments, names);
    }
    fail(at, &["serve", "absent.glb"], &["absent.glb"]);
    fail(at, &["view", "--url", "http://127.0.0.1:1/", "--headless"], &["127.0.0.1:1"]);
}

/// Viewers that come, go, break off, stall and move things. `DAPPLE_SOAK_SECONDS` sets for how long (default 60).
#[test]
fn a_soak_loses_nothing_and_memory_stays_flat() {
    let folder = TempDir::new().unwrap();
    let seconds = std::env::var("DAPPLE_SOAK_SECONDS").unwrap_or_else(|_| "60".to_owned());
    let out = succeed(
        folder.path(),
        &["bench", "soak", "--seconds", &seconds, "--detail", "0.05", "--points", "40", "--viewers", "16"],
    );
    assert!(out.contains("no event was lost"), "{out}");
    println!("{out}");
}

#[test]
fn with_a_certificate_it_speaks_tls_alone() {
    use tokio_rustls::rustls::pki_types::ServerName;
    use tokio_rustls::rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned, crypto};

    let folder = TempDir::new().unwrap();
    let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    std::fs::write(folder.path().join("cert.pem"), made.cert.pem()).unwrap();
    std::fs::write(folder.path().join("key.pem"), made.signing_key.serialize_pem()).unwrap();
    let served = Served::start(folder.path(), 0, &["--tls-cert", "cert.pem", "--tls-key", "key.pem"]);
    let mut roots = RootCertStore::empty();
    roots.add(made.cert.der().clone()).unwrap();
    let config = ClientConfig::builder_with_provider(Arc::new(crypto::ring::default_provider()))
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    let name = ServerName::try_from("localhost").unwrap();
    let connection = ClientConnection::new(Arc::new(config), name).unwrap();
    let socket = TcpStream::connect(("127.0.0.1", served.port)).unwrap();
    let mut tls = StreamOwned::new(connection, socket);
    tls.write_all(b"GET /health HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").unwrap();
    let mut answer = Vec::new();
    // A server need not say that TLS ends where HTTP has.
    let _ = tls.read_to_end(&mut answer);
    let answer = String::from_utf8_lossy(&answer);
    assert!(answer.starts_with("HTTP/1.1 200") && answer.contains("\"status\""), "{answer}");
    // Who speaks without gets nothing that looks like an answer.
    let mut plain = TcpStream::connect(("127.0.0.1", served.port)).unwrap();
    plain.write_all(b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
    let mut nothing = Vec::new();
    let _ = plain.read_to_end(&mut nothing);
    assert!(!String::from_utf8_lossy(&nothing).contains("HTTP"));
    // Certificate and key of different pairs.
    let other = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    std::fs::write(folder.path().join("other.pem"), other.signing_key.serialize_pem()).unwrap();
    let arguments = [&SMALL[..], &["--tls-cert", "cert.pem", "--tls-key", "other.pem"]].concat();
    fail(folder.path(), &arguments, &["do not belong together"]);
}

#[test]
fn it_can_be_ended_while_it_makes_its_first_light() {
    let folder = TempDir::new().unwrap();
    // Enough points for a while.
    let arguments = "serve --builtin cornell --points 4000 --port 0 --threads 1 --record x.dapple";
    let served = Served::run(folder.path(), &arguments.split(' ').collect::<Vec<_>>());
    let start = Instant::now();
    while !served.text("/health").contains("starting") {
        assert!(start.elapsed() < Duration::from_secs(20), "{}", served.text("/health"));
    }
    let mut viewer = Viewer::join(served.port, &served.scene(), config(1));
    viewer.until("it hears how far the light is", |v| v.guest.status().started > 0);
    assert!(!viewer.has_light() && viewer.guest.status().started < 1000);
    served.signal("-INT");
    viewer.until("it hears of the end", |v| v.refused.is_some());
    assert!(served.wait().0);
    assert_eq!(common::command::files(folder.path()), Vec::<std::path::PathBuf>::new());
}
