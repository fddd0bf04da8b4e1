//! The network: a memory, and heads that speak about the motion, a scan and the extent.

use super::KIND;
use super::hyper::RmmNetHyper;
use crate::error::ModelError;
use crate::filter::LABELS;
use crate::filter::memory::Room;
use crate::layer::{Linear, Lstm, activation};
use crate::model::{Model, Weights};

/// The network of an [`RmmNet`](super::RmmNet).
///
/// It is loaded once and shared by all filters of that model.
#[derive(Debug, Clone, PartialEq)]
pub struct RmmNetwork {
    hyper: RmmNetHyper,
    memory: Lstm,
    motion: Head,
    points: [Linear; 2],
    scan: Head,
    extent: Head,
}

/// A layer with the hyperbolic tangent, and a linear one.
#[derive(Debug, Clone, PartialEq)]
struct Head {
    hidden: Linear,
    output: Linear,
}

impl Head {
    fn take(weights: &mut Weights<'_>, name: &str, sizes: [usize; 3]) -> Result<Self, ModelError> {
        Ok(Head {
            hidden: weights.linear(&format!("{name}.hidden"), sizes[0], sizes[1])?,
            output: weights.linear(&format!("{name}.output"), sizes[1], sizes[2])?,
        })
    }

    fn say(&self, seen: &[f32], hidden: &mut [f32], said: &mut [f32]) {
        self.hidden.forward(seen, hidden);
        activation::tanh(hidden);
        self.output.forward(hidden, said);
    }
}

impl RmmNetwork {
    /// Builds the network of a model of the kind `rmmnet`.
    ///
    /// # Errors
    /// When the model is of another kind, made for another state than `x, y, vx, vy`, its options make no sense, or its tensors
    /// are not those of the architecture.
    pub fn from_model(model: &Model) -> Result<Self, ModelError> {
        model.expect(KIND, &LABELS)?;
        let hyper = RmmNetHyper::of(model)?;
        let (memory, hidden, encoder) = (hyper.memory, hyper.aligned().hidden, hyper.aligned().encoder);
        let sizes = hyper.sizes();
        let seen = sizes.motion_seen;
        let mut weights = model.weights();
        let network = RmmNetwork {
            memory: weights.lstm("memory", seen, memory)?,
            motion: Head::take(&mut weights, "motion", [memory + seen, hidden, sizes.motion_said])?,
            points: [
                weights.linear("points.first", sizes.point, encoder)?,
                weights.linear("points.second", encoder, encoder)?,
            ],
            scan: Head::take(
                &mut weights,
                "scan",
                [2 * encoder + sizes.scan_seen + memory, hidden, sizes.scan_said],
            )?,
            extent: Head::take(
                &mut weights,
                "extent",
                [hidden + sizes.extent_seen, hidden, sizes.extent_said],
            )?,
            hyper: hyper.clone(),
        };
        weights.finish()?;
        Ok(network)
    }

    /// Sizes and options.
    pub fn hyper(&self) -> &RmmNetHyper {
        &self.hyper
    }

    /// Numbers of memory for one object: output and cell.
    pub fn memory(&self) -> usize {
        2 * self.hyper.memory
    }

    /// Numbers of scratch space that a step of one object needs, without its points.
    pub(super) fn scratch(&self) -> usize {
        let (sizes, size, form) = (self.hyper.sizes(), self.hyper.memory, self.hyper.aligned());
        let own = sizes.motion_seen + sizes.motion_said;
        let motion = own + size + sizes.motion_seen + form.hidden + self.memory.scratch(1);
        let own = sizes.scan_seen + form.hidden + sizes.scan_said + sizes.extent_seen + sizes.extent_said;
        let joined = 2 * form.encoder + sizes.scan_seen + size;
        motion.max(own + joined.max(2 * form.hidden + sizes.extent_seen))
    }

    /// Moves the memory of one object on by what is seen of it, and writes what that says of the motion.
    pub(super) fn say_motion(&self, seen: &[f32], memory: &mut [f32], scratch: &mut [f32], said: &mut [f32]) {
        let mut room = Room(scratch);
        let joined = room.take(self.hyper.memory + seen.len());
        let hidden = room.take(self.hyper.aligned().hidden);
        let (output, cell) = memory.split_at_mut(self.hyper.memory);
        self.memory.step(seen, output, cell, room.0);
        joined[..output.len()].copy_from_slice(output);
        joined[output.len()..].copy_from_slice(seen);
        self.motion.say(joined, hidden, said);
    }

    /// What a scan says: writes what the layer before it holds, and what is said.
    pub(super) fn say_scan(
        &self,
        (rows, count): (&mut [f32], usize),
        seen: &[f32],
        memory: &[f32],
        scratch: &mut [f32],
        (hidden, said): (&mut [f32], &mut [f32]),
    ) {
        let width = self.hyper.aligned().encoder;
        let point = self.hyper.sizes().point;
        let mut room = Room(scratch);
        let joined = room.take(2 * width + seen.len() + self.hyper.memory);
        let (seen_points, rest) = rows.split_at_mut(count * point);
        let (first, rest) = rest.split_at_mut(count * width);
        let second = &mut rest[..count * width];
        self.points[0].forward_relu(seen_points, first);
        self.points[1].forward_relu(first, second);
        let (pooled, others) = joined.split_at_mut(2 * width);
        pool(second, width, pooled);
        others[..seen.len()].copy_from_slice(seen);
        others[seen.len()..].copy_from_slice(&memory[..self.hyper.memory]);
        self.scan.say(joined, hidden, said);
    }

    /// Numbers of room for the points of a scan and what the encoder makes of them.
    pub(super) fn room(&self, count: usize) -> usize {
        count * (self.hyper.sizes().point + 2 * self.hyper.aligned().encoder)
    }

    /// What the layer before the last word about a scan, and what is seen of the extent, say about it.
    pub(super) fn say_extent(&self, scan: &[f32], seen: &[f32], scratch: &mut [f32], said: &mut [f32]) {
        let mut room = Room(scratch);
        let joined = room.take(scan.len() + seen.len());
        let hidden = room.take(self.hyper.aligned().hidden);
        joined[..scan.len()].copy_from_slice(scan);
        joined[scan.len()..].copy_from_slice(seen);
        self.extent.say(joined, hidden, said);
    }
}

/// Mean and maximum over rows.
fn pool(rows: &[f32], width: usize, pooled: &mut [f32]) {
    let (mean, largest) = pooled.split_at_mut(width);
    let share = width as f32 / rows.len() as f32;
    mean.fill(0.0);
    largest.copy_from_slice(&rows[..width]);
    for row in rows.chunks_exact(width) {
        for ((mean, largest), x) in mean.iter_mut().zip(largest.iter_mut()).zip(row) {
            *mean += share * x;
            *largest = if *x > *largest { *x } else { *largest };
        }
    }
}
