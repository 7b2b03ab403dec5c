//! Ports to listen on.

use std::io::ErrorKind;
use std::net::{SocketAddr, TcpListener};

use anyhow::{Context, Result, bail};

/// The port that is tried first where none is given, and how many after it.
const FIRST_PORT: u16 = 8000;
const PORTS_TRIED: u16 = 100;

/// The given port of `host`, or else the first that is free.
pub(crate) fn bind(host: &str, port: Option<u16>) -> Result<TcpListener> {
    let try_port = |port: u16| TcpListener::bind((host, port));
    if let Some(port) = port {
        return try_port(port).map_err(|error| match error.kind() {
            ErrorKind::AddrInUse => anyhow::anyhow!(
                "port {port} is in use: choose another with --port, or leave it out to take a free one"
            ),
            _ => anyhow::Error::new(error).context(format!("cannot listen on {host}, port {port}")),
        });
    }
    for port in FIRST_PORT..FIRST_PORT + PORTS_TRIED {
        match try_port(port) {
            Ok(listener) => return Ok(listener),
            Err(error) if matches!(error.kind(), ErrorKind::AddrInUse | ErrorKind::PermissionDenied) => {}
            Err(error) => return Err(error).with_context(|| format!("cannot listen on {host}, port {port}")),
        }
    }
    bail!("ports {FIRST_PORT} to {} are all in use: choose another with --port", FIRST_PORT + PORTS_TRIED - 1)
}

/// The address that people on this machine open.
pub(crate) fn url_of(address: SocketAddr, scheme: &str) -> String {
    // Who listens on all addresses is reached on this machine by the usual one.
    let ip = if address.ip().is_unspecified() { "127.0.0.1".to_owned() } else { address.ip().to_string() };
    let host = if ip.contains(':') { format!("[{ip}]") } else { ip };
    format!("{scheme}://{host}:{}/", address.port())
}
