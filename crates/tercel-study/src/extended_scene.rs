//! The study `extended-scene`: extended objects that cross among false points, in trackers of many objects.

mod example;
mod methods;
mod score;

use std::collections::BTreeMap;

use nalgebra::Matrix2;
use tercel_sim::extended::{Crossing, CrossingScene, Scatterers};

use self::methods::{Method, method};
use self::score::{METRICS, score};
use crate::StudyError;
use crate::monte_carlo::{Attempt, Curve, Example, Experiment, Plan, Quantity};
use crate::studies::Request;

pub use self::methods::METHODS;

/// The seed of the tables. It is reserved: nothing is tuned on scenes of this seed.
pub const SEED: u64 = 7919;

/// Trackers of extended objects on simulated crossings.
pub struct ExtendedSceneExperiment {
    plan: Plan,
    scene: Crossing,
    methods: Vec<Box<dyn Method>>,
}

/// Mean number of points of an object, and the deviation of the sensor noise, m.
const POINTS: (f64, f64) = (12.0, 0.5);

impl ExtendedSceneExperiment {
    pub(crate) fn new(request: &Request<'_>) -> Result<Self, StudyError> {
        let noise = Matrix2::identity() * (POINTS.1 * POINTS.1);
        let scene = Crossing::new(Scatterers::new(POINTS.0, noise)?);
        let methods = request.methods.iter().map(|name| method(name, &scene)).collect::<Result<_, _>>()?;
        let quantity = |(name, unit): (&str, &str)| Quantity {
            name: name.to_owned(),
            unit: unit.to_owned(),
            shown: true,
        };
        let x: Vec<f64> = (0..scene.steps()).map(|step| step as f64).collect();
        let curve = |title: &str, unit: &str| Curve {
            title: title.to_owned(),
            unit: unit.to_owned(),
            abscissa: "Time, s".to_owned(),
            x: x.clone(),
            root: false,
        };
        let plan = Plan {
            study: "extended-scene".to_owned(),
            seed: request.seed,
            runs: request.runs,
            options: BTreeMap::new(),
            sweep: None,
            methods: request.methods.to_vec(),
            metrics: METRICS.map(quantity).to_vec(),
            curves: vec![curve("GOSPA over time", "m"), curve("Confirmed tracks over time", "")],
        };
        Ok(ExtendedSceneExperiment { plan, scene, methods })
    }
}

impl Experiment for ExtendedSceneExperiment {
    fn plan(&self) -> &Plan {
        &self.plan
    }

    fn run(&self, _condition: usize, run: u64) -> Vec<Attempt> {
        let scene: CrossingScene = self.scene.draw(self.plan.seed, run);
        let steps = scene.scans.len() as u64;
        let attempt = |method: &dyn Method| {
            Attempt::of(steps, || method.follow(&scene.scans), |reports| score(&scene.rides, &reports))
        };
        self.methods.iter().map(|method| attempt(&**method)).collect()
    }

    fn example(&self) -> Result<Option<Example>, StudyError> {
        if self.plan.runs == 0 {
            return Ok(None);
        }
        let scene = self.scene.draw(self.plan.seed, 0);
        let names = self.plan.methods.iter().zip(&self.methods);
        let followed: Vec<_> = names
            .filter_map(|(name, method)| Some((name.as_str(), method.follow(&scene.scans).ok()?)))
            .collect();
        example::draw(&scene, format!("Scene 0 of {}", self.plan.study), &followed).map(Some)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trackers_of_cells_find_three_crossing_objects_and_their_size() {
        let methods = METHODS.map(str::to_owned);
        let request = Request {
            set: "",
            seed: 11,
            runs: 1,
            chosen_runs: true,
            methods: &methods,
            options: BTreeMap::new(),
            data: None,
            models: &tercel_neural::shipped::Models::default(),
        };
        let experiment = ExtendedSceneExperiment::new(&request).unwrap();
        let attempts = experiment.run(0, 0);
        let figures: Vec<_> = attempts.into_iter().map(|attempt| attempt.outcome.unwrap().metrics).collect();
        for (name, figures) in METHODS.iter().zip(&figures) {
            assert!(figures[0] < 25.0, "{name}: GOSPA {}", figures[0]);
        }
        for (name, figures) in METHODS.iter().zip(&figures).take(4) {
            assert!(figures[4] > 0.5, "{name}: IoU {}", figures[4]);
        }
    }
}
