//! What a scene refers to: the library opens no file itself.

use std::sync::Arc;

/// Bytes of a file, held or mapped; cheap to clone.
#[derive(Clone)]
pub struct Bytes(Arc<dyn AsRef<[u8]> + Send + Sync>);

impl Bytes {
    /// Bytes from anything that holds them.
    pub fn new(holder: impl AsRef<[u8]> + Send + Sync + 'static) -> Bytes {
        Bytes(Arc::new(holder))
    }
}

impl std::ops::Deref for Bytes {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        (*self.0).as_ref()
    }
}

impl std::fmt::Debug for Bytes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} bytes", self.len())
    }
}

/// Gives the bytes of the files a scene refers to.
pub trait Resources: Send + Sync {
    /// The file at `path`, which is relative to the scene file, with `/` between parts and percent-escapes decoded.
    /// Implementations refuse paths that leave the scene's folder (absolute ones, `..`).
    fn read(&self, path: &str) -> std::io::Result<Bytes>;
}
