//! Interacting multiple models: the published one, and ours.

use nalgebra::Matrix2;
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::filter::{Extended, Filter, Imm, ImmBelief, Transition, TurnBank};
use tercel_core::motion::{AccelerationNoise, Turn};
use tercel_core::sensor::{Measurement, Position, RangeBearing};

use super::{Plot, follow, stated};
use crate::air_traffic::{Method, Recording, StepEstimate};

/// Accuracy that is assumed where none is stated: range, m, and bearing, rad.
pub(super) const NOMINAL: (f64, f64) = (50.0, 0.5 * std::f64::consts::PI / 180.0);

/// Bearing accuracies among which a filter chooses that is told none, degrees.
pub(super) const ADAPTIVE_BEARINGS: [f64; 4] = [0.15, 0.4, 0.7, 1.0];

type Belief = ImmBelief<Gaussian<4>, 4>;

fn read<S>(bank: &TurnBank, filter: &Imm<Extended<Turn, S>>, belief: &Belief) -> StepEstimate
where
    Extended<Turn, S>: Filter<4, Belief = Gaussian<4>>,
{
    let state = filter.state(belief);
    StepEstimate {
        mean: state.mean,
        covariance: Some(state.covariance),
        manoeuvres: Some(bank.directions(filter.mode_probabilities(belief))),
    }
}

/// The IMM with which the AttEnsKNets paper compares: straight flight and turns at ±10 °/s, position noise `1250 I` m².
pub(super) struct Published {
    bank: TurnBank,
    filter: Imm<Extended<Turn, Position>>,
}

impl Published {
    pub fn new() -> Result<Self, FilterError> {
        let rate = 10.0_f64.to_radians();
        let bank = TurnBank::new([0.0, rate, -rate])?
            .with_noise(AccelerationNoise::Piecewise(10.0))
            .with_transition(Transition::from_rows([
                [0.95, 0.025, 0.025],
                [0.05, 0.70, 0.25],
                [0.05, 0.25, 0.70],
            ])?);
        let filter = bank.filter(Position::new(1250.0_f64.sqrt())?)?;
        Ok(Published { bank, filter })
    }
}

impl Method for Published {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let position = |plot: &Plot| {
            let (sine, cosine) = plot.y.sin_cos();
            Measurement::from([plot.x * cosine, plot.x * sine])
        };
        // The first plot has the accuracy that it has; with 35 m on each axis the filter would need long to forget it.
        let start = |plot: &Plot| position(plot).with_noise(rotated(plot, NOMINAL));
        follow(recording, &self.filter, start, position, |belief| read(&self.bank, &self.filter, belief))
    }
}

/// Covariance of a plot's position for these deviations of range and bearing.
fn rotated(plot: &Plot, (range, bearing): (f64, f64)) -> Matrix2<f64> {
    let (sine, cosine) = plot.y.sin_cos();
    let along = nalgebra::Vector2::new(cosine, sine);
    let across = nalgebra::Vector2::new(-sine, cosine);
    along * along.transpose() * (range * range) + across * across.transpose() * (plot.x * bearing).powi(2)
}

/// The bank of our own methods.
fn turns() -> Result<TurnBank, FilterError> {
    Ok(TurnBank::evenly(20.0_f64.to_radians(), 10)?
        .with_noise(AccelerationNoise::Piecewise(11.0))
        .with_transition(Transition::sticky(0.985)))
}

/// A bank of turns that believes the radar's stated accuracy.
pub struct Bank {
    bank: TurnBank,
    filter: Imm<Extended<Turn, RangeBearing>>,
}

impl Bank {
    /// Any bank.
    ///
    /// # Errors
    /// When its transition does not fit its rates.
    pub fn new(bank: TurnBank) -> Result<Self, FilterError> {
        // The accuracy comes with each measurement; this one is never used.
        let filter = bank.filter(RangeBearing::new(NOMINAL.0, NOMINAL.1)?)?;
        Ok(Bank { bank, filter })
    }

    /// The bank of the method `imm`: 21 rates to ±20 °/s. Tuned on training and validation flights, whose turns end at 10 °/s; the
    /// reach is what the fastest aircraft of interest can do.
    ///
    /// # Errors
    /// Never, as long as the constants are sound.
    pub fn shipped() -> Result<Self, FilterError> {
        Bank::new(turns()?)
    }
}

impl Method for Bank {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let measure = |plot: &Plot| stated(plot, recording);
        follow(recording, &self.filter, measure, measure, |belief| read(&self.bank, &self.filter, belief))
    }
}

/// A bank of turns that is told nothing of the radar's accuracy, and estimates it.
pub struct AdaptiveBank {
    bank: TurnBank,
    filter: Imm<Extended<Turn, RangeBearing>>,
}

impl AdaptiveBank {
    /// Any bank, with the accuracies that the radar may have: range, m, and bearing, rad.
    ///
    /// # Errors
    /// When an accuracy is not positive, or the bank's transition does not fit its rates.
    pub fn new(bank: TurnBank, accuracies: &[(f64, f64)]) -> Result<Self, FilterError> {
        let radars: Result<Vec<_>, _> =
            accuracies.iter().map(|&(range, bearing)| RangeBearing::new(range, bearing)).collect();
        let filter = bank.estimating(&radars?)?;
        Ok(AdaptiveBank { bank, filter })
    }

    /// The bank of the method `imm-adaptive`: that of `imm`, with bearings of 0.15, 0.4, 0.7 and 1 degree. At these distances the
    /// range error is small beside the bearing error, and one value of it does.
    ///
    /// # Errors
    /// Never, as long as the constants are sound.
    pub fn shipped() -> Result<Self, FilterError> {
        let accuracies = ADAPTIVE_BEARINGS.map(|degrees| (NOMINAL.0, degrees.to_radians()));
        AdaptiveBank::new(turns()?, &accuracies)
    }
}

impl Method for AdaptiveBank {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let measure = |plot: &Plot| Measurement::from(*plot);
        follow(recording, &self.filter, measure, measure, |belief| read(&self.bank, &self.filter, belief))
    }
}
