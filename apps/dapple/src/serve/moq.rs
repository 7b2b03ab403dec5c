//! Viewers over Media over QUIC: those that connect to this server, and those behind relays.

use std::net::SocketAddr;
use std::sync::Arc;

use anyhow::{Context, Result, anyhow};
use dapple_moq::moq_net::{cache, origin};
use dapple_moq::{Arrivals, Broadcast, Names};
use moq_tokio::server::Request;
use tokio::runtime::Runtime;
use tokio::sync::Semaphore;
use tokio::task::JoinHandle;
use url::Url;

use super::hub::{Hub, SharedHub, Whence};
use super::viewer::talk;
use crate::args::ServeArgs;
use crate::page::{HOST, MoqJson, VIEWER};
use crate::transport::moq::{arrived, client};

/// Most bytes that are kept: what this publishes for those who come late, and what viewers say until it was heard.
const CACHE_BYTES: u64 = 256 << 20;

/// What is published, and by which ways.
pub(crate) struct Moq {
    origin: origin::Producer,
    names: Names,
    server: Option<moq_tokio::Server>,
    relays: Vec<Url>,
    /// What viewers are told.
    pub(crate) json: MoqJson,
}

impl Moq {
    /// Takes the port and makes the certificate; nothing where nobody asked for it.
    pub(crate) fn open(args: &ServeArgs, scene: &[u8; 32], runtime: &Runtime) -> Result<Option<Moq>> {
        if args.moq.is_none() && args.relay.is_empty() {
            return Ok(None);
        }
        let _guard = runtime.enter();
        let name = match &args.moq_name {
            Some(name) => name.clone(),
            None => random_name(scene)?,
        };
        let names = Names::new(&name).map_err(|error| anyhow!("--moq-name: {error}"))?;
        let relays = args.relay.iter().map(|text| relay(text)).collect::<Result<Vec<Url>>>()?;
        let (server, own) = match args.moq {
            Some(port) => {
                let (server, port, certificate) = listen(args, port)?;
                let path = names.path_of(VIEWER);
                (Some(server), Some((format!("https://{HOST}:{port}{path}"), certificate)))
            }
            None => (None, None),
        };
        let at = args.moq_at.clone().or_else(|| own.as_ref().map(|(url, _)| url.clone()));
        let at = at.or_else(|| relays.first().map(without_token));
        let url = at.context("there is neither a port nor a relay")?;
        // That of another address is its own.
        let certificate = own.filter(|(own, _)| *own == url).and_then(|(_, certificate)| certificate);
        let json = MoqJson { url, name, certificate };
        let mut config = origin::Config::default();
        let kept = cache::Config::default().with_capacity(CACHE_BYTES).with_expiry(cache::DEFAULT_EXPIRY);
        config.pool = cache::Pool::new(kept);
        Ok(Some(Moq { origin: moq_tokio::origin::spawn_config(config), names, server, relays, json }))
    }

    /// Publishes until the hub ends; `most` viewers are heard, and as many connections taken. The task ends once the host has said that it does.
    pub(crate) fn start(
        self,
        hub: &SharedHub,
        runtime: &Runtime,
        first_group: u64,
        most: usize,
    ) -> Result<JoinHandle<()>> {
        let _guard = runtime.enter();
        let Moq { origin, names, server, relays, .. } = self;
        let broadcast =
            Broadcast::new(&origin, &names, &hub.host(), first_group).context("cannot publish over MoQ")?;
        let ways = Ways { origin: origin.clone(), names: names.clone() };
        for url in relays {
            tokio::spawn(ways.clone().relay(url));
        }
        if let Some(server) = server {
            tokio::spawn(ways.accept(server, most));
        }
        let arrivals = Arrivals::new(&origin, &names, most)?;
        tokio::spawn(hear(hub.clone(), arrivals));
        Ok(tokio::spawn(publish(hub.clone(), broadcast, origin)))
    }
}

fn random_name(scene: &[u8; 32]) -> Result<String> {
    let mut secret = [0; 8];
    getrandom::fill(&mut secret).map_err(|error| anyhow!("the system gives no random numbers: {error}"))?;
    let hex = dapple_session::host::hex;
    Ok(format!("dapple/{}-{}", hex(&scene[..8]), hex(&secret)))
}

fn relay(text: &str) -> Result<Url> {
    let url: Url = text.parse().with_context(|| format!("--relay {text} is no address"))?;
    if !matches!(url.scheme(), "https" | "http" | "moqt" | "moql") || !url.has_host() {
        return Err(anyhow!(
            "--relay {text}: write https://HOST:PORT/ (or http:// for a relay that tells the hash of its certificate)"
        ));
    }
    Ok(url)
}

/// What others may see of a relay's address.
fn without_token(url: &Url) -> String {
    let mut url = url.clone();
    url.set_query(None);
    url.to_string()
}

