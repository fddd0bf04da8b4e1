//! Turn sensor detections into tracks.
//!
//! A *belief* is a value: what is known of one object. A [`Filter`](filter::Filter) is a set of functions on it: predict it
//! over a time step, update it with a measurement. A [`Tracker`](multi::Tracker) finds the objects among the detections of a
//! scan, with any filter. So a tracker is three choices: how objects move, what the sensor measures, and how objects are found.
//!
//! ```
//! use tercel::prelude::*;
//!
//! // Boats that move straight on, a radar with errors of 5 m that sees nine of ten, five false plots a scan on a km².
//! let filter = Kalman::new(ConstantVelocity::new(0.1).with_speed(10.0), Position::new(5.0)?);
//! let (detection, clutter) = (Detection::uniform(0.9)?, Clutter::per_scan(5.0, 1e6)?);
//! let mut tracker = NearestNeighbour::<Gaussian<4>>::new(NearestNeighbourConfig::default())?;
//!
//! for second in 0..10 {
//!     let time = f64::from(second);
//!     let plots = [[6.0 * time, 0.0], [400.0, 300.0 - 8.0 * time]].map(Measurement::from);
//!     tracker.step(&filter, &Scan { time, measurements: &plots, detection: &detection, clutter: &clutter })?;
//! }
//! for track in tracker.tracks() {
//!     let [x, y, vx, vy] = track.belief.mean.into();
//!     println!("{} is at ({x:.0}, {y:.0}) m and moves with ({vx:.1}, {vy:.1}) m/s", track.id);
//! }
//! assert_eq!(tracker.tracks().iter().filter(|track| track.status == Status::Confirmed).count(), 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Each choice may be another one, and nothing else changes:
//!
//! - **the motion**: a [`TurnBank`](filter::TurnBank) follows aircraft that manoeuvre, any filters in an [`Imm`](filter::Imm)
//!   whatever else changes its motion, and the learned filters of [`neural`] what models do not say;
//! - **the sensor**: [`RangeBearing`](sensor::RangeBearing) with an [`Extended`](filter::Extended) or an
//!   [`Unscented`](filter::Unscented) filter, [`ConvertedPolar`](sensor::ConvertedPolar) with a [`Kalman`](filter::Kalman) filter;
//!   the filter goes in with each scan, so sensors may move and several may feed one tracker;
//! - **the tracker**: [`Phd`](multi::Phd) where clutter is dense, with the same filters.
//!
//! Recordings come in and tracks go out as tables ([`data`]), a TOML file describes a whole tracker at run time
//! ([`pipeline`]), and tracks are scored and drawn by [`study`]. The program `tercel` is made of these three.
//!
//! Units are SI, angles are radians from `x` (east) towards `y` (north), and states are ordered by derivative: positions,
//! velocities, then the rest.

#[doc(inline)]
pub use tercel_core::{association, belief, error, filter, geo, metric, motion, multi, sensor};
#[doc(inline)]
pub use tercel_data as data;
#[doc(inline)]
pub use tercel_neural as neural;
#[doc(inline)]
pub use tercel_pipeline as pipeline;
#[doc(inline)]
pub use tercel_sim as sim;
#[doc(inline)]
pub use tercel_study as study;

/// What most trackers are written with.
pub mod prelude {
    pub use tercel_core::belief::Gaussian;
    pub use tercel_core::error::FilterError;
    pub use tercel_core::filter::{
        Estimate, Extended, Filter, Imm, ImmBelief, Innovation, Kalman, Padded, Particle, RaoBlackwellised,
        Transition, TurnBank, Unscented,
    };
    pub use tercel_core::metric::{Gospa, Ospa, TrajectoryGospa};
    pub use tercel_core::motion::{
        ConstantAcceleration, ConstantVelocity, CoordinatedTurn, Motion, RandomWalk, Singer, Turn,
    };
    pub use tercel_core::multi::{
        Clutter, ClutterMap, Confirmation, Detection, Management, NearestNeighbour, NearestNeighbourConfig,
        Phd, PhdConfig, Scan, Status, Track, Tracker, TrackerError,
    };
    pub use tercel_core::sensor::{
        BearingOnly, ConvertedPolar, Measurement, Position, RangeBearing, RangeBearingRate, Sensor,
    };
}

/// The example of the README.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
