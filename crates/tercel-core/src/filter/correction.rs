//! The steps that Kalman and extended filters share.

use nalgebra::{SMatrix, SVector};

use super::Innovation;
use crate::belief::{Cholesky, Gaussian, positive};
use crate::error::FilterError;
use crate::motion::Motion;
use crate::sensor::{Aged, Measurement, Reading, Sensor};

/// A measurement compared with a Gaussian belief through a linearised sensor.
pub(crate) struct Comparison<const N: usize, const M: usize> {
    residual: SVector<f64, M>,
    noise: SMatrix<f64, M, M>,
    jacobian: SMatrix<f64, M, N>,
    /// `P Hᵀ`, the covariance of state and reading.
    cross: SMatrix<f64, N, M>,
    factor: Cholesky<M>,
    pub innovation: Innovation,
}

impl<const N: usize, const M: usize> Comparison<N, M> {
    /// Compares `measurement` with what `sensor` would read of `belief` as it is; for one with an age, that is the sensor of then.
    // Inlined by force, as `condition` is: the parts would otherwise travel through memory, a quarter of the time of a step.
    #[inline(always)]
    pub fn new(
        sensor: &impl Sensor<N, M>,
        belief: &Gaussian<N>,
        measurement: &Measurement<M>,
    ) -> Result<Self, FilterError> {
        let expected = sensor.expected(&belief.mean);
        let Reading { value, noise } = sensor.read(measurement, Some(&expected))?;
        let residual = sensor.difference(&value, &expected);
        let jacobian = sensor.jacobian(&belief.mean);
        let cross = sensor.project(&belief.covariance, &jacobian);
        let factor = Cholesky::new(&(jacobian * cross + noise), "innovation covariance")?;
        let nis = near(factor.mahalanobis(&residual))?;
        let innovation = Innovation::new(&residual, nis, factor.ln_density(nis));
        Ok(Comparison { residual, noise, jacobian, cross, factor, innovation })
    }

    /// Conditions the belief on the measurement, with the covariance in Joseph's form. On an error it stays as it was.
    #[inline(always)]
    pub fn condition(&self, sensor: &impl Sensor<N, M>, belief: &mut Gaussian<N>) -> Result<(), FilterError> {
        let gain = self.factor.right_solve(&self.cross);
        let mean = belief.mean + gain * self.residual;
        let covariance = self.conditioned(sensor, belief, &gain)?;
        if !mean.iter().all(|x| x.is_finite()) {
            return Err(FilterError::NotFinite { what: "state mean" });
        }
        *belief = Gaussian { mean, covariance };
        Ok(())
    }

    /// The covariance after the measurement: `(I - K H) P (I - K H)ᵀ + K R Kᵀ`.
    #[inline(always)]
    fn conditioned(
        &self,
        sensor: &impl Sensor<N, M>,
        belief: &Gaussian<N>,
        gain: &SMatrix<f64, N, M>,
    ) -> Result<SMatrix<f64, N, N>, FilterError> {
        // With A = (I - K H) P = P - K (P Hᵀ)ᵀ computed once.
        let shrunk = belief.covariance - gain * self.cross.transpose();
        let mut covariance =
            shrunk - (sensor.project(&shrunk, &self.jacobian) - gain * self.noise) * gain.transpose();
        positive::symmetrise(&mut covariance);
        if !positive::is_definite(&covariance) {
            covariance = self.factored(belief, gain)?;
        }
        Ok(covariance)
    }

    /// The same covariance from a factor `L` of the old one, `(L - K H L)(L - K H L)ᵀ + K R Kᵀ`. Slower, but cancels only
    /// half as many digits, which saves a belief that was vague beside the measurement.
    #[cold]
    fn factored(
        &self,
        belief: &Gaussian<N>,
        gain: &SMatrix<f64, N, M>,
    ) -> Result<SMatrix<f64, N, N>, FilterError> {
        let lower = positive::root(&belief.covariance);
        let left = lower - gain * (self.jacobian * lower);
        let mut covariance = left * left.transpose() + gain * self.noise * gain.transpose();
        positive::settle(&mut covariance, "state covariance")?;
        Ok(covariance)
    }
}

/// Conditions a belief on a measurement of any age. On an error it stays as it was.
#[inline(always)]
pub(crate) fn update<const N: usize, const M: usize>(
    sensor: &impl Sensor<N, M>,
    belief: &mut Gaussian<N>,
    measurement: &Measurement<M>,
) -> Result<Innovation, FilterError> {
    if measurement.age != 0.0 {
        return update_of_then(&Aged::new(sensor, measurement.age), belief, measurement);
    }
    let comparison = Comparison::new(sensor, belief, measurement)?;
    comparison.condition(sensor, belief)?;
    Ok(comparison.innovation)
}

// Out of line, so that the common case stays small.
#[cold]
#[inline(never)]
fn update_of_then<const N: usize, const M: usize>(
    sensor: &impl Sensor<N, M>,
    belief: &mut Gaussian<N>,
    measurement: &Measurement<M>,
) -> Result<Innovation, FilterError> {
    let comparison = Comparison::new(sensor, belief, measurement)?;
    comparison.condition(sensor, belief)?;
    Ok(comparison.innovation)
}

/// What [`update`] would return.
#[inline(always)]
pub(crate) fn innovation<const N: usize, const M: usize>(
    sensor: &impl Sensor<N, M>,
    belief: &Gaussian<N>,
    measurement: &Measurement<M>,
) -> Result<Innovation, FilterError> {
    Ok(Comparison::new(&Aged::new(sensor, measurement.age), belief, measurement)?.innovation)
}

