//! What the machine promises, with an experiment that is quick and fails now and then.

use std::collections::BTreeMap;
use std::path::PathBuf;

use rand::{Rng, RngExt, SeedableRng};

use super::*;
use crate::StudyError;
use crate::table::StudyTable;

/// Draws numbers. Its second method fails in every seventh run, and has a metric that it does not tell.
struct Dice(Plan);

impl Dice {
    fn new(seed: u64, runs: u64) -> Self {
        let quantity = |name: &str| Quantity { name: name.to_owned(), unit: "m".to_owned(), shown: true };
        let curve = |root| Curve {
            title: "Error over time".to_owned(),
            unit: "m".to_owned(),
            abscissa: "Time, s".to_owned(),
            x: vec![0.0, 1.0, 2.0],
            root,
        };
        Dice(Plan {
            study: "dice".to_owned(),
            seed,
            runs,
            options: BTreeMap::new(),
            sweep: Some(Sweep {
                name: "level".to_owned(),
                label: "Level".to_owned(),
                values: vec![0.1, 10.0],
            }),
            methods: vec!["plain".to_owned(), "moody".to_owned()],
            metrics: vec![quantity("error"), quantity("other")],
            curves: vec![curve(true), curve(false)],
        })
    }
}

impl Experiment for Dice {
    fn plan(&self) -> &Plan {
        &self.0
    }

    fn run(&self, condition: usize, run: u64) -> Vec<Attempt> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(self.0.seed);
        random.set_stream(run);
        let level = self.0.sweep.as_ref().unwrap().values[condition];
        let mut outcome = |other: f64| Outcome {
            metrics: vec![level * random.random::<f64>(), other],
            curves: vec![
                vec![1e9 * random.random::<f64>(), random.random(), f64::NAN],
                vec![-random.random::<f64>(); 3],
            ],
        };
        let (plain, mut moody) = (outcome(random_number(run)), outcome(f64::NAN));
        if run % 7 == 3 {
            moody.metrics[0] = f64::INFINITY;
        }
        let attempt = |outcome| Attempt::of(3, || Ok::<_, String>(()), |()| Ok(outcome));
        vec![attempt(plain), attempt(moody)]
    }
}

/// Numbers whose sum depends on the order.
fn random_number(run: u64) -> f64 {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(run);
    10f64.powi((random.next_u32() % 30) as i32 - 15)
}

fn results(dice: &Dice, shard: &str, threads: usize) -> Results {
    let mut results = conduct(dice, shard.parse().unwrap(), Some(threads), &|| {}).unwrap();
    for cell in &mut results.cells {
        assert!(cell.seconds >= 0.0);
        cell.seconds = 0.0;
    }
    results
}

/// The table as bytes, without the time for a step.
fn bytes(results: &Results, dice: &Dice) -> Vec<u8> {
    let mut table: StudyTable = results.table(dice);
    table.rows.iter_mut().for_each(|row| row.us_per_step = 0.0);
    serde_json::to_vec(&table).unwrap()
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let dice = Dice::new(5, 101);
    let one = results(&dice, "1/1", 1);
    for threads in [2, 3, 8] {
        assert_eq!(results(&dice, "1/1", threads), one);
    }
    assert_ne!(results(&Dice::new(6, 101), "1/1", 1).cells, one.cells);
}

#[test]
fn merged_shards_are_the_whole_to_the_last_bit() {
    let dice = Dice::new(5, 50);
    let whole = results(&dice, "1/1", 2);
    let folder = tempfile::tempdir().unwrap();
    for count in [1, 2, 7, 60] {
        let shards = (1..=count).rev().map(|index| {
            let shard = results(&dice, &format!("{index}/{count}"), 1);
            let path = folder.path().join(Results::file_name(&dice.0, shard.shard));
            shard.write(&path).unwrap();
            assert_eq!(Results::read(&path).unwrap(), shard, "a file gives back what was written");
            (path, shard)
        });
        let merged = Results::merge(shards.collect()).unwrap();
        assert_eq!(merged, whole);
        assert_eq!(bytes(&merged, &dice), bytes(&whole, &dice));
        assert_eq!(merged.metrics().rows.len(), 2 * 2 * 3 * 50);
    }
}

