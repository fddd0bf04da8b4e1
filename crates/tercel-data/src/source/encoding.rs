//! Bytes as text: UTF-8, UTF-16 with and without a byte order mark, and Windows-1252 where bytes are neither.

use std::cell::Cell;
use std::io::{self, BufRead, Read};
use std::rc::Rc;
use std::sync::Arc;

use super::{Kind, read_error};
use crate::error::{DataError, Place};

/// A stream of text, whose bytes are UTF-8 from here on.
pub(crate) struct Text<'a> {
    pub reader: Box<dyn BufRead + 'a>,
    /// Bytes that were no UTF-8, so far.
    foreign: Rc<Cell<u64>>,
}

impl Text<'_> {
    /// What is worth saying about the encoding, once all is read.
    pub fn note(&self) -> Option<String> {
        let foreign = self.foreign.get();
        (foreign > 0).then(|| {
            format!("{foreign} bytes are not UTF-8 and were read as Windows-1252 (Western European) text")
        })
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Utf8,
    Utf16Little,
    Utf16Big,
}

impl Encoding {
    /// The encoding, and how long its mark is.
    fn of(start: &[u8]) -> (Self, usize) {
        match start {
            [0xef, 0xbb, 0xbf, ..] => (Encoding::Utf8, 3),
            [0xff, 0xfe, ..] => (Encoding::Utf16Little, 2),
            [0xfe, 0xff, ..] => (Encoding::Utf16Big, 2),
            // Without a mark every other byte of Western text is zero.
            [first, 0, second, 0, ..] if *first != 0 && *second != 0 && alternates(start, 1) => {
                (Encoding::Utf16Little, 0)
            }
            [0, first, 0, second, ..] if *first != 0 && *second != 0 && alternates(start, 0) => {
                (Encoding::Utf16Big, 0)
            }
            _ => (Encoding::Utf8, 0),
        }
    }
}

/// True when most of every other byte from `first` on are zero and the rest is text.
fn alternates(start: &[u8], first: usize) -> bool {
    let start = &start[..start.len().min(256)];
    let zeros = |first: usize| start.iter().skip(first).step_by(2).filter(|byte| **byte == 0).count();
    zeros(first) * 10 >= start.len() / 2 * 9 && zeros(1 - first) == 0
}

/// Text from a stream that is already decompressed. What is plainly no text is refused by the name of what it is.
pub(crate) fn text<'a>(mut reader: impl BufRead + 'a, file: &Arc<str>) -> Result<Text<'a>, DataError> {
    let start = reader.fill_buf().map_err(|error| read_error(file, error))?;
    let (encoding, mark) = Encoding::of(start);
    if encoding == Encoding::Utf8 {
        refuse_binary(Kind::of(&start[mark..]), file)?;
    }
    reader.consume(mark);
    let foreign = Rc::new(Cell::new(0));
    let decoder = Decoder {
        reader,
        encoding,
        bytes: Vec::new(),
        text: String::new(),
        taken: 0,
        foreign: Rc::clone(&foreign),
    };
    Ok(Text { reader: Box::new(decoder), foreign })
}

fn refuse_binary(kind: Kind, file: &Arc<str>) -> Result<(), DataError> {
    let (what, help) = match kind {
        Kind::Text | Kind::Json => return Ok(()),
        Kind::Parquet => ("a Parquet file", "name the format: --from parquet"),
        Kind::Other(what) => (what, "save the table as CSV with a header, as Parquet, or as lines of JSON"),
    };
    Err(DataError::unsettled(Place::whole(file), format!("this is no text but {what}"), help))
}

/// Turns bytes into UTF-8.
struct Decoder<R> {
    reader: R,
    encoding: Encoding,
    /// Bytes of a character that is not complete.
    bytes: Vec<u8>,
    text: String,
    taken: usize,
    foreign: Rc<Cell<u64>>,
}

