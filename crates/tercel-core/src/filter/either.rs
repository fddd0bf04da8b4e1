//! One of two filters of different types.

use nalgebra::{SMatrix, Vector2};

use super::{Estimate, Filter, Innovation};
use crate::association::{Region, Search};
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::extended::InverseWishart;

/// A filter of one type or of another, of the same state and the same measurements.
///
/// It lets filters of different types stand side by side: as the modes of an [`Imm`](super::Imm), some learned and some not, or in a
/// list of methods that are compared. More than two types nest.
///
/// ## Use it when
/// filters whose beliefs differ must have one type. Filters whose beliefs are the same go in boxes. A belief belongs to the side that
/// made it: handing it to the other one is refused where there are errors, and does nothing where there are none.
///
/// ## Reference
/// Not a method, but a sum of two types.
///
/// ```
/// use tercel_core::filter::{Either, Filter, Imm, Kalman, Transition, Unscented};
/// use tercel_core::{motion::{ConstantVelocity, Turn}, sensor::Position};
///
/// let radar = Position::<2>::new(5.0)?;
/// let calm = Either::Left(Kalman::new(ConstantVelocity::new(0.1), radar));
/// let turn = Either::Right(Unscented::new(Turn::new(0.1, 0.1), radar));
/// let imm = Imm::new([calm, turn], Transition::sticky(0.95).per(1.0))?;
/// let mut belief = imm.birth(&[0.0, 0.0].into())?;
/// imm.predict(&mut belief, 1.0);
/// imm.update(&mut belief, &[10.0, 0.0].into())?;
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Either<A, B> {
    /// The first type.
    Left(A),
    /// The second type.
    Right(B),
}

use Either::{Left, Right};

/// What is left to say where a belief of one side meets a filter of the other.
const STRANGER: FilterError = FilterError::NotFinite { what: "belief of the other filter" };

