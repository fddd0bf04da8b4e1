//! Rows of numbers that stand for what the recursion carries, in single precision between the operations.

use tercel_neural::filter::rmm_net::{Number, Report, Symmetric, Track};

/// Numbers of a track.
pub const TRACK: usize = 17;

/// Numbers of a step: the track after it, the extent after it, and that which was expected (angle, weight, axes).
pub const STEP: usize = TRACK + 2 + 4;

/// The numbers of a track, in the order of a row.
pub fn numbers<T: Number>(track: &Track<T>) -> [T; TRACK] {
    let Track { place, velocity, place_covariance: pp, cross, velocity_covariance: vv, axes, worth } = *track;
    [
        place[0], place[1], velocity[0], velocity[1], pp.xx, pp.xy, pp.yy, cross[0][0], cross[0][1], cross[1][0],
        cross[1][1], vv.xx, vv.xy, vv.yy, axes[0], axes[1], worth,
    ]
}

/// The track of a row.
pub fn track<T: Number>(row: &[T]) -> Track<T> {
    Track {
        place: [row[0], row[1]],
        velocity: [row[2], row[3]],
        place_covariance: Symmetric { xx: row[4], xy: row[5], yy: row[6] },
        cross: [[row[7], row[8]], [row[9], row[10]]],
        velocity_covariance: Symmetric { xx: row[11], xy: row[12], yy: row[13] },
        axes: [row[14], row[15]],
        worth: row[16],
    }
}

/// The track of a row in single precision.
pub fn plain(row: &[f32]) -> Track<f64> {
    let row: [f64; TRACK] = std::array::from_fn(|i| f64::from(row[i]));
    track(&row)
}

/// What a step gives, in the order of a row.
pub fn step<T: Number>(after: &Track<T>, found: &Report<T>, expected: &Report<T>, before: &Track<T>) -> [T; STEP] {
    let track = numbers(after);
    std::array::from_fn(|i| match i.checked_sub(TRACK) {
        None => track[i],
        Some(0) => found.angle,
        Some(1) => found.ln_weight,
        Some(2) => expected.angle,
        Some(3) => expected.ln_weight,
        Some(4) => before.axes[0],
        _ => before.axes[1],
    })
}
