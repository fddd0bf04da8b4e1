//! TrMTT: a transformer reads a window of measurements.

mod hyper;
mod network;

use std::sync::Arc;

use nalgebra::{Vector2, Vector4};
use tercel_core::association::{Region, Search};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::filter::{Extended, Filter, Innovation};
use tercel_core::motion::{AccelerationNoise, ConstantVelocity};
use tercel_core::sensor::{Measurement, Sensor};

use super::memory::{Memory, share};
use super::sight::scaled;

pub use hyper::{Frame, TrMttHyper};
pub use network::TransformerNetwork;

/// The kind of these models in their cards.
pub(super) const KIND: &str = "tr-mtt";

/// Estimates position and velocity in the plane from the last measurements alone, which a transformer turns into the states of
/// their steps.
///
/// ## Recursion
/// With the places `z` of the last measurements, their centre `c` and extent `a`, and the network `g`:
/// ```text
/// predict   the window advances by a step without a reading; the estimate moves with its velocity
/// update    the last step gets its reading;   x̂, s = the last row of g((z(t-w+1) - c) / a, .., (z(t) - c) / a)
/// ```
/// An extended Kalman filter for straight motion runs beside it, the carrier: it compares measurements, bounds gates, and lends
/// its covariance, whose deviations the network scales by `e^s`. It is the estimate before there are two readings, and where outputs
/// are not finite.
///
/// A missing measurement is a step that the attention leaves out; the estimate moves on until the next. Of two measurements at
/// one time the mean is seen. Mixing ([`set_state`](Filter::set_state)) moves the carrier and puts it in the place of the estimate
/// until the next measurement; merging takes means. The network does not see times: it knows the steps that it was trained for.
///
/// [`windowed`](TrMtt::windowed) is the publication's way, for whole recordings: overlapping windows, whose states are averaged.
/// An estimate then waits for up to a window of later measurements, and must not be compared with a filter as if it had not.
///
/// ## Use it when
/// it is to be compared with. It has no model of motion or sensor, so nothing that is known of them helps it.
///
/// ## Reference
/// Zhang, Li, Zhang and He, "A deep learning model based on transformer structure for radar tracking of maneuvering targets",
/// Information Fusion 103 (2024), with the windows of Mari and Snidaro. The inside of the publication was not at hand: sizes are
/// ours, as are normalisation before each part of a layer, a decoder that starts from the measurements, masks, and the carrier.
///
/// ```
/// use std::sync::Arc;
/// use tercel_core::{filter::Filter, sensor::RangeBearing};
/// use tercel_neural::filter::{TrMtt, TrMttHyper, TransformerNetwork};
/// use tercel_neural::{Card, Model, Tensor};
///
/// // A network that gives zero: the centre of the window, at rest. Others come from `Model::open`.
/// let hyper = TrMttHyper { window: 4, size: 8, feed: 16, ..TrMttHyper::default() };
/// let mut card = Card::new("zero", "tr-mtt", &["x", "y", "vx", "vy"]);
/// card.hyper = hyper.to_table().unwrap();
/// let zeros = |shape: Vec<usize>| Tensor { values: vec![0.0; shape.iter().product()], shape };
/// let tensors = hyper.tensors().into_iter().map(|(name, shape)| (name, zeros(shape))).collect();
/// let network = Arc::new(TransformerNetwork::from_model(&Model::new(card, tensors)?)?);
///
/// let filter = TrMtt::new(network, RangeBearing::new(50.0, 0.009)?);
/// let mut belief = filter.birth(&[60_000.0, 0.0].into())?;
/// filter.predict(&mut belief, 1.0);
/// filter.update(&mut belief, &[60_200.0, 0.0].into())?;
/// assert!((filter.state(&belief).mean[0] - 60_100.0).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct TrMtt<S> {
    network: Arc<TransformerNetwork>,
    carrier: Extended<ConstantVelocity, S>,
    origin: Vector2<f64>,
}

/// What a [`TrMtt`] knows of one object.
#[derive(Debug, PartialEq)]
pub struct TrMttBelief {
    carrier: Gaussian<4>,
    /// Places of the last measurements, the present step last.
    window: Vec<Option<Vector2<f64>>>,
    /// What the network last said, moved to now, if it has said anything.
    estimate: Option<Vector4<f64>>,
    scales: [f64; 2],
    inputs: Vec<f32>,
    mask: Vec<f32>,
    outputs: Vec<f32>,
    scratch: Memory,
}

impl TrMttBelief {
    /// Places of the last measurements, the present step last; `None` where nothing was measured.
    pub fn window(&self) -> &[Option<Vector2<f64>>] {
        &self.window
    }

    /// What the network answered at the last measurement: a row for each step of the window.
    pub fn outputs(&self) -> &[f32] {
        &self.outputs
    }
}

