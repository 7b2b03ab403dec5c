//! A viewer's end over a network: connects, talks, and connects again.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use dapple_session::{Guest, GuestError, News};
use tokio::sync::watch;

use crate::page::MoqJson;
#[cfg(feature = "moq")]
use crate::transport::moq;
use crate::transport::{Inbound, LinkError, Message, Outbound, ws};

/// What waits to be said is looked for this often, besides after each message.
const LOOK_FOR_WORDS: Duration = Duration::from_millis(50);

/// Nothing from a host for so long means that the connection is dead: it says at least four times a second that the light is right.
const SILENCE: Duration = Duration::from_secs(10);

/// Largest message that is taken: the state of a scene in which everything was changed.
const MAX_MESSAGE_BYTES: usize = dapple_session::MAX_FROM_HOST_BYTES;

/// How a connection is.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum LinkState {
    Connecting,
    Connected,
    /// It broke, why, and seconds after which it is tried again.
    Waiting(String, f64),
    /// It is of no use to try again, and why.
    Ended(String),
}

/// Where a session is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Address {
    /// At `ws://…`.
    Ws(String),
    /// Over MoQ, directly or through a relay.
    Moq(MoqPlace),
}

/// Where a session is over MoQ.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct MoqPlace {
    /// As it was told.
    pub(crate) json: MoqJson,
    /// The folder of the viewer.json that told it, which is asked again after a connection has broken: a server that starts again has another name.
    pub(crate) folder: String,
    /// The relay that is used instead of what it says.
    pub(crate) relay: Option<String>,
    /// Whether the viewer takes the light in parts where it comes in some.
    pub(crate) in_parts: bool,
}

impl Address {
    /// The session that the viewer.json in a folder names; over MoQ if that is wanted: at a relay's address, or (an empty one) where the folder says.
    pub(crate) fn choose(
        folder: &str,
        live: Option<String>,
        moq: Option<MoqJson>,
        relay: Option<&str>,
    ) -> Result<Option<Address>> {
        let Some(relay) = relay else { return Ok(live.map(Address::Ws)) };
        if cfg!(not(feature = "moq")) {
            bail!("--moq: this program was built without MoQ: cargo build --release --features moq");
        }
        let json = moq.context("--moq: what is served there is not served over MoQ (dapple serve --moq)")?;
        let relay = (!relay.is_empty()).then(|| relay.to_owned());
        Ok(Some(Address::Moq(
            MoqPlace { json, folder: folder.to_owned(), relay, in_parts: false }.by_relay(),
        )))
    }

    /// The same for a viewer that can take the light in parts ([`News::Light`]), and says what it sees.
    pub(crate) fn in_parts(self) -> Address {
        match self {
            Address::Moq(place) => Address::Moq(MoqPlace { in_parts: true, ..place }),
            Address::Ws(_) => self,
        }
    }

    /// The same after the connection has broken.
    #[cfg(feature = "moq")]
    async fn again(&mut self) -> Result<()> {
        let Address::Moq(place) = self else { return Ok(()) };
        let folder = place.folder.clone();
        let json = tokio::task::spawn_blocking(move || crate::view::fetch_moq(&folder)).await??;
        place.json = json.context("the server serves no MoQ any more")?;
        *place = place.clone().by_relay();
        Ok(())
    }

    #[cfg(not(feature = "moq"))]
    async fn again(&mut self) -> Result<()> {
        Ok(())
    }
}

impl MoqPlace {
    fn by_relay(mut self) -> MoqPlace {
        if let Some(relay) = &self.relay {
            // It has a certificate of its own.
            (self.json.url, self.json.certificate) = (relay.clone(), None);
        }
        self
    }
}

/// A guest that a task and others share.
pub(crate) struct SharedGuest {
    guest: Mutex<Guest>,
    began: std::time::Instant,
}

