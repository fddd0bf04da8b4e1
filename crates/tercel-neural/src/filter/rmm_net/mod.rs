//! RMMNet: a random-matrix filter with a learned memory.

mod belief;
mod features;
mod hyper;
mod kinematics;
mod network;
mod number;
mod regression;
mod track;
mod view;

use std::sync::Arc;

use nalgebra::{Matrix2, Vector2};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::extended::{
    Evolution, Freedom, GaussianInverseWishart, InverseWishart, Points, RandomMatrix, Rule, Scattering,
};
use tercel_core::filter::{Estimate, Filter, Innovation};
use tercel_core::motion::ConstantVelocity;

use super::memory::{Memory, Room};
use belief::gaussian;

pub use belief::RmmNetBelief;
pub use features::{Before, heading};
pub use hyper::{Aligned, Form, RmmNetHyper, Sizes};
pub use kinematics::Kinematics;
pub use network::RmmNetwork;
pub use number::{Number, Symmetric};
pub use regression::{Identification, Regression};
pub use track::{Length, Past, Report, Track};
pub use view::View;

/// The kind of these models in their cards.
pub(super) const KIND: &str = "rmmnet";

/// Estimates motion and extent of an object that gives many points a scan, with a motion, a reading of the points and an extent
/// that were learned.
///
/// ## Recursion
/// With a memory `c` (LSTM) and heads `f`, `h`, `e` in the frame of the object, which see neither position nor direction:
/// ```text
/// predict   c, and from it by f:   v⁻ = v + Δ_v,  p⁻ = p + T (v⁻ + Δ_p),   P⁻ = J P Jᵀ + Q,   axes and weight of the extent
/// update    the points in the frame, each through two layers, then mean and maximum over them; with count, scatter and c by h:
///           a centre z = z̄ + Δ with the covariance L Lᵀ, and the direction in which the object moves: a Kalman update with both
///           axes by the rule of Feldmann, Fränken and Koch in the frame of the object
/// extent    by e: direction between the course of the updated velocity and that of the scatter, axes, weight
/// ```
/// `Δ_v` has a part that is said in the frame of the heading, weights of past velocities, and a share of what weights expect that
/// are identified while the object is tracked ([`Identification`]). Scale and sensor noise of the [`Scattering`] are inside. A
/// network that says nothing is a random-matrix filter in straight motion. A scan without points, or none, is a prediction.
///
/// ## Use it when
/// there is a model trained for such objects: their motion has a memory, they point where they go, or the points tell more than
/// count, mean and scatter. [`Aligned`](tercel_core::extended::Aligned) is the filter to compare with, where the size is known.
///
/// ## Reference
/// RMMNet paper, section III. The form here is ours: frame, points, the update of the direction and the extent after the update are
/// not in the paper, whose additive extent cannot follow an object that turns faster than its shape is averaged.
#[derive(Debug, Clone, PartialEq)]
pub struct RmmNet {
    network: Arc<RmmNetwork>,
    scattering: Scattering,
}

/// Points for which a new belief has room.
const ROOM: usize = 64;

/// Speed beyond which objects go straight, in units of a new object's.
const FASTEST: f64 = 1e3;

impl RmmNet {
    /// A filter of this network, for a sensor whose points spread so.
    pub fn new(network: Arc<RmmNetwork>, scattering: Scattering) -> Self {
        RmmNet { network, scattering }
    }

    /// The network.
    pub fn network(&self) -> &Arc<RmmNetwork> {
        &self.network
    }

    fn options(&self) -> &Aligned {
        self.network.hyper().aligned()
    }

    /// The filter that compares scans with what is expected. Its motion is not used.
    fn classical(&self) -> Result<RandomMatrix<ConstantVelocity>, FilterError> {
        let [along, across] = self.options().axes.map(|axis| axis * axis);
        let prior = InverseWishart::new(Matrix2::new(along, 0.0, 0.0, across), self.options().worth)?;
        let evolution = Evolution::wishart(2.0, Freedom::Exact)?;
        let motion = ConstantVelocity::new(0.0).with_speed(self.options().speed);
        Ok(RandomMatrix::new(motion, self.scattering, prior, evolution, Rule::Distorted))
    }

    fn compared(&self, belief: &RmmNetBelief, points: &Points) -> Result<Innovation, FilterError> {
        let expected = GaussianInverseWishart { state: belief.state, extent: belief.extent()?, rate: None };
        self.classical()?.innovation(&expected, points)
    }
}

fn finite(values: &[f32]) -> bool {
    values.iter().all(|value| value.is_finite())
}

/// Outputs in double precision, on the stack: at most as many as a network of the largest history has.
fn widened(said: &[f32], room: &mut [f64; 80]) {
    for (to, from) in room.iter_mut().zip(said) {
        *to = f64::from(*from);
    }
}

impl Filter<4> for RmmNet {
    type Belief = RmmNetBelief;
    type Measurement = Points;

