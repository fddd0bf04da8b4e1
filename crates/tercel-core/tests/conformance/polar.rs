//! The suite over sensors of range and bearing, far enough away to be nearly linear.

use nalgebra::{Matrix2, Vector2};
use tercel_core::conformance::{Expectations, Problem, Subject};
use tercel_core::filter::{Extended, Filter, Unscented};
use tercel_core::motion::ConstantVelocity;
use tercel_core::sensor::{Measurement, RangeBearing};

/// A filter of range and bearing, seen from the origin.
pub struct Polar<F>(pub fn(&Problem) -> F);

/// Deviation of a bearing, rad: about that of the problem's positions at the distance of its objects.
const BEARING: f64 = 0.001;

fn radar(problem: &Problem) -> RangeBearing {
    RangeBearing::new(problem.deviations[0], BEARING).unwrap()
}

pub fn extended(problem: &Problem) -> Extended<ConstantVelocity, RangeBearing> {
    Extended::new(problem.motion(), radar(problem))
}

pub fn unscented(problem: &Problem) -> Unscented<ConstantVelocity, RangeBearing> {
    Unscented::new(problem.motion(), radar(problem))
}

impl<F: Filter<4, Measurement = Measurement<2>>> Subject<4> for Polar<F> {
    type Filter = F;

    fn filter(&self, problem: &Problem) -> F {
        (self.0)(problem)
    }

    fn measurement(
        &self,
        problem: &Problem,
        position: &Vector2<f64>,
        error: &Vector2<f64>,
    ) -> Measurement<2> {
        let range = position.norm() + problem.deviations[0] * error[0];
        [range, position.y.atan2(position.x) + BEARING * error[1]].into()
    }

    fn unusable(&self) -> Vec<Measurement<2>> {
        let good: Measurement<2> = [5000.0, 0.5].into();
        vec![
            [f64::NAN, 0.5].into(),
            [5000.0, f64::NEG_INFINITY].into(),
            good.with_noise(Matrix2::new(1.0, 0.0, 0.0, -1e12)),
        ]
    }

    fn expectations(&self) -> Expectations {
        // Curvature and a sensor of its own: consistent, but not the Kalman filter, and not made for steps of a quarter of
        // an hour.
        Expectations { kalman: None, extremes: false, ..Expectations::exact() }
    }
}
