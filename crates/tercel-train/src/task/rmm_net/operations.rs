//! A step of the filter, the pooling of points, and the costs, as operations with backward passes of their own.

use std::sync::Arc;

use tercel_neural::filter::rmm_net::{Aligned, Length, Moments, Number, Past, Published, View};

use super::cost::{Costs, Truth};
use super::rows::{EXTENDED, Layout, STEP, extended, extended_numbers, shifted, step, track};
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
    /// By how much the origin moves.
    pub shift: [f64; 2],
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

impl Rows<4, STEP> for Step {
    fn of<T: Number>(&self, member: usize, [before, motion, scan, extent]: [&[T]; 4]) -> [T; STEP] {
        let given = &self.given[member];
        let past = Past { heading: given.heading, velocities: &given.velocities, expected: given.expected };
        let prior = track(before).predict(&self.options, &past, motion, self.length);
        let expected = prior.foresee(&self.options, given.held, motion);
        let row = match &given.view {
            None => step(&prior, &expected, &expected, &prior),
            Some(view) => {
                let mut after = prior.update(&self.options, view, scan);
                let found = after.settle_extent(&self.options, view, extent);
                step(&after, &found, &expected, &prior)
            }
        };
        shifted(row, given.shift)
    }
}

fn variables<'t>(tape: &'t Tape, row: &[f32]) -> Vec<Variable<'t>> {
    row.iter().map(|x| tape.variable(f64::from(*x))).collect()
}

fn row(matrix: &Matrix, member: usize) -> &[f32] {
    &matrix.values()[member * matrix.columns()..][..matrix.columns()]
}

/// A step of single numbers on the rows of some inputs, which gives `WIDTH` numbers for each member.
pub trait Rows<const N: usize, const WIDTH: usize> {
    /// The step of one member.
    fn of<T: Number>(&self, member: usize, inputs: [&[T]; N]) -> [T; WIDTH];

    /// The step of all members.
    fn values(&self, inputs: &[Matrix; N]) -> Forward<()> {
        let members = inputs[0].rows();
        let mut values = Vec::with_capacity(members * WIDTH);
        for member in 0..members {
            let wide = |input: &Matrix| row(input, member).iter().map(|x| f64::from(*x)).collect::<Vec<_>>();
            let inputs = inputs.each_ref().map(wide);
            let found = self.of(member, inputs.each_ref().map(Vec::as_slice));
            values.extend(found.map(|value| value as f32));
        }
        Forward { values, shape: [members, WIDTH], saved: () }
    }

    /// The gradients with respect to the inputs, given that of the values.
    fn slopes(&self, inputs: &[Matrix; N], gradient: &[f32]) -> [Option<Vec<f32>>; N] {
        let mut found = inputs.each_ref().map(|input| vec![0.0_f32; input.rows() * input.columns()]);
        let (mut tape, mut slopes) = (Tape::default(), Vec::new());
        for member in 0..inputs[0].rows() {
            tape.clear();
            let inputs = inputs.each_ref().map(|input| variables(&tape, row(input, member)));
            let values = self.of(member, inputs.each_ref().map(Vec::as_slice));
            let given = gradient[member * WIDTH..].iter().map(|weight| f64::from(*weight));
            let weighed: Vec<_> = values.into_iter().zip(given).collect();
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

impl Operation<4> for Step {
    type Saved = ();

    fn forward(&self, inputs: &[Matrix; 4]) -> Forward<()> {
        self.values(inputs)
    }

    fn backward(&self, past: Before<'_, (), 4>, gradient: &[f32]) -> [Option<Vec<f32>>; 4] {
        self.slopes(past.inputs, gradient)
    }
}

/// The same of the form of the publication: of states and extents and what the network says of prediction and scan.
#[derive(Debug, Clone)]
pub struct PublishedStep {
    pub options: Arc<Published>,
    pub dt: f64,
    pub seen: Arc<Vec<Scan>>,
}

/// What counts as given in the published step of one member.
#[derive(Debug, Clone)]
pub struct Scan {
    /// The scan, if it has points.
    pub moments: Option<Moments>,
    /// By how much the origin moves.
    pub shift: [f64; 2],
}

impl Rows<3, EXTENDED> for PublishedStep {
    fn of<T: Number>(&self, member: usize, [before, prediction, scan]: [&[T]; 3]) -> [T; EXTENDED] {
        let prior = extended(before).predict(&self.options, prediction, self.dt);
        let Scan { moments, shift } = &self.seen[member];
        let after = moments.as_ref().map(|seen| prior.update(&self.options, seen, scan));
        shifted(extended_numbers(&after.unwrap_or(prior)), *shift)
    }
}

impl Operation<3> for PublishedStep {
    type Saved = ();

    fn forward(&self, inputs: &[Matrix; 3]) -> Forward<()> {
        self.values(inputs)
    }

    fn backward(&self, past: Before<'_, (), 3>, gradient: &[f32]) -> [Option<Vec<f32>>; 3] {
        self.slopes(past.inputs, gradient)
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

/// The cost of each row, given the truth.
#[derive(Debug, Clone)]
pub struct Judge {
    pub costs: Costs,
    pub layout: Layout,
    pub truth: Arc<Vec<Truth>>,
}

impl Operation<1> for Judge {
    type Saved = ();

    fn forward(&self, [rows]: &[Matrix; 1]) -> Forward<()> {
        let cost = |member: usize| {
            let constant = |x: &f32| Variable::of(f64::from(*x));
            let row: Vec<Variable<'_>> = row(rows, member).iter().map(constant).collect();
            self.costs.of(&self.layout.read(&row), &self.truth[member]).value() as f32
        };
        Forward { values: (0..rows.rows()).map(cost).collect(), shape: [rows.rows(), 1], saved: () }
    }

    fn backward(&self, past: Before<'_, (), 1>, gradient: &[f32]) -> [Option<Vec<f32>>; 1] {
        let [rows] = past.inputs;
        let mut found = Vec::with_capacity(rows.rows() * rows.columns());
        let (mut tape, mut slopes) = (Tape::default(), Vec::new());
        for (member, weight) in gradient.iter().enumerate() {
            tape.clear();
            let row = variables(&tape, row(rows, member));
            let cost = self.costs.of(&self.layout.read(&row), &self.truth[member]);
            tape.slopes(&[(cost, f64::from(*weight))], &mut slopes);
            found.extend(row.iter().map(|input| slopes[input.place()] as f32));
        }
        [Some(found)]
    }
}
