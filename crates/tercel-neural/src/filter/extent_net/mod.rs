//! ExtentNet: state and extent by a network alone.

mod frame;
mod hyper;
mod network;

use std::sync::Arc;

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use tercel_core::association::{Region, Search};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::extended::{
    Evolution, Freedom, GaussianInverseWishart, InverseWishart, Points, RandomMatrix, Rule, Scattering,
};
use tercel_core::filter::{Estimate, Filter, Innovation};
use tercel_core::motion::{AccelerationNoise, ConstantVelocity, Motion};

use super::memory::share;
use network::Past;

pub use frame::{DOUBTED, Doubt, SEEN, Scan, TOLD, Told};
pub use hyper::{Architecture, ExtentNetHyper, Frame};
pub use network::ExtentNetwork;

/// The kind of these models in their cards.
pub(super) const KIND: &str = "extent-net";

/// Estimates motion and extent of an object that gives many points a scan by a network alone, which remembers what it saw and
/// said: without a model of motion or sensor.
///
/// ## Recursion
/// With the last estimate `p, v, L`, the centroid `z̄` of the scan, its scatter `S` per point, the count `n`, the time `τ` since the
/// last scan, and the network `g` with its memory:
/// ```text
/// predict    p⁻ = p + T v
/// absolute   o = g(p⁻, v, L, z̄, S, ln n, ln τ)                       p = o_p              v = o_v
/// residual   o = g(p⁻ - z̄, v, L, v - d, S, ln n, ln τ)               p = z̄ + o_p          v = d + o_v       d: way of z̄ over τ
/// extent     X̂ = L Lᵀ,   L = [softplus(o₁) 0; o₂ softplus(o₃)]
/// ```
/// all in the units of the card. The memory is one layer of long short-term memory, or a decoder with a token for each scan, whose
/// keys and values are kept for the last scans of a window. A second head on the same row says standard deviations of position and
/// velocity and the weight of the extent; in a training its gradient stays in it, so the estimates are what they are without it.
///
/// A scan without points is not seen: the state moves on straight, and its covariance grows by jumps of the velocity. A network
/// that overflows forgets the object, and the centroid is the estimate. Mixing ([`set_state`](Filter::set_state),
/// [`set_extent`](Filter::set_extent)) changes the last estimate and leaves the memory; merging takes means, and of memories of
/// different ages the heavier. The likelihood is that of a random matrix around what was predicted, so that hypotheses compare with
/// those of [`RandomMatrix`].
///
/// ## Use it when
/// it is to be compared with. In the frame [`Absolute`](Frame::Absolute) it has to learn what a subtraction gives, and is lost
/// where no training object went; in the frame [`Residual`](Frame::Residual) it is a fair opponent.
///
/// ## Reference
/// RMMNet paper, section IV.A: the purely data-driven methods. Inputs, normalisation and the inside of the decoder are not in the
/// paper: root mean square norms, rotary positions and gated feed-forward parts are those of its authors' earlier programs. The last
/// estimate is given at the time of the scan, which the first layer can undo; the window, `τ`, the second head and the residual frame
/// are ours.
///
/// ```
/// use std::sync::Arc;
/// use nalgebra::Matrix2;
/// use tercel_core::{extended::{Points, Scattering}, filter::Filter};
/// use tercel_neural::filter::{ExtentNet, ExtentNetHyper, ExtentNetwork};
/// use tercel_neural::{Card, Model, Tensor};
///
/// // A network that says nothing: the centroid and its way. Others come from `Model::open`.
/// let hyper = ExtentNetHyper::default();
/// let mut card = Card::new("zero", "extent-net", &["x", "y", "vx", "vy"]);
/// card.hyper = hyper.to_table().unwrap();
/// let zeros = |shape: Vec<usize>| Tensor { values: vec![0.0; shape.iter().product()], shape };
/// let tensors = hyper.tensors().into_iter().map(|(name, shape)| (name, zeros(shape))).collect();
/// let network = Arc::new(ExtentNetwork::from_model(&Model::new(card, tensors)?)?);
///
/// let filter = ExtentNet::new(network, Scattering::uniform(Matrix2::identity())?);
/// let car = |x: f64| Points::from_iter([[x - 3.0, 0.9], [x + 3.0, -0.9]]);
/// let mut belief = filter.birth(&car(0.0))?;
/// filter.predict(&mut belief, 1.0);
/// filter.update(&mut belief, &car(4.0))?;
/// assert!((filter.state(&belief).mean[0] - 4.0).abs() < 1e-9);
/// assert!((filter.state(&belief).mean[2] - 4.0).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct ExtentNet {
    network: Arc<ExtentNetwork>,
    scattering: Scattering,
}

