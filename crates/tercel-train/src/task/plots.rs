//! Simulated flights as plots of a radar: the data of tasks whose filters read them as they come.

use nalgebra::{Matrix2, Vector2, Vector4};
use rand::RngExt;
use serde::Deserialize;
use tercel_core::sensor::Measurement;
use tercel_sim::air_traffic::{AirTraffic, Radar};

use super::flights::Fresh;
use super::neural_imm::Population;
use crate::TrainError;
use crate::check::{positive, refused, size};
use crate::trainer::{Draw, Split};

/// The section `[data]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlotsConfig {
    /// Training flights in an epoch.
    pub training: usize,
    /// Validation flights.
    pub validation: usize,
    /// Steps of a flight, with the first.
    pub steps: usize,
    /// From which flights are drawn, in turns.
    pub population: Vec<Population>,
    /// What is new in each epoch.
    pub fresh: Fresh,
    /// Share of flights whose radar is seen at each step.
    pub unbroken: f64,
    /// The range from which the others draw their detection probability.
    pub detection: [f64; 2],
    /// Share of flights whose radar states its accuracy.
    pub stated: f64,
    /// The range accuracy that is assumed of the others, m.
    pub range: f64,
    /// The bearing accuracy that is assumed of the others, degrees.
    pub bearing: f64,
    /// Windows of each flight in an epoch, for tasks that learn from windows; 0 for all.
    pub windows: usize,
}

impl Default for PlotsConfig {
    fn default() -> Self {
        Self {
            training: 6400,
            validation: 640,
            steps: 200,
            population: vec![Population::default()],
            fresh: Fresh::Flights,
            unbroken: 0.5,
            detection: [0.6, 1.0],
            stated: 1.0,
            range: 50.0,
            bearing: 0.5,
            windows: 8,
        }
    }
}

/// Where flights come from. What is drawn depends on the seed of the recipe and the [`Draw`] alone.
#[derive(Debug)]
pub struct Plots {
    config: PlotsConfig,
    populations: Vec<AirTraffic>,
    seed: u64,
}

/// One flight, and what a radar saw of it.
#[derive(Debug)]
pub struct Sighting {
    /// True states: `x, y, vx, vy`.
    pub states: Vec<Vector4<f64>>,
    /// Range and bearing at each step, with their accuracy if it is stated.
    pub plots: Vec<Option<Measurement<2>>>,
    /// Seconds between steps.
    pub interval: f64,
}

impl Sighting {
    /// The first plot, from which a filter starts.
    ///
    /// # Errors
    ///
    /// If there is none.
    pub fn first(&self) -> Result<&Measurement<2>, TrainError> {
        let first = self.plots.first().and_then(Option::as_ref);
        first.ok_or_else(|| TrainError::Data("the first step of a flight was not seen".into()))
    }
}

/// Keeps the flights of trainings apart from those of studies, whose seeds are small numbers.
const TRAINING: u64 = 0x706c_6f74_0000_0000;
const VALIDATION: u64 = 0x706c_6f75_0000_0000;

impl Plots {
    /// The flights of a recipe, of at least `least` steps.
    ///
    /// # Errors
    ///
    /// If a value makes no sense; its key is named.
    pub fn new(config: &PlotsConfig, seed: u64, least: usize) -> Result<Self, TrainError> {
        size("data.training", config.training, [1, 100_000_000])?;
        size("data.validation", config.validation, [1, 100_000_000])?;
        size("data.steps", config.steps, [least, 1_000_000])?;
        let [low, high] = config.detection;
        if !(0.0 < low && low <= high && high <= 1.0) {
            let value = format!("[{low}, {high}]");
            return Err(refused("data.detection", value, "it must be a range above 0 and up to 1"));
        }
        for (key, share) in [("data.unbroken", config.unbroken), ("data.stated", config.stated)] {
            if !(0.0..=1.0).contains(&share) {
                return Err(refused(key, share, "it is a share, between 0 and 1"));
            }
        }
        positive("data.range", config.range)?;
        positive("data.bearing", config.bearing)?;
        if config.population.is_empty() {
            return Err(refused("data.population", "[]", "there must be at least one"));
        }
        let scenario = |population: &Population| {
            let fault = |error| TrainError::Recipe(format!("[[data.population]]: {error}"));
            population.scenario(config.steps).map_err(fault)
        };
        let populations = config.population.iter().map(scenario).collect::<Result<_, _>>()?;
        Ok(Self { config: config.clone(), populations, seed })
    }

