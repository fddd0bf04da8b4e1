//! Model files: weights as safetensors, with a card.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use crate::card::{Card, CardError, SCHEMA};
use crate::error::ModelError;

/// The key of the card in the metadata of the file.
const CARD: &str = "card";

/// Largest size of a model file, bytes. Models that run once per detection are a thousand times smaller.
const LIMIT: u64 = 1 << 30;

/// Numbers in single precision, with a shape; row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Tensor {
    /// Lengths of the dimensions.
    pub shape: Vec<usize>,
    /// The numbers: as many as the product of the lengths.
    pub values: Vec<f32>,
}

/// A model: named tensors of finite numbers, and a card.
///
/// ```
/// use std::collections::BTreeMap;
/// use tercel_neural::{Card, Model, Tensor};
///
/// let gain = Tensor { shape: vec![2, 2], values: vec![1.0, 0.0, 0.0, 1.0] };
/// let card = Card::new("example", "kalman-net", &["x", "y", "vx", "vy"]);
/// let model = Model::new(card, BTreeMap::from([("gain.weight".to_owned(), gain)]))?;
/// let read = Model::from_bytes("example", &model.to_bytes()?)?;
/// assert_eq!(read.tensors(), model.tensors());
/// # Ok::<(), tercel_neural::ModelError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    file: Arc<str>,
    card: Card,
    tensors: BTreeMap<String, Tensor>,
}

impl Model {
    /// A model of this card and these tensors. Errors about it name the model instead of a file.
    ///
    /// # Errors
    /// When the card does not make sense, or a tensor has not as many numbers as its shape says or one that is not finite.
    pub fn new(card: Card, tensors: BTreeMap<String, Tensor>) -> Result<Self, ModelError> {
        Model::checked(card.name.as_str().into(), card, tensors)
    }

    /// Reads a model file.
    ///
    /// # Errors
    /// When the file cannot be read, is damaged or too large, has no card that is understood, or holds a tensor of another
    /// type or with a number that is not finite.
    pub fn open(path: &Path) -> Result<Self, ModelError> {
        let file: Arc<str> = path.display().to_string().into();
        let failed = |source| ModelError::Io { file: file.clone(), action: "read", source };
        let opened = std::fs::File::open(path).map_err(failed)?;
        let bytes = opened.metadata().map_err(failed)?.len();
        let mut content = Vec::new();
        // The length of what is no regular file is not known beforehand, so the reading is limited too.
        if bytes <= LIMIT {
            opened.take(LIMIT + 1).read_to_end(&mut content).map_err(failed)?;
        }
        let bytes = bytes.max(content.len() as u64);
        if bytes > LIMIT {
            return Err(ModelError::TooLarge { file, bytes, limit: LIMIT });
        }
        Model::from_bytes(&file, &content)
    }

    /// Reads a model from the content of its file. Errors call it `name`.
    ///
    /// # Errors
    /// As [`open`](Model::open).
    pub fn from_bytes(name: &str, bytes: &[u8]) -> Result<Self, ModelError> {
        let file: Arc<str> = name.into();
        let damaged = |error: safetensors::SafeTensorError| ModelError::Damaged {
            file: file.clone(),
            reason: error.to_string(),
        };
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(damaged)?;
        let card = header.metadata().as_ref().and_then(|metadata| metadata.get(CARD));
        let card = card.ok_or_else(|| ModelError::NoCard { file: file.clone() })?;
        let card = Card::from_json(card).map_err(|error| refused(&file, error))?;
        let mut tensors = BTreeMap::new();
        for (tensor, view) in SafeTensors::deserialize(bytes).map_err(damaged)?.tensors() {
            if view.dtype() != Dtype::F32 {
                return Err(ModelError::Type { file, tensor, found: view.dtype().to_string() });
            }
            let numbers = view.data().as_chunks::<4>().0;
            let values = numbers.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
            tensors.insert(tensor, Tensor { shape: view.shape().to_vec(), values });
        }
        Model::checked(file, card, tensors)
    }

    fn checked(file: Arc<str>, card: Card, tensors: BTreeMap<String, Tensor>) -> Result<Self, ModelError> {
        let card = card.checked().map_err(|error| refused(&file, error))?;
        for (name, tensor) in &tensors {
            let count = tensor.shape.iter().try_fold(1_usize, |count, length| count.checked_mul(*length));
            if count != Some(tensor.values.len()) {
                let (tensor, found) = (name.clone(), vec![tensor.values.len()]);
                return Err(ModelError::Shape { file, tensor, found, expected: tensors[name].shape.clone() });
            }
            if let Some(index) = tensor.values.iter().position(|value| !value.is_finite()) {
                let (tensor, value) = (name.clone(), tensor.values[index]);
                return Err(ModelError::NotFinite { file, tensor, index, value });
            }
        }
        Ok(Model { file, card, tensors })
    }

    /// The card.
    pub fn card(&self) -> &Card {
        &self.card
    }

    /// The tensors, by name.
    pub fn tensors(&self) -> &BTreeMap<String, Tensor> {
        &self.tensors
    }

    /// What errors call the model: its file, or its name.
    pub fn file(&self) -> &Arc<str> {
        &self.file
    }

    /// Accepts the model only as one of this kind, made for this state.
    ///
    /// # Errors
    /// Names what the model is and what was expected.
    pub fn expect(&self, kind: &str, state: &[&str]) -> Result<(), ModelError> {
        let file = self.file.clone();
        if self.card.kind != kind {
            return Err(ModelError::Kind { file, found: self.card.kind.clone(), expected: kind.to_owned() });
        }
        if self.card.state != state {
            let expected = state.iter().map(|label| (*label).to_owned()).collect();
            return Err(ModelError::State { file, found: self.card.state.clone(), expected });
        }
        Ok(())
    }

