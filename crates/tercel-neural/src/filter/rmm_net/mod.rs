//! RMMNet: a random-matrix filter with a learned memory.

mod belief;
mod features;
mod hyper;
mod kinematics;
mod layers;
mod network;
mod number;
mod published;
mod regression;
mod steps;
mod track;
mod view;

use std::sync::Arc;

use nalgebra::{Matrix2, Vector2};
use tercel_core::association::{Region, Search};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::extended::{
    Evolution, Freedom, GaussianInverseWishart, InverseWishart, Points, RandomMatrix, Rate, Rule, Scattering,
};
use tercel_core::filter::{Estimate, Filter, Innovation};
use tercel_core::motion::ConstantVelocity;

use super::memory::Memory;
use belief::gaussian;
use network::Layers;

pub use belief::RmmNetBelief;
pub use features::{Before, EXTENT_SEEN, heading};
pub use hyper::{Aligned, Form, RmmNetHyper, Sizes};
pub use kinematics::{Kinematics, begin};
pub use network::RmmNetwork;
pub(in crate::filter) use number::within;
pub use number::{Number, Symmetric};
pub use published::{Blocks, Extended, Moments, Published, Transition};
/// Widths of what the form of the publication sees and says.
pub mod widths {
    pub use super::published::{ESTIMATE_SEEN, PREDICTED, PREDICTIONS, SAID, SCAN_SEEN};
}
pub use regression::{Identification, Regression};
pub use track::{Length, Past, Report, Track};
pub use view::View;

/// The kind of these models in their cards.
pub(super) const KIND: &str = "rmmnet";

/// Estimates motion and extent of an object that gives many points a scan, with a motion, a reading of the points and an extent
/// that were learned.
///
/// ## Recursion
/// In the form [`Aligned`], with a memory `c` (LSTM) and heads `f`, `h`, `e` that see neither position nor direction:
/// ```text
/// predict   c from the last estimate;  f(c):   v⁻ = v + Δ_v,   p⁻ = p + T (v⁻ + Δ_p),   P⁻ = J P Jᵀ + Q,   scaling of the axes
/// update    each point in the frame of the object through two layers, then mean and maximum over them;
///           h of these, of count, mean and scatter, and of c:   a centre z = z̄ + Δ_z with covariance L Lᵀ, and the direction
///           in which the object moves: a Kalman update with both;   axes as a random matrix in the frame of the object
/// extent    e: direction between the course of the updated velocity and the scatter, axes, weight
/// ```
/// `Δ_v` has a part along and across the course, weights of past velocities, and a share of what weights expect that are identified
/// while the object is tracked ([`Identification`]). Scale and sensor noise ([`Scattering`]) are inside, as what the network sees and
/// in what it says nothing of. A network that says nothing is a random-matrix filter in straight motion; so is one that overflows. A
/// scan without points changes nothing but the rate, and none is a prediction. Over no time there is no step.
///
/// The form [`Published`] is that of the paper.
///
/// Mixing ([`set_state`](Filter::set_state), [`set_extent`](Filter::set_extent)) leaves the memory; merging takes the mean of
/// memories. The likelihood is that of the random matrix around what was predicted, so that hypotheses compare with those of
/// [`RandomMatrix`].
///
/// ## Use it when
/// there is a model trained for such objects: their motion has a memory, they point where they go, or the points tell more than
/// count, mean and scatter. Where the size is known, compare with [`tercel_core::extended::Aligned`].
///
/// ## Reference
/// RMMNet paper, section III (eqs. 9 to 36). The form [`Aligned`] is ours: the frame, the points, the update of the direction and the
/// extent after the update are not in the paper, whose additive extent cannot follow an object that turns faster than its shape can be
/// averaged.
///
/// ```
/// use std::sync::Arc;
/// use nalgebra::Matrix2;
/// use tercel_core::{extended::{Points, Scattering}, filter::Filter};
/// use tercel_neural::{filter::{RmmNet, RmmNetwork}, shipped};
///
/// // Vehicles, once a second; others come from `Model::open`.
/// let network = Arc::new(RmmNetwork::from_model(&shipped::model("rmmnet-vehicle")?)?);
/// let filter = RmmNet::new(network, Scattering::uniform(Matrix2::new(1.0, 0.0, 0.0, 0.64))?);
/// let car = |x: f64| Points::from_iter([[x - 3.0, 0.9], [x + 4.0, 0.5], [x - 4.0, -0.9], [x + 3.0, -0.5]]);
/// let mut belief = filter.birth(&car(0.0))?;
/// for second in 1..=20 {
///     filter.predict(&mut belief, 1.0);
///     filter.update(&mut belief, &car(4.0 * second as f64))?;
/// }
/// assert!((filter.state(&belief).mean[2] - 4.0).abs() < 1.0);
/// assert!(belief.axes()[0] > 2.0 * belief.axes()[1]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct RmmNet {
    network: Arc<RmmNetwork>,
    scattering: Scattering,
    rate: Option<(Rate, f64)>,
}

/// Points for which a new belief has room.
const ROOM: usize = 64;

impl RmmNet {
    /// A filter of this network, for a sensor whose points spread so.
    pub fn new(network: Arc<RmmNetwork>, scattering: Scattering) -> Self {
        RmmNet { network, scattering, rate: None }
    }

