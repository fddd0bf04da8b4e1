//! Latitude, longitude and altitude on the WGS84 ellipsoid.

use nalgebra::{Vector3, vector};

/// Semi-major axis of the WGS84 ellipsoid, m.
pub const SEMI_MAJOR_AXIS: f64 = 6_378_137.0;
/// Flattening of the WGS84 ellipsoid.
pub const FLATTENING: f64 = 1.0 / 298.257_223_563;

const SEMI_MINOR_AXIS: f64 = SEMI_MAJOR_AXIS * (1.0 - FLATTENING);
/// First eccentricity squared, `1 - b²/a²`.
const ECCENTRICITY2: f64 = FLATTENING * (2.0 - FLATTENING);
/// Second eccentricity squared, `a²/b² - 1`.
const SECOND_ECCENTRICITY2: f64 = ECCENTRICITY2 / ((1.0 - FLATTENING) * (1.0 - FLATTENING));

/// A place relative to the WGS84 ellipsoid.
///
/// ## Definition
/// With `N = a / sqrt(1 - e² sin²φ)`, latitude `φ`, longitude `λ` and altitude `h` above the ellipsoid (not above the sea):
/// ```text
/// x = (N + h) cos φ cos λ
/// y = (N + h) cos φ sin λ
/// z = (N (1 - e²) + h) sin φ
/// ```
/// The way back looks for the nearest point of the ellipsoid. In the meridian plane, with `r² = x² + y²`, that point
/// follows from the positive root `w` of a falling convex function, which Newton's method reaches from below without
/// overshooting:
/// ```text
/// (a r / (b² (w + e'²)))² + (z / (b w))² = 1,      tan φ = z (w + e'²) / (r w)
/// ```
/// It holds everywhere: on the axis, on the equator, deep inside the Earth and far out. Where several points of the ellipsoid
/// are equally near (on the equatorial disc within 43 km of the centre), the northern one is taken.
///
/// ## Accuracy
/// There and back again agree to 1e-12 rad and 1e-7 m from the centre of the Earth to 40 000 km above it, apart from the
/// disc just named, where latitude is ill-conditioned and only the place agrees (to 1e-7 m). Tests hold this.
///
/// ## Reference
/// NGA.STND.0036, "World Geodetic System 1984" (2014), for the constants; EPSG guidance note 7-2, method 9602. The root is
/// that of the distance from a point to an ellipse (Eberly, "Distance from a point to an ellipse", 2013), which has no
/// exceptions near the poles as the usual fixed-point iterations have.
///
/// ```
/// use tercel_core::geo::Geodetic;
///
/// let paris = Geodetic::from_degrees(48.8583, 2.2945, 330.0);
/// let back = Geodetic::from_ecef(&paris.to_ecef());
/// assert!((back.latitude - paris.latitude).abs() < 1e-12);
/// assert!((back.altitude - paris.altitude).abs() < 1e-7);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Geodetic {
    /// Latitude, rad, north positive, in [-π/2, π/2].
    pub latitude: f64,
    /// Longitude, rad, east positive. What this library returns lies in [-π, π].
    pub longitude: f64,
    /// Height above the ellipsoid, m.
    pub altitude: f64,
}

impl Geodetic {
    /// A place from latitude and longitude in degrees and altitude in metres.
    pub fn from_degrees(latitude: f64, longitude: f64, altitude: f64) -> Self {
        Geodetic { latitude: latitude.to_radians(), longitude: longitude.to_radians(), altitude }
    }

    /// Earth-centred, Earth-fixed coordinates, m.
    pub fn to_ecef(&self) -> Vector3<f64> {
        let (sin_latitude, cos_latitude) = self.latitude.sin_cos();
        let (sin_longitude, cos_longitude) = self.longitude.sin_cos();
        let curvature = SEMI_MAJOR_AXIS / (1.0 - ECCENTRICITY2 * sin_latitude * sin_latitude).sqrt();
        let across = (curvature + self.altitude) * cos_latitude;
        vector![
            across * cos_longitude,
            across * sin_longitude,
            (curvature * (1.0 - ECCENTRICITY2) + self.altitude) * sin_latitude
        ]
    }

    /// The place with these Earth-centred, Earth-fixed coordinates, m.
    ///
    /// Coordinates that are not finite give a place that is not a number.
    pub fn from_ecef(ecef: &Vector3<f64>) -> Self {
        let across = ecef.x.hypot(ecef.y);
        let (latitude, altitude) = meridian(across, ecef.z.abs());
        let latitude = if ecef.z < 0.0 { -latitude } else { latitude };
        Geodetic { latitude, longitude: ecef.y.atan2(ecef.x), altitude }
    }
}

/// Latitude and altitude of the point at `across` from the axis and `along` above the equator, both non-negative.
fn meridian(across: f64, along: f64) -> (f64, f64) {
    let (numerator, tall) =
        (SEMI_MAJOR_AXIS * across / (SEMI_MINOR_AXIS * SEMI_MINOR_AXIS), along / SEMI_MINOR_AXIS);
    let mut root = tall.max(numerator - SECOND_ECCENTRICITY2);
    if root <= 0.0 {
        return disc(across);
    }
    // Rounding ends the climb after a dozen steps at most; the bound is for numbers that are not finite.
    for _ in 0..100 {
        let (wide, high) = (numerator / (root + SECOND_ECCENTRICITY2), tall / root);
        let slope = wide * wide / (root + SECOND_ECCENTRICITY2) + high * high / root;
        let next = root + 0.5 * (wide * wide + high * high - 1.0) / slope;
        if next <= root {
            break;
        }
        root = next;
    }
    let latitude = (along * (root + SECOND_ECCENTRICITY2)).atan2(across * root);
    (latitude, height(across, along, latitude))
}

/// The equatorial disc inside the evolute of the ellipse, where the nearest point lies off the equator.
fn disc(across: f64) -> (f64, f64) {
    let cosine = across / (SEMI_MAJOR_AXIS * ECCENTRICITY2);
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    // These are cosine and sine of the parametric latitude of the nearest point.
    let latitude = (SEMI_MAJOR_AXIS * sine).atan2(SEMI_MINOR_AXIS * cosine);
    (latitude, height(across, 0.0, latitude))
}

/// Height above the ellipsoid along its normal at `latitude`.
fn height(across: f64, along: f64, latitude: f64) -> f64 {
    let (sine, cosine) = latitude.sin_cos();
    across * cosine + along * sine - SEMI_MAJOR_AXIS * (1.0 - ECCENTRICITY2 * sine * sine).sqrt()
}
