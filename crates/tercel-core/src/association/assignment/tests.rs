use proptest::prelude::*;
use rand::{RngExt, SeedableRng};

use super::*;

const FORBIDDEN: f64 = f64::INFINITY;

/// Lowest cost over all assignments of the rows from `row` on.
fn brute_force(costs: &[f64], columns: usize, misses: &[f64], row: usize, taken: u32) -> f64 {
    if row == misses.len() {
        return 0.0;
    }
    let mut best = misses[row] + brute_force(costs, columns, misses, row + 1, taken);
    for column in (0..columns).filter(|column| taken & (1 << column) == 0) {
        let cost = costs[row * columns + column];
        if cost < FORBIDDEN {
            best = best.min(cost + brute_force(costs, columns, misses, row + 1, taken | (1 << column)));
        }
    }
    best
}

/// Largest number of pairs, and the lowest cost with that many.
fn brute_force_maximum(costs: &[f64], rows: usize, columns: usize, row: usize, taken: u32) -> (usize, f64) {
    if row == rows {
        return (0, 0.0);
    }
    let mut best = brute_force_maximum(costs, rows, columns, row + 1, taken);
    for column in (0..columns).filter(|column| taken & (1 << column) == 0) {
        let cost = costs[row * columns + column];
        if cost < FORBIDDEN {
            let (pairs, rest) = brute_force_maximum(costs, rows, columns, row + 1, taken | (1 << column));
            if pairs + 1 > best.0 || (pairs + 1 == best.0 && cost + rest < best.1) {
                best = (pairs + 1, cost + rest);
            }
        }
    }
    best
}

fn consistent(best: &Assignment) {
    for (row, column) in best.columns.iter().enumerate() {
        if let Some(column) = column {
            assert_eq!(best.rows[*column], Some(row));
        }
    }
    assert_eq!(best.rows.iter().flatten().count(), best.pairs().count());
}

/// What the documentation of `Assignment` states of the dual values.
fn optimal(best: &Assignment, costs: &[f64], misses: &[f64]) {
    let columns = best.rows.len();
    consistent(best);
    for (row, &u) in best.row_duals.iter().enumerate() {
        assert!(u <= misses[row] + 1e-9);
        if best.columns[row].is_none() {
            assert!((u - misses[row]).abs() < 1e-9);
        }
        for (column, &v) in best.column_duals.iter().enumerate() {
            let reduced = costs[row * columns + column] - u - v;
            assert!(reduced > -1e-9, "row {row}, column {column}: {reduced}");
            if best.columns[row] == Some(column) {
                assert!(reduced < 1e-9, "row {row}, column {column}: {reduced}");
            }
        }
    }
    for (column, &v) in best.column_duals.iter().enumerate() {
        assert!(v <= 1e-9 && (best.rows[column].is_some() || v.abs() < 1e-9));
    }
    let duals: f64 = best.row_duals.iter().chain(&best.column_duals).sum();
    assert!((duals - best.cost).abs() < 1e-9);
}

/// Costs with ties, forbidden pairs and both signs.
fn cost() -> impl Strategy<Value = f64> {
    prop_oneof![
        3 => (-5i32..=5).prop_map(f64::from),
        3 => -10.0..10.0,
        2 => Just(FORBIDDEN),
    ]
}

fn problem() -> impl Strategy<Value = (Vec<f64>, usize, usize)> {
    (0usize..=6, 0usize..=6).prop_flat_map(|(rows, columns)| {
        (prop::collection::vec(cost(), rows * columns), Just(rows), Just(columns))
    })
}

