//! The study `paris` as an experiment.

use super::Traffic;
use super::methods::method;
use super::traffic::{INTERVAL, STEPS};
use crate::StudyError;
use crate::clutter::{Method, drawn, plan_of, score};
use crate::monte_carlo::{Attempt, Example, Experiment, Plan};
use crate::studies::{Request, options_of};

/// The seed of the published tables.
pub const SEED: u64 = 7919;

/// Distance beyond which a track has nothing to do with an aircraft, m: some five deviations of a far bearing.
pub const CUTOFF: f64 = 1000.0;

/// Methods that follow the aircraft of recorded windows.
pub struct ParisExperiment {
    plan: Plan,
    traffic: Traffic,
    methods: Vec<Box<dyn Method>>,
}

impl ParisExperiment {
    /// The windows of the data of a request: each once, unless more runs are asked for.
    ///
    /// # Errors
    /// When the data cannot be read, or a method is not known.
    pub(crate) fn new(request: &Request<'_>) -> Result<Self, StudyError> {
        // The study asks for data before it is built.
        let path = request.data.unwrap_or(std::path::Path::new(""));
        let traffic = Traffic::read(path)?;
        let runs = if request.chosen_runs { request.runs } else { traffic.windows() };
        let data = ("data".to_owned(), path.display().to_string());
        let options = options_of(request.models).chain([data]).collect();
        let times = (0..STEPS).map(|step| step as f64 * INTERVAL);
        let plan = plan_of("paris", (request.seed, runs), options, request.methods, times);
        let methods = request.methods.iter().map(|name| method(name, request.models));
        let methods = methods.collect::<Result<_, _>>()?;
        Ok(ParisExperiment { plan, traffic, methods })
    }
}

impl Experiment for ParisExperiment {
    fn plan(&self) -> &Plan {
        &self.plan
    }

    fn run(&self, _condition: usize, run: u64) -> Vec<Attempt> {
        let recording = self.traffic.recording(self.plan.seed, run);
        let steps = recording.scans.len() as u64;
        let attempt = |method: &dyn Method| {
            let judge = |reported: Vec<_>| score(&recording, &reported, CUTOFF);
            Attempt::of(steps, || method.follow(&recording), judge)
        };
        self.methods.iter().map(|method| attempt(&**method)).collect()
    }

    fn example(&self) -> Result<Option<Example>, StudyError> {
        let recording = self.traffic.recording(self.plan.seed, 0);
        drawn(&self.plan, &recording, &self.methods, "The first ten minutes")
    }
}
