//! The server: a thread of its own with the page, the stream of changes and the lit model.

use crate::guard::{Guard, Refusal};
use crate::page;
use crate::protocol::Word;
use crate::stage::{Stage, Watcher};
use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Path, Request, State};
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::io;
use std::net::{SocketAddr, TcpListener, ToSocketAddrs};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::sync::{Notify, Semaphore};
use tokio::time::{sleep, timeout};

/// Most that watch at a time.
pub const MOST_WATCHERS: usize = 16;

/// Most connections at a time; more are closed at once.
const MOST_CONNECTIONS: usize = 64;

/// Most bytes of a message from a page: its longest word takes nine.
const LONGEST_WORD: usize = 64;

/// A request has to be there so long after the last one, or after the connection.
const REQUEST: Duration = Duration::from_secs(5);

/// A page takes a message, and shows what it was sent, by then; else it is given up.
const PATIENCE: Duration = Duration::from_secs(60);

/// When the server ends, pages get the last state until then.
const FAREWELL: Duration = Duration::from_secs(2);

/// What a page may do: only with what this server sends.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:; connect-src 'self'; \
    base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Shows a [`Stage`] in browsers, until it is dropped.
pub struct Server {
    stage: Arc<Stage>,
    link: String,
    end: Arc<Notify>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Clone)]
struct Shared {
    stage: Arc<Stage>,
    guard: Arc<Guard>,
}

impl Server {
    /// Listens at an address: `host:port`. Port 0 takes a free one.
    pub fn open(address: &str) -> io::Result<Server> {
        let found = address.to_socket_addrs()?.next();
        let listener = TcpListener::bind(found.ok_or_else(|| io::Error::other("there is no such address"))?)?;
        listener.set_nonblocking(true)?;
        let bound = listener.local_addr()?;
        let guard = Arc::new(Guard::new(address, bound)?);
        let link = format!("http://{}/{}", reachable(bound), guard.query());
        let (stage, end) = (Arc::new(Stage::default()), Arc::new(Notify::new()));
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
        let (shared, ended) = (Shared { stage: stage.clone(), guard }, end.clone());
        let serve = move || {
            runtime.block_on(async {
                if let Ok(listener) = tokio::net::TcpListener::from_std(listener) {
                    let stage = shared.stage.clone();
                    tokio::spawn(accept(listener, shared));
                    ended.notified().await;
                    let left = async {
                        while stage.watchers() > 0 {
                            sleep(Duration::from_millis(10)).await;
                        }
                    };
                    timeout(FAREWELL, left).await.ok();
                }
            });
        };
        let thread = std::thread::Builder::new().name("view".into()).spawn(serve)?;
        Ok(Server { stage, link, end, thread: Some(thread) })
    }

    /// The link to open.
    pub fn link(&self) -> &str {
        &self.link
    }

    /// What is shown.
    pub fn stage(&self) -> &Arc<Stage> {
        &self.stage
    }
}

impl Drop for Server {
    /// Pages get the last state before they are left alone.
    fn drop(&mut self) {
        self.stage.end();
        self.end.notify_one();
        if let Some(thread) = self.thread.take() {
            thread.join().ok();
        }
    }
}

/// An address that a browser on this machine can open.
fn reachable(bound: SocketAddr) -> SocketAddr {
    match bound {
        SocketAddr::V4(v4) if v4.ip().is_unspecified() => ([127, 0, 0, 1], v4.port()).into(),
        SocketAddr::V6(v6) if v6.ip().is_unspecified() => ([0, 0, 0, 0, 0, 0, 0, 1], v6.port()).into(),
        other => other,
    }
}

/// Takes connections.
async fn accept(listener: tokio::net::TcpListener, shared: Shared) {
    let routes = Router::new()
        .route("/", get(page_file))
        .route("/viewer.js", get(page_file))
        .route("/viewer.css", get(page_file))
        .route("/stream", get(stream))
        .route("/model.glb", get(model))
        .route("/image/{number}", get(image))
        .layer(middleware::from_fn_with_state(shared.clone(), guard))
        .with_state(shared);
    let room = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    loop {
        let Ok((connection, _)) = listener.accept().await else {
            // No more files can be opened, perhaps: later there may be.
            sleep(Duration::from_millis(100)).await;
            continue;
        };
        let Ok(place) = room.clone().try_acquire_owned() else { continue };
        connection.set_nodelay(true).ok();
        let service = TowerToHyperService::new(routes.clone());
        tokio::spawn(async move {
            let mut http = http1::Builder::new();
            http.timer(TokioTimer::new()).header_read_timeout(REQUEST).max_buf_size(16 << 10);
            http.serve_connection(TokioIo::new(connection), service).with_upgrades().await.ok();
            drop(place);
        });
    }
}

