//! What the server answers over HTTP: the page, the scene, figures, and the door to the live session.

use std::path::PathBuf;
use std::sync::Arc;

use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::get;
use axum::{Extension, Router};
use dapple_session::{MAX_FROM_VIEWER_BYTES, MAX_LIGHT_MESSAGE_BYTES};
use serde_json::json;
use tower_http::compression::CompressionLayer;
use tower_http::services::ServeDir;
use tower_http::set_header::SetResponseHeaderLayer;

use super::accept::Permit;
use super::asset::Asset;
use super::hub::{Phase, SharedHub, Whence};
use super::viewer::talk;
use super::work::{self, WorkHub};
use crate::page::{FILE_NAME, HOST, MoqJson, Spares, ViewerJson};
use crate::transport::ws;

/// Where viewers connect to.
pub(crate) const LIVE_PATH: &str = "live";

/// Where workers connect to.
pub(crate) const WORK_PATH: &str = "work";

/// Where the page's scene lies.
const SCENE_FOLDER: &str = "scene";

#[derive(Clone)]
struct Shared {
    hub: SharedHub,
    asset: Arc<Asset>,
    work: Option<Arc<WorkHub>>,
    viewer_json: ViewerJsons,
}

/// What a page's viewer.json says.
#[derive(Clone)]
struct ViewerJsons {
    /// To pages of other hosts.
    open: Arc<str>,
    /// To its own, and to programs: the name of a session over MoQ is all that keeps others from changing the scene where there are no tokens.
    own: Arc<str>,
}

/// Everything that is served; `radius_m` is that of its light, `page` is the built page's folder, where there is one.
pub(crate) fn router(
    hub: SharedHub,
    asset: Arc<Asset>,
    work: Option<Arc<WorkHub>>,
    page: Option<PathBuf>,
    moq: Option<MoqJson>,
    radius_m: f32,
) -> Router {
    let json = ViewerJson {
        scene: format!("{SCENE_FOLDER}/{}", asset.name),
        stream: None,
        live: Some(LIVE_PATH.to_owned()),
        moq: None,
        radius: Some(radius_m),
        animation: asset.scene.active_animation.filter(|index| *index != 0),
        spares: asset
            .spares
            .iter()
            .map(|spare| Spares { instance: spare.instance, count: spare.count })
            .collect(),
    };
    let text = |json| serde_json::to_string_pretty(json).expect("it is made of names and numbers").into();
    let (open, own) = (text(&json), text(&ViewerJson { moq, ..json.clone() }));
    let shared = Shared { hub, asset, work, viewer_json: ViewerJsons { open, own } };
    // Anyone may show the scene in a page of theirs; who may change it is a matter of tokens.
    let open = SetResponseHeaderLayer::overriding(
        header::ACCESS_CONTROL_ALLOW_ORIGIN,
        HeaderValue::from_static("*"),
    );
    let router = Router::new();
    let router = if page.is_none() { router.route("/", get(no_page_answer)) } else { router };
    let router = router
        .route(&format!("/{FILE_NAME}"), get(viewer_json_answer))
        .route(&format!("/{SCENE_FOLDER}/{{name}}"), get(scene_answer))
        .route(&format!("/{LIVE_PATH}"), get(live_answer))
        .route(&format!("/{WORK_PATH}"), get(work_answer))
        .route("/health", get(health_answer))
        .route("/metrics", get(metrics_answer))
        .with_state(shared)
        .layer(open);
    match page {
        Some(folder) => {
            let files = Router::new()
                .fallback_service(ServeDir::new(folder))
                // A page that was built anew must not meet an old program.
                .layer(SetResponseHeaderLayer::overriding(
                    header::CACHE_CONTROL,
                    HeaderValue::from_static("no-cache"),
                ))
                .layer(CompressionLayer::new().gzip(true));
            router.fallback_service(files)
        }
        None => router,
    }
}

async fn viewer_json_answer(State(shared): State<Shared>, asked: HeaderMap) -> Response {
    let headers = [
        (header::CONTENT_TYPE, "application/json"),
        (header::CACHE_CONTROL, "no-cache"),
        (header::VARY, "origin"),
    ];
    let ViewerJsons { open, own } = &shared.viewer_json;
    if is_foreign(&asked) {
        return (headers, open.to_string()).into_response();
    }
    (headers, own.replace(HOST, &host_name(&asked))).into_response()
}

