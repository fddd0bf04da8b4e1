//! All assignments of a small cluster, one by one.

use super::Local;

/// Finds the probabilities of the entries by the sum over all assignments.
pub(super) fn solve(local: &mut Local) {
    let mut taken = vec![false; local.columns];
    let total = branch(local, 0, 1.0, &mut taken);
    local.result.iter_mut().for_each(|sum| *sum /= total);
}

/// Sum of the weights of all ways to go on from a row, given those of the rows before, whose product is `prefix`. Entries
/// collect the weights of the assignments that hold them.
fn branch(local: &mut Local, row: usize, prefix: f64, taken: &mut [bool]) -> f64 {
    if row == local.rows {
        return 1.0;
    }
    let mut sum = branch(local, row + 1, prefix, taken);
    for entry in local.starts[row]..local.starts[row + 1] {
        let (column, weight) = (local.entries[entry].column, local.entries[entry].weight);
        if taken[column] {
            continue;
        }
        taken[column] = true;
        let below = weight * branch(local, row + 1, prefix * weight, taken);
        taken[column] = false;
        local.result[entry] += prefix * below;
        sum += below;
    }
    sum
}
