//! Viewers over MoQ, for tests.

use std::sync::Arc;
use std::time::{Duration, Instant};

use dapple_moq::moq_net::origin;
use dapple_moq::{LinkError, Message, Names, ViewerIn, ViewerOut, Wish};
use dapple_scene::{Edit, Placement, Scene};
use dapple_session::{Event, Guest, GuestConfig, GuestError, Held, News};
use dapple_stream::{Applied, Limits, Parts, Subscriber};
use moq_tokio::Connection;
use tokio::runtime::Runtime;

use super::live::Served;

pub(crate) fn runtime() -> Runtime {
    tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap()
}

pub(crate) fn config(seed: u64) -> GuestConfig {
    GuestConfig { seed, ..GuestConfig::default() }
}

pub(crate) fn place(node: u32, x: f32) -> Event {
    let placement = Placement { translation: [x, 0.4, 0.2], rotation: [0.0, 0.0, 0.0, 1.0], scale: [0.5; 3] };
    Event::Edit { change: Edit::Place { node, placement } }
}

/// Where a session is.
#[derive(Clone)]
pub(crate) struct At {
    pub(crate) url: String,
    pub(crate) name: String,
    pub(crate) certificate: Option<String>,
}

impl At {
    /// As the page is told.
    pub(crate) fn of(served: &Served) -> At {
        let json: serde_json::Value = serde_json::from_str(&served.text("/viewer.json")).unwrap();
        let text = |field: &str| json["moq"][field].as_str().map(str::to_owned);
        At { url: text("url").unwrap(), name: text("name").unwrap(), certificate: text("certificate") }
    }

    pub(crate) async fn connect(&self, viewer: &str) -> (Connection, origin::Producer, origin::Producer) {
        self.try_connect(viewer).await.unwrap()
    }

    pub(crate) async fn try_connect(
        &self,
        viewer: &str,
    ) -> Result<(Connection, origin::Producer, origin::Producer), String> {
        let mut config = moq_tokio::connect::Config::default();
        config.tls.fingerprint = self.certificate.clone().into_iter().collect();
        let (from, to) = (moq_tokio::origin::spawn(), moq_tokio::origin::spawn());
        let client = config.init(Default::default()).unwrap().with_reconnect(false);
        let client = client.with_publisher(&to).with_subscriber(from.clone());
        let url: url::Url = self.url.replace("{viewer}", viewer).parse().unwrap();
        let connecting = client.connect(url).established();
        let connected = tokio::time::timeout(Duration::from_secs(10), connecting).await;
        let connection = connected.map_err(|_| "no answer")?.map_err(|error| error.to_string())?;
        Ok((connection, from, to))
    }
}

/// A viewer over MoQ that decodes everything.
pub(crate) struct MoqViewer {
    pub(crate) guest: Guest,
    pub(crate) subscriber: Subscriber,
    /// Of one that takes light in parts.
    pub(crate) parts: Parts,
    pub(crate) out: ViewerOut,
    pub(crate) inbound: ViewerIn,
    _connection: (Connection, origin::Producer, origin::Producer),
    began: Instant,
    pub(crate) snapshots: u32,
    /// Bytes of light that came.
    pub(crate) bytes: u64,
    pub(crate) refused: Option<GuestError>,
    pub(crate) ended: Option<String>,
}

impl MoqViewer {
    pub(crate) async fn join(at: &At, scene: &Arc<Scene>, config: GuestConfig) -> MoqViewer {
        MoqViewer::join_as(at, scene, config, false).await
    }

    /// One that takes the light in parts if `in_parts`, and it comes in some.
    pub(crate) async fn join_as(
        at: &At,
        scene: &Arc<Scene>,
        config: GuestConfig,
        in_parts: bool,
    ) -> MoqViewer {
        let mut secret = [0; 16];
        getrandom::fill(&mut secret).unwrap();
        let viewer = dapple_session::host::hex(&secret);
        let connection = at.connect(&viewer).await;
        let mut guest = Guest::new(scene.clone(), GuestConfig { in_parts, ..config });
        let hello = guest.hello();
        let wish = Wish { scene: hello.scene, bits_per_s: hello.bits_per_s, viewer, parts: in_parts };
        let names = Names::new(&at.name).unwrap();
        let from = connection.1.consume();
        let joining = dapple_moq::join(&from, &connection.2, &names, &wish);
        let (out, inbound) = tokio::time::timeout(Duration::from_secs(20), joining).await.unwrap().unwrap();
        guest.connected(0);
        let subscriber = Subscriber::new(Some(scene.hash().0), Limits::default());
        MoqViewer {
            guest,
            subscriber,
            parts: Parts::new(Some(scene.hash().0), Limits::default()),
            out,
            inbound,
            _connection: connection,
            began: Instant::now(),
            snapshots: 0,
            bytes: 0,
            refused: None,
            ended: None,
        }
    }

    pub(crate) fn now_us(&self) -> u64 {
        self.began.elapsed().as_micros() as u64
    }

    pub(crate) async fn talk(&mut self) {
        while let Some(text) = self.guest.next(self.now_us()) {
            if let Err(error) = self.out.send(&text) {
                self.ended = Some(error.to_string());
            }
        }
        let waiting = tokio::time::timeout(Duration::from_millis(10), self.inbound.receive());
        let news = match waiting.await {
            Err(_) => return,
            Ok(Ok(Some(Message::Text(text)))) => self.guest.receive_text(&text),
            Ok(Ok(Some(Message::Bytes(bytes)))) => self.guest.receive_bytes(&bytes, self.now_us()),
            Ok(Ok(None)) => {
                self.ended.get_or_insert("in order".to_owned());
                return tokio::time::sleep(Duration::from_millis(10)).await;
            }
            Ok(Err(LinkError::Ended(reason) | LinkError::Refused(reason))) => {
                self.ended.get_or_insert(reason);
                return;
            }
        };
        match news {
            Ok(News::Light { part: Some(part), frame }) if !frame.is_empty() => {
                self.bytes += frame.len() as u64;
                let applied = self.parts.receive(part.into(), &frame);
                self.guest.applied(None, applied.is_ok());
            }
            Ok(News::Light { part: None, frame }) if !frame.is_empty() => {
                self.bytes += frame.len() as u64;
                let applied = self.subscriber.receive(&frame);
                self.snapshots += u32::from(matches!(applied, Ok(Applied::NewLayout)));
                let held = self.subscriber.group().zip(self.subscriber.epoch());
                let held = held.map(|(group, epoch)| Held { group, epoch });
                self.guest.applied(held, applied.is_ok());
            }
            Ok(News::Welcome(false)) => {
                self.subscriber.outdate();
                self.parts.outdate();
            }
            Ok(_) => {}
            Err(error) => self.refused = Some(error),
        }
    }

    pub(crate) async fn until(&mut self, what: &str, mut holds: impl FnMut(&MoqViewer) -> bool) {
        let start = Instant::now();
        while !holds(self) {
            assert!(
                start.elapsed() < Duration::from_secs(60),
                "waited in vain until {what}: {:?}",
                self.ended
            );
            self.talk().await;
        }
    }

    pub(crate) fn has_light(&self) -> bool {
        self.subscriber.store().is_some()
    }

    pub(crate) fn held(&self) -> Option<(u64, u64, &[u8])> {
        let subscriber = &self.subscriber;
        Some((subscriber.group()?, subscriber.epoch()?, subscriber.store()?.visibility()))
    }
}