/// The server, its port and the hash of its certificate where nobody else vouches for it.
fn listen(args: &ServeArgs, port: u16) -> Result<(moq_tokio::Server, u16, Option<String>)> {
    let mut config = moq_tokio::listen::Config::default();
    let addresses = std::net::ToSocketAddrs::to_socket_addrs(&(args.host.as_str(), port));
    let address: SocketAddr = addresses
        .with_context(|| format!("--host {}", args.host))?
        .next()
        .with_context(|| format!("--host {} has no address", args.host))?;
    config.bind = Some(address.to_string().parse().map_err(|error| anyhow!("{address}: {error}"))?);
    let is_own = match (&args.tls_cert, &args.tls_key) {
        (Some(certificates), Some(key)) => {
            (config.tls.cert, config.tls.key) = (vec![certificates.clone()], vec![key.clone()]);
            false
        }
        _ => {
            let mut hosts = vec!["localhost".to_owned(), "127.0.0.1".to_owned()];
            if !address.ip().is_unspecified() {
                hosts.push(address.ip().to_string());
            }
            config.tls.generate = hosts;
            true
        }
    };
    let server = config
        .init(moq_tokio::quic::Config::default())
        .with_context(|| format!("cannot listen on UDP port {port} of {} (--moq)", args.host))?;
    let local = server.local_addr().context("the QUIC listener has no address")?;
    let certificate = is_own.then(|| server.certificates().fingerprints().into_iter().next()).flatten();
    Ok((server, local.port(), certificate))
}

/// By which ways what is published goes, and how much of it is seen there.
#[derive(Clone)]
struct Ways {
    origin: origin::Producer,
    names: Names,
}

impl Ways {
    /// Keeps up the connection to a relay.
    async fn relay(self, url: Url) {
        let shown = without_token(&url);
        let connecting = || {
            let client = client(None)?;
            let (readable, writable) = self.scopes("*")?;
            Ok::<_, anyhow::Error>(
                client.with_publisher(readable).with_subscriber(writable).connect(url.clone()),
            )
        };
        let mut connection = match connecting() {
            Ok(connection) => connection,
            Err(error) => {
                tracing::error!("the relay {shown} cannot be used: {error}");
                return;
            }
        };
        loop {
            match connection.status().await {
                Ok(moq_tokio::Status::Connected) => tracing::info!("publishing to {shown}"),
                Ok(status) => tracing::warn!("the relay {shown}: {status:?}"),
                Err(error) => {
                    tracing::error!("the relay {shown} was given up: {error}");
                    return;
                }
            }
        }
    }

    /// Takes connections of viewers, so many at a time.
    async fn accept(self, server: moq_tokio::Server, most: usize) {
        let places = Arc::new(Semaphore::new(most));
        let mut listener = match server.listen().await {
            Ok(listener) => listener,
            Err(error) => {
                tracing::error!("no viewers come over QUIC: {error}");
                return;
            }
        };
        while let Some(request) = listener.accept().await {
            let Ok(place) = places.clone().try_acquire_owned() else {
                // Dropped, it is closed.
                continue;
            };
            let ways = self.clone();
            tokio::spawn(async move {
                if let Err(error) = ways.serve(request).await {
                    tracing::debug!("a connection ended: {error:#}");
                }
                drop(place);
            });
        }
    }

    /// What a viewer (`*` for all of a relay's) sees of what is published, and where it may write.
    fn scopes(&self, viewer: &str) -> Result<(origin::Consumer, origin::Producer)> {
        let (readable, writable) = self.names.rights(viewer)?;
        Ok((self.origin.consume().scope("", &readable)?, self.origin.scope("", &writable)?))
    }

    async fn serve(self, request: Request) -> Result<()> {
        let viewer = self.names.viewer_at(request.path()).map(str::to_owned);
        // Whoever does not know the name learns nothing. Dropped, it is closed.
        let viewer = viewer.context("it connects at no viewer's path")?;
        let (readable, writable) = self.scopes(&viewer)?;
        let session = request.with_publisher(readable).with_subscriber(writable).ok().await?;
        let _ = session.closed().await;
        Ok(())
    }
}

/// Writes what each step brings.
async fn publish(hub: SharedHub, mut broadcast: Broadcast, _origin: origin::Producer) {
    let mut steps = hub.watch_steps();
    loop {
        match write(&hub, &mut broadcast) {
            Ok(false) => {}
            Ok(true) => {
                // The last words are on their way.
                tokio::time::sleep(std::time::Duration::from_secs(1)).await;
                return;
            }
            Err(error) => {
                tracing::error!("nothing is published over MoQ any more: {error:#}");
                return;
            }
        }
        if steps.changed().await.is_err() {
            return;
        }
    }
}

fn write(hub: &Hub, broadcast: &mut Broadcast) -> Result<bool> {
    let arrival = hub.arrival(true, Whence { is_foreign: false, shares: true })?;
    let now_us = hub.now_us();
    Ok(broadcast.write(&mut hub.host(), &arrival, now_us)?)
}

/// Talks to viewers that want to be heard.
async fn hear(hub: SharedHub, mut arrivals: Arrivals) {
    while let Some(halves) = arrivals.next().await {
        let (out, inbound) = arrived(halves);
        tokio::spawn(talk(hub.clone(), out, inbound, Whence { is_foreign: false, shares: true }));
    }
}
