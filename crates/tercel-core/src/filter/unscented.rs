//! The unscented Kalman filter.

use nalgebra::{SMatrix, SVector};

use super::correction::near;
use super::gaussian::{gaussian_belief, searched};
use super::sigma::{Image, Points};
use super::{Filter, Innovation, SigmaPoints};
use crate::association::{Region, Search};
use crate::belief::{Cholesky, Gaussian};
use crate::error::FilterError;
use crate::motion::Motion;
use crate::sensor::{Aged, Measurement, Reading, Sensor};

/// Estimates the state of an object whose motion or sensor bends, by sending a few points of the belief through both.
///
/// ## Recursion
/// ```text
/// predict   x⁻, P⁻ = moments of f(χ) + (0, Q)                              χ: sigma points of (x, P)
/// update    ẑ, S   = moments of h(χ) + (0, R)     C = cov(χ, h(χ))         χ: sigma points of (x⁻, P⁻), drawn anew
///           K = C S⁻¹        x = x⁻ + K (z ⊖ ẑ)        P = P⁻ - K S Kᵀ
/// ```
/// [`SigmaPoints`] says where the points lie and how their moments are taken. The mean of a periodic reading is taken on
/// the circle, through the differences from the reading of the central point.
///
/// ## Use it when
/// the curvature matters over the width of the belief: long ranges with coarse bearings, fast turns, first scans. Models
/// need no Jacobian. On linear problems it is the Kalman filter at several times its cost.
///
/// ## Reference
/// Julier and Uhlmann (2004); Wan and van der Merwe (2000), section 3, with additive noise. Deviations: `P` is computed
/// as `(X - K Z)(X - K Z)ᵀ + K R Kᵀ` from the columns `X` and `Z` of state and reading, which is the same matrix in a
/// form that cannot become indefinite, and likewise all moments (see [`SigmaPoints`]).
///
/// Validated against FilterPy 1.4.5 over 15 steps of range and bearing: states and covariances agree to 1e-9.
///
/// ```
/// use tercel_core::{belief::Gaussian, filter::{Filter, Unscented}, motion::CoordinatedTurn, sensor::RangeBearing};
///
/// let filter = Unscented::new(CoordinatedTurn::new(1.0, 1e-4), RangeBearing::new(20.0, 0.02)?);
/// let mut belief: Gaussian<5> = filter.birth(&[5_000.0, 3.14].into())?;
/// filter.predict(&mut belief, 2.0);
/// let innovation = filter.update(&mut belief, &[5_000.0, -3.14].into())?;
/// assert!(innovation.residual()[1].abs() < 0.01); // across the cut, not around the world
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unscented<T, S, const M: usize = 2> {
    /// How the object moves.
    pub motion: T,
    /// What is measured of it.
    pub sensor: S,
    /// Where the belief is sampled.
    pub points: SigmaPoints,
}

impl<T, S, const M: usize> Unscented<T, S, M> {
    /// An unscented filter of this motion and this sensor, with the default [`SigmaPoints`].
    pub fn new(motion: T, sensor: S) -> Self {
        Unscented { motion, sensor, points: SigmaPoints::default() }
    }

    /// Sets where the belief is sampled.
    pub fn with_points(self, points: SigmaPoints) -> Self {
        Unscented { points, ..self }
    }

