//! Media over QUIC: one connection a viewer, to the host itself or to a relay. `dapple-moq` says what is in it.

use std::sync::Arc;
use std::time::Duration;

use dapple_moq::moq_net::origin;
use dapple_moq::{HostIn, HostOut, Names, ViewerIn, ViewerOut, Wish};
use dapple_session::Hello;
use moq_tokio::{Client, Connection};
use url::Url;

use super::{Inbound, LinkError, Message, Outbound};
use crate::page::{MoqJson, VIEWER};

/// How long a host may take to answer at all: the connection, and what it says of itself.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// What was said last has this long to leave.
const CLOSE_TIMEOUT: Duration = Duration::from_millis(500);

/// What a viewer was told last is kept for so long.
const LAST_WORDS: Duration = Duration::from_secs(5);

/// A viewer's connection, closed with both halves.
struct Held {
    connection: Connection,
    client: Client,
    /// What it publishes.
    _to: origin::Producer,
}

/// A client as both hosts and viewers need it; `certificate` is the SHA-256 of the other end's, where nobody else vouches for it.
pub(crate) fn client(certificate: Option<&str>) -> Result<Client, LinkError> {
    let mut config = moq_tokio::connect::Config::default();
    config.tls.fingerprint = certificate.map(str::to_owned).into_iter().collect();
    config.init(moq_tokio::quic::Config::default()).map_err(ended)
}

/// Connects to a host, or to a relay that has it; `in_parts` to take the light in parts where it comes in some.
pub(crate) async fn connect(
    address: &MoqJson,
    hello: &Hello,
    in_parts: bool,
) -> Result<(ClientOut, ClientIn), LinkError> {
    let names = Names::new(&address.name).map_err(from)?;
    let mut secret = [0; 16];
    getrandom::fill(&mut secret)
        .map_err(|error| LinkError::Refused(format!("the system gives no random numbers: {error}")))?;
    let wish = Wish {
        scene: hello.scene.clone(),
        bits_per_s: hello.bits_per_s,
        viewer: dapple_session::host::hex(&secret),
        parts: in_parts,
    };
    let url = address.url.replace(VIEWER, &wish.viewer);
    let url: Url =
        url.parse().map_err(|error| LinkError::Refused(format!("{url} is no address: {error}")))?;
    let (from_host, to_host) = (moq_tokio::origin::spawn(), moq_tokio::origin::spawn());
    // It asks for what it needs alone: others need not be told of, by the host or by a relay.
    let readable = names.rights(&wish.viewer).map_err(from)?.0;
    let readable = from_host.scope("", &readable).map_err(ended)?;
    let client = client(address.certificate.as_deref())?
        .with_reconnect(false)
        .with_publisher(&to_host)
        .with_subscriber(readable);
    let connecting = async {
        let connection = client.connect(url).established().await.map_err(ended)?;
        let joined = dapple_moq::join(&from_host.consume(), &to_host, &names, &wish).await.map_err(from)?;
        Ok::<_, LinkError>((connection, joined))
    };
    let connected = tokio::time::timeout(CONNECT_TIMEOUT, connecting).await;
    let (connection, (out, inbound)) = connected
        .map_err(|_| LinkError::Ended(format!("{} does not have {}", address.url, address.name)))??;
    let held = Arc::new(Held { connection, client, _to: to_host });
    Ok((ClientOut { out, held: held.clone() }, ClientIn { inbound, held, _from: from_host }))
}

/// The viewer's words.
pub(crate) struct ClientOut {
    out: ViewerOut,
    held: Arc<Held>,
}

/// What comes for it.
pub(crate) struct ClientIn {
    inbound: ViewerIn,
    held: Arc<Held>,
    _from: origin::Producer,
}

impl Outbound for ClientOut {
    const IS_RELIABLE: bool = true;

    async fn send_text(&mut self, text: Arc<str>) -> Result<(), LinkError> {
        self.out.send(&text).map_err(from)
    }

    async fn send_bytes(&mut self, _: Arc<[u8]>) -> Result<(), LinkError> {
        Err(LinkError::Refused("viewers say everything in text".to_owned()))
    }

    async fn close(&mut self) {
        self.out.close();
        let _ = tokio::time::timeout(CLOSE_TIMEOUT, self.held.connection.clone().close()).await;
        let _ = tokio::time::timeout(CLOSE_TIMEOUT, self.held.client.clone().close()).await;
    }
}

impl Inbound for ClientIn {
    async fn receive(&mut self) -> Result<Option<Message>, LinkError> {
        tokio::select! {
            message = self.inbound.receive() => Ok(message.map_err(from)?.map(message_from)),
            closed = self.held.connection.closed() => {
                Err(LinkError::Ended(closed.err().map_or("it was closed".to_owned(), |error| error.to_string())))
            }
        }
    }
}

/// The host's words to one viewer.
pub(crate) struct ServerOut(HostOut);

/// What a viewer says.
pub(crate) struct ServerIn(HostIn);

/// The host's halves of a viewer that wants to be heard.
pub(crate) fn arrived((out, inbound): (HostOut, HostIn)) -> (ServerOut, ServerIn) {
    (ServerOut(out), ServerIn(inbound))
}

impl Outbound for ServerOut {
    const IS_RELIABLE: bool = true;

    async fn send_text(&mut self, text: Arc<str>) -> Result<(), LinkError> {
        self.0.send(text).map_err(from)
    }

    async fn send_bytes(&mut self, _: Arc<[u8]>) -> Result<(), LinkError> {
        Err(LinkError::Refused("light goes to all at once".to_owned()))
    }

    async fn close(&mut self) {
        self.0.finish();
        // It goes when this is dropped, and the viewer may only just be coming for it.
        tokio::time::sleep(LAST_WORDS).await;
    }
}

impl Inbound for ServerIn {
    async fn receive(&mut self) -> Result<Option<Message>, LinkError> {
        Ok(self.0.receive().await.map_err(from)?.map(message_from))
    }
}

fn message_from(message: dapple_moq::Message) -> Message {
    match message {
        dapple_moq::Message::Text(text) => Message::Text(text),
        dapple_moq::Message::Bytes(bytes) => Message::Bytes(bytes.into()),
    }
}

fn from(error: dapple_moq::LinkError) -> LinkError {
    match error {
        dapple_moq::LinkError::Ended(reason) => LinkError::Ended(reason),
        dapple_moq::LinkError::Refused(reason) => LinkError::Refused(reason),
    }
}

fn ended(error: impl std::fmt::Display) -> LinkError {
    LinkError::Ended(error.to_string())
}
