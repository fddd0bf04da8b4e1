//! Files that appear whole or not at all.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tempfile::NamedTempFile;

use crate::error::DataError;
use crate::source::file_name;

/// A file that is written beside its target and takes its place when it is complete.
///
/// Dropped before [`finish`](AtomicFile::finish), it leaves nothing behind, and a file that was there before
/// stays as it was. What is no regular file (a device, a pipe) is written directly.
///
/// ```
/// use std::io::Write;
/// use tercel_data::AtomicFile;
///
/// let folder = tempfile::tempdir()?;
/// let target = folder.path().join("report.html");
/// let mut file = AtomicFile::create(&target)?;
/// file.write_all(b"<p>half</p>")?;
/// assert!(!target.exists());
/// file.finish()?;
/// assert!(target.exists());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct AtomicFile {
    target: PathBuf,
    name: Arc<str>,
    sink: Sink,
}

#[derive(Debug)]
enum Sink {
    Beside(BufWriter<NamedTempFile>),
    Direct(BufWriter<File>),
}

impl AtomicFile {
    /// Begins to write what will become `target`.
    ///
    /// # Errors
    /// [`DataError::Io`] when the folder does not exist or cannot be written.
    pub fn create(target: &Path) -> Result<Self, DataError> {
        let name = file_name(target);
        let failed = |error| DataError::io(&name, "write", error);
        // A link keeps pointing to its file, which is the one that is replaced.
        let target = target.canonicalize().unwrap_or_else(|_| target.to_path_buf());
        let sink = match target.metadata() {
            Ok(there) if there.is_dir() => return Err(failed(std::io::ErrorKind::IsADirectory.into())),
            Ok(there) if !there.is_file() => {
                Sink::Direct(BufWriter::new(File::options().write(true).open(&target).map_err(failed)?))
            }
            _ => Sink::Beside(BufWriter::with_capacity(1 << 16, beside(&target).map_err(failed)?)),
        };
        Ok(AtomicFile { target, name, sink })
    }

    /// Puts the complete file in its place.
    ///
    /// # Errors
    /// [`DataError::Io`] when it cannot be written to the disk or renamed; the target is then as it was before.
    pub fn finish(self) -> Result<(), DataError> {
        let AtomicFile { target, name, sink } = self;
        put(sink, &target).map_err(|error| DataError::io(&name, "write", error))
    }
}

fn put(sink: Sink, target: &Path) -> std::io::Result<()> {
    match sink {
        Sink::Direct(mut file) => file.flush(),
        Sink::Beside(file) => {
            let file = file.into_inner().map_err(std::io::IntoInnerError::into_error)?;
            file.as_file().sync_all()?;
            file.persist(target)?;
            // The name is on the disk only when the folder is. Not every file system can do this, and the file
            // itself is safe already.
            let _ = File::open(folder(target)).and_then(|folder| folder.sync_all());
            Ok(())
        }
    }
}

fn folder(target: &Path) -> &Path {
    target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// An empty file in the folder of the target, with the rights of a file that is made anew or of the one there.
fn beside(target: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".tercel-").suffix(".part");
    let rights = target.metadata().map(|there| there.permissions());
    #[cfg(unix)]
    let fresh = <std::fs::Permissions as std::os::unix::fs::PermissionsExt>::from_mode(0o666);
    #[cfg(unix)]
    builder.permissions(fresh);
    let file = builder.tempfile_in(folder(target))?;
    if let Ok(rights) = rights {
        file.as_file().set_permissions(rights)?;
    }
    Ok(file)
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match &mut self.sink {
            Sink::Beside(file) => file.write(bytes),
            Sink::Direct(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match &mut self.sink {
            Sink::Beside(file) => file.flush(),
            Sink::Direct(file) => file.flush(),
        }
    }
}
