//! What can be wrong with a model file.

use std::sync::Arc;

/// A model that cannot be read, written or used as asked. Each case names the file.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The operating system refused.
    #[error("{file}: cannot {action}: {source}")]
    Io {
        /// The file.
        file: Arc<str>,
        /// What was tried: "read", "write".
        action: &'static str,
        /// Why it failed.
        source: std::io::Error,
    },
    /// The file is larger than any model of this library.
    #[error("{file}: {bytes} bytes are more than a model may have ({limit}); is it a model of Tercel?")]
    TooLarge {
        /// The file.
        file: Arc<str>,
        /// Its size.
        bytes: u64,
        /// The largest size.
        limit: u64,
    },
    /// No model of this name comes with Tercel.
    #[error("no model `{name}` comes with Tercel; there are: {known}")]
    NotShipped {
        /// The name that was given.
        name: String,
        /// The names that exist.
        known: String,
    },
    /// The file is no safetensors file, or it is damaged or cut short.
    #[error("{file}: not a whole safetensors file: {reason}")]
    Damaged {
        /// The file.
        file: Arc<str>,
        /// What the reader found.
        reason: String,
    },
    /// The file has no model card.
    #[error("{file}: there is no model card: the metadata of a model of Tercel has the key `card`")]
    NoCard {
        /// The file.
        file: Arc<str>,
    },
    /// The model card cannot be understood.
    #[error("{file}: model card: {reason}")]
    Card {
        /// The file.
        file: Arc<str>,
        /// What is wrong, and where.
        reason: String,
    },
    /// The card follows another schema.
    #[error("{file}: model card of schema {found}; this version reads schema {expected}")]
    Schema {
        /// The file.
        file: Arc<str>,
        /// The schema of the card.
        found: String,
        /// The schema that is read.
        expected: u32,
    },
    /// The model is of another kind.
    #[error("{file}: a model of kind `{found}`; expected `{expected}`")]
    Kind {
        /// The file.
        file: Arc<str>,
        /// Kind of the model.
        found: String,
        /// Kind that is needed.
        expected: String,
    },
    /// The model was made for another state.
    #[error("{file}: made for the state [{}]; expected [{}]", found.join(", "), expected.join(", "))]
    State {
        /// The file.
        file: Arc<str>,
        /// Components of the model's state.
        found: Vec<String>,
        /// Components that are needed.
        expected: Vec<String>,
    },
    /// A size or option of the architecture is missing, unknown or impossible.
    #[error("{file}: model card, `hyper`: {reason}")]
    Hyper {
        /// The file.
        file: Arc<str>,
        /// Which, and what was expected.
        reason: String,
    },
    /// A scale is missing or wrong.
    #[error("{file}: model card, scale `{scale}`: {reason}")]
    Scale {
        /// The file.
        file: Arc<str>,
        /// Name of the scale.
        scale: String,
        /// What is wrong, and what was expected.
        reason: String,
    },
    /// A tensor of the architecture is not there.
    #[error("{file}: tensor `{tensor}` is missing; expected shape {expected:?}")]
    Missing {
        /// The file.
        file: Arc<str>,
        /// Name of the tensor.
        tensor: String,
        /// The shape that it should have.
        expected: Vec<usize>,
    },
    /// A tensor does not belong to the architecture.
    #[error("{file}: tensor `{tensor}` of shape {found:?} does not belong to this architecture")]
    Unknown {
        /// The file.
        file: Arc<str>,
        /// Name of the tensor.
        tensor: String,
        /// Its shape.
        found: Vec<usize>,
    },
    /// A tensor has another shape than the architecture says.
    #[error("{file}: tensor `{tensor}` has shape {found:?}; expected {expected:?}")]
    Shape {
        /// The file.
        file: Arc<str>,
        /// Name of the tensor.
        tensor: String,
        /// Its shape.
        found: Vec<usize>,
        /// The shape that it should have.
        expected: Vec<usize>,
    },
    /// A tensor holds other numbers than single precision.
    #[error("{file}: tensor `{tensor}` holds {found}; expected F32")]
    Type {
        /// The file.
        file: Arc<str>,
        /// Name of the tensor.
        tensor: String,
        /// Type of its numbers.
        found: String,
    },
    /// A tensor holds a number that is not finite.
    #[error("{file}: tensor `{tensor}`: number {index} is {value}; expected a finite number")]
    NotFinite {
        /// The file.
        file: Arc<str>,
        /// Name of the tensor.
        tensor: String,
        /// Place of the number, counted row by row from 0.
        index: usize,
        /// The number.
        value: f32,
    },
}
