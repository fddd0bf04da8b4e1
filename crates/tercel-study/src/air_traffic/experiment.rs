//! The studies `atc-test`, `atc-hshm`, `atc-noise`, `atc-missing` and `atc-ablation` as experiments.

use std::collections::BTreeMap;

use tercel_neural::shipped::Models;
use tercel_sim::air_traffic::{AirTraffic, Radar};

use super::methods::method;
use super::published::{PUBLISHED, PublishedFigures};
use super::score::{METRICS, score};
use super::{Method, Recording, example};
use crate::StudyError;
use crate::monte_carlo::{Attempt, Curve, Example, Experiment, Plan, Quantity, Sweep};
use crate::report::{Section, Table};
use crate::studies::options_of;

/// The seed of the published tables. It is reserved: nothing is tuned or trained on flights of this seed.
pub const SEED: u64 = 7919;

/// Range deviation of the sweeps, m.
const RANGE: f64 = 50.0;

/// Bearing deviation of the sweep over detection probabilities, degrees.
const BEARING: f64 = 0.5;

/// Methods that follow the flights of a population, each seen by its own radar or by one that a sweep sets.
pub struct AirTrafficExperiment {
    plan: Plan,
    population: AirTraffic,
    set: &'static str,
    /// The radar under each condition; none for the flight's own.
    radars: Vec<Option<Radar>>,
    methods: Vec<Box<dyn Method>>,
}

impl AirTrafficExperiment {
    /// The flights of a set (`atc-test` or `atc-hshm`), each seen by its own radar.
    ///
    /// # Errors
    /// When a method is not known.
    pub fn published(
        set: &'static str,
        seed: u64,
        runs: u64,
        methods: &[String],
        models: &Models,
    ) -> Result<Self, StudyError> {
        Self::new(set, (set, None, vec![None]), seed, runs, methods, models)
    }

    /// Flights of the population `atc-validation`, each seen by its own radar.
    ///
    /// # Errors
    /// When a method is not known.
    pub fn ablation(seed: u64, runs: u64, methods: &[String], models: &Models) -> Result<Self, StudyError> {
        Self::new("atc-validation", ("atc-ablation", None, vec![None]), seed, runs, methods, models)
    }

    /// The same flights, seen by radars with bearing deviations of 0.1 to 1 degrees.
    ///
    /// # Errors
    /// When a method is not known.
    pub fn noise(
        set: &'static str,
        seed: u64,
        runs: u64,
        methods: &[String],
        models: &Models,
    ) -> Result<Self, StudyError> {
        let sweep = Sweep {
            name: "bearing_deviation_deg".to_owned(),
            label: "Standard deviation of the bearing, degrees".to_owned(),
            values: (1..=10).map(|tenths| f64::from(tenths) / 10.0).collect(),
        };
        let radar = |degrees: &f64| Ok(Some(Radar::new(RANGE, degrees.to_radians())?));
        let radars = sweep.values.iter().map(radar).collect::<Result<_, StudyError>>()?;
        Self::new(set, ("atc-noise", Some(sweep), radars), seed, runs, methods, models)
    }

    /// The same flights, seen by radars that detect with a probability of 1 to 0.65.
    ///
    /// # Errors
    /// When a method is not known.
    pub fn missing(
        set: &'static str,
        seed: u64,
        runs: u64,
        methods: &[String],
        models: &Models,
    ) -> Result<Self, StudyError> {
        let sweep = Sweep {
            name: "detection".to_owned(),
            label: "Probability of detection".to_owned(),
            values: (0..=7).map(|steps| f64::from(100 - 5 * steps) / 100.0).collect(),
        };
        let radar =
            |chance: &f64| Ok(Some(Radar::new(RANGE, BEARING.to_radians())?.with_detection(*chance)?));
        let radars = sweep.values.iter().map(radar).collect::<Result<_, StudyError>>()?;
        Self::new(set, ("atc-missing", Some(sweep), radars), seed, runs, methods, models)
    }

