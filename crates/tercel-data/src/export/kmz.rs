//! Compressed KML: a ZIP archive with one file.

use std::io::{Error, Result, Write};

use flate2::write::DeflateEncoder;
use flate2::{Compression, Crc};

use super::{Clock, Path, kml};

/// The file that readers look for.
const NAME: &[u8] = b"doc.kml";
/// Version 2.0 of the format, the first with compression.
const VERSION: u16 = 20;
const DEFLATED: u16 = 8;
/// The first day that the format knows: the archive is the same whenever it is made.
const DAY: u16 = 1 << 5 | 1;

/// Writes the archive.
pub(super) fn write(sink: &mut dyn Write, paths: &[Path], clock: Clock) -> Result<()> {
    let mut text = Vec::new();
    kml::write(&mut text, paths, clock)?;
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(&text)?;
    let packed = encoder.finish()?;
    let entry = entry(&text, packed.len())?;
    let mut local = b"PK\x03\x04".to_vec();
    local.extend(&entry);
    local.extend(NAME);
    let mut directory = b"PK\x01\x02".to_vec();
    directory.extend(VERSION.to_le_bytes());
    directory.extend(&entry);
    // No comment, first disk, attributes of no system, and the entry begins with the archive.
    directory.extend([0; 14]);
    directory.extend(NAME);
    let mut end = b"PK\x05\x06\0\0\0\0\x01\0\x01\0".to_vec();
    end.extend(size(directory.len())?.to_le_bytes());
    end.extend(size(local.len() + packed.len())?.to_le_bytes());
    end.extend([0; 2]);
    [local, packed, directory, end].iter().try_for_each(|part| sink.write_all(part))
}

/// What both headers say of the file, up to its name.
fn entry(text: &[u8], packed: usize) -> Result<Vec<u8>> {
    let mut crc = Crc::new();
    crc.update(text);
    let mut entry = Vec::new();
    for field in [VERSION, 0, DEFLATED, 0, DAY] {
        entry.extend(field.to_le_bytes());
    }
    for field in [crc.sum(), size(packed)?, size(text.len())?] {
        entry.extend(field.to_le_bytes());
    }
    entry.extend((NAME.len() as u16).to_le_bytes());
    entry.extend([0; 2]);
    Ok(entry)
}

/// A length in the field that the format has for it.
fn size(bytes: usize) -> Result<u32> {
    u32::try_from(bytes).map_err(|_| Error::other("more than 4 GiB in an archive"))
}
