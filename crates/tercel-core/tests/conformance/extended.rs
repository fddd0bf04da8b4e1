//! Filters of extended objects on one point a scan. With a known shape they are Kalman filters.

use nalgebra::{Matrix2, Matrix3, SVector, Vector2, Vector3};
use tercel_core::belief::Gaussian;
use tercel_core::conformance::{Expectations, Problem, Subject};
use tercel_core::extended::{
    Aligned, AlignedAutoRegressive, Centroid, Evolution, InverseWishart, KnownSize, MemEkf, MemRbpf,
    Pointing, Points, RandomMatrix, Rule, Scattering,
};
use tercel_core::filter::{Filter, Imm, Transition};
use tercel_core::motion::ConstantVelocity;

/// A filter that sees each position as a scan of one point.
pub struct OnePoint<const N: usize, B> {
    expectations: Expectations,
    build: B,
}

/// A filter that must be exact.
pub fn exact<F, B>(build: B) -> OnePoint<4, B>
where
    F: Filter<4, Measurement = Points>,
    B: Fn(&Problem) -> F,
{
    OnePoint { expectations: Expectations::exact(), build }
}

/// A filter with models of its own.
pub fn own<const N: usize, F, B>(build: B) -> OnePoint<N, B>
where
    F: Filter<N, Measurement = Points>,
    B: Fn(&Problem) -> F,
{
    OnePoint { expectations: Expectations { extremes: false, ..Expectations::own_models() }, build }
}

impl<const N: usize, F, B> Subject<N> for OnePoint<N, B>
where
    F: Filter<N, Measurement = Points>,
    B: Fn(&Problem) -> F,
{
    type Filter = F;

    fn filter(&self, problem: &Problem) -> F {
        (self.build)(problem)
    }

    fn measurement(&self, problem: &Problem, position: &Vector2<f64>, error: &Vector2<f64>) -> Points {
        Points::from(vec![position + problem.deviations.component_mul(error)])
    }

    fn unusable(&self) -> Vec<Points> {
        vec![
            Points::from_iter([[f64::NAN, 3000.0]]),
            Points::from_iter([[4000.0, 3000.0], [4000.0, f64::INFINITY]]),
            Points::from_iter([[4000.0, 3000.0], [f64::NEG_INFINITY, f64::NAN], [4000.0, 3000.0]]),
        ]
    }

    fn expectations(&self) -> Expectations {
        self.expectations
    }
}

/// A weight beside which a point is nothing.
const CERTAIN: f64 = 1e13;

/// Half of the noise of the problem as that of the sensor; the other half is to come from the extent.
fn halved(problem: &Problem) -> (Scattering, Vector2<f64>) {
    let scattering = Scattering::uniform(problem.noise() * 0.5).unwrap();
    (scattering, problem.deviations * 2.0_f64.sqrt())
}

pub enum Kind {
    Direct,
    Distorted,
    Variational,
}

pub fn matrix(problem: &Problem, kind: Kind) -> RandomMatrix<ConstantVelocity> {
    let (halved, axes) = halved(problem);
    let extent = Matrix2::from_diagonal(&axes.component_mul(&axes));
    // The variational filter estimates the true point as well; it is exact where the sensor has no noise.
    let (scattering, extent, rule) = match kind {
        Kind::Direct => (Scattering::direct(), problem.noise(), Rule::Direct),
        Kind::Distorted => (halved, extent, Rule::Distorted),
        Kind::Variational => {
            let scattering = Scattering::uniform(Matrix2::zeros()).unwrap();
            (scattering, problem.noise() * 4.0, Rule::Variational { sweeps: 5, tolerance: 0.0 })
        }
    };
    let prior = InverseWishart::new(extent, CERTAIN).unwrap();
    RandomMatrix::new(problem.motion(), scattering, prior, Evolution::forget(f64::INFINITY).unwrap(), rule)
}

pub fn interacting(problem: &Problem) -> Imm<RandomMatrix<ConstantVelocity>> {
    Imm::new([0; 3].map(|_| matrix(problem, Kind::Distorted)), Transition::sticky(0.9).per(1.0)).unwrap()
}

pub fn unknown(problem: &Problem) -> RandomMatrix<ConstantVelocity> {
    let (scattering, axes) = halved(problem);
    let prior = InverseWishart::new(Matrix2::from_diagonal(&axes.component_mul(&axes)), 5.0).unwrap();
    let evolution = Evolution::forget(20.0).unwrap();
    RandomMatrix::new(problem.motion(), scattering, prior, evolution, Rule::Distorted)
}

pub fn linearised(problem: &Problem) -> MemEkf<ConstantVelocity> {
    let (scattering, axes) = halved(problem);
    let shape = Gaussian { mean: Vector3::new(0.0, axes.x, axes.y), covariance: Matrix3::zeros() };
    MemEkf::new(problem.motion(), scattering, shape, Vector3::zeros()).unwrap()
}

pub fn sampled(problem: &Problem) -> MemRbpf<ConstantVelocity> {
    let (scattering, axes) = halved(problem);
    let filter = MemRbpf::new(problem.motion(), scattering, axes, 10, 1).unwrap();
    filter.with_turning(0.0).unwrap().with_angle(0.0, 0.0)
}

pub fn known(problem: &Problem) -> KnownSize<ConstantVelocity> {
    let (scattering, axes) = halved(problem);
    KnownSize::new(problem.motion(), scattering, axes, Pointing::Scan).unwrap()
}

/// A round object without size: one that has either turns with its velocity.
fn dot(problem: &Problem) -> (Scattering, Vector2<f64>) {
    let scattering = Scattering::uniform(problem.noise()).unwrap();
    (scattering, Vector2::repeat(1e-6 * problem.deviations.min()))
}

pub fn aligned(problem: &Problem) -> Aligned<ConstantVelocity> {
    let (scattering, axes) = dot(problem);
    Aligned::new(problem.motion(), scattering, axes).unwrap()
}

pub fn regressive(problem: &Problem) -> AlignedAutoRegressive<3> {
    let (scattering, axes) = dot(problem);
    let weights =
        Gaussian { mean: SVector::<f64, 3>::new(1.0, 0.0, 0.0), covariance: Matrix3::identity() * 1e-4 };
    let filter = AlignedAutoRegressive::new(scattering, axes, 1.0, problem.density.sqrt()).unwrap();
    filter.with_coefficients(weights).with_speed(20.0)
}

pub fn centroid(problem: &Problem) -> Centroid<ConstantVelocity> {
    let (scattering, axes) = halved(problem);
    let extent = Matrix2::from_diagonal(&axes.component_mul(&axes));
    Centroid::new(problem.motion(), scattering, extent).unwrap()
}
