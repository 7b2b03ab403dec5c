//! A served scene and viewers of it, for tests.

use std::io::{BufRead, BufReader, Read};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use dapple_scene::{NoFiles, Scene};
use dapple_session::{Guest, GuestConfig, GuestError, Held, News};
use dapple_stream::{Applied, Limits, Subscriber};
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;
use tokio_tungstenite::tungstenite::{Error, Message, WebSocket, client};

use super::command::dapple;
use super::http;

/// A scene that is lit within a second.
pub(crate) const SMALL: [&str; 9] =
    ["serve", "--builtin", "cornell", "--detail", "0.2", "--points", "60", "--hz", "20"];

/// A running `dapple serve`.
pub(crate) struct Served {
    pub(crate) child: Child,
    out: BufReader<ChildStdout>,
    pub(crate) port: u16,
}

impl Served {
    /// Starts one on any port, or on one that is given.
    pub(crate) fn start(folder: &Path, port: u16, more: &[&str]) -> Served {
        let port = port.to_string();
        Served::run(folder, &[&SMALL[..], &["--port", &port], more].concat())
    }

    /// Starts what these arguments say.
    pub(crate) fn run(folder: &Path, arguments: &[&str]) -> Served {
        let mut command = dapple(folder, arguments);
        let mut child = command.env_remove("DAPPLE_TOKENS").stdout(Stdio::piped()).spawn().unwrap();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let port = loop {
            let mut line = String::new();
            assert!(out.read_line(&mut line).unwrap() > 0, "it ended before it said its address");
            if let Some(at) = line.find("://127.0.0.1:").filter(|_| line.contains("health")) {
                let digits = line[at + 13..].chars().take_while(char::is_ascii_digit).collect::<String>();
                break digits.parse().unwrap();
            }
        };
        Served { child, out, port }
    }

    /// Status, headers in small letters, and body of a GET.
    pub(crate) fn get(&self, path: &str, headers: &str) -> (u16, String, Vec<u8>) {
        http::get(self.port, path, headers)
    }

    pub(crate) fn text(&self, path: &str) -> String {
        String::from_utf8(self.get(path, "").2).unwrap()
    }

    /// The scene as viewers load it.
    pub(crate) fn scene(&self) -> Arc<Scene> {
        let json: serde_json::Value = serde_json::from_str(&self.text("/viewer.json")).unwrap();
        let bytes = self.get(&format!("/{}", json["scene"].as_str().unwrap()), "").2;
        let mut scene = dapple_scene::load("scene.glb", &bytes, &NoFiles).unwrap();
        let number = |value: &serde_json::Value| value.as_u64().unwrap() as u32;
        let spares: Vec<dapple_scene::Spare> = json["spares"]
            .as_array()
            .into_iter()
            .flatten()
            .map(|spare| dapple_scene::Spare {
                instance: number(&spare["instance"]),
                count: number(&spare["count"]),
            })
            .collect();
        scene.add_spares(&spares).unwrap();
        Arc::new(scene)
    }

    /// A figure of its metrics.
    pub(crate) fn figure(&self, name: &str) -> f64 {
        let text = self.text("/metrics");
        let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        line.unwrap_or_else(|| panic!("there is no {name} in\n{text}")).parse().unwrap()
    }

    pub(crate) fn signal(&self, name: &str) {
        let kill = Command::new("kill").args([name, &self.child.id().to_string()]).status();
        assert!(kill.unwrap().success());
    }

