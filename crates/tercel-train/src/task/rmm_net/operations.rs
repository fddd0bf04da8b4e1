//! A step of the filter, the pooling of points, and the costs, as operations with backward passes of their own.

use std::sync::Arc;

use tercel_neural::filter::rmm_net::{Aligned, Length, Number, Past, View};

use super::cost::{Costs, Truth};
use super::rows::{STEP, TRACK, step, track};
use crate::backend::{Forward, Matrix, Operation, Past as Before};
use crate::tape::{Tape, Variable};

/// What counts as given in the step of one member.
#[derive(Debug, Clone)]
pub struct Given {
    pub heading: [f64; 2],
    pub velocities: Vec<[f64; 2]>,
    pub expected: [f64; 2],
    /// The direction of the extent before.
    pub held: f64,
    /// The scan, if it has points.
    pub view: Option<View>,
}

/// Prediction, update and extent: of tracks `[members, TRACK]` and what the network says of motion, scan and extent, gives rows
/// of [`STEP`] numbers.
#[derive(Debug, Clone)]
pub struct Step {
    pub options: Arc<Aligned>,
    pub length: Length,
    pub given: Arc<Vec<Given>>,
}

impl Step {
    fn take<T: Number>(&self, member: usize, before: &[T], said: [&[T]; 3]) -> [T; STEP] {
        let given = &self.given[member];
        let past = Past { heading: given.heading, velocities: &given.velocities, expected: given.expected };
        let prior = track(before).predict(&self.options, &past, said[0], self.length);
        let expected = prior.foresee(&self.options, given.held, said[0]);
        match &given.view {
            None => step(&prior, &expected, &expected, &prior),
            Some(view) => {
                let mut after = prior.update(&self.options, view, said[1]);
                let found = after.settle_extent(&self.options, view, said[2]);
                step(&after, &found, &expected, &prior)
            }
        }
    }
}

fn row(matrix: &Matrix, member: usize) -> &[f32] {
    &matrix.values()[member * matrix.columns()..][..matrix.columns()]
}

impl Operation<4> for Step {
    type Saved = ();

    fn forward(&self, inputs: &[Matrix; 4]) -> Forward<()> {
        let members = inputs[0].rows();
        let mut values = Vec::with_capacity(members * STEP);
        for member in 0..members {
            let [before, motion, scan, extent] = inputs
                .each_ref()
                .map(|input| row(input, member).iter().map(|x| f64::from(*x)).collect::<Vec<_>>());
            let after = self.take(member, &before, [&motion, &scan, &extent]);
            values.extend(after.map(|value| value as f32));
        }
        Forward { values, shape: [members, STEP], saved: () }
    }

    fn backward(&self, past: Before<'_, (), 4>, gradient: &[f32]) -> [Option<Vec<f32>>; 4] {
        let members = past.inputs[0].rows();
        let mut found = past.inputs.each_ref().map(|input| vec![0.0_f32; input.rows() * input.columns()]);
        let (mut tape, mut slopes) = (Tape::default(), Vec::new());
        for member in 0..members {
            tape.clear();
            let inputs = past.inputs.each_ref().map(|input| {
                row(input, member).iter().map(|x| tape.variable(f64::from(*x))).collect::<Vec<Variable<'_>>>()
            });
            let after = self.take(member, &inputs[0], [&inputs[1], &inputs[2], &inputs[3]]);
            let given = &gradient[member * STEP..][..STEP];
            let weighed: Vec<_> =
                after.into_iter().zip(given).map(|(value, weight)| (value, f64::from(*weight))).collect();
            tape.slopes(&weighed, &mut slopes);
            for (found, inputs) in found.iter_mut().zip(&inputs) {
                let found = &mut found[member * inputs.len()..][..inputs.len()];
                for (found, input) in found.iter_mut().zip(inputs) {
                    *found = slopes[input.place()] as f32;
                }
            }
        }
        found.map(Some)
    }
}

/// Mean and maximum of the rows of each member, of which there are `counts`; zero without rows.
#[derive(Debug, Clone)]
pub struct Pool {
    pub counts: Arc<Vec<usize>>,
}

impl Operation<1> for Pool {
    /// The row in which each maximum stands.
    type Saved = Vec<u32>;

    fn forward(&self, [rows]: &[Matrix; 1]) -> Forward<Vec<u32>> {
        let width = rows.columns();
        let mut values = vec![0.0; self.counts.len() * 2 * width];
        let mut places = vec![0; self.counts.len() * width];
        let mut first = 0;
        let out = values.chunks_exact_mut(2 * width).zip(places.chunks_exact_mut(width));
        for (count, (out, places)) in self.counts.iter().zip(out) {
            let (mean, largest) = out.split_at_mut(width);
            for number in first..first + count {
                let row = row(rows, number);
                for i in 0..width {
                    mean[i] += row[i] / *count as f32;
                    if number == first || row[i] > largest[i] {
                        largest[i] = row[i];
                        places[i] = number as u32;
                    }
                }
            }
            first += count;
        }
        Forward { values, shape: [self.counts.len(), 2 * width], saved: places }
    }

    fn backward(&self, past: Before<'_, Vec<u32>, 1>, gradient: &[f32]) -> [Option<Vec<f32>>; 1] {
        let [rows] = past.inputs;
        let width = rows.columns();
        let mut found = vec![0.0; rows.rows() * width];
        let mut first = 0;
        let given = gradient.chunks_exact(2 * width).zip(past.saved.chunks_exact(width));
        for (count, (given, places)) in self.counts.iter().zip(given) {
            let (mean, largest) = given.split_at(width);
            for row in found[first * width..(first + count) * width].chunks_exact_mut(width) {
                for (found, mean) in row.iter_mut().zip(mean) {
                    *found += mean / *count as f32;
                }
            }
            if *count > 0 {
                for (i, place) in places.iter().enumerate() {
                    found[*place as usize * width + i] += largest[i];
                }
            }
            first += count;
        }
        [Some(found)]
    }
}

/// The cost of each row of [`STEP`] numbers, given the truth.
#[derive(Debug, Clone)]
pub struct Judge {
    pub costs: Costs,
    pub truth: Arc<Vec<Truth>>,
}

impl Operation<1> for Judge {
    type Saved = ();

    fn forward(&self, [rows]: &[Matrix; 1]) -> Forward<()> {
        let tape = Tape::default();
        let cost = |member: usize| {
            let row: Vec<Variable<'_>> =
                row(rows, member).iter().map(|x| Variable::of(f64::from(*x))).collect();
            let _ = &tape;
            self.costs.of(&row, &self.truth[member]).value() as f32
        };
        let values: Vec<f32> = (0..rows.rows()).map(cost).collect();
        Forward { values, shape: [rows.rows(), 1], saved: () }
    }

    fn backward(&self, past: Before<'_, (), 1>, gradient: &[f32]) -> [Option<Vec<f32>>; 1] {
        let [rows] = past.inputs;
        let mut found = Vec::with_capacity(rows.rows() * TRACK);
        let (mut tape, mut slopes) = (Tape::default(), Vec::new());
        for (member, weight) in gradient.iter().enumerate() {
            tape.clear();
            let row: Vec<Variable<'_>> =
                row(rows, member).iter().map(|x| tape.variable(f64::from(*x))).collect();
            let cost = self.costs.of(&row, &self.truth[member]);
            tape.slopes(&[(cost, f64::from(*weight))], &mut slopes);
            found.extend(row.iter().map(|input| slopes[input.place()] as f32));
        }
        [Some(found)]
    }
}
