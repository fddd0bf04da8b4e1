//! The mathematics of tracking: beliefs about objects, how they move, how they are seen, and the filters and
//! multi-object trackers made of these.
//!
//! Everything here is plain computation: no files, no clock, no threads. One idea carries it: a *belief* is a
//! value, and a [`Filter`](filter::Filter) is a set of functions on that value. A Kalman filter, an interacting
//! multiple model filter and a learned filter differ only in what their belief holds, so every multi-object
//! tracker in [`multi`] takes any of them.
//!
//! | folder | what it holds |
//! |---|---|
//! | [`belief`] | what is known about one object: Gaussian, ... |
//! | [`motion`] | how objects move over a time step |
//! | [`sensor`] | what a sensor would measure |
//! | [`filter`] | recursions for one object |
//! | [`extended`] | objects that give many points: extents, and filters that estimate them |
//! | [`association`] | gating and assignment of measurements |
//! | [`multi`] | trackers for many objects in clutter |
//! | [`metric`] | how good the tracks are |
//! | [`geo`] | positions on the Earth and local frames |
//!
//! Units are SI and angles are radians everywhere.

pub mod association;
pub mod belief;
#[cfg(feature = "conformance")]
pub mod conformance;
pub mod error;
pub mod extended;
pub mod filter;
pub mod geo;
pub mod metric;
pub mod motion;
pub mod multi;
pub mod sensor;
