//! Learned filters at run time: small layers that do not allocate, model files, and the filters made of them.
//!
//! A network is trained elsewhere and arrives as a [`Model`]: its weights with a [`Card`] that says what it is. The [`filter`]
//! module builds filters of models, which fit wherever a classical filter does; [`layer`] has what they are made of, and [`shipped`]
//! the models that come with Tercel.

mod card;
mod error;
pub mod filter;
pub mod layer;
mod model;
pub mod shipped;

pub use card::{Card, DataSizes, SCHEMA, Scale};
pub use error::ModelError;
pub use model::{Model, Tensor, Weights};