impl Clone for TrMttBelief {
    fn clone(&self) -> Self {
        TrMttBelief {
            window: self.window.clone(),
            inputs: self.inputs.clone(),
            mask: self.mask.clone(),
            outputs: self.outputs.clone(),
            scratch: self.scratch.clone(),
            ..*self
        }
    }

    fn clone_from(&mut self, source: &Self) {
        (self.carrier, self.estimate, self.scales) = (source.carrier, source.estimate, source.scales);
        self.window.clone_from(&source.window);
        self.inputs.clone_from(&source.inputs);
        self.mask.clone_from(&source.mask);
        self.outputs.clone_from(&source.outputs);
        self.scratch.clone_from(&source.scratch);
    }
}

impl<S> TrMtt<S> {
    /// A filter of this network and this sensor, which stands at the origin.
    pub fn new(network: Arc<TransformerNetwork>, sensor: S) -> Self {
        let hyper = network.hyper();
        let noise = AccelerationNoise::Piecewise(hyper.acceleration);
        let motion = ConstantVelocity::with_noise(noise).with_speed(hyper.speed);
        TrMtt { carrier: Extended::new(motion, sensor), network, origin: Vector2::zeros() }
    }

    /// Says where the sensor stands, m.
    pub fn seen_from(self, origin: Vector2<f64>) -> Self {
        TrMtt { origin, ..self }
    }

    /// The network.
    pub fn network(&self) -> &Arc<TransformerNetwork> {
        &self.network
    }

    /// The states of the steps of a whole recording: each the mean over the windows that cover it, of which one starts every
    /// `stride` steps and the last ends with the recording. Readings are places in the plane; a step is `None` when no window
    /// that covers it has two of them.
    pub fn windowed(&self, readings: &[Option<Vector2<f64>>], stride: usize) -> Vec<Option<Vector4<f64>>> {
        let hyper = self.network.hyper();
        let mut belief = Working::new(&self.network);
        let mut sums = vec![(Vector4::zeros(), 0.0); readings.len()];
        let last = readings.len().saturating_sub(hyper.window);
        for start in (0..last).step_by(stride.max(1)).chain([last]) {
            let covered = &readings[start..readings.len().min(start + hyper.window)];
            // A recording that is shorter than a window fills its end, as the filter does.
            let empty = hyper.window - covered.len();
            belief.window[..empty].fill(None);
            belief.window[empty..].copy_from_slice(covered);
            let Some(frame) = belief.speak(&self.network, &self.origin) else { continue };
            let rows = belief.outputs.chunks_exact(hyper.outputs()).skip(empty);
            for ((sum, count), row) in sums[start..].iter_mut().zip(rows) {
                *sum += hyper.said(&frame, row).0;
                *count += 1.0;
            }
        }
        sums.into_iter().map(|(sum, count)| (count > 0.0).then(|| sum / count)).collect()
    }
}

/// A window outside of a belief.
struct Working {
    window: Vec<Option<Vector2<f64>>>,
    inputs: Vec<f32>,
    mask: Vec<f32>,
    outputs: Vec<f32>,
    scratch: Vec<f32>,
}

impl Working {
    fn new(network: &TransformerNetwork) -> Self {
        let hyper = network.hyper();
        Working {
            window: vec![None; hyper.window],
            inputs: vec![0.0; hyper.window * hyper.inputs()],
            mask: vec![0.0; hyper.window],
            outputs: vec![0.0; hyper.window * hyper.outputs()],
            scratch: vec![0.0; network.scratch()],
        }
    }

    /// Asks the network about the window. Gives its frame, unless there are too few readings or an output is not finite.
    fn speak(&mut self, network: &TransformerNetwork, origin: &Vector2<f64>) -> Option<Frame> {
        let Working { window, inputs, mask, outputs, scratch } = self;
        asked(network, origin, window, Rows { inputs, mask, outputs }, scratch)
    }
}

/// What goes into the network and comes out of it.
struct Rows<'a> {
    inputs: &'a mut [f32],
    mask: &'a mut [f32],
    outputs: &'a mut [f32],
}

/// Asks a network about a window of readings. Gives the frame of its answer, if there is one.
fn asked(
    network: &TransformerNetwork,
    origin: &Vector2<f64>,
    window: &[Option<Vector2<f64>>],
    Rows { inputs, mask, outputs }: Rows<'_>,
    scratch: &mut [f32],
) -> Option<Frame> {
    let frame = network.hyper().frame(window, origin)?;
    network.hyper().see(window, &frame, inputs, mask);
    network.forward(inputs, mask, outputs, scratch);
    outputs.iter().all(|value| value.is_finite()).then_some(frame)
}

