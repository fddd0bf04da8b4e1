//! Flights as a bank of filters followed them: what the network sees, and what it should make of it.

use std::sync::{Arc, OnceLock};

use nalgebra::{Matrix2, Vector2, Vector4};
use rand::RngExt;
use serde::Deserialize;
use tercel_core::error::FilterError;
use tercel_core::filter::Filter;
use tercel_core::sensor::{Measurement, Position, RangeBearing, Sensor};
use tercel_neural::filter::{BankNetwork, NeuralImm, NeuralImmBelief, NeuralImmHyper};
use tercel_sim::air_traffic::{AirTraffic, Radar};
use tercel_sim::{Interval, SimulationError};

use crate::TrainError;
use crate::check::{refused, size};
use crate::task::liquid::LiquidData;
use crate::trainer::{Draw, Split};

/// The section `[data]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BankDataConfig {
    /// Training flights in an epoch.
    pub training: usize,
    /// Whether each epoch has flights of its own. Otherwise those of the first are kept, a megabyte for every six of 200 steps:
    /// the bank takes longer to follow a flight than the network to learn from it.
    pub fresh: bool,
    /// Validation flights.
    pub validation: usize,
    /// Steps of a flight, with the first.
    pub steps: usize,
    /// From which flights are drawn, in turns.
    pub population: Vec<Population>,
    /// Share of flights whose radar is seen at each step.
    pub unbroken: f64,
    /// The range from which the others draw their detection probability.
    pub detection: [f64; 2],
    /// Share of flights whose radar states its accuracy.
    pub stated: f64,
    /// The bearing accuracies among which the bank chooses for the others, degrees.
    pub bearings: Vec<f64>,
    /// The range accuracy that goes with them, m.
    pub range: f64,
    /// Objects that are measured as positions, in the place of flights that a radar sees. Their numbers and steps are those above.
    pub positions: Option<LiquidData>,
    /// Steps at the start that do not count: a filter may find its feet.
    pub skip: usize,
}

impl Default for BankDataConfig {
    fn default() -> Self {
        Self {
            training: 12_800,
            fresh: false,
            validation: 1_024,
            steps: 200,
            population: vec![Population::default()],
            unbroken: 0.5,
            detection: [0.6, 1.0],
            stated: 0.7,
            bearings: vec![0.15, 0.4, 0.7, 1.0],
            range: 50.0,
            positions: None,
            skip: 10,
        }
    }
}

/// A population of simulated flights: [`AirTraffic`] with other numbers.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Population {
    /// Fewest and most switches between manoeuvres.
    pub switches: [usize; 2],
    /// Slowest and fastest turns, degrees a second.
    pub turn_rate: [f64; 2],
    /// Smallest and largest deviation of the acceleration, m/s².
    pub acceleration: [f64; 2],
    /// Lowest and highest first speed, m/s.
    pub speed: [f64; 2],
    /// Nearest and farthest start, m.
    pub distance: [f64; 2],
}

impl Default for Population {
    fn default() -> Self {
        Self {
            switches: [1, 6],
            turn_rate: [0.0, 20.0],
            acceleration: [5.0, 20.0],
            speed: [50.0, 600.0],
            distance: [50e3, 150e3],
        }
    }
}

impl Population {
    /// The scenario, for flights of this many steps.
    pub(in crate::task) fn scenario(&self, steps: usize) -> Result<AirTraffic, SimulationError> {
        let interval = |[low, high]: [f64; 2]| Interval::new(low, high);
        AirTraffic::training()
            .with_steps(steps)?
            .with_switches(self.switches[0]..=self.switches[1])?
            .with_turn_rates(interval(self.turn_rate.map(f64::to_radians))?)?
            .with_acceleration(interval(self.acceleration)?)?
            .with_speed(interval(self.speed)?)?
            .with_distance(interval(self.distance)?)
    }
}

/// Where objects come from, and the filters that follow them.
#[derive(Debug)]
enum Source {
    Flights {
        populations: Vec<AirTraffic>,
        stated: NeuralImm<RangeBearing>,
        estimating: NeuralImm<RangeBearing>,
    },
    Positions {
        data: LiquidData,
        filter: NeuralImm<Position<2>>,
    },
}

