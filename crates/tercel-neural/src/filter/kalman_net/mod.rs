//! KalmanNet: a Kalman filter whose gain is learned.

mod branched;
mod features;
mod hyper;
mod network;
mod stacked;

use std::sync::Arc;

use nalgebra::{Matrix4, Matrix4x2, Vector2};
use tercel_core::association::{Region, Search};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::filter::{Extended, Filter, Innovation};
use tercel_core::motion::Motion;
use tercel_core::sensor::{Aged, LinearSensor, Measurement, Sensor};

use super::memory::{Memory, Room};
use super::present;
use features::{History, View};

pub use hyper::{Architecture, Covariance, Feature, KalmanNetHyper};
pub use network::GainNetwork;

/// The kind of these models in their cards.
pub(super) const KIND: &str = "kalman-net";

/// The state for which they are made.
pub(super) const LABELS: [&str; 4] = ["x", "y", "vx", "vy"];

/// Estimates position and velocity in the plane with the prediction of a motion model and a gain that a recurrent network
/// gives, from what was observed and estimated last.
///
/// ## Recursion
/// With motion `f`, sensor `h` and the network `g` with memory `m`:
/// ```text
/// predict   x⁻ = f(x)                                   P⁻ = F P Fᵀ + Q
/// update    K, m' = g(F1, .., F4; m)                    x = x⁻ + K (y - h(x⁻))
///           F1 = y(t) - y(t-1)                          F2 = y(t) - h(x⁻)
///           F3 = x(t-1) - x(t-2)                        F4 = x(t-1) - x⁻(t-1)
/// ```
/// [`KalmanNetHyper`] says which features there are and in which form, which network, and how the covariance goes on: with the
/// Kalman gain, or in Joseph's form with the learned one. Neither enters the estimate; they serve gates, likelihoods and
/// mixtures.
///
/// A missing measurement is a prediction: the network does not step, the next F1 compares with `h(x⁻)`, and the next F4 is
/// zero. A prediction over no time is no step. When two sensors measure at one time, the network steps twice with the same
/// F1, F3 and F4 of the time before. Mixing ([`set_state`](Filter::set_state)) moves the state and leaves differences and
/// memory; merging takes the mean of them all.
///
/// ## Use it when
/// there is a model trained for these objects, this sensor and about this time step: the network knows no other, and does not
/// see the step. Without one, or where noises are known, an interacting multiple model filter is the better choice. The
/// covariance does not know what the network does; `joseph` is the more honest of the two, `riccati` the one of the papers.
///
/// ## Reference
/// Revach et al. (2022), architectures #1 and #2. Deviations: magnitudes, sensor frame, gain offset and Joseph's form are
/// ours; options of the model switch them. Readings must be positions ([`LinearSensor`]); polar radars go through
/// [`ConvertedPolar`](tercel_core::sensor::ConvertedPolar).
///
/// Validated against an implementation in double precision in the tests: 1e-5 relative over 60 steps.
///
/// ```
/// use std::collections::BTreeMap;
/// use std::sync::Arc;
/// use tercel_core::{filter::Filter, motion::ConstantVelocity, sensor::Position};
/// use tercel_neural::filter::{Architecture, GainNetwork, KalmanNet, KalmanNetHyper};
/// use tercel_neural::{Card, Model, Tensor};
///
/// // A network that gives zero, beside an offset: an alpha-beta filter. Others come from `Model::open`.
/// let mut hyper = KalmanNetHyper::paper(Architecture::two());
/// hyper.gain_offset = Some([[0.5, 0.0], [0.0, 0.5], [0.1, 0.0], [0.0, 0.1]]);
/// let mut card = Card::new("zero", "kalman-net", &["x", "y", "vx", "vy"]);
/// card.hyper = hyper.to_table().unwrap();
/// let zeros = |shape: Vec<usize>| Tensor { values: vec![0.0; shape.iter().product()], shape };
/// let tensors = hyper.tensors().into_iter().map(|(name, shape)| (name, zeros(shape))).collect();
/// let network = Arc::new(GainNetwork::from_model(&Model::new(card, tensors)?)?);
///
/// let filter = KalmanNet::new(network, ConstantVelocity::new(0.5), Position::new(5.0)?);
/// let mut belief = filter.birth(&[0.0, 0.0].into())?;
/// filter.predict(&mut belief, 1.0);
/// filter.update(&mut belief, &[10.0, -4.0].into())?;
/// assert_eq!(filter.state(&belief).mean.as_slice()[..2], [5.0, -2.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct KalmanNet<T, S> {
    network: Arc<GainNetwork>,
    motion: T,
    sensor: S,
    origin: Vector2<f64>,
}

/// What a [`KalmanNet`] knows of one object.
#[derive(Debug, PartialEq)]
pub struct KalmanNetBelief {
    state: Gaussian<4>,
    history: History,
    memory: Memory,
}

impl KalmanNetBelief {
    /// What the network remembers.
    pub fn memory(&self) -> &[f32] {
        self.memory.held()
    }
}

impl Clone for KalmanNetBelief {
    fn clone(&self) -> Self {
        KalmanNetBelief { state: self.state, history: self.history, memory: self.memory.clone() }
    }

    fn clone_from(&mut self, source: &Self) {
        self.state = source.state;
        self.history = source.history;
        self.memory.clone_from(&source.memory);
    }
}

