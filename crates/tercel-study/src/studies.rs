//! The studies by name.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use tercel_neural::Model;
use tercel_neural::shipped::Models;

use crate::air_traffic::{self, AirTrafficExperiment};
use crate::autoferry;
use crate::clutter::{self, ClutterExperiment};
use crate::error::StudyError;
use crate::extended::{self, ExtendedExperiment};
use crate::extended_scene::{self, ExtendedSceneExperiment};
use crate::monte_carlo::{Experiment, Plan};
use crate::paris::{self, ParisExperiment};

/// A study that can be run by its name.
///
/// ```
/// use tercel_study::studies::{Choice, Study};
///
/// let study = Study::find("atc-test")?;
/// let choice = Choice { runs: Some(20), methods: Some(vec!["measurement".into()]), ..Choice::default() };
/// assert_eq!(study.experiment(&choice)?.plan().runs, 20);
/// # Ok::<(), tercel_study::StudyError>(())
/// ```
#[derive(Debug)]
pub struct Study {
    /// Its name.
    pub name: &'static str,
    /// What it is about, in half a sentence.
    pub about: &'static str,
    /// The methods that it compares, in the order in which they are best read.
    pub methods: &'static [&'static str],
    /// Whether its scenes are recordings or are drawn.
    pub kind: Kind,
}

/// Where the scenes of a study come from.
#[derive(Debug)]
pub enum Kind {
    /// From recordings: there is a folder of data, and nothing is drawn.
    Recordings,
    /// From a seed.
    MonteCarlo(MonteCarlo),
}

/// A study whose scenes are drawn.
#[derive(Debug)]
pub struct MonteCarlo {
    /// The seed unless another is chosen.
    pub seed: u64,
    /// The number of runs unless another is chosen; at most that, where data have fewer scenes.
    pub runs: u64,
    /// The sets of scenes among which can be chosen, the default first; none when there is nothing to choose.
    pub sets: &'static [&'static str],
    /// What else can be chosen.
    pub options: &'static [Selection],
    /// Whether its scenes are drawn around recorded data, which must be named.
    pub data: bool,
    build: fn(&Request<'_>) -> Result<Box<dyn Experiment>, StudyError>,
}

impl MonteCarlo {
    /// A study with nothing to choose but seed and number of runs.
    const fn new(
        seed: u64,
        runs: u64,
        build: fn(&Request<'_>) -> Result<Box<dyn Experiment>, StudyError>,
    ) -> Self {
        MonteCarlo { seed, runs, sets: &[], options: &[], data: false, build }
    }

    /// A study of airliners on recorded tracks.
    const fn on_tracks(build: fn(&Request<'_>) -> Result<Box<dyn Experiment>, StudyError>) -> Self {
        let sets = &["course", "smoothed", "crab", "even"];
        MonteCarlo { sets, data: true, ..MonteCarlo::new(extended::SEED, 52, build) }
    }
}

/// Something of which a study has several kinds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Selection {
    /// Its name, as that of an option.
    pub name: &'static str,
    /// The kinds, the default first.
    pub values: &'static [&'static str],
}

/// What may be chosen about a study whose scenes are drawn; what is not chosen is as the study has it.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Choice {
    /// Seed of the random numbers.
    pub seed: Option<u64>,
    /// Number of runs.
    pub runs: Option<u64>,
    /// Names of methods.
    pub methods: Option<Vec<String>>,
    /// Name of a set of scenes.
    pub set: Option<String>,
    /// Of what a study has several kinds, by name.
    pub options: BTreeMap<String, String>,
    /// File or folder of the data around which scenes are drawn.
    pub data: Option<PathBuf>,
    /// Files of models that take the place of shipped ones, by the name of those.
    pub models: BTreeMap<String, PathBuf>,
}

/// A choice that was made.
pub(crate) struct Request<'a> {
    pub set: &'a str,
    pub seed: u64,
    pub runs: u64,
    /// Whether the number of runs was asked for.
    pub chosen_runs: bool,
    pub methods: &'a [String],
    /// The kinds of everything of which there are several.
    pub options: BTreeMap<String, String>,
    pub data: Option<&'a Path>,
    /// The models of the learned methods.
    pub models: &'a Models,
}