    /// Estimates how many points an object gives, too, from this prior, which is forgotten over `time` seconds: trackers of many
    /// objects can then tell an object that gives few points from one that gives many.
    ///
    /// # Errors
    /// When the time is not positive.
    pub fn with_rate(self, prior: Rate, time: f64) -> Result<Self, FilterError> {
        // The same range as that of the filter that compares.
        self.classical()?.with_rate(prior, time)?;
        Ok(RmmNet { rate: Some((prior, time)), ..self })
    }

    /// The network.
    pub fn network(&self) -> &Arc<RmmNetwork> {
        &self.network
    }

    /// The first semi-axes, how many points they are worth, and the deviation of a first velocity.
    fn beginning(&self) -> ([f64; 2], f64, f64) {
        match &self.network.layers {
            Layers::Aligned(layers) => {
                let options = &layers.options;
                (options.axes, options.worth, options.speed)
            }
            Layers::Published(layers) => {
                let (extent, weight) = layers.options.first_extent();
                ([extent.xx.sqrt(), extent.yy.sqrt()], weight, layers.options.speed)
            }
        }
    }

    /// The filter that compares scans with what is expected. Its motion is not used.
    fn classical(&self) -> Result<RandomMatrix<ConstantVelocity>, FilterError> {
        let (axes, worth, speed) = self.beginning();
        let prior =
            InverseWishart::new(Matrix2::from_diagonal(&Vector2::from(axes.map(|axis| axis * axis))), worth)?;
        let evolution = Evolution::wishart(2.0, Freedom::Exact)?;
        let motion = ConstantVelocity::new(0.0).with_speed(speed);
        let filter = RandomMatrix::new(motion, self.scattering, prior, evolution, Rule::Distorted);
        match self.rate {
            Some((rate, time)) => filter.with_rate(rate, time),
            None => Ok(filter),
        }
    }

    fn compared(&self, belief: &RmmNetBelief, points: &Points) -> Result<Innovation, FilterError> {
        let expected =
            GaussianInverseWishart { state: belief.state, extent: belief.extent()?, rate: belief.rate };
        self.classical()?.innovation(&expected, points)
    }
}

impl Filter<4> for RmmNet {
    type Belief = RmmNetBelief;
    type Measurement = Points;

    fn birth(&self, points: &Points) -> Result<RmmNetBelief, FilterError> {
        // The classical filter refuses what is no beginning.
        let first: GaussianInverseWishart<4> = self.classical()?.birth(points)?;
        let (axes, worth, speed) = self.beginning();
        let (motion, angle) = begin(points, &self.scattering, axes, speed);
        // As published, the extent of a new object lies along the axes of the plane.
        let (angle, order) = match &self.network.layers {
            Layers::Aligned(layers) => (angle, layers.options.identification),
            Layers::Published(_) => (0.0, Identification { order: 0, ..Identification::default() }),
        };
        let memory = vec![0.0; self.network.memory()];
        Ok(RmmNetBelief {
            state: gaussian(&motion),
            axes: axes.map(f64::ln),
            worth,
            angle,
            ln_weight: worth.ln(),
            held: angle,
            rate: first.rate,
            correction: [0.0; 4],
            measured: true,
            regression: Regression::new(&order),
            memory: Memory::new(&memory, self.network.scratch()),
            room: belief::Room(vec![0.0; self.network.room(points.count().max(ROOM))]),
        })
    }

    fn predict(&self, belief: &mut RmmNetBelief, dt: f64) {
        if dt == 0.0 {
            return;
        }
        if let (Some(rate), Some((_, time))) = (&mut belief.rate, self.rate) {
            rate.forget((-dt.abs() / time).exp());
        }
        let length = Length { dt, share: dt / self.network.hyper().interval };
        match &self.network.layers {
            Layers::Aligned(layers) => layers.predict(belief, length),
            Layers::Published(layers) => layers.predict(belief, dt),
        }
    }

    fn update(&self, belief: &mut RmmNetBelief, points: &Points) -> Result<Innovation, FilterError> {
        let innovation = self.compared(belief, points)?;
        let mut rate = belief.rate;
        if let Some(rate) = &mut rate {
            rate.add(points.count());
        }
        if points.is_empty() {
            belief.rate = rate;
            return Ok(innovation);
        }
        match &self.network.layers {
            Layers::Aligned(layers) => layers.update(belief, points, &self.scattering)?,
            Layers::Published(layers) => layers.update(belief, points, &self.scattering)?,
        }
        (belief.rate, belief.measured) = (rate, true);
        Ok(innovation)
    }

    fn innovation(&self, belief: &RmmNetBelief, points: &Points) -> Result<Innovation, FilterError> {
        self.compared(belief, points)
    }

    fn state(&self, belief: &RmmNetBelief) -> Gaussian<4> {
        belief.state
    }

    fn set_state(&self, belief: &mut RmmNetBelief, state: &Gaussian<4>) {
        belief.state = *state;
    }

    fn merge(&self, belief: &mut RmmNetBelief, weight: f64, other: &RmmNetBelief, other_weight: f64) {
        belief.merge(weight, other, other_weight);
    }

    fn extent(&self, belief: &RmmNetBelief) -> Option<InverseWishart> {
        belief.extent().ok()
    }

    fn set_extent(&self, belief: &mut RmmNetBelief, extent: &InverseWishart) {
        belief.set_extent(extent);
    }

    fn estimate(&self, belief: &RmmNetBelief) -> Estimate<4> {
        Estimate { extent: belief.extent().ok().map(|extent| extent.mean()), ..belief.state.into() }
    }

    fn reach(&self, belief: &RmmNetBelief, search: &Search) -> Option<Region> {
        let spread = self.scattering.spread(&belief.extent().ok()?.mean());
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