impl<const N: usize, A, B> Filter<N> for Either<A, B>
where
    A: Filter<N>,
    B: Filter<N, Measurement = A::Measurement>,
{
    type Belief = Either<A::Belief, B::Belief>;
    type Measurement = A::Measurement;

    fn birth(&self, measurement: &A::Measurement) -> Result<Self::Belief, FilterError> {
        Ok(match self {
            Left(filter) => Left(filter.birth(measurement)?),
            Right(filter) => Right(filter.birth(measurement)?),
        })
    }

    fn predict(&self, belief: &mut Self::Belief, dt: f64) {
        match (self, belief) {
            (Left(filter), Left(belief)) => filter.predict(belief, dt),
            (Right(filter), Right(belief)) => filter.predict(belief, dt),
            _ => {}
        }
    }

    fn update(
        &self,
        belief: &mut Self::Belief,
        measurement: &A::Measurement,
    ) -> Result<Innovation, FilterError> {
        match (self, belief) {
            (Left(filter), Left(belief)) => filter.update(belief, measurement),
            (Right(filter), Right(belief)) => filter.update(belief, measurement),
            _ => Err(STRANGER),
        }
    }

    fn innovation(
        &self,
        belief: &Self::Belief,
        measurement: &A::Measurement,
    ) -> Result<Innovation, FilterError> {
        match (self, belief) {
            (Left(filter), Left(belief)) => filter.innovation(belief, measurement),
            (Right(filter), Right(belief)) => filter.innovation(belief, measurement),
            _ => Err(STRANGER),
        }
    }

    fn state(&self, belief: &Self::Belief) -> Gaussian<N> {
        match (self, belief) {
            (Left(filter), Left(belief)) => filter.state(belief),
            (Right(filter), Right(belief)) => filter.state(belief),
            _ => Gaussian { mean: nalgebra::SVector::repeat(f64::NAN), covariance: SMatrix::identity() },
        }
    }

    fn set_state(&self, belief: &mut Self::Belief, state: &Gaussian<N>) {
        match (self, belief) {
            (Left(filter), Left(belief)) => filter.set_state(belief, state),
            (Right(filter), Right(belief)) => filter.set_state(belief, state),
            _ => {}
        }
    }

    fn merge(&self, belief: &mut Self::Belief, weight: f64, other: &Self::Belief, other_weight: f64) {
        match (self, belief, other) {
            (Left(filter), Left(belief), Left(other)) => filter.merge(belief, weight, other, other_weight),
            (Right(filter), Right(belief), Right(other)) => filter.merge(belief, weight, other, other_weight),
            _ => {}
        }
    }

    fn distance(&self, belief: &Self::Belief, other: &Self::Belief, limit: f64) -> f64 {
        match (self, belief, other) {
            (Left(filter), Left(belief), Left(other)) => filter.distance(belief, other, limit),
            (Right(filter), Right(belief), Right(other)) => filter.distance(belief, other, limit),
            _ => f64::INFINITY,
        }
    }

    fn extent(&self, belief: &Self::Belief) -> Option<InverseWishart> {
        match (self, belief) {
            (Left(filter), Left(belief)) => filter.extent(belief),
            (Right(filter), Right(belief)) => filter.extent(belief),
            _ => None,
        }
    }

    fn set_extent(&self, belief: &mut Self::Belief, extent: &InverseWishart) {
        match (self, belief) {
            (Left(filter), Left(belief)) => filter.set_extent(belief, extent),
            (Right(filter), Right(belief)) => filter.set_extent(belief, extent),
            _ => {}
        }
    }

    fn estimate(&self, belief: &Self::Belief) -> Estimate<N> {
        match (self, belief) {
            (Left(filter), Left(belief)) => filter.estimate(belief),
            (Right(filter), Right(belief)) => filter.estimate(belief),
            _ => self.state(belief).into(),
        }
    }

    fn reach(&self, belief: &Self::Belief, search: &Search) -> Option<Region> {
        match (self, belief) {
            (Left(filter), Left(belief)) => filter.reach(belief, search),
            (Right(filter), Right(belief)) => filter.reach(belief, search),
            _ => None,
        }
    }

    fn widen(&self, search: &mut Search, measurement: &A::Measurement) {
        match self {
            Left(filter) => filter.widen(search, measurement),
            Right(filter) => filter.widen(search, measurement),
        }
    }

    fn place(&self, measurement: &A::Measurement) -> Option<Vector2<f64>> {
        match self {
            Left(filter) => filter.place(measurement),
            Right(filter) => filter.place(measurement),
        }
    }

    fn area(&self, measurement: &A::Measurement) -> f64 {
        match self {
            Left(filter) => filter.area(measurement),
            Right(filter) => filter.area(measurement),
        }
    }

    fn ln_clutter(&self, measurement: &A::Measurement, intensity: f64) -> f64 {
        match self {
            Left(filter) => filter.ln_clutter(measurement, intensity),
            Right(filter) => filter.ln_clutter(measurement, intensity),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::{Extended, Imm, Kalman, Transition};
    use crate::motion::Turn;
    use crate::sensor::{Measurement, Position};

    fn seen(step: i32) -> Measurement<2> {
        let (sine, cosine) = (0.1 * f64::from(step)).sin_cos();
        Measurement::from([500.0 * cosine, 500.0 * sine])
    }

    #[test]
    fn a_mixture_of_both_sides_is_the_mixture_of_their_filters() {
        let radar = Position::<2>::new(5.0).unwrap();
        let modes = [0.0, 0.1].map(|rate| Turn::new(rate, 0.2));
        let stay = || Transition::sticky(0.9).per(1.0);
        let plain = Imm::new(modes.map(|turn| Kalman::new(turn, radar)), stay()).unwrap();
        let either = [Left(Kalman::new(modes[0], radar)), Right(Extended::new(modes[1], radar))];
        let either = Imm::new(either, stay()).unwrap();
        let (mut ours, mut theirs) = (either.birth(&seen(0)).unwrap(), plain.birth(&seen(0)).unwrap());
        for step in 1..40 {
            either.predict(&mut ours, 1.0);
            plain.predict(&mut theirs, 1.0);
            let innovation = either.innovation(&ours, &seen(step)).unwrap();
            assert_eq!(either.update(&mut ours, &seen(step)).unwrap(), innovation);
            plain.update(&mut theirs, &seen(step)).unwrap();
        }
        assert!((either.state(&ours).mean - plain.state(&theirs).mean).norm() < 1e-6);
        let (ours, theirs) = (either.mode_probabilities(&ours), plain.mode_probabilities(&theirs));
        assert!((ours[1] - theirs[1]).abs() < 1e-9, "{ours:?} {theirs:?}");
    }

    #[test]
    fn a_belief_of_the_other_side_is_refused() {
        let radar = Position::<2>::new(5.0).unwrap();
        type Both = Either<Kalman<Turn, Position<2>>, Extended<Turn, Position<2>>>;
        let left: Both = Left(Kalman::new(Turn::new(0.0, 0.2), radar));
        let right: Both = Right(Extended::new(Turn::new(0.0, 0.2), radar));
        let mut belief = Filter::<4>::birth(&left, &seen(0)).unwrap();
        assert!(Filter::<4>::update(&right, &mut belief, &seen(1)).is_err());
        assert!(Filter::<4>::reach(&right, &belief, &Search::default()).is_none());
        assert!(!Filter::<4>::state(&right, &belief).mean[0].is_finite());
    }
}
