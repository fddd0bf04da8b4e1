//! The canonical tables of tracking, and how they come in and go out.
//!
//! There are four [tables](table): detections, tracks, truth and metrics. Each has one set of columns, in SI units
//! and radians, and is the same in CSV, Parquet and NDJSON; the ending of a file's name chooses the format.
//! Recordings of other programs come in by [`import()`].
//!
//! ```
//! use tercel_data::{ReadOptions, read_detections, write_detections};
//!
//! let folder = tempfile::tempdir()?;
//! let csv = folder.path().join("radar.csv");
//! std::fs::write(&csv, "time,sensor,x,y\n0.0,radar,120.0,30.5\n1.0,radar,121.5,29.0\n")?;
//!
//! let detections = read_detections(&csv, &ReadOptions::default())?;
//! assert_eq!(detections.scans.len(), 2);
//!
//! let parquet = folder.path().join("radar.parquet");
//! write_detections(&parquet, &detections)?;
//! assert_eq!(read_detections(&parquet, &ReadOptions::default())?, detections);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Tables of other programs may have other names, units, times and dialects; [`ReadOptions`] say what their content
//! does not tell. Readers refuse what does not fit, and say where it stands, what was expected and what helps ([`DataError`]).
//! Writers put a file in its place only when it is complete ([`AtomicFile`]).

mod column;
mod error;
mod format;
mod geographic;
pub mod import;
mod layout;
mod metadata;
mod names;
pub mod ndjson;
mod npy;
mod options;
mod output;
mod read;
mod remarks;
mod sheet;
mod source;
pub mod table;
mod time;
mod unit;
mod write;

pub use column::Angles;
pub use error::{DataError, Place, Spot};
pub use format::Format;
pub use import::{ImportOptions, Imported, LeftOut, Recording, Source, import, import_from};
pub use metadata::SCHEMA_VERSION;
pub use npy::{Array, read_npy, read_npy_from};
pub use options::{Bearings, DateOrder, OnError, ReadOptions};
pub use output::AtomicFile;
pub use read::{
    import_table_from, read_detections, read_detections_from, read_metrics, read_metrics_from, read_tracks,
    read_tracks_from, read_truths, read_truths_from,
};
pub use unit::Unit;
pub use write::{
    TracksWriter, write_detections, write_detections_to, write_metrics, write_metrics_to, write_tracks,
    write_tracks_to, write_truths, write_truths_to,
};