    fn new(
        set: &'static str,
        (study, sweep, radars): (&str, Option<Sweep>, Vec<Option<Radar>>),
        seed: u64,
        runs: u64,
        names: &[String],
        models: &Models,
    ) -> Result<Self, StudyError> {
        let population = AirTraffic::named(set)
            .ok_or_else(|| StudyError::Option(format!("there is no population of flights `{set}`")))?;
        let methods = names.iter().map(|name| method(name, &population, models)).collect::<Result<_, _>>()?;
        let quantity = |(name, unit, shown): (&str, &str, bool)| Quantity {
            name: name.to_owned(),
            unit: unit.to_owned(),
            shown,
        };
        let short = set.trim_start_matches("atc-").to_owned();
        let set_option = sweep.as_ref().map(|_| ("set".to_owned(), short));
        let plan = Plan {
            study: study.to_owned(),
            seed,
            runs,
            options: set_option.into_iter().chain(options_of(models)).collect(),
            // A sweep is drawn over what it changes, not over time.
            curves: if sweep.is_some() { Vec::new() } else { curves(&population) },
            sweep,
            methods: names.to_vec(),
            metrics: METRICS.map(quantity).to_vec(),
        };
        Ok(AirTrafficExperiment { plan, population, set, radars, methods })
    }

    /// A flight under a condition.
    fn recording(&self, condition: usize, run: u64) -> Recording {
        match self.radars[condition] {
            None => Recording::new(&self.population, self.plan.seed, run),
            Some(radar) => {
                let flight = self.population.flight(self.plan.seed, run);
                Recording::with_radar(flight, radar, self.plan.seed, run)
            }
        }
    }
}

fn curves(population: &AirTraffic) -> Vec<Curve> {
    let x: Vec<f64> = (0..population.steps()).map(|step| step as f64 * population.interval()).collect();
    let curve = |title: &str, unit: &str| Curve {
        title: title.to_owned(),
        unit: unit.to_owned(),
        abscissa: "Time, s".to_owned(),
        x: x.clone(),
        root: true,
    };
    vec![
        curve("Position error over time (element RMSE)", "m"),
        curve("Velocity error over time (element RMSE)", "m/s"),
    ]
}

/// All published rows of a set, whether the method is here or not.
fn published_table(set: &str) -> Table {
    let columns = ["method", "rmse_all", "rmse_pos, m", "rmse_vel, m/s", "accuracy, %"];
    let heading = format!("Published figures (mean ± std), {set}");
    let pair = |(mean, std): (f64, f64)| format!("{mean} ± {std}");
    PUBLISHED.iter().filter(|row| row.set == set).fold(Table::new(heading, columns), |table, row| {
        let accuracy = row.accuracy.map_or("-".to_owned(), pair);
        table.with_row([
            row.method.to_owned(),
            pair(row.rmse_all),
            pair(row.rmse_pos),
            pair(row.rmse_vel),
            accuracy,
        ])
    })
}

impl Experiment for AirTrafficExperiment {
    fn plan(&self) -> &Plan {
        &self.plan
    }

    fn run(&self, condition: usize, run: u64) -> Vec<Attempt> {
        let recording = self.recording(condition, run);
        let steps = recording.plots.len() as u64;
        let attempt = |method: &dyn Method| {
            Attempt::of(steps, || method.follow(&recording), |estimates| score(&recording, &estimates))
        };
        self.methods.iter().map(|method| attempt(&**method)).collect()
    }

    fn published(&self, method: &str, _condition: usize) -> Option<BTreeMap<String, f64>> {
        // The sweeps were published as plots without numbers.
        let tables = self.plan.sweep.is_none();
        PublishedFigures::of(method, self.set).filter(|_| tables).map(PublishedFigures::means)
    }

    fn sections(&self) -> Vec<Section> {
        vec![published_table(self.set).into()]
    }

    fn example(&self) -> Result<Option<Example>, StudyError> {
        if self.plan.runs == 0 {
            return Ok(None);
        }
        // The middle of a sweep shows most.
        let condition = self.plan.conditions() / 2;
        let recording = self.recording(condition, 0);
        let names = self.plan.methods.iter().zip(&self.methods);
        let followed: Vec<_> = names
            .filter_map(|(name, method)| Some((name.as_str(), method.follow(&recording).ok()?)))
            .collect();
        let at = self.plan.at(condition).map(|(name, value)| format!(", {name} {value}"));
        let title = format!("Flight 0 of {}{}", self.set, at.unwrap_or_default());
        example::draw(&recording, title, &followed).map(Some)
    }
}
