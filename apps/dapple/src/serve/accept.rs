//! Connections: how many, how slow they may be, and TLS.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use axum::Router;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};

/// A place among the connections: it is free again once all copies are gone.
pub(crate) type Permit = Arc<OwnedSemaphorePermit>;

/// How long the head of a request, or the start of TLS, may take.
const PATIENCE: Duration = Duration::from_secs(5);

/// Bytes that the system may hold for a connection on their way out: what waits there cannot be replaced by newer light.
const SEND_BUFFER_BYTES: usize = 256 << 10;

/// Connections that wait to be accepted.
const BACKLOG: u32 = 1024;

/// After a failure to accept, such as too many open files.
const PAUSE: Duration = Duration::from_millis(50);

/// Makes a bound socket one that connections can be accepted on.
pub(crate) fn listener(socket: std::net::TcpListener) -> Result<TcpListener> {
    socket.set_nonblocking(true).context("cannot prepare the listener")?;
    let reference = socket2::SockRef::from(&socket);
    // Accepted sockets have what their listener has.
    reference.set_send_buffer_size(SEND_BUFFER_BYTES).context("cannot prepare the listener")?;
    reference.listen(BACKLOG as i32).context("cannot listen")?;
    TcpListener::from_std(socket).context("cannot prepare the listener")
}

/// Reads what TLS needs.
pub(crate) fn tls(certificates: &Path, key: &Path) -> Result<TlsAcceptor> {
    let chain: Vec<CertificateDer<'static>> = CertificateDer::pem_file_iter(certificates)
        .and_then(Iterator::collect)
        .with_context(|| format!("--tls-cert {}: not certificates in PEM", certificates.display()))?;
    if chain.is_empty() {
        bail!("--tls-cert {}: it holds no certificate", certificates.display());
    }
    let key = PrivateKeyDer::from_pem_file(key)
        .with_context(|| format!("--tls-key {}: not a key in PEM", key.display()))?;
    let provider = Arc::new(tokio_rustls::rustls::crypto::ring::default_provider());
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .context("TLS is not to be had")?
        .with_no_client_auth()
        .with_single_cert(chain, key)
        .context("--tls-cert and --tls-key do not belong together")?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(TlsAcceptor::from(Arc::new(config)))
}

/// Accepts until told to stop; at most so many connections at a time, more are closed at once.
pub(crate) async fn accept(
    listener: TcpListener,
    router: Router,
    tls: Option<TlsAcceptor>,
    most: usize,
    mut stop: watch::Receiver<bool>,
) {
    let room = Arc::new(Semaphore::new(most));
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            _ = stop.changed() => return,
        };
        let stream = match accepted {
            Ok((stream, _)) => stream,
            Err(error) => {
                tracing::warn!("a connection could not be accepted: {error}");
                tokio::time::sleep(PAUSE).await;
                continue;
            }
        };
        let Ok(permit) = room.clone().try_acquire_owned() else {
            tracing::debug!("a connection too many was closed");
            continue;
        };
        // Small messages must not wait for others.
        let _ = stream.set_nodelay(true);
        tokio::spawn(serve(stream, router.clone(), tls.clone(), permit));
    }
}

async fn serve(stream: TcpStream, router: Router, tls: Option<TlsAcceptor>, permit: OwnedSemaphorePermit) {
    match tls {
        None => http(stream, router, permit).await,
        Some(tls) => {
            if let Ok(Ok(stream)) = tokio::time::timeout(PATIENCE, tls.accept(stream)).await {
                http(stream, router, permit).await;
            }
        }
    }
}

async fn http(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    router: Router,
    permit: OwnedSemaphorePermit,
) {
    // The permit goes with what is served over the connection: an upgraded one outlives this function.
    let permit: Permit = Arc::new(permit);
    let router = router.layer(axum::Extension(permit));
    let connection = hyper::server::conn::http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(PATIENCE)
        .serve_connection(TokioIo::new(stream), TowerToHyperService::new(router))
        .with_upgrades();
    if let Err(error) = connection.await {
        tracing::debug!("a connection ended: {error}");
    }
}