    /// Flights of a split.
    pub fn samples(&self, split: Split) -> usize {
        match split {
            Split::Training => self.config.training,
            Split::Validation => self.config.validation,
        }
    }

    /// Steps of a flight, with the first.
    pub fn steps(&self) -> usize {
        self.config.steps
    }

    /// Seconds between steps.
    pub fn interval(&self) -> f64 {
        self.populations.first().map_or(1.0, AirTraffic::interval)
    }

    /// The accuracy that is assumed of a radar that does not state its own: m, rad.
    pub fn assumed(&self) -> [f64; 2] {
        [self.config.range, self.config.bearing.to_radians()]
    }

    /// Which of `count` windows of a flight are learned from in this epoch, in order.
    pub fn windows(&self, draw: Draw<'_>, sample: u64, count: usize) -> Vec<usize> {
        if self.config.windows == 0 || self.config.windows >= count {
            return (0..count).collect();
        }
        // A stream apart from that of the flight, of which it must not depend how many numbers were drawn.
        let mut random = Draw { seed: draw.seed ^ 0x7769_6e64, ..draw }.random(sample);
        let mut chosen = rand::seq::index::sample(&mut random, count, self.config.windows).into_vec();
        chosen.sort_unstable();
        chosen
    }

    /// A flight of a draw.
    ///
    /// # Errors
    ///
    /// If the simulator refuses what the recipe asks for.
    pub fn sighting(&self, draw: Draw<'_>, sample: u64) -> Result<Sighting, TrainError> {
        let epoch = draw.epoch as u64;
        let (seed, run, realisation) = match (draw.split, self.config.fresh) {
            (Split::Validation, _) => (VALIDATION, sample, 0),
            (_, Fresh::Nothing) => (TRAINING, sample, 0),
            (_, Fresh::Noise) => (TRAINING, sample, epoch),
            (_, Fresh::Flights) => (TRAINING, epoch * self.config.training as u64 + sample, 0),
        };
        let seed = seed ^ self.seed;
        let flight = self.populations[(sample % self.populations.len() as u64) as usize].flight(seed, run);
        let mut random = match self.config.fresh {
            Fresh::Nothing => Draw { epoch: 0, ..draw }.random(sample),
            _ => draw.random(sample),
        };
        let [low, high] = self.config.detection;
        let drawn = low + (high - low) * random.random::<f64>();
        let detection = if random.random::<f64>() < self.config.unbroken { 1.0 } else { drawn };
        let stated = random.random::<f64>() < self.config.stated;
        let radar = flight
            .radar()
            .with_detection(detection)
            .map_err(|error| TrainError::Data(format!("flight {sample}: {error}")))?
            .with_realisation(realisation);
        let measure = |plot: Vector2<f64>| measurement(plot, stated.then_some(&radar));
        Ok(Sighting {
            states: flight.states().to_vec(),
            plots: flight.observe(&radar, seed, run).into_iter().map(|plot| plot.map(measure)).collect(),
            interval: flight.interval(),
        })
    }
}

fn measurement(plot: Vector2<f64>, radar: Option<&Radar>) -> Measurement<2> {
    let measurement = Measurement::from(plot);
    match radar {
        None => measurement,
        Some(radar) => {
            let variances = Vector2::new(radar.range() * radar.range(), radar.bearing() * radar.bearing());
            measurement.with_noise(Matrix2::from_diagonal(&variances))
        }
    }
}
