//! From a file or a stream to text: what every reader of text has in common.
//!
//! Compression, encoding and the kind of content are told from the bytes, never from the name: files are renamed, and streams
//! have no name.

mod compression;
mod encoding;
mod kind;
mod zip;

use std::io::BufRead;
use std::path::Path;
use std::sync::Arc;

pub(crate) use compression::decompressed;
pub(crate) use encoding::{Text, text};
pub(crate) use kind::Kind;

use crate::error::{DataError, Place};

/// The name of a file in messages: as it was given.
pub(crate) fn file_name(path: &Path) -> Arc<str> {
    path.to_string_lossy().into()
}

/// Opens a file for reading, decompressed, with its name for messages.
pub(crate) fn open(path: &Path) -> Result<(Arc<str>, Box<dyn BufRead>), DataError> {
    let file = file_name(path);
    let opened = std::fs::File::open(path).map_err(|error| DataError::io(&file, "open", error))?;
    let reader = decompressed(opened, &file)?;
    Ok((file, reader))
}

/// What went wrong while reading: either the system, or compressed data that is broken.
pub(crate) fn read_error(file: &Arc<str>, error: std::io::Error) -> DataError {
    use std::io::ErrorKind;
    match error.kind() {
        ErrorKind::UnexpectedEof | ErrorKind::InvalidData | ErrorKind::InvalidInput | ErrorKind::Other => {
            DataError::Corrupt {
                place: Place::whole(file),
                problem: format!("the compressed data is broken: {error}"),
                help: "the file may be truncated: write or copy it again",
            }
        }
        _ => DataError::io(file, "read", error),
    }
}
