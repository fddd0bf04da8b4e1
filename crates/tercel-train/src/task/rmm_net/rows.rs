//! Rows of numbers that stand for what the recursion carries, in single precision between the operations.

use tercel_neural::filter::rmm_net::{Kinematics, Number, Report, Track};

/// Numbers of a Gaussian.
pub const MOTION: usize = 14;

/// Numbers of a track.
pub const TRACK: usize = MOTION + 3;

/// Numbers of a step: the track after it, the extent after it, and that which was expected (angle, weight, axes).
pub const STEP: usize = TRACK + 2 + 4;

/// The numbers of a track, in the order of a row.
pub fn numbers<T: Number>(track: &Track<T>) -> [T; TRACK] {
    let motion = track.motion.numbers();
    let rest = [track.axes[0], track.axes[1], track.worth];
    std::array::from_fn(|i| if i < MOTION { motion[i] } else { rest[i - MOTION] })
}

/// The track of a row.
pub fn track<T: Number>(row: &[T]) -> Track<T> {
    let motion = Kinematics::of(row);
    Track { motion, axes: [row[MOTION], row[MOTION + 1]], worth: row[MOTION + 2] }
}

/// The track of a row in single precision.
pub fn plain(row: &[f32]) -> Track<f64> {
    let row: [f64; TRACK] = std::array::from_fn(|i| f64::from(row[i]));
    track(&row)
}

/// What a step gives, in the order of a row.
pub fn step<T: Number>(
    after: &Track<T>,
    found: &Report<T>,
    expected: &Report<T>,
    before: &Track<T>,
) -> [T; STEP] {
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
