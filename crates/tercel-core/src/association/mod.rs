//! Which measurement may belong to which object.

mod assignment;
pub(crate) mod clusters;
mod gate;
mod k_best;
mod marginals;
mod search;
mod threshold;

pub use assignment::{Assignment, AssignmentError, AssignmentSolver};
pub use gate::PlaceIndex;
pub use k_best::{KBest, Ranked};
pub use marginals::Marginals;
pub use search::{Region, Search};
pub use threshold::Gate;
