//! A narrow link: a TCP relay that lets so many bytes a second through, later.

use std::time::Duration;

use anyhow::{Context, Result};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;
use tokio::time::Instant;

/// Bytes that are passed on at once.
const PIECE_BYTES: usize = 4 << 10;

/// Pieces that the link holds on their way at most: it pushes back, as a narrow link does.
const ON_ITS_WAY: usize = 64;

/// Relays connections to `target`, one way each with half of the delay; gives its own address. Ends with the runtime.
pub(crate) async fn start(target: String, bytes_per_s: f64, round_trip: Duration) -> Result<String> {
    let listener = TcpListener::bind("127.0.0.1:0").await.context("cannot listen for the narrow link")?;
    let address = listener.local_addr().context("the narrow link has no address")?;
    tokio::spawn(async move {
        while let Ok((near, _)) = listener.accept().await {
            let target = target.clone();
            tokio::spawn(async move {
                let Ok(far) = TcpStream::connect(&target).await else { return };
                let _ = (near.set_nodelay(true), far.set_nodelay(true));
                let (near_in, near_out) = near.into_split();
                let (far_in, far_out) = far.into_split();
                let way = round_trip / 2;
                tokio::join!(
                    pass(far_in, near_out, Some(bytes_per_s), way),
                    pass(near_in, far_out, None, way)
                );
            });
        }
    });
    Ok(address.to_string())
}

async fn pass(
    mut from: tokio::net::tcp::OwnedReadHalf,
    mut to: tokio::net::tcp::OwnedWriteHalf,
    bytes_per_s: Option<f64>,
    way: Duration,
) {
    let (sender, mut receiver) = mpsc::channel::<(Instant, Vec<u8>)>(ON_ITS_WAY);
    let read = async move {
        let mut free = Instant::now();
        loop {
            let mut piece = vec![0; PIECE_BYTES];
            let Ok(length @ 1..) = from.read(&mut piece).await else { return };
            piece.truncate(length);
            if let Some(rate) = bytes_per_s {
                free = free.max(Instant::now()) + Duration::from_secs_f64(length as f64 / rate);
                tokio::time::sleep_until(free).await;
            }
            if sender.send((Instant::now() + way, piece)).await.is_err() {
                return;
            }
        }
    };
    let write = async move {
        while let Some((due, piece)) = receiver.recv().await {
            tokio::time::sleep_until(due).await;
            if to.write_all(&piece).await.is_err() {
                return;
            }
        }
        let _ = to.shutdown().await;
    };
    tokio::join!(read, write);
}
