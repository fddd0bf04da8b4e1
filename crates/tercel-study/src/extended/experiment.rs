//! The studies `vehicle` and `aircraft` as experiments.

use std::collections::BTreeMap;

use tercel_core::motion::Kinematics;
use tercel_neural::shipped::Models;
use tercel_sim::extended::{Generator, Heading, Sizes, Vehicle};

use super::methods::{DATA_MODELS, method};
use super::published::{PUBLISHED, PublishedRow};
use super::score::{METRICS, score};
use super::settings::Settings;
use super::{Aircraft, Held, Method, Recording, Scene, example};
use crate::StudyError;
use crate::monte_carlo::{Attempt, Curve, Example, Experiment, Plan, Quantity, Sweep};
use crate::report::{Section, Table};
use crate::studies::{Request, options_of};

/// The seed of the published tables. It is reserved: nothing is tuned or trained on recordings of this seed.
pub const SEED: u64 = 7919;

/// Tracks on which the publication tests.
const PUBLISHED_TRACKS: usize = 52;

/// Methods that follow extended objects.
pub struct ExtendedExperiment {
    plan: Plan,
    scene: Scene,
    /// The methods under each condition.
    methods: Vec<Vec<Box<dyn Method>>>,
}

impl ExtendedExperiment {
    /// The study of this name over a scene. `options` says in the tables what was chosen of it, and
    /// `settings` are the numbers to which filters are tuned, under each condition.
    ///
    /// # Errors
    /// When a method is not known.
    fn new(
        study: &'static str,
        scene: Scene,
        settings: &[Settings],
        options: BTreeMap<String, String>,
        (seed, runs): (u64, u64),
        (names, models): (&[String], &Models),
    ) -> Result<Self, StudyError> {
        let under = |settings: &Settings| -> Result<_, StudyError> {
            names.iter().map(|name| method(study, name, settings, models)).collect()
        };
        let methods = settings.iter().map(under).collect::<Result<_, _>>()?;
        let quantity = |(name, unit, shown): (&str, &str, bool)| Quantity {
            name: name.to_owned(),
            unit: unit.to_owned(),
            shown,
        };
        let plan = Plan {
            study: study.to_owned(),
            seed,
            runs,
            options: options.into_iter().chain(options_of(models)).collect(),
            sweep: None,
            methods: names.to_vec(),
            metrics: METRICS.map(quantity).to_vec(),
            curves: curves(&scene),
        };
        Ok(ExtendedExperiment { plan, scene, methods })
    }

    /// The study `vehicle`.
    pub(crate) fn vehicle(request: &Request<'_>) -> Result<Self, StudyError> {
        let chosen = |name: &str| request.options.get(name).map_or("", String::as_str);
        let (generator, settings) = match chosen("generator") {
            "smooth" => (Generator::Smooth, Settings::SMOOTH),
            "l1" => (Generator::L1, Settings::L1),
            _ => (Generator::Reject, Settings::REJECT),
        };
        let kinematics = if request.set == "forward" { Kinematics::Forward } else { Kinematics::Backward };
        let mut vehicle = Vehicle::new(generator).with_kinematics(kinematics);
        let mut settings = settings;
        if chosen("sizes") == "random" {
            vehicle = vehicle.with_sizes(Sizes::MIXED)?;
            settings = settings.for_mixed_sizes();
        }
        let mut options = request.options.clone();
        options.insert("set".to_owned(), request.set.to_owned());
        let drawn = (request.seed, request.runs);
        Self::new(
            "vehicle",
            Scene::Vehicle(vehicle),
            &[settings],
            options,
            drawn,
            (request.methods, request.models),
        )
    }

    /// The study `vehicle-ablation`: what the blocks of RMMNet are worth.
    pub(crate) fn ablation(request: &Request<'_>) -> Result<Self, StudyError> {
        let scene = Scene::Vehicle(Vehicle::new(Generator::Reject));
        let drawn = (request.seed, request.runs);
        let chosen = (request.methods, request.models);
        Self::new("vehicle-ablation", scene, &[Settings::REJECT], BTreeMap::new(), drawn, chosen)
    }

    /// The study `vehicle-data`: how much networks must have seen.
    pub(crate) fn data(request: &Request<'_>) -> Result<Self, StudyError> {
        let scene = Scene::Vehicle(Vehicle::new(Generator::Reject));
        let drawn = (request.seed, request.runs);
        let chosen = (request.methods, request.models);
        let settings = DATA_MODELS.map(|(_, [lstm, transformer, rmmnet])| Settings {
            lstm,
            transformer,
            rmmnet,
            ..Settings::REJECT
        });
        let first = Self::new("vehicle-data", scene, &settings, BTreeMap::new(), drawn, chosen)?;
        let sweep = Sweep {
            name: "trajectories".to_owned(),
            label: "Vehicles to learn from".to_owned(),
            values: DATA_MODELS.map(|(count, _)| f64::from(count)).to_vec(),
        };
        // A sweep is drawn over what it changes, not over time.
        let plan = Plan { sweep: Some(sweep), curves: Vec::new(), ..first.plan };
        Ok(ExtendedExperiment { plan, ..first })
    }

