//! Loopy belief propagation in a large cluster.

use super::Local;

/// Rounds of messages at most; they close in by a factor in each.
const ROUNDS: usize = 200;

/// Messages that change by less have converged.
const CONVERGED: f64 = 1e-7;

/// Visits of entries up to which each pair is conditioned on.
const AFFORDABLE: usize = 4_000_000;

/// The messages of a cluster, of which one row and one column may be left out.
struct Messages<'a> {
    local: &'a Local,
    /// Of each entry, from its row to its column and back.
    to_column: Vec<f64>,
    to_row: Vec<f64>,
    /// Sums of the messages at each row and column.
    rows: Vec<f64>,
    columns: Vec<f64>,
}

/// Finds the probabilities of the entries.
pub(super) fn solve(local: &mut Local) {
    let mut messages = Messages::new(local);
    messages.converge(None);
    let plain = messages.probabilities();
    // Each of the entries asks for some ten rounds over all.
    let result = if local.entries.len() * local.entries.len() * 10 <= AFFORDABLE {
        messages.conditioned()
    } else {
        plain
    };
    local.result = result;
}

impl<'a> Messages<'a> {
    fn new(local: &'a Local) -> Self {
        Messages {
            local,
            to_column: vec![0.0; local.entries.len()],
            to_row: vec![1.0; local.entries.len()],
            rows: vec![0.0; local.rows],
            columns: vec![0.0; local.columns],
        }
    }

    /// Sends messages until they stay, from those of the last time, among all rows and columns but those `left_out`.
    fn converge(&mut self, left_out: Option<(usize, usize)>) {
        let out = |row, column| left_out.is_some_and(|(r, c)| r == row || c == column);
        for _ in 0..ROUNDS {
            self.rows.fill(0.0);
            self.columns.fill(0.0);
            for (entry, message) in self.local.entries.iter().zip(&self.to_row) {
                if !out(entry.row, entry.column) {
                    self.rows[entry.row] += entry.weight * message;
                }
            }
            for (place, entry) in self.local.entries.iter().enumerate() {
                if !out(entry.row, entry.column) {
                    let others = (self.rows[entry.row] - entry.weight * self.to_row[place]).max(0.0);
                    self.to_column[place] = entry.weight / (1.0 + others);
                    self.columns[entry.column] += self.to_column[place];
                }
            }
            let mut change = 0.0_f64;
            for (place, entry) in self.local.entries.iter().enumerate() {
                if !out(entry.row, entry.column) {
                    let others = (self.columns[entry.column] - self.to_column[place]).max(0.0);
                    let message = 1.0 / (1.0 + others);
                    change = change.max((message - self.to_row[place]).abs());
                    self.to_row[place] = message;
                }
            }
            if change < CONVERGED {
                break;
            }
        }
        // The sums belong to the last messages.
        self.rows.fill(0.0);
        for (entry, message) in self.local.entries.iter().zip(&self.to_row) {
            if !out(entry.row, entry.column) {
                self.rows[entry.row] += entry.weight * message;
            }
        }
    }

    fn probabilities(&self) -> Vec<f64> {
        let entries = self.local.entries.iter().zip(&self.to_row);
        entries.map(|(entry, message)| entry.weight * message / (1.0 + self.rows[entry.row])).collect()
    }

    /// Logarithm of the Bethe approximation to the sum over all assignments, from messages that have converged.
    fn ln_sum(&self, left_out: (usize, usize)) -> f64 {
        let others = |count: &[f64], out: usize| -> f64 {
            count.iter().enumerate().filter(|(i, _)| *i != out).map(|(_, sum)| sum.ln_1p()).sum()
        };
        let pairs = self.local.entries.iter().zip(&self.to_column).zip(&self.to_row);
        let shared: f64 = pairs
            .filter(|((entry, _), _)| entry.row != left_out.0 && entry.column != left_out.1)
            .map(|((_, to_column), to_row)| (to_column * to_row).ln_1p())
            .sum();
        others(&self.rows, left_out.0) + others(&self.columns, left_out.1) - shared
    }

    /// Probabilities from the sums that remain when each pair, or the absence of any, is taken for granted.
    fn conditioned(&mut self) -> Vec<f64> {
        const NO_COLUMN: usize = usize::MAX;
        let mut result = vec![0.0; self.local.entries.len()];
        let settled = self.to_row.clone();
        let local = self.local;
        for row in 0..local.rows {
            let range = local.starts[row]..local.starts[row + 1];
            let mut ln_sum_without = |column: usize| {
                self.to_row.clone_from(&settled);
                self.converge(Some((row, column)));
                self.ln_sum((row, column))
            };
            let alone = ln_sum_without(NO_COLUMN);
            let mut sum = 1.0;
            for place in range.clone() {
                let entry = local.entries[place];
                result[place] = entry.weight * (ln_sum_without(entry.column) - alone).exp();
                sum += result[place];
            }
            result[range].iter_mut().for_each(|share| *share /= sum);
        }
        result
    }
}
