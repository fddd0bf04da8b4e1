//! How good tracks are, given the truth.
//!
//! | metric | compares | says |
//! |---|---|---|
//! | [`Gospa`] | two sets of points | distance, split into localisation, missed and false objects |
//! | [`Ospa`] | two sets of points | distance per object, split into localisation and cardinality |
//! | [`Ospa2`] | two sets of trajectories, over a window | distance per trajectory |
//! | [`TrajectoryGospa`] | two sets of trajectories | GOSPA over time, with a part for track switches |
//! | [`Rmse`] | one estimated state with the true one | root mean square errors, per element and Euclidean |
//! | [`intersection_over_union`] | an estimated extent with the true one | the share of the area that both cover |
//! | [`wasserstein`] | the same | squared distance, split into position and shape |
//! | [`Consistency`] | errors with what the filter believes of them | NEES and NIS, their chi-square bounds, coverage |
//!
//! The set metrics are true metrics: zero for equal sets only, symmetric, and with the triangle inequality. Every one of
//! them takes a cut-off, the distance beyond which an estimate has nothing to do with an object, and an order, which
//! says how much a large error outweighs several small ones.
//!
//! A score holds parts that add up: these are `p`-th powers, `p` being the order, and `total` is the `p`-th root of their
//! sum. A pair at the cut-off is no pair. Averages over steps and runs are taken by accumulators that can be merged, so that runs may be scored apart.

mod consistency;
mod ellipse_overlap;
mod gospa;
mod near;
mod ospa;
mod ospa2;
mod rmse;
mod scale;
#[cfg(test)]
mod tests;
mod trajectory;
mod trajectory_gospa;
mod wasserstein;

pub use consistency::{Consistency, chi_square_quantile, nees};
pub use ellipse_overlap::intersection_over_union;
pub use gospa::{Gospa, GospaAverage, GospaParts, GospaScore};
pub use near::{NearIndex, pairs_within};
pub use ospa::{Ospa, OspaParts, OspaScore};
pub use ospa2::Ospa2;
pub use rmse::Rmse;
pub use trajectory::{Trajectory, Walk};
pub use trajectory_gospa::{TrajectoryGospa, TrajectoryGospaParts, TrajectoryGospaScore};
pub use wasserstein::{Wasserstein, wasserstein};
