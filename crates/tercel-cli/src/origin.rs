//! Where on the Earth the local frame lies.

use tercel_data::table::Origin;

use crate::failure::Failure;

/// Reads `LAT,LON[,ALT]`, in degrees and m.
pub fn parse(text: &str) -> Result<Origin, String> {
    let wrong =
        || "expected degrees north and east, and possibly m above the ellipsoid: 47.46,8.55,432".to_owned();
    let numbers: Vec<f64> =
        text.split(',').map(|part| part.trim().parse().map_err(|_| wrong())).collect::<Result<_, _>>()?;
    let (latitude, longitude, altitude) = match numbers[..] {
        [latitude, longitude] => (latitude, longitude, 0.0),
        [latitude, longitude, altitude] => (latitude, longitude, altitude),
        _ => return Err(wrong()),
    };
    if !(latitude.abs() <= 90.0 && longitude.abs() <= 180.0 && altitude.is_finite()) {
        return Err(wrong());
    }
    Ok(Origin { latitude: latitude.to_radians(), longitude: longitude.to_radians(), altitude })
}

/// The origin of a table: the one that it has, or the one that the user named. A frame that lies somewhere is not moved.
pub fn settle(found: Option<Origin>, named: Option<Origin>) -> Result<Option<Origin>, Failure> {
    match (found, named) {
        (Some(found), Some(named)) if found != named => {
            let Origin { latitude, longitude, altitude } = found;
            let message = format!(
                "--origin names another place than the table, whose origin is {},{},{altitude}",
                latitude.to_degrees(),
                longitude.to_degrees()
            );
            Err(Failure::input(message)
                .with_help("leave out --origin, or give it when the recording is converted"))
        }
        (found, named) => Ok(found.or(named)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_origin_is_degrees_and_metres() {
        let place = parse("47.5, 8.25,432").unwrap();
        assert_eq!(
            (place.latitude, place.longitude, place.altitude),
            (47.5_f64.to_radians(), 8.25_f64.to_radians(), 432.0)
        );
        assert_eq!(parse("-33.9,18.4").unwrap().altitude, 0.0);
    }

    #[test]
    fn an_origin_beyond_the_earth_is_refused() {
        for text in ["91,0", "0,181", "NaN,0", "1", "1,2,3,4", "1,2,inf", "north,east"] {
            assert!(parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_frame_that_lies_somewhere_is_not_moved() {
        let (here, there) = (parse("47,8").unwrap(), parse("48,8").unwrap());
        assert_eq!(settle(None, Some(here)).unwrap(), Some(here));
        assert_eq!(settle(Some(here), None).unwrap(), Some(here));
        assert_eq!(settle(Some(here), Some(here)).unwrap(), Some(here));
        assert!(settle(Some(here), Some(there)).is_err());
    }
}
