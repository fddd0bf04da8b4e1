//! What the network sees and says of a batch, as operations with backward passes of their own.

use std::sync::Arc;

use tercel_neural::filter::ExtentNetHyper;
use tercel_neural::filter::extent_net::{SEEN, Scan, TOLD, Told};
use tercel_neural::filter::rmm_net::Number;

use crate::backend::{Forward, Matrix, Operation, Past};
use crate::task::rmm_net::Rows;

/// What counts as given in a step of the batch.
#[derive(Debug)]
pub struct Given {
    pub hyper: Arc<ExtentNetHyper>,
    /// The scans, where they have points, and by how much the origins move.
    pub scans: Vec<(Option<Scan>, [f64; 2])>,
}

impl Given {
    fn prior<T: Number>(&self, before: &[T]) -> Told<T> {
        Told::of(before).moved(self.hyper.interval)
    }
}

/// Of the rows of the last estimates gives what the network sees.
#[derive(Debug, Clone)]
pub struct See(pub Arc<Given>);

impl Rows<1, SEEN> for See {
    fn of<T: Number>(&self, member: usize, [before]: [&[T]; 1]) -> [T; SEEN] {
        match &self.0.scans[member].0 {
            Some(scan) => self.0.hyper.see(&self.0.prior(before), scan),
            None => [T::of(0.0); SEEN],
        }
    }
}

impl Operation<1> for See {
    type Saved = ();

    fn forward(&self, inputs: &[Matrix; 1]) -> Forward<()> {
        self.values(inputs)
    }

    fn backward(&self, past: Past<'_, (), 1>, gradient: &[f32]) -> [Option<Vec<f32>>; 1] {
        self.slopes(past.inputs, gradient)
    }
}

/// Of the rows of the last estimates and of what the network says gives the rows of the next.
#[derive(Debug, Clone)]
pub struct Tell(pub Arc<Given>);

impl Rows<2, TOLD> for Tell {
    fn of<T: Number>(&self, member: usize, [before, said]: [&[T]; 2]) -> [T; TOLD] {
        let (scan, shift) = &self.0.scans[member];
        let prior = self.0.prior(before);
        let mut told = match scan {
            Some(scan) => self.0.hyper.told(&prior, scan, said),
            None => prior,
        };
        told.place = [0, 1].map(|i| told.place[i] + -shift[i]);
        told.numbers()
    }
}

impl Operation<2> for Tell {
    type Saved = ();

    fn forward(&self, inputs: &[Matrix; 2]) -> Forward<()> {
        self.values(inputs)
    }

    fn backward(&self, past: Past<'_, (), 2>, gradient: &[f32]) -> [Option<Vec<f32>>; 2] {
        self.slopes(past.inputs, gradient)
    }
}
