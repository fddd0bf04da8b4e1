//! All assignments of a small cluster, one by one.

use super::{Entry, Local};

/// What a row may take that others want as well.
struct Row {
    /// Weight of the choices that concern no other row: none, and the columns that are its own alone.
    alone: f64,
    /// Its first contested entry.
    first: usize,
}

/// A cluster without what concerns one row only.
struct Contest {
    rows: Vec<Row>,
    /// Column and weight of the contested entries, by row. Weights are relative to the row alone.
    entries: Vec<(usize, f64)>,
    /// Sum of the assignments that hold each entry.
    sums: Vec<f64>,
    taken: Vec<bool>,
}

/// Finds the probabilities of the entries by the sum over all assignments.
///
/// A column that only one row wants is in no other's way, so to take it is one of the ways in which a row leaves the contested
/// columns to the others. Only choices of these are enumerated.
pub(super) fn solve(local: &mut Local) {
    let mut contest = Contest::new(local);
    let total = contest.branch(0, 1.0);
    let mut place = 0;
    for row in 0..local.rows {
        let range = local.starts[row]..local.starts[row + 1];
        // Contested entries first: what they leave is shared by the rest.
        let mut left = 1.0;
        for entry in range.clone() {
            if local.is_contested(&local.entries[entry]) {
                local.result[entry] = contest.sums[place] / total;
                left -= local.result[entry];
                place += 1;
            }
        }
        for entry in range {
            if !local.is_contested(&local.entries[entry]) {
                local.result[entry] = left.max(0.0) * local.entries[entry].weight / contest.rows[row].alone;
            }
        }
    }
}

impl Local {
    /// Whether other rows want the column of an entry, too.
    pub(super) fn is_contested(&self, entry: &Entry) -> bool {
        self.wanted[entry.column] > 1
    }

    /// Number of the assignments to enumerate, counted without their conflicts.
    pub(super) fn events(&self) -> usize {
        let rows = self.starts.windows(2).map(|range| &self.entries[range[0]..range[1]]);
        let choices = rows.map(|row| row.iter().filter(|entry| self.is_contested(entry)).count() + 1);
        choices.fold(1, |events: usize, choices| events.saturating_mul(choices))
    }
}

impl Contest {
    fn new(local: &Local) -> Self {
        let mut contest = Contest {
            rows: Vec::with_capacity(local.rows + 1),
            entries: Vec::new(),
            sums: Vec::new(),
            taken: vec![false; local.columns],
        };
        for range in local.starts.windows(2) {
            let row = &local.entries[range[0]..range[1]];
            let own = row.iter().filter(|entry| !local.is_contested(entry));
            let alone = 1.0 + own.map(|entry| entry.weight).sum::<f64>();
            contest.rows.push(Row { alone, first: contest.entries.len() });
            let contested = row.iter().filter(|entry| local.is_contested(entry));
            contest.entries.extend(contested.map(|entry| (entry.column, entry.weight / alone)));
        }
        contest.rows.push(Row { alone: 1.0, first: contest.entries.len() });
        contest.sums.resize(contest.entries.len(), 0.0);
        contest
    }

    /// Sum of the weights of all ways to go on from a row, given those of the rows before, whose product is `prefix`. Entries
    /// collect the weights of the assignments that hold them.
    fn branch(&mut self, row: usize, prefix: f64) -> f64 {
        let last = row + 2 >= self.rows.len();
        let Some(next) = self.rows.get(row + 1) else { return 1.0 };
        let range = self.rows[row].first..next.first;
        let mut sum = if last { 1.0 } else { self.branch(row + 1, prefix) };
        for entry in range {
            let (column, weight) = self.entries[entry];
            if self.taken[column] {
                continue;
            }
            let below = if last {
                weight
            } else {
                self.taken[column] = true;
                let below = weight * self.branch(row + 1, prefix * weight);
                self.taken[column] = false;
                below
            };
            self.sums[entry] += prefix * below;
            sum += below;
        }
        sum
    }
}
