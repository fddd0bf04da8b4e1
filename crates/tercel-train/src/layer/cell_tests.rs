//! Cells against the run time, and their gradients against differences.

use tercel_neural::layer::{CellShape, Solver, Tangents};
use tercel_neural::{Card, Model};

use super::Cell;
use crate::backend::{Tensor, constant, values};
use crate::{Initial, ParameterSet, Weights};

const CELLS: [CellShape; 6] = [
    CellShape::Ltc { size: 9, unfolds: 6, solver: Solver::Fused },
    CellShape::Ltc { size: 4, unfolds: 20, solver: Solver::Euler },
    CellShape::Ltc { size: 5, unfolds: 10, solver: Solver::RungeKutta },
    CellShape::Cfc { size: 7, backbone: 11 },
    CellShape::Gru { size: 8 },
    CellShape::Mlp { size: 6, hidden: 5 },
];

const INPUTS: usize = 3;
const BATCH: usize = 4;

fn numbers(count: usize, salt: usize) -> Vec<f32> {
    (0..count).map(|i| ((i + 17 * salt) as f32 * 1.7).sin()).collect()
}

/// A cell with its parameters, an input and a memory, which are parameters too.
fn cell(shape: CellShape) -> (Cell, ParameterSet) {
    let mut set = ParameterSet::new(7);
    let cell = Cell::new(&mut set, "cell", INPUTS, shape).unwrap();
    let memory = numbers(BATCH * shape.size(), 2).iter().map(|x| 0.5 * x).collect();
    set.add("x", &[BATCH, INPUTS], Initial::Values(numbers(BATCH * INPUTS, 1))).unwrap();
    set.add("memory", &[BATCH, shape.size()], Initial::Values(memory)).unwrap();
    (cell, set)
}

fn stepped(cell: &Cell, weights: &Weights, elapsed: f32) -> Tensor {
    let [x, memory] = [2, 1].map(|back| weights.tensors()[weights.tensors().len() - back].clone());
    cell.step(weights, elapsed, x, memory)
}

#[test]
fn the_run_time_steps_as_the_training_for_200_steps() {
    for shape in CELLS {
        let mut set = ParameterSet::new(7);
        let trained = Cell::new(&mut set, "cell", INPUTS, shape).unwrap();
        let model = Model::new(Card::new("cell", "cell", &["x"]), set.tensors()).unwrap();
        let mut tensors = model.weights();
        let ran = tensors.cell("cell", INPUTS, shape).unwrap();
        tensors.finish().unwrap();
        let weights = Weights::frozen(&set);
        let mut memory = Cell::zero(BATCH, shape);
        let mut found = vec![0.0; BATCH * shape.size()];
        let mut scratch = vec![0.0; ran.scratch(BATCH, 0)];
        for step in 0..200 {
            let (x, elapsed) = (numbers(BATCH * INPUTS, step), [1.0, 0.4, 0.9][step % 3]);
            memory = trained.step(&weights, elapsed, constant(x.clone(), [BATCH, INPUTS]), memory);
            ran.step_along(elapsed, &x, &mut found, Tangents::none(), &mut scratch);
            for (trained, ran) in values(&memory).iter().zip(&found) {
                assert!(
                    (trained - ran).abs() < 1e-4 * ran.abs().max(0.1),
                    "{shape:?}, step {step}: {trained} {ran}"
                );
            }
        }
        assert!(found.iter().any(|value| value.abs() > 0.05), "{shape:?}");
    }
}

#[test]
fn the_gradients_of_cells_are_their_slopes() {
    for shape in CELLS {
        let (cell, set) = cell(shape);
        let weigh = numbers(BATCH * shape.size(), 5);
        let loss = |weights: &Weights| {
            let value = stepped(&cell, weights, 0.7);
            let dims = value.dims();
            (value * constant(weigh.clone(), dims)).sum().reshape([1, 1])
        };
        let exact = |set: &ParameterSet| -> f64 {
            let value = values(&stepped(&cell, &Weights::frozen(set), 0.7));
            value.iter().zip(&weigh).map(|(value, weight)| f64::from(*value) * f64::from(*weight)).sum()
        };
        let weights = Weights::trainable(&set);
        let found = weights.gradients(&loss(&weights));
        for (place, gradients) in found.iter().enumerate() {
            let name = set.iter().nth(place).unwrap().name().to_owned();
            let largest = gradients.iter().fold(0.0_f32, |largest, g| largest.max(g.abs()));
            // An MLP has no memory.
            assert!(
                largest > 1e-4 || (name == "memory" && matches!(shape, CellShape::Mlp { .. })),
                "{shape:?} {name}"
            );
            for index in (0..gradients.len()).step_by(1 + gradients.len() / 40) {
                let moved = |by: f32| {
                    let mut set = set.clone();
                    set.values_mut().nth(place).unwrap().1[index] += by;
                    exact(&set)
                };
                let slope = (moved(5e-3) - moved(-5e-3)) / 1e-2;
                let gradient = f64::from(gradients[index]);
                let error = (slope - gradient).abs();
                assert!(
                    error < 2e-4 + 5e-3 * slope.abs(),
                    "{shape:?} {name}[{index}]: {gradient} for {slope}"
                );
            }
        }
    }
}
