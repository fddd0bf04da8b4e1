//! Simulated flights, as a batch of filters sees them: the data of every task on air traffic.

use std::sync::Arc;

use nalgebra::Vector2;
use rand::RngExt;
use serde::Deserialize;
use tercel_core::sensor::ConvertedPolar;
use tercel_sim::air_traffic::{AirTraffic, Flight, NAMES, Radar};

use crate::TrainError;
use crate::check::{refused, size};
use crate::task::neural_imm::Population;
use crate::trainer::{Draw, Split};

/// The section `[data]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FlightsConfig {
    /// The scenario of the training flights: a name of [`tercel_sim`].
    pub scenario: String,
    /// That of the validation.
    pub validation_scenario: String,
    /// Training flights in an epoch.
    pub training: usize,
    /// Validation flights.
    pub validation: usize,
    /// What is new in each epoch.
    pub fresh: Fresh,
    /// The range from which each training flight draws its detection probability; validation flights too.
    pub detection: [f64; 2],
    /// How polar measurements become positions.
    pub conversion: Conversion,
    /// Flights that are drawn in turns in the place of both scenarios, if there are any.
    pub population: Vec<Population>,
}

impl Default for FlightsConfig {
    fn default() -> Self {
        Self {
            scenario: "atc-train".into(),
            validation_scenario: "atc-validation".into(),
            training: 5000,
            validation: 500,
            fresh: Fresh::Flights,
            detection: [1.0, 1.0],
            conversion: Conversion::Debiased,
            population: Vec::new(),
        }
    }
}

/// What is new in each epoch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fresh {
    /// Nothing: one training set for all epochs, as in publications.
    Nothing,
    /// The errors and misses of the measurements.
    Noise,
    /// The flights.
    Flights,
}

/// How polar measurements become positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Conversion {
    /// With plain trigonometry.
    Plain,
    /// Without bias, given the accuracy of the radar.
    Debiased,
}

/// Where flights come from. What is drawn depends on the seed of the recipe and the [`Draw`] alone.
#[derive(Debug)]
pub struct Flights {
    training: AirTraffic,
    validation: AirTraffic,
    populations: Vec<AirTraffic>,
    config: FlightsConfig,
    seed: u64,
}

/// A flight, and what a radar saw of it.
#[derive(Debug)]
pub struct Observed {
    /// The flight.
    pub flight: Flight,
    /// The radar.
    pub radar: Radar,
    /// Range and bearing at each step, unless it was missed; the first step is always seen.
    pub plots: Vec<Option<Vector2<f64>>>,
}

/// Keeps the flights of trainings apart from those of studies, whose seeds are small numbers.
const TRAINING: u64 = 0x7472_6169_6e00_0000;
const VALIDATION: u64 = 0x7661_6c69_6400_0000;

impl Flights {
    /// The flights of a recipe.
    ///
    /// # Errors
    ///
    /// If a scenario is unknown or a test set, or a value makes no sense; its key is named.
    pub fn new(config: &FlightsConfig, seed: u64) -> Result<Self, TrainError> {
        let scenario = |key: &str, name: &str| {
            let expected = || format!("there are the scenarios {}", NAMES.join(", "));
            AirTraffic::named(name).ok_or_else(|| refused(key, format!("{name:?}"), expected()))
        };
        for (key, name) in
            [("scenario", &config.scenario), ("validation_scenario", &config.validation_scenario)]
        {
            if ["atc-test", "atc-hshm"].contains(&name.as_str()) {
                let expected =
                    "no test set takes part in a training; use \"atc-train\" or \"atc-validation\"";
                return Err(refused(&format!("data.{key}"), format!("{name:?}"), expected));
            }
        }
        size("data.training", config.training, [1, 100_000_000])?;
        size("data.validation", config.validation, [1, 100_000_000])?;
        let [low, high] = config.detection;
        if !(0.0 < low && low <= high && high <= 1.0) {
            let value = format!("[{low}, {high}]");
            return Err(refused("data.detection", value, "it must be a range above 0 and up to 1"));
        }
        let training = scenario("data.scenario", &config.scenario)?;
        let population = |population: &Population| {
            let fault = |error| TrainError::Recipe(format!("[[data.population]]: {error}"));
            population.scenario(training.steps()).map_err(fault)
        };
        Ok(Self {
            populations: config.population.iter().map(population).collect::<Result<_, _>>()?,
            training,
            validation: scenario("data.validation_scenario", &config.validation_scenario)?,
            config: config.clone(),
            seed,
        })
    }

    /// Steps of a flight, with the first.
    pub fn steps(&self) -> usize {
        self.training.steps().min(self.validation.steps())
    }

    /// Seconds between steps.
    pub fn interval(&self) -> f64 {
        self.training.interval()
    }

    /// Flights of a split.
    pub fn samples(&self, split: Split) -> usize {
        match split {
            Split::Training => self.config.training,
            Split::Validation => self.config.validation,
        }
    }

    /// How polar measurements become positions.
    pub fn conversion(&self) -> Conversion {
        self.config.conversion
    }

    /// Whether a split has the same flights and measurements in every epoch.
    pub fn repeats(&self, split: Split) -> bool {
        split == Split::Validation || self.config.fresh == Fresh::Nothing
    }