    /// What it still says, and whether it ended well.
    pub(crate) fn wait(mut self) -> (bool, String) {
        let mut rest = String::new();
        self.out.read_to_string(&mut rest).unwrap();
        (self.child.wait().unwrap().success(), rest)
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub(crate) type Socket = WebSocket<TcpStream>;

/// A WebSocket to the live session.
pub(crate) fn socket(port: u16) -> Option<Socket> {
    let stream = TcpStream::connect(("127.0.0.1", port)).ok()?;
    let config = WebSocketConfig::default().max_message_size(Some(64 << 20)).max_frame_size(Some(64 << 20));
    let (mut socket, _) =
        client::client_with_config(format!("ws://127.0.0.1:{port}/live"), stream, Some(config)).ok()?;
    socket.get_mut().set_read_timeout(Some(Duration::from_millis(5))).unwrap();
    Some(socket)
}

/// A viewer that decodes everything.
pub(crate) struct Viewer {
    pub(crate) guest: Guest,
    pub(crate) subscriber: Subscriber,
    socket: Option<Socket>,
    began: Instant,
    pub(crate) snapshots: u32,
    pub(crate) rejected: Vec<String>,
    pub(crate) refused: Option<GuestError>,
}

impl Viewer {
    pub(crate) fn join(port: u16, scene: &Arc<Scene>, config: GuestConfig) -> Viewer {
        let most = scene.instances.len() as u32;
        let mut viewer = Viewer {
            guest: Guest::new(scene.clone(), config),
            subscriber: Subscriber::new(
                Some(scene.hash().0),
                Limits { max_sets: most.max(65_536), ..Limits::default() },
            ),
            socket: None,
            began: Instant::now(),
            snapshots: 0,
            rejected: Vec::new(),
            refused: None,
        };
        assert!(viewer.connect(port), "nobody listens on port {port}");
        viewer
    }

    pub(crate) fn now_us(&self) -> u64 {
        self.began.elapsed().as_micros() as u64
    }

    pub(crate) fn connect(&mut self, port: u16) -> bool {
        self.socket = socket(port);
        if self.socket.is_some() {
            self.guest.connected(self.now_us());
        }
        self.socket.is_some()
    }

    /// The connection breaks without a word.
    pub(crate) fn cut(&mut self) {
        self.socket = None;
        self.guest.disconnected();
    }

    pub(crate) fn is_connected(&self) -> bool {
        self.socket.is_some()
    }

    /// Talks until something holds; panics if that takes too long.
    pub(crate) fn until(&mut self, what: &str, mut holds: impl FnMut(&Viewer) -> bool) {
        let start = Instant::now();
        while !holds(self) {
            assert!(start.elapsed() < Duration::from_secs(60), "waited in vain until {what}");
            self.talk();
        }
    }

    /// Talks for a while.
    pub(crate) fn run(&mut self, time: Duration) {
        let start = Instant::now();
        while start.elapsed() < time {
            self.talk();
        }
    }

    fn talk(&mut self) {
        let now_us = self.now_us();
        while let Some(text) = self.guest.next(now_us) {
            self.send(Message::text(text));
        }
        let Some(socket) = &mut self.socket else {
            std::thread::sleep(Duration::from_millis(5));
            return;
        };
        let news = match socket.read() {
            Ok(Message::Text(text)) => self.guest.receive_text(text.as_str()),
            Ok(Message::Binary(bytes)) => self.guest.receive_bytes(&bytes, self.now_us()),
            Ok(_) => return,
            Err(Error::Io(error))
                if matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) =>
            {
                return;
            }
            Err(_) => {
                self.cut();
                return;
            }
        };
        match news {
            Ok(News::Light { frame, .. }) if !frame.is_empty() => self.apply(&frame),
            Ok(News::Welcome(false)) => self.subscriber.outdate(),
            Ok(News::Rejected(reason)) => self.rejected.push(reason),
            Ok(_) => {}
            Err(error) => self.refused = Some(error),
        }
    }

    fn apply(&mut self, frame: &[u8]) {
        let applied = self.subscriber.receive(frame).expect("over TCP every frame fits");
        self.snapshots += u32::from(applied == Applied::NewLayout);
        let held = self.subscriber.group().zip(self.subscriber.epoch());
        self.guest.applied(held.map(|(group, epoch)| Held { group, epoch }), true);
    }

    pub(crate) fn send(&mut self, message: Message) {
        if let Some(socket) = &mut self.socket
            && socket.send(message).is_err()
        {
            self.cut();
        }
    }

    pub(crate) fn has_light(&self) -> bool {
        self.subscriber.store().is_some()
    }

    /// What it holds, if it holds anything.
    pub(crate) fn held(&self) -> Option<(u64, u64, &[u8])> {
        let subscriber = &self.subscriber;
        Some((subscriber.group()?, subscriber.epoch()?, subscriber.store()?.visibility()))
    }
}