    fn birth(&self, points: &Points) -> Result<RmmNetBelief, FilterError> {
        // The classical filter refuses what is no beginning.
        let _: GaussianInverseWishart<4> = self.classical()?.birth(points)?;
        let options = self.options();
        let (track, angle) = options.birth(points, &self.scattering);
        let memory = vec![0.0; self.network.memory()];
        Ok(RmmNetBelief {
            state: gaussian(&track.motion),
            axes: track.axes,
            worth: track.worth,
            angle,
            ln_weight: options.worth.ln(),
            held: angle,
            correction: [0.0; 4],
            measured: true,
            regression: Regression::new(&options.identification),
            memory: Memory::new(&memory, self.network.scratch()),
            room: belief::Room(vec![0.0; self.network.room(points.count().max(ROOM))]),
        })
    }

    fn predict(&self, belief: &mut RmmNetBelief, dt: f64) {
        if dt == 0.0 {
            return;
        }
        let (options, sizes) = (self.options(), self.network.hyper().sizes());
        let length = Length { dt, share: dt / self.network.hyper().interval };
        let before = belief.track();
        belief.regression.take(
            &options.identification,
            options.change,
            before.motion.velocity,
            belief.measured,
        );
        let known = Before { regression: &belief.regression, ..belief.before() };
        let (next, scratch) = belief.memory.stage();
        let mut room = Room(scratch);
        let (seen, said) = (room.take(sizes.motion_seen), room.take(sizes.motion_said));
        options.see_motion(&before, &known, seen);
        self.network.say_motion(seen, next, room.0, said);
        let [vx, vy] = before.motion.velocity;
        // Weights of past velocities may let a speed grow for as long as nothing is measured.
        let sound = finite(said) && finite(next) && vx.hypot(vy) < FASTEST * options.speed;
        let mut wide = [0.0; 80];
        if sound {
            widened(said, &mut wide);
        }
        let wide = &wide[..sizes.motion_said];
        if sound {
            belief.memory.commit();
        }
        let past = Past {
            heading: heading(options, before.motion.velocity, belief.angle),
            velocities: belief.regression.past(),
            expected: belief.regression.expected(),
        };
        let prior = before.predict(options, &past, wide, length);
        let report = prior.foresee(options, belief.angle, wide);
        belief.state = gaussian(&prior.motion);
        // What cannot be saved is reported by the next update.
        let _ = belief.state.settle();
        belief.held = belief.angle;
        belief.report(&prior, &report);
        (belief.correction, belief.measured) = ([0.0; 4], false);
    }

    fn update(&self, belief: &mut RmmNetBelief, points: &Points) -> Result<Innovation, FilterError> {
        let innovation = self.compared(belief, points)?;
        if points.is_empty() {
            return Ok(innovation);
        }
        let (options, sizes, count) = (self.options(), self.network.hyper().sizes(), points.count());
        let prior = belief.track();
        let noise = self.scattering.noise();
        let view = View::new(options, &prior, belief.held, points, (self.scattering.scale(), &noise));
        let needed = self.network.room(count);
        if belief.room.0.len() < needed {
            belief.room.0.resize(needed, 0.0);
        }
        let rows = &mut belief.room.0[..needed];
        view.see_points(&prior, points, &mut rows[..count * sizes.point]);
        let (memory, scratch) = belief.memory.stage();
        let mut room = Room(scratch);
        let (seen, hidden) = (room.take(sizes.scan_seen), room.take(options.hidden));
        let (said, seen_extent) = (room.take(sizes.scan_said), room.take(sizes.extent_seen));
        let said_extent = room.take(sizes.extent_said);
        options.see_scan(&prior, &view, seen);
        self.network.say_scan((rows, count), seen, memory, room.0, (hidden, said));
        let mut wide = [0.0; 80];
        if finite(said) && finite(hidden) {
            widened(said, &mut wide);
        }
        let mut after = prior.update(options, &view, &wide[..sizes.scan_said]);
        options.see_extent(&after, &view, seen_extent);
        self.network.say_extent(hidden, seen_extent, room.0, said_extent);
        wide = [0.0; 80];
        if finite(said_extent) {
            widened(said_extent, &mut wide);
        }
        let report = after.settle_extent(options, &view, &wide[..sizes.extent_said]);
        let mut state = gaussian(&after.motion);
        state.settle()?;
        let sound = after.axes.iter().chain([&after.worth, &report.angle]).all(|value| value.is_finite());
        if !sound {
            return Err(FilterError::NotFinite { what: "extent" });
        }
        for (i, correction) in belief.correction.iter_mut().enumerate() {
            *correction += state.mean[i] - belief.state.mean[i];
        }
        belief.state = state;
        belief.measured = true;
        belief.report(&after, &report);
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

    fn reach(&self, belief: &RmmNetBelief) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let spread = self.scattering.spread(&belief.extent().ok()?.mean());
        let covariance = belief.state.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        Some((belief.state.mean.xy(), covariance + spread))
    }

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
