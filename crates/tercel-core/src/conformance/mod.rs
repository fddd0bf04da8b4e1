//! What every [`Filter`] must do, as tests that any crate can run over its own (cargo feature `conformance`).
//!
//! A filter that a tracker accepts must keep more promises than its types say: a failed update changes nothing, a copy is
//! independent, covariances stay positive definite when noises are extreme, a missing measurement is a prediction. This
//! module tests them on objects that move straight in the plane and are seen with Gaussian errors.
//!
//! The author of a filter says how to build it for a [`Problem`], how it is told of a position, and what may be expected of
//! it, by implementing [`Subject`]; for filters of plain positions [`positions`] does. Then
//! [`conformance!`](crate::conformance!) makes one test of each check:
//!
//! ```no_run
//! use tercel_core::conformance::{Expectations, positions};
//! use tercel_core::filter::Kalman;
//!
//! tercel_core::conformance!(
//!     kalman,
//!     positions::<4, _, _>(Expectations::exact(), |problem| Kalman::new(problem.motion(), problem.sensor()))
//! );
//! # fn main() {}
//! ```
//!
//! with, in the crate's manifest,
//!
//! ```toml
//! [dev-dependencies]
//! tercel-core = { version = "0.1", features = ["conformance"] }
//! ```
//!
//! Checks that a filter need not pass are switched off in its [`Expectations`]: a learned filter does not equal the Kalman
//! filter. Those about errors, copies and order hold for every filter and cannot be switched off.

// The verdict of a check is a panic, as that of any test.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod behaviour;
mod numbers;
mod world;

use nalgebra::{Matrix2, Vector2};

use crate::filter::Filter;
use crate::motion::ConstantVelocity;
use crate::sensor::{Measurement, Position};

pub use behaviour::{
    a_boxed_filter_is_the_filter, a_copy_is_independent, a_failed_update_changes_nothing,
    a_missing_measurement_is_a_prediction, innovation_foretells_update, no_time_changes_nothing,
    objects_are_independent, the_reach_covers_the_measurements, the_same_steps_give_the_same_belief,
};
pub use numbers::{
    beliefs_merge_to_their_moments, chi_square, covariances_stay_positive_definite, equals_the_kalman_filter,
    errors_match_the_covariance, predictions_compose,
};

/// A straight motion in the plane, seen as positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Problem {
    /// Spectral density of the white acceleration, m²/s³ per axis.
    pub density: f64,
    /// Standard deviation of a measured position along each axis, m.
    pub deviations: Vector2<f64>,
}

/// Standard deviation of the velocity of an object at birth, m/s per axis.
const SPEED: f64 = 20.0;

impl Problem {
    /// The noises of most checks.
    pub const ORDINARY: Problem = Problem { density: 0.5, deviations: Vector2::new(5.0, 8.0) };

    /// The motion, with the prior from which objects are drawn.
    pub fn motion(&self) -> ConstantVelocity {
        ConstantVelocity::new(self.density).with_speed(SPEED)
    }

    /// Covariance of a measured position, m².
    pub fn noise(&self) -> Matrix2<f64> {
        Matrix2::from_diagonal(&self.deviations.component_mul(&self.deviations))
    }

    /// A sensor of positions.
    pub fn sensor(&self) -> Position<2> {
        Position::with_noise(self.noise()).unwrap()
    }
}

/// What may be expected of a filter beyond the promises that hold for all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expectations {
    /// It equals the Kalman filter on linear-Gaussian problems: largest root mean square difference of mean and covariance
    /// over time, in standard deviations.
    pub kalman: Option<f64>,
    /// Its errors match its covariance: the mean NEES of this many objects lies inside its 99 % bounds.
    pub consistent: Option<u64>,
    /// Two predictions equal one over the sum of the times: largest difference, in standard deviations.
    pub composes: Option<f64>,
    /// The moments of a merged belief, and those after `set_state`: largest difference, in standard deviations.
    pub moments: Option<f64>,
    /// Covariances stay positive definite over 10,000 steps when noises span twelve orders of magnitude and time steps six.
    /// Without it, over 500 steps of ordinary size.
    pub extremes: bool,
}

