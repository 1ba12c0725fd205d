//! What must not get in: every way is tried on a server that goes on serving its own page meanwhile.

use ringlight_view::protocol::{Hello, Status};
use ringlight_view::{Image, MOST_WATCHERS, Server};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;
use tungstenite::client::IntoClientRequest;
use tungstenite::handshake::client::Response;
use tungstenite::{Error, Message, WebSocket};

struct Site {
    server: Server,
    address: SocketAddr,
}

type Stream = WebSocket<TcpStream>;

impl Site {
    fn open() -> Site {
        let server = Server::open("127.0.0.1:0").unwrap();
        server.stage().begin(&Hello::default(), Vec::new(), vec![vec![1; 32], vec![2; 32]]);
        server.stage().status(&Status::default());
        let address = server.link().trim_start_matches("http://").trim_end_matches('/').parse().unwrap();
        Site { server, address }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        stream
    }

    /// The answer to a request made of these bytes.
    fn raw(&self, request: &[u8]) -> String {
        let mut stream = self.connect();
        stream.write_all(request).ok();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).ok();
        String::from_utf8_lossy(&answer).into_owned()
    }

    fn get(&self, path: &str, headers: &str) -> String {
        self.raw(format!("GET {path} HTTP/1.1\r\nConnection: close\r\n{headers}\r\n").as_bytes())
    }

    fn host(&self) -> String {
        format!("Host: {}\r\n", self.address)
    }

    /// Opens the stream as a page of `origin` would.
    fn stream(&self, host: &str, origin: Option<&str>) -> Result<(Stream, Response), Error> {
        let mut request = format!("ws://{}/stream", self.address).into_client_request().unwrap();
        request.headers_mut().insert("host", host.parse().unwrap());
        if let Some(origin) = origin {
            request.headers_mut().insert("origin", origin.parse().unwrap());
        }
        tungstenite::client(request, self.connect()).map_err(|error| match error {
            tungstenite::HandshakeError::Failure(error) => error,
            tungstenite::HandshakeError::Interrupted(_) => Error::ConnectionClosed,
        })
    }

    fn own_stream(&self) -> Result<Stream, Error> {
        let host = self.address.to_string();
        Ok(self.stream(&host, Some(&format!("http://{host}")))?.0)
    }

    /// Whether the own page still gets all it needs.
    fn serves(&self) -> bool {
        let page = self.get("/", &self.host());
        let mut stream = self.own_stream().unwrap();
        page.starts_with("HTTP/1.1 200") && round(&mut stream).is_ok_and(|messages| messages == 4)
    }
}

/// Takes a round; the number of its messages before the empty one.
fn round(stream: &mut Stream) -> Result<usize, Error> {
    let mut count = 0;
    loop {
        match stream.read()? {
            Message::Binary(bytes) if bytes.is_empty() => break,
            Message::Close(_) => return Err(Error::ConnectionClosed),
            _ => count += 1,
        }
    }
    stream.send(Message::text("\"ready\""))?;
    Ok(count)
}

fn status_of(error: Error) -> u16 {
    match error {
        Error::Http(response) => response.status().as_u16(),
        other => panic!("no answer: {other}"),
    }
}

#[test]
fn other_sites_are_refused() {
    let site = Site::open();
    let host = site.address.to_string();
    let near = format!("http://127.0.0.1:{}", site.address.port() ^ 1);
    for origin in [None, Some("http://evil.example"), Some("null"), Some("https://evil.example"), Some(near.as_str())] {
        assert_eq!(status_of(site.stream(&host, origin).unwrap_err()), 403, "{origin:?}");
    }
    for host in ["evil.example", "evil.example:80", "127.0.0.1.evil.example"] {
        assert_eq!(status_of(site.stream(host, Some(&format!("http://{host}"))).unwrap_err()), 403, "{host}");
        assert!(site.get("/", &format!("Host: {host}\r\n")).starts_with("HTTP/1.1 403"));
    }
    let cross = format!("{}Origin: http://evil.example\r\n", site.host());
    assert!(site.get("/model.glb", &cross).starts_with("HTTP/1.1 403"));
    assert!(site.serves());
}