impl SharedGuest {
    pub(crate) fn new(guest: Guest) -> SharedGuest {
        SharedGuest { guest: Mutex::new(guest), began: std::time::Instant::now() }
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, Guest> {
        self.guest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Microseconds of this viewer's clock.
    pub(crate) fn now_us(&self) -> u64 {
        self.began.elapsed().as_micros() as u64
    }
}

/// Keeps up a session until told to stop or refused for good. `on_news` is called with the guest as it brings news.
pub(crate) async fn keep(
    address: &Address,
    shared: &SharedGuest,
    state: &watch::Sender<LinkState>,
    mut stop: watch::Receiver<bool>,
    mut on_news: impl FnMut(&mut Guest, News) + Send,
) {
    let mut address = address.clone();
    let mut is_first = true;
    loop {
        state.send_replace(LinkState::Connecting);
        let known = if is_first {
            Ok(())
        } else {
            tokio::select! {
                known = address.again() => known,
                () = told(&mut stop) => return,
            }
        };
        is_first = false;
        let ended = match known {
            Ok(()) => converse(&address, shared, state, &mut stop, &mut on_news).await,
            Err(error) => Ended::Broken(format!("{error:#}")),
        };
        let wait_us = shared.lock().disconnected();
        let reason = match ended {
            Ended::Broken(reason) => reason,
            Ended::Refused(reason) => {
                state.send_replace(LinkState::Ended(reason));
                return;
            }
            Ended::Stopped => return,
        };
        let wait = Duration::from_micros(wait_us);
        tracing::info!("{reason}; trying again in {:.1} s", wait.as_secs_f64());
        state.send_replace(LinkState::Waiting(reason, wait.as_secs_f64()));
        tokio::select! {
            () = tokio::time::sleep(wait) => {}
            () = told(&mut stop) => return,
        }
    }
}

/// Waits until told to stop, or until nobody can say so any more.
async fn told(stop: &mut watch::Receiver<bool>) {
    let _ = stop.wait_for(|stop| *stop).await;
}

/// How a conversation ended.
enum Ended {
    Broken(String),
    Refused(String),
    /// This end was told to stop, and has said so.
    Stopped,
}

async fn converse(
    address: &Address,
    shared: &SharedGuest,
    state: &watch::Sender<LinkState>,
    stop: &mut watch::Receiver<bool>,
    on_news: &mut (impl FnMut(&mut Guest, News) + Send),
) -> Ended {
    match address {
        Address::Ws(address) => {
            let connecting = ws::connect(address, MAX_MESSAGE_BYTES);
            converse_over(connecting, shared, state, stop, on_news).await
        }
        #[cfg(feature = "moq")]
        Address::Moq(place) => {
            let hello = shared.lock().hello();
            let connecting = moq::connect(&place.json, &hello, place.in_parts);
            converse_over(connecting, shared, state, stop, on_news).await
        }
        #[cfg(not(feature = "moq"))]
        Address::Moq(_) => Ended::Refused("this program was built without MoQ".to_owned()),
    }
}

async fn converse_over<O: Outbound, I: Inbound>(
    connecting: impl Future<Output = Result<(O, I), LinkError>> + Send,
    shared: &SharedGuest,
    state: &watch::Sender<LinkState>,
    stop: &mut watch::Receiver<bool>,
    on_news: &mut (impl FnMut(&mut Guest, News) + Send),
) -> Ended {
    let connected = tokio::select! {
        connected = connecting => connected,
        () = told(stop) => return Ended::Stopped,
    };
    let (mut out, mut inbound) = match connected {
        Ok(halves) => halves,
        Err(LinkError::Ended(reason)) => return Ended::Broken(reason),
        Err(LinkError::Refused(reason)) => return Ended::Refused(reason),
    };
    shared.lock().connected(shared.now_us());
    let mut words = tokio::time::interval(LOOK_FOR_WORDS);
    words.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    let mut heard = tokio::time::Instant::now();
    loop {
        loop {
            let text = shared.lock().next(shared.now_us());
            let Some(text) = text else { break };
            if let Err(error) = out.send_text(text.into()).await {
                return Ended::Broken(error.to_string());
            }
        }
        let message = tokio::select! {
            message = inbound.receive() => message,
            () = told(stop) => {
                // It is no loss if the host does not hear it.
                let _ = out.send_text(Guest::bye().into()).await;
                out.close().await;
                return Ended::Stopped;
            }
            _ = words.tick() => {
                if heard.elapsed() > SILENCE {
                    return Ended::Broken(format!("the host has said nothing for {} s", SILENCE.as_secs()));
                }
                continue;
            }
        };
        let message = match message {
            Ok(Some(message)) => message,
            Ok(None) => return Ended::Broken("the host closed the connection".to_owned()),
            Err(error) => return Ended::Broken(error.to_string()),
        };
        heard = tokio::time::Instant::now();
        let mut guest = shared.lock();
        let news = match &message {
            Message::Text(text) => guest.receive_text(text),
            Message::Bytes(bytes) => guest.receive_bytes(bytes, shared.now_us()),
        };
        match news {
            Ok(News::Nothing) => {}
            Ok(news) => {
                if matches!(news, News::Welcome(_)) {
                    state.send_replace(LinkState::Connected);
                }
                on_news(&mut guest, news);
            }
            Err(GuestError::Refused(refusal)) if refusal.reason.may_retry() => {
                return Ended::Broken(refusal.message);
            }
            Err(error) => return Ended::Refused(error.to_string()),
        }
    }
}
