//! Files that appear whole or not at all, and tensors in them.

use std::collections::HashMap;
use std::io::Write;
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use crate::TrainError;

/// A tensor on its way to or from a file: name, shape, values in row-major order.
pub type Named = (String, Vec<usize>, Vec<f32>);

/// Writes a file beside its target, flushes it to the disk, and renames it: an interrupted or failed write
/// leaves the old file.
///
/// # Errors
///
/// If the directory or the file cannot be written.
pub fn write(path: &Path, contents: &[u8]) -> Result<(), TrainError> {
    let attempt = || {
        let mut file = tempfile::NamedTempFile::new_in(directory(path))?;
        file.write_all(contents)?;
        file.as_file().sync_all()?;
        file.persist(path).map_err(|error| error.error)?;
        Ok(())
    };
    attempt().map_err(|source| TrainError::File { path: path.to_owned(), source })
}

/// Checks that a file could be written, so that a training does not find out after its first epoch.
///
/// # Errors
///
/// If its directory cannot be written to, or the path is a directory.
pub fn probe(path: &Path) -> Result<(), TrainError> {
    let attempt = || {
        if path.is_dir() {
            return Err(std::io::Error::from(std::io::ErrorKind::IsADirectory));
        }
        tempfile::NamedTempFile::new_in(directory(path)).map(drop)
    };
    attempt().map_err(|source| TrainError::File { path: path.to_owned(), source })
}

fn directory(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Tensors and metadata as the bytes of a safetensors file.
///
/// # Errors
///
/// If two tensors have one name or values do not fill a shape, which is a mistake of the caller.
pub fn pack(
    tensors: impl IntoIterator<Item = Named>,
    metadata: HashMap<String, String>,
) -> Result<Vec<u8>, TrainError> {
    let bytes: Vec<_> = tensors
        .into_iter()
        .map(|(name, shape, values)| {
            let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
            (name, shape, bytes)
        })
        .collect();
    let fault = |name: &str, error: safetensors::SafeTensorError| TrainError::Parameter {
        name: name.to_owned(),
        problem: error.to_string(),
    };
    let views = bytes
        .iter()
        .map(|(name, shape, bytes)| {
            let view =
                TensorView::new(Dtype::F32, shape.clone(), bytes).map_err(|error| fault(name, error))?;
            Ok((name.as_str(), view))
        })
        .collect::<Result<Vec<_>, TrainError>>()?;
    safetensors::serialize(views, Some(metadata)).map_err(|error| fault("file", error))
}

/// The tensors and metadata in the bytes of a safetensors file, or what is wrong with it.
///
/// # Errors
///
/// If it is damaged, or a tensor is not of 32-bit floats; the tensor is named.
pub fn unpack(bytes: &[u8]) -> Result<(Vec<Named>, HashMap<String, String>), String> {
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|error| error.to_string())?;
    let file = SafeTensors::deserialize(bytes).map_err(|error| error.to_string())?;
    let mut tensors = Vec::new();
    for (name, view) in file.tensors() {
        if view.dtype() != Dtype::F32 {
            return Err(format!("tensor {name} holds {:?}, but F32 is needed", view.dtype()));
        }
        let (whole, _) = view.data().as_chunks::<4>();
        tensors.push((
            name,
            view.shape().to_vec(),
            whole.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect(),
        ));
    }
    Ok((tensors, header.metadata().clone().unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tensors_come_back_bit_for_bit() {
        let tensors = vec![
            ("a".to_owned(), vec![2, 2], vec![1.0, -0.0, f32::MIN_POSITIVE, 1e-45]),
            ("b".to_owned(), vec![1], vec![0.1]),
        ];
        let metadata = HashMap::from([("key".to_owned(), "value \"quoted\"".to_owned())]);
        let (found, found_metadata) = unpack(&pack(tensors.clone(), metadata.clone()).unwrap()).unwrap();
        let bits = |tensors: &[Named]| -> Vec<Vec<u32>> {
            tensors.iter().map(|(.., values)| values.iter().map(|value| value.to_bits()).collect()).collect()
        };
        let mut found = found;
        found.sort_by(|a, b| a.0.cmp(&b.0));
        assert_eq!(bits(&found), bits(&tensors));
        assert_eq!(found_metadata, metadata);
    }

    #[test]
    fn a_failed_write_leaves_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model");
        write(&path, b"old").unwrap();
        assert!(write(&folder.path().join("missing").join("model"), b"new").is_err());
        assert!(probe(folder.path()).is_err());
        assert!(probe(&path).is_ok());
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
    }

    #[test]
    fn a_truncated_file_is_refused() {
        let bytes = pack(vec![("a".to_owned(), vec![3], vec![1.0; 3])], HashMap::new()).unwrap();
        for length in 0..bytes.len() {
            assert!(unpack(&bytes[..length]).is_err(), "{length} bytes");
        }
    }
}
