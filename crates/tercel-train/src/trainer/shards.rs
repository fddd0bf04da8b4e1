//! A batch in shards, each with a graph and at most one thread of its own.

use std::thread;

use super::task::{Draw, Task};
use crate::backend::values;
use crate::{ParameterSet, TrainError, Weights};

/// What some windows have lost, and the gradients if they were asked for.
#[derive(Debug, Default)]
pub(super) struct Tally {
    /// Terms of the loss.
    terms: f64,
    /// Sum of the loss over its terms.
    sum: f64,
    /// Sums of its parts, in the order in which they were first met.
    parts: Vec<(&'static str, f64)>,
    /// Gradients of the sum, for each parameter.
    gradients: Vec<Vec<f32>>,
    /// Updates that were made of it, and the sum of the norms of their gradients.
    pub(super) updates: usize,
    norms: f64,
    /// Updates that were not made, because something was not finite.
    pub(super) skipped: usize,
}

impl Tally {
    /// Adds what another has. Gradients are added in the order of the calls.
    pub(super) fn merge(&mut self, other: Self) {
        self.terms += other.terms;
        self.sum += other.sum;
        self.updates += other.updates;
        self.norms += other.norms;
        self.skipped += other.skipped;
        for (name, value) in other.parts {
            match self.parts.iter_mut().find(|(known, _)| *known == name) {
                Some((_, sum)) => *sum += value,
                None => self.parts.push((name, value)),
            }
        }
        if self.gradients.is_empty() {
            self.gradients = other.gradients;
        } else {
            for (sums, gradients) in self.gradients.iter_mut().zip(other.gradients) {
                sums.iter_mut().zip(gradients).for_each(|(sum, gradient)| *sum += gradient);
            }
        }
    }

    pub(super) fn mean(&self) -> f64 {
        self.sum / self.terms
    }

    pub(super) fn parts(&self) -> impl Iterator<Item = (&'static str, f64)> {
        self.parts.iter().map(|(name, sum)| (*name, sum / self.terms))
    }

    pub(super) fn mean_norm(&self) -> f64 {
        self.norms / self.updates as f64
    }

    pub(super) fn is_finite(&self) -> bool {
        self.mean().is_finite()
    }

    /// The gradients of the mean.
    pub(super) fn take_gradients(&mut self) -> Vec<Vec<f32>> {
        let scale = (1.0 / self.terms) as f32;
        let mut gradients = std::mem::take(&mut self.gradients);
        gradients.iter_mut().flatten().for_each(|gradient| *gradient *= scale);
        gradients
    }

    pub(super) fn accepted(&mut self, norm: f64) {
        self.updates += 1;
        self.norms += norm;
    }

    /// Forgets the losses, which would spoil the mean of the epoch.
    pub(super) fn refused(&mut self) {
        *self = Self { skipped: self.skipped + 1, ..Self::default() };
    }
}

struct Shard<T: Task> {
    batch: T::Batch,
    memory: Option<T::Memory>,
}

/// The shards of one batch.
pub(super) struct Shards<'a, T: Task> {
    task: &'a T,
    shards: Vec<Shard<T>>,
    threads: usize,
}

impl<'a, T: Task> Shards<'a, T> {
    /// Splits the samples evenly and lets each shard make its data.
    pub(super) fn new(task: &'a T, draw: Draw<'_>, count: usize, threads: usize) -> Result<Self, TrainError> {
        let length = draw.samples.len().div_ceil(count);
        let mut parts: Vec<&[u64]> = draw.samples.chunks(length).collect();
        let make = |samples: &mut &[u64]| {
            let batch = task.batch(Draw { samples, ..draw })?;
            Ok(Shard { batch, memory: None })
        };
        let shards = each(&mut parts, threads, make)?;
        Ok(Self { task, shards, threads })
    }

    pub(super) fn windows(&self) -> usize {
        self.shards.iter().map(|shard| self.task.windows(&shard.batch)).max().unwrap_or(0)
    }

    /// Losses and gradients of a window.
    pub(super) fn gradients(&mut self, window: usize, set: &ParameterSet) -> Result<Tally, TrainError> {
        self.run(window, set, true)
    }

    /// Losses of a window.
    pub(super) fn values(&mut self, window: usize, set: &ParameterSet) -> Result<Tally, TrainError> {
        self.run(window, set, false)
    }

    fn run(&mut self, window: usize, set: &ParameterSet, learn: bool) -> Result<Tally, TrainError> {
        let task = self.task;
        let tallies = each(&mut self.shards, self.threads, |shard| {
            let weights = if learn { Weights::trainable(set) } else { Weights::frozen(set) };
            let loss = task.loss(&weights, &shard.batch, window, &mut shard.memory)?;
            let mean = values(&loss.value).first().copied().map_or(f64::NAN, f64::from);
            let mut gradients = if learn { weights.gradients(&loss.value) } else { Vec::new() };
            let terms = loss.terms as f32;
            gradients.iter_mut().flatten().for_each(|gradient| *gradient *= terms);
            let parts = loss.parts.iter().map(|(name, value)| (*name, value * loss.terms)).collect();
            let (terms, sum) = (loss.terms, mean * loss.terms);
            Ok(Tally { terms, sum, parts, gradients, ..Tally::default() })
        })?;
        let mut whole = Tally::default();
        tallies.into_iter().for_each(|tally| whole.merge(tally));
        Ok(whole)
    }
}

/// Works on each item, on so many threads, with the results in the order of the items.
fn each<I: Send, R: Send>(
    items: &mut [I],
    threads: usize,
    work: impl Fn(&mut I) -> Result<R, TrainError> + Sync,
) -> Result<Vec<R>, TrainError> {
    if threads <= 1 || items.len() <= 1 {
        return items.iter_mut().map(work).collect();
    }
    let length = items.len().div_ceil(threads);
    let work = &work;
    thread::scope(|scope| {
        let handles: Vec<_> = items
            .chunks_mut(length)
            .map(|items| scope.spawn(move || items.iter_mut().map(work).collect::<Result<Vec<_>, _>>()))
            .collect();
        let mut results = Vec::new();
        for handle in handles {
            match handle.join() {
                Ok(part) => results.extend(part?),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        Ok(results)
    })
}
