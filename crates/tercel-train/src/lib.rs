//! Trains the networks inside learned filters.
//!
//! A [`recipe`] says what is trained, on which data and how. Its kind chooses a [task]: a differentiable
//! model, its data and its loss. The [trainer] takes the task through epochs of updates and leaves a model
//! that [`tercel_neural`] runs, a checkpoint to go on from, and a learning curve.
//!
//! ```text
//! recipe ─► task ─► batch ─► shards ─► loss, backward (one thread each) ─► sum ─► AdamW ─► parameters
//!                                                                                             │
//!           model file ◄─ best validation ◄─ checkpoint and curve, after each epoch ◄─────────┘
//! ```
//!
//! - **The same result again.** All that is random follows from the seed, the epoch and the number of a
//!   sample. A batch is split into a fixed number of shards whose gradients are summed in order, so the
//!   weights do not depend on the number of threads, and a training that was interrupted ends with the same
//!   weights, bit for bit.
//! - **Nothing is lost.** Files appear whole or not at all. A training that is killed, or finds the disk
//!   full, leaves the last good model. Updates whose loss or gradient is not finite are skipped and counted.
//! - **Few, large operations.** A recurrent layer over a whole sequence is one operation with a backward pass
//!   by hand ([`backend::Operation`]), and so are the steps of a filter's recursion. Recording small
//!   operations is what training on a processor mostly spends its time on.
//!
//! # A task of a new kind
//!
//! A module in [`task`] with three sections for its recipes ([`recipe::Kind`]) and a type that implements
//! [`trainer::Task`]; then an arm in [`task::train`]. [`task::kalman_net`] is the one to follow. In short:
//!
//! ```
//! use serde::Deserialize;
//! use tercel_train::backend::constant;
//! use tercel_train::layer::{Activation, Linear};
//! use tercel_train::recipe::{Kind, Recipe};
//! use tercel_train::trainer::{Draw, Loss, Run, Split, Task, train};
//! use tercel_train::{ParameterSet, TrainError, Weights};
//! use rand::RngExt;
//! use tercel_neural::Card;
//!
//! // The recipe: sections of its own.
//! #[derive(Default, Deserialize)]
//! #[serde(deny_unknown_fields)]
//! struct Slope { slope: Option<f32> }
//!
//! #[derive(Default, Deserialize)]
//! #[serde(deny_unknown_fields)]
//! struct Nothing {}
//!
//! struct LineKind;
//! impl Kind for LineKind {
//!     const NAME: &'static str = "line";
//!     type Data = Slope;
//!     type Model = Nothing;
//!     type Loss = Nothing;
//! }
//!
//! // The task: layers, and where data come from.
//! struct Line { layer: Linear, slope: f32 }
//!
//! impl Task for Line {
//!     type Batch = Vec<f32>;
//!     type Memory = ();
//!
//!     fn card(&self) -> Card {
//!         Card::new("", "line", &["y"])
//!     }
//!     fn samples(&self, split: Split) -> usize {
//!         match split { Split::Training => 64, Split::Validation => 16 }
//!     }
//!     fn batch(&self, draw: Draw<'_>) -> Result<Vec<f32>, TrainError> {
//!         Ok(draw.samples.iter().map(|sample| draw.random(*sample).random()).collect())
//!     }
//!     fn loss(&self, weights: &Weights, x: &Vec<f32>, _: usize, _: &mut Option<()>) -> Result<Loss, TrainError> {
//!         let shape = [x.len(), 1];
//!         let wanted = constant(x.iter().map(|x| self.slope * x).collect(), shape);
//!         let error = self.layer.forward(weights, constant(x.clone(), shape)) - wanted;
//!         let value = (error.clone() * error).mean().reshape([1, 1]);
//!         Ok(Loss { value, terms: x.len() as f64, parts: Vec::new() })
//!     }
//! }
//!
//! let text = "version = 1\nkind = \"line\"\nname = \"slope\"\n[data]\nslope = 3.0\n[model]\n\
//!             [optimiser]\nrate = 0.1\n[schedule]\nepochs = 40\nbatch = 16\n";
//! let recipe = Recipe::<LineKind>::parse(text)?;
//! let mut set = ParameterSet::new(recipe.seed);
//! let layer = Linear::new(&mut set, "line", 1, 1, Activation::Identity)?;
//! let task = Line { layer, slope: recipe.data.slope.unwrap_or(1.0) };
//!
//! let folder = tempfile::tempdir()?;
//! let run = Run::new(folder.path().join("slope.safetensors"));
//! let summary = train(&recipe, &task, set, &run, &mut |_| std::ops::ControlFlow::Continue(()))?;
//! assert!(summary.curve.last().and_then(|row| row.validation).is_some_and(|loss| loss < 0.01));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Tensors are matrices with a row for each member of a batch; a sequence has its steps one below the other.
//! What the run time must repeat (feature definitions, names and shapes of tensors) is defined in
//! [`tercel_neural`] and tied to the model here by a test that compares the two over a whole sequence. A
//! network that feeds on the outputs of others that are trained already reads them with [`Weights::frozen`],
//! which records nothing. Operations with a backward pass by hand are checked against differences; copy one
//! of those tests with the operation.

pub mod backend;
mod check;
mod error;
mod hash;
pub mod kalman;
pub mod layer;
pub mod optimiser;
mod parameters;
pub mod recipe;
mod store;
mod tape;
pub mod task;
pub mod trainer;

pub use error::TrainError;
pub use parameters::{Initial, Parameter, ParameterId, ParameterSet, Weights};
