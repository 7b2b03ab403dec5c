//! One viewer's connection, whatever carries it.

use std::time::Duration;

use dapple_session::host::{Link, Next, Outgoing};
use dapple_session::{FromHost, FromViewer, Reason, Refusal};
use tokio::sync::Notify;

use super::hub::{Hub, SharedHub, Whence};
use crate::transport::{Inbound, LinkError, Message, Outbound};

/// A hello must come within this time.
const HELLO_TIMEOUT: Duration = Duration::from_secs(5);

/// A message that cannot be sent for so long ends the connection.
const SEND_TIMEOUT: Duration = Duration::from_secs(20);

/// Talks to a viewer until one of both ends it.
pub(crate) async fn talk(hub: SharedHub, mut out: impl Outbound, mut inbound: impl Inbound, whence: Whence) {
    match join(&hub, is_reliable(&out), &mut inbound, whence).await {
        Ok(link) => {
            // However this ends, its place is free then.
            let place = Place { hub: &hub, link };
            let refusal = converse(&hub, link, &mut out, &mut inbound).await;
            drop(place);
            tracing::debug!(viewer = link.viewer, connection = link.connection, reason = ?refusal, "left");
            if let Some(refusal) = refusal {
                refuse(&mut out, refusal).await;
            }
        }
        Err(Some(refusal)) => {
            tracing::debug!(reason = ?refusal.reason, "refused: {refusal}");
            refuse(&mut out, refusal).await;
        }
        // It went away by itself.
        Err(None) => {}
    }
    out.close().await;
}

/// A viewer's place among those that are connected.
struct Place<'a> {
    hub: &'a Hub,
    link: Link,
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.hub.host().leave(self.link, self.hub.now_us());
    }
}

async fn refuse(out: &mut impl Outbound, refusal: Refusal) {
    let text = FromHost::Refused(refusal).to_text();
    let _ = tokio::time::timeout(SEND_TIMEOUT, out.send_text(text.into())).await;
}

fn is_reliable<O: Outbound>(_: &O) -> bool {
    O::IS_RELIABLE
}

/// Waits for a hello and lets its viewer in.
async fn join(
    hub: &Hub,
    is_reliable: bool,
    inbound: &mut impl Inbound,
    whence: Whence,
) -> Result<Link, Option<Refusal>> {
    let malformed = |message: String| Some(Refusal { reason: Reason::Malformed, message });
    let message = tokio::time::timeout(HELLO_TIMEOUT, inbound.receive()).await.map_err(|_| {
        let message = format!("no hello within {} s", HELLO_TIMEOUT.as_secs());
        Some(Refusal { reason: Reason::Silent, message })
    })?;
    let text = match message {
        Ok(Some(Message::Text(text))) => text,
        Ok(Some(Message::Bytes(_))) => {
            return Err(malformed("the first message must be a hello, in text".to_owned()));
        }
        Ok(None) | Err(LinkError::Ended(_)) => return Err(None),
        Err(LinkError::Refused(reason)) => return Err(malformed(reason)),
    };
    let hello = match FromViewer::parse(&text).map_err(|error| malformed(error.to_string()))? {
        FromViewer::Hello(hello) => hello,
        _ => return Err(malformed("the first message must be a hello".to_owned())),
    };
    let arrival = hub.arrival(is_reliable, whence).map_err(|error| {
        tracing::error!("the system gives no random numbers: {error}");
        Some(Refusal { reason: Reason::Closing, message: "the host cannot let anyone in".to_owned() })
    })?;
    let link = hub.host().join(&hello, arrival, hub.now_us()).map_err(Some)?;
    tracing::debug!(viewer = link.viewer, connection = link.connection, "joined");
    Ok(link)
}

/// Sends and receives until the end; gives the refusal that is still to be sent.
async fn converse(
    hub: &Hub,
    link: Link,
    out: &mut impl Outbound,
    inbound: &mut impl Inbound,
) -> Option<Refusal> {
    // What came may allow what could not be sent before.
    let heard = Notify::new();
    tokio::select! {
        refusal = send_all(hub, link, out, &heard) => refusal,
        refusal = receive_all(hub, link, inbound, &heard) => refusal,
    }
}

async fn send_all(hub: &Hub, link: Link, out: &mut impl Outbound, heard: &Notify) -> Option<Refusal> {
    let mut steps = hub.watch_steps();
    loop {
        let next = hub.host().next(link, hub.now_us());
        let sending = match next {
            Next::Send(Outgoing::Text(text)) => tokio::time::timeout(SEND_TIMEOUT, out.send_text(text)).await,
            Next::Send(Outgoing::Bytes(bytes)) => {
                tokio::time::timeout(SEND_TIMEOUT, out.send_bytes(bytes)).await
            }
            Next::Close(refusal) => return Some(refusal),
            Next::Wait => {
                tokio::select! {
                    changed = steps.changed() => if changed.is_err() { return None },
                    () = heard.notified() => {}
                }
                continue;
            }
        };
        match sending {
            Ok(Ok(())) => {}
            // It does not read: there is no way to tell it anything.
            Ok(Err(_)) | Err(_) => return None,
        }
    }
}

async fn receive_all(hub: &Hub, link: Link, inbound: &mut impl Inbound, heard: &Notify) -> Option<Refusal> {
    loop {
        let text = match inbound.receive().await {
            Ok(Some(Message::Text(text))) => text,
            Ok(Some(Message::Bytes(_))) => {
                let message = "viewers say everything in text".to_owned();
                return Some(Refusal { reason: Reason::Malformed, message });
            }
            Ok(None) | Err(LinkError::Ended(_)) => return None,
            Err(LinkError::Refused(message)) => return Some(Refusal { reason: Reason::Malformed, message }),
        };
        if let Err(refusal) = hub.host().announce(link, hub.now_us()) {
            return Some(refusal);
        }
        // Read without the lock that everyone waits for.
        let message = FromViewer::parse(&text)
            .map_err(|error| Refusal { reason: Reason::Malformed, message: error.to_string() });
        if let Err(refusal) = hub.host().hear(link, message, hub.now_us()) {
            return Some(refusal);
        }
        heard.notify_one();
    }
}