proptest! {
    #[test]
    fn the_cost_is_the_lowest_of_all_assignments_of_most_rows((costs, rows, columns) in problem()) {
        let mut solver = AssignmentSolver::new();
        let best = solver.solve(&costs, rows, columns).unwrap();
        consistent(best);
        let (pairs, cost) = brute_force_maximum(&costs, rows, columns, 0, 0);
        prop_assert_eq!(best.pairs().count(), pairs);
        prop_assert!((best.cost - cost).abs() < 1e-9, "{} instead of {}", best.cost, cost);
        let paid: f64 = best.pairs().map(|(row, column)| costs[row * columns + column]).sum();
        prop_assert!((best.cost - paid).abs() < 1e-9);
    }

    #[test]
    fn dual_values_prove_the_assignment_of_all_rows(
        (rows, columns) in (0usize..=6, 0usize..=6),
        values in prop::collection::vec(-10.0..10.0, 36),
    ) {
        let costs = &values[..rows * columns];
        let mut solver = AssignmentSolver::new();
        let best = solver.solve(costs, rows, columns).unwrap();
        for row in 0..rows {
            for column in 0..columns {
                let reduced = costs[row * columns + column] - best.row_duals[row] - best.column_duals[column];
                prop_assert!(reduced > -1e-9 && (best.columns[row] != Some(column) || reduced < 1e-9));
            }
        }
        let duals: f64 = best.row_duals.iter().chain(&best.column_duals).sum();
        prop_assert!((duals - best.cost).abs() < 1e-9);
        let larger = if rows > columns { &best.row_duals } else { &best.column_duals };
        prop_assert!(larger.iter().all(|dual| *dual <= 1e-9));
    }

    #[test]
    fn with_misses_the_cost_is_the_lowest_of_all_assignments(
        (costs, rows, columns) in problem(),
        misses in prop::collection::vec(-10.0..10.0, 6),
    ) {
        let misses = &misses[..rows];
        let mut solver = AssignmentSolver::new();
        let best = solver.solve_or_miss(&costs, columns, misses).unwrap();
        prop_assert!((best.cost - brute_force(&costs, columns, misses, 0, 0)).abs() < 1e-9);
        optimal(best, &costs, misses);
    }

    #[test]
    fn rows_that_must_be_assigned_are_or_the_problem_is_refused(
        (costs, rows, columns) in problem(),
        misses in prop::collection::vec(prop_oneof![Just(FORBIDDEN), -5.0..5.0], 6),
    ) {
        let misses = &misses[..rows];
        let expected = brute_force(&costs, columns, misses, 0, 0);
        let mut solver = AssignmentSolver::new();
        match solver.solve_or_miss(&costs, columns, misses) {
            Ok(best) => {
                prop_assert!((best.cost - expected).abs() < 1e-9);
                optimal(best, &costs, misses);
            }
            Err(error) => {
                let refused = matches!(error, AssignmentError::Infeasible { .. });
                prop_assert!(refused);
                prop_assert_eq!(expected, FORBIDDEN);
            }
        }
    }

    #[test]
    fn sparse_entries_cost_what_their_matrix_costs(
        (costs, rows, columns) in problem(),
        misses in prop::collection::vec(-10.0..10.0, 6),
        doubled in prop::collection::vec(0.0..5.0, 36),
    ) {
        let misses = &misses[..rows];
        let mut entries: Vec<_> = (0..rows * columns)
            .filter(|k| costs[*k] < FORBIDDEN)
            .flat_map(|k| {
                let entry = (k / columns, k % columns, costs[k]);
                [(entry.0, entry.1, entry.2 + doubled[k]), entry]
            })
            .collect();
        entries.reverse();
        let mut solver = AssignmentSolver::new();
        let best = solver.solve_sparse(&entries, columns, misses).unwrap();
        optimal(best, &costs, misses);
    }

    #[test]
    fn a_used_solver_answers_as_a_new_one(problems in prop::collection::vec(problem(), 1..6)) {
        let mut used = AssignmentSolver::new();
        for (costs, rows, columns) in &problems {
            used.solve_or_miss(costs, *columns, &vec![1.0; *rows]).unwrap();
            let mut new = AssignmentSolver::new();
            let again = used.solve(costs, *rows, *columns).unwrap();
            prop_assert_eq!(again, new.solve(costs, *rows, *columns).unwrap());
        }
    }
}

#[test]
fn large_sparse_and_dense_problems_agree_and_are_proved() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let (rows, columns) = (1000, 2000);
    let mut costs = vec![FORBIDDEN; rows * columns];
    let mut entries = Vec::new();
    for row in 0..rows {
        for _ in 0..6 {
            let column = (2 * row + random.random_range(0..40)) % columns;
            let cost = random.random_range(0.0..10.0f64);
            entries.push((row, column, cost));
            let place = &mut costs[row * columns + column];
            *place = place.min(cost);
        }
    }
    let misses = vec![8.0; rows];
    let mut solver = AssignmentSolver::new();
    let sparse = solver.solve_sparse(&entries, columns, &misses).unwrap().cost;
    let dense = solver.solve_or_miss(&costs, columns, &misses).unwrap();
    assert!((sparse - dense.cost).abs() < 1e-8);
    for (k, cost) in costs.iter().enumerate() {
        assert!(cost - dense.row_duals[k / columns] - dense.column_duals[k % columns] > -1e-9);
    }
}

#[test]
fn a_chain_of_contested_columns_is_resolved_by_the_longest_path() {
    // Each row prefers the column of the row before it, so the last row to come moves all others.
    let mut entries: Vec<_> = (0..500).flat_map(|k| [(k, k, 0.0), (k, k + 1, 1e-3)]).collect();
    entries.push((500, 0, 0.0));
    let mut solver = AssignmentSolver::new();
    let best = solver.solve_sparse(&entries, 501, &[10.0; 501]).unwrap();
    assert!((best.cost - 0.5).abs() < 1e-9);
    assert_eq!(best.pairs().count(), 501);
}

#[test]
fn what_is_not_a_number_or_not_there_is_refused() {
    let mut solver = AssignmentSolver::new();
    let nan = solver.solve(&[1.0, 2.0, f64::NAN, 3.0], 2, 2).unwrap_err();
    assert!(matches!(nan, AssignmentError::Cost { row: 1, column: 0, .. }));
    let low = solver.solve_or_miss(&[f64::NEG_INFINITY], 1, &[0.0]).unwrap_err();
    assert!(matches!(low, AssignmentError::Cost { row: 0, column: 0, .. }));
    assert!(matches!(solver.solve(&[1e200], 1, 1), Err(AssignmentError::Cost { .. })));
    let miss = solver.solve_or_miss(&[1.0, 1.0], 1, &[0.0, f64::NAN]).unwrap_err();
    assert!(matches!(miss, AssignmentError::Miss { row: 1, .. }));
    let shape = solver.solve(&[1.0, 2.0, 3.0], 2, 2).unwrap_err();
    assert_eq!(shape.to_string(), "2 x 2 assignment needs 4 costs and got 3");
    let outside = solver.solve_sparse(&[(0, 2, 1.0)], 2, &[0.0]).unwrap_err();
    assert!(matches!(outside, AssignmentError::Outside { row: 0, column: 2, rows: 1, columns: 2 }));
}

#[test]
fn empty_problems_have_empty_answers() {
    let mut solver = AssignmentSolver::new();
    assert_eq!(solver.solve(&[], 0, 0).unwrap().cost, 0.0);
    assert_eq!(solver.solve(&[], 3, 0).unwrap().columns, [None; 3]);
    assert_eq!(solver.solve(&[], 0, 3).unwrap().rows, [None; 3]);
    assert_eq!(solver.solve_or_miss(&[], 0, &[1.0, 2.0]).unwrap().cost, 3.0);
}
