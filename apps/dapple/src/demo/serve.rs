//! A folder over HTTP on this machine.

use std::net::TcpListener;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use axum::Router;
use axum::extract::Request;
use axum::http::{HeaderValue, header};
use axum::middleware::{self, Next};
use axum::response::Response;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{DefaultPredicate, NotForContentType, Predicate};
use tower_http::services::ServeDir;
use tower_http::set_header::SetResponseHeaderLayer;

use crate::listen::url_of;

/// How long requests under way may take once the program is told to stop.
const PATIENCE: Duration = Duration::from_millis(500);

/// Serves `folder` until Ctrl-C, or, with `only_check`, until it has fetched its own page once.
pub(super) fn serve(listener: TcpListener, folder: &Path, only_check: bool) -> Result<()> {
    let address = listener.local_addr().context("the listener has no address")?;
    listener.set_nonblocking(true).context("cannot prepare the listener")?;
    let router = router(folder);
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .context("cannot start the server's threads")?;
    let listener = {
        let _guard = runtime.enter();
        tokio::net::TcpListener::from_std(listener).context("cannot prepare the listener")?
    };
    let server = runtime.spawn(async move { axum::serve(listener, router).await });

    let url = url_of(address, "http");
    if only_check {
        check(&url)?;
        say!("CI is set: {url} answers; it is not served on");
    } else {
        say!("\nthe page: {url}\nCtrl-C ends it");
        runtime.block_on(tokio::signal::ctrl_c()).context("cannot wait for Ctrl-C")?;
        say!("\nended");
    }
    server.abort();
    runtime.shutdown_timeout(PATIENCE);
    Ok(())
}

fn router(folder: &Path) -> Router {
    // Recordings are compressed inside.
    let worth_it = DefaultPredicate::new().and(NotForContentType::const_new("application/octet-stream"));
    Router::new()
        .fallback_service(ServeDir::new(folder))
        .layer(middleware::from_fn(name_types))
        // A page that was built anew must not meet an old program.
        .layer(SetResponseHeaderLayer::overriding(
            header::CACHE_CONTROL,
            HeaderValue::from_static("no-cache"),
        ))
        .layer(CompressionLayer::new().gzip(true).compress_when(worth_it))
}

/// Types that tables of file endings do not have.
async fn name_types(request: Request, next: Next) -> Response {
    let kind = request.uri().path().rsplit_once('.').and_then(|(_, ending)| match ending {
        "dapple" => Some("application/octet-stream"),
        "glb" => Some("model/gltf-binary"),
        "wasm" => Some("application/wasm"),
        _ => None,
    });
    let mut response = next.run(request).await;
    if let Some(kind) = kind.filter(|_| response.status().is_success()) {
        response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(kind));
    }
    response
}

/// Fetches the page as a browser would begin to.
fn check(url: &str) -> Result<()> {
    for name in ["", crate::page::FILE_NAME] {
        let address = format!("{url}{name}");
        let mut response =
            ureq::get(&address).call().with_context(|| format!("{address} does not answer"))?;
        let text = response.body_mut().read_to_string().with_context(|| format!("{address} breaks off"))?;
        if text.is_empty() {
            bail!("{address} is empty");
        }
    }
    Ok(())
}
