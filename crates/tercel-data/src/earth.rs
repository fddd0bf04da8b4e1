//! Where tracks are on the Earth, and how they move over it.

use nalgebra::{Vector3, vector};
use tercel_core::geo::{Geodetic, LocalFrame, SEMI_MAJOR_AXIS};

use crate::table::{Origin, Track};

/// Where an object is and how it moves, as people say it. What is not known is empty.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Fix {
    /// WGS84 latitude and longitude, degrees north and east.
    pub position: Option<[f64; 2]>,
    /// Height above the WGS84 ellipsoid, m.
    pub altitude: Option<f64>,
    /// Speed over ground, m/s.
    pub speed: Option<f64>,
    /// Course over ground, degrees clockwise from north, 0 to 360.
    pub course: Option<f64>,
}

/// Reads fixes from the rows of a table of tracks.
///
/// The local frame is a plane that touches the Earth at its origin. Where the height of an object over this plane is
/// known, so is its place. Otherwise it is looked for along the vertical of the frame at the altitude that came with its
/// detections, or on the ellipsoid: the way back of how the importers place reports without an altitude. A velocity without a
/// vertical part is taken to be level where the object is. Courses are against true north there; without an origin, against
/// the axis `y`.
#[derive(Debug, Clone)]
pub(crate) struct Navigator {
    frame: Option<LocalFrame>,
    place: Option<[usize; 2]>,
    height: Option<usize>,
    velocity: Option<[usize; 2]>,
    climb: Option<usize>,
}

impl Navigator {
    /// For states with these components.
    pub fn new(origin: Option<Origin>, labels: &[String]) -> Self {
        let at = |name: &str| labels.iter().position(|label| label == name);
        let both = |a: &str, b: &str| at(a).zip(at(b)).map(|(a, b)| [a, b]);
        Navigator {
            frame: origin.and_then(Origin::frame),
            place: both("x", "y"),
            height: at("z"),
            velocity: both("vx", "vy"),
            climb: at("vz"),
        }
    }

    /// True when places have a latitude and a longitude.
    pub fn knows_the_earth(&self) -> bool {
        self.frame.is_some() && self.place.is_some()
    }

    /// True when the state has a velocity.
    pub fn knows_speeds(&self) -> bool {
        self.velocity.is_some()
    }

    /// Where the object of a row is.
    pub fn fix(&self, track: &Track) -> Fix {
        let number = |at: usize| track.state.get(at).copied();
        let pair = |at: Option<[usize; 2]>| at.and_then(|[a, b]| number(a).zip(number(b)));
        let velocity = pair(self.velocity).map(|(x, y)| (x, y, self.climb.and_then(number)));
        let Some((frame, (x, y))) = self.frame.as_ref().zip(pair(self.place)) else {
            let motion = velocity.and_then(|(x, y, _)| motion(x, y));
            return Fix {
                speed: motion.map(|(speed, _)| speed),
                course: motion.and_then(|(_, course)| course),
                ..Fix::default()
            };
        };
        let height = self.height.and_then(number);
        let place = match height {
            Some(z) => Some(frame.from_enu(&vector![x, y, z])),
            None => above(frame, x, y, track.altitude.unwrap_or(0.0)),
        };
        let Some(place) = place.filter(|place| place.to_ecef().iter().all(|number| number.is_finite()))
        else {
            return Fix { altitude: track.altitude, ..Fix::default() };
        };
        let motion = velocity.and_then(|(x, y, z)| over_ground(frame, place, [x, y], z));
        Fix {
            position: Some([place.latitude.to_degrees(), place.longitude.to_degrees()]),
            altitude: height.map(|_| place.altitude).or(track.altitude),
            speed: motion.map(|(speed, _)| speed),
            course: motion.and_then(|(_, course)| course),
        }
    }
}

