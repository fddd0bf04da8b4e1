//! A file or a stream that can be read more than once.

use std::cell::RefCell;
use std::fs::File;
use std::io::{self, BufRead, Cursor, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytes::Bytes;
use tempfile::NamedTempFile;

use super::clock::Clock;
use super::content;
pub(super) use super::content::Content;
use crate::error::DataError;
use crate::source::{decompressed, file_name};

/// Something to read, with its name for messages.
#[derive(Debug)]
pub(super) struct Input {
    pub name: Arc<str>,
    kept: Kept,
    /// How its times are read, once that is known.
    clock: RefCell<Option<Clock>>,
}

#[derive(Debug)]
enum Kept {
    Path(PathBuf),
    /// A stream that was short.
    Memory(Bytes),
    /// A stream that was long; the file vanishes with us.
    Temporary(NamedTempFile),
}

impl Input {
    /// A file by its name.
    pub fn file(path: &Path) -> Self {
        Input { name: file_name(path), kept: Kept::Path(path.to_path_buf()), clock: RefCell::default() }
    }

    /// A stream, which is kept as it comes: in memory if it is short, in a temporary file otherwise.
    pub fn stream(mut reader: impl Read, name: &str) -> Result<Self, DataError> {
        /// A stream of this size is short.
        const SHORT: u64 = 1 << 24;
        let name: Arc<str> = name.into();
        let failed = |error| DataError::io(&name, "read", error);
        let mut start = Vec::new();
        reader.by_ref().take(SHORT).read_to_end(&mut start).map_err(failed)?;
        if (start.len() as u64) < SHORT {
            return Ok(Input { name, kept: Kept::Memory(start.into()), clock: RefCell::default() });
        }
        let mut spill = || -> io::Result<NamedTempFile> {
            let mut file = NamedTempFile::new()?;
            file.write_all(&start)?;
            io::copy(&mut reader, &mut file)?;
            Ok(file)
        };
        let file = spill().map_err(|error| DataError::io(&name, "keep", error))?;
        Ok(Input { name, kept: Kept::Temporary(file), clock: RefCell::default() })
    }

    /// Reads from the beginning, decompressed.
    pub fn open(&self) -> Result<Box<dyn BufRead>, DataError> {
        let failed = |error| DataError::io(&self.name, "open", error);
        match &self.kept {
            Kept::Path(path) => decompressed(File::open(path).map_err(failed)?, &self.name),
            Kept::Memory(bytes) => decompressed(Cursor::new(bytes.clone()), &self.name),
            Kept::Temporary(file) => decompressed(file.reopen().map_err(failed)?, &self.name),
        }
    }

    /// What the beginning says that it is.
    pub fn content(&self) -> Result<Content, DataError> {
        content::of(self.open()?, &self.name)
    }

    /// How the times are read: settled when it is asked for first.
    pub fn clock(&self, settle: impl FnOnce() -> Result<Clock, DataError>) -> Result<Clock, DataError> {
        if let Some(clock) = &*self.clock.borrow() {
            return Ok(clock.clone());
        }
        let clock = settle()?;
        *self.clock.borrow_mut() = Some(clock.clone());
        Ok(clock)
    }
}
