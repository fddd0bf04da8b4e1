//! Sums over all assignments of a cluster by the sets of columns that they take.

use super::Local;

/// Number of steps that [`solve`] takes: a row at a time, for each set of the columns that several rows want.
pub(super) fn steps(local: &Local) -> usize {
    let contested = local.wanted.iter().filter(|wanted| **wanted > 1).count();
    let states = u32::try_from(contested).ok().and_then(|bits| 1_usize.checked_shl(bits));
    states.and_then(|states| states.checked_mul(local.rows)).unwrap_or(usize::MAX)
}

/// Finds the probabilities of the entries. What the rows before one make of each set of columns meets what the rows after it
/// make of the rest, so every assignment counts once without being listed.
pub(super) fn solve(local: &mut Local) {
    let cluster = Sets::new(local);
    let after = cluster.after();
    let mut before = vec![0.0; cluster.states];
    before[0] = 1.0;
    let mut result = vec![0.0; local.entries.len()];
    for row in 0..local.rows {
        let next = &after[(row + 1) * cluster.states..][..cluster.states];
        let range = local.starts[row]..local.starts[row + 1];
        let alone: f64 = before.iter().zip(next).map(|(before, after)| before * after).sum();
        let mut total = alone * cluster.free[row];
        for place in range.clone() {
            let (bit, weight) = (cluster.bits[local.entries[place].column], local.entries[place].weight);
            let share = match bit {
                0 => alone,
                _ => cluster.without(bit).map(|set| before[set] * next[set | bit]).sum(),
            };
            result[place] = share * weight;
            total += if bit == 0 { 0.0 } else { result[place] };
        }
        result[range].iter_mut().for_each(|share| *share /= total);
        before = cluster.advanced(row, &before);
    }
    local.result = result;
}

/// A cluster whose assignments are told apart by the set of contested columns that they take.
struct Sets<'a> {
    local: &'a Local,
    states: usize,
    /// The bit of each contested column in a set, zero for the others.
    bits: Vec<usize>,
    /// Weight of each row without a contested column: with none at all, or with one that nobody else wants.
    free: Vec<f64>,
}

impl<'a> Sets<'a> {
    fn new(local: &'a Local) -> Self {
        let mut states = 1;
        let bit = |wanted: &usize| match *wanted > 1 {
            true => {
                states *= 2;
                states / 2
            }
            false => 0,
        };
        let bits: Vec<usize> = local.wanted.iter().map(bit).collect();
        let mut free = vec![1.0; local.rows];
        for entry in local.entries.iter().filter(|entry| bits[entry.column] == 0) {
            free[entry.row] += entry.weight;
        }
        Sets { local, states, bits, free }
    }

    /// The sets that lack a column.
    fn without(&self, bit: usize) -> impl Iterator<Item = usize> {
        (0..self.states).filter(move |set| set & bit == 0)
    }

    /// The contested columns of a row as bits, with their weights.
    fn choices(&self, row: usize) -> impl Iterator<Item = (usize, f64)> {
        let entries = &self.local.entries[self.local.starts[row]..self.local.starts[row + 1]];
        entries.iter().map(|entry| (self.bits[entry.column], entry.weight)).filter(|(bit, _)| *bit != 0)
    }

    /// Weight of the assignments of the first rows that take each set, after one more row.
    fn advanced(&self, row: usize, before: &[f64]) -> Vec<f64> {
        let mut next: Vec<f64> = before.iter().map(|weight| weight * self.free[row]).collect();
        for (bit, weight) in self.choices(row) {
            self.without(bit).for_each(|set| next[set | bit] += before[set] * weight);
        }
        scale(&mut next);
        next
    }

    /// Weight of the assignments of each row and those after it where a set is taken already; the sets of the first row, then
    /// those of the second, up to one after the last.
    fn after(&self) -> Vec<f64> {
        let mut after = vec![1.0; (self.local.rows + 1) * self.states];
        for row in (0..self.local.rows).rev() {
            let (head, next) = after.split_at_mut((row + 1) * self.states);
            let here = &mut head[row * self.states..];
            here.iter_mut().zip(&*next).for_each(|(here, next)| *here = next * self.free[row]);
            for (bit, weight) in self.choices(row) {
                self.without(bit).for_each(|set| here[set] += next[set | bit] * weight);
            }
            scale(here);
        }
        after
    }
}

/// Only ratios matter, and products of many weights must stay finite.
fn scale(weights: &mut [f64]) {
    let top = weights.iter().copied().fold(0.0, f64::max);
    if top > 0.0 {
        weights.iter_mut().for_each(|weight| *weight /= top);
    }
}
