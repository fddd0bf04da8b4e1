//! Positions on the Earth and local frames.
//!
//! Trackers work in metres in a plane; sensors and recordings speak of latitude, longitude and altitude. A [`LocalFrame`]
//! joins the two.
//!
//! | type | holds | frame |
//! |---|---|---|
//! | [`Geodetic`] | latitude, longitude (rad), altitude (m) | WGS84 ellipsoid |
//! | `Vector3` "ECEF" | x, y, z (m) | Earth-centred, Earth-fixed: x to 0° N 0° E, z to the north pole |
//! | `Vector3` "ENU" | east, north, up (m) | [`LocalFrame`] at an origin |
//! | `Vector3` "NED" | north, east, down (m) | the same frame, as aircraft use it: [`enu_to_ned`] |
//!
//! ```
//! use tercel_core::geo::{Geodetic, LocalFrame};
//!
//! let radar = LocalFrame::new(Geodetic::from_degrees(63.4389, 10.3991, 10.0))?;
//! let boat = radar.to_enu(&Geodetic::from_degrees(63.4400, 10.4020, 0.0));
//! assert!((boat.x - 145.0).abs() < 1.0 && (boat.y - 122.6).abs() < 1.0);
//! # Ok::<(), tercel_core::error::FilterError>(())
//! ```

mod geodetic;
mod local;
#[cfg(test)]
mod tests;

pub use geodetic::{FLATTENING, Geodetic, SEMI_MAJOR_AXIS};
pub use local::{LocalFrame, enu_to_ned, ned_to_enu};