    /// The tensors, to be taken one after the other.
    pub fn weights(&self) -> Weights<'_> {
        Weights { model: self, taken: BTreeSet::new() }
    }

    /// The content of the model's file.
    ///
    /// # Errors
    /// When the card cannot be written.
    pub fn to_bytes(&self) -> Result<Vec<u8>, ModelError> {
        let refused = |reason| ModelError::Card { file: self.file.clone(), reason };
        let metadata = HashMap::from([(CARD.to_owned(), self.card.to_json().map_err(refused)?)]);
        let content: Vec<(&String, &Tensor, Vec<u8>)> = self
            .tensors
            .iter()
            .map(|(name, tensor)| {
                (name, tensor, tensor.values.iter().flat_map(|x| x.to_le_bytes()).collect())
            })
            .collect();
        let views: Result<Vec<_>, _> = content
            .iter()
            .map(|(name, tensor, bytes)| {
                Ok((*name, TensorView::new(Dtype::F32, tensor.shape.clone(), bytes)?))
            })
            .collect();
        let bytes = views.and_then(|views| safetensors::serialize(views, Some(metadata)));
        bytes.map_err(|error| ModelError::Damaged { file: self.file.clone(), reason: error.to_string() })
    }

    /// Writes the model, and its card as TOML beside it: `model.safetensors` and `model.toml`.
    ///
    /// Both are written in full beside their targets before either takes its place, so a full disk or an interruption leaves
    /// the old model as it was.
    ///
    /// # Errors
    /// When the card cannot be written as TOML, or a file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), ModelError> {
        let refused = |reason| ModelError::Card { file: self.file.clone(), reason };
        let twin = path.with_extension("toml");
        if twin == path {
            return Err(refused("the file of a model cannot end in `.toml`: its card has that name".into()));
        }
        let (bytes, card) = (self.to_bytes()?, self.card.to_toml().map_err(refused)?);
        let model = Pending::write(path, &bytes)?;
        let card = Pending::write(&twin, card.as_bytes())?;
        model.finish()?;
        card.finish()
    }
}

fn refused(file: &Arc<str>, error: CardError) -> ModelError {
    let file = file.clone();
    match error {
        CardError::Schema(found) => ModelError::Schema { file, found, expected: SCHEMA },
        CardError::Content(reason) => ModelError::Card { file, reason },
    }
}

/// A complete file that has not yet taken the place of its target.
struct Pending {
    target: PathBuf,
    file: tempfile::NamedTempFile,
}

impl Pending {
    fn write(target: &Path, content: &[u8]) -> Result<Self, ModelError> {
        let failed = |source| write_error(target, source);
        if target.is_dir() {
            return Err(failed(std::io::ErrorKind::IsADirectory.into()));
        }
        let mut builder = tempfile::Builder::new();
        builder.prefix(".tercel-").suffix(".part");
        // The rights of any new file; those of a temporary one keep others from reading it.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut file = builder.tempfile_in(folder(target)).map_err(failed)?;
        file.write_all(content).and_then(|()| file.as_file().sync_all()).map_err(failed)?;
        Ok(Pending { target: target.to_path_buf(), file })
    }

    fn finish(self) -> Result<(), ModelError> {
        let Pending { target, file } = self;
        file.persist(&target).map_err(|error| write_error(&target, error.error))?;
        // The name is on the disk only when the folder is. Not every file system can do this, and the content is safe.
        let _ = std::fs::File::open(folder(&target)).and_then(|folder| folder.sync_all());
        Ok(())
    }
}

fn folder(target: &Path) -> &Path {
    target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn write_error(target: &Path, source: std::io::Error) -> ModelError {
    ModelError::Io { file: target.display().to_string().into(), action: "write", source }
}

/// The tensors of a model, taken one after the other by the network that is built of them.
///
/// A network takes what its architecture needs and then calls [`finish`](Weights::finish), which refuses a model that has more.
#[derive(Debug)]
pub struct Weights<'a> {
    model: &'a Model,
    taken: BTreeSet<String>,
}

impl<'a> Weights<'a> {
    /// The numbers of a tensor.
    ///
    /// # Errors
    /// When there is no tensor of that name, or it has another shape.
    pub fn take(&mut self, tensor: &str, shape: &[usize]) -> Result<&'a [f32], ModelError> {
        let file = self.model.file.clone();
        let expected = shape.to_vec();
        let Some(found) = self.model.tensors.get(tensor) else {
            return Err(ModelError::Missing { file, tensor: tensor.to_owned(), expected });
        };
        if found.shape != shape {
            let (tensor, found) = (tensor.to_owned(), found.shape.clone());
            return Err(ModelError::Shape { file, tensor, found, expected });
        }
        self.taken.insert(tensor.to_owned());
        Ok(&found.values)
    }

    /// Says that everything was taken.
    ///
    /// # Errors
    /// Names the first tensor that was not.
    pub fn finish(self) -> Result<(), ModelError> {
        match self.model.tensors.iter().find(|(name, _)| !self.taken.contains(*name)) {
            None => Ok(()),
            Some((tensor, found)) => Err(ModelError::Unknown {
                file: self.model.file.clone(),
                tensor: tensor.clone(),
                found: found.shape.clone(),
            }),
        }
    }
}
