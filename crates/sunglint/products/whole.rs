//! Files that appear whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Writes a file beside its place under a name of its own, flushes it to the disk and renames it into place; parent
/// folders are made. A reader sees the former file or the whole new one; after an error or a panic in `body` nothing is
/// left. Several processes may write one path at once: the last rename wins.
///
/// # Errors
/// Those of `body` and of the file system, with the path in the message.
pub fn write_whole(path: &Path, body: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let mut unfinished = Unfinished::create(path)?;
    unfinished.write(body)?;
    unfinished.publish()
}

/// A file on its way; dropped before [`Self::publish`], it is removed.
pub(super) struct Unfinished {
    path: PathBuf,
    temporary: PathBuf,
    out: Option<BufWriter<File>>,
}

impl Unfinished {
    pub(super) fn create(path: &Path) -> io::Result<Self> {
        let at = |error| at_path(path, error);
        if path.file_name().is_none() {
            return Err(at(io::Error::new(io::ErrorKind::InvalidInput, "not a file's path")));
        }
        let folder = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        fs::create_dir_all(folder).map_err(at)?;
        loop {
            static COUNT: AtomicU64 = AtomicU64::new(0);
            let count = COUNT.fetch_add(1, Ordering::Relaxed);
            let temporary = folder.join(format!(".sunglint-{}-{count}.part", std::process::id()));
            // `create_new` is what makes the name ours: another machine may have the same process number.
            match OpenOptions::new().read(true).write(true).create_new(true).open(&temporary) {
                Ok(file) => {
                    let out = Some(BufWriter::with_capacity(1 << 18, file));
                    return Ok(Self { path: path.to_path_buf(), temporary, out });
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(at(error)),
            }
        }
    }

    pub(super) fn write(&mut self, body: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
        let Some(out) = &mut self.out else { return Ok(()) };
        body(out)
            .and_then(|()| out.flush())
            .and_then(|()| out.get_ref().sync_all())
            .map_err(|error| at_path(&self.path, error))
    }

    pub(super) fn publish(mut self) -> io::Result<()> {
        self.out = None; // some systems rename no open file
        fs::rename(&self.temporary, &self.path).map_err(|error| at_path(&self.path, error))?;
        self.temporary.clear(); // the name may be another's from now on
        Ok(())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        if let Some(out) = self.out.take() {
            drop(out.into_parts()); // what is buffered need not reach the disk
        }
        if !self.temporary.as_os_str().is_empty() {
            let _ = fs::remove_file(&self.temporary); // an error is under way already
        }
    }
}

fn at_path(path: &Path, error: io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_appears_whole_and_its_folders_are_made() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("noon/roof/radiance.txt");
        write_whole(&path, |out| {
            out.write_all(b"first")?;
            assert!(!path.exists());
            Ok(())
        })
        .unwrap();
        write_whole(&path, |out| out.write_all(b"second")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(names(path.parent().unwrap()), ["radiance.txt"]);
    }

    /// The former file stays and no temporary is left, be it an error, a panic, or a place that cannot be renamed to.
    #[test]
    fn an_interrupted_file_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("radiance.txt");
        fs::write(&path, "former").unwrap();
        let error = write_whole(&path, |out| {
            out.write_all(b"half")?;
            Err(io::Error::other("the disk is full"))
        })
        .unwrap_err();
        assert!(error.to_string().contains("radiance.txt: the disk is full"), "{error}");
        let panicked = std::panic::catch_unwind(|| write_whole(&path, |_| panic!("in the midst")));
        assert!(panicked.is_err());
        fs::create_dir_all(folder.path().join("taken/inside")).unwrap();
        assert!(write_whole(&folder.path().join("taken"), |out| out.write_all(b"x")).is_err());
        assert!(write_whole(&folder.path().join("radiance.txt/below"), |_| Ok(())).is_err());
        assert!(write_whole(Path::new("/"), |_| Ok(())).is_err());
        assert_eq!(fs::read(&path).unwrap(), b"former");
        assert_eq!(names(folder.path()), ["radiance.txt", "taken"]);
    }
}
