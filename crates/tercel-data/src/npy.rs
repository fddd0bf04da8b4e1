//! Arrays of numbers in NumPy's file format.

use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use crate::{DataError, Place, Spot};

/// An array of 64-bit numbers, the last index running fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Number of entries along each axis.
    pub shape: Vec<usize>,
    /// The entries.
    pub values: Vec<f64>,
}

const HELP: &str = "write it again as numpy.save(path, numpy.ascontiguousarray(array, dtype='<f8'))";

/// Reads a `.npy` file with 64-bit little-endian floating-point numbers in C order.
///
/// ## Reference
/// NumPy enhancement proposal 1, format versions 1 to 3. Pickled objects are refused: they are programs.
///
/// # Errors
/// When the file cannot be read, is not such a file, or ends early.
pub fn read_npy(path: impl AsRef<Path>) -> Result<Array, DataError> {
    let name = path.as_ref().display().to_string();
    let file = std::fs::File::open(path.as_ref()).map_err(|source| failed("open", &name, source))?;
    read_npy_from(file, &name)
}

/// The same from any source of bytes; errors call it by this name.
///
/// ```
/// let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
/// let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 2), }\n";
/// bytes.extend((header.len() as u16).to_le_bytes());
/// bytes.extend(header.as_bytes());
/// bytes.extend([1.0_f64, 2.5].map(f64::to_le_bytes).concat());
///
/// let array = tercel_data::read_npy_from(bytes.as_slice(), "two numbers")?;
/// assert_eq!((array.shape, array.values), (vec![1, 2], vec![1.0, 2.5]));
/// # Ok::<(), tercel_data::DataError>(())
/// ```
///
/// # Errors
/// When the source cannot be read, is no such array, or ends early.
pub fn read_npy_from(mut source: impl Read, name: &str) -> Result<Array, DataError> {
    let mut bytes = Vec::new();
    source.read_to_end(&mut bytes).map_err(|source| failed("read", name, source))?;
    decode(&bytes).map_err(|problem| {
        let place = Place { file: name.into(), spot: Spot::Whole };
        DataError::Corrupt { place, problem, help: HELP }
    })
}

fn failed(action: &'static str, name: &str, source: std::io::Error) -> DataError {
    let file: Arc<str> = name.into();
    DataError::Io { file, action, source }
}

fn decode(bytes: &[u8]) -> Result<Array, String> {
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or("this is no .npy file: its first bytes are others")?;
    let ended = || "the file ends within its header".to_owned();
    let (version, rest) = rest.split_at_checked(2).ok_or_else(ended)?;
    let width = if version[0] == 1 { 2 } else { 4 };
    let (length, rest) = rest.split_at_checked(width).ok_or_else(ended)?;
    let length = length.iter().rev().fold(0, |sum, byte| (sum << 8) | usize::from(*byte));
    let (header, data) = rest.split_at_checked(length).ok_or_else(ended)?;
    let header = String::from_utf8_lossy(header);
    let entry = |name: &str| header.split_once(&format!("'{name}':")).map(|(_, rest)| rest.trim_start());
    if !entry("descr").is_some_and(|kind| kind.starts_with("'<f8'")) {
        return Err("its entries are not 64-bit little-endian floating-point numbers".to_owned());
    }
    if !entry("fortran_order").is_some_and(|order| order.starts_with("False")) {
        return Err("its entries are in Fortran order; expected C order".to_owned());
    }
    let shape =
        entry("shape").and_then(|shape| shape.strip_prefix('(')).and_then(|shape| shape.split_once(')'));
    let shape: Option<Vec<usize>> = shape.and_then(|(shape, _)| {
        let sizes = shape.split(',').map(str::trim).filter(|size| !size.is_empty());
        sizes.map(|size| size.parse().ok()).collect()
    });
    let shape = shape.ok_or("its header does not tell a shape")?;
    let count = shape.iter().try_fold(8_usize, |product, size| product.checked_mul(*size));
    if count != Some(data.len()) {
        let needed = count.map_or("more than fit into memory".to_owned(), |count| count.to_string());
        let has = data.len();
        return Err(format!("it has {has} bytes of data; its shape {shape:?} needs {needed}"));
    }
    let values = data.chunks_exact(8).map(|chunk| {
        let mut number = [0; 8];
        number.copy_from_slice(chunk);
        f64::from_le_bytes(number)
    });
    Ok(Array { shape, values: values.collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, values: &[f64]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        bytes
    }

    #[test]
    fn shape_and_entries_are_read() {
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }\n";
        let array = decode(&file(header, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.5])).unwrap();
        assert_eq!((array.shape, array.values[5]), (vec![2, 3], 6.5));
        let flat = decode(&file(&header.replace("(2, 3)", "(1,)"), &[4.0])).unwrap();
        assert_eq!(flat.shape, [1]);
    }

    #[test]
    fn what_is_something_else_is_refused_with_what_it_is() {
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }\n";
        let good = file(header, &[1.0, 2.0]);
        for (bytes, word) in [
            (b"PAR1".to_vec(), "no .npy"),
            (good[..9].to_vec(), "header"),
            (good[..good.len() - 1].to_vec(), "15 bytes"),
            (file(&header.replace("<f8", "|O"), &[1.0, 2.0]), "64-bit"),
            (file(&header.replace("False", "True"), &[1.0, 2.0]), "Fortran"),
            (file(&header.replace("(2,)", "(18446744073709551615, 9)"), &[1.0]), "shape"),
            (file("{'descr': '<f8', 'fortran_order': False}", &[1.0]), "shape"),
        ] {
            let problem = decode(&bytes).unwrap_err();
            assert!(problem.contains(word), "{problem}");
        }
    }
}
