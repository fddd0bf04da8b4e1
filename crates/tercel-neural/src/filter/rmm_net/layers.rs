//! The layers of the forms.

use super::hyper::Aligned;
use super::published::{ESTIMATE_SEEN, PREDICTED, PREDICTIONS, Published, SAID, SCAN_SEEN};
use crate::error::ModelError;
use crate::filter::memory::Room;
use crate::layer::{Linear, Lstm, activation};
use crate::model::Weights;

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

/// The layers that work in the frame of the object.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AlignedLayers {
    pub options: Aligned,
    memory: Lstm,
    motion: Head,
    points: [Linear; 2],
    scan: Head,
    extent: Head,
}

impl AlignedLayers {
    pub fn take(weights: &mut Weights<'_>, options: Aligned, memory: usize) -> Result<Self, ModelError> {
        let Aligned { hidden, encoder, .. } = options;
        let sizes = options.sizes();
        let seen = sizes.motion_seen;
        let joined = 2 * encoder + sizes.scan_seen + memory;
        Ok(AlignedLayers {
            memory: weights.lstm("memory", seen, memory)?,
            motion: Head::take(weights, "motion", [memory + seen, hidden, sizes.motion_said])?,
            points: [
                weights.linear("points.first", sizes.point, encoder)?,
                weights.linear("points.second", encoder, encoder)?,
            ],
            scan: Head::take(weights, "scan", [joined, hidden, sizes.scan_said])?,
            extent: Head::take(weights, "extent", [hidden + sizes.extent_seen, hidden, sizes.extent_said])?,
            options,
        })
    }

    /// Numbers of memory for one object: output and cell.
    pub fn memory(&self) -> usize {
        2 * self.memory.size()
    }

    /// Numbers of scratch space that a step of one object needs, without its points.
    pub fn scratch(&self) -> usize {
        let (sizes, size, form) = (self.options.sizes(), self.memory.size(), &self.options);
        let own = sizes.motion_seen + sizes.motion_said;
        let motion = own + size + sizes.motion_seen + form.hidden + self.memory.scratch(1);
        let own = sizes.scan_seen + form.hidden + sizes.scan_said + sizes.extent_seen + sizes.extent_said;
        let joined = 2 * form.encoder + sizes.scan_seen + size;
        motion.max(own + joined.max(2 * form.hidden + sizes.extent_seen))
    }

    /// Moves the memory of one object on by what is seen of it, and writes what that says of the motion.
    pub fn say_motion(&self, seen: &[f32], memory: &mut [f32], scratch: &mut [f32], said: &mut [f32]) {
        let mut room = Room(scratch);
        let joined = room.take(self.memory.size() + seen.len());
        let hidden = room.take(self.options.hidden);
        let (output, cell) = memory.split_at_mut(self.memory.size());
        self.memory.step(seen, output, cell, room.0);
        joined[..output.len()].copy_from_slice(output);
        joined[output.len()..].copy_from_slice(seen);
        self.motion.say(joined, hidden, said);
    }

    /// What a scan says: writes what the layer before it holds, and what is said.
    pub fn say_scan(
        &self,
        (rows, count): (&mut [f32], usize),
        seen: &[f32],
        memory: &[f32],
        scratch: &mut [f32],
        (hidden, said): (&mut [f32], &mut [f32]),
    ) {
        let width = self.options.encoder;
        let point = self.options.sizes().point;
        let mut room = Room(scratch);
        let joined = room.take(2 * width + seen.len() + self.memory.size());
        let (seen_points, rest) = rows.split_at_mut(count * point);
        let (first, rest) = rest.split_at_mut(count * width);
        let second = &mut rest[..count * width];
        self.points[0].forward_relu(seen_points, first);
        self.points[1].forward_relu(first, second);
        let (pooled, others) = joined.split_at_mut(2 * width);
        pool(second, width, pooled);
        others[..seen.len()].copy_from_slice(seen);
        others[seen.len()..].copy_from_slice(&memory[..self.memory.size()]);
        self.scan.say(joined, hidden, said);
    }