#[test]
fn failed_runs_are_counted_and_never_averaged() {
    let dice = Dice::new(5, 50);
    let whole = results(&dice, "1/1", 2);
    let table = whole.table(&dice);
    let row = |condition: usize, method: usize| &table.rows[2 * condition + method];
    assert_eq!(row(0, 0).metrics["failures"].mean, 0.0);
    assert_eq!(row(1, 1).metrics["failures"].mean, 7.0 / 50.0);
    assert!(row(1, 1).metrics["error"].mean.is_finite());
    assert!(row(1, 1).metrics["other"].mean.is_nan(), "what is never told has no figure");
    assert_eq!(whole.cell(1, 1).unwrap().curves[1][0].count(), 43);
    let lines = whole.failures();
    assert_eq!(lines.len(), 2);
    assert_eq!(
        lines[1],
        "moody at level = 10 failed in 7 of 50 runs, first in run 3: diverged: a metric is inf"
    );
}

#[test]
fn progress_is_told_once_a_run_and_condition() {
    let count = std::sync::atomic::AtomicUsize::new(0);
    let dice = Dice::new(1, 10);
    let progress = || {
        count.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    };
    conduct(&dice, "2/3".parse().unwrap(), None, &progress).unwrap();
    assert_eq!(count.into_inner(), 2 * 3);
}

fn refusal(shards: Vec<Results>) -> String {
    let named = shards.into_iter().enumerate();
    let named = named.map(|(place, shard)| (PathBuf::from(format!("file{place}")), shard)).collect();
    Results::merge(named).unwrap_err().to_string()
}

#[test]
fn shards_that_do_not_make_a_whole_are_refused_with_the_reason() {
    let shard = |text: &str| results(&Dice::new(5, 20), text, 1);
    assert!(refusal(vec![]).contains("no shards"));
    assert!(refusal(vec![shard("1/3")]).contains("shard 2/3, 3/3 is missing"));
    let twice = refusal(vec![shard("1/3"), shard("2/3"), shard("1/3")]);
    assert_eq!(twice, "file0 and file2 are both shard 1/3; each must be there once");
    let seeds = refusal(vec![shard("1/2"), results(&Dice::new(6, 20), "2/2", 1)]);
    assert_eq!(seeds, "file0 and file1 cannot be joined: their seeds differ: `5` and `6`");
    let changed = |change: &dyn Fn(&mut Plan)| {
        let mut other = shard("2/2");
        change(&mut other.plan);
        refusal(vec![shard("1/2"), other])
    };
    assert!(changed(&|plan| plan.runs = 21).contains("numbers of runs differ: `20` and `21`"));
    assert!(changed(&|plan| plan.study = "cards".to_owned()).contains("`dice` and `cards`"));
    assert!(changed(&|plan| plan.methods.reverse()).contains("methods differ"));
    assert!(changed(&|plan| drop(plan.options.insert("set".into(), "b".into()))).contains("options"));
    assert!(changed(&|plan| plan.curves[0].root = false).contains("curves"));
    assert!(refusal(vec![shard("1/2"), shard("2/3")]).contains("numbers of shards"));
}

#[test]
fn a_file_that_is_no_whole_shard_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.shard.json");
    results(&Dice::new(5, 20), "1/2", 1).write(&path).unwrap();
    let good = std::fs::read_to_string(&path).unwrap();
    let refused = |text: &str| {
        std::fs::write(&path, text).unwrap();
        let error = Results::read(&path).unwrap_err();
        assert!(matches!(error, StudyError::Shard { .. }));
        error.to_string()
    };
    assert!(refused("").contains("no shard of a study"));
    assert!(refused(&good[..good.len() / 2]).contains("damaged"));
    let version = format!("\"tercel\":\"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(refused(&good.replace(&version, "\"tercel\":\"9.9.9\"")).contains("made by Tercel 9.9.9"));
    assert!(refused(&good.replace("tercel study shard", "recipe")).contains("`recipe`"));
    assert!(refused(&good.replace("\"index\":1", "\"index\":2")).contains("not those of the shard"));
    assert!(refused(&good.replace("\"index\":1", "\"index\":3")).contains("among the shards"));
    assert!(refused(&good.replace("\"runs\":20", "\"runs\":22")).contains("runs are missing"));
    assert!(refused(&good.replace("\"plain\",", "")).contains("methods or conditions"));
    assert!(refused(&good.replace("[0.0,1.0,2.0]", "[0.0,1.0]")).contains("one sum per point"));
    std::fs::remove_file(&path).unwrap();
    assert!(Results::read(&path).unwrap_err().to_string().contains("cannot read"));
    assert!(find_shards(&[folder.path().into()]).unwrap_err().to_string().contains("holds no shard"));
}