impl Request<'_> {
    /// The population of flights of this set.
    fn flights(&self) -> &'static str {
        if self.set == "hshm" { "atc-hshm" } else { "atc-test" }
    }
}

fn boxed<E: Experiment + 'static>(
    experiment: Result<E, StudyError>,
) -> Result<Box<dyn Experiment>, StudyError> {
    Ok(Box::new(experiment?))
}

/// All studies.
pub const STUDIES: [Study; 16] = [
    Study {
        name: "atc-test",
        about: "one aircraft that turns, seen by a radar: the published test set (Table 3)",
        methods: &air_traffic::methods::METHODS,
        kind: Kind::MonteCarlo(MonteCarlo::new(air_traffic::SEED, 1000, |r| {
            boxed(AirTrafficExperiment::published("atc-test", r.seed, r.runs, r.methods, r.models))
        })),
    },
    Study {
        name: "atc-hshm",
        about: "the same at high speed with hard turns (Table 5)",
        methods: &air_traffic::methods::METHODS,
        kind: Kind::MonteCarlo(MonteCarlo::new(air_traffic::SEED, 1000, |r| {
            boxed(AirTrafficExperiment::published("atc-hshm", r.seed, r.runs, r.methods, r.models))
        })),
    },
    Study {
        name: "atc-noise",
        about: "errors over the bearing noise of the radar, 0.1 to 1 degrees",
        methods: &air_traffic::methods::METHODS,
        kind: Kind::MonteCarlo(MonteCarlo {
            sets: &["test", "hshm"],
            ..MonteCarlo::new(air_traffic::SEED, 200, |r| {
                boxed(AirTrafficExperiment::noise(r.flights(), r.seed, r.runs, r.methods, r.models))
            })
        }),
    },
    Study {
        name: "atc-missing",
        about: "errors over the detection probability of the radar, 1 to 0.65",
        methods: &air_traffic::methods::METHODS,
        kind: Kind::MonteCarlo(MonteCarlo {
            sets: &["test", "hshm"],
            ..MonteCarlo::new(air_traffic::SEED, 200, |r| {
                boxed(AirTrafficExperiment::missing(r.flights(), r.seed, r.runs, r.methods, r.models))
            })
        }),
    },
    Study {
        name: "atc-ablation",
        about: "what the parts of the published ensemble are worth, on validation flights (Table 2)",
        methods: &air_traffic::methods::ABLATION,
        kind: Kind::MonteCarlo(MonteCarlo::new(air_traffic::SEED, 1000, |r| {
            boxed(AirTrafficExperiment::ablation(r.seed, r.runs, r.methods, r.models))
        })),
    },
    Study {
        name: "vehicle",
        about: "one vehicle seen as many points: motion and ellipse (RMMNet paper, Table I)",
        methods: &extended::methods::VEHICLE_METHODS,
        kind: Kind::MonteCarlo(MonteCarlo {
            sets: &["backward", "forward"],
            options: &[
                Selection { name: "generator", values: &["reject", "l1", "smooth"] },
                Selection { name: "sizes", values: &["fixed", "random"] },
            ],
            ..MonteCarlo::new(extended::SEED, 40, |r| boxed(ExtendedExperiment::vehicle(r)))
        }),
    },
    Study {
        name: "vehicle-ablation",
        about: "what the blocks of RMMNet are worth, on the vehicles of the study vehicle (Table III)",
        methods: &extended::methods::ABLATION,
        kind: Kind::MonteCarlo(MonteCarlo::new(extended::SEED, 40, |r| {
            boxed(ExtendedExperiment::ablation(r))
        })),
    },
    Study {
        name: "vehicle-data",
        about: "how many vehicles networks must have seen (Fig. 5)",
        methods: &extended::methods::DATA_METHODS,
        kind: Kind::MonteCarlo(MonteCarlo::new(extended::SEED, 40, |r| boxed(ExtendedExperiment::data(r)))),
    },
    Study {
        name: "aircraft",
        about: "airliners on recorded tracks, seen as many points (RMMNet paper, Table II)",
        methods: &extended::methods::AIRCRAFT_METHODS,
        kind: Kind::MonteCarlo(MonteCarlo::on_tracks(|r| boxed(ExtendedExperiment::aircraft(r)))),
    },
    Study {
        name: "aircraft-random",
        about: "the same with tracks to test on that are drawn from all",
        methods: &extended::methods::RANDOM_METHODS,
        kind: Kind::MonteCarlo(MonteCarlo::on_tracks(|r| boxed(ExtendedExperiment::aircraft_random(r)))),
    },
    Study {
        name: "extended-scene",
        about: "three extended objects that cross among false points, in trackers of many objects",
        methods: &extended_scene::METHODS,
        kind: Kind::MonteCarlo(MonteCarlo::new(extended_scene::SEED, 50, |r| {
            boxed(ExtendedSceneExperiment::new(r))
        })),
    },
    Study {
        name: "clutter-partial",
        about: "nine objects in dense clutter, two of which manoeuvre (Figs. 2 and 3)",
        methods: &clutter::methods::METHODS,
        kind: Kind::MonteCarlo(MonteCarlo::new(clutter::SEED, 100, |r| {
            boxed(ClutterExperiment::new("clutter-partial", r.seed, r.runs, r.methods, r.models))
        })),
    },
    Study {
        name: "clutter-all",
        about: "six objects in clutter that all manoeuvre at once (Figs. 4 and 5)",
        methods: &clutter::methods::METHODS,
        kind: Kind::MonteCarlo(MonteCarlo::new(clutter::SEED, 100, |r| {
            boxed(ClutterExperiment::new("clutter-all", r.seed, r.runs, r.methods, r.models))
        })),
    },
    Study {
        name: "clutter-random",
        about: "random scenes of 5 to 12 objects that come, go and manoeuvre in clutter",
        methods: &clutter::methods::METHODS,
        kind: Kind::MonteCarlo(MonteCarlo::new(clutter::SEED, 100, |r| {
            boxed(ClutterExperiment::new("clutter-random", r.seed, r.runs, r.methods, r.models))
        })),
    },
    Study {
        name: "paris",
        about: "aircraft around Paris as they flew, seen by a simulated radar in clutter",
        methods: &paris::methods::METHODS,
        kind: Kind::MonteCarlo(MonteCarlo {
            data: true,
            ..MonteCarlo::new(paris::SEED, 17, |r| boxed(ParisExperiment::new(r)))
        }),
    },
    Study {
        name: autoferry::NAME,
        about: "radar and lidar of a small ferry against the GNSS truth of two boats",
        methods: &autoferry::METHODS,
        kind: Kind::Recordings,
    },
];

