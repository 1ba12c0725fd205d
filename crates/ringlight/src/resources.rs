//! What a scene refers to: the library opens no file itself.

pub use crate::column::Bytes;
use crate::column::Store;

/// Gives the bytes of the files a scene refers to.
pub trait Resources: Send + Sync {
    /// The file at `path`, which is relative to the scene file, with `/` between parts and percent-escapes decoded.
    /// Implementations refuse paths that leave the scene's folder (absolute ones, `..`).
    fn read(&self, path: &str) -> std::io::Result<Bytes>;

    /// Where to keep what is read from text: other formats are read where they are.
    fn store(&self) -> Store<'_> {
        Store::Heap
    }
}
