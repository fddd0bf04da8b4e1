//! The network that predicts.

use nalgebra::Vector4;

use super::KIND;
use super::form::{Moved, Seen, Span};
use super::hyper::{Derivative, LiquidHyper};
use crate::error::ModelError;
use crate::filter::LABELS;
use crate::filter::memory::Room;
use crate::layer::{Cell, Linear, Tangents};
use crate::model::Model;

/// The network of a [`LiquidKalman`](super::LiquidKalman): a cell that is stepped through time, and a linear layer.
///
/// It is loaded once and shared by all filters of that model.
#[derive(Debug, Clone, PartialEq)]
pub struct LiquidNetwork {
    hyper: LiquidHyper,
    cell: Cell,
    output: Linear,
}

/// What a [`LiquidNetwork`] says of objects that were predicted together.
#[derive(Debug)]
pub struct Predictions<'a> {
    network: &'a LiquidNetwork,
    layout: Layout,
    span: Span,
    batch: Batch<'a>,
}

/// Rows of an object, and directions of derivatives through the network.
#[derive(Debug, Clone, Copy)]
struct Layout {
    copies: usize,
    directions: usize,
}

/// Rows of objects. Those of an object that is moved for differences lie below its own.
#[derive(Debug)]
struct Batch<'a> {
    inputs: &'a mut [f32],
    input_tangents: &'a mut [f32],
    memory: &'a mut [f32],
    memory_tangents: &'a mut [f32],
    outputs: &'a mut [f32],
    output_tangents: &'a mut [f32],
}

impl LiquidNetwork {
    /// Builds the network of a model of the kind `liquid`.
    ///
    /// # Errors
    /// When the model is of another kind, made for another state than `x, y, vx, vy`, its options make no sense, or its tensors
    /// are not those of the architecture.
    pub fn from_model(model: &Model) -> Result<Self, ModelError> {
        model.expect(KIND, &LABELS)?;
        let hyper = LiquidHyper::of(model)?;
        let mut weights = model.weights();
        let cell = weights.cell("cell", hyper.form.inputs(), hyper.cell)?;
        let output = weights.linear("output", hyper.cell.size(), hyper.form.outputs())?;
        weights.finish()?;
        Ok(LiquidNetwork { hyper, cell, output })
    }

    /// Sizes and options.
    pub fn hyper(&self) -> &LiquidHyper {
        &self.hyper
    }

    /// Numbers of memory for one object.
    pub fn memory(&self) -> usize {
        if self.hyper.carried { self.cell.size() } else { 0 }
    }

    /// How the rows lie when Jacobians are asked for.
    fn layout(&self) -> Layout {
        let directions = self.hyper.form.directions().len();
        match self.hyper.jacobian {
            Derivative::Exact => Layout { copies: 1, directions },
            Derivative::Difference { .. } => Layout { copies: 1 + directions, directions: 0 },
        }
    }

    /// Predicts this many objects together over a time, given what is known and remembered of each. The network is called once.
    ///
    /// `room` grows to what is needed, and is kept by the caller.
    ///
    /// # Panics
    /// When there are more objects, or a memory has another length.
    pub fn predict<'a, 'm>(
        &'a self,
        count: usize,
        objects: impl Iterator<Item = (Seen, &'m [f32])>,
        dt: f64,
        room: &'a mut Vec<f32>,
    ) -> Predictions<'a> {
        self.ask(self.layout(), count, objects, dt, room)
    }

    /// As [`predict`](LiquidNetwork::predict), for those who need no Jacobian: theirs is that of outputs that stay.
    ///
    /// # Panics
    /// As [`predict`](LiquidNetwork::predict).
    pub fn predict_means<'a, 'm>(
        &'a self,
        count: usize,
        objects: impl Iterator<Item = (Seen, &'m [f32])>,
        dt: f64,
        room: &'a mut Vec<f32>,
    ) -> Predictions<'a> {
        self.ask(Layout { copies: 1, directions: 0 }, count, objects, dt, room)
    }

