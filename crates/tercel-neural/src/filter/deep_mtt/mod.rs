//! DeepMTT: a network finds the residuals of an unscented filter.

mod hyper;
mod network;

use std::sync::Arc;

use nalgebra::{Vector2, Vector4};
use tercel_core::association::{Region, Search};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::filter::{Filter, Innovation, Unscented};
use tercel_core::motion::{AccelerationNoise, ConstantVelocity};
use tercel_core::sensor::{Measurement, Sensor};

use super::memory::{Memory, share};
use super::sight::scaled;

pub use hyper::DeepMttHyper;
pub use network::ResidualNetwork;

/// The kind of these models in their cards.
pub(super) const KIND: &str = "deep-mtt";

/// Estimates position and velocity in the plane with an unscented filter for straight motion, whose estimates a bidirectional
/// network corrects from a window of the last ones.
///
/// ## Recursion
/// With the estimates `x` and covariances `P` of the front end, and the network `g`:
/// ```text
/// predict   x, P by constant velocity; the window advances; d moves with its velocity
/// update    x, P by the unscented filter; they replace the last of the window
///           d, s = the last of g(x(t-w+1) - x(t), .., x(t) - x(t))
/// estimate  x + d,   D P D,   D = diag(e^s₁, e^s₁, e^s₂, e^s₂)
/// ```
/// The corrections do not flow back into the front end. Before the window is full, and where outputs are not finite, the front
/// end's estimate stands. Gates and likelihoods are those of the front end.
///
/// A missing measurement is a prediction: the network does not step, and sees the predicted estimate in the next window. Mixing
/// ([`set_state`](Filter::set_state)) moves the front end and forgets the correction; merging takes the means of corrections and
/// of windows. [`smoothed`](DeepMtt::smoothed) averages over the windows that cover an instant, for whole recordings.
///
/// ## Use it when
/// it is to be compared with. A straight-line front end far from the truth is corrected by what its own lag looks like; a bank of
/// turns has no such lag.
///
/// ## Reference
/// Liu, Wang and Xu, "DeepMTT: a deep learning maneuvering target-tracking algorithm based on bidirectional LSTM network",
/// Information Fusion 53 (2020), with the windows of Mari and Snidaro: five estimates, one step apart, the residual at the last
/// one. Deviations: plain LSTM layers without the smoothing filter before them and without maxout after them; weights of the last
/// layers are shared by all steps; the front end is not restarted; frame, context, whitening and scales are ours and options.
///
/// ```
/// use std::sync::Arc;
/// use tercel_core::{filter::Filter, sensor::RangeBearing};
/// use tercel_neural::filter::{DeepMtt, DeepMttHyper, ResidualNetwork};
/// use tercel_neural::{Card, Model, Tensor};
///
/// // A network that gives zero: the unscented filter. Others come from `Model::open`.
/// let hyper = DeepMttHyper { layers: vec![8], ..DeepMttHyper::default() };
/// let mut card = Card::new("zero", "deep-mtt", &["x", "y", "vx", "vy"]);
/// card.hyper = hyper.to_table().unwrap();
/// let zeros = |shape: Vec<usize>| Tensor { values: vec![0.0; shape.iter().product()], shape };
/// let tensors = hyper.tensors().into_iter().map(|(name, shape)| (name, zeros(shape))).collect();
/// let network = Arc::new(ResidualNetwork::from_model(&Model::new(card, tensors)?)?);
///
/// let filter = DeepMtt::new(network, RangeBearing::new(50.0, 0.009)?);
/// let mut belief = filter.birth(&[60_000.0, 0.3].into())?;
/// filter.predict(&mut belief, 1.0);
/// filter.update(&mut belief, &[60_100.0, 0.3].into())?;
/// assert_eq!(filter.state(&belief), *belief.front());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct DeepMtt<S> {
    network: Arc<ResidualNetwork>,
    front: Unscented<ConstantVelocity, S>,
    origin: Vector2<f64>,
}

/// What a [`DeepMtt`] knows of one object.
#[derive(Debug, PartialEq)]
pub struct DeepMttBelief {
    front: Gaussian<4>,
    /// The last estimates of the front end, the present one last; `count` of them are of this object.
    window: Vec<Gaussian<4>>,
    count: usize,
    correction: Vector4<f64>,
    scales: [f64; 2],
    inputs: Vec<f32>,
    outputs: Vec<f32>,
    scratch: Memory,
}

