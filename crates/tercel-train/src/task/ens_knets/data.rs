//! Flights as the KalmanNets of an ensemble followed them: what the branches see, and what they should make
//! of it.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::{Matrix2, Vector2, Vector4};
use rand::RngExt;
use serde::Deserialize;
use tercel_core::error::FilterError;
use tercel_core::filter::Filter;
use tercel_core::sensor::{ConvertedPolar, Measurement, Position};
use tercel_neural::filter::{
    BranchHyper, EnsKNets, EnsKNetsBelief, EnsKNetsHyper, EnsembleNetwork, Normalisation,
};
use tercel_neural::{Card, Model, Tensor as Stored};
use tercel_sim::air_traffic::{Flight, Radar};

use crate::TrainError;
use crate::check::{positive, refused};
use crate::task::flights::{Conversion, Flights, FlightsConfig, Observed};
use crate::trainer::{Draw, Split};

/// The section `[data]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EnsembleDataConfig {
    /// Share of flights whose radar states its accuracy.
    pub stated: f64,
    /// The accuracy that is assumed for the others.
    pub nominal: Accuracy,
    /// A standard deviation of converted positions along each axis, m, that is assumed for all flights in the
    /// place of both.
    pub deviation: Option<f64>,
    /// The flights.
    pub flights: FlightsConfig,
}

/// The accuracy of a radar.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Accuracy {
    /// Standard deviation of ranges, m.
    pub range: f64,
    /// Standard deviation of bearings, degrees.
    pub bearing: f64,
}

impl Default for Accuracy {
    fn default() -> Self {
        Self { range: 50.0, bearing: 0.5 }
    }
}

impl Default for EnsembleDataConfig {
    fn default() -> Self {
        let (nominal, flights) = (Accuracy::default(), FlightsConfig::default());
        Self { stated: 1.0, nominal, deviation: None, flights }
    }
}

/// Where flights come from, and the KalmanNets that follow them.
#[derive(Debug)]
pub(super) struct EnsembleData {
    config: EnsembleDataConfig,
    flights: Flights,
    filter: EnsKNets<Position<2>>,
    whole: bool,
    /// Flights that come again in every epoch.
    known: Mutex<HashMap<(Split, u64), Arc<Followed>>>,
}

impl EnsembleData {
    /// The data of a recipe, for these options and KalmanNets, whose tensors have the prefixes of an
    /// ensemble.
    pub fn new(
        config: &EnsembleDataConfig,
        seed: u64,
        hyper: &EnsKNetsHyper,
        card: Card,
        nets: &BTreeMap<String, Stored>,
    ) -> Result<Self, TrainError> {
        if !(0.0..=1.0).contains(&config.stated) {
            return Err(refused("data.stated", config.stated, "it is a share, between 0 and 1"));
        }
        positive("data.nominal.range", config.nominal.range)?;
        positive("data.nominal.bearing", config.nominal.bearing)?;
        let deviation = config.deviation.unwrap_or(1.0);
        positive("data.deviation", deviation)?;
        let sensor = Position::new(deviation).map_err(|error| TrainError::Recipe(error.to_string()))?;
        let network = Arc::new(smallest(hyper, card, nets)?);
        Ok(Self {
            flights: Flights::new(&config.flights, seed)?,
            filter: EnsKNets::new(network, sensor)?,
            whole: hyper.normalisation == Normalisation::Sequence,
            config: config.clone(),
            known: Mutex::default(),
        })
    }

    pub fn flights(&self) -> &Flights {
        &self.flights
    }

    /// The flights of a draw, followed by the KalmanNets.
    pub fn batch(&self, draw: Draw<'_>) -> Result<Vec<Arc<Followed>>, TrainError> {
        draw.samples.iter().map(|sample| self.flight(draw, *sample)).collect()
    }

    fn flight(&self, draw: Draw<'_>, sample: u64) -> Result<Arc<Followed>, TrainError> {
        let key = (draw.split, sample);
        let repeats = self.flights.repeats(draw.split);
        // What comes again must not depend on the epoch in which a training began or went on.
        let draw = if repeats { Draw { epoch: 0, ..draw } } else { draw };
        // Another thread that failed has left whole entries behind.
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if repeats && let Some(found) = known().get(&key) {
            return Ok(Arc::clone(found));
        }
        let followed = Arc::new(self.follow(draw, sample)?);
        if repeats {
            known().insert(key, Arc::clone(&followed));
        }
        Ok(followed)
    }

    fn follow(&self, draw: Draw<'_>, sample: u64) -> Result<Followed, TrainError> {
        let fault = |error: &dyn std::fmt::Display| TrainError::Data(format!("flight {sample}: {error}"));
        let Observed { flight, radar, plots } = self.flights.observed(draw, sample)?;
        // Beside the detection probability, which is drawn first from the same numbers.
        let mut random = draw.random(sample);
        let _: f64 = random.random();
        let stated = random.random::<f64>() < self.config.stated;
        let measure = self.measure(&radar, stated).map_err(|error| fault(&error))?;
        let (first, rest) = plots.split_first().ok_or_else(|| fault(&"it has no steps"))?;
        let first = first.as_ref().ok_or_else(|| fault(&"its first step was not seen"))?;
        let mut belief = self.filter.birth(&measure(first)).map_err(|error| fault(&error))?;
        let mut followed = Followed::new(self.filter.network().hyper());
        for (step, plot) in rest.iter().enumerate() {
            self.filter.predict(&mut belief, flight.interval());
            if let Some(plot) = plot {
                self.filter.update(&mut belief, &measure(plot)).map_err(|error| fault(&error))?;
                followed.see(if self.whole { belief.features() } else { belief.inputs() });
            }
            followed.expect(&self.filter, &belief, &flight, step + 1);
        }
        if self.whole && followed.width > 0 {
            EnsembleNetwork::normalise_sequence(&mut followed.inputs, followed.width);
        }
        Ok(followed)
    }