    fn ask<'a, 'm>(
        &'a self,
        layout: Layout,
        count: usize,
        objects: impl Iterator<Item = (Seen, &'m [f32])>,
        dt: f64,
        room: &'a mut Vec<f32>,
    ) -> Predictions<'a> {
        let (form, size) = (&self.hyper.form, self.cell.size());
        let Layout { copies, directions } = layout;
        let (inputs, outputs, rows) = (form.inputs(), form.outputs(), count * copies);
        let scratch = self.cell.scratch(rows, directions);
        let needed = rows * (1 + directions) * (inputs + size + outputs) + scratch;
        if room.len() < needed {
            room.resize(needed, 0.0);
        }
        let mut room = Room(room);
        let mut take = |width: usize| room.take(rows * width);
        let mut batch = Batch {
            inputs: take(inputs),
            input_tangents: take(directions * inputs),
            memory: take(size),
            memory_tangents: take(directions * size),
            outputs: take(outputs),
            output_tangents: take(directions * outputs),
        };
        self.see(layout, objects, &mut batch);
        let span = Span { dt, interval: self.hyper.interval };
        self.step((dt / span.interval) as f32, directions, &mut batch, room.0);
        Predictions { network: self, layout, span, batch }
    }

    /// Fills in what the network sees and remembers.
    fn see<'m>(
        &self,
        layout: Layout,
        objects: impl Iterator<Item = (Seen, &'m [f32])>,
        batch: &mut Batch<'_>,
    ) {
        let (form, size) = (&self.hyper.form, self.cell.size());
        let Layout { copies, directions } = layout;
        let inputs = form.inputs();
        for (number, (seen, remembered)) in objects.enumerate() {
            for copy in 0..copies {
                let row = number * copies + copy;
                let to = &mut batch.input_tangents[row * directions * inputs..][..directions * inputs];
                let seen = Seen { mean: self.displaced(&seen.mean, copy), ..seen };
                form.see(&seen, &mut batch.inputs[row * inputs..][..inputs], to);
                let memory = &mut batch.memory[row * size..][..size];
                memory.fill(0.0);
                memory[..remembered.len()].copy_from_slice(remembered);
            }
        }
    }

    /// The state of a copy: that of number 0 is the state itself, the others are moved by a step in one component.
    fn displaced(&self, mean: &Vector4<f64>, copy: usize) -> Vector4<f64> {
        let mut mean = *mean;
        if let (Derivative::Difference { step }, 1..) = (self.hyper.jacobian, copy) {
            mean[self.hyper.form.directions().start + copy - 1] += step;
        }
        mean
    }

    fn step(&self, elapsed: f32, directions: usize, batch: &mut Batch<'_>, scratch: &mut [f32]) {
        let Batch { inputs, input_tangents, memory, memory_tangents, outputs, output_tangents } = batch;
        let tangents = Tangents { directions, input: input_tangents, output: memory_tangents };
        self.cell.step_along(elapsed, inputs, memory, tangents, scratch);
        self.output.forward(memory, outputs);
        if directions > 0 {
            self.output.tangents(memory_tangents, output_tangents);
        }
    }
}

impl Predictions<'_> {
    /// The prediction of an object and its memory after it, given what was known of it. `None` where the network says something
    /// that is not finite.
    ///
    /// # Panics
    /// When there is no object of this number.
    pub fn get(&self, number: usize, seen: &Seen) -> Option<(Moved, &[f32])> {
        let Predictions { network, layout: Layout { copies, directions }, batch, span } = self;
        let form = &network.hyper.form;
        let outputs = form.outputs();
        let said = &batch.outputs[number * copies * outputs..][..copies * outputs];
        let tangents = &batch.output_tangents[number * directions * outputs..][..directions * outputs];
        let memory = &batch.memory[number * copies * network.cell.size()..][..network.memory()];
        if !said.iter().chain(tangents).chain(memory).all(|value| value.is_finite()) {
            return None;
        }
        let mut moved = form.moved(seen, &said[..outputs], tangents, *span);
        if let (Derivative::Difference { step }, 2..) = (network.hyper.jacobian, *copies) {
            for (copy, said) in said.chunks_exact(outputs).enumerate().skip(1) {
                let seen = Seen { mean: network.displaced(&seen.mean, copy), ..*seen };
                let there = form.moved(&seen, said, &[], *span).mean;
                moved.jacobian.set_column(form.directions().start + copy - 1, &((there - moved.mean) / step));
            }
        }
        Some((moved, memory))
    }
}
