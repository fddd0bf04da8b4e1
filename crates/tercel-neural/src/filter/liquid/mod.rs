//! Liquid Kalman filter: the motion is learned by a network of continuous time, the update is that of Kalman.

mod form;
mod hyper;
mod motion;
mod network;

use std::sync::Arc;

use nalgebra::{Vector2, Vector4};
use tercel_core::association::{Region, Search};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::filter::{Extended, Filter, Innovation};
use tercel_core::motion::{ConstantVelocity, Motion};
use tercel_core::sensor::{Measurement, Sensor};

use super::memory::share;

use form::Cut;
pub use form::{Absolute, Form, Moved, Residual, Seen, Span, surprise, widths};
pub use hyper::{Derivative, LiquidHyper};
pub use motion::{LiquidMemory, LiquidMotion};
pub use network::{LiquidNetwork, Predictions};

/// The kind of these models in their cards.
pub(super) const KIND: &str = "liquid";

/// Estimates position and velocity in the plane with a motion that a liquid network has learned, whose memory every object
/// carries.
///
/// ## Recursion
/// With the transition `F` of constant velocity and the network `g` with memory `u`:
/// ```text
/// predict   d, Q, u' = g(v, last correction; u)         (see Residual)
///           x⁻ = Φ(x) = F x + d                         P⁻ = J P Jᵀ + Q,   J = ∂Φ/∂x = F + ∂d/∂x, with u held
/// update    that of the (extended) Kalman filter; the correction is x - x⁻
/// ```
/// The network does not see the position, so it predicts alike everywhere. `J` comes from derivatives that are carried through
/// the solver of the network, or from differences. The first steps after a birth are straight, since there is no velocity yet;
/// so is what the network says nothing finite of. A missing measurement is a prediction after which nothing was corrected. Over
/// no time there is no step. A longer time than that of the training is cut into steps of about that time, up to 300; what is
/// left after these is straight.
///
/// Mixing ([`set_state`](Filter::set_state)) moves the state and leaves the memory; merging takes the mean of memories.
/// [`predict_all`](Filter::predict_all) asks the network once for all objects, and gives the same bits as one by one.
///
/// ## Use it when
/// there is a model trained for such objects, and a mixture of many components must predict better than straight on at the
/// cost of one network call a scan. [`LiquidHyper::cell`] may be gated or without a memory: whether the liquid one is better
/// for an object is a question to the study, not a fact. A bank of turns ([`NeuralImm`](super::NeuralImm)) keeps what is not
/// decided yet, which one Gaussian cannot.
///
/// ## Reference
/// Liu, Guo, Zeng, Yu, Li and Jin, "Hybrid liquid neural network-random finite set filtering for robust maneuvering object
/// tracking": eqs. 8 and 10 to 14. [`LiquidHyper::paper`] is that: it sees the state within limits, remembers nothing from
/// step to step, takes differences and has a fixed noise. Deviations of the default: the residual on straight motion, the memory,
/// the correction among the inputs, the exact Jacobian and the learned noise are ours.
///
/// ```
/// use std::sync::Arc;
/// use tercel_core::{filter::Filter, sensor::Position};
/// use tercel_neural::filter::{LiquidHyper, LiquidKalman, LiquidNetwork};
/// use tercel_neural::{Card, Model, Tensor};
///
/// // A network that gives zero: a Kalman filter. Others come from `Model::open`.
/// let hyper = LiquidHyper::default();
/// let mut card = Card::new("zero", "liquid", &["x", "y", "vx", "vy"]);
/// card.hyper = hyper.to_table().unwrap();
/// let zeros = |shape: Vec<usize>| Tensor { values: vec![0.0; shape.iter().product()], shape };
/// let tensors = hyper.tensors().into_iter().map(|(name, shape)| (name, zeros(shape))).collect();
/// let network = Arc::new(LiquidNetwork::from_model(&Model::new(card, tensors)?)?);
///
/// let filter = LiquidKalman::new(network, Position::new(5.0)?);
/// let mut belief = filter.birth(&[0.0, 0.0].into())?;
/// for second in 1..=20 {
///     filter.predict(&mut belief, 1.0);
///     filter.update(&mut belief, &[12.0 * second as f64, 0.0].into())?;
/// }
/// assert!((filter.state(&belief).mean[2] - 12.0).abs() < 0.1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct LiquidKalman<S, const M: usize = 2> {
    network: Arc<LiquidNetwork>,
    sensor: S,
    speed: f64,
}