impl<S: Sensor<4, 2>> TrMtt<S> {
    /// Where an object in this state that gave this measurement is now: the window holds places at the times of the scans.
    fn present_place(&self, measurement: &Measurement<2>, state: &Gaussian<4>) -> Option<Vector2<f64>> {
        let velocity = state.mean.fixed_rows::<2>(2).into_owned();
        Some(self.place(measurement)? + velocity * measurement.age)
    }
}

impl<S: Sensor<4, 2>> Filter<4> for TrMtt<S> {
    type Belief = TrMttBelief;
    type Measurement = Measurement<2>;

    fn birth(&self, measurement: &Measurement<2>) -> Result<TrMttBelief, FilterError> {
        let carrier = self.carrier.birth(measurement)?;
        let Working { mut window, inputs, mask, outputs, scratch } = Working::new(&self.network);
        if let Some(last) = window.last_mut() {
            *last = self.present_place(measurement, &carrier);
        }
        let scratch = Memory::new(&[], scratch.len());
        Ok(TrMttBelief { carrier, window, estimate: None, scales: [0.0; 2], inputs, mask, outputs, scratch })
    }

    fn predict(&self, belief: &mut TrMttBelief, dt: f64) {
        if dt == 0.0 {
            return;
        }
        self.carrier.predict(&mut belief.carrier, dt);
        if let Some(estimate) = &mut belief.estimate {
            estimate[0] += estimate[2] * dt;
            estimate[1] += estimate[3] * dt;
        }
        belief.window.rotate_left(1);
        if let Some(last) = belief.window.last_mut() {
            *last = None;
        }
    }

    fn update(
        &self,
        belief: &mut TrMttBelief,
        measurement: &Measurement<2>,
    ) -> Result<Innovation, FilterError> {
        let innovation = self.carrier.update(&mut belief.carrier, measurement)?;
        let place = self.present_place(measurement, &belief.carrier);
        let Some(place) = place else { return Ok(innovation) };
        if let Some(last) = belief.window.last_mut() {
            *last = Some(last.map_or(place, |before| (before + place) / 2.0));
        }
        let TrMttBelief { window, inputs, mask, outputs, scratch, .. } = belief;
        let rows = Rows { inputs, mask, outputs };
        let frame = asked(&self.network, &self.origin, window, rows, scratch.stage().1);
        let hyper = self.network.hyper();
        let last = (hyper.window - 1) * hyper.outputs();
        let said = frame.map(|frame| hyper.said(&frame, &belief.outputs[last..]));
        (belief.estimate, belief.scales) = (said.map(|said| said.0), said.map_or([0.0; 2], |said| said.1));
        Ok(innovation)
    }

    fn innovation(
        &self,
        belief: &TrMttBelief,
        measurement: &Measurement<2>,
    ) -> Result<Innovation, FilterError> {
        self.carrier.innovation(&belief.carrier, measurement)
    }

    fn state(&self, belief: &TrMttBelief) -> Gaussian<4> {
        Gaussian {
            mean: belief.estimate.unwrap_or(belief.carrier.mean),
            covariance: scaled(&belief.carrier.covariance, belief.scales),
        }
    }

    fn set_state(&self, belief: &mut TrMttBelief, state: &Gaussian<4>) {
        belief.carrier = *state;
        (belief.estimate, belief.scales) = (None, [0.0; 2]);
    }

    fn merge(&self, belief: &mut TrMttBelief, weight: f64, other: &TrMttBelief, other_weight: f64) {
        let share = share(weight, other_weight);
        let (ours, theirs) = (self.state(belief).mean, self.state(other).mean);
        if belief.estimate.is_some() || (other.estimate.is_some() && share > 0.0) {
            belief.estimate = Some(ours + (theirs - ours) * share);
        }
        belief.carrier.merge(weight, &other.carrier, other_weight);
        for (ours, theirs) in belief.window.iter_mut().zip(&other.window) {
            *ours = match (*ours, *theirs) {
                (Some(ours), Some(theirs)) => Some(ours + (theirs - ours) * share),
                (ours, theirs) => ours.or(theirs.filter(|_| share > 0.0)),
            };
        }
        for (ours, theirs) in belief.scales.iter_mut().zip(&other.scales) {
            *ours += (theirs - *ours) * share;
        }
    }

    fn reach(&self, belief: &TrMttBelief, search: &Search) -> Option<Region> {
        self.carrier.reach(&belief.carrier, search)
    }

    fn widen(&self, search: &mut Search, measurement: &Measurement<2>) {
        search.widen(measurement);
    }

    fn place(&self, measurement: &Measurement<2>) -> Option<Vector2<f64>> {
        Filter::<4>::place(&self.carrier, measurement)
    }

    fn area(&self, measurement: &Measurement<2>) -> f64 {
        Filter::<4>::area(&self.carrier, measurement)
    }
}