    /// Numbers of room for the points of a scan and what the encoder makes of them.
    pub fn room(&self, count: usize) -> usize {
        count * (self.options.sizes().point + 2 * self.options.encoder)
    }

    /// What the layer before the last word about a scan, and what is seen of the extent, say about it.
    pub fn say_extent(&self, scan: &[f32], seen: &[f32], scratch: &mut [f32], said: &mut [f32]) {
        let mut room = Room(scratch);
        let joined = room.take(scan.len() + seen.len());
        let hidden = room.take(self.options.hidden);
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

/// The layers of the publication.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PublishedLayers {
    pub options: Published,
    units: usize,
    memory: Option<Lstm>,
    prediction: Option<[Head; 3]>,
    update: Option<Head>,
}

impl PublishedLayers {
    pub fn take(weights: &mut Weights<'_>, options: Published, units: usize) -> Result<Self, ModelError> {
        let (seen, context, blocks) = (options.seen(units), options.context(units), options.blocks);
        let memory = if blocks.memory { Some(weights.lstm("memory", ESTIMATE_SEEN, units)?) } else { None };
        let prediction = if blocks.prediction {
            let mut head = |i: usize| Head::take(weights, PREDICTIONS[i], [seen, units, SAID[i]]);
            Some([head(0)?, head(1)?, head(2)?])
        } else {
            None
        };
        let update = if blocks.update {
            Some(Head::take(weights, "update", [SCAN_SEEN + context, units, SAID[3]])?)
        } else {
            None
        };
        Ok(PublishedLayers { options, units, memory, prediction, update })
    }

    /// Numbers of memory for one object: output and cell, or the last estimate.
    pub fn memory(&self) -> usize {
        if self.memory.is_some() { 2 * self.units } else { ESTIMATE_SEEN }
    }

    /// Numbers of scratch space for a step of one object.
    pub fn scratch(&self) -> usize {
        let gates = self.memory.as_ref().map_or(0, |memory| memory.scratch(1));
        let prediction = ESTIMATE_SEEN + self.options.seen(self.units) + PREDICTED;
        let update = SCAN_SEEN + self.options.context(self.units) + SAID[3];
        (prediction + gates).max(update) + self.units
    }

    /// Moves the memory of one object on by what is seen of its estimate, and writes what that says of the prediction.
    pub fn say_prediction(&self, seen: &[f32], memory: &mut [f32], scratch: &mut [f32], said: &mut [f32]) {
        let mut room = Room(scratch);
        let joined = room.take(self.options.seen(self.units));
        let hidden = room.take(self.units);
        match &self.memory {
            Some(layer) => {
                let (output, cell) = memory.split_at_mut(self.units);
                layer.step(seen, output, cell, room.0);
                joined[..self.units].copy_from_slice(output);
                joined[self.units..].copy_from_slice(seen);
            }
            None => {
                memory.copy_from_slice(seen);
                joined.copy_from_slice(seen);
            }
        }
        said.fill(0.0);
        if let Some(heads) = &self.prediction {
            let mut rest = said;
            for (head, width) in heads.iter().zip(SAID) {
                let (own, others) = rest.split_at_mut(width);
                head.say(joined, hidden, own);
                rest = others;
            }
        }
    }

    /// Writes what is said of a scan.
    pub fn say_update(&self, seen: &[f32], memory: &[f32], scratch: &mut [f32], said: &mut [f32]) {
        said.fill(0.0);
        if let Some(head) = &self.update {
            let mut room = Room(scratch);
            let context = self.options.context(self.units);
            let joined = room.take(seen.len() + context);
            let hidden = room.take(self.units);
            joined[..seen.len()].copy_from_slice(seen);
            joined[seen.len()..].copy_from_slice(&memory[..context]);
            head.say(joined, hidden, said);
        }
    }
}
