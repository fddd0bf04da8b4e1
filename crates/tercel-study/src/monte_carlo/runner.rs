//! Carries out the runs of a study on all cores.

use rayon::prelude::*;

use super::{Cell, Experiment, Results, Shard};
use crate::StudyError;

/// Called after each run under each condition, from any thread.
pub type Progress<'a> = &'a (dyn Fn() + Sync);

/// Carries out the runs of a shard, on `threads` threads or as many as there are cores.
///
/// # Errors
/// When the threads cannot be started. A run that fails is part of the results.
pub fn conduct(
    experiment: &dyn Experiment,
    shard: Shard,
    threads: Option<usize>,
    progress: Progress<'_>,
) -> Result<Results, StudyError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    let pool = pool.map_err(|error| StudyError::Threads(error.to_string()))?;
    Ok(pool.install(|| conduct_here(experiment, shard, progress)))
}

fn conduct_here(experiment: &dyn Experiment, shard: Shard, progress: Progress<'_>) -> Results {
    let plan = experiment.plan();
    let runs: Vec<u64> = shard.runs(plan.runs).collect();
    let methods = plan.methods.len();
    let units: Vec<(usize, u64)> =
        (0..plan.conditions()).flat_map(|condition| runs.iter().map(move |&run| (condition, run))).collect();
    let nothing = || vec![Cell::new(plan); plan.conditions() * methods];
    let mut cells = units
        .par_iter()
        .fold(nothing, |mut cells, &(condition, run)| {
            let attempts = experiment.run(condition, run);
            for (cell, attempt) in cells[condition * methods..].iter_mut().zip(attempts) {
                cell.push(run, attempt);
            }
            progress();
            cells
        })
        .reduce(nothing, |mut left, right| {
            left.iter_mut().zip(right).for_each(|(left, right)| left.merge(right));
            left
        });
    cells.iter_mut().for_each(Cell::sort);
    Results { plan: plan.clone(), shard, cells }
}