impl<T, S> KalmanNet<T, S> {
    /// A filter of this network, this motion and this sensor, which stands at the origin.
    pub fn new(network: Arc<GainNetwork>, motion: T, sensor: S) -> Self {
        KalmanNet { network, motion, sensor, origin: Vector2::zeros() }
    }

    /// Says where the sensor stands, m. Networks with magnitudes or in the frame of the sensor see from there.
    pub fn seen_from(self, origin: Vector2<f64>) -> Self {
        KalmanNet { origin, ..self }
    }

    /// The network.
    pub fn network(&self) -> &Arc<GainNetwork> {
        &self.network
    }
}

impl<T: Motion<4>, S: LinearSensor<4, 2>> KalmanNet<T, S> {
    /// The filter of the same models with the gain of Kalman, which carries the covariance.
    fn classical(&self) -> Extended<&T, &S> {
        Extended::new(&self.motion, &self.sensor)
    }

    /// The learned gain for this innovation. Stages the memory after the step.
    fn gain(
        &self,
        belief: &mut KalmanNetBelief,
        reading: &Vector2<f64>,
        innovation: &Vector2<f64>,
    ) -> Matrix4x2<f64> {
        let hyper = self.network.hyper();
        let mean = &belief.state.mean;
        let view = View::new(Vector2::new(mean[0], mean[1]) - self.origin, hyper.sensor_frame);
        let (memory, scratch) = belief.memory.stage();
        let mut room = Room(scratch);
        let inputs = room.take(hyper.inputs());
        belief.history.inputs(&self.network, reading, innovation, &view, inputs);
        let mut gain = [0.0; GainNetwork::GAIN];
        self.network.step(inputs, memory, room.0, &mut gain);
        let offset = hyper.gain_offset.unwrap_or_default();
        let both = |i: usize, j: usize| f64::from(gain[2 * i + j]) + f64::from(offset[i][j]);
        view.gain(Matrix4x2::from_fn(both))
    }

    /// The covariance after an update with any gain.
    fn joseph(
        &self,
        state: &Gaussian<4>,
        gain: &Matrix4x2<f64>,
        measurement: &Measurement<2>,
    ) -> Result<Matrix4<f64>, FilterError> {
        let sensor = Aged::new(&self.sensor, measurement.age);
        let rest = Matrix4::identity() - gain * sensor.jacobian(&state.mean);
        let noise = sensor.read(measurement, Some(&sensor.expected(&state.mean)))?.noise;
        Ok(rest * state.covariance * rest.transpose() + gain * noise * gain.transpose())
    }
}

impl<T: Motion<4>, S: LinearSensor<4, 2>> Filter<4> for KalmanNet<T, S> {
    type Belief = KalmanNetBelief;
    type Measurement = Measurement<2>;

    fn birth(&self, measurement: &Measurement<2>) -> Result<KalmanNetBelief, FilterError> {
        let state = self.sensor.birth(measurement, &self.motion.prior())?;
        let history = History::new(present(&self.sensor, measurement, &state.mean)?);
        let scratch = self.network.hyper().inputs() + self.network.scratch(1);
        Ok(KalmanNetBelief { state, history, memory: Memory::new(&self.network.initial(), scratch) })
    }

    fn predict(&self, belief: &mut KalmanNetBelief, dt: f64) {
        if dt == 0.0 {
            return;
        }
        let before = belief.state.mean;
        self.classical().predict(&mut belief.state, dt);
        belief.history.predicted(belief.state.mean - before, self.sensor.expected(&before));
    }

    fn update(
        &self,
        belief: &mut KalmanNetBelief,
        measurement: &Measurement<2>,
    ) -> Result<Innovation, FilterError> {
        let mut next = belief.state;
        // Also refuses what is not finite before the network sees it.
        let innovation = self.classical().update(&mut next, measurement)?;
        let reading = present(&self.sensor, measurement, &belief.state.mean)?;
        let difference = self.sensor.difference(&reading, &self.sensor.expected(&belief.state.mean));
        let gain = self.gain(belief, &reading, &difference);
        let correction = gain * difference;
        next.mean = belief.state.mean + correction;
        if self.network.hyper().covariance == Covariance::Joseph {
            next.covariance = self.joseph(&belief.state, &gain, measurement)?;
        }
        next.settle()?;
        belief.state = next;
        belief.history.updated(reading, correction);
        belief.memory.commit();
        Ok(innovation)
    }

    fn innovation(
        &self,
        belief: &KalmanNetBelief,
        measurement: &Measurement<2>,
    ) -> Result<Innovation, FilterError> {
        self.classical().innovation(&belief.state, measurement)
    }

    fn state(&self, belief: &KalmanNetBelief) -> Gaussian<4> {
        belief.state
    }

    fn set_state(&self, belief: &mut KalmanNetBelief, state: &Gaussian<4>) {
        belief.state = *state;
    }

    fn merge(&self, belief: &mut KalmanNetBelief, weight: f64, other: &KalmanNetBelief, other_weight: f64) {
        belief.state.merge(weight, &other.state, other_weight);
        belief.history.merge(weight, &other.history, other_weight);
        belief.memory.merge(weight, &other.memory, other_weight);
    }

    fn reach(&self, belief: &KalmanNetBelief, search: &Search) -> Option<Region> {
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