/// What an [`ExtentNet`] knows of one object.
#[derive(Debug, Clone, PartialEq)]
pub struct ExtentNetBelief {
    state: Gaussian<4>,
    /// The factor of the extent, m, and the logarithm of the weight of that.
    factor: [f64; 3],
    ln_weight: f64,
    /// The last centroid, m, and the time since then, s.
    centre: [f64; 2],
    elapsed: f64,
    past: Past,
}

/// The lower triangular factor of a positive definite matrix; `None` of any other.
fn factor_of(extent: &Matrix2<f64>) -> Option<[f64; 3]> {
    let first = extent.m11.sqrt();
    let below = 0.5 * (extent.m12 + extent.m21) / first;
    let last = (extent.m22 - below * below).sqrt();
    (first > 0.0 && last > 0.0 && first.is_finite() && last.is_finite()).then_some([first, below, last])
}

impl ExtentNetBelief {
    /// The expected extent.
    fn matrix(&self) -> Matrix2<f64> {
        let [a, b, c] = self.factor;
        Matrix2::new(a * a, a * b, a * b, b * b + c * c)
    }

    fn extent(&self) -> Result<InverseWishart, FilterError> {
        InverseWishart::new(self.matrix(), self.ln_weight.exp())
    }

    /// The last estimate, relative to an origin.
    fn told(&self, origin: [f64; 2]) -> Told<f64> {
        let mean = &self.state.mean;
        let place = [mean.x - origin[0], mean.y - origin[1]];
        Told { place, velocity: [mean.z, mean.w], factor: self.factor }
    }
}

impl ExtentNet {
    /// A filter of this network. How points spread is what it compares scans by; the network is not told.
    pub fn new(network: Arc<ExtentNetwork>, scattering: Scattering) -> Self {
        ExtentNet { network, scattering }
    }

    /// The network.
    pub fn network(&self) -> &Arc<ExtentNetwork> {
        &self.network
    }

    /// The filter that compares scans with what is expected. Its motion is not used.
    fn classical(&self) -> Result<RandomMatrix<ConstantVelocity>, FilterError> {
        let hyper = self.network.hyper();
        let squares = hyper.axes.map(|axis| axis * axis);
        let prior = InverseWishart::new(Matrix2::from_diagonal(&Vector2::from(squares)), hyper.worth)?;
        let evolution = Evolution::wishart(2.0, Freedom::Exact)?;
        let motion = ConstantVelocity::new(0.0).with_speed(hyper.speed);
        Ok(RandomMatrix::new(motion, self.scattering, prior, evolution, Rule::Distorted))
    }

    fn compared(&self, belief: &ExtentNetBelief, points: &Points) -> Result<Innovation, FilterError> {
        let expected = GaussianInverseWishart { state: belief.state, extent: belief.extent()?, rate: None };
        self.classical()?.innovation(&expected, points)
    }

    /// Lets the network see a scan with points.
    fn see(&self, belief: &mut ExtentNetBelief, points: &Points) {
        let hyper = self.network.hyper();
        let origin = match hyper.frame {
            Frame::Absolute => hyper.origin,
            Frame::Residual => belief.centre,
        };
        let prior = belief.told(origin);
        let scan = Scan::new(points, origin, belief.centre, belief.elapsed);
        let said = self.network.step(&hyper.see(&prior, &scan), &mut belief.past);
        let (told, doubt) = match said {
            Some((told, doubt)) => (hyper.told(&prior, &scan, &told), hyper.doubt(&doubt)),
            None => (Told { place: scan.centre, ..prior }, hyper.doubt(&[0.0; DOUBTED])),
        };
        let [x, y] = [0, 1].map(|i| told.place[i] + origin[i]);
        let [place, velocity] = [doubt.ln_place, doubt.ln_velocity].map(|ln| (2.0 * ln).exp());
        belief.state = Gaussian {
            mean: Vector4::new(x, y, told.velocity[0], told.velocity[1]),
            covariance: Matrix4::from_diagonal(&Vector4::new(place, place, velocity, velocity)),
        };
        (belief.factor, belief.ln_weight) = (told.factor, doubt.ln_weight);
        (belief.centre, belief.elapsed) = (points.mean().into(), 0.0);
    }
}

