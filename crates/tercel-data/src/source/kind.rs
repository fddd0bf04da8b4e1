//! What the first bytes of a file say that it is.

/// A kind of content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Text that is none of the kinds below.
    Text,
    /// Apache Parquet.
    Parquet,
    /// Text that begins like JSON.
    Json,
    /// Another format, by name.
    Other(&'static str),
}

/// Beginnings of formats that people have and that are no text tables.
const BEGINNINGS: [(&[u8], &str); 31] = [
    (b"\x89PNG", "a picture (PNG)"),
    (b"\xff\xd8\xff", "a picture (JPEG)"),
    (b"GIF8", "a picture (GIF)"),
    (b"II*\0", "a picture (TIFF)"),
    (b"MM\0*", "a picture (TIFF)"),
    (b"%PDF", "a PDF document"),
    (b"\x89HDF", "an HDF5, NetCDF-4 or MATLAB 7.3 file"),
    (b"CDF\x01", "a NetCDF file"),
    (b"CDF\x02", "a NetCDF file"),
    (b"MATLAB 5.0", "a MATLAB file"),
    (b"SQLite format 3", "an SQLite database"),
    (b"\x93NUMPY", "a NumPy array (.npy)"),
    (b"ARROW1", "an Arrow (Feather) file"),
    (b"FEA1", "a Feather file"),
    (b"ORC", "an ORC file"),
    (b"Obj\x01", "an Avro file"),
    (b"\xd4\xc3\xb2\xa1", "a capture of network packets (pcap)"),
    (b"\xa1\xb2\xc3\xd4", "a capture of network packets (pcap)"),
    (b"\x4d\x3c\xb2\xa1", "a capture of network packets (pcap)"),
    (b"\x0a\x0d\x0d\x0a", "a capture of network packets (pcapng)"),
    (b"#ROSBAG", "a ROS bag"),
    (b"\x89MCAP", "an MCAP recording"),
    (b"\x80\x04\x95", "a Python pickle"),
    (b"\x80\x05\x95", "a Python pickle"),
    (b"BZh", "compressed by bzip2"),
    (b"7z\xbc\xaf", "a 7z archive"),
    (b"Rar!", "a RAR archive"),
    (b"\x04\x22\x4d\x18", "compressed by LZ4"),
    (b"\xd0\xcf\x11\xe0", "a spreadsheet or document of an old office program (.xls)"),
    (b"{\\rtf", "a text document (RTF)"),
    (b"version https://git-lfs", "a pointer of Git LFS; `git lfs pull` fetches the file itself"),
];

impl Kind {
    /// Tells the kind from the beginning of a file, without a byte order mark.
    pub fn of(start: &[u8]) -> Kind {
        if start.starts_with(b"PAR1") {
            return Kind::Parquet;
        }
        if let Some((_, name)) = BEGINNINGS.iter().find(|(beginning, _)| start.starts_with(beginning)) {
            return Kind::Other(name);
        }
        if start.get(257..262) == Some(b"ustar") {
            return Kind::Other("a tar archive");
        }
        let text = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start).trim_ascii_start();
        let begins =
            |word: &[u8]| text.get(..word.len()).is_some_and(|start| start.eq_ignore_ascii_case(word));
        if begins(b"<!doctype html") || begins(b"<html") {
            return Kind::Other("a web page; the download may have failed");
        }
        if begins(b"<?xml") || begins(b"<gpx") || begins(b"<kml") {
            return Kind::Other("XML");
        }
        if start.contains(&0) {
            return Kind::Other("binary data");
        }
        match text.first() {
            Some(b'{') | Some(b'[') => Kind::Json,
            _ => Kind::Text,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_told_from_the_first_bytes() {
        assert_eq!(Kind::of(b"time,x,y\n0,1,2\n"), Kind::Text);
        assert_eq!(Kind::of(b" \n{\"time\": 0}"), Kind::Json);
        assert_eq!(Kind::of(b"PAR1\x15\x04"), Kind::Parquet);
        assert_eq!(Kind::of(b"\x89PNG\r\n"), Kind::Other("a picture (PNG)"));
        assert_eq!(
            Kind::of(b"<!DOCTYPE html><html>"),
            Kind::Other("a web page; the download may have failed")
        );
        assert_eq!(Kind::of(b"\x30\x00\x51\xff"), Kind::Other("binary data"));
    }
}
