//! What is known about one object: values without behaviour of their own.

mod gaussian;
pub(crate) mod positive;

pub use gaussian::Gaussian;
pub use positive::Cholesky;
