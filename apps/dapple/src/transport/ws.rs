//! WebSocket: one link a connection, over TCP or TLS.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{self, WebSocket};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;
use tokio_tungstenite::tungstenite::{self};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream};

use super::{Inbound, LinkError, Message, Outbound};

/// How long a goodbye may take.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);

/// How long a host may take to answer at all.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// The server's halves of an accepted connection.
pub(crate) fn accepted(socket: WebSocket) -> (ServerOut, ServerIn) {
    let (sink, stream) = socket.split();
    (ServerOut(sink), ServerIn(stream))
}

pub(crate) struct ServerOut(SplitSink<WebSocket, ws::Message>);
pub(crate) struct ServerIn(SplitStream<WebSocket>);

/// Bytes that many connections share, without a copy for each.
struct Shared(Arc<[u8]>);

impl AsRef<[u8]> for Shared {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

impl Outbound for ServerOut {
    const IS_RELIABLE: bool = true;

    async fn send_text(&mut self, text: Arc<str>) -> Result<(), LinkError> {
        self.0.send(ws::Message::Text((&*text).into())).await.map_err(ended)
    }

    async fn send_bytes(&mut self, bytes: Arc<[u8]>) -> Result<(), LinkError> {
        self.0.send(ws::Message::Binary(Bytes::from_owner(Shared(bytes)))).await.map_err(ended)
    }

    async fn close(&mut self) {
        let _ = tokio::time::timeout(CLOSE_TIMEOUT, self.0.close()).await;
    }
}

impl Inbound for ServerIn {
    async fn receive(&mut self) -> Result<Option<Message>, LinkError> {
        loop {
            let Some(message) = self.0.next().await else { return Ok(None) };
            match message.map_err(refused_or_ended)? {
                ws::Message::Text(text) => return Ok(Some(Message::Text(text.as_str().to_owned()))),
                ws::Message::Binary(bytes) => return Ok(Some(Message::Bytes(bytes.to_vec()))),
                ws::Message::Close(_) => return Ok(None),
                // Answered by the library.
                ws::Message::Ping(_) | ws::Message::Pong(_) => {}
            }
        }
    }
}

type ClientSocket = WebSocketStream<MaybeTlsStream<TcpStream>>;

/// Connects to a host at `ws://…`.
pub(crate) async fn connect(
    address: &str,
    max_message_bytes: usize,
) -> Result<(ClientOut, ClientIn), LinkError> {
    let request = address
        .into_client_request()
        .map_err(|error| LinkError::Refused(format!("{address} is no address of a host: {error}")))?;
    let config = WebSocketConfig::default()
        .max_message_size(Some(max_message_bytes))
        .max_frame_size(Some(max_message_bytes));
    let connecting = tokio_tungstenite::connect_async_with_config(request, Some(config), true);
    let connected = tokio::time::timeout(CONNECT_TIMEOUT, connecting).await;
    let (socket, _) = connected
        .map_err(|_| LinkError::Ended(format!("{address} does not answer")))?
        .map_err(|error| LinkError::Ended(format!("{address}: {error}")))?;
    let (sink, stream) = socket.split();
    Ok((ClientOut(sink), ClientIn(stream)))
}

pub(crate) struct ClientOut(SplitSink<ClientSocket, tungstenite::Message>);
pub(crate) struct ClientIn(SplitStream<ClientSocket>);

impl Outbound for ClientOut {
    const IS_RELIABLE: bool = true;

    async fn send_text(&mut self, text: Arc<str>) -> Result<(), LinkError> {
        self.0.send(tungstenite::Message::Text((&*text).into())).await.map_err(ended)
    }

    async fn send_bytes(&mut self, bytes: Arc<[u8]>) -> Result<(), LinkError> {
        self.0.send(tungstenite::Message::Binary(bytes.to_vec().into())).await.map_err(ended)
    }

    async fn close(&mut self) {
        let _ = tokio::time::timeout(CLOSE_TIMEOUT, self.0.close()).await;
    }
}

impl Inbound for ClientIn {
    async fn receive(&mut self) -> Result<Option<Message>, LinkError> {
        loop {
            let Some(message) = self.0.next().await else { return Ok(None) };
            match message.map_err(ended)? {
                tungstenite::Message::Text(text) => return Ok(Some(Message::Text(text.as_str().to_owned()))),
                tungstenite::Message::Binary(bytes) => return Ok(Some(Message::Bytes(bytes.to_vec()))),
                tungstenite::Message::Close(_) => return Ok(None),
                _ => {}
            }
        }
    }
}

fn ended(error: impl std::fmt::Display) -> LinkError {
    LinkError::Ended(error.to_string())
}

/// Too long a message, or none at all, is answered; everything else has ended the link.
fn refused_or_ended(error: axum::Error) -> LinkError {
    let inner = error.into_inner();
    match inner.downcast_ref::<tungstenite::Error>() {
        Some(tungstenite::Error::Capacity(reason)) => LinkError::Refused(format!("{reason}")),
        Some(tungstenite::Error::Utf8(_)) => LinkError::Refused("a text that is not UTF-8".to_owned()),
        _ => LinkError::Ended(inner.to_string()),
    }
}
