//! Mnemonic Kalman filter: the prediction is learned, the update is that of Kalman.

mod hyper;
mod network;

use std::sync::Arc;

use nalgebra::{Vector2, Vector4};
use tercel_core::association::{Region, Search};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::filter::{Extended, Filter, Innovation};
use tercel_core::motion::{ConstantVelocity, Motion};
use tercel_core::sensor::{Measurement, Sensor};

use super::memory::{Memory, Room, share};
use super::sight::place;

pub use hyper::MnemonicHyper;
pub use network::MnemonicNetwork;

/// The kind of these models in their cards.
pub(super) const KIND: &str = "mnemonic";

/// Estimates position and velocity in the plane with a prediction that a recurrent network with long memory corrects: its mean
/// by a residual, its covariance by a process noise of its own for every step.
///
/// ## Recursion
/// With the transition `F` of constant velocity, the turn `R` from the frame of the line of sight into that of the state, and the
/// network `g` with memory `m`:
/// ```text
/// predict   d, L, m' = g(x, root of P, last correction; m)
///           x⁻ = F x + R d                       P⁻ = F P Fᵀ + R L Lᵀ Rᵀ
/// update    that of the (extended) Kalman filter
/// ```
/// `L` is lower triangular with a positive diagonal, so every prediction has a covariance. A network that gives zero is the Kalman
/// filter of constant velocity with independent noises of position and velocity; where outputs are not finite it is that too.
///
/// A missing measurement is a prediction: the network steps, and sees that nothing was corrected. Over no time there is no step.
/// Mixing ([`set_state`](Filter::set_state)) moves the state and leaves the memory; merging takes the mean of memories.
///
/// ## Use it when
/// there is a model trained for such objects and about this time step, and the Bayesian form of the update must stay: likelihoods,
/// gates and covariances are those of a Kalman filter with a better motion model. A bank of turns
/// ([`NeuralImm`](super::NeuralImm)) represents what is not decided yet, which one Gaussian cannot.
///
/// ## Reference
/// Jung, Schlangen and Charlish, "A mnemonic Kalman filter for non-linear systems with extensive temporal dependencies", IEEE
/// Signal Processing Letters 27 (2020). The inside of the publication was not at hand: inputs, sizes and the form of the noise
/// follow its description by Mari and Snidaro. [`MnemonicHyper::paper`] sees the last estimate and its covariance alone; the
/// frame and the last correction are ours.
///
/// ```
/// use std::sync::Arc;
/// use tercel_core::{filter::Filter, sensor::Position};
/// use tercel_neural::filter::{MnemonicHyper, MnemonicKalman, MnemonicNetwork};
/// use tercel_neural::{Card, Model, Tensor};
///
/// // A network that gives zero: a Kalman filter. Others come from `Model::open`.
/// let hyper = MnemonicHyper { hidden: 8, ..MnemonicHyper::default() };
/// let mut card = Card::new("zero", "mnemonic", &["x", "y", "vx", "vy"]);
/// card.hyper = hyper.to_table().unwrap();
/// let zeros = |shape: Vec<usize>| Tensor { values: vec![0.0; shape.iter().product()], shape };
/// let tensors = hyper.tensors().into_iter().map(|(name, shape)| (name, zeros(shape))).collect();
/// let network = Arc::new(MnemonicNetwork::from_model(&Model::new(card, tensors)?)?);
///
/// let filter = MnemonicKalman::new(network, Position::new(50.0)?);
/// let mut belief = filter.birth(&[60_000.0, 0.0].into())?;
/// for second in 1..=10 {
///     filter.predict(&mut belief, 1.0);
///     filter.update(&mut belief, &[60_000.0 + 200.0 * second as f64, 0.0].into())?;
/// }
/// assert!((filter.state(&belief).mean[2] - 200.0).abs() < 5.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct MnemonicKalman<S> {
    network: Arc<MnemonicNetwork>,
    sensor: S,
    origin: Vector2<f64>,
}

/// What a [`MnemonicKalman`] knows of one object.
#[derive(Debug, PartialEq)]
pub struct MnemonicBelief {
    state: Gaussian<4>,
    /// What the measurements of the present step changed, and whether there was one.
    correction: Vector4<f64>,
    seen: bool,
    memory: Memory,
    outputs: Vec<f32>,
}

impl MnemonicBelief {
    /// What the network said at the last prediction: four residuals, ten numbers of the noise factor.
    pub fn outputs(&self) -> &[f32] {
        &self.outputs
    }
}

impl Clone for MnemonicBelief {
    fn clone(&self) -> Self {
        MnemonicBelief { memory: self.memory.clone(), outputs: self.outputs.clone(), ..*self }
    }

