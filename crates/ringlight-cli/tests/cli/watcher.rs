//! A page without a screen: takes what the server sends, and says what it is told to.

use std::io::{BufRead, BufReader, Read};
use std::net::TcpStream;
use std::process::Child;
use std::time::Duration;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

/// A page.
pub struct Watcher {
    stream: WebSocket<TcpStream>,
    /// The latest status.
    pub status: serde_json::Value,
    /// Bytes of light so far.
    pub light: usize,
}

/// The address in the link that a command prints on its standard error, and what it says after that.
pub fn address(child: &mut Child) -> (String, impl FnOnce() -> String + use<>) {
    let mut said = BufReader::new(child.stderr.take().expect("standard error is piped"));
    let mut words = String::new();
    let address = loop {
        let mut line = String::new();
        assert!(said.read_line(&mut line).unwrap() > 0, "no link: {words}");
        if let Some(link) = line.trim().strip_prefix("view: http://") {
            break link.trim_end_matches('/').to_owned();
        }
        words.push_str(&line);
    };
    // It must not wait for anyone to read.
    let rest = std::thread::spawn(move || {
        said.read_to_string(&mut words).ok();
        words
    });
    (address, move || rest.join().unwrap())
}

impl Watcher {
    /// Watches what is shown at an address.
    pub fn open(address: &str) -> Watcher {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        let mut request = format!("ws://{address}/stream").into_client_request().unwrap();
        request.headers_mut().insert("origin", format!("http://{address}").parse().unwrap());
        let (stream, _) = tungstenite::client(request, stream).unwrap();
        Watcher { stream, status: serde_json::Value::Null, light: 0 }
    }

    /// Takes a round; false when the server has ended.
    pub fn round(&mut self) -> bool {
        loop {
            match self.stream.read() {
                Ok(Message::Text(text)) => {
                    let text: serde_json::Value = serde_json::from_str(&text).unwrap();
                    if let Some(status) = text.get("status") {
                        self.status = status.clone();
                    }
                }
                Ok(Message::Binary(bytes)) if bytes.is_empty() => return self.say("ready"),
                Ok(Message::Binary(bytes)) => self.light += if bytes[0] == 2 { bytes.len() } else { 0 },
                Ok(_) => {}
                Err(_) => return false,
            }
        }
    }

    /// Says a word; false when the server has ended.
    pub fn say(&mut self, word: &str) -> bool {
        self.stream.send(Message::text(format!("\"{word}\""))).is_ok()
    }

    /// Takes rounds until the phase is this one.
    pub fn wait_for(&mut self, phase: &str) {
        while self.status["phase"] != phase {
            assert!(self.round(), "the server has ended before the phase {phase}");
        }
    }

    /// Takes rounds until so many shots are done.
    pub fn wait_for_shots(&mut self, shots: u64) {
        while self.status["shots"].as_u64().is_none_or(|found| found < shots) {
            assert!(self.round(), "the server has ended before {shots} shots");
        }
    }

    /// Takes all rounds to the end.
    pub fn watch_to_the_end(&mut self) {
        while self.round() {}
    }
}