/// Flights and other objects, as the bank follows them.
#[derive(Debug)]
pub(super) struct BankData {
    config: BankDataConfig,
    source: Source,
    hyper: NeuralImmHyper,
    seed: u64,
    /// Flights that were followed and are kept, of both splits.
    kept: [Vec<OnceLock<Arc<Log>>>; 2],
}

/// Keeps the flights of trainings apart from those of studies, whose seeds are small numbers.
const TRAINING: u64 = 0x6261_6e6b_0000_0000;
const VALIDATION: u64 = 0x6261_6e6c_0000_0000;

impl BankData {
    /// The data of a recipe. Of the network only the bank is used.
    pub fn new(config: &BankDataConfig, seed: u64, network: &Arc<BankNetwork>) -> Result<Self, TrainError> {
        size("data.training", config.training, [1, 100_000_000])?;
        size("data.validation", config.validation, [1, 100_000_000])?;
        size("data.steps", config.steps, [config.skip.saturating_add(2), 1_000_000])?;
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
        Ok(Self {
            source: match &config.positions {
                Some(positions) => Source::positions(config, positions, network)?,
                None => Source::flights(config, network)?,
            },
            hyper: network.hyper().clone(),
            config: config.clone(),
            seed,
            kept: [empty(if config.fresh { 0 } else { config.training }), empty(config.validation)],
        })
    }
}

impl Source {
    fn positions(
        config: &BankDataConfig,
        positions: &LiquidData,
        network: &Arc<BankNetwork>,
    ) -> Result<Self, TrainError> {
        let BankDataConfig { training, validation, steps, detection, .. } = *config;
        let data = LiquidData { training, validation, steps, detection, ..positions.clone() };
        data.check()?;
        let fault = |error: FilterError| TrainError::Recipe(format!("[data] or [model]: {error}"));
        // Its accuracy is stated with each measurement.
        let sensor = Position::new(data.deviation[0]).map_err(fault)?;
        Ok(Source::Positions { data, filter: NeuralImm::new(network.clone(), &[sensor]).map_err(fault)? })
    }

    fn flights(config: &BankDataConfig, network: &Arc<BankNetwork>) -> Result<Self, TrainError> {
        let filter = |radars: &[RangeBearing]| NeuralImm::new(network.clone(), radars);
        if config.population.is_empty() {
            return Err(refused("data.population", "[]", "there must be at least one"));
        }
        let scenario = |population: &Population| {
            let fault = |error| TrainError::Recipe(format!("[[data.population]]: {error}"));
            population.scenario(config.steps).map_err(fault)
        };
        let fault = |error: FilterError| TrainError::Recipe(format!("[data] or [model]: {error}"));
        let radar = |degrees: &f64| RangeBearing::new(config.range, degrees.to_radians());
        let radars: Result<Vec<_>, _> = config.bearings.iter().map(radar).collect();
        let radars = radars.map_err(fault)?;
        let first =
            radars.first().ok_or_else(|| refused("data.bearings", "[]", "there must be at least one"))?;
        Ok(Source::Flights {
            populations: config.population.iter().map(scenario).collect::<Result<_, _>>()?,
            stated: filter(std::slice::from_ref(first)).map_err(fault)?,
            estimating: filter(&radars).map_err(fault)?,
        })
    }
}

impl BankData {
    pub fn samples(&self, split: Split) -> usize {
        match split {
            Split::Training => self.config.training,
            Split::Validation => self.config.validation,
        }
    }

    /// The flights of a draw, followed by the bank.
    pub fn batch(&self, draw: Draw<'_>) -> Result<Followed, TrainError> {
        let hyper = &self.hyper;
        let mut followed = Followed::new(draw.samples.len(), self.config.steps, hyper.inputs(), &hyper.rates);
        for (member, sample) in draw.samples.iter().enumerate() {
            let log = self.log(draw, *sample).map_err(|error| match error {
                TrainError::Data(reason) => TrainError::Data(format!("flight {sample}: {reason}")),
                other => other,
            })?;
            followed.add(member, &log);
        }
        Ok(followed)
    }

    /// A flight, followed now or before.
    fn log(&self, draw: Draw<'_>, sample: u64) -> Result<Arc<Log>, TrainError> {
        let [training, validation] = &self.kept;
        let kept = if draw.split == Split::Training { training } else { validation };
        let Some(place) = usize::try_from(sample).ok().and_then(|sample| kept.get(sample)) else {
            return Ok(Arc::new(self.follow(draw, sample)?));
        };
        if let Some(log) = place.get() {
            return Ok(log.clone());
        }
        // Two threads that follow it at one time find the same.
        let log = Arc::new(self.follow(Draw { epoch: 0, ..draw }, sample)?);
        Ok(place.get_or_init(|| log).clone())
    }

