//! Zip archives that hold one file.

use std::io::Read;
use std::sync::Arc;

use flate2::read::DeflateDecoder;

use super::read_error;
use crate::error::{DataError, Place};

const CENTRAL: &[u8] = b"PK\x01\x02";
const LOCAL: &[u8] = b"PK\x03\x04";
const END: &[u8] = b"PK\x05\x06";

/// A file in the archive, as its table of contents says.
struct Entry {
    name: String,
    method: usize,
    encrypted: bool,
    packed: usize,
    size: usize,
    offset: usize,
}

/// The content of the only file of an archive.
pub(super) fn only_file(mut reader: impl Read, file: &Arc<str>) -> Result<Vec<u8>, DataError> {
    let mut archive = Vec::new();
    reader.read_to_end(&mut archive).map_err(|error| read_error(file, error))?;
    let entries = contents(&archive).ok_or_else(|| broken(file, "its table of contents is missing"))?;
    let [entry] = &entries[..] else { return Err(several(file, &entries)) };
    if entry.encrypted {
        return Err(wrong(
            file,
            "the file in the zip archive is encrypted".to_owned(),
            "unpack it first".into(),
        ));
    }
    let packed = content(&archive, entry).ok_or_else(|| broken(file, "it is cut short"))?;
    match entry.method {
        0 => Ok(packed.to_vec()),
        8 => {
            let mut text = Vec::new();
            // What is longer than it says is broken, or made to fill the memory.
            DeflateDecoder::new(packed)
                .take(entry.size as u64 + 1)
                .read_to_end(&mut text)
                .map_err(|error| read_error(file, error))?;
            if text.len() == entry.size { Ok(text) } else { Err(broken(file, "a size is wrong")) }
        }
        other => {
            let problem =
                format!("the file in the zip archive is packed by method {other}, which is not known");
            Err(wrong(file, problem, "unpack it first".into()))
        }
    }
}

fn wrong(file: &Arc<str>, problem: String, help: String) -> DataError {
    DataError::unsettled(Place::whole(file), problem, help)
}

fn broken(file: &Arc<str>, why: &str) -> DataError {
    wrong(
        file,
        format!("this is not a whole zip archive: {why}"),
        "the file may be truncated: write or copy it again".to_owned(),
    )
}

fn several(file: &Arc<str>, entries: &[Entry]) -> DataError {
    if entries.iter().any(|entry| entry.name.starts_with("xl/") || entry.name.starts_with("content.xml")) {
        let problem = "this is a spreadsheet, not text".to_owned();
        return wrong(file, problem, "save the sheet as CSV".to_owned());
    }
    if entries.iter().any(|entry| entry.name.ends_with(".npy")) {
        let problem = "this is an archive of NumPy arrays (.npz), not text".to_owned();
        return wrong(file, problem, "save the columns as CSV with a header".to_owned());
    }
    const SHOWN: usize = 8;
    let names: Vec<&str> = entries.iter().take(SHOWN).map(|entry| entry.name.as_str()).collect();
    let more = if entries.len() > SHOWN { ", ..." } else { "" };
    let problem = format!("the zip archive holds {} files: {}{more}", entries.len(), names.join(", "));
    let help = match names.first() {
        Some(name) => format!("name one: unzip -p {file} '{name}' | tercel track - --from csv"),
        None => "there is nothing to read in it".to_owned(),
    };
    wrong(file, problem, help)
}

/// A number of `size` bytes at `at`, the lowest first.
fn number(bytes: &[u8], at: usize, size: usize) -> Option<usize> {
    let bytes = bytes.get(at..at.checked_add(size)?)?;
    Some(bytes.iter().rev().fold(0, |sum, byte| sum << 8 | usize::from(*byte)))
}

/// The files of the archive; folders and the shadow files of macOS are passed over.
fn contents(archive: &[u8]) -> Option<Vec<Entry>> {
    let end = (0..=archive.len().checked_sub(22)?)
        .rev()
        .take(1 << 17)
        .find(|at| archive[*at..].starts_with(END))?;
    let (count, mut at) = (number(archive, end + 10, 2)?, number(archive, end + 16, 4)?);
    let mut entries = Vec::new();
    for _ in 0..count {
        if !archive.get(at..)?.starts_with(CENTRAL) {
            return None;
        }
        let [name, extra, comment] = [28, 30, 32].map(|offset| number(archive, at + offset, 2));
        let name_end = at + 46 + name?;
        let entry = Entry {
            name: String::from_utf8_lossy(archive.get(at + 46..name_end)?).into_owned(),
            method: number(archive, at + 10, 2)?,
            encrypted: number(archive, at + 8, 2)? & 1 != 0,
            packed: number(archive, at + 20, 4)?,
            size: number(archive, at + 24, 4)?,
            offset: number(archive, at + 42, 4)?,
        };
        if !entry.name.ends_with('/') && !entry.name.starts_with("__MACOSX/") {
            entries.push(entry);
        }
        at = name_end + extra? + comment?;
    }
    Some(entries)
}

/// The packed bytes of a file.
fn content<'a>(archive: &'a [u8], entry: &Entry) -> Option<&'a [u8]> {
    let at = entry.offset;
    if !archive.get(at..)?.starts_with(LOCAL) {
        return None;
    }
    let start = at + 30 + number(archive, at + 26, 2)? + number(archive, at + 28, 2)?;
    archive.get(start..start.checked_add(entry.packed)?)
}