    /// The study `aircraft-random`: `aircraft` with other tracks to test on.
    pub(crate) fn aircraft_random(request: &Request<'_>) -> Result<Self, StudyError> {
        let settings = Settings { rmmnet: "rmmnet-aircraft-random", ..Settings::AIRCRAFT };
        Self::on_tracks("aircraft-random", Held::Random, settings, request)
    }

    /// The study `aircraft`.
    pub(crate) fn aircraft(request: &Request<'_>) -> Result<Self, StudyError> {
        Self::on_tracks("aircraft", Held::Last, Settings::AIRCRAFT, request)
    }

    fn on_tracks(
        study: &'static str,
        held: Held,
        settings: Settings,
        request: &Request<'_>,
    ) -> Result<Self, StudyError> {
        let heading = match request.set {
            "smoothed" => Heading::Smoothed,
            "crab" => Heading::Crab,
            _ => Heading::Course,
        };
        // The study asks for data before it is built.
        let path = request.data.unwrap_or(std::path::Path::new(""));
        let aircraft = Aircraft::test(path, heading, held)?;
        let aircraft = if request.set == "even" { aircraft.evened() } else { aircraft };
        let count = aircraft.count() as u64;
        if request.chosen_runs && request.runs > count {
            let runs = request.runs;
            return Err(StudyError::Option(format!(
                "there are {count} tracks to test on, too few for {runs} runs"
            )));
        }
        let set = ("set".to_owned(), request.set.to_owned());
        let data = ("data".to_owned(), path.display().to_string());
        let drawn = (request.seed, request.runs.min(count));
        let scene = Scene::Aircraft(aircraft);
        Self::new(study, scene, &[settings], [set, data].into(), drawn, (request.methods, request.models))
    }

    /// Whether the scenes are those of the publication, as far as it describes them.
    fn is_published(&self) -> bool {
        match &self.scene {
            Scene::Vehicle(_) => self.plan.options.get("sizes").is_none_or(|sizes| sizes == "fixed"),
            Scene::Aircraft(aircraft) => aircraft.count() == PUBLISHED_TRACKS,
        }
    }

    fn record(&self, run: u64) -> Result<Recording, StudyError> {
        self.scene.record(self.plan.seed, run)
    }
}

fn curves(scene: &Scene) -> Vec<Curve> {
    let x: Vec<f64> = (0..scene.steps()).map(|step| step as f64 * scene.interval()).collect();
    let curve = |title: &str, unit: &str, root: bool| Curve {
        title: title.to_owned(),
        unit: unit.to_owned(),
        abscissa: "Time, s".to_owned(),
        x: x.clone(),
        root,
    };
    vec![
        curve("Position error over time (element RMSE)", "m", true),
        curve("Intersection over union, over time", "", false),
        curve("Squared Gaussian Wasserstein distance over time", "m²", false),
    ]
}

/// All published rows of a study, whether the method is here or not.
fn published_table(study: &str) -> Table {
    let columns = ["method", "rmse_pos, m", "rmse_vel, m/s", "iou", "gwd, m²"];
    let heading = "Published figures (RMMNet paper)".to_owned();
    PUBLISHED.iter().filter(|row| row.study == study).fold(Table::new(heading, columns), |table, row| {
        table.with_row([
            row.method.to_owned(),
            row.rmse_pos.to_string(),
            row.rmse_vel.to_string(),
            row.iou.to_string(),
            row.gwd.to_string(),
        ])
    })
}

impl Experiment for ExtendedExperiment {
    fn plan(&self) -> &Plan {
        &self.plan
    }

    fn run(&self, condition: usize, run: u64) -> Vec<Attempt> {
        match self.record(run) {
            Ok(recording) => {
                let steps = recording.scans.len() as u64;
                let attempt = |method: &dyn Method| {
                    Attempt::of(
                        steps,
                        || method.follow(&recording),
                        |estimates| score(&recording, &estimates),
                    )
                };
                self.methods[condition].iter().map(|method| attempt(&**method)).collect()
            }
            Err(error) => {
                let failed =
                    || Attempt { outcome: Err(error.to_string()), time: Default::default(), steps: 0 };
                self.plan.methods.iter().map(|_| failed()).collect()
            }
        }
    }

    fn published(&self, method: &str, _condition: usize) -> Option<BTreeMap<String, f64>> {
        PublishedRow::of(method, &self.plan.study).filter(|_| self.is_published()).map(PublishedRow::figures)
    }

    fn sections(&self) -> Vec<Section> {
        let published = PUBLISHED.iter().any(|row| row.study == self.plan.study);
        published.then(|| published_table(&self.plan.study).into()).into_iter().collect()
    }

    fn example(&self) -> Result<Option<Example>, StudyError> {
        if self.plan.runs == 0 {
            return Ok(None);
        }
        let recording = self.record(0)?;
        // The last condition shows most.
        let names = self.plan.methods.iter().zip(self.methods.last().into_iter().flatten());
        let followed: Vec<_> = names
            .filter_map(|(name, method)| Some((name.as_str(), method.follow(&recording).ok()?)))
            .collect();
        example::draw(&recording, format!("Recording 0 of {}", self.plan.study), &followed).map(Some)
    }
}