    fn clone_from(&mut self, source: &Self) {
        (self.state, self.correction, self.seen) = (source.state, source.correction, source.seen);
        self.memory.clone_from(&source.memory);
        self.outputs.clone_from(&source.outputs);
    }
}

impl<S> MnemonicKalman<S> {
    /// A filter of this network and this sensor, which stands at the origin.
    pub fn new(network: Arc<MnemonicNetwork>, sensor: S) -> Self {
        MnemonicKalman { network, sensor, origin: Vector2::zeros() }
    }

    /// Says where the sensor stands, m.
    pub fn seen_from(self, origin: Vector2<f64>) -> Self {
        MnemonicKalman { origin, ..self }
    }

    /// The network.
    pub fn network(&self) -> &Arc<MnemonicNetwork> {
        &self.network
    }

    fn motion(&self) -> ConstantVelocity {
        ConstantVelocity::new(0.0).with_speed(self.network.hyper().speed)
    }

    /// The filter that updates and compares. Its motion is not used.
    fn classical(&self) -> Extended<ConstantVelocity, &S> {
        Extended::new(self.motion(), &self.sensor)
    }
}

impl<S: Sensor<4, 2>> Filter<4> for MnemonicKalman<S> {
    type Belief = MnemonicBelief;
    type Measurement = Measurement<2>;

    fn birth(&self, measurement: &Measurement<2>) -> Result<MnemonicBelief, FilterError> {
        let hyper = self.network.hyper();
        let scratch = hyper.inputs() + self.network.scratch();
        Ok(MnemonicBelief {
            state: self.sensor.birth(measurement, &Motion::<4>::prior(&self.motion()))?,
            correction: Vector4::zeros(),
            seen: true,
            memory: Memory::new(&vec![0.0; self.network.memory()], scratch),
            outputs: vec![0.0; hyper.outputs()],
        })
    }

    fn predict(&self, belief: &mut MnemonicBelief, dt: f64) {
        if dt == 0.0 {
            return;
        }
        let hyper = self.network.hyper();
        let MnemonicBelief { state, correction, seen, memory, outputs } = belief;
        let place = place(state, &self.origin);
        let (next, scratch) = memory.stage();
        let mut room = Room(scratch);
        let inputs = room.take(hyper.inputs());
        hyper.see(state, place, (correction, *seen), inputs);
        self.network.step(inputs, next, room.0, outputs);
        if outputs.iter().all(|value| value.is_finite()) {
            memory.commit();
        } else {
            outputs.fill(0.0);
        }
        *state = hyper.moved(state, place, outputs, dt);
        (*correction, *seen) = (Vector4::zeros(), false);
    }

    fn update(
        &self,
        belief: &mut MnemonicBelief,
        measurement: &Measurement<2>,
    ) -> Result<Innovation, FilterError> {
        let before = belief.state.mean;
        let innovation = self.classical().update(&mut belief.state, measurement)?;
        belief.correction += belief.state.mean - before;
        belief.seen = true;
        Ok(innovation)
    }

    fn innovation(
        &self,
        belief: &MnemonicBelief,
        measurement: &Measurement<2>,
    ) -> Result<Innovation, FilterError> {
        self.classical().innovation(&belief.state, measurement)
    }

    fn state(&self, belief: &MnemonicBelief) -> Gaussian<4> {
        belief.state
    }

    fn set_state(&self, belief: &mut MnemonicBelief, state: &Gaussian<4>) {
        belief.state = *state;
    }

    fn merge(&self, belief: &mut MnemonicBelief, weight: f64, other: &MnemonicBelief, other_weight: f64) {
        belief.state.merge(weight, &other.state, other_weight);
        belief.memory.merge(weight, &other.memory, other_weight);
        let share = share(weight, other_weight);
        belief.correction += (other.correction - belief.correction) * share;
        belief.seen |= other.seen && share > 0.0;
        for (ours, theirs) in belief.outputs.iter_mut().zip(&other.outputs) {
            *ours += (theirs - *ours) * share as f32;
        }
    }

    fn reach(&self, belief: &MnemonicBelief, search: &Search) -> Option<Region> {
        self.classical().reach(&belief.state, search)
    }

    fn widen(&self, search: &mut Search, measurement: &Measurement<2>) {
        search.widen(measurement);
    }

    fn place(&self, measurement: &Measurement<2>) -> Option<Vector2<f64>> {
        self.sensor.place(measurement)
    }

    fn area(&self, measurement: &Measurement<2>) -> f64 {
        self.sensor.area(measurement)
    }
}
