//! Monte Carlo studies: many runs of several methods, on all cores or on several machines, with one result.
//!
//! An [`Experiment`] says what one run is: a scene is drawn from the seed and the number of the run, every method works on
//! it, and each gives a number per metric and, if wanted, curves over time. Its [`Plan`] says which runs, methods and
//! conditions there are. The machine does the rest: [`conduct`] carries out the runs of a [`Shard`], [`Results`] keeps what
//! they gave, and [`Results::merge`] joins shards.
//!
//! ## Exactness
//! Results are the same to the last bit for any number of threads and any sharding:
//!
//! - numbers of runs are kept run by run, and averaged in the order of the runs;
//! - curves are sums over runs of multiples of 2⁻²⁴ in integers ([`ExactSum`]), which do not depend on the order;
//! - a run depends on seed and number alone, which is for the experiment to keep.
//!
//! The time for a step is measured beside that, and is the one thing that differs.
//!
//! A run that fails is counted, under the metric `failures`, and its message is kept. Its other metrics have no value, so
//! that means are over the runs that succeeded: read them together with `failures`.

mod curve;
mod experiment;
mod plan;
mod results;
mod runner;
mod shard_file;
mod table;
mod write;

pub use curve::ExactSum;
pub use experiment::{Attempt, Example, Experiment, Outcome};
pub use plan::{Curve, Plan, Quantity, Shard, Sweep};
pub use results::{Cell, Failure, Results};
pub use runner::{Progress, conduct};
pub use shard_file::find as find_shards;

#[cfg(test)]
mod tests;
