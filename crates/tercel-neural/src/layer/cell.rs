//! Cells that may take each other's place.

use serde::{Deserialize, Serialize};

use super::{Cfc, Gru, LayerShape, Ltc, Mlp, Solver, Tangents};

/// A layer that is stepped through time: liquid, closed form, gated, or without a memory.
///
/// What it gives at a step is what it remembers. So cells of the same size can be exchanged, and what is liquid about a filter
/// can be tested against what is not.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Liquid time constants.
    Ltc(Ltc),
    /// Closed-form continuous time.
    Cfc(Cfc),
    /// Gated recurrent units, which do not see how much time has passed.
    Gru(Gru),
    /// Two layers that remember nothing and see no time.
    Mlp(Mlp),
}

impl Cell {
    /// Width of an input row.
    pub fn inputs(&self) -> usize {
        match self {
            Cell::Ltc(cell) => cell.inputs(),
            Cell::Cfc(cell) => cell.inputs(),
            Cell::Gru(cell) => cell.inputs(),
            Cell::Mlp(cell) => cell.inputs(),
        }
    }

    /// Width of the memory, which is also the output.
    pub fn size(&self) -> usize {
        match self {
            Cell::Ltc(cell) => cell.size(),
            Cell::Cfc(cell) => cell.size(),
            Cell::Gru(cell) => cell.size(),
            Cell::Mlp(cell) => cell.size(),
        }
    }

    /// Numbers of scratch space that a step of this many rows along this many directions needs.
    pub fn scratch(&self, batch: usize, directions: usize) -> usize {
        match self {
            Cell::Ltc(cell) => cell.scratch(directions),
            Cell::Cfc(cell) => cell.scratch(batch, directions),
            Cell::Gru(cell) => cell.scratch_along(batch, directions),
            Cell::Mlp(cell) => cell.scratch(batch, directions),
        }
    }

    /// Moves the memory `[batch, size]` on by a time with the input `[batch, inputs]`, and gives derivatives.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows, or the scratch space is too small.
    pub fn step_along(
        &self,
        elapsed: f32,
        input: &[f32],
        memory: &mut [f32],
        tangents: Tangents<'_>,
        scratch: &mut [f32],
    ) {
        match self {
            Cell::Ltc(cell) => cell.step_along(elapsed, input, memory, tangents, scratch),
            Cell::Cfc(cell) => cell.step_along(elapsed, input, memory, tangents, scratch),
            Cell::Gru(cell) => cell.step_along(input, memory, tangents, scratch),
            Cell::Mlp(cell) => cell.forward_along(input, memory, tangents, scratch),
        }
    }
}

/// Which cell, and how large: a table of a model card.
///
/// ```toml
/// cell = { kind = "ltc", size = 32, unfolds = 6, solver = "fused" }
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum CellShape {
    /// An [`Ltc`].
    Ltc {
        /// Number of neurons.
        size: usize,
        /// Steps in which its equation is solved.
        unfolds: usize,
        /// How it is solved.
        solver: Solver,
    },
    /// A [`Cfc`].
    Cfc {
        /// Number of neurons.
        size: usize,
        /// Width of the backbone.
        backbone: usize,
    },
    /// A [`Gru`].
    Gru {
        /// Number of units.
        size: usize,
    },
    /// An [`Mlp`].
    Mlp {
        /// Width of the output.
        size: usize,
        /// Width of the first layer.
        hidden: usize,
    },
}

impl CellShape {
    /// Width of the memory, which is also the output.
    pub fn size(self) -> usize {
        match self {
            CellShape::Ltc { size, .. }
            | CellShape::Cfc { size, .. }
            | CellShape::Gru { size }
            | CellShape::Mlp { size, .. } => size,
        }
    }

    /// The layer with this many inputs.
    pub fn layer(self, inputs: usize) -> LayerShape {
        match self {
            CellShape::Ltc { size, .. } => LayerShape::Ltc { inputs, size },
            CellShape::Cfc { size, backbone } => LayerShape::Cfc { inputs, size, backbone },
            CellShape::Gru { size } => LayerShape::Gru { inputs, size },
            CellShape::Mlp { size, hidden } => LayerShape::Mlp { inputs, hidden, size },
        }
    }

    /// The sizes by name, of which none may be zero.
    pub fn sizes(self) -> Vec<(&'static str, usize)> {
        match self {
            CellShape::Ltc { size, unfolds, .. } => vec![("size", size), ("unfolds", unfolds)],
            CellShape::Cfc { size, backbone } => vec![("size", size), ("backbone", backbone)],
            CellShape::Gru { size } => vec![("size", size)],
            CellShape::Mlp { size, hidden } => vec![("size", size), ("hidden", hidden)],
        }
    }
}