impl Origin {
    /// Height above the WGS84 ellipsoid (m) of the place `x, y, z` (m) in the local frame of this origin. Nothing when the
    /// origin is not on the Earth or the place is not finite.
    pub fn altitude_of(self, [x, y, z]: [f64; 3]) -> Option<f64> {
        let altitude = self.frame()?.from_enu(&vector![x, y, z]).altitude;
        altitude.is_finite().then_some(altitude)
    }

    pub(crate) fn frame(self) -> Option<LocalFrame> {
        let Origin { latitude, longitude, altitude } = self;
        LocalFrame::new(Geodetic { latitude, longitude, altitude }).ok()
    }
}

/// The place at `x`, `y` of the frame with this altitude; nothing where the vertical of the frame does not meet it.
fn above(frame: &LocalFrame, x: f64, y: f64, altitude: f64) -> Option<Geodetic> {
    /// Beyond this part of the radius the vertical meets the surface too flatly.
    const REACH: f64 = 0.8;
    /// How near the altitude must come, m.
    const NEAR: f64 = 1e-5;
    let radius = SEMI_MAJOR_AXIS + altitude;
    let across = x.hypot(y);
    if !(across.is_finite() && radius.is_finite() && across < REACH * radius) {
        return None;
    }
    let up = up_at(frame.origin());
    // A sphere is near enough to begin with; Newton's method does the rest in two or three steps.
    let mut z = (radius * radius - across * across).sqrt() - SEMI_MAJOR_AXIS - frame.origin().altitude;
    for _ in 0..20 {
        let place = frame.from_enu(&vector![x, y, z]);
        let miss = place.altitude - altitude;
        if miss.abs() < NEAR {
            return Some(place);
        }
        z -= miss / up.dot(&up_at(place));
    }
    None
}

/// The vertical at a place, in Earth-centred axes.
fn up_at(place: Geodetic) -> Vector3<f64> {
    let (sin_latitude, cos_latitude) = place.latitude.sin_cos();
    let (sin_longitude, cos_longitude) = place.longitude.sin_cos();
    vector![cos_latitude * cos_longitude, cos_latitude * sin_longitude, sin_latitude]
}

/// Speed and course at `place` of a velocity in the local frame.
fn over_ground(
    frame: &LocalFrame,
    place: Geodetic,
    [x, y]: [f64; 2],
    climb: Option<f64>,
) -> Option<(f64, Option<f64>)> {
    let there = LocalFrame::new(place).ok()?;
    let turned = |velocity: Vector3<f64>| there.velocity_to_enu(&frame.velocity_from_enu(&velocity));
    let mut velocity = turned(vector![x, y, climb.unwrap_or(0.0)]);
    if climb.is_none() {
        let up = turned(vector![0.0, 0.0, 1.0]);
        velocity -= up * (velocity.z / up.z);
    }
    motion(velocity.x, velocity.y)
}

