use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Vector3, vector};
use proptest::prelude::*;

use super::*;

const A: f64 = SEMI_MAJOR_AXIS;
const B: f64 = SEMI_MAJOR_AXIS * (1.0 - FLATTENING);

fn dms(degrees: f64, minutes: f64, seconds: f64) -> f64 {
    (degrees + minutes / 60.0 + seconds / 3600.0).to_radians()
}

/// The place of the guidance note's examples: 53°48'33.820"N, 2°07'46.380"E, 73.0 m.
fn north_sea() -> Geodetic {
    Geodetic { latitude: dms(53.0, 48.0, 33.820), longitude: dms(2.0, 7.0, 46.380), altitude: 73.0 }
}

proptest! {
    #[test]
    fn there_and_back_again_is_the_same_place(
        latitude in -FRAC_PI_2..=FRAC_PI_2,
        longitude in -PI..=PI,
        altitude in prop_oneof![-6.3e6..4e7, -500.0..20e3],
    ) {
        let place = Geodetic { latitude, longitude, altitude };
        let ecef = place.to_ecef();
        let back = Geodetic::from_ecef(&ecef);
        prop_assert!((back.to_ecef() - ecef).norm() < 1e-7);
        // Inside the evolute several normals pass through a point, and another one may be the shortest.
        if altitude > -6.2e6 {
            prop_assert!((back.latitude - latitude).abs() < 1e-12);
            prop_assert!((back.altitude - altitude).abs() < 1e-7);
            let turn = (back.longitude - longitude).rem_euclid(2.0 * PI);
            prop_assert!(turn.min(2.0 * PI - turn) * latitude.cos() < 1e-12);
        }
    }

    #[test]
    fn every_point_of_space_has_a_place(
        x in -1.0..1.0, y in -1.0..1.0, z in -1.0..1.0, exponent in -9.0..8.0,
    ) {
        let ecef = vector![x, y, z] * 10f64.powf(exponent);
        let back = Geodetic::from_ecef(&ecef).to_ecef();
        prop_assert!((back - ecef).norm() < 1e-7f64.max(1e-15 * ecef.norm()), "{ecef} came back as {back}");
    }

    #[test]
    fn no_point_of_the_ellipsoid_is_nearer_than_the_altitude(
        across in 0.0..8e6, along in 0.0..8e6, parametric in 0.0..FRAC_PI_2,
    ) {
        let place = Geodetic::from_ecef(&vector![across, 0.0, along]);
        let other = vector![A * parametric.cos() - across, B * parametric.sin() - along];
        prop_assert!(place.altitude.abs() <= other.norm() + 1e-6);
    }

    #[test]
    fn a_local_frame_gives_back_what_it_took(
        latitude in -FRAC_PI_2..=FRAC_PI_2,
        longitude in -PI..=PI,
        enu in prop::array::uniform3(-3e5..3e5f64),
        velocity in prop::array::uniform3(-1e3..1e3f64),
    ) {
        let frame = LocalFrame::new(Geodetic { latitude, longitude, altitude: 100.0 }).unwrap();
        let enu = Vector3::from(enu);
        prop_assert!((frame.to_enu(&frame.from_enu(&enu)) - enu).norm() < 1e-7);
        let velocity = Vector3::from(velocity);
        prop_assert!((frame.velocity_to_enu(&frame.velocity_from_enu(&velocity)) - velocity).norm() < 1e-10);
        // Moving for a second and then converting is converting and then moving.
        let moved = frame.enu_to_ecef(&enu) + frame.velocity_from_enu(&velocity);
        prop_assert!((frame.ecef_to_enu(&moved) - (enu + velocity)).norm() < 1e-7);
    }

    #[test]
    fn two_frames_agree_on_distances(
        first in (-1.5..1.5f64, -PI..PI), second in (-1.5..1.5f64, -PI..PI),
        a in prop::array::uniform3(-1e5..1e5f64), b in prop::array::uniform3(-1e5..1e5f64),
    ) {
        let frame = |(latitude, longitude): (f64, f64)| {
            LocalFrame::new(Geodetic { latitude, longitude, altitude: 0.0 }).unwrap()
        };
        let (first, second) = (frame(first), frame(second));
        let through = |x: [f64; 3]| second.ecef_to_enu(&first.enu_to_ecef(&x.into()));
        let direct = (Vector3::from(a) - Vector3::from(b)).norm();
        prop_assert!(((through(a) - through(b)).norm() - direct).abs() < 1e-7);
    }
}

