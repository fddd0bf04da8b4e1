//! Latitudes and longitudes in a local frame.

use std::sync::Arc;

use tercel_core::geo::{Geodetic, LocalFrame};

use crate::column::wrapped;
use crate::error::{DataError, Place, Refusal};
use crate::table::Origin;

/// The local frame with this origin.
pub(crate) fn frame(origin: Origin, file: &Arc<str>) -> Result<LocalFrame, DataError> {
    let Origin { latitude, longitude, altitude } = origin;
    LocalFrame::new(Geodetic { latitude, longitude, altitude }).map_err(|error| DataError::Row {
        place: Place::whole(file),
        problem: format!("the origin of the local frame is not on the Earth: {error}"),
        help: "latitude and longitude of the origin are radians, the altitude is m",
    })
}

/// The median of latitudes and longitudes (rad), on the ellipsoid: where a frame lies without an origin.
pub(crate) fn middle(positions: impl Iterator<Item = (f64, f64)>) -> Option<Origin> {
    let mut positions = positions.peekable();
    let (_, first) = *positions.peek()?;
    middle_around(first, positions)
}

/// The same, for positions around a longitude.
pub(crate) fn middle_around(first: f64, positions: impl Iterator<Item = (f64, f64)>) -> Option<Origin> {
    let (latitudes, longitudes): (Vec<f64>, Vec<f64>) = positions.unzip();
    // Longitudes near the date line are turned so that they do not fall apart.
    let near = |longitude: &f64| first + wrapped(longitude - first);
    let longitude = wrapped(median(longitudes.iter().map(near).collect())?);
    Some(Origin { latitude: median(latitudes)?, longitude, altitude: 0.0 })
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// A latitude and a longitude (rad) that are on the Earth; longitudes may run from 0 to 2π. Otherwise which of them is not.
pub(crate) fn on_earth(latitude: f64, longitude: f64) -> Result<(f64, f64), (&'static str, Refusal)> {
    use std::f64::consts::{FRAC_PI_2, TAU};
    // Degrees that became radians may be a little more than half a turn.
    const SLACK: f64 = 1e-9;
    if latitude.abs() > FRAC_PI_2 + SLACK {
        let refusal = Refusal::new(latitude.to_degrees(), "degrees in [-90, 90]");
        return Err(("latitude", match longitude.abs() <= FRAC_PI_2 {
            true => refusal.helped("latitude and longitude may be swapped: --column latitude=NAME --column longitude=NAME says \
                 which is which"),
            false => refusal,
        }));
    }
    if longitude.abs() > TAU + SLACK {
        return Err(("longitude", Refusal::new(longitude.to_degrees(), "degrees in [-180, 360]")));
    }
    Ok((latitude, wrapped(longitude)))
}