    fn follow(&self, draw: Draw<'_>, sample: u64) -> Result<Log, TrainError> {
        match &self.source {
            Source::Flights { populations, stated, estimating } => {
                self.follow_flight(draw, sample, populations, [stated, estimating])
            }
            Source::Positions { data, filter } => {
                let (states, measurements) = data.measured(draw, sample);
                let before = states.first().into_iter().chain(&states);
                let told = states.iter().zip(before);
                let manoeuvres: Vec<u8> = told.map(|(after, before)| turned(before, after)).collect();
                let flown = Flown { states: &states, manoeuvres: &manoeuvres, interval: data.interval };
                Log::of(filter, &flown, &measurements, self.config.skip)
            }
        }
    }

    fn follow_flight(
        &self,
        draw: Draw<'_>,
        sample: u64,
        populations: &[AirTraffic],
        [stating, estimating]: [&NeuralImm<RangeBearing>; 2],
    ) -> Result<Log, TrainError> {
        let fault = |error: &dyn std::fmt::Display| TrainError::Data(error.to_string());
        let (seed, run) = match draw.split {
            Split::Training => (TRAINING, draw.epoch as u64 * self.config.training as u64 + sample),
            Split::Validation => (VALIDATION, sample),
        };
        let seed = seed ^ self.seed;
        let flight = populations[(sample % populations.len() as u64) as usize].flight(seed, run);
        let mut random = draw.random(sample);
        let [low, high] = self.config.detection;
        let drawn = low + (high - low) * random.random::<f64>();
        let detection = if random.random::<f64>() < self.config.unbroken { 1.0 } else { drawn };
        let stated = random.random::<f64>() < self.config.stated;
        let radar = flight.radar().with_detection(detection).map_err(|error| fault(&error))?;
        let plots = flight.observe(&radar, seed, run);
        let filter = if stated { stating } else { estimating };
        let measure = |plot: &Option<Vector2<f64>>| {
            plot.as_ref().map(|plot| measurement(plot, stated.then_some(&radar)))
        };
        let measurements: Vec<_> = plots.iter().map(measure).collect();
        let manoeuvres: Vec<u8> = flight.manoeuvres().iter().map(|flown| flown.index() as u8).collect();
        let flown = Flown { states: flight.states(), manoeuvres: &manoeuvres, interval: flight.interval() };
        Log::of(filter, &flown, &measurements, self.config.skip)
    }
}

/// What an object did.
struct Flown<'a> {
    states: &'a [Vector4<f64>],
    /// At each step: 0 straight, 1 left, 2 right.
    manoeuvres: &'a [u8],
    /// Time between steps, s.
    interval: f64,
}

/// Smallest change of the heading in a step that is a turn, rad.
const TURN: f64 = 0.01;

/// Whether an object turned between two states, and to which side.
fn turned(before: &Vector4<f64>, after: &Vector4<f64>) -> u8 {
    let across = before[2] * after[3] - before[3] * after[2];
    let along = before[2] * after[2] + before[3] * after[3];
    let angle = across.atan2(along);
    if angle.abs() < TURN { 0 } else { 1 + u8::from(angle < 0.0) }
}

fn empty(count: usize) -> Vec<OnceLock<Arc<Log>>> {
    (0..count).map(|_| OnceLock::new()).collect()
}

fn measurement(plot: &Vector2<f64>, radar: Option<&Radar>) -> Measurement<2> {
    let measurement = Measurement::from(*plot);
    match radar {
        None => measurement,
        Some(radar) => {
            let variances = Vector2::new(radar.range() * radar.range(), radar.bearing() * radar.bearing());
            measurement.with_noise(Matrix2::from_diagonal(&variances))
        }
    }
}

/// What the bank said of one flight.
#[derive(Debug, Default)]
struct Log {
    /// Inputs of the network, one row after the other.
    inputs: Vec<f32>,
    /// Measurements after the first.
    updates: usize,
    /// The instants that count; their rows are numbers of updates.
    instants: Vec<Instant>,
    ln_probabilities: Vec<f32>,
    offsets: Vec<[f32; 4]>,
}