#[test]
fn nothing_but_the_page_is_served() {
    let site = Site::open();
    for path in [
        "/../../etc/passwd",
        "/..%2f..%2fetc%2fpasswd",
        "//etc/passwd",
        "/viewer.js/../../Cargo.toml",
        "/%2e%2e/Cargo.toml",
        "/..\\..\\Cargo.toml",
        "/Cargo.toml",
        "/.gitignore",
        "/index.html%00.js",
        "/src/main.ts",
        "/image/0",
        "/image/-1",
        "/image/../Cargo.toml",
        "/image/99999999999999999999",
    ] {
        let answer = site.get(path, &site.host());
        assert!(answer.starts_with("HTTP/1.1 40"), "{path}: {answer}");
        assert!(!answer.contains("root:") && !answer.contains("[package]"), "{path}: {answer}");
    }
    for method in ["POST", "PUT", "DELETE", "CONNECT", "TRACE", "BREW"] {
        let answer = site.raw(format!("{method} / HTTP/1.1\r\nConnection: close\r\n{}\r\n", site.host()).as_bytes());
        assert!(answer.starts_with("HTTP/1.1 40"), "{method}: {answer}");
    }
    let page = site.get("/", &site.host());
    for rule in ["default-src 'none'", "frame-ancestors 'none'", "nosniff", "no-referrer", "same-origin"] {
        assert!(page.contains(rule), "{rule}: {page}");
    }
    assert!(!page.to_lowercase().contains("access-control-allow"));
    assert!(site.serves());
}

#[test]
fn images_are_served_as_images_only() {
    let site = Site::open();
    let image = |media_type: &str| {
        let bytes = ringlight::resources::Bytes::new(b"<script>alert(1)</script>".to_vec());
        Some(Image { media_type: media_type.into(), bytes })
    };
    let images = vec![image("image/png"), image("text/html"), image("image/svg+xml"), None];
    site.server.stage().begin(&Hello::default(), images, Vec::new());
    let answer = site.get("/image/0", &site.host());
    assert!(answer.starts_with("HTTP/1.1 200") && answer.contains("content-type: image/png\r\n"), "{answer}");
    for number in 1..5 {
        assert!(site.get(&format!("/image/{number}"), &site.host()).starts_with("HTTP/1.1 404"));
    }
    let cross = format!("{}Origin: http://evil.example\r\n", site.host());
    assert!(site.get("/image/0", &cross).starts_with("HTTP/1.1 403"));
}

#[test]
fn a_server_that_others_can_reach_wants_its_token() {
    let server = Server::open("0.0.0.0:0").unwrap();
    server.stage().begin(&Hello::default(), Vec::new(), Vec::new());
    let link = server.link().to_owned();
    let (address, query) = link.trim_start_matches("http://").split_once("/?").unwrap();
    let ask = |path: &str| {
        let mut stream = TcpStream::connect(address).unwrap();
        let origin = format!("Origin: http://{address}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n");
        let key = "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\n{origin}{key}\r\n").unwrap();
        let mut answer = [0; 12];
        stream.read_exact(&mut answer).unwrap();
        String::from_utf8_lossy(&answer).into_owned()
    };
    assert_eq!(ask(&format!("/stream?{query}")), "HTTP/1.1 101");
    for wrong in ["/stream", "/stream?token=", "/stream?token=0", "/model.glb", "/model.glb?token=x", "/image/0"] {
        assert_eq!(ask(wrong), "HTTP/1.1 403", "{wrong}");
    }
    let almost = format!("/stream?{}0", &query[..query.len() - 1]);
    assert!(ask(&almost) == "HTTP/1.1 403" || query.ends_with('0'));
}