#[test]
fn the_published_example_of_geocentric_conversion_is_met() {
    // EPSG guidance note 7-2, method 9602.
    let ecef = north_sea().to_ecef();
    assert!((ecef - vector![3_771_793.968, 140_253.342, 5_124_304.349]).amax() < 1e-3, "{ecef}");
    let back = Geodetic::from_ecef(&vector![3_771_793.968, 140_253.342, 5_124_304.349]);
    assert!((back.latitude - north_sea().latitude).abs() < 1e-9);
    assert!((back.altitude - 73.0).abs() < 1e-3);
}

#[test]
fn the_published_example_of_topocentric_conversion_is_met() {
    // EPSG guidance note 7-2, methods 9836 and 9837: origin 55°N 5°E, 200 m.
    let frame = LocalFrame::new(Geodetic::from_degrees(55.0, 5.0, 200.0)).unwrap();
    let enu = frame.to_enu(&north_sea());
    assert!((enu - vector![-189_013.869, -128_642.040, -4_220.171]).amax() < 1e-3, "{enu}");
}

#[test]
fn poles_equator_and_antimeridian_are_ordinary_places() {
    let pole = Geodetic::from_ecef(&vector![0.0, 0.0, B + 5.0]);
    assert_eq!(pole.latitude, FRAC_PI_2);
    assert!((pole.altitude - 5.0).abs() < 1e-8);
    let south = Geodetic::from_ecef(&vector![0.0, 0.0, -B]);
    assert_eq!(south.latitude, -FRAC_PI_2);
    let equator = Geodetic::from_ecef(&vector![0.0, A + 7.0, 0.0]);
    assert_eq!((equator.latitude, equator.longitude), (0.0, FRAC_PI_2));
    assert!((equator.altitude - 7.0).abs() < 1e-8);
    let frame = LocalFrame::new(Geodetic::from_degrees(10.0, 179.999, 0.0)).unwrap();
    let beyond = frame.to_enu(&Geodetic::from_degrees(10.0, -179.999, 0.0));
    assert!((beyond.x - 219.28).abs() < 0.1 && beyond.y.abs() < 0.01, "{beyond}");
    let over = LocalFrame::new(Geodetic::from_degrees(90.0, 0.0, 0.0)).unwrap();
    assert!((over.from_enu(&vector![0.0, 1000.0, 0.0]).longitude.abs() - PI).abs() < 1e-9);
}

#[test]
fn the_centre_of_the_earth_is_under_a_pole() {
    let centre = Geodetic::from_ecef(&Vector3::zeros());
    assert_eq!(centre.latitude, FRAC_PI_2);
    assert!((centre.altitude + B).abs() < 1e-8);
}

#[test]
fn east_north_and_up_point_there() {
    let frame = LocalFrame::new(Geodetic::from_degrees(48.0, 11.0, 500.0)).unwrap();
    let up = frame.to_enu(&Geodetic::from_degrees(48.0, 11.0, 600.0));
    assert!((up - vector![0.0, 0.0, 100.0]).norm() < 1e-8);
    let north = frame.to_enu(&Geodetic::from_degrees(48.001, 11.0, 500.0));
    assert!((north.y - 111.2).abs() < 0.1 && north.x.abs() < 1e-8);
    let east = frame.to_enu(&Geodetic::from_degrees(48.0, 11.001, 500.0));
    assert!((east.x - 74.6).abs() < 0.1);
    assert_eq!(enu_to_ned(&vector![1.0, 2.0, 3.0]), vector![2.0, 1.0, -3.0]);
    assert_eq!(ned_to_enu(&enu_to_ned(&vector![1.0, 2.0, 3.0])), vector![1.0, 2.0, 3.0]);
}

#[test]
fn origins_in_degrees_or_not_finite_are_refused() {
    let degrees = LocalFrame::new(Geodetic { latitude: 48.0, longitude: 11.0, altitude: 0.0 });
    assert!(degrees.unwrap_err().to_string().contains("latitude is 48"));
    assert!(LocalFrame::new(Geodetic { latitude: f64::NAN, longitude: 0.0, altitude: 0.0 }).is_err());
    assert!(LocalFrame::new(Geodetic { latitude: 0.0, longitude: f64::INFINITY, altitude: 0.0 }).is_err());
}

#[test]
fn what_is_not_finite_does_not_come_back_as_a_place() {
    assert!(Geodetic::from_ecef(&vector![f64::NAN, 0.0, 0.0]).latitude.is_nan());
    assert!(Geodetic::from_ecef(&vector![0.0, 0.0, f64::INFINITY]).altitude.is_nan());
}
