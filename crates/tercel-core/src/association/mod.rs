//! Which measurement may belong to which object.

mod assignment;
mod gate;
mod threshold;

pub use assignment::{Assignment, AssignmentError, AssignmentSolver};
pub use gate::PlaceIndex;
pub use threshold::Gate;