impl Expectations {
    /// Of a filter that is exact on linear-Gaussian problems: everything, to 1e-9.
    pub const fn exact() -> Self {
        Expectations {
            kalman: Some(1e-9),
            consistent: Some(200),
            composes: Some(1e-9),
            moments: Some(1e-9),
            extremes: true,
        }
    }

    /// Of a filter that approximates by samples: the same within the scatter of some thousand, but at ordinary noises.
    pub const fn sampled() -> Self {
        Expectations {
            kalman: Some(0.35),
            consistent: Some(100),
            composes: Some(0.15),
            moments: Some(1e-6),
            extremes: false,
        }
    }

    /// Of a filter with models of its own: only that covariances stay positive definite and that moments are kept.
    pub const fn own_models() -> Self {
        Expectations { kalman: None, consistent: None, composes: None, moments: Some(1e-9), extremes: true }
    }
}

/// A filter under test: how it is built, how it is told of a position, and what it should do.
pub trait Subject<const N: usize> {
    /// The filter. The state begins with `x, y, vx, vy`.
    type Filter: Filter<N>;

    /// The filter for this problem.
    fn filter(&self, problem: &Problem) -> Self::Filter;

    /// What the sensor says of an object at `position`. `error` is drawn from the standard normal distribution.
    fn measurement(
        &self,
        problem: &Problem,
        position: &Vector2<f64>,
        error: &Vector2<f64>,
    ) -> <Self::Filter as Filter<N>>::Measurement;

    /// Measurements that must be refused.
    fn unusable(&self) -> Vec<<Self::Filter as Filter<N>>::Measurement>;

    /// What to expect.
    fn expectations(&self) -> Expectations;
}

/// A [`Subject`] that measures plain positions.
#[derive(Debug, Clone, Copy)]
pub struct Positions<const N: usize, B> {
    expectations: Expectations,
    build: B,
}

/// A filter of plain positions under test, built by `build`.
pub fn positions<const N: usize, F, B>(expectations: Expectations, build: B) -> Positions<N, B>
where
    F: Filter<N, Measurement = Measurement<2>>,
    B: Fn(&Problem) -> F,
{
    Positions { expectations, build }
}

impl<const N: usize, F, B> Subject<N> for Positions<N, B>
where
    F: Filter<N, Measurement = Measurement<2>>,
    B: Fn(&Problem) -> F,
{
    type Filter = F;

    fn filter(&self, problem: &Problem) -> F {
        (self.build)(problem)
    }

    fn measurement(
        &self,
        problem: &Problem,
        position: &Vector2<f64>,
        error: &Vector2<f64>,
    ) -> Measurement<2> {
        (position + problem.deviations.component_mul(error)).into()
    }

    fn unusable(&self) -> Vec<Measurement<2>> {
        let good: Measurement<2> = [4000.0, 3000.0].into();
        vec![
            [f64::NAN, 3000.0].into(),
            [4000.0, f64::INFINITY].into(),
            [f64::NEG_INFINITY, f64::NAN].into(),
            good.with_noise(Matrix2::new(f64::NAN, 0.0, 0.0, 1.0)),
            good.with_noise(Matrix2::new(1.0, 0.0, 0.0, -1e12)),
        ]
    }

    fn expectations(&self) -> Expectations {
        self.expectations
    }
}

/// One test of each conformance check, in a module of this name, over a [`Subject`](crate::conformance::Subject).
#[macro_export]
macro_rules! conformance {
    ($name:ident, $subject:expr) => {
        $crate::conformance!(@checks $name, $subject,
            equals_the_kalman_filter,
            errors_match_the_covariance,
            covariances_stay_positive_definite,
            predictions_compose,
            beliefs_merge_to_their_moments,
            no_time_changes_nothing,
            a_missing_measurement_is_a_prediction,
            objects_are_independent,
            a_copy_is_independent,
            a_failed_update_changes_nothing,
            innovation_foretells_update,
            the_same_steps_give_the_same_belief,
            the_reach_covers_the_measurements,
            a_boxed_filter_is_the_filter,
        );
    };
    (@checks $name:ident, $subject:expr, $($check:ident),* $(,)?) => {
        mod $name {
            use super::*;
            $(
                #[test]
                fn $check() {
                    $crate::conformance::$check(&$subject);
                }
            )*
        }
    };
}