/// Largest normalised innovation squared. The square of what lies farther away than this may be too large for a double in the
/// next step, when modes are mixed.
const LARGEST_NIS: f64 = 1e200;

/// A normalised innovation squared that can be computed with.
///
/// # Errors
/// When it is not finite or too large: something is not a number, or the measurement lies beyond all bounds.
#[inline(always)]
pub(super) fn near(nis: f64) -> Result<f64, FilterError> {
    if nis <= LARGEST_NIS { Ok(nis) } else { Err(FilterError::NotFinite { what: "innovation" }) }
}

/// Compares a belief with several measurements. What the expected reading shares with those of one age is computed once, and the
/// factor of the innovation covariance once for readings of the same noise.
pub(crate) fn compare_all<const N: usize, const M: usize>(
    sensor: &impl Sensor<N, M>,
    belief: &Gaussian<N>,
    measurements: &[&Measurement<M>],
    found: &mut Vec<Result<Innovation, FilterError>>,
) {
    found.clear();
    for run in measurements.chunk_by(|one, next| one.age == next.age) {
        compare_run(&Aged::new(sensor, run[0].age), belief, run, found);
    }
}

/// The same for measurements that the sensor took at one time.
#[inline]
fn compare_run<const N: usize, const M: usize>(
    sensor: &impl Sensor<N, M>,
    belief: &Gaussian<N>,
    measurements: &[&Measurement<M>],
    found: &mut Vec<Result<Innovation, FilterError>>,
) {
    let expected = sensor.expected(&belief.mean);
    let jacobian = sensor.jacobian(&belief.mean);
    let spread = jacobian * sensor.project(&belief.covariance, &jacobian);
    let mut last: Option<(SMatrix<f64, M, M>, Cholesky<M>, f64)> = None;
    found.extend(measurements.iter().map(|measurement| {
        let reading = sensor.read(measurement, Some(&expected))?;
        let residual = sensor.difference(&reading.value, &expected);
        let (_, factor, ln_peak) = match &last {
            Some(shared) if shared.0 == reading.noise => shared,
            _ => {
                let factor = Cholesky::new(&(spread + reading.noise), "innovation covariance")?;
                last.insert((reading.noise, factor, factor.ln_density(0.0)))
            }
        };
        let nis = near(factor.mahalanobis(&residual))?;
        Ok(Innovation::new(&residual, nis, ln_peak - 0.5 * nis))
    }));
}

/// Conditions a belief on several measurements with one gain, which is exact if their noise and age are the same: the means differ by what
/// the gain makes of the residuals, and the covariance is common. Returns the weight of the measurements; none, and leaves the
/// belief as it was, where that is not possible.
pub(crate) fn associate<const N: usize, const M: usize>(
    sensor: &impl Sensor<N, M>,
    belief: &mut Gaussian<N>,
    parts: &[(f64, &Measurement<M>)],
    none: f64,
) -> Option<f64> {
    let first = parts.first()?.1;
    let sensor = &Aged::new(sensor, first.age);
    let comparison = Comparison::new(sensor, belief, first).ok()?;
    let expected = sensor.expected(&belief.mean);
    // Mean and covariance of the residual; it is zero where no measurement is the object's own.
    let (mut mean, mut scatter) = (SVector::<f64, M>::zeros(), SMatrix::<f64, M, M>::zeros());
    let (mut total, mut weight) = (none, 0.0);
    for (part, measurement) in parts.iter().filter(|part| part.0 > 0.0) {
        let reading = sensor.read(measurement, Some(&expected)).ok()?;
        let difference = sensor.difference(&reading.value, &expected) - mean;
        let alike = reading.noise == comparison.noise && measurement.age == first.age;
        if !alike || !difference.iter().all(|x| x.is_finite()) {
            return None;
        }
        (total, weight) = (total + part, weight + part);
        let share = part / total;
        mean += difference * share;
        scatter = scatter * (1.0 - share) + difference * difference.transpose() * (share * (1.0 - share));
    }
    if weight == 0.0 {
        return Some(0.0);
    }
    let gain = comparison.factor.right_solve(&comparison.cross);
    let conditioned = comparison.conditioned(sensor, belief, &gain).ok()?;
    let share = weight / total;
    let mut covariance =
        belief.covariance * (1.0 - share) + conditioned * share + gain * scatter * gain.transpose();
    positive::symmetrise(&mut covariance);
    let mean = belief.mean + gain * mean;
    if !positive::is_definite(&covariance) || !mean.iter().all(|x| x.is_finite()) {
        return None;
    }
    *belief = Gaussian { mean, covariance };
    Some(weight)
}

/// The belief after `dt` by a motion, to first order.
#[inline(always)]
pub(crate) fn predicted<const N: usize>(
    motion: &impl Motion<N>,
    belief: &Gaussian<N>,
    dt: f64,
) -> Gaussian<N> {
    let mut next = motion.predict(belief, dt);
    positive::symmetrise(&mut next.covariance);
    if !positive::is_definite(&next.covariance) {
        next.covariance = spread(motion, belief, dt);
    }
    next
}

/// The predicted covariance from a factor of the old one, when a long step has left it singular up to rounding. What is not
/// finite stays so, for the next update to report.
#[cold]
fn spread<const N: usize>(motion: &impl Motion<N>, belief: &Gaussian<N>, dt: f64) -> SMatrix<f64, N, N> {
    let moved = motion.jacobian(&belief.mean, dt) * positive::root(&belief.covariance);
    let mut covariance = moved * moved.transpose() + motion.noise(&belief.mean, dt);
    let _ = positive::settle(&mut covariance, "state covariance");
    covariance
}
