//! A tracker described by a TOML file, for scans whose kind is known only at run time.
//!
//! [`Config`] says which sensors there are, how objects move, which filter estimates them and which tracker finds them.
//! [`Pipeline`] is what it describes: scans of the canonical tables in, rows of the track table out.
//!
//! ```
//! use tercel_pipeline::{Config, Pipeline};
//! use tercel_data::table::{Detection, Observation, Scan};
//!
//! let config = Config::parse(
//!     r#"
//!     [motion]
//!     constant_velocity = { acceleration_density = 0.5, speed = 15.0 }
//!
//!     [sensors.radar]
//!     measures = { position = { deviation = 5.0 } }
//!     clutter = { uniform = { density = 1e-6 } }
//!     "#,
//! )?;
//! let mut pipeline = Pipeline::new(&config)?;
//! let observation = Observation::Position { x: 100.0, y: 50.0, z: None };
//! let detection = Detection::new(1, observation);
//! let scan = Scan::new(0.0, "radar", vec![detection]);
//! let rows = pipeline.push(scan)?;
//! assert_eq!(rows[0].state, [100.0, 50.0, 0.0, 0.0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod advice;
mod antenna;
mod carrier;
pub mod config;
mod engine;
mod error;
mod estimator;
mod learned;
mod names;
mod notice;
mod numbered;
mod pipeline;
mod reorder;
mod repeats;
mod sensors;
mod slant;
mod turns;
mod understood;

pub use advice::advice;
pub use config::Config;
pub use error::PipelineError;
pub use notice::Notice;
pub use pipeline::{Pipeline, Summary};

#[cfg(test)]
mod tests;