/// What a [`LiquidKalman`] knows of one object.
#[derive(Debug)]
pub struct LiquidBelief {
    state: Gaussian<4>,
    /// What the measurements of the present step changed, and whether there was one.
    correction: Vector4<f64>,
    measured: bool,
    surprise: Vector2<f64>,
    /// How wide the belief was after the last prediction or measurement, whatever mixing made of it since.
    widths: [f64; 2],
    /// Predictions since birth.
    age: u32,
    memory: Vec<f32>,
    /// Room for predictions of this object alone. Copies have none until they need it: mixtures make many, and predict them
    /// together.
    room: Vec<f32>,
}

impl LiquidBelief {
    /// What the network remembers of the object.
    pub fn memory(&self) -> &[f32] {
        &self.memory
    }

    fn seen(&self) -> Seen {
        let LiquidBelief { correction, measured, surprise, widths, .. } = *self;
        Seen { mean: self.state.mean, correction, measured, surprise, widths }
    }

    /// Moves the state, and forgets the corrections of the step that ends.
    fn go_on(&mut self, moved: &Moved) {
        self.state = moved.of(&self.state);
        // What cannot be saved is reported by the next update.
        let _ = self.state.settle();
        (self.correction, self.measured) = (Vector4::zeros(), false);
        (self.surprise, self.widths) = (Vector2::zeros(), widths(&self.state));
        self.age = self.age.saturating_add(1);
    }
}

impl PartialEq for LiquidBelief {
    fn eq(&self, other: &Self) -> bool {
        let of = |belief: &Self| (belief.state, belief.seen(), belief.age);
        of(self) == of(other) && self.memory == other.memory
    }
}

impl Clone for LiquidBelief {
    fn clone(&self) -> Self {
        LiquidBelief { memory: self.memory.clone(), room: Vec::new(), ..*self }
    }

    fn clone_from(&mut self, source: &Self) {
        (self.state, self.correction) = (source.state, source.correction);
        (self.measured, self.age) = (source.measured, source.age);
        (self.surprise, self.widths) = (source.surprise, source.widths);
        self.memory.clone_from(&source.memory);
    }
}

impl<S, const M: usize> LiquidKalman<S, M> {
    /// A filter of this network and this sensor.
    pub fn new(network: Arc<LiquidNetwork>, sensor: S) -> Self {
        let speed = network.hyper().speed;
        LiquidKalman { network, sensor, speed }
    }

    /// Sets the standard deviation of a new object's velocity, m/s per axis. That of the training is the default.
    ///
    /// # Errors
    /// Unless it is positive and finite.
    pub fn with_speed(self, speed: f64) -> Result<Self, FilterError> {
        Ok(LiquidKalman { speed: FilterError::positive("speed of a new object", speed)?, ..self })
    }

    /// The network.
    pub fn network(&self) -> &Arc<LiquidNetwork> {
        &self.network
    }

    fn motion(&self) -> ConstantVelocity {
        ConstantVelocity::new(0.0).with_speed(self.speed)
    }

    /// The filter that updates and compares. Its motion is not used.
    fn classical(&self) -> Extended<ConstantVelocity, &S, M> {
        Extended::new(self.motion(), &self.sensor)
    }

    /// Moves beliefs forward, in steps of the time that the network has learned.
    fn advance(&self, beliefs: &mut [&mut LiquidBelief], dt: f64, room: &mut Vec<f32>) {
        let LiquidHyper { interval, form, .. } = self.network.hyper();
        let cut = Cut::new(dt, *interval);
        for _ in 0..cut.steps {
            self.step(beliefs, cut.each, room);
        }
        if cut.rest > 0.0 {
            let span = Span { dt: cut.rest, interval: *interval };
            beliefs.iter_mut().for_each(|belief| belief.go_on(&form.straight(&belief.state.mean, span)));
        }
    }