/// Speed, and course in degrees where there is one; nothing for numbers too large for a speed.
fn motion(east: f64, north: f64) -> Option<(f64, Option<f64>)> {
    let speed = east.hypot(north);
    let course = east.atan2(north).to_degrees().rem_euclid(360.0);
    let course = (speed > 0.0).then_some(if course < 360.0 { course } else { 0.0 });
    speed.is_finite().then_some((speed, course))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Status;

    const ORIGIN: Origin = Origin { latitude: 0.96, longitude: 0.21, altitude: 30.0 };

    fn labels(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    fn row(state: &[f64], altitude: Option<f64>) -> Track {
        Track {
            time: 0.0,
            sensor: "ais".into(),
            track: 1,
            status: Status::Confirmed,
            existence: 1.0,
            state: state.to_vec(),
            covariance: Vec::new(),
            modes: Vec::new(),
            extent: None,
            altitude,
            identity: None,
            detection: None,
        }
    }

    #[test]
    fn a_flat_state_leads_back_to_the_report_it_was_made_of() {
        let frame = ORIGIN.frame().unwrap();
        let flat = Navigator::new(Some(ORIGIN), &labels(&["x", "y", "vx", "vy"]));
        let reports =
            [(55.1, 12.4, None), (57.9, 6.5, None), (54.2, 16.8, Some(11_280.0)), (41.0, -3.0, Some(900.0))];
        for (latitude, longitude, altitude) in reports {
            let place = Geodetic::from_degrees(latitude, longitude, altitude.unwrap_or(0.0));
            let (speed, course) = (7.5, 213.0_f64);
            let (east, north) = (speed * course.to_radians().sin(), speed * course.to_radians().cos());
            let there = LocalFrame::new(place).unwrap();
            let enu = frame.to_enu(&place);
            let velocity = frame.velocity_to_enu(&there.velocity_from_enu(&vector![east, north, 0.0]));
            let fix = flat.fix(&row(&[enu.x, enu.y, velocity.x, velocity.y], altitude));
            let [north, east] = fix.position.unwrap();
            // 1e-9 degrees are 0.1 mm.
            assert!((north - latitude).abs() < 1e-9 && (east - longitude).abs() < 1e-9, "{fix:?}");
            assert_eq!(fix.altitude, altitude);
            assert!((fix.speed.unwrap() - speed).abs() < 1e-9, "{fix:?}");
            assert!((fix.course.unwrap() - course).abs() < 1e-7, "{fix:?}");
        }
    }

    #[test]
    fn a_state_in_space_needs_no_guess() {
        let frame = ORIGIN.frame().unwrap();
        let place = Geodetic::from_degrees(54.0, 14.0, 9_500.0);
        let enu = frame.to_enu(&place);
        let there = LocalFrame::new(place).unwrap();
        let velocity = frame.velocity_to_enu(&there.velocity_from_enu(&vector![0.0, 200.0, -15.0]));
        let space = Navigator::new(Some(ORIGIN), &labels(&["x", "y", "z", "vx", "vy", "vz"]));
        let fix = space.fix(&row(&[enu.x, enu.y, enu.z, velocity.x, velocity.y, velocity.z], Some(-1.0)));
        assert!((fix.position.unwrap()[0] - 54.0).abs() < 1e-9);
        assert!((fix.altitude.unwrap() - 9_500.0).abs() < 1e-6);
        assert!((fix.speed.unwrap() - 200.0).abs() < 1e-9, "the climb is not speed over ground");
        let course = fix.course.unwrap();
        assert!(course.min(360.0 - course) < 1e-9);
    }

    #[test]
    fn without_an_origin_courses_are_against_the_axis_y() {
        let plane = Navigator::new(None, &labels(&["x", "y", "vx", "vy"]));
        for (velocity, course) in [([0.0, 2.0], 0.0), ([2.0, 0.0], 90.0), ([-2.0, 0.0], 270.0)] {
            let fix = plane.fix(&row(&[1.0, 1.0, velocity[0], velocity[1]], None));
            assert_eq!((fix.position, fix.speed, fix.course), (None, Some(2.0), Some(course)));
        }
        let rest = plane.fix(&row(&[1.0, 1.0, 0.0, 0.0], None));
        assert_eq!((rest.speed, rest.course), (Some(0.0), None), "what rests has no course");
        assert_eq!(plane.fix(&row(&[1.0, 1.0, 1.5e308, 1.5e308], None)), Fix::default());
    }

    #[test]
    fn what_is_beside_the_earth_has_no_place() {
        let flat = Navigator::new(Some(ORIGIN), &labels(&["x", "y", "vx", "vy"]));
        for x in [6e6, 1e300] {
            assert_eq!(flat.fix(&row(&[x, 0.0, 1.0, 0.0], None)), Fix::default());
        }
        assert_eq!(flat.fix(&row(&[0.0, 0.0, 1.0, 0.0], Some(-1e300))).position, None);
    }
}
