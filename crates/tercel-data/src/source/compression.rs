//! Compressed streams: gzip, zstd, xz, and zip with one file.

use std::io::{self, BufRead, BufReader, Read};
use std::sync::Arc;

use flate2::bufread::MultiGzDecoder;
use xz4rust::{XzDecoder, XzNextBlockResult};

use super::{read_error, zip};
use crate::error::DataError;

const BUFFER: usize = 1 << 16;
/// As much as is looked at to tell what a stream is.
const BEGINNING: usize = 8192;
/// As much as says whether a stream is compressed.
const MAGIC: usize = 6;

/// A stream that is decompressed if it begins like a compressed one.
pub(crate) fn decompressed<'a>(
    reader: impl Read + 'a,
    file: &Arc<str>,
) -> Result<Box<dyn BufRead + 'a>, DataError> {
    let mut reader = Rejoined::new(reader);
    let start = reader.peek().map_err(|error| DataError::io(file, "read", error))?;
    Ok(match Compression::of(start) {
        None => Box::new(BufReader::with_capacity(BUFFER, reader)),
        Some(Compression::Gzip) => {
            let reader = BufReader::with_capacity(BUFFER, reader);
            Box::new(BufReader::with_capacity(BUFFER, MultiGzDecoder::new(reader)))
        }
        Some(Compression::Zstd) => {
            let decoder = zstd::Decoder::new(reader).map_err(|error| read_error(file, error))?;
            Box::new(BufReader::with_capacity(BUFFER, decoder))
        }
        Some(Compression::Xz) => Box::new(BufReader::with_capacity(BUFFER, Xz::new(reader))),
        Some(Compression::Zip) => Box::new(io::Cursor::new(zip::only_file(reader, file)?)),
    })
}

enum Compression {
    Gzip,
    Zstd,
    Xz,
    Zip,
}

impl Compression {
    fn of(start: &[u8]) -> Option<Self> {
        match start {
            [0x1f, 0x8b, ..] => Some(Compression::Gzip),
            [0x28, 0xb5, 0x2f, 0xfd, ..] => Some(Compression::Zstd),
            // A frame that is to be skipped; some programs begin with one.
            [0x50..=0x5f, 0x2a, 0x4d, 0x18, ..] => Some(Compression::Zstd),
            [0xfd, b'7', b'z', b'X', b'Z', 0, ..] => Some(Compression::Xz),
            [b'P', b'K', 3, 4, ..] | [b'P', b'K', 5, 6, ..] => Some(Compression::Zip),
            _ => None,
        }
    }
}

/// A stream whose first bytes were looked at.
///
/// A pipe may hand out a single byte first, so that looking into the buffer of a reader is not enough.
struct Rejoined<R> {
    start: Box<[u8; BEGINNING]>,
    filled: usize,
    taken: usize,
    rest: R,
}

impl<R: Read> Rejoined<R> {
    fn new(rest: R) -> Self {
        Rejoined { start: Box::new([0; BEGINNING]), filled: 0, taken: 0, rest }
    }

    /// Reads on while the stream may still turn out to be compressed; a line of text is not waited for in vain.
    fn peek(&mut self) -> io::Result<&[u8]> {
        const BEGINNINGS: [u8; 4] = [0x1f, 0x28, 0xfd, b'P'];
        while self.filled < MAGIC {
            match self.rest.read(&mut self.start[self.filled..]) {
                Ok(0) => break,
                Ok(more) => self.filled += more,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            }
            if !BEGINNINGS.contains(&self.start[0]) && !(0x50..=0x5f).contains(&self.start[0]) {
                break;
            }
        }
        Ok(&self.start[..self.filled])
    }
}

impl<R: Read> Read for Rejoined<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.taken == self.filled {
            return self.rest.read(into);
        }
        let some = (&self.start[self.taken..self.filled]).read(into)?;
        self.taken += some;
        Ok(some)
    }
}

/// An xz stream, or several one after another.
struct Xz<R> {
    reader: BufReader<R>,
    decoder: Box<XzDecoder<'static>>,
    /// Between two streams, where the file may end.
    between: bool,
}

impl<R: Read> Xz<R> {
    fn new(reader: R) -> Self {
        /// As much as the strongest setting of xz asks for is 64 MiB.
        const LARGEST_DICTIONARY: usize = 1 << 28;
        let decoder = XzDecoder::in_heap_with_alloc_dict_size(1 << 16, LARGEST_DICTIONARY);
        Xz { reader: BufReader::with_capacity(BUFFER, reader), decoder, between: false }
    }
}

impl<R: Read> Read for Xz<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if into.is_empty() {
            return Ok(0);
        }
        loop {
            let input = self.reader.fill_buf()?;
            if self.between {
                // Streams may be padded by zeros.
                match input.first() {
                    None => return Ok(0),
                    Some(0) => {
                        self.reader.consume(1);
                        continue;
                    }
                    Some(_) => {
                        self.decoder.reset();
                        self.between = false;
                    }
                }
                continue;
            }
            let at_end = input.is_empty();
            let result = self.decoder.decode(input, into).map_err(io::Error::other)?;
            let (used, made) = (result.input_consumed(), result.output_produced());
            self.reader.consume(used);
            self.between = matches!(result, XzNextBlockResult::EndOfStream(..));
            if made > 0 {
                return Ok(made);
            }
            if at_end && !self.between {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
        }
    }
}
