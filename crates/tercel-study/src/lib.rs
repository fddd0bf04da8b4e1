//! Studies and reports: run trackers over scenarios, score them, draw the result.

pub mod evaluate;
pub mod report;
mod timeline;
