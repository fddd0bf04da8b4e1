//! Studies and reports: run trackers over scenarios, score them, draw the result.
//!
//! | module | what it does |
//! |---|---|
//! | [`evaluate`] | scores tracks against the truth |
//! | [`report`] | draws a recording, its tracks and scores as one HTML file |
//! | [`studies`] | the studies by name |
//! | [`monte_carlo`] | carries out studies whose scenes are drawn, on all cores or several machines |
//! | [`air_traffic`] | the studies of one manoeuvring aircraft |
//! | [`clutter`] | the studies of many manoeuvring objects in clutter |
//! | [`extended`] | the studies of one object that is seen as many points |
//! | [`extended_scene`] | the study of several such objects that cross |
//! | [`autoferry`] | the study on real radar and lidar |
//! | [`tune`] | fits the numbers of a configuration to recordings |

pub mod air_traffic;
pub mod autoferry;
pub mod clutter;
mod error;
pub mod evaluate;
pub mod extended;
pub mod extended_scene;
pub mod monte_carlo;
pub mod paris;
pub mod report;
pub mod studies;
mod table;
mod timeline;
pub mod tune;

pub use error::StudyError;
pub use table::{Figure, Row, StudyTable};