impl DeepMttBelief {
    /// What the front end says.
    pub fn front(&self) -> &Gaussian<4> {
        &self.front
    }

    /// The estimates of the front end that the network sees, the present one last, once there are enough.
    pub fn window(&self) -> Option<&[Gaussian<4>]> {
        (self.count == self.window.len()).then_some(self.window.as_slice())
    }

    /// What the network saw at the last measurement: a row for each estimate of the window.
    pub fn inputs(&self) -> &[f32] {
        &self.inputs
    }

    /// What the network answered: a row for each estimate of the window.
    pub fn outputs(&self) -> &[f32] {
        &self.outputs
    }

    fn forget(&mut self) {
        (self.correction, self.scales) = (Vector4::zeros(), [0.0; 2]);
    }
}

impl Clone for DeepMttBelief {
    fn clone(&self) -> Self {
        DeepMttBelief {
            window: self.window.clone(),
            inputs: self.inputs.clone(),
            outputs: self.outputs.clone(),
            scratch: self.scratch.clone(),
            ..*self
        }
    }

    fn clone_from(&mut self, source: &Self) {
        (self.front, self.count) = (source.front, source.count);
        (self.correction, self.scales) = (source.correction, source.scales);
        self.window.clone_from(&source.window);
        self.inputs.clone_from(&source.inputs);
        self.outputs.clone_from(&source.outputs);
        self.scratch.clone_from(&source.scratch);
    }
}

impl<S> DeepMtt<S> {
    /// A filter of this network and this sensor, which stands at the origin.
    pub fn new(network: Arc<ResidualNetwork>, sensor: S) -> Self {
        let hyper = network.hyper();
        let noise = AccelerationNoise::Piecewise(hyper.acceleration);
        let motion = ConstantVelocity::with_noise(noise).with_speed(hyper.speed);
        DeepMtt { front: Unscented::new(motion, sensor), network, origin: Vector2::zeros() }
    }

    /// Says where the sensor stands, m.
    pub fn seen_from(self, origin: Vector2<f64>) -> Self {
        DeepMtt { origin, ..self }
    }

    /// The network.
    pub fn network(&self) -> &Arc<ResidualNetwork> {
        &self.network
    }

    /// Asks the network about the window.
    fn speak(&self, belief: &mut DeepMttBelief) {
        belief.forget();
        if belief.count < belief.window.len() {
            return;
        }
        let hyper = self.network.hyper();
        let DeepMttBelief { window, inputs, outputs, scratch, .. } = belief;
        hyper.see(window, &self.origin, inputs);
        self.network.forward(inputs, outputs, scratch.stage().1);
        if !outputs.iter().all(|value| value.is_finite()) {
            outputs.fill(0.0);
            return;
        }
        let sight = hyper.sight(&belief.front, &self.origin);
        let row = &belief.outputs[(hyper.window - 1) * hyper.outputs()..];
        (belief.correction, belief.scales) = hyper.said(&belief.front, &sight, row);
    }
}

impl<S: Sensor<4, 2>> DeepMtt<S> {
    /// The estimates of a whole recording, each the mean over the windows that end at most `delay` steps after it: more accurate
    /// than the filter, and later by that much. A scan is the time since the one before it and what was measured, if anything.
    ///
    /// With a delay of 0 these are the estimates of the filter; windows reach no further back than their length.
    ///
    /// # Errors
    /// When the first scan has no measurement, or a step of the front end fails.
    pub fn smoothed(
        &self,
        scans: &[(f64, Option<Measurement<2>>)],
        delay: usize,
    ) -> Result<Vec<Gaussian<4>>, FilterError> {
        let nothing = FilterError::Parameter {
            parameter: "number of measurements in the first scan",
            value: 0.0,
            expected: "must be 1, from which the filter starts",
        };
        let Some((_, Some(first))) = scans.first() else { return Err(nothing) };
        let mut belief = self.birth(first)?;
        let mut estimates = vec![self.state(&belief)];
        let mut fronts = vec![belief.front.mean];
        let mut sums = vec![(Vector4::zeros(), 0.0); scans.len()];
        for (step, (dt, measurement)) in scans.iter().enumerate().skip(1) {
            self.predict(&mut belief, *dt);
            if let Some(measurement) = measurement {
                self.update(&mut belief, measurement)?;
                if belief.window().is_some() {
                    self.spread(&belief, &mut sums[..=step], delay);
                }
            }
            estimates.push(self.state(&belief));
            fronts.push(belief.front.mean);
        }
        for ((estimate, front), (sum, count)) in estimates.iter_mut().zip(fronts).zip(sums) {
            if count > 0.0 {
                estimate.mean = front + sum / count;
            }
        }
        Ok(estimates)
    }

