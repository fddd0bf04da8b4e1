//! What a sensor reports of one object.

use nalgebra::{SMatrix, SVector};

use crate::belief::Cholesky;
use crate::error::FilterError;

/// One measurement of `M` components, with its own noise covariance when the sensor reports one.
///
/// ```
/// use tercel_core::sensor::Measurement;
///
/// let plot: Measurement<2> = [1200.0, 0.3].into();
/// assert_eq!(plot.noise, None);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement<const M: usize> {
    /// What was measured, in the sensor's components and order.
    pub value: SVector<f64, M>,
    /// Covariance of the error of `value`, when it comes with the measurement; otherwise the sensor's own holds.
    pub noise: Option<SMatrix<f64, M, M>>,
    /// Seconds between the moment at which the object was measured and the time of the scan, `>= 0` unless clocks disagree.
    /// The measurement is compared with where the object was then: `age` times its velocity back, to first order. States
    /// without velocities ignore it.
    pub age: f64,
}

impl<const M: usize> From<[f64; M]> for Measurement<M> {
    fn from(value: [f64; M]) -> Self {
        Measurement { value: value.into(), noise: None, age: 0.0 }
    }
}

impl<const M: usize> From<SVector<f64, M>> for Measurement<M> {
    fn from(value: SVector<f64, M>) -> Self {
        Measurement { value, noise: None, age: 0.0 }
    }
}

impl<const M: usize> Measurement<M> {
    /// The same measurement with its own noise covariance.
    pub fn with_noise(self, noise: SMatrix<f64, M, M>) -> Self {
        Measurement { noise: Some(noise), ..self }
    }

    /// The same measurement, taken `age` seconds before the time of the scan.
    ///
    /// ```
    /// use tercel_core::{belief::Gaussian, filter::{Filter, Kalman}, motion::ConstantVelocity, sensor::{Measurement, Position}};
    ///
    /// let filter = Kalman::new(ConstantVelocity::new(0.1), Position::new(5.0)?);
    /// let mut belief: Gaussian<4> = filter.birth(&[0.0, 0.0].into())?;
    /// for second in 1..=20 {
    ///     filter.predict(&mut belief, 1.0);
    ///     // Flies at 100 m/s and is always measured 0.4 s before the scan ends.
    ///     let plot = Measurement::from([100.0 * (second as f64 - 0.4), 0.0]).with_age(0.4);
    ///     filter.update(&mut belief, &plot)?;
    /// }
    /// assert!((belief.mean[0] - 2000.0).abs() < 1.0);
    /// # Ok::<(), tercel_core::error::FilterError>(())
    /// ```
    pub fn with_age(self, age: f64) -> Self {
        Measurement { age, ..self }
    }

    /// The noise covariance that came with the measurement, if one did.
    ///
    /// # Errors
    /// When it is not positive definite. An error of zero is not one that a measurement can have.
    #[inline]
    pub fn own_noise(&self) -> Result<Option<&SMatrix<f64, M, M>>, FilterError> {
        match &self.noise {
            Some(noise) => definite(noise).map(|()| Some(noise)),
            None => Ok(None),
        }
    }

    /// Fails when the value, the noise or the age holds a number that is not finite.
    pub(super) fn check_finite(&self) -> Result<(), FilterError> {
        let noise_is_finite = self.noise.is_none_or(|noise| noise.iter().all(|x| x.is_finite()));
        if noise_is_finite && self.age.is_finite() && self.value.iter().all(|x| x.is_finite()) {
            return Ok(());
        }
        Err(FilterError::NotFinite { what: "measurement" })
    }
}

// Out of line: most measurements bring no noise.
#[inline(never)]
fn definite<const M: usize>(noise: &SMatrix<f64, M, M>) -> Result<(), FilterError> {
    Cholesky::new(noise, "noise of the measurement").map(drop)
}

/// A measurement in the components in which a filter compares it with what was expected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading<const M: usize> {
    /// The measured components.
    pub value: SVector<f64, M>,
    /// Covariance of their errors.
    pub noise: SMatrix<f64, M, M>,
}
