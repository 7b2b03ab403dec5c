//! A page's scene and recording, over plain HTTP.

use std::io::Read;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use dapple_scene::{NoFiles, Scene, Spare};

use crate::inspect::MAX_RECORDING_BYTES;
use crate::page::{FILE_NAME, MoqJson, Spares, ViewerJson, resolve};
use crate::progress::Bar;
use crate::source::MAX_SCENE_BYTES;

/// Largest viewer.json.
const MAX_JSON_BYTES: u64 = 1 << 20;

/// Bytes of a recording that are handed on at once.
const PIECE_BYTES: usize = 64 << 10;

/// How long a host may take to answer at all.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// A scene, and the pieces of its recording as they come.
pub(super) struct Fetched {
    pub(super) scene: Scene,
    pub(super) title: String,
    pub(super) stream: Option<Receiver<Piece>>,
    /// Where its live session is, `ws://…`.
    pub(super) live: Option<String>,
    /// Where it is over MoQ.
    pub(super) moq: Option<MoqJson>,
    /// How far away what blocks may be, metres, if the folder says so.
    pub(super) radius_m: Option<f32>,
}

/// The next bytes, or why there are no more; the channel closes after the last.
pub(super) type Piece = Result<Vec<u8>, String>;

/// A folder's viewer.json.
pub(super) fn fetch_json(url: &str) -> Result<ViewerJson> {
    let address = resolve(url, FILE_NAME)?;
    ViewerJson::parse(&get_all(&address, MAX_JSON_BYTES)?).with_context(|| address.clone())
}

/// Fetches what the folder's viewer.json names.
pub(super) fn fetch(url: &str) -> Result<Fetched> {
    let json_address = resolve(url, FILE_NAME)?;
    let json = fetch_json(url)?;
    let scene_address = resolve(url, &json.scene)?;
    let bar = Bar::spinner(&format!("fetching {scene_address}"));
    let bytes = get_all(&scene_address, MAX_SCENE_BYTES)?;
    drop(bar);
    let name = scene_address.rsplit('/').next().unwrap_or_default();
    let mut scene = dapple_scene::load(name, &bytes, &NoFiles)
        .with_context(|| format!("{scene_address} cannot be shown"))?;
    if scene.triangle_count() == 0 {
        bail!("{scene_address} has no triangles: there is nothing to show");
    }
    if let Some(animation) = json.animation {
        if animation as usize >= scene.animations.len() {
            bail!("{json_address} names animation {animation}, which the scene does not have");
        }
        scene.set_active_animation(Some(animation));
    }
    let spares: Vec<Spare> = json
        .spares
        .iter()
        .map(|Spares { instance, count }| Spare { instance: *instance, count: *count })
        .collect();
    scene.add_spares(&spares).with_context(|| format!("{json_address}: spare instances"))?;
    let live = match &json.live {
        Some(live) => Some(resolve(url, live)?.replacen("http://", "ws://", 1)),
        None => None,
    };
    let stream = match &json.stream {
        Some(stream) => Some(get_pieces(resolve(url, stream)?)?),
        None => None,
    };
    Ok(Fetched {
        scene,
        title: scene_address,
        stream,
        live,
        moq: json.moq,
        radius_m: json.radius.filter(|r| *r > 0.0 && r.is_finite()),
    })
}

fn open(address: &str) -> Result<(impl Read + Send + use<>, Option<u64>)> {
    let request = ureq::get(address).config().timeout_connect(Some(CONNECT_TIMEOUT)).build();
    let response = request.call().with_context(|| format!("cannot fetch {address}"))?;
    let length = response.body().content_length();
    Ok((response.into_body().into_reader(), length))
}

fn get_all(address: &str, limit_bytes: u64) -> Result<Vec<u8>> {
    let (reader, length) = open(address)?;
    let mut bytes = Vec::new();
    reader
        .take(limit_bytes + 1)
        .read_to_end(&mut bytes)
        .with_context(|| format!("{address} breaks off after {} bytes", bytes.len()))?;
    if bytes.len() as u64 > limit_bytes || length.is_some_and(|length| length > limit_bytes) {
        bail!("{address} has more than the {limit_bytes} bytes that are taken");
    }
    Ok(bytes)
}

/// Fetches on a thread of its own.
fn get_pieces(address: String) -> Result<Receiver<Piece>> {
    let (mut reader, _) = open(&address)?;
    let (sender, receiver) = channel();
    std::thread::Builder::new()
        .name("fetch".to_owned())
        .spawn(move || {
            let mut total = 0;
            loop {
                let mut piece = vec![0; PIECE_BYTES];
                let message = match reader.read(&mut piece) {
                    Ok(0) => return,
                    Ok(_) if total > MAX_RECORDING_BYTES => {
                        Err(format!("{address} has more than the {MAX_RECORDING_BYTES} bytes that are taken"))
                    }
                    Ok(count) => {
                        total += count as u64;
                        piece.truncate(count);
                        Ok(piece)
                    }
                    Err(error) => Err(format!("{address} breaks off after {total} bytes: {error}")),
                };
                let last = message.is_err();
                if sender.send(message).is_err() || last {
                    return;
                }
            }
        })
        .context("cannot start a thread that fetches")?;
    Ok(receiver)
}