impl Study {
    /// The study of that name.
    ///
    /// # Errors
    /// When there is none; the message lists all, and the one that may have been meant.
    pub fn find(name: &str) -> Result<&'static Study, StudyError> {
        static ALL: &[Study] = &STUDIES;
        ALL.iter().find(|study| study.name == name).ok_or_else(|| {
            let names = STUDIES.map(|study| study.name);
            StudyError::Unknown { name: name.to_owned(), known: listed(name, &names) }
        })
    }

    /// The chosen methods, or all.
    ///
    /// # Errors
    /// When the study has no such method, or one is chosen twice.
    pub fn methods(&self, chosen: Option<&[String]>) -> Result<Vec<String>, StudyError> {
        let all = || self.methods.iter().map(|name| (*name).to_owned()).collect();
        let methods: Vec<String> = chosen.map_or_else(all, <[String]>::to_vec);
        for (place, name) in methods.iter().enumerate() {
            if !self.methods.contains(&name.as_str()) {
                let known = listed(name, self.methods);
                return Err(StudyError::UnknownMethod { study: self.name, name: name.clone(), known });
            }
            if methods[..place].contains(name) {
                return Err(StudyError::Option(format!("the method `{name}` is named twice")));
            }
        }
        Ok(methods)
    }

    /// The experiment of a study whose scenes are drawn.
    ///
    /// # Errors
    /// When the study does not have what was chosen, or its scenes are not drawn.
    pub fn experiment(&self, choice: &Choice) -> Result<Box<dyn Experiment>, StudyError> {
        let refused = |problem: String| Err(StudyError::Option(problem));
        let Kind::MonteCarlo(study) = &self.kind else {
            return refused(format!("the study {} has recordings: no runs can be drawn", self.name));
        };
        let methods = self.methods(choice.methods.as_deref())?;
        let set = match (choice.set.as_deref(), study.sets) {
            (None, sets) => sets.first().copied().unwrap_or_default(),
            (Some(_), []) => {
                return refused(format!("the study {} takes no --set: it has one set of scenes", self.name));
            }
            (Some(set), sets) if sets.contains(&set) => set,
            (Some(set), sets) => {
                let known = sets.join(", ");
                return refused(format!("the study {} has no set `{set}`; its sets are: {known}", self.name));
            }
        };
        let runs = choice.runs.unwrap_or(study.runs);
        if !(1..=1 << 32).contains(&runs) {
            return refused(format!("a study cannot have {runs} runs; expected 1 to {}", 1_u64 << 32));
        }
        let options = self.options(study, &choice.options)?;
        let data = choice.data.as_deref();
        if study.data != data.is_some() {
            return Err(self.wrong_data(study.data));
        }
        let seed = choice.seed.unwrap_or(study.seed);
        let chosen_runs = choice.runs.is_some();
        let models = &opened(&choice.models)?;
        let request = Request { set, seed, runs, chosen_runs, methods: &methods, options, data, models };
        let experiment = (study.build)(&request)?;
        refuse_unused(choice.models.keys(), &models.asked())?;
        Ok(experiment)
    }
}

