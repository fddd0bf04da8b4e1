//! Simulated scenarios: truth and detections from a name and a seed.
//!
//! | scenario | module | what happens |
//! |---|---|---|
//! | `atc-train`, `atc-validation`, `atc-test`, `atc-hshm` | [`air_traffic`] | one aircraft that flies straight and turns, seen by a radar |
//! | vehicles, aircraft, crossings | [`extended`] | ellipses that move, seen as many points a scan |
//! | `clutter-partial`, `clutter-all`, `clutter-random` | [`clutter`] | many objects that manoeuvre, among false measurements |
//!
//! A scenario is a value that says from which distributions everything is drawn. What is drawn depends on the seed and on
//! the number of the run alone: run 17 is the same whether it is the only one, one of a thousand, or made on another
//! thread or machine. Truth, measurement errors and missed detections come from separate streams of random numbers
//! ([`Stream`]), so the same flights can be measured again with another radar.
//!
//! ```
//! use tercel_sim::air_traffic::AirTraffic;
//!
//! let scenario = AirTraffic::test();
//! let flight = scenario.flight(7, 17); // seed and run
//! let plots = flight.observe(&flight.radar(), 7, 17);
//! assert_eq!((flight.states().len(), plots.len()), (200, 200));
//! ```

pub mod air_traffic;
pub mod clutter;
mod error;
pub mod extended;
mod interval;
mod stream;

pub use error::SimulationError;
pub use interval::Interval;
pub use stream::Stream;
