//! Rows of numbers that stand for what the recursion carries, in single precision between the operations.

use tercel_neural::filter::rmm_net::{Extended, Kinematics, Number, Report, Symmetric, Track};

use crate::backend::{Tensor, values};

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

/// The rows of a tensor in double precision.
pub fn wide(tensor: &Tensor) -> Vec<Vec<f64>> {
    let [_, width] = tensor.dims();
    let row = |row: &[f32]| row.iter().map(|x| f64::from(*x)).collect();
    values(tensor).chunks_exact(width).map(row).collect()
}

/// The same numbers with positions relative to another origin.
pub fn shifted<T: Number, const N: usize>(mut row: [T; N], shift: [f64; 2]) -> [T; N] {
    (row[0], row[1]) = (row[0] + -shift[0], row[1] + -shift[1]);
    row
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

/// Numbers of a row of the form of the publication: the state, the mean extent and its weight.
pub const EXTENDED: usize = MOTION + 4;

/// The numbers of a state and extent as published.
pub fn extended_numbers<T: Number>(estimate: &Extended<T>) -> [T; EXTENDED] {
    let (motion, extent) = (estimate.motion.numbers(), &estimate.extent);
    let rest = [extent.xx, extent.xy, extent.yy, estimate.weight];
    std::array::from_fn(|i| if i < MOTION { motion[i] } else { rest[i - MOTION] })
}

/// State and extent of such a row.
pub fn extended<T: Number>(row: &[T]) -> Extended<T> {
    let extent = Symmetric { xx: row[MOTION], xy: row[MOTION + 1], yy: row[MOTION + 2] };
    Extended { motion: Kinematics::of(row), extent, weight: row[MOTION + 3] }
}

/// What stands in the rows of a form.
#[derive(Debug, Clone, Copy)]
pub enum Layout {
    Aligned,
    Published,
}

/// What a row says of an object.
pub struct Estimate<T> {
    pub motion: Kinematics<T>,
    pub extent: Symmetric<T>,
    pub ln_weight: T,
    /// The extent that was expected, and the logarithm of its weight.
    pub expected: Option<(Symmetric<T>, T)>,
}

impl Layout {
    /// Numbers of a row.
    pub fn width(self) -> usize {
        match self {
            Layout::Aligned => STEP,
            Layout::Published => EXTENDED,
        }
    }

    /// What a row says.
    pub fn read<T: Number>(self, row: &[T]) -> Estimate<T> {
        match self {
            Layout::Aligned => {
                let track = track(row);
                let extent = |[along, across]: [T; 2], angle: T| {
                    let [xx, yy] = [along, across].map(|axis| (axis * 2.0).exp());
                    Symmetric { xx, xy: T::of(0.0), yy }.turned([angle.cos(), angle.sin()])
                };
                let expected = extent([row[TRACK + 4], row[TRACK + 5]], row[TRACK + 2]);
                Estimate {
                    motion: track.motion,
                    extent: extent(track.axes, row[TRACK]),
                    ln_weight: row[TRACK + 1],
                    expected: Some((expected, row[TRACK + 3])),
                }
            }
            Layout::Published => {
                let Extended { motion, extent, weight } = extended(row);
                Estimate { motion, extent, ln_weight: weight.ln(), expected: None }
            }
        }
    }
}
