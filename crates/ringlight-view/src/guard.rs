//! Who may speak to the server: what browsers send by themselves is enough to keep other sites out.
//!
//! A page of another site that a user looks at may try to reach the server on this machine. Its requests carry its own
//! `Origin` (cross-site), or, if it has made its own name point to this machine, that name as `Host` (rebinding). Both
//! are refused. A server that others can reach wants a secret of its link, too.

use axum::extract::Request;
use axum::http::{HeaderMap, header};
use std::net::{IpAddr, SocketAddr};

/// Bytes of a secret; written in hexadecimal digits.
const SECRET: usize = 16;

/// What a request has to show.
#[derive(Clone, Debug)]
pub struct Guard {
    /// Name under which the server may be called, besides `localhost` and numbers.
    name: Option<String>,
    secret: Option<String>,
}

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal(pub &'static str);

impl Guard {
    /// Of a server that was asked to listen at `name` and listens at `address`: one that others can reach has a secret.
    pub fn new(name: &str, address: SocketAddr) -> std::io::Result<Guard> {
        let name = host_name(name).to_ascii_lowercase();
        let secret = if address.ip().is_loopback() { None } else { Some(random()?) };
        Ok(Guard { name: (!name.is_empty()).then_some(name), secret })
    }

    /// The part of the link that holds the secret.
    pub fn query(&self) -> String {
        self.secret.as_ref().map_or(String::new(), |secret| format!("?token={secret}"))
    }

    /// Whether a request was sent to this server by its name, and not by a name that someone else gave it.
    pub fn check_host(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let host = only(headers, header::HOST).ok_or(Refusal("a request needs one Host"))?;
        let name = host_name(host).to_ascii_lowercase();
        let number = name.trim_matches(['[', ']']).parse::<IpAddr>().is_ok();
        let known = number || name == "localhost" || self.name.as_deref() == Some(&name);
        if known { Ok(()) } else { Err(Refusal("this server is not known under that Host")) }
    }

    /// Whether a request comes from this server's own page. Browsers leave `Origin` out where they get a file of the
    /// same site; `required` is for what they never leave it out of.
    pub fn check_origin(&self, headers: &HeaderMap, required: bool) -> Result<(), Refusal> {
        let own = only(headers, header::HOST).map(|host| format!("http://{host}"));
        match headers.get_all(header::ORIGIN).iter().collect::<Vec<_>>()[..] {
            [] if !required => Ok(()),
            [origin] if own.is_some_and(|own| own.as_bytes().eq_ignore_ascii_case(origin.as_bytes())) => Ok(()),
            _ => Err(Refusal("only this server's own page may ask for that")),
        }
    }

    /// Whether the query holds the secret, if there is one.
    pub fn check_secret(&self, query: Option<&str>) -> Result<(), Refusal> {
        let Some(secret) = &self.secret else { return Ok(()) };
        let given = query.and_then(|query| query.split('&').find_map(|pair| pair.strip_prefix("token=")));
        // All of it is compared, so that the time tells nothing about where it differs.
        let given = given.unwrap_or_default().as_bytes();
        let differs = secret.bytes().zip(given).fold(0, |differs, (a, b)| differs | (a ^ b));
        let same = given.len() == secret.len() && differs == 0;
        if same { Ok(()) } else { Err(Refusal("the link's token is missing or wrong")) }
    }

    /// Whether a request for a file comes from the page, with the secret.
    pub fn check_own(&self, request: &Request) -> Result<(), Refusal> {
        self.check_origin(request.headers(), false)?;
        self.check_secret(request.uri().query())
    }
}

/// The value of a header that is there once.
fn only(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    let mut values = headers.get_all(name).iter();
    let first = values.next()?.to_str().ok()?;
    values.next().is_none().then_some(first)
}

/// `name:port` or `[number]:port` without the port.
fn host_name(host: &str) -> &str {
    match host.rsplit_once(':') {
        Some((name, port))
            if port.bytes().all(|c| c.is_ascii_digit()) && (!name.contains(':') || name.ends_with(']')) =>
        {
            name
        }
        _ => host,
    }
}

fn random() -> std::io::Result<String> {
    let mut bytes = [0; SECRET];
    getrandom::fill(&mut bytes).map_err(std::io::Error::other)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::{HeaderName, HeaderValue};

    fn headers(pairs: &[(&'static str, &'static str)]) -> HeaderMap {
        pairs.iter().map(|&(name, value)| (HeaderName::from_static(name), HeaderValue::from_static(value))).collect()
    }

    fn guard(name: &str, address: &str) -> Guard {
        Guard::new(name, address.parse().unwrap()).unwrap()
    }

    #[test]
    fn only_names_that_nobody_else_can_give_are_hosts() {
        let guard = guard("lab.example:80", "10.0.0.2:80");
        for host in ["localhost", "localhost:9", "127.0.0.1:80", "[::1]:80", "10.0.0.2", "Lab.Example:80"] {
            assert!(guard.check_host(&headers(&[("host", host)])).is_ok(), "{host}");
        }
        for host in ["evil.example", "localhost.evil.example", "127.0.0.1.evil.example:80", "", "lab.example.:80"] {
            assert!(guard.check_host(&headers(&[("host", host)])).is_err(), "{host}");
        }
        assert!(guard.check_host(&headers(&[])).is_err());
        let mut twice = headers(&[("host", "localhost")]);
        twice.append("host", HeaderValue::from_static("localhost"));
        assert!(guard.check_host(&twice).is_err());
    }

    #[test]
    fn only_the_own_page_is_an_origin() {
        let guard = guard("127.0.0.1:0", "127.0.0.1:80");
        let check = |origin, required| {
            guard.check_origin(&headers(&[("host", "127.0.0.1:80"), ("origin", origin)]), required).is_ok()
        };
        assert!(check("http://127.0.0.1:80", true));
        for origin in
            ["http://evil.example", "null", "http://127.0.0.1:81", "https://127.0.0.1:80", "http://localhost:80"]
        {
            assert!(!check(origin, true) && !check(origin, false), "{origin}");
        }
        let without = headers(&[("host", "127.0.0.1:80")]);
        assert!(guard.check_origin(&without, false).is_ok() && guard.check_origin(&without, true).is_err());
    }

    #[test]
    fn a_server_that_others_can_reach_wants_its_secret() {
        assert!(guard("127.0.0.1:0", "127.0.0.1:80").check_secret(None).is_ok());
        let (guard, other) = (guard("0.0.0.0:80", "0.0.0.0:80"), guard("0.0.0.0:80", "0.0.0.0:80"));
        let query = guard.query();
        assert!(query.len() == 7 + 2 * SECRET && query != other.query());
        assert!(guard.check_secret(query.strip_prefix('?')).is_ok());
        assert!(guard.check_secret(Some(&format!("a=b&{}", &query[1..]))).is_ok());
        for wrong in [None, Some("token="), Some(&query[1..query.len() - 1]), other.query().strip_prefix('?')] {
            assert!(guard.check_secret(wrong).is_err(), "{wrong:?}");
        }
    }
}