    /// How plots of a radar become measurements.
    pub fn measure(
        &self,
        radar: &Radar,
        stated: bool,
    ) -> Result<impl Fn(&Vector2<f64>) -> Measurement<2>, FilterError> {
        let (converter, deviation) = (self.converter(radar, stated)?, self.config.deviation);
        Ok(move |plot: &Vector2<f64>| {
            let reading = converter.convert(plot);
            let measurement = Measurement::from(reading.value);
            match deviation {
                Some(_) => measurement,
                None => measurement.with_noise(reading.noise),
            }
        })
    }

    /// The sensor that such measurements are of.
    #[cfg(test)]
    pub fn sensor(&self) -> Position<2> {
        Position::new(self.config.deviation.unwrap_or(1.0)).unwrap()
    }

    fn converter(&self, radar: &Radar, stated: bool) -> Result<ConvertedPolar, FilterError> {
        let Accuracy { range, bearing } = self.config.nominal;
        let (range, bearing) =
            if stated { (radar.range(), radar.bearing()) } else { (range, bearing.to_radians()) };
        let converter = ConvertedPolar::new(range, bearing)?;
        Ok(match self.flights.conversion() {
            Conversion::Debiased => converter,
            Conversion::Plain => converter.biased(),
        })
    }
}

/// An ensemble of the same KalmanNets and inputs whose branches cost next to nothing: the data needs no
/// answers of theirs.
fn smallest(
    hyper: &EnsKNetsHyper,
    mut card: Card,
    nets: &BTreeMap<String, Stored>,
) -> Result<EnsembleNetwork, TrainError> {
    let unit = |branch: Option<BranchHyper>| branch.map(|_| BranchHyper { hidden: 1, layers: 1 });
    // What is normalised over whole flights is so here, once they are over.
    let normalisation = match hyper.normalisation {
        Normalisation::Relative => Normalisation::Relative,
        Normalisation::Running | Normalisation::Sequence => Normalisation::Running,
    };
    let (correction, classification) = (unit(hyper.correction), unit(hyper.classification));
    let hyper = EnsKNetsHyper { normalisation, correction, classification, ..hyper.clone() };
    card.hyper = hyper.to_table().map_err(TrainError::Recipe)?;
    let mut tensors = nets.clone();
    for (name, shape) in hyper.layers().iter().flat_map(|(name, shape)| shape.tensors(name)) {
        tensors.insert(name, Stored { values: vec![0.0; shape.iter().product()], shape });
    }
    Ok(EnsembleNetwork::from_model(&Model::new(card, tensors)?)?)
}

/// One flight.
#[derive(Debug)]
pub(super) struct Followed {
    width: usize,
    relative: bool,
    /// Steps since the last measurement.
    held: usize,
    /// Measurements after the first.
    pub rows: usize,
    /// What the branches see, a row for each measurement after the first.
    pub inputs: Vec<f32>,
    /// The steps after the first of those measurements.
    pub instants: Vec<Instant>,
    /// For each instant, what each KalmanNet's state is too much, in the frame of the last measurement's
    /// corrections.
    pub errors: Vec<[f32; 4]>,
}

/// One step of a flight.
#[derive(Debug, Clone, Copy)]
pub(super) struct Instant {
    /// Its number, from the first measurement of the flight, which is 0.
    pub step: usize,
    /// The row of the last measurement.
    pub row: usize,
    /// Steps since then.
    pub held: usize,
    /// What the aircraft does: 0 straight, 1 left, 2 right.
    pub manoeuvre: u8,
}

impl Followed {
    fn new(hyper: &EnsKNetsHyper) -> Self {
        let relative = hyper.normalisation == Normalisation::Relative;
        let (inputs, instants, errors) = (Vec::new(), Vec::new(), Vec::new());
        Self { width: hyper.inputs(), relative, held: 0, rows: 0, inputs, instants, errors }
    }

    fn see(&mut self, inputs: &[f32]) {
        self.inputs.extend_from_slice(inputs);
        (self.rows, self.held) = (self.rows + 1, 0);
    }

    /// Notes a step, after its measurement if it has one.
    fn expect(
        &mut self,
        filter: &EnsKNets<Position<2>>,
        belief: &EnsKNetsBelief,
        flight: &Flight,
        step: usize,
    ) {
        if self.rows == 0 {
            return;
        }
        let manoeuvre = flight.manoeuvres()[step].index() as u8;
        self.instants.push(Instant { step, row: self.rows - 1, held: self.held, manoeuvre });
        self.held += 1;
        let turn = if self.relative { sight(belief) } else { Matrix2::identity() };
        let truth = &flight.states()[step];
        for state in filter.net_states(belief) {
            self.errors.push(turned(&turn, &(state.mean - truth)));
        }
    }
}

/// The turn into the line of sight in which corrections are meant: to the mean of the KalmanNets after the
/// last measurement.
fn sight(belief: &EnsKNetsBelief) -> Matrix2<f64> {
    let mean: Vector4<f64> = belief.evidence().map(|evidence| evidence.state).sum();
    let range = mean.xy().norm();
    match range > 0.0 {
        true => Matrix2::new(mean[0], mean[1], -mean[1], mean[0]) / range,
        false => Matrix2::identity(),
    }
}

fn turned(turn: &Matrix2<f64>, state: &Vector4<f64>) -> [f32; 4] {
    let (position, velocity) = (turn * state.fixed_rows::<2>(0), turn * state.fixed_rows::<2>(2));
    [position[0], position[1], velocity[0], velocity[1]].map(|value| value as f32)
}