impl Study {
    /// What was chosen of everything of which the study has several kinds.
    fn options(
        &self,
        study: &MonteCarlo,
        chosen: &BTreeMap<String, String>,
    ) -> Result<BTreeMap<String, String>, StudyError> {
        if let Some(name) =
            chosen.keys().find(|name| study.options.iter().all(|option| option.name != **name))
        {
            return Err(StudyError::Option(format!("the study {} takes no --{name}", self.name)));
        }
        let choose = |option: &Selection| {
            let value = chosen.get(option.name).map_or(option.values[0], String::as_str);
            if option.values.contains(&value) {
                return Ok((option.name.to_owned(), value.to_owned()));
            }
            let (study, name, known) = (self.name, option.name, listed(value, option.values));
            Err(StudyError::Option(format!(
                "the study {study} has no {name} `{value}`; expected one of: {known}"
            )))
        };
        study.options.iter().map(choose).collect()
    }

    fn wrong_data(&self, needed: bool) -> StudyError {
        let name = self.name;
        StudyError::Option(if needed {
            format!(
                "the study {name} draws its scenes around recorded tracks\n  help: say where they are with --data PATH"
            )
        } else {
            format!("the study {name} draws its scenes and takes no --data")
        })
    }
}

/// What the name of a replaced model follows in the options of a plan.
const MODEL: &str = "model ";

/// What a plan says of the models that take the place of shipped ones.
pub(crate) fn options_of(models: &Models) -> impl Iterator<Item = (String, String)> {
    models.replacements().map(|(name, model)| (format!("{MODEL}{name}"), model.file().to_string()))
}

/// Refuses models that no method uses: figures under their name would be those of others.
pub(crate) fn refuse_unused<'a>(
    given: impl IntoIterator<Item = &'a String>,
    used: &[String],
) -> Result<(), StudyError> {
    let Some(name) = given.into_iter().find(|name| !used.contains(name)) else { return Ok(()) };
    let known = if used.is_empty() { "none".to_owned() } else { used.join(", ") };
    Err(StudyError::Option(format!(
        "no chosen method uses the model `{name}`\n  help: the models in use are: {known}"
    )))
}

/// The models that come with Tercel, with those of these files in the place of some.
fn opened(files: &BTreeMap<String, PathBuf>) -> Result<Models, StudyError> {
    let mut models = Models::default();
    for (name, file) in files {
        models = models.with(name, Model::open(file)?)?;
    }
    Ok(models)
}

