//! Extended objects: an object gives many points a scan, and the filter estimates its motion and an ellipse.
//!
//! The measurement of every filter here is a set of [`Points`], possibly empty. All are a
//! [`Filter`](crate::filter::Filter), so every tracker of many objects takes them.
//!
//! | filter | knows | estimates the extent as |
//! |---|---|---|
//! | [`Centroid`] | | the ellipse of the last scan |
//! | [`RandomMatrix`] | | an inverse Wishart matrix: B-RMM, FFK, Lan and Li, VB-RMM |
//! | [`Imm`](crate::filter::Imm) of these | the modes of the motion | one such matrix for each mode, mixed |
//! | [`MemEkf`] | | angle and semi-axes with one covariance |
//! | [`MemRbpf`] | | particles of the angle, each with its semi-axes |
//! | [`KnownSize`] | the size | the angle of the last scan, or the course |
//! | [`Aligned`] | the size; that it points where it goes | an angle that scan and velocity tell together |
//! | [`AlignedAutoRegressive`] | the same | the same, with a motion that is identified while it is tracked |
//!
//! [`distance_partition`] cuts a scan into the sets that may come from one object each.

mod aligned;
mod auto_regressive;
mod centroid;
mod ellipse;
mod heading;
mod inverse_wishart;
mod known_size;
mod mem_ekf;
mod mem_rbpf;
mod orientation;
mod partition;
mod points;
mod random_matrix;
mod rate;
mod scattering;
mod symmetric;

pub use aligned::Aligned;
pub use auto_regressive::{AlignedAutoRegressive, Identified};
pub use centroid::{Centroid, Seen};
pub use ellipse::Ellipse;
pub use inverse_wishart::{Freedom, InverseWishart};
pub use known_size::{KnownSize, Oriented, Pointing};
pub use mem_ekf::{MemEkf, Shaped};
pub use mem_rbpf::{MemRbpf, ShapeParticle, ShapeParticles};
pub use partition::distance_partition;
pub use points::Points;
pub use random_matrix::{Evolution, GaussianInverseWishart, RandomMatrix, Rule};
pub use rate::Rate;
pub use scattering::Scattering;
pub(crate) use symmetric::{congruent, rotation};
pub use symmetric::{eigen, inverse_root, root};

/// The methods of [`Filter`](crate::filter::Filter) that follow from a belief with a field `state` and a scan
/// of points.
macro_rules! scan_state {
    () => {
        fn state(&self, belief: &Self::Belief) -> Gaussian<N> {
            belief.state
        }

        fn set_state(&self, belief: &mut Self::Belief, state: &Gaussian<N>) {
            belief.state = *state;
        }

        fn place(&self, points: &Points) -> Option<Vector2<f64>> {
            (!points.is_empty()).then(|| points.mean())
        }

        /// Scans of points are as old as their time says, and bring no noise.
        fn widen(&self, _: &mut Search, _: &Points) {}

        fn area(&self, _: &Points) -> f64 {
            1.0
        }

        fn ln_clutter(&self, points: &Points, intensity: f64) -> f64 {
            points.count() as f64 * intensity.ln()
        }
    };
}
use scan_state;