    /// The flights of a draw.
    ///
    /// # Errors
    ///
    /// If the simulator refuses what the recipe asks for.
    pub fn rollout(&self, draw: Draw<'_>) -> Result<Rollout, TrainError> {
        let mut rollout = Rollout::new(draw.samples.len(), self.steps());
        for (member, sample) in draw.samples.iter().enumerate() {
            self.fly(draw, *sample, member, &mut rollout)?;
        }
        Ok(rollout)
    }

    /// A flight of a draw, as its radar saw it.
    ///
    /// # Errors
    ///
    /// If the simulator refuses what the recipe asks for.
    pub fn observed(&self, draw: Draw<'_>, sample: u64) -> Result<Observed, TrainError> {
        let fault = |error: &dyn std::fmt::Display| TrainError::Data(format!("flight {sample}: {error}"));
        let epoch = draw.epoch as u64;
        let (scenario, seed, run, realisation) = match (draw.split, self.config.fresh) {
            (Split::Validation, _) => (&self.validation, VALIDATION, sample, 0),
            (_, Fresh::Nothing) => (&self.training, TRAINING, sample, 0),
            (_, Fresh::Noise) => (&self.training, TRAINING, sample, epoch),
            (_, Fresh::Flights) => {
                (&self.training, TRAINING, epoch * self.config.training as u64 + sample, 0)
            }
        };
        let seed = seed ^ self.seed;
        let scenario = match self.populations.len() as u64 {
            0 => scenario,
            count => &self.populations[(sample % count) as usize],
        };
        let flight = scenario.flight(seed, run);
        let [low, high] = self.config.detection;
        let detection = low + (high - low) * draw.random(sample).random::<f64>();
        let radar = flight.radar().with_detection(detection).map_err(|error| fault(&error))?;
        let plots = flight.observe(&radar.with_realisation(realisation), seed, run);
        Ok(Observed { flight, radar, plots })
    }

    fn fly(
        &self,
        draw: Draw<'_>,
        sample: u64,
        member: usize,
        rollout: &mut Rollout,
    ) -> Result<(), TrainError> {
        let fault = |error: &dyn std::fmt::Display| TrainError::Data(format!("flight {sample}: {error}"));
        let Observed { flight, radar, plots } = self.observed(draw, sample)?;
        let converter = ConvertedPolar::new(radar.range(), radar.bearing()).map_err(|error| fault(&error))?;
        let converter = match self.config.conversion {
            Conversion::Debiased => converter,
            Conversion::Plain => converter.biased(),
        };
        let read = |plot: &Vector2<f64>| converter.convert(plot).value;
        let first = plots.first().and_then(Option::as_ref).map(read);
        let origin = first.ok_or_else(|| fault(&"its first step was not seen"))?;
        let readings = plots.iter().map(|plot| plot.as_ref().map(read));
        rollout.fill(member, origin, readings, flight.states().iter());
        Ok(())
    }
}

/// Flights side by side: what a batch of filters is given, and what it should say. Positions are relative to
/// the first reading of each flight.
#[derive(Debug)]
pub struct Rollout {
    /// The number of flights.
    pub members: usize,
    /// The first readings, relative to the radar: `[members, 2]`.
    pub origins: Arc<Vec<f32>>,
    /// For each step, `[members, 2]`; zero where nothing was seen.
    pub readings: Vec<Arc<Vec<f32>>>,
    /// For each step, 1 or 0 for each member.
    pub seen: Vec<Arc<Vec<f32>>>,
    /// True states, row `step * members + member`: `x, y, vx, vy`.
    pub truth: Vec<f32>,
}

impl Rollout {
    fn new(members: usize, steps: usize) -> Self {
        Self {
            members,
            origins: Arc::new(vec![0.0; 2 * members]),
            readings: (0..steps).map(|_| Arc::new(vec![0.0; 2 * members])).collect(),
            seen: (0..steps).map(|_| Arc::new(vec![0.0; members])).collect(),
            truth: vec![0.0; steps * members * 4],
        }
    }

    /// Steps, with the first.
    pub fn steps(&self) -> usize {
        self.readings.len()
    }

    /// Whether all members were seen at a step.
    pub fn all_seen(&self, step: usize) -> bool {
        self.seen[step].iter().all(|seen| *seen == 1.0)
    }

    fn fill<'a>(
        &mut self,
        member: usize,
        origin: Vector2<f64>,
        readings: impl Iterator<Item = Option<Vector2<f64>>>,
        states: impl Iterator<Item = &'a nalgebra::Vector4<f64>>,
    ) {
        let place = 2 * member..2 * member + 2;
        let pair = |v: Vector2<f64>| [v.x as f32, v.y as f32];
        Arc::make_mut(&mut self.origins)[place.clone()].copy_from_slice(&pair(origin));
        let steps = self.readings.iter_mut().zip(&mut self.seen);
        for ((readings, seen), reading) in steps.zip(readings) {
            if let Some(reading) = reading {
                Arc::make_mut(readings)[place.clone()].copy_from_slice(&pair(reading - origin));
                Arc::make_mut(seen)[member] = 1.0;
            }
        }
        for (row, state) in self.truth.chunks_exact_mut(4 * self.members).zip(states) {
            let [x, y] = pair(Vector2::new(state[0], state[1]) - origin);
            row[4 * member..4 * member + 4].copy_from_slice(&[x, y, state[2] as f32, state[3] as f32]);
        }
    }
}
