//! Random-matrix filters, and the scan alone.

use nalgebra::Matrix2;
use tercel_core::error::FilterError;
use tercel_core::extended::{
    Centroid, Evolution, Freedom, GaussianInverseWishart, InverseWishart, Points, RandomMatrix, Rule,
    Scattering,
};
use tercel_core::filter::{Filter, Imm, Transition};
use tercel_core::motion::{AccelerationNoise, ConstantAcceleration, ConstantVelocity, PaddedMotion, Turn};

use super::{Method, Recording, Settings, StepEstimate};
use crate::extended::recording::follow;

/// The sensor of a recording, as its data sheet says.
pub(super) fn sensor(recording: &Recording) -> Result<Scattering, FilterError> {
    Scattering::uniform(recording.scatterers.noise())
}

/// Straight motion whose velocity jumps by this much, m/s per axis.
pub(super) fn straight(jump: f64) -> ConstantVelocity {
    ConstantVelocity::with_noise(AccelerationNoise::Jump(jump))
}

/// A time over which a weight falls to this share in a step.
fn forgetting(kept: f64, recording: &Recording) -> Result<Evolution, FilterError> {
    Evolution::forget(-recording.ride.interval() / kept.ln())
}

/// The scan alone. The velocity is that of the motion's prior, and is not told.
pub(super) struct Mean(pub Settings);

impl Method for Mean {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let filter = Centroid::new(straight(self.0.jump), sensor(recording)?, self.0.extent())?;
        let mut estimates = follow::<4, _>(recording, &filter)?;
        for estimate in &mut estimates {
            (estimate.mean.z, estimate.mean.w) = (f64::NAN, f64::NAN);
        }
        Ok(estimates)
    }
}

/// A random-matrix filter, tuned.
pub(super) struct Matrix {
    settings: Settings,
    rule: Rule,
    kept: f64,
    delta: Option<f64>,
}

impl Matrix {
    pub fn direct(settings: Settings) -> Self {
        Matrix { settings, rule: Rule::Direct, kept: settings.kept_direct, delta: None }
    }

    pub fn distorted(settings: Settings) -> Self {
        Matrix { settings, rule: Rule::Distorted, kept: settings.kept, delta: None }
    }

    pub fn variational(settings: Settings) -> Self {
        let rule = Rule::Variational { sweeps: settings.sweeps, tolerance: 0.0 };
        Matrix { settings, rule, kept: settings.kept_variational, delta: None }
    }

    pub fn lan_li(settings: Settings) -> Self {
        Matrix { delta: Some(settings.delta), ..Matrix::distorted(settings) }
    }
}

impl Method for Matrix {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let (settings, scattering) = (&self.settings, sensor(recording)?);
        let evolution = match self.delta {
            Some(delta) => Evolution::wishart(delta, Freedom::Exact)?,
            None => forgetting(self.kept, recording)?,
        };
        let mean = match self.rule {
            Rule::Direct => scattering.spread(&settings.extent()),
            _ => settings.extent(),
        };
        let prior = InverseWishart::new(mean, settings.weight)?;
        let filter = RandomMatrix::new(straight(settings.jump), scattering, prior, evolution, self.rule);
        follow::<4, _>(recording, &filter)
    }
}

/// A random-matrix filter as published.
pub(super) struct PaperMatrix {
    settings: Settings,
    rule: Rule,
    delta: Option<f64>,
}

/// Degrees of freedom of the next extent where the publication has none.
const DELTA: f64 = 5.0;

impl PaperMatrix {
    pub fn direct(settings: Settings) -> Self {
        PaperMatrix { settings, rule: Rule::Direct, delta: None }
    }

    pub fn variational(settings: Settings) -> Self {
        let rule = Rule::Variational { sweeps: settings.paper.sweeps, tolerance: 0.0 };
        PaperMatrix { settings, rule, delta: None }
    }

    pub fn lan_li(settings: Settings) -> Self {
        PaperMatrix { settings, rule: Rule::Direct, delta: Some(DELTA) }
    }
}

/// The first extent of the publication, whose squares are those of its scale matrix.
fn paper_prior(settings: &Settings) -> Result<InverseWishart, FilterError> {
    let axes = settings.paper.axes;
    InverseWishart::gupta_nagar(settings.paper.freedom, Matrix2::from_diagonal(&axes.component_mul(&axes)))
}

impl Method for PaperMatrix {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let paper = &self.settings.paper;
        let scattering = match self.rule {
            Rule::Variational { .. } => sensor(recording)?,
            _ => Scattering::direct(),
        };
        let evolution = match self.delta {
            Some(delta) => Evolution::wishart(delta, Freedom::Printed)?,
            None => Evolution::forget(paper.time)?,
        };
        let motion = ConstantVelocity::with_noise(AccelerationNoise::Piecewise(paper.acceleration));
        let filter =
            RandomMatrix::new(motion, scattering, paper_prior(&self.settings)?, evolution, self.rule);
        follow::<4, _>(recording, &filter)
    }
}

/// Four random-matrix filters that interact: straight, accelerating, turning left and right.
pub(super) struct Interacting {
    pub settings: Settings,
    pub paper: bool,
}

type Mode = Box<dyn Filter<6, Belief = GaussianInverseWishart<6>, Measurement = Points>>;

/// Deviation of the accelerations in modes that have none, m/s²: enough for mixing to stay regular.
const STILL: f64 = 0.1;

/// Published probability of keeping the mode, density of the jerk, m²/s⁵.
const PAPER_MODES: (f64, f64) = (0.9, 0.25);

impl Interacting {
    fn modes(&self, recording: &Recording) -> Result<[Mode; 4], FilterError> {
        let (settings, imm, paper) = (&self.settings, &self.settings.imm, &self.settings.paper);
        let (noise, jerk, turn) = match self.paper {
            true => (AccelerationNoise::Piecewise(paper.acceleration), PAPER_MODES.1, paper.turn),
            false => (AccelerationNoise::Jump(imm.jump), imm.jerk, imm.turn),
        };
        let (scattering, evolution, prior, rule) = match self.paper {
            true => {
                let evolution = Evolution::wishart(DELTA, Freedom::Printed)?;
                (Scattering::direct(), evolution, paper_prior(settings)?, Rule::Direct)
            }
            false => {
                let prior = InverseWishart::new(settings.extent(), settings.weight)?;
                let rule = Rule::Variational { sweeps: settings.sweeps, tolerance: 0.0 };
                (sensor(recording)?, forgetting(imm.kept, recording)?, prior, rule)
            }
        };
        // The publication does not turn the extents of its turning modes.
        let turning = |rate: f64| {
            let evolution = if self.paper { evolution } else { evolution.with_turn_rate(rate) };
            let motion = PaddedMotion::<_, 4>::new(Turn::with_noise(rate, noise), STILL);
            RandomMatrix::new(motion, scattering, prior, evolution, rule)
        };
        let straight = PaddedMotion::<_, 4>::new(ConstantVelocity::with_noise(noise), STILL);
        Ok([
            Box::new(RandomMatrix::new(straight, scattering, prior, evolution, rule)),
            Box::new(RandomMatrix::new(ConstantAcceleration::new(jerk), scattering, prior, evolution, rule)),
            Box::new(turning(turn)),
            Box::new(turning(-turn)),
        ])
    }
}

impl Method for Interacting {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let stay = if self.paper { PAPER_MODES.0 } else { self.settings.imm.stay };
        let imm = Imm::new(self.modes(recording)?, Transition::sticky(stay))?;
        follow::<6, _>(recording, &imm)
    }
}
