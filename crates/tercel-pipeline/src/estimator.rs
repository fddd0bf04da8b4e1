//! From the motion and filter sections to a filter, whatever the sensor of the moment.

use nalgebra::{SMatrix, SVector, Vector2};
use tercel_core::association::Region;
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::filter::{
    Extended, Filter, Imm, ImmBelief, Padded, Particle, Particles, Transition, Unscented,
};
use tercel_core::motion::Motion;
use tercel_core::sensor::{Measurement, Reading, Sensor};

/// A filter that lacks its sensor, over states of `N` components.
pub(crate) trait Recursion<const N: usize> {
    /// What is known of one object.
    type Belief: Clone;

    /// Runs `work` with the filter for this sensor, whose measurements may be bent: see [`Rule::ByBend`].
    ///
    /// # Errors
    /// When the parameters make no filter; this does not depend on the sensor.
    fn with<const M: usize, R>(
        &self,
        sensor: &dyn Sensor<N, M>,
        bent: bool,
        work: impl FnOnce(&dyn Filter<N, Belief = Self::Belief, Measurement = Measurement<M>>) -> R,
    ) -> Result<R, FilterError>;

    /// Names of the modes of an estimate, unique; empty where there is one motion.
    fn modes(&self) -> Vec<String> {
        Vec::new()
    }
}

/// Which of the Gaussian recursions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Rule {
    /// Linearised at the mean; for linear motion and sensors this is the Kalman filter.
    Extended,
    /// By sigma points.
    Unscented,
    /// Unscented where the measurements of the scan are bent over the width of their errors, extended elsewhere.
    ByBend,
}

impl Rule {
    fn takes_sigma_points(self, bent: bool) -> bool {
        match self {
            Rule::Extended => false,
            Rule::Unscented => true,
            Rule::ByBend => bent,
        }
    }
}

/// One model of motion.
pub(crate) struct Single<const N: usize> {
    pub motion: Box<dyn Motion<N>>,
    pub rule: Rule,
}

impl<const N: usize> Recursion<N> for Single<N> {
    type Belief = Gaussian<N>;

    fn with<const M: usize, R>(
        &self,
        sensor: &dyn Sensor<N, M>,
        bent: bool,
        work: impl FnOnce(&dyn Filter<N, Belief = Gaussian<N>, Measurement = Measurement<M>>) -> R,
    ) -> Result<R, FilterError> {
        Ok(if self.rule.takes_sigma_points(bent) {
            work(&Unscented::<_, _, M>::new(&*self.motion, sensor))
        } else {
            work(&Extended::<_, _, M>::new(&*self.motion, sensor))
        })
    }
}

/// One model of motion, estimated by particles.
pub(crate) struct Cloud<const N: usize> {
    pub motion: Box<dyn Motion<N>>,
    pub count: usize,
    pub seed: u64,
}

/// Share by which resampled particles are spread, so that a vague birth does not end in a handful of copies.
const SMOOTHING: f64 = 0.35;

impl<const N: usize> Recursion<N> for Cloud<N> {
    type Belief = Particles<N>;

    fn with<const M: usize, R>(
        &self,
        sensor: &dyn Sensor<N, M>,
        _: bool,
        work: impl FnOnce(&dyn Filter<N, Belief = Particles<N>, Measurement = Measurement<M>>) -> R,
    ) -> Result<R, FilterError> {
        let filter = Particle::<_, _, M>::new(&*self.motion, sensor, self.count, self.seed)?;
        Ok(work(&filter.with_smoothing(SMOOTHING)?))
    }
}

/// Several models of motion, one of which holds at a time.
pub(crate) struct Switching<const N: usize> {
    pub modes: Vec<Mode<N>>,
    pub names: Vec<String>,
    pub rule: Rule,
    pub transition: Transition,
    /// Standard deviation of the components that a smaller mode lacks.
    pub missing: f64,
}

/// A mode, whose state may be the beginning of the whole.
pub(crate) enum Mode<const N: usize> {
    Whole(Box<dyn Motion<N>>),
    Positions(Box<dyn Motion<2>>),
    Velocities(Box<dyn Motion<4>>),
}

type AnyFilter<'a, const N: usize, const M: usize> =
    Box<dyn Filter<N, Belief = Gaussian<N>, Measurement = Measurement<M>> + 'a>;