    /// Moves beliefs forward: the young ones straight, the others by one call of the network.
    fn step(&self, beliefs: &mut [&mut LiquidBelief], dt: f64, room: &mut Vec<f32>) {
        let hyper = self.network.hyper();
        let span = Span { dt, interval: hyper.interval };
        let asked = |belief: &&mut LiquidBelief| belief.age >= hyper.warm_up;
        let count = beliefs.iter().filter(|belief| asked(belief)).count();
        let objects = beliefs.iter().filter(|belief| asked(belief));
        let objects = objects.map(|belief| (belief.seen(), belief.memory.as_slice()));
        let predictions = self.network.predict(count, objects, dt, room);
        let mut number = 0;
        for belief in beliefs {
            let said = if asked(belief) { predictions.get(number, &belief.seen()) } else { None };
            number += usize::from(asked(belief));
            match said {
                Some((moved, memory)) => {
                    belief.memory.copy_from_slice(memory);
                    belief.go_on(&moved);
                }
                None => belief.go_on(&hyper.form.straight(&belief.state.mean, span)),
            }
        }
    }
}

impl<const M: usize, S: Sensor<4, M>> Filter<4> for LiquidKalman<S, M> {
    type Belief = LiquidBelief;
    type Measurement = Measurement<M>;

    fn birth(&self, measurement: &Measurement<M>) -> Result<LiquidBelief, FilterError> {
        let state = self.sensor.birth(measurement, &Motion::<4>::prior(&self.motion()))?;
        Ok(LiquidBelief {
            state,
            correction: Vector4::zeros(),
            measured: true,
            surprise: Vector2::zeros(),
            widths: widths(&state),
            age: 0,
            memory: vec![0.0; self.network.memory()],
            room: Vec::new(),
        })
    }

    fn predict(&self, belief: &mut LiquidBelief, dt: f64) {
        let mut room = std::mem::take(&mut belief.room);
        self.advance(&mut [&mut *belief], dt, &mut room);
        belief.room = room;
    }

    fn update(
        &self,
        belief: &mut LiquidBelief,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError> {
        let before = belief.state;
        let innovation = self.classical().update(&mut belief.state, measurement)?;
        belief.correction += belief.state.mean - before.mean;
        belief.surprise += surprise(&before, &belief.state);
        belief.widths = widths(&belief.state);
        belief.measured = true;
        Ok(innovation)
    }

    fn innovation(
        &self,
        belief: &LiquidBelief,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError> {
        self.classical().innovation(&belief.state, measurement)
    }

    fn state(&self, belief: &LiquidBelief) -> Gaussian<4> {
        belief.state
    }

    fn set_state(&self, belief: &mut LiquidBelief, state: &Gaussian<4>) {
        belief.state = *state;
    }

    fn merge(&self, belief: &mut LiquidBelief, weight: f64, other: &LiquidBelief, other_weight: f64) {
        belief.state.merge(weight, &other.state, other_weight);
        let share = share(weight, other_weight);
        belief.correction += (other.correction - belief.correction) * share;
        belief.surprise += (other.surprise - belief.surprise) * share;
        for (ours, theirs) in belief.widths.iter_mut().zip(other.widths) {
            *ours += (theirs - *ours) * share;
        }
        for (ours, theirs) in belief.memory.iter_mut().zip(&other.memory) {
            *ours += share as f32 * (theirs - *ours);
        }
        if share > 0.0 {
            belief.measured |= other.measured;
            belief.age = belief.age.max(other.age);
        }
    }

    fn reach(&self, belief: &LiquidBelief, search: &Search) -> Option<Region> {
        self.classical().reach(&belief.state, search)
    }

    fn widen(&self, search: &mut Search, measurement: &Measurement<M>) {
        search.widen(measurement);
    }

    fn place(&self, measurement: &Measurement<M>) -> Option<Vector2<f64>> {
        self.sensor.place(measurement)
    }

    fn area(&self, measurement: &Measurement<M>) -> f64 {
        self.sensor.area(measurement)
    }

    fn predict_all(&self, beliefs: &mut [&mut LiquidBelief], dt: f64) {
        self.advance(beliefs, dt, &mut Vec::new());
    }
}