impl<R: BufRead> Decoder<R> {
    /// Decodes the next part of the stream; the text is empty at its end.
    fn refill(&mut self) -> io::Result<()> {
        self.text.clear();
        self.taken = 0;
        while self.text.is_empty() {
            let chunk = self.reader.fill_buf()?;
            let (read, ended) = (chunk.len(), chunk.is_empty());
            self.bytes.extend_from_slice(chunk);
            self.reader.consume(read);
            if ended && self.bytes.is_empty() {
                return Ok(());
            }
            match self.encoding {
                Encoding::Utf8 => self.take_utf8(ended),
                Encoding::Utf16Little => self.take_utf16(ended, u16::from_le_bytes),
                Encoding::Utf16Big => self.take_utf16(ended, u16::from_be_bytes),
            }
        }
        Ok(())
    }

    fn take_utf8(&mut self, ended: bool) {
        let mut at = 0;
        loop {
            match std::str::from_utf8(&self.bytes[at..]) {
                Ok(text) => {
                    self.text.push_str(text);
                    self.bytes.clear();
                    return;
                }
                Err(error) => {
                    let valid = at + error.valid_up_to();
                    self.text.push_str(&String::from_utf8_lossy(&self.bytes[at..valid]));
                    if error.error_len().is_none() && !ended {
                        self.bytes.drain(..valid);
                        return;
                    }
                    self.text.push(windows_1252(self.bytes[valid]));
                    self.foreign.set(self.foreign.get() + 1);
                    at = valid + 1;
                }
            }
        }
    }

    fn take_utf16(&mut self, ended: bool, unit: fn([u8; 2]) -> u16) {
        let units: Vec<u16> = self.bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]])).collect();
        // The first half of a pair of units waits for the second.
        let waits = !ended && units.last().is_some_and(|unit| (0xd800..0xdc00).contains(unit));
        let whole = units.len() - usize::from(waits);
        self.text.extend(
            char::decode_utf16(units[..whole].iter().copied())
                .map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)),
        );
        self.bytes.drain(..whole * 2);
        if ended {
            self.bytes.clear();
        }
    }
}

/// The character that a byte is in Windows-1252.
fn windows_1252(byte: u8) -> char {
    const HIGH: [char; 32] = [
        '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž', '\u{8f}',
        '\u{90}', '‘', '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}', 'ž', 'Ÿ',
    ];
    match byte {
        0x80..=0x9f => HIGH[usize::from(byte - 0x80)],
        _ => char::from(byte),
    }
}

impl<R: BufRead> Read for Decoder<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let some = self.fill_buf()?.read(into)?;
        self.consume(some);
        Ok(some)
    }
}

impl<R: BufRead> BufRead for Decoder<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.taken >= self.text.len() {
            self.refill()?;
        }
        Ok(&self.text.as_bytes()[self.taken..])
    }

    fn consume(&mut self, amount: usize) {
        self.taken += amount;
    }
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;

    use super::*;

    fn decoded(bytes: &[u8]) -> (String, Option<String>) {
        // One byte at a time, so that every character is cut somewhere.
        let mut reader = BufReader::with_capacity(8, bytes);
        let mut text = text(&mut reader, &"file".into()).unwrap();
        let mut all = String::new();
        text.reader.read_to_string(&mut all).unwrap();
        (all, text.note())
    }

    #[test]
    fn utf_16_of_both_orders_is_read_with_and_without_a_mark() {
        let content = "time,sensor\n0,Ærø 🚢\n";
        let units: Vec<u16> = content.encode_utf16().collect();
        let little: Vec<u8> = units.iter().flat_map(|unit| unit.to_le_bytes()).collect();
        let big: Vec<u8> = units.iter().flat_map(|unit| unit.to_be_bytes()).collect();
        for bytes in [[b"\xff\xfe", &little[..]].concat(), [b"\xfe\xff", &big[..]].concat(), little, big] {
            assert_eq!(decoded(&bytes), (content.to_owned(), None));
        }
    }

    #[test]
    fn bytes_that_are_no_utf_8_are_western_european_and_counted() {
        let (text, note) = decoded(b"name\n\xc6r\xf8 \x80 \xe2\x82\xac\n");
        assert_eq!(text, "name\nÆrø € €\n");
        assert!(note.unwrap().starts_with("3 bytes"));
    }

    #[test]
    fn a_picture_is_refused_by_name() {
        let mut reader: &[u8] = b"\x89PNG\r\n\x1a\n\0\0";
        let error = text(&mut reader, &"file".into()).err().unwrap();
        assert_eq!(error.to_string(), "file: this is no text but a picture (PNG)");
    }
}