/// The experiment that a plan describes.
///
/// # Errors
/// When this version of the program would not follow exactly this plan.
pub fn experiment_of(plan: &Plan) -> Result<Box<dyn Experiment>, StudyError> {
    let choice = Choice {
        seed: Some(plan.seed),
        runs: Some(plan.runs),
        methods: Some(plan.methods.clone()),
        set: plan.options.get("set").cloned(),
        options: plan
            .options
            .iter()
            .filter(|(name, _)| !["set", "data"].contains(&name.as_str()) && !name.starts_with(MODEL))
            .map(|(name, value)| (name.clone(), value.clone()))
            .collect(),
        data: plan.options.get("data").map(PathBuf::from),
        models: plan
            .options
            .iter()
            .filter_map(|(name, file)| Some((name.strip_prefix(MODEL)?.to_owned(), file.into())))
            .collect(),
    };
    let experiment = Study::find(&plan.study)?.experiment(&choice)?;
    if experiment.plan() == plan {
        return Ok(experiment);
    }
    let problem = format!("the plan of the study {} is not the one that this program has", plan.study);
    Err(StudyError::Option(problem))
}

/// Names with commas between them, and the one that may have been meant.
fn listed(name: &str, known: &[&str]) -> String {
    let nearest = known.iter().map(|other| (changes(name, other), other)).min();
    let meant = nearest.filter(|(changes, other)| *changes <= 2 && *changes < other.len());
    let help = meant.map(|(_, other)| format!("\n  help: did you mean `{other}`?"));
    known.join(", ") + &help.unwrap_or_default()
}

/// How many letters must be changed, added or taken away to make one word of the other (Levenshtein).
fn changes(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for j in 0..b.len() {
            let replaced = diagonal + usize::from(letter != b[j]);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(choice: &Choice, name: &str) -> String {
        Study::find(name).unwrap().experiment(choice).err().unwrap().to_string()
    }

    #[test]
    fn an_unknown_study_or_method_lists_the_known_ones_and_guesses_what_was_meant() {
        let error = Study::find("atc-tset").unwrap_err().to_string();
        assert!(
            error.contains("atc-hshm, atc-noise") && error.contains("did you mean `atc-test`"),
            "{error}"
        );
        assert!(!Study::find("magic").unwrap_err().to_string().contains("did you mean"));
        let methods = Some(vec!["mesurement".to_owned()]);
        let error = message(&Choice { methods, ..Choice::default() }, "atc-test");
        assert!(error.contains("did you mean `measurement`"), "{error}");
    }

    #[test]
    fn what_a_study_does_not_have_is_refused() {
        let set = |set: &str| Choice { set: Some(set.to_owned()), ..Choice::default() };
        assert!(message(&set("test"), "atc-test").contains("takes no --set"));
        assert!(message(&set("slow"), "atc-noise").contains("test, hshm"));
        assert!(message(&Choice { runs: Some(0), ..Choice::default() }, "atc-test").contains("0 runs"));
        let twice = Some(vec!["measurement".to_owned(); 2]);
        assert!(message(&Choice { methods: twice, ..Choice::default() }, "atc-test").contains("twice"));
        assert!(message(&Choice::default(), "autoferry").contains("recordings"));
    }

    #[test]
    fn a_model_that_no_method_uses_is_refused() {
        let choice = |study: &str, model: &str| {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("mine.safetensors");
            tercel_neural::shipped::model(model).unwrap().save(&file).unwrap();
            let models = [(model.to_owned(), file)].into();
            Study::find(study).unwrap().experiment(&Choice { models, ..Choice::default() }).err()
        };
        let error = choice("vehicle-data", "rmmnet-vehicle").unwrap().to_string();
        assert!(error.contains("`rmmnet-vehicle`") && error.contains("rmmnet-data-100"), "{error}");
        assert!(choice("vehicle-data", "rmmnet-data-300").is_none());
    }

    #[test]
    fn a_plan_gives_its_experiment_back() {
        for name in [
            "atc-test",
            "atc-hshm",
            "atc-noise",
            "atc-missing",
            "atc-ablation",
            "vehicle",
            "vehicle-ablation",
            "vehicle-data",
            "extended-scene",
            "clutter-all",
            "clutter-random",
        ] {
            let choice = Choice { runs: Some(3), seed: Some(u64::MAX), ..Choice::default() };
            let plan = Study::find(name).unwrap().experiment(&choice).unwrap().plan().clone();
            assert_eq!(experiment_of(&plan).unwrap().plan(), &plan);
            let mut other = plan.clone();
            other.metrics.pop();
            assert!(experiment_of(&other).is_err());
        }
    }
}
