//! A filter of a smaller state beside filters of a larger one.

use nalgebra::{SMatrix, SVector, Vector2};

use super::{Filter, Innovation};
use crate::association::{Region, Search};
use crate::belief::Gaussian;
use crate::error::FilterError;

/// Estimates a state of `N` components with a filter of its first `K`, so that it can stand beside filters of
/// all `N`.
///
/// ## Definition
/// The filter works on the leading `K` components. The rest has mean zero, the stated deviation, and no
/// correlation with anything, after every step:
/// ```text
/// x = (x_K, 0)        P = diag(P_K, σ² I)
/// ```
///
/// ## Use it when
/// modes of an [`Imm`](super::Imm) have states of different length: a straight model without accelerations
/// beside one that estimates them. The deviation says how far the missing components may be from zero while
/// this mode holds: when the larger model takes over, mixing starts it there. About the size that these
/// components reach in the larger model is right; a tiny one would hold the larger model back after every
/// change.
///
/// ## Reference
/// Bar-Shalom, Li and Kirubarajan (2001), section 11.6.7, on models of different dimension.
///
/// ```
/// use tercel_core::{filter::{Filter, Imm, Kalman, Padded, Transition}, sensor::Position};
/// use tercel_core::motion::{ConstantAcceleration, ConstantVelocity};
/// use tercel_core::{belief::Gaussian, sensor::Measurement};
///
/// let radar = Position::<2>::new(5.0)?;
/// type Mode = Box<dyn Filter<6, Belief = Gaussian<6>, Measurement = Measurement<2>>>;
/// let straight: Mode = Box::new(Padded::<_, 4>::new(Kalman::new(ConstantVelocity::new(0.1), radar), 2.0)?);
/// let manoeuvring: Mode = Box::new(Kalman::new(ConstantAcceleration::new(1.0), radar));
/// let imm = Imm::new([straight, manoeuvring], Transition::sticky(0.95))?;
/// # let mut belief = imm.birth(&[0.0, 0.0].into())?;
/// # imm.predict(&mut belief, 1.0);
/// # imm.update(&mut belief, &[1.0, 1.0].into())?;
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Padded<F, const K: usize> {
    filter: F,
    variance: f64,
}

impl<F, const K: usize> Padded<F, K> {
    /// A filter of the first `K` components, and the standard deviation of each missing one, in its own unit.
    ///
    /// # Errors
    /// When the deviation is not positive and finite.
    pub fn new(filter: F, deviation: f64) -> Result<Self, FilterError> {
        let deviation = FilterError::positive("deviation of a missing component", deviation)?;
        Ok(Padded { filter, variance: deviation * deviation })
    }

    /// The belief of the whole state whose leading part is `part`.
    fn whole<const N: usize>(&self, part: &Gaussian<K>) -> Gaussian<N> {
        const { assert!(K <= N, "the state of a padded filter cannot be longer than the whole") };
        let inside = |i: usize, j: usize| i < K && j < K;
        Gaussian {
            mean: SVector::from_fn(|i, _| if i < K { part.mean[i] } else { 0.0 }),
            covariance: SMatrix::from_fn(|i, j| match i == j {
                _ if inside(i, j) => part.covariance[(i, j)],
                true => self.variance,
                false => 0.0,
            }),
        }
    }
}

impl<const N: usize, const K: usize, F> Filter<N> for Padded<F, K>
where
    F: Filter<K, Belief = Gaussian<K>>,
{
    type Belief = Gaussian<N>;
    type Measurement = F::Measurement;

    fn birth(&self, measurement: &F::Measurement) -> Result<Gaussian<N>, FilterError> {
        Ok(self.whole(&self.filter.birth(measurement)?))
    }

    fn predict(&self, belief: &mut Gaussian<N>, dt: f64) {
        let mut part = belief.leading();
        self.filter.predict(&mut part, dt);
        *belief = self.whole(&part);
    }

    fn update(
        &self,
        belief: &mut Gaussian<N>,
        measurement: &F::Measurement,
    ) -> Result<Innovation, FilterError> {
        let mut part = belief.leading();
        let innovation = self.filter.update(&mut part, measurement)?;
        *belief = self.whole(&part);
        Ok(innovation)
    }

    fn innovation(
        &self,
        belief: &Gaussian<N>,
        measurement: &F::Measurement,
    ) -> Result<Innovation, FilterError> {
        self.filter.innovation(&belief.leading(), measurement)
    }

    fn state(&self, belief: &Gaussian<N>) -> Gaussian<N> {
        *belief
    }

    /// Only the leading part is taken over.
    fn set_state(&self, belief: &mut Gaussian<N>, state: &Gaussian<N>) {
        *belief = self.whole(&state.leading());
    }

    fn merge(&self, belief: &mut Gaussian<N>, weight: f64, other: &Gaussian<N>, other_weight: f64) {
        belief.merge(weight, other, other_weight);
    }

    /// Distance of the leading parts.
    fn distance(&self, belief: &Gaussian<N>, other: &Gaussian<N>, limit: f64) -> f64 {
        self.filter.distance(&belief.leading(), &other.leading(), limit)
    }

    fn reach(&self, belief: &Gaussian<N>, search: &Search) -> Option<Region> {
        self.filter.reach(&belief.leading(), search)
    }

    fn widen(&self, search: &mut Search, measurement: &F::Measurement) {
        self.filter.widen(search, measurement);
    }

    fn place(&self, measurement: &F::Measurement) -> Option<Vector2<f64>> {
        self.filter.place(measurement)
    }

    fn area(&self, measurement: &F::Measurement) -> f64 {
        self.filter.area(measurement)
    }
}
