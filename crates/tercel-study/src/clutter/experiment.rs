//! The studies `clutter-partial`, `clutter-all` and `clutter-random` as experiments.

use std::collections::BTreeMap;

use tercel_neural::shipped::Models;
use tercel_sim::clutter::Scenario;

use super::methods::method;
use super::score::{CURVES, CUTOFF, METRICS, score};
use super::{Method, Recording, example, recovery};
use crate::StudyError;
use crate::monte_carlo::{Attempt, Curve, Example, Experiment, Plan, Quantity, Results};
use crate::report::{Section, Table};
use crate::studies::options_of;

/// The seed of the published tables. It is reserved: nothing is tuned or trained on scenes of this seed.
pub const SEED: u64 = 7919;

/// Where the motion of `clutter-all` jumps, and the scan up to which a recovery is looked for.
const JUMPS: [(usize, usize); 2] = [(40, 50), (60, 80)];

/// Methods that follow the objects of a scenario.
pub struct ClutterExperiment {
    plan: Plan,
    scenario: Scenario,
    methods: Vec<Box<dyn Method>>,
}

impl ClutterExperiment {
    /// The scenes of a scenario, one of [`NAMES`](tercel_sim::clutter::NAMES), which is also the name of the study.
    ///
    /// # Errors
    /// When the scenario or a method is not known.
    pub fn new(
        name: &str,
        seed: u64,
        runs: u64,
        methods: &[String],
        models: &Models,
    ) -> Result<Self, StudyError> {
        let scenario = Scenario::named(name)
            .ok_or_else(|| StudyError::Option(format!("there is no scenario `{name}`")))?;
        let times = (0..scenario.steps()).map(|step| step as f64);
        let plan = plan_of(name, (seed, runs), options_of(models).collect(), methods, times);
        let methods = methods.iter().map(|name| method(name, models)).collect::<Result<_, _>>()?;
        Ok(ClutterExperiment { plan, scenario, methods })
    }

    fn recording(&self, run: u64) -> Recording {
        Recording::new(&self.scenario, self.plan.seed, run)
    }
}

impl Experiment for ClutterExperiment {
    fn plan(&self) -> &Plan {
        &self.plan
    }

    fn run(&self, _condition: usize, run: u64) -> Vec<Attempt> {
        let recording = self.recording(run);
        let steps = recording.scans.len() as u64;
        let attempt = |method: &dyn Method| {
            Attempt::of(steps, || method.follow(&recording), |reported| score(&recording, &reported, CUTOFF))
        };
        self.methods.iter().map(|method| attempt(&**method)).collect()
    }

    /// How many scans the error of each method takes to fall back after the jumps of `clutter-all`.
    fn conclusions(&self, results: &Results) -> Vec<Section> {
        if self.scenario != Scenario::All {
            return Vec::new();
        }
        let heading = "Scans until the mean error is back within 20 % of its level before a jump";
        let mut table = Table::new(heading, ["method", "jump at 40 s", "jump at 60 s"]);
        for (number, name) in self.plan.methods.iter().enumerate() {
            let Some(cell) = results.cell(0, number) else { continue };
            let curve: Vec<f64> = cell.curves[0].iter().map(|sum| sum.mean().unwrap_or(f64::NAN)).collect();
            let scans = JUMPS.map(|(jump, end)| {
                recovery(&curve, jump, end).map_or("-".to_owned(), |scans| scans.to_string())
            });
            table = table.with_row([name.clone()].into_iter().chain(scans));
        }
        vec![table.into()]
    }

    fn example(&self) -> Result<Option<Example>, StudyError> {
        if self.plan.runs == 0 {
            return Ok(None);
        }
        let title = format!("Scene 0 of {}", self.plan.study);
        drawn(&self.plan, &self.recording(0), &self.methods, &title)
    }
}

/// The plan of a study whose methods report the objects of scenes: seed and number of runs, options, methods, and the times of the
/// scans.
pub(crate) fn plan_of(
    study: &str,
    (seed, runs): (u64, u64),
    options: BTreeMap<String, String>,
    methods: &[String],
    times: impl Iterator<Item = f64>,
) -> Plan {
    let times: Vec<f64> = times.collect();
    let quantity = |(name, unit, shown): (&str, &str, bool)| Quantity {
        name: name.to_owned(),
        unit: unit.to_owned(),
        shown,
    };
    let curve = |(title, unit): (&str, &str)| Curve {
        title: title.to_owned(),
        unit: unit.to_owned(),
        abscissa: "Time, s".to_owned(),
        x: times.clone(),
        root: false,
    };
    Plan {
        study: study.to_owned(),
        seed,
        runs,
        options,
        sweep: None,
        methods: methods.to_vec(),
        metrics: METRICS.map(quantity).to_vec(),
        curves: CURVES.map(curve).to_vec(),
    }
}

/// A recording drawn with what every method made of it.
pub(crate) fn drawn(
    plan: &Plan,
    recording: &Recording,
    methods: &[Box<dyn Method>],
    title: &str,
) -> Result<Option<Example>, StudyError> {
    let names = plan.methods.iter().zip(methods);
    let followed: Vec<_> =
        names.filter_map(|(name, method)| Some((name.as_str(), method.follow(recording).ok()?))).collect();
    example::draw(recording, title.to_owned(), &followed).map(Some)
}
