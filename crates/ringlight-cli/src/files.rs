//! Files: what a scene refers to, and writing that leaves no half-written file.

use crate::map;
use anyhow::{Context, bail};
use ringlight::column::Store;
use ringlight::resources::{Bytes, Resources};
use ringlight::transport::{Communicator, Failure as RankFailure};
use serde::Serialize;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Component, Path, PathBuf};
use std::sync::Mutex;

/// The bytes of a file: mapped if it is a regular one, else read.
pub fn open(path: &Path) -> io::Result<Bytes> {
    let file = File::open(path)?;
    let data = file.metadata()?;
    if data.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"));
    }
    if data.is_file() && data.len() > 0 {
        return map::whole(&file);
    }
    Ok(Bytes::new(std::fs::read(path)?))
}

/// The folder that holds `path`.
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// The files in and below a folder, and no others.
pub struct FileResources<'a> {
    folder: PathBuf,
    store: Store<'a>,
    opened: Mutex<Vec<PathBuf>>,
}

impl<'a> FileResources<'a> {
    /// The files beside the scene or solution at `path`; what has to be kept of them is kept in `store`.
    pub fn beside(path: &Path, store: Store<'a>) -> io::Result<FileResources<'a>> {
        Ok(FileResources { folder: folder_of(path).canonicalize()?, store, opened: Mutex::default() })
    }

    /// The files that have been read, without links.
    pub fn opened(self) -> Vec<PathBuf> {
        self.opened.into_inner().unwrap_or_default()
    }
}

impl Resources for FileResources<'_> {
    fn store(&self) -> Store<'_> {
        self.store
    }

    fn read(&self, path: &str) -> io::Result<Bytes> {
        let refused = |why| Err(io::Error::new(io::ErrorKind::PermissionDenied, why));
        let relative = Path::new(path);
        if path.is_empty()
            || !relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
        {
            return refused("the path leaves the scene's folder");
        }
        let resolved = self.folder.join(relative).canonicalize()?;
        if !resolved.starts_with(&self.folder) {
            return refused("a link leaves the scene's folder");
        }
        // A pipe or a device in a scene's folder could keep us waiting for ever.
        if !resolved.metadata()?.is_file() {
            return refused("it is not a file");
        }
        if let Ok(mut opened) = self.opened.lock() {
            opened.push(resolved.clone());
        }
        open(&resolved)
    }
}

/// Whether `path` may be written later: nothing is there (unless `force`), and its folder takes new files.
pub fn check_target(path: &Path, force: bool) -> anyhow::Result<()> {
    if path.is_dir() {
        bail!("{}: it is a folder; expected a file to write", path.display());
    }
    if !force && path.symlink_metadata().is_ok() {
        bail!("{}: the file exists; --force overwrites it", path.display());
    }
    let folder = folder_of(path);
    if !folder.is_dir() {
        bail!("{}: there is no folder {}", path.display(), folder.display());
    }
    temporary(path).with_context(|| format!("{}: cannot write into its folder", path.display()))?;
    Ok(())
}

/// A new file beside `path`, which is removed again unless it is renamed.
fn temporary(path: &Path) -> io::Result<tempfile::NamedTempFile> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut builder = tempfile::Builder::new();
    let prefix = format!(".{name}.");
    builder.prefix(&prefix).suffix(".partial");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // What the user's umask leaves of it, as for any new file.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder_of(path))
}

/// A file that appears under its name only when it is complete.
#[derive(Debug)]
pub struct NewFile {
    path: PathBuf,
    out: BufWriter<tempfile::NamedTempFile>,
}

impl NewFile {
    /// Begins a file that will be at `path`.
    pub fn create(path: &Path) -> io::Result<NewFile> {
        Ok(NewFile { path: path.to_owned(), out: BufWriter::with_capacity(1 << 20, temporary(path)?) })
    }

    /// Puts the file under its name, with all its content on the disk first.
    pub fn finish(self) -> io::Result<()> {
        let file = self.out.into_inner().map_err(io::IntoInnerError::into_error)?;
        file.as_file().sync_all()?;
        file.persist(&self.path).map_err(|error| error.error)?;
        // The new name, too; not every system lets folders be synced.
        if let Ok(folder) = File::open(folder_of(&self.path)) {
            folder.sync_all().ok();
        }
        Ok(())
    }
}

impl Write for NewFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

impl Seek for NewFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.out.seek(to)
    }
}

/// Writes a file: all of it, or nothing.
pub fn write<T>(path: &Path, content: impl FnOnce(&mut NewFile) -> io::Result<T>) -> anyhow::Result<T> {
    let whole = || {
        let mut file = NewFile::create(path)?;
        let result = content(&mut file)?;
        file.finish()?;
        Ok::<T, io::Error>(result)
    };
    whole().with_context(|| format!("{}: cannot be written", path.display()))
}