impl Filter<4> for ExtentNet {
    type Belief = ExtentNetBelief;
    type Measurement = Points;

    fn birth(&self, points: &Points) -> Result<ExtentNetBelief, FilterError> {
        let first: GaussianInverseWishart<4> = self.classical()?.birth(points)?;
        let hyper = self.network.hyper();
        Ok(ExtentNetBelief {
            state: first.state,
            factor: [hyper.axes[0], 0.0, hyper.axes[1]],
            ln_weight: hyper.worth.ln(),
            centre: points.mean().into(),
            elapsed: 0.0,
            past: self.network.past(),
        })
    }

    fn predict(&self, belief: &mut ExtentNetBelief, dt: f64) {
        if dt == 0.0 {
            return;
        }
        let hyper = self.network.hyper();
        let jump = hyper.change * (dt.abs() / hyper.interval).sqrt();
        let motion = ConstantVelocity::with_noise(AccelerationNoise::Jump(jump));
        belief.state = Motion::<4>::predict(&motion, &belief.state, dt);
        belief.elapsed += dt;
    }

    fn update(&self, belief: &mut ExtentNetBelief, points: &Points) -> Result<Innovation, FilterError> {
        let innovation = self.compared(belief, points)?;
        if !points.is_empty() {
            self.see(belief, points);
        }
        Ok(innovation)
    }

    fn innovation(&self, belief: &ExtentNetBelief, points: &Points) -> Result<Innovation, FilterError> {
        self.compared(belief, points)
    }

    fn state(&self, belief: &ExtentNetBelief) -> Gaussian<4> {
        belief.state
    }

    fn set_state(&self, belief: &mut ExtentNetBelief, state: &Gaussian<4>) {
        belief.state = *state;
    }

    fn merge(&self, belief: &mut ExtentNetBelief, weight: f64, other: &ExtentNetBelief, other_weight: f64) {
        belief.state.merge(weight, &other.state, other_weight);
        let share = share(weight, other_weight);
        let mix = |ours: &mut f64, theirs: f64| *ours += share * (theirs - *ours);
        let (mut extent, theirs) = (belief.matrix(), other.matrix());
        extent += (theirs - extent) * share;
        belief.factor = factor_of(&extent).unwrap_or(belief.factor);
        mix(&mut belief.ln_weight, other.ln_weight);
        (0..2).for_each(|i| mix(&mut belief.centre[i], other.centre[i]));
        mix(&mut belief.elapsed, other.elapsed);
        belief.past.merge(weight, &other.past, other_weight);
    }

    fn extent(&self, belief: &ExtentNetBelief) -> Option<InverseWishart> {
        belief.extent().ok()
    }

    fn set_extent(&self, belief: &mut ExtentNetBelief, extent: &InverseWishart) {
        if let Some(factor) = factor_of(&extent.mean()).filter(|_| extent.weight() > 0.0) {
            (belief.factor, belief.ln_weight) = (factor, extent.weight().ln());
        }
    }

    fn estimate(&self, belief: &ExtentNetBelief) -> Estimate<4> {
        Estimate { extent: Some(belief.matrix()), ..belief.state.into() }
    }

    fn reach(&self, belief: &ExtentNetBelief, search: &Search) -> Option<Region> {
        let spread = self.scattering.spread(&belief.matrix());
        let covariance = belief.state.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        Some(search.around(belief.state.mean.xy(), &(covariance + spread)))
    }

    fn widen(&self, _: &mut Search, _: &Points) {}

    fn place(&self, points: &Points) -> Option<Vector2<f64>> {
        (!points.is_empty()).then(|| points.mean())
    }

    fn area(&self, _: &Points) -> f64 {
        1.0
    }

    fn ln_clutter(&self, points: &Points, intensity: f64) -> f64 {
        points.count() as f64 * intensity.ln()
    }
}