    /// Adds the residuals of a window to the sums of its steps, the last of which is the last of `sums`.
    fn spread(&self, belief: &DeepMttBelief, sums: &mut [(Vector4<f64>, f64)], delay: usize) {
        let hyper = self.network.hyper();
        let sight = hyper.sight(&belief.front, &self.origin);
        let rows = belief.outputs.chunks_exact(hyper.outputs()).zip(&belief.window).rev();
        for ((row, state), (sum, count)) in rows.zip(sums.iter_mut().rev()).take(delay.saturating_add(1)) {
            *sum += hyper.said(state, &sight, row).0;
            *count += 1.0;
        }
    }
}

impl<S: Sensor<4, 2>> Filter<4> for DeepMtt<S> {
    type Belief = DeepMttBelief;
    type Measurement = Measurement<2>;

    fn birth(&self, measurement: &Measurement<2>) -> Result<DeepMttBelief, FilterError> {
        let hyper = self.network.hyper();
        let front = self.front.birth(measurement)?;
        Ok(DeepMttBelief {
            front,
            window: vec![front; hyper.window],
            count: 1,
            correction: Vector4::zeros(),
            scales: [0.0; 2],
            inputs: vec![0.0; hyper.window * hyper.inputs()],
            outputs: vec![0.0; hyper.window * hyper.outputs()],
            scratch: Memory::new(&[], self.network.scratch()),
        })
    }

    fn predict(&self, belief: &mut DeepMttBelief, dt: f64) {
        if dt == 0.0 {
            return;
        }
        self.front.predict(&mut belief.front, dt);
        let velocity = belief.correction.fixed_rows::<2>(2).into_owned();
        let mut position = belief.correction.fixed_rows_mut::<2>(0);
        position += velocity * dt;
        belief.window.rotate_left(1);
        belief.count = (belief.count + 1).min(belief.window.len());
        if let Some(last) = belief.window.last_mut() {
            *last = belief.front;
        }
    }

    fn update(
        &self,
        belief: &mut DeepMttBelief,
        measurement: &Measurement<2>,
    ) -> Result<Innovation, FilterError> {
        let innovation = self.front.update(&mut belief.front, measurement)?;
        if let Some(last) = belief.window.last_mut() {
            *last = belief.front;
        }
        self.speak(belief);
        Ok(innovation)
    }

    fn innovation(
        &self,
        belief: &DeepMttBelief,
        measurement: &Measurement<2>,
    ) -> Result<Innovation, FilterError> {
        self.front.innovation(&belief.front, measurement)
    }

    fn state(&self, belief: &DeepMttBelief) -> Gaussian<4> {
        Gaussian {
            mean: belief.front.mean + belief.correction,
            covariance: scaled(&belief.front.covariance, belief.scales),
        }
    }

    fn set_state(&self, belief: &mut DeepMttBelief, state: &Gaussian<4>) {
        belief.front = *state;
        if let Some(last) = belief.window.last_mut() {
            *last = *state;
        }
        belief.forget();
    }

    fn merge(&self, belief: &mut DeepMttBelief, weight: f64, other: &DeepMttBelief, other_weight: f64) {
        let share = share(weight, other_weight);
        belief.front.merge(weight, &other.front, other_weight);
        for (ours, theirs) in belief.window.iter_mut().zip(&other.window) {
            ours.merge(weight, theirs, other_weight);
        }
        if share > 0.0 {
            belief.count = belief.count.min(other.count);
        }
        belief.correction += (other.correction - belief.correction) * share;
        for (ours, theirs) in belief.scales.iter_mut().zip(&other.scales) {
            *ours += (theirs - *ours) * share;
        }
    }

    fn reach(&self, belief: &DeepMttBelief, search: &Search) -> Option<Region> {
        self.front.reach(&belief.front, search)
    }

    fn widen(&self, search: &mut Search, measurement: &Measurement<2>) {
        search.widen(measurement);
    }

    fn place(&self, measurement: &Measurement<2>) -> Option<Vector2<f64>> {
        Filter::<4>::place(&self.front, measurement)
    }

    fn area(&self, measurement: &Measurement<2>) -> f64 {
        Filter::<4>::area(&self.front, measurement)
    }
}