#[test]
fn nonsense_ends_a_connection_and_nothing_else() {
    let site = Site::open();
    let nonsense: [Message; 7] = [
        Message::text("pause"),
        Message::text("{\"pause\":true}"),
        Message::text("\"format the disk\""),
        Message::text("\"ready\"".repeat(1000)),
        Message::binary(vec![0; 10]),
        Message::binary(vec![0xff; 1 << 20]),
        Message::text(format!("\"{}\"", "x".repeat(60))),
    ];
    for message in nonsense {
        let mut stream = site.own_stream().unwrap();
        round(&mut stream).unwrap();
        let words = format!("{message:.40?}");
        stream.send(message).ok();
        let ended = std::iter::from_fn(|| Some(stream.read())).take(20).any(|read| match read {
            Ok(Message::Close(_)) | Err(_) => true,
            Ok(_) => false,
        });
        assert!(ended, "{words}");
        assert!(!site.server.stage().paused() && !site.server.stage().stopped(), "{words}");
    }
    // Bytes that are no frames, and no requests.
    let mut stream = site.own_stream().unwrap();
    stream.get_mut().write_all(&[0xff; 4096]).ok();
    assert!(std::iter::from_fn(|| Some(stream.read())).take(20).any(|read| read.is_err()));
    let long = format!("GET / HTTP/1.1\r\nConnection: close\r\nX: {}\r\n\r\n", "x".repeat(1 << 20));
    for request in [&b"\x16\x03\x01\x02\x00\x01\x00"[..], b"\0\0\0\0\r\n\r\n", long.as_bytes()] {
        let answer = site.raw(request);
        assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 4"), "{answer}");
    }
    assert!(site.serves());
}

#[test]
fn what_a_page_says_is_heard() {
    let site = Site::open();
    let mut stream = site.own_stream().unwrap();
    round(&mut stream).unwrap();
    let hears = |stream: &mut Stream, word: &str, heard: &dyn Fn() -> bool| {
        stream.send(Message::text(word)).unwrap();
        (0..500).any(|_| {
            std::thread::sleep(Duration::from_millis(10));
            heard()
        })
    };
    let stage = site.server.stage();
    assert!(hears(&mut stream, "\"pause\"", &|| stage.paused()));
    assert!(hears(&mut stream, "\"resume\"", &|| !stage.paused()));
    assert!(hears(&mut stream, "\"stop\"", &|| stage.stopped()));
    // Only what has changed comes next.
    stage.light(vec![(1, vec![3; 8])]);
    assert_eq!(round(&mut stream).unwrap(), 1);
}

#[test]
fn thousands_of_connections_are_let_go() {
    let site = Site::open();
    let mut held = Vec::new();
    for k in 0..3000 {
        let Ok(mut stream) = TcpStream::connect(site.address) else { continue };
        if k % 2 == 0 {
            stream.write_all(b"GET / HTTP/1.1\r\nHost: local").ok();
        }
        held.push(stream);
        if held.len() > 500 {
            held.remove(0);
        }
    }
    // Those that say nothing are let go after a while, those that stay away at once.
    drop(held.split_off(held.len() / 2));
    let serves = (0..40).any(|_| {
        std::thread::sleep(Duration::from_millis(250));
        site.get("/", &site.host()).starts_with("HTTP/1.1 200")
    });
    assert!(serves);
    drop(held);
}

#[test]
fn no_more_watch_than_may() {
    let site = Site::open();
    let watchers: Vec<Stream> = (0..MOST_WATCHERS).map(|_| site.own_stream().unwrap()).collect();
    assert_eq!(status_of(site.own_stream().unwrap_err()), 503);
    drop(watchers);
    let again = (0..100).any(|_| {
        std::thread::sleep(Duration::from_millis(50));
        site.own_stream().is_ok()
    });
    assert!(again);
}

#[test]
fn pages_get_the_last_state_before_the_server_ends() {
    let site = Site::open();
    let mut stream = site.own_stream().unwrap();
    round(&mut stream).unwrap();
    let address = site.address;
    site.server.stage().status(&Status { shots: 77, ..Status::default() });
    let ended = std::thread::spawn(move || drop(site));
    let mut last = String::new();
    loop {
        match stream.read() {
            Ok(Message::Text(text)) => last = text.to_string(),
            Ok(Message::Binary(_)) => stream.send(Message::text("\"ready\"")).unwrap(),
            Ok(_) => {}
            Err(_) => break,
        }
    }
    ended.join().unwrap();
    assert!(last.contains("\"shots\":77"), "{last}");
    assert!(TcpStream::connect(address).is_err());
}
