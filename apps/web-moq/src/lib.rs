//! A live session over Media over QUIC in a browser (WebTransport): what the page uses in place of a WebSocket where it can. Compiles to nothing elsewhere.
#![cfg(target_arch = "wasm32")]

use dapple_moq::moq_net::{Client, origin, time};
use dapple_moq::{LinkError, Message, Names, Wish};
use futures_channel::mpsc;
use futures_util::StreamExt;
use futures_util::future::{Either, select};
use js_sys::{Function, Uint8Array};
use url::Url;
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::spawn_local;

/// Words that wait to be said.
enum Word {
    Say(String),
    Close,
}

/// One connection: opened as it is made, and heard by its functions.
#[wasm_bindgen]
pub struct MoqLink {
    words: mpsc::UnboundedSender<Word>,
}

#[wasm_bindgen]
impl MoqLink {
    /// Opens a connection to the host or relay at `url` and joins what is called `name` there. `certificate` is the SHA-256 of its certificate in
    /// hexadecimal, or nothing where it has one of an authority. `scene` is the hash of the scene that has been loaded, `viewer` 32 hexadecimal digits
    /// drawn at random, `bitsPerSecond` the most that is wanted, if there is a limit.
    ///
    /// `onOpen()` is called once it has joined, `onMessage(data)` with each text or `Uint8Array`, and `onClose(reason)` at the end, whatever it was.
    #[wasm_bindgen(constructor)]
    #[allow(clippy::too_many_arguments, reason = "it is called once, from JavaScript")]
    pub fn new(
        url: String,
        name: String,
        certificate: Option<String>,
        scene: String,
        viewer: String,
        bits_per_s: Option<f64>,
        on_open: Function,
        on_message: Function,
        on_close: Function,
    ) -> MoqLink {
        console_error_panic_hook::set_once();
        let (words, said) = mpsc::unbounded();
        let wish = Wish { scene, viewer, bits_per_s: bits_per_s.map(|bits| bits as u64), parts: true };
        spawn_local(async move {
            let ended =
                converse(&url, &name, certificate.as_deref(), &wish, said, &on_open, &on_message).await;
            let reason = ended.err().map_or(String::new(), |error| error.to_string());
            // If the page's function throws there is nobody to tell.
            let _ = on_close.call1(&JsValue::NULL, &reason.into());
        });
        MoqLink { words }
    }

    /// Says a text; nothing once it has ended.
    pub fn send(&self, text: String) {
        let _ = self.words.unbounded_send(Word::Say(text));
    }

    /// Ends it. What was said before is still sent, if there is time.
    pub fn close(&self) {
        let _ = self.words.unbounded_send(Word::Close);
    }
}

async fn converse(
    url: &str,
    name: &str,
    certificate: Option<&str>,
    wish: &Wish,
    mut said: mpsc::UnboundedReceiver<Word>,
    on_open: &Function,
    on_message: &Function,
) -> Result<(), LinkError> {
    let url: Url =
        url.parse().map_err(|error| LinkError::Refused(format!("{url} is no address: {error}")))?;
    let names = Names::new(name)?;
    let client = web_transport_wasm::ClientBuilder::new().with_protocols(PROTOCOLS);
    let client = match certificate {
        Some(certificate) => client.with_server_certificate_hashes(vec![bytes(certificate)?]),
        None => client.with_system_roots(),
    };
    let transport =
        client.connect(url).await.map_err(|error| LinkError::Ended(format!("no WebTransport: {error}")))?;
    let (from, from_driver) = origin::Producer::new(origin::Config::default());
    let (to, to_driver) = origin::Producer::new(origin::Config::default());
    // They end with what they drive.
    spawn_local(async { drop(time::run(from_driver).await) });
    spawn_local(async { drop(time::run(to_driver).await) });
    // It asks for what it needs alone: others need not be told of, by the host or by a relay.
    let readable = from.scope("", &names.rights(&wish.viewer)?.0)?;
    let client = Client::new().with_publisher(&to).with_subscriber(readable);
    let (session, driver) = client.connect_lite(now(), transport).await?;
    spawn_local(async { drop(time::run(driver).await) });
    let (mut out, mut inbound) = {
        let consumer = from.consume();
        let joining = Box::pin(dapple_moq::join(&consumer, &to, &names, wish));
        // Nothing is said before it has joined but that it is to end.
        match select(joining, said.next()).await {
            Either::Left((joined, _)) => joined?,
            Either::Right(_) => return Ok(()),
        }
    };
    let _ = on_open.call0(&JsValue::NULL);
    loop {
        let word = {
            let message = Box::pin(inbound.receive());
            match select(message, said.next()).await {
                Either::Left((message, _)) => {
                    let Some(message) = message? else { break };
                    let data = match message {
                        Message::Text(text) => JsValue::from_str(&text),
                        Message::Bytes(bytes) => Uint8Array::from(&bytes[..]).into(),
                    };
                    let _ = on_message.call1(&JsValue::NULL, &data);
                    continue;
                }
                Either::Right((word, _)) => word,
            }
        };
        match word {
            Some(Word::Say(text)) => out.send(&text)?,
            Some(Word::Close) | None => break,
        }
    }
    out.close();
    let _ = session.close().await;
    Ok(())
}

/// What is offered: the newest first.
const PROTOCOLS: [&str; 2] = ["moq-lite-06", "moq-lite-05"];

fn now() -> time::Instant {
    time::Instant::now()
}

fn bytes(hex: &str) -> Result<Vec<u8>, LinkError> {
    let refused = || LinkError::Refused("the hash of the certificate is not hexadecimal".to_owned());
    if !hex.is_ascii() || hex.len() != 64 {
        return Err(refused());
    }
    (0..hex.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&hex[at..at + 2], 16).map_err(|_| refused()))
        .collect()
}
