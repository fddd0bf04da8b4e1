//! association

mod assignment;

pub use assignment::{Assignment, AssignmentError, AssignmentSolver};
