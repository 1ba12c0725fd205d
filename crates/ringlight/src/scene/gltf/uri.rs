//! URIs of buffers and images: embedded data, or a path that stays in the scene's folder.

/// What a URI names.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// Embedded bytes and their media type.
    Data {
        /// Media type, may be empty.
        media_type: String,
        /// The decoded bytes.
        bytes: Vec<u8>,
    },
    /// A path relative to the scene file.
    Path(String),
}

/// A URI that cannot be used: what was found and what was expected.
pub(super) type Refusal = (String, &'static str);

/// Splits a URI by kind. Schemes other than `data:`, absolute paths and paths that leave the scene's folder are refused.
pub(super) fn parse(uri: &str) -> Result<Target, Refusal> {
    if let Some(rest) = strip_prefix_ignore_case(uri, "data:") {
        return data(rest);
    }
    let shown = shorten(uri);
    if scheme(uri).is_some() {
        return Err((format!("URI {shown:?}"), "a path relative to the scene file; nothing is fetched from elsewhere"));
    }
    let path = String::from_utf8(percent_decode(uri.as_bytes()))
        .map_err(|_| (format!("URI {shown:?}"), "a path whose percent-escapes are UTF-8"))?;
    let leaves = path.starts_with(['/', '\\'])
        || scheme(&path).is_some()
        || path.split(['/', '\\']).any(|part| part == "..")
        || path.contains('\0');
    if leaves {
        return Err((format!("URI {shown:?}"), "a path inside the scene's folder"));
    }
    let parts: Vec<&str> = path.split('/').filter(|part| !part.is_empty() && *part != ".").collect();
    if parts.is_empty() {
        return Err((format!("URI {shown:?}"), "the path of a file"));
    }
    Ok(Target::Path(parts.join("/")))
}

/// The scheme of a URI (RFC 3986, section 3.1), which a drive letter also looks like.
fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let mut letters = scheme.chars();
    let first_is_letter = letters.next().is_some_and(|c| c.is_ascii_alphabetic());
    let rest_allowed = letters.all(|c| c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.'));
    (first_is_letter && rest_allowed).then_some(scheme)
}

/// A `data:` URI (RFC 2397) after its scheme.
fn data(rest: &str) -> Result<Target, Refusal> {
    let Some((header, body)) = rest.split_once(',') else {
        return Err((format!("URI \"data:{}\"", shorten(rest)), "a comma before the data"));
    };
    let base64_header = header.rsplit_once(';').filter(|(_, last)| last.trim().eq_ignore_ascii_case("base64"));
    let (parameters, bytes) = match base64_header {
        Some((parameters, _)) => {
            let bytes = base64(body.as_bytes()).ok_or_else(|| {
                (format!("URI \"data:{}\"", shorten(rest)), "base64: letters, digits and + / (or - _)")
            })?;
            (parameters, bytes)
        }
        None => (header, percent_decode(body.as_bytes())),
    };
    let media_type = parameters.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    Ok(Target::Data { media_type, bytes })
}

/// Base64 in any of its forms: standard or URL alphabet, padded or not, with white space or percent-escapes in between.
fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let unescaped;
    let text = if text.contains(&b'%') {
        unescaped = percent_decode(text);
        &unescaped
    } else {
        text
    };
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 3);
    let mut bits = 0_u32;
    let mut bit_count = 0;
    let mut padded = false;
    for &letter in text {
        let value = match letter {
            b'A'..=b'Z' => letter - b'A',
            b'a'..=b'z' => letter - b'a' + 26,
            b'0'..=b'9' => letter - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            b'=' => {
                padded = true;
                continue;
            }
            b' ' | b'\t' | b'\r' | b'\n' => continue,
            _ => return None,
        };
        if padded {
            return None;
        }
        bits = bits << 6 | u32::from(value);
        bit_count += 6;
        if bit_count >= 8 {
            bit_count -= 8;
            bytes.push((bits >> bit_count) as u8);
        }
    }
    // A single letter left over carries fewer bits than a byte.
    (bit_count < 6).then_some(bytes)
}

/// Replaces `%41` by `A`; a `%` that starts no escape stays.
fn percent_decode(text: &[u8]) -> Vec<u8> {
    let digit = |letter: Option<&u8>| letter.and_then(|l| char::from(*l).to_digit(16)).map(|d| d as u8);
    let mut decoded = Vec::with_capacity(text.len());
    let mut rest = text;
    while let [first, tail @ ..] = rest {
        rest = tail;
        match (*first, digit(tail.first()), digit(tail.get(1))) {
            (b'%', Some(high), Some(low)) => {
                decoded.push(high << 4 | low);
                rest = tail.get(2..).unwrap_or_default();
            }
            _ => decoded.push(*first),
        }
    }
    decoded
}

fn strip_prefix_ignore_case<'a>(text: &'a str, prefix: &str) -> Option<&'a str> {
    let head = text.get(..prefix.len())?;
    head.eq_ignore_ascii_case(prefix).then(|| text.get(prefix.len()..)).flatten()
}

/// A URI short enough for a message.
fn shorten(uri: &str) -> String {
    const LONGEST: usize = 80;
    if uri.chars().count() <= LONGEST {
        return uri.to_owned();
    }
    uri.chars().take(LONGEST).chain("…".chars()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(text: &str) -> Target {
        Target::Path(text.to_owned())
    }

    #[test]
    fn paths_are_percent_decoded() {
        assert_eq!(parse("daten%20%C3%BC/teil%232.bin"), Ok(path("daten ü/teil#2.bin")));
        assert_eq!(parse("./a//b.bin"), Ok(path("a/b.bin")));
        assert_eq!(parse("50%.png"), Ok(path("50%.png")));
    }

    #[test]
    fn paths_that_leave_the_folder_are_refused() {
        for uri in [
            "../x.bin",
            "a/../../x.bin",
            "%2e%2e/x.bin",
            "a%2F..%2Fx",
            "/etc/passwd",
            "%2Fetc/passwd",
            "\\\\host\\x",
            "C:\\x.bin",
            "c%3A/x",
            "file:///etc/passwd",
            "http://example.org/x.bin",
            "HTTPS://example.org",
            "x%00.bin",
            "",
            "%ff.bin",
            ".",
            "data:nothing",
        ] {
            assert!(parse(uri).is_err(), "{uri}");
        }
    }

    #[test]
    fn base64_in_any_form() {
        let expected = vec![0xfb, 0xff, 0xfe, 0x01];
        for uri in [
            "data:application/octet-stream;base64,+//+AQ==",
            "data:;base64,+//+AQ",
            "DATA:application/gltf-buffer;Base64,-__-AQ==",
            "data:a/b;charset=utf-8;base64,%2B//%2BAQ%3D%3D",
            "data:a/b;base64, +//+\r\n AQ==",
            "data:a/b,%fb%ff%fe%01",
        ] {
            match parse(uri) {
                Ok(Target::Data { bytes, .. }) => assert_eq!(bytes, expected, "{uri}"),
                other => panic!("{uri}: {other:?}"),
            }
        }
        assert!(parse("data:;base64,A").is_err());
        assert!(parse("data:;base64,AA=A").is_err());
        assert!(parse("data:;base64,A*AA").is_err());
    }
}