impl Log {
    /// What the bank of a filter says of an object at every step from number `skip` on.
    fn of<S: Sensor<4, 2> + Clone>(
        filter: &NeuralImm<S>,
        flown: &Flown<'_>,
        measurements: &[Option<Measurement<2>>],
        skip: usize,
    ) -> Result<Self, TrainError> {
        let fault = |error: &dyn std::fmt::Display| TrainError::Data(error.to_string());
        let (first, rest) = measurements.split_first().ok_or_else(|| fault(&"it has no steps"))?;
        let first = first.as_ref().ok_or_else(|| fault(&"its first step was not seen"))?;
        let mut belief = filter.birth(first).map_err(|error| fault(&error))?;
        let mut log = Log::default();
        for (step, measurement) in (1..).zip(rest) {
            filter.predict(&mut belief, flown.interval);
            if let Some(measurement) = measurement {
                filter.update(&mut belief, measurement).map_err(|error| fault(&error))?;
                log.inputs.extend_from_slice(belief.inputs());
                log.updates += 1;
            }
            if step >= skip && log.updates > 0 {
                log.expect(&belief, flown, step);
            }
        }
        Ok(log)
    }

    fn expect(&mut self, belief: &NeuralImmBelief, flown: &Flown<'_>, step: usize) {
        let outlook = belief.outlook();
        let four = |v: &Vector4<f64>| -> [f32; 4] { std::array::from_fn(|i| v[i] as f32) };
        let target = outlook.turned(&(flown.states[step] - outlook.state().mean));
        let root = outlook.root();
        self.instants.push(Instant {
            member: 0,
            row: self.updates - 1,
            target: four(&target),
            root: std::array::from_fn(|i| std::array::from_fn(|j| root[(i, j)] as f32)),
            manoeuvre: flown.manoeuvres[step],
        });
        self.ln_probabilities.extend(outlook.probabilities().iter().map(|p| p.ln() as f32));
        self.offsets.extend(outlook.offsets().iter().map(four));
    }
}

/// A batch of flights.
#[derive(Debug)]
pub(super) struct Followed {
    pub members: usize,
    /// Most measurements of a flight after the first.
    pub updates: usize,
    width: usize,
    /// Inputs of the network, row `update * members + member`; zero after the last measurement of a flight.
    pub inputs: Vec<f32>,
    /// The instants that count.
    pub instants: Vec<Instant>,
    /// For each instant, the turn rates one after the other.
    pub ln_probabilities: Vec<f32>,
    pub offsets: Vec<[f32; 4]>,
    /// The manoeuvre of each turn rate.
    pub directions: Vec<u8>,
}

/// One instant of one flight.
#[derive(Debug, Clone, Copy)]
pub(super) struct Instant {
    pub member: usize,
    /// The row of the last network step before it or at it.
    pub row: usize,
    /// What is to be added to the mean of the bank, in the frame of the line of sight.
    pub target: [f32; 4],
    /// Lower Cholesky factor of the bank's covariance in that frame, row by row.
    pub root: [[f32; 4]; 4],
    /// What the aircraft does: 0 straight, 1 left, 2 right.
    pub manoeuvre: u8,
}

impl Followed {
    fn new(members: usize, steps: usize, width: usize, rates: &[f64]) -> Self {
        let updates = steps - 1;
        let direction = |rate: &f64| if *rate == 0.0 { 0 } else { 1 + u8::from(*rate < 0.0) };
        Self {
            members,
            updates,
            width,
            inputs: vec![0.0; members * updates * width],
            instants: Vec::with_capacity(members * updates),
            ln_probabilities: Vec::new(),
            offsets: Vec::new(),
            directions: rates.iter().map(direction).collect(),
        }
    }

    /// Width of an input row.
    pub fn width(&self) -> usize {
        self.width
    }

    fn add(&mut self, member: usize, log: &Log) {
        let (members, width) = (self.members, self.width);
        for (update, inputs) in log.inputs.chunks_exact(width).enumerate() {
            self.inputs[(update * members + member) * width..][..width].copy_from_slice(inputs);
        }
        let placed = |instant: &Instant| Instant { member, row: instant.row * members + member, ..*instant };
        self.instants.extend(log.instants.iter().map(placed));
        self.ln_probabilities.extend_from_slice(&log.ln_probabilities);
        self.offsets.extend_from_slice(&log.offsets);
    }
}
