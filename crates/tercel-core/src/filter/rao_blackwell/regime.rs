//! How the parameters of a motion are drawn and jump.

use rand::Rng;

use crate::motion::LinearMotion;

/// What may happen to the motion of an object whose state has `N` components: parameters that are drawn at its birth and jump
/// at random, and the linear motion that they stand for. Together a jump Markov linear system.
///
/// The parameters may be anything: an index of a mode, a turn rate, the level of a noise, or all of these.
///
/// ```
/// use rand::{Rng, RngExt};
/// use tercel_core::filter::Regime;
/// use tercel_core::motion::ConstantVelocity;
///
/// /// Calm for ten minutes on average, agitated for one.
/// struct Moods;
///
/// impl Regime<4> for Moods {
///     type Parameters = bool;
///     type Motion = ConstantVelocity;
///
///     fn draw(&self, random: &mut impl Rng) -> bool {
///         random.random_bool(1.0 / 11.0)
///     }
///     fn jump(&self, agitated: &mut bool, dt: f64, random: &mut impl Rng) {
///         let lasts = if *agitated { 60.0 } else { 600.0 };
///         *agitated ^= random.random_bool(1.0 - (-dt / lasts).exp());
///     }
///     fn motion(&self, agitated: &bool) -> ConstantVelocity {
///         ConstantVelocity::new(if *agitated { 9.0 } else { 0.01 })
///     }
///     fn modes(&self) -> usize {
///         2
///     }
///     fn mode(&self, agitated: &bool) -> usize {
///         usize::from(*agitated)
///     }
/// }
/// ```
pub trait Regime<const N: usize> {
    /// What a particle holds of its motion.
    type Parameters: Clone;
    /// How an object moves while its parameters stay.
    type Motion: LinearMotion<N>;

    /// The parameters of a new object.
    fn draw(&self, random: &mut impl Rng) -> Self::Parameters;

    /// Moves the parameters over the next `dt` seconds; they hold for the whole step. A step of no length is left out.
    fn jump(&self, parameters: &mut Self::Parameters, dt: f64, random: &mut impl Rng);

    /// The motion of an object with these parameters, with what is believed of its state at birth
    /// ([`Motion::prior`](crate::motion::Motion::prior)).
    fn motion(&self, parameters: &Self::Parameters) -> Self::Motion;

    /// Number of modes whose probabilities are reported.
    fn modes(&self) -> usize {
        1
    }

    /// The mode of these parameters, below [`modes`](Regime::modes). Others are counted to no mode.
    fn mode(&self, _parameters: &Self::Parameters) -> usize {
        0
    }
}
