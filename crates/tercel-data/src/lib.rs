//! The canonical tables of tracking, and how they come in and go out.

pub mod table;
