//! The page's files, held by the program.

use rust_embed::RustEmbed;

#[derive(RustEmbed)]
#[folder = "../../viewer/dist"]
struct Built;

/// What is shown in place of a page that has not been built.
const NOT_BUILT: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Ringlight</title>\
    <p>This ringlight was built without its page. Build the page with <code>cargo xtask viewer</code> (it needs Node.js and \
    npm), then build ringlight again.";

/// A file of the page and its media type.
pub fn file(path: &str) -> Option<(Vec<u8>, &'static str)> {
    let (name, media_type) = match path {
        "/" => ("index.html", "text/html; charset=utf-8"),
        "/viewer.js" => ("viewer.js", "text/javascript; charset=utf-8"),
        "/viewer.css" => ("viewer.css", "text/css; charset=utf-8"),
        _ => return None,
    };
    match Built::get(name) {
        Some(file) => Some((file.data.into_owned(), media_type)),
        None => (path == "/").then(|| (NOT_BUILT.into(), media_type)),
    }
}

/// Whether the page has been built.
pub fn is_built() -> bool {
    Built::get("index.html").is_some()
}