/// Looks at every request before anything else does, and adds to every answer what browsers are to keep to.
async fn guard(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    let mut response = match shared.guard.check_host(request.headers()) {
        _ if request.method() != Method::GET => StatusCode::METHOD_NOT_ALLOWED.into_response(),
        Err(refusal) => refused(refusal),
        Ok(()) => next.run(request).await,
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
        (header::HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        (header::HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

fn refused(Refusal(why): Refusal) -> Response {
    (StatusCode::FORBIDDEN, why).into_response()
}

async fn page_file(request: Request) -> Response {
    match page::file(request.uri().path()) {
        Some((bytes, media_type)) => ([(header::CONTENT_TYPE, media_type)], bytes).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

/// Media types of images: no browser takes one of them for a page.
const IMAGES: [&str; 3] = ["image/png", "image/jpeg", "image/webp"];

/// An image of the scene's textures.
async fn image(State(shared): State<Shared>, Path(number): Path<usize>, request: Request) -> Response {
    if let Err(refusal) = shared.guard.check_own(&request) {
        return refused(refusal);
    }
    let image = shared.stage.image(number);
    match image.and_then(|image| Some((*IMAGES.iter().find(|known| **known == image.media_type)?, image.bytes))) {
        Some((media_type, bytes)) => {
            ([(header::CONTENT_TYPE, media_type)], Body::from(Bytes::from_owner(bytes))).into_response()
        }
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

/// The lit model, which the solver makes when it comes to it.
async fn model(State(shared): State<Shared>, request: Request) -> Response {
    if let Err(refusal) = shared.guard.check_own(&request) {
        return refused(refusal);
    }
    // What waits for a model is counted as a watcher is.
    let Some(_watcher) = shared.stage.enter(MOST_WATCHERS) else { return full() };
    match shared.stage.wish().await {
        Ok(Ok(bytes)) => {
            let kind = [(header::CONTENT_TYPE, "model/gltf-binary")];
            (kind, Body::from(bytes)).into_response()
        }
        Ok(Err(why)) => (StatusCode::CONFLICT, why).into_response(),
        Err(_) => StatusCode::SERVICE_UNAVAILABLE.into_response(),
    }
}

fn full() -> Response {
    (StatusCode::SERVICE_UNAVAILABLE, "as many watch as may").into_response()
}

async fn stream(State(shared): State<Shared>, upgrade: WebSocketUpgrade, request: Request) -> Response {
    let origin = shared.guard.check_origin(request.headers(), true);
    if let Err(refusal) = origin.and(shared.guard.check_secret(request.uri().query())) {
        return refused(refusal);
    }
    let Some(watcher) = shared.stage.enter(MOST_WATCHERS) else { return full() };
    let upgrade = upgrade.max_message_size(LONGEST_WORD).max_frame_size(LONGEST_WORD);
    upgrade.on_upgrade(move |socket| async move {
        // Whoever breaks the rules, or goes away, is let go.
        watch(socket, &shared.stage, watcher).await;
    })
}

/// Sends what has changed, and hears what the page says, until either ends. Nothing is sent before the page has shown what
/// it was sent before.
async fn watch(mut socket: WebSocket, stage: &Stage, _watcher: Watcher) -> Option<()> {
    let mut changes = stage.changes();
    let mut sent = 0;
    loop {
        changes.borrow_and_update();
        let last = stage.ended();
        let news = stage.news(sent);
        sent = news.change;
        let texts = news.texts.into_iter().map(|text| Message::Text(text.into()));
        let records = news.records.into_iter().map(Message::Binary);
        for message in texts.chain(records).chain([Message::Binary(Bytes::new())]) {
            timeout(PATIENCE, socket.send(message)).await.ok()?.ok()?;
        }
        while timeout(PATIENCE, hear(&mut socket, stage)).await.ok()?? != Word::Ready {}
        if last {
            socket.send(Message::Close(None)).await.ok();
            return None;
        }
        // Until there is news, the page may say something, or go away.
        loop {
            let changed = std::pin::pin!(changes.changed());
            let heard = std::pin::pin!(hear(&mut socket, stage));
            match first(changed, heard).await {
                First::One(changed) => {
                    changed.ok()?;
                    break;
                }
                First::Other(word) => word.map(|_| ())?,
            }
        }
    }
}

/// The next word of a page, which is heeded; none if it says anything else or goes away.
async fn hear(socket: &mut WebSocket, stage: &Stage) -> Option<Word> {
    loop {
        let word = match socket.recv().await?.ok()? {
            Message::Text(text) => serde_json::from_str(&text).ok()?,
            Message::Ping(_) | Message::Pong(_) => continue,
            Message::Binary(_) | Message::Close(_) => return None,
        };
        match word {
            Word::Ready => {}
            Word::Pause => stage.pause(true),
            Word::Resume => stage.pause(false),
            Word::Stop => stage.stop(),
        }
        return Some(word);
    }
}

/// What of two was there first.
enum First<A, B> {
    One(A),
    Other(B),
}

/// Waits for the first of two; the other is dropped, which loses nothing of either.
async fn first<A: Future + Unpin, B: Future + Unpin>(mut one: A, mut other: B) -> First<A::Output, B::Output> {
    use std::pin::Pin;
    use std::task::Poll;
    std::future::poll_fn(|context| match Pin::new(&mut one).poll(context) {
        Poll::Ready(value) => Poll::Ready(First::One(value)),
        Poll::Pending => Pin::new(&mut other).poll(context).map(First::Other),
    })
    .await
}