/// Writes a report as JSON.
pub fn write_json(path: &Path, report: &impl Serialize) -> anyhow::Result<()> {
    write(path, |out| {
        serde_json::to_writer_pretty(&mut *out, report)?;
        out.write_all(b"\n")
    })
}

/// Writes a file over ranks: all of them call it, and rank 0 writes. `content` runs on all of them even when rank 0 has no
/// file to write to. The outer error is that of the ranks; the inner one is rank 0's, and leaves what was there.
pub fn write_over_ranks(
    path: &Path,
    ranks: &mut Communicator<'_>,
    content: impl FnOnce(&mut Communicator<'_>, &mut dyn Write) -> Result<io::Result<()>, RankFailure>,
) -> Result<anyhow::Result<()>, RankFailure> {
    let failed = |error| anyhow::Error::new(error).context(format!("{}: cannot be written", path.display()));
    if ranks.rank() > 0 {
        return Ok(content(ranks, &mut io::sink())?.map_err(failed));
    }
    let written = match NewFile::create(path) {
        Ok(mut file) => content(ranks, &mut file)?.and_then(|()| file.finish()),
        // What the others hear must not depend on it: they take part as if there were a file.
        Err(error) => content(ranks, &mut Refusing).map(|_| Err(error))?,
    };
    Ok(written.map_err(failed))
}

/// Takes nothing.
struct Refusing;

impl Write for Refusing {
    fn write(&mut self, _: &[u8]) -> io::Result<usize> {
        Err(io::ErrorKind::Unsupported.into())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes two files that belong together: both of them whole, or neither.
pub fn write_pair<T>(
    [first, second]: [&Path; 2],
    content: impl FnOnce(&mut NewFile, &mut NewFile) -> io::Result<T>,
) -> anyhow::Result<T> {
    let both = || {
        let (mut one, mut other) = (NewFile::create(first)?, NewFile::create(second)?);
        let result = content(&mut one, &mut other)?;
        // The first refers to the second, so the second is there when the first appears.
        other.finish()?;
        one.finish()?;
        Ok::<T, io::Error>(result)
    };
    both().with_context(|| format!("{}: cannot be written", first.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resources_stay_in_the_scenes_folder() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("scene");
        std::fs::create_dir_all(folder.join("textures")).unwrap();
        std::fs::write(folder.join("textures/a b.png"), "inside").unwrap();
        std::fs::write(folder.join("empty"), "").unwrap();
        std::fs::write(root.path().join("secret"), "outside").unwrap();
        let resources = FileResources::beside(&folder.join("scene.gltf"), Store::Heap).unwrap();
        assert_eq!(&resources.read("textures/a b.png").unwrap()[..], b"inside");
        assert_eq!(&resources.read("./empty").unwrap()[..], b"");
        let absolute = root.path().join("secret");
        for bad in ["../secret", "textures/../../secret", absolute.to_str().unwrap(), "", "textures", "no such file"] {
            assert!(resources.read(bad).is_err(), "{bad}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(&absolute, folder.join("link")).unwrap();
            assert!(resources.read("link").is_err());
            std::os::unix::fs::symlink(folder.join("empty"), folder.join("fine")).unwrap();
            assert!(resources.read("fine").is_ok());
        }
    }

    #[test]
    fn a_failed_write_leaves_neither_a_file_nor_a_part_of_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.csv");
        let failed = write(&path, |out| {
            out.write_all(b"half")?;
            Err::<(), _>(io::Error::other("the disk is full"))
        });
        assert!(format!("{:#}", failed.unwrap_err()).contains("out.csv: cannot be written: the disk is full"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        write(&path, |out| out.write_all(b"whole")).unwrap();
        write(&path, |out| out.write_all(b"anew")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"anew");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn ranks_write_one_file_and_those_without_hear_of_no_failure() {
        use ringlight::transport::threads;
        let folder = tempfile::tempdir().unwrap();
        let write = |path: PathBuf| {
            let results = threads::run(3, |ranks| {
                write_over_ranks(&path, ranks, |ranks, out| {
                    let sum = ranks.all_reduce(1, [1], |a, b| [a[0] + b[0]])?;
                    Ok(out.write_all(&sum))
                })
            });
            results.unwrap()
        };
        let fine = folder.path().join("fine");
        assert!(write(fine.clone()).iter().all(Result::is_ok));
        assert_eq!(std::fs::read(&fine).unwrap(), [3]);
        let failed = write(folder.path().join("no folder/file"));
        assert!(failed[1].is_ok() && failed[2].is_ok());
        let error = format!("{:#}", failed[0].as_ref().unwrap_err());
        assert!(error.contains("cannot be written: No such file"), "{error}");
    }
}
