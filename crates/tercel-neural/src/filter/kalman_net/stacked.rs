//! Architecture #1: one stack of layers.

use super::hyper::{READING, STATE};
use crate::error::ModelError;
use crate::filter::memory::Room;
use crate::layer::{Gru, Linear};
use crate::model::Weights;

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stacked {
    input: Linear,
    recurrent: Vec<Gru>,
    head: Option<Linear>,
    gain: Linear,
}

impl Stacked {
    pub fn new(
        weights: &mut Weights<'_>,
        inputs: usize,
        [input, hidden, layers, head]: [usize; 4],
    ) -> Result<Self, ModelError> {
        let first = weights.linear("input", inputs, input)?;
        let recurrent: Result<Vec<Gru>, ModelError> = (0..layers)
            .map(|layer| {
                weights.gru(&format!("gru.{layer}"), if layer == 0 { input } else { hidden }, hidden)
            })
            .collect();
        let (recurrent, mut width) = (recurrent?, hidden);
        let mut second = None;
        if head > 0 {
            second = Some(weights.linear("head", hidden, head)?);
            width = head;
        }
        let gain = weights.linear("gain", width, STATE * READING)?;
        Ok(Stacked { input: first, recurrent, head: second, gain })
    }

    pub fn initial(&self) -> Vec<f32> {
        vec![0.0; self.recurrent.iter().map(Gru::size).sum()]
    }

    pub fn scratch(&self, batch: usize) -> usize {
        let recurrent = self.recurrent.iter().map(|layer| layer.scratch(batch)).max().unwrap_or(0);
        batch * (self.input.outputs() + self.head.as_ref().map_or(0, Linear::outputs)) + recurrent
    }

    pub fn step(&self, inputs: &[f32], memory: &mut [f32], scratch: &mut [f32], gain: &mut [f32]) {
        let batch = inputs.len() / self.input.inputs();
        let mut room = Room(scratch);
        let first = room.take(batch * self.input.outputs());
        self.input.forward_relu(inputs, first);
        let second = room.take(batch * self.head.as_ref().map_or(0, Linear::outputs));
        let mut value: &[f32] = first;
        let mut rest = memory;
        for layer in &self.recurrent {
            let (own, after) = rest.split_at_mut(batch * layer.size());
            layer.step(value, own, room.0);
            (value, rest) = (own, after);
        }
        if let Some(head) = &self.head {
            head.forward_relu(value, second);
            value = second;
        }
        self.gain.forward(value, gain);
    }
}