    /// Predicts over `dt` seconds and updates with the points that were moved, instead of drawing new ones between.
    ///
    /// This saves one factorisation, and is what FilterPy does. The moved points know nothing of the process noise of
    /// this step, so the reading's spread and the gain come out too small by its share, and the filter listens less to
    /// the measurement than it should: prefer [`predict`](Filter::predict) and [`update`](Filter::update) unless the
    /// process noise of one step is small against the covariance.
    ///
    /// # Errors
    /// As [`update`](Filter::update). The belief is then unchanged, and not predicted either.
    pub fn step<const N: usize>(
        &self,
        belief: &mut Gaussian<N>,
        dt: f64,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError>
    where
        T: Motion<N>,
        S: Sensor<N, M>,
    {
        let moved = self.points.draw(belief).map(|state| self.motion.transition(state, dt));
        let noise = self.motion.noise(&belief.mean, dt);
        let comparison = Comparison::new(self, &moved, measurement)?;
        *belief = comparison.posterior(&moved.image(&self.points, |a, b| a - b), &noise)?;
        Ok(comparison.innovation)
    }
}

impl<const N: usize, const M: usize, T, S> Filter<N> for Unscented<T, S, M>
where
    T: Motion<N>,
    S: Sensor<N, M>,
{
    type Belief = Gaussian<N>;
    type Measurement = Measurement<M>;

    fn birth(&self, measurement: &Measurement<M>) -> Result<Gaussian<N>, FilterError> {
        self.sensor.birth(measurement, &self.motion.prior())
    }

    fn predict(&self, belief: &mut Gaussian<N>, dt: f64) {
        let noise = self.motion.noise(&belief.mean, dt);
        let moved = self.points.draw(belief).map(|state| self.motion.transition(state, dt));
        let image = moved.image(&self.points, |a, b| a - b);
        belief.mean = image.mean;
        belief.covariance = image.covariance() + noise;
    }

    fn update(
        &self,
        belief: &mut Gaussian<N>,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError> {
        let points = self.points.draw(belief);
        let comparison = Comparison::new(self, &points, measurement)?;
        *belief = comparison.posterior(&points.image(&self.points, |a, b| a - b), &SMatrix::zeros())?;
        Ok(comparison.innovation)
    }

    fn innovation(
        &self,
        belief: &Gaussian<N>,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError> {
        Ok(Comparison::new(self, &self.points.draw(belief), measurement)?.innovation)
    }

    fn reach(&self, belief: &Gaussian<N>, search: &Search) -> Option<Region> {
        let points = self.points.draw(belief);
        searched(&self.sensor, search, &belief.mean, |sensor, probe| {
            let image = readings(sensor, &self.points, &points);
            let noise = sensor.read(probe, Some(&image.mean))?.noise;
            Ok((image.mean, (image.covariance() + noise).diagonal()))
        })
    }

    gaussian_belief!(M);
}

/// The moments of what a sensor reads of sigma points.
#[inline]
fn readings<const N: usize, const M: usize>(
    sensor: &impl Sensor<N, M>,
    rule: &SigmaPoints,
    points: &Points<N, N>,
) -> Image<M, N> {
    let readings = points.map(|state| sensor.expected(state));
    readings.image(rule, |reading, centre| sensor.difference(reading, centre))
}

/// A measurement compared with the readings of sigma points.
struct Comparison<const N: usize, const M: usize> {
    reading: Reading<M>,
    residual: SVector<f64, M>,
    image: Image<M, N>,
    factor: Cholesky<M>,
    innovation: Innovation,
}

impl<const N: usize, const M: usize> Comparison<N, M> {
    fn new<T, S: Sensor<N, M>>(
        filter: &Unscented<T, S, M>,
        points: &Points<N, N>,
        measurement: &Measurement<M>,
    ) -> Result<Self, FilterError> {
        let sensor = Aged::new(&filter.sensor, measurement.age);
        let image = readings(&sensor, &filter.points, points);
        let reading = sensor.read(measurement, Some(&image.mean))?;
        let residual = sensor.difference(&reading.value, &image.mean);
        let factor = Cholesky::new(&(image.covariance() + reading.noise), "innovation covariance")?;
        let nis = near(factor.mahalanobis(&residual))?;
        let innovation = Innovation::new(&residual, nis, factor.ln_density(nis));
        Ok(Comparison { reading, residual, image, factor, innovation })
    }

    /// The belief whose sigma points have this image, with additional noise, conditioned on the measurement.
    fn posterior(&self, state: &Image<N, N>, noise: &SMatrix<f64, N, N>) -> Result<Gaussian<N>, FilterError> {
        let gain = self.factor.right_solve(&state.cross(&self.image));
        let left = state.minus(&gain, &self.image);
        let mut posterior = Gaussian {
            mean: state.mean + gain * self.residual,
            covariance: left.covariance() + noise + gain * self.reading.noise * gain.transpose(),
        };
        posterior.settle()?;
        Ok(posterior)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::{Extended, Kalman};
    use crate::motion::{ConstantVelocity, CoordinatedTurn};
    use crate::sensor::{BearingOnly, Position, RangeBearing};
    use nalgebra::{SMatrix, vector};
    use proptest::prelude::*;

    /// A sensor of the square of a position, whose moments are known.
    struct Square;

    impl Sensor<1, 1> for Square {
        fn expected(&self, state: &SVector<f64, 1>) -> SVector<f64, 1> {
            vector![state[0] * state[0]]
        }
        fn jacobian(&self, state: &SVector<f64, 1>) -> SMatrix<f64, 1, 1> {
            SMatrix::from([[2.0 * state[0]]])
        }
        fn noise(&self, _: &SVector<f64, 1>) -> SMatrix<f64, 1, 1> {
            SMatrix::from([[0.5]])
        }
        fn birth(&self, _: &Measurement<1>, prior: &Gaussian<1>) -> Result<Gaussian<1>, FilterError> {
            Ok(*prior)
        }
        fn place(&self, _: &Measurement<1>) -> Option<nalgebra::Vector2<f64>> {
            None
        }
        fn region(&self, _: &SVector<f64, 1>, _: &SVector<f64, 1>) -> Option<Region> {
            None
        }
    }

    #[test]
    fn the_moments_of_a_square_are_exact_for_any_spread_of_the_points() {
        let (mean, variance) = (0.7, 2.0);
        let belief = Gaussian::new(vector![mean], SMatrix::from([[variance]])).unwrap();
        for (alpha, kappa) in [(1.0, 0.0), (1e-3, 0.0), (0.5, 2.0)] {
            let filter: Unscented<_, _, 1> = Unscented::new(crate::motion::RandomWalk::new(1.0), Square)
                .with_points(SigmaPoints::new(alpha, 2.0, kappa).unwrap());
            let innovation = filter.innovation(&belief, &[3.0].into()).unwrap();
            let residual = innovation.residual()[0];
            assert!((residual - (3.0 - mean * mean - variance)).abs() < 1e-8, "{alpha} {residual}");
            // The extra κ of the even part scales with the fourth moment, which is exact at κ = 0.
            if kappa == 0.0 {
                let spread = 4.0 * mean * mean * variance + 2.0 * variance * variance + 0.5;
                assert!((innovation.nis * spread / (residual * residual) - 1.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_bearing_is_averaged_across_the_cut() {
        let radar = RangeBearing::new(10.0, 0.01).unwrap();
        let filter = Unscented::new(ConstantVelocity::new(1.0), radar);
        let far = SMatrix::from_diagonal(&vector![100.0, 1e4, 1.0, 1.0]);
        let mut belief = Gaussian::new(vector![-1000.0, 0.0, 0.0, 0.0], far).unwrap();
        let innovation = filter.update(&mut belief, &[1005.0, -3.1].into()).unwrap();
        assert!((innovation.residual()[1] - 0.0416).abs() < 1e-3, "{:?}", innovation.residual());
        assert!(belief.mean[1] < -30.0);
    }

    #[test]
    fn a_wide_cross_range_error_biases_the_extended_filter_more() {
        // Range 1000 m, 200 m wide across: the mean range is longer than the range of the mean by 200²/2000 m.
        let radar = RangeBearing::new(5.0, 0.01).unwrap();
        let wide = SMatrix::from_diagonal(&vector![100.0, 4e4, 1.0, 1.0]);
        let belief = Gaussian::new(vector![1000.0, 0.0, 0.0, 0.0], wide).unwrap();
        let motion = ConstantVelocity::new(1.0);
        let seen = [1020.0, 0.0].into();
        let bent = Unscented::new(motion, radar).innovation(&belief, &seen).unwrap();
        let straight = Extended::new(motion, radar).innovation(&belief, &seen).unwrap();
        assert!(bent.residual()[0].abs() < 1.0 && straight.residual()[0] == 20.0, "{bent:?}");
        assert!(bent.nis < straight.nis);
    }

    #[test]
    fn a_step_that_keeps_its_points_is_the_filter_when_there_is_no_process_noise() {
        let still = ConstantVelocity::new(0.0);
        let filter = Unscented::new(still, RangeBearing::new(10.0, 0.01).unwrap());
        let mut once: Gaussian<4> = filter.birth(&[1000.0, 0.3].into()).unwrap();
        let before = once;
        let mut twice = once;
        assert!(filter.step(&mut once, 1.0, &[f64::NAN, 0.0].into()).is_err());
        assert_eq!(once, before);
        filter.step(&mut once, 0.0, &[1003.0, 0.31].into()).unwrap();
        filter.predict(&mut twice, 0.0);
        filter.update(&mut twice, &[1003.0, 0.31].into()).unwrap();
        assert!((once.mean - twice.mean).norm() < 1e-9);
        assert!((once.covariance - twice.covariance).norm() < 1e-9);
    }

    #[test]
    fn linear_problems_are_the_kalman_filters_up_to_rounding_even_after_a_vague_birth() {
        let (motion, radar) = (ConstantVelocity::new(0.1).with_speed(1e4), Position::<2>::new(1e-3).unwrap());
        let (bent, exact) = (Unscented::new(motion, radar), Kalman::new(motion, radar));
        let mut a: Gaussian<4> = bent.birth(&[0.0, 0.0].into()).unwrap();
        let mut b = a;
        for step in 1..50 {
            let seen = [f64::from(step), 0.5].into();
            bent.predict(&mut a, 1.0);
            bent.update(&mut a, &seen).unwrap();
            exact.predict(&mut b, 1.0);
            exact.update(&mut b, &seen).unwrap();
        }
        assert!((a.covariance - b.covariance).norm() < 1e-6 * b.covariance.norm());
    }

    proptest! {
        #[test]
        fn no_parameters_and_no_belief_make_a_covariance_indefinite(
            (alpha, beta, kappa) in (1e-3..2.0_f64, 0.0..3.0_f64, 0.0..3.0_f64),
            mean in proptest::array::uniform5(-100.0..100.0_f64),
            deviations in proptest::array::uniform5(1e-3..1e3_f64),
            dt in 0.0..50.0_f64,
            bearing in -3.0..3.0_f64,
        ) {
            let points = SigmaPoints::new(alpha, beta, kappa).unwrap();
            let motion = CoordinatedTurn::new(0.0, 0.0);
            let filter: Unscented<_, _, 1> =
                Unscented::new(motion, BearingOnly::new(1e-3).unwrap()).with_points(points);
            let square = SVector::from(deviations.map(|d| d * d));
            let mut belief = Gaussian::new(SVector::from(mean), SMatrix::from_diagonal(&square)).unwrap();
            filter.predict(&mut belief, dt);
            let eigenvalues = belief.covariance.symmetric_eigenvalues();
            prop_assert!(eigenvalues.min() >= -1e-12 * eigenvalues.max(), "predicted: {eigenvalues}");
            filter.update(&mut belief, &[bearing].into()).unwrap();
            prop_assert!(Cholesky::new(&belief.covariance, "posterior").is_ok());
        }
    }
}