impl<const N: usize> Switching<N> {
    /// Builds the filter. Its parameters do not depend on the sensor, so an error for one sensor is one for all.
    pub fn filter<'a, const M: usize>(
        &'a self,
        sensor: &'a dyn Sensor<N, M>,
        bent: bool,
    ) -> Result<Imm<AnyFilter<'a, N, M>>, FilterError> {
        let modes: Result<Vec<AnyFilter<'a, N, M>>, FilterError> = self
            .modes
            .iter()
            .map(|mode| match mode {
                Mode::Whole(motion) => Ok(gaussian(self.rule.takes_sigma_points(bent), &**motion, sensor)),
                Mode::Positions(motion) => self.padded::<2, M>(&**motion, sensor, bent),
                Mode::Velocities(motion) => self.padded::<4, M>(&**motion, sensor, bent),
            })
            .collect();
        Imm::new(modes?, self.transition.clone())
    }

    fn padded<'a, const K: usize, const M: usize>(
        &'a self,
        motion: &'a dyn Motion<K>,
        sensor: &'a dyn Sensor<N, M>,
        bent: bool,
    ) -> Result<AnyFilter<'a, N, M>, FilterError> {
        let part = gaussian::<K, M>(self.rule.takes_sigma_points(bent), motion, Shortened { sensor });
        Ok(Box::new(Padded::<_, K>::new(part, self.missing)?))
    }
}

/// A filter with a Gaussian belief.
fn gaussian<'a, const N: usize, const M: usize>(
    sigma_points: bool,
    motion: &'a dyn Motion<N>,
    sensor: impl Sensor<N, M> + 'a,
) -> AnyFilter<'a, N, M> {
    if sigma_points {
        Box::new(Unscented::<_, _, M>::new(motion, sensor))
    } else {
        Box::new(Extended::<_, _, M>::new(motion, sensor))
    }
}

impl<const N: usize> Recursion<N> for Switching<N> {
    type Belief = ImmBelief<Gaussian<N>, N>;

    fn with<const M: usize, R>(
        &self,
        sensor: &dyn Sensor<N, M>,
        bent: bool,
        work: impl FnOnce(&dyn Filter<N, Belief = Self::Belief, Measurement = Measurement<M>>) -> R,
    ) -> Result<R, FilterError> {
        Ok(work(&self.filter(sensor, bent)?))
    }

    fn modes(&self) -> Vec<String> {
        self.names.clone()
    }
}

/// A sensor of a whole state, as one of its first `K` components: the rest is zero.
struct Shortened<'a, const N: usize, const M: usize> {
    sensor: &'a dyn Sensor<N, M>,
}

/// A state with zeros for what is missing.
fn lengthened<const K: usize, const N: usize>(state: &SVector<f64, K>) -> SVector<f64, N> {
    SVector::from_fn(|i, _| if i < K { state[i] } else { 0.0 })
}

impl<const K: usize, const N: usize, const M: usize> Sensor<K, M> for Shortened<'_, N, M> {
    fn expected(&self, state: &SVector<f64, K>) -> SVector<f64, M> {
        self.sensor.expected(&lengthened(state))
    }

    fn jacobian(&self, state: &SVector<f64, K>) -> SMatrix<f64, M, K> {
        let whole = self.sensor.jacobian(&lengthened(state));
        SMatrix::from_fn(|i, j| whole[(i, j)])
    }

    fn noise(&self, expected: &SVector<f64, M>) -> SMatrix<f64, M, M> {
        self.sensor.noise(expected)
    }

    fn read(
        &self,
        measurement: &Measurement<M>,
        expected: Option<&SVector<f64, M>>,
    ) -> Result<Reading<M>, FilterError> {
        self.sensor.read(measurement, expected)
    }

    fn periodic(&self) -> [bool; M] {
        self.sensor.periodic()
    }

    fn birth(&self, measurement: &Measurement<M>, prior: &Gaussian<K>) -> Result<Gaussian<K>, FilterError> {
        let covariance = SMatrix::from_fn(|i, j| match i == j {
            _ if i < K && j < K => prior.covariance[(i, j)],
            true => 1.0,
            false => 0.0,
        });
        let whole = Gaussian { mean: lengthened(&prior.mean), covariance };
        Ok(self.sensor.birth(measurement, &whole)?.leading())
    }

    fn place(&self, measurement: &Measurement<M>) -> Option<Vector2<f64>> {
        self.sensor.place(measurement)
    }

    fn region(&self, expected: &SVector<f64, M>, half: &SVector<f64, M>) -> Option<Region> {
        self.sensor.region(expected, half)
    }

    fn site(&self) -> Option<Vector2<f64>> {
        self.sensor.site()
    }

    fn axes(&self) -> usize {
        self.sensor.axes()
    }

    fn area(&self, measurement: &Measurement<M>) -> f64 {
        self.sensor.area(measurement)
    }
}
