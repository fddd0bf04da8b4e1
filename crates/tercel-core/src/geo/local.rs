//! A frame that touches the Earth at one place.

use nalgebra::{Matrix3, Vector3, matrix, vector};

use super::Geodetic;
use crate::error::FilterError;

/// East, north and up at an origin: a Cartesian frame, fixed to the Earth, in which trackers work.
///
/// ## Definition
/// With the origin at latitude `φ`, longitude `λ` and Earth-centred position `o`:
/// ```text
///                      | -sin λ          cos λ         0     |
/// enu = R (x - o), R = | -sin φ cos λ   -sin φ sin λ   cos φ |
///                      |  cos φ cos λ    cos φ sin λ   sin φ |
/// ```
/// The frame is exact and does not bend with the Earth: at 100 km from the origin the ground lies 780 m below its plane.
/// Velocities rotate as positions do, because the frame does not move.
///
/// ## Reference
/// EPSG guidance note 7-2, method 9837 (geographic/topocentric conversions).
///
/// ```
/// use tercel_core::geo::{Geodetic, LocalFrame};
/// use nalgebra::vector;
///
/// let frame = LocalFrame::new(Geodetic::from_degrees(55.0, 12.0, 0.0))?;
/// let place = frame.from_enu(&vector![3000.0, -4000.0, 200.0]);
/// assert!((frame.to_enu(&place) - vector![3000.0, -4000.0, 200.0]).norm() < 1e-7);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalFrame {
    origin: Geodetic,
    centre: Vector3<f64>,
    rotation: Matrix3<f64>,
}

impl LocalFrame {
    /// A frame at `origin`. At a pole the longitude says where north points, as everywhere.
    ///
    /// # Errors
    /// When the origin is not finite or its latitude is beyond a pole, which mostly means degrees in place of radians.
    pub fn new(origin: Geodetic) -> Result<Self, FilterError> {
        let Geodetic { latitude, longitude, altitude } = origin;
        if !(longitude.is_finite() && altitude.is_finite()) {
            return Err(FilterError::NotFinite { what: "origin of the local frame" });
        }
        if latitude.is_nan() || latitude.abs() > std::f64::consts::FRAC_PI_2 {
            let (parameter, expected) = ("latitude", "must be radians between -π/2 and π/2");
            return Err(FilterError::Parameter { parameter, value: latitude, expected });
        }
        let (sin_latitude, cos_latitude) = latitude.sin_cos();
        let (sin_longitude, cos_longitude) = longitude.sin_cos();
        let rotation = matrix![
            -sin_longitude, cos_longitude, 0.0;
            -sin_latitude * cos_longitude, -sin_latitude * sin_longitude, cos_latitude;
            cos_latitude * cos_longitude, cos_latitude * sin_longitude, sin_latitude
        ];
        Ok(LocalFrame { origin, centre: origin.to_ecef(), rotation })
    }

    /// Where the frame touches the Earth.
    pub fn origin(&self) -> Geodetic {
        self.origin
    }

    /// East, north and up of a place, m.
    pub fn to_enu(&self, place: &Geodetic) -> Vector3<f64> {
        self.ecef_to_enu(&place.to_ecef())
    }

    /// The place at these east, north and up coordinates, m.
    #[allow(clippy::wrong_self_convention)] // the frame converts; it is not what is made
    pub fn from_enu(&self, enu: &Vector3<f64>) -> Geodetic {
        Geodetic::from_ecef(&self.enu_to_ecef(enu))
    }

    /// East, north and up of an Earth-centred position, m.
    pub fn ecef_to_enu(&self, ecef: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * (ecef - self.centre)
    }

    /// The Earth-centred position at these east, north and up coordinates, m.
    pub fn enu_to_ecef(&self, enu: &Vector3<f64>) -> Vector3<f64> {
        self.centre + self.rotation.tr_mul(enu)
    }

    /// A velocity relative to the Earth, from Earth-centred axes to east, north and up, m/s.
    pub fn velocity_to_enu(&self, ecef: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * ecef
    }

    /// A velocity relative to the Earth, from east, north and up to Earth-centred axes, m/s.
    pub fn velocity_from_enu(&self, enu: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.tr_mul(enu)
    }
}

/// North, east and down of a vector given as east, north and up.
pub fn enu_to_ned(enu: &Vector3<f64>) -> Vector3<f64> {
    vector![enu.y, enu.x, -enu.z]
}

/// East, north and up of a vector given as north, east and down.
pub fn ned_to_enu(ned: &Vector3<f64>) -> Vector3<f64> {
    vector![ned.y, ned.x, -ned.z]
}