/// The scene under the name of its content: who has it need never ask again.
async fn scene_answer(State(shared): State<Shared>, Path(name): Path<String>, asked: HeaderMap) -> Response {
    let asset = &shared.asset;
    if name != asset.name {
        let message = "this is not the scene that is lit here now: reload the page\n";
        return (StatusCode::NOT_FOUND, message).into_response();
    }
    let takes_gzip = asked
        .get(header::ACCEPT_ENCODING)
        .and_then(|value| value.to_str().ok())
        .is_some_and(|value| value.split(',').any(|coding| coding.trim().starts_with("gzip")));
    let mut headers = HeaderMap::new();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("model/gltf-binary"));
    headers.insert(header::VARY, HeaderValue::from_static("accept-encoding"));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("public, max-age=31536000, immutable"));
    match asset.gzip.clone().filter(|_| takes_gzip) {
        Some(packed) => {
            headers.insert(header::CONTENT_ENCODING, HeaderValue::from_static("gzip"));
            (headers, packed).into_response()
        }
        None => (headers, asset.plain.clone()).into_response(),
    }
}

/// Whether a page of another host asks: browsers name it, and nobody else does.
fn is_foreign(headers: &HeaderMap) -> bool {
    let Some(origin) = headers.get(header::ORIGIN) else { return false };
    let host = headers.get(header::HOST).map(HeaderValue::as_bytes).unwrap_or_default();
    let origin = origin.as_bytes();
    let own = origin.strip_prefix(b"http://").or(origin.strip_prefix(b"https://"));
    own != Some(host)
}

/// The name under which this server was reached, without a port.
fn host_name(headers: &HeaderMap) -> String {
    let host = headers.get(header::HOST).and_then(|host| host.to_str().ok()).unwrap_or_default();
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let is_good = |byte: u8| byte.is_ascii_alphanumeric() || b".-:[]".contains(&byte);
    if name.is_empty() || !name.bytes().all(is_good) { "127.0.0.1".to_owned() } else { name.to_owned() }
}

async fn live_answer(
    State(shared): State<Shared>,
    Extension(permit): Extension<Permit>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    let is_foreign = is_foreign(&headers);
    upgrade
        .max_message_size(MAX_FROM_VIEWER_BYTES)
        .max_frame_size(MAX_FROM_VIEWER_BYTES)
        // What cannot be sent waits in the host, where newer light takes its place.
        .write_buffer_size(0)
        .max_write_buffer_size(1 << 20)
        .on_upgrade(async move |socket| {
            let (out, inbound) = ws::accepted(socket);
            talk(shared.hub, out, inbound, Whence { is_foreign, shares: false }).await;
            drop(permit);
        })
}

async fn work_answer(
    State(shared): State<Shared>,
    Extension(permit): Extension<Permit>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if headers.contains_key(header::ORIGIN) {
        return (StatusCode::FORBIDDEN, "workers are programs, not pages\n").into_response();
    }
    let Some(hub) = shared.work else {
        let message = "this server traces by itself: start it with --workers to have others trace\n";
        return (StatusCode::NOT_FOUND, message).into_response();
    };
    upgrade.max_message_size(MAX_LIGHT_MESSAGE_BYTES).max_frame_size(MAX_LIGHT_MESSAGE_BYTES).on_upgrade(
        async move |socket| {
            let (out, inbound) = ws::accepted(socket);
            work::talk(hub, out, inbound).await;
            drop(permit);
        },
    )
}

async fn health_answer(State(shared): State<Shared>) -> Response {
    let phase = shared.hub.phase();
    let (status, name, detail) = match &phase {
        Phase::Starting(what, mille) => {
            (StatusCode::OK, "starting", format!("{what}, {:.0} %", f64::from(*mille) / 10.0))
        }
        Phase::Serving => (StatusCode::OK, "serving", String::new()),
        Phase::Draining => (StatusCode::SERVICE_UNAVAILABLE, "draining", String::new()),
        Phase::Failed(reason) => (StatusCode::SERVICE_UNAVAILABLE, "failed", reason.clone()),
    };
    let ready = phase == Phase::Serving;
    let body = json!({
        "status": name, "ready": ready, "detail": detail, "scene": shared.asset.scene.name,
        "version": env!("CARGO_PKG_VERSION"),
    });
    let headers = [(header::CONTENT_TYPE, "application/json"), (header::CACHE_CONTROL, "no-store")];
    (status, headers, format!("{body}\n")).into_response()
}

async fn metrics_answer(State(shared): State<Shared>) -> Response {
    let counts = shared.hub.host().counts();
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    ([(header::CONTENT_TYPE, kind), (header::CACHE_CONTROL, "no-store")], shared.hub.figures.text(&counts))
        .into_response()
}

async fn no_page_answer(State(shared): State<Shared>, headers: HeaderMap) -> Html<String> {
    let host = headers.get(header::HOST).and_then(|host| host.to_str().ok()).unwrap_or("this host");
    let escape = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;");
    Html(format!(
        "<!doctype html><title>Dapple</title><h1>{} is lit here</h1><p>The page that shows it has not been built: run \
         <code>cargo xtask wasm</code> and start again, or name its folder with <code>--page</code>.<p>Without it: \
         <code>dapple view --url http://{}/</code>",
        escape(&shared.asset.scene.name),
        escape(host)
    ))
}
