//! Loopy belief propagation in a large cluster, with exact sums in the surroundings of each row.

use super::{Entry, Local, enumeration};

/// Rounds of messages at most; they close in by a factor in each.
const ROUNDS: usize = 1000;

/// Messages that change by less, relative to themselves, have converged.
const CONVERGED: f64 = 1e-6;

/// Assignments of the surroundings of a row up to which these grow.
const SURROUNDINGS: usize = 8192;

/// Rows that compete with those of the surroundings by less, as the chance that both take one column, stay outside.
const LEAST_PULL: f64 = 1e-5;

/// Pairs of rows that want the same column, up to which the surroundings are looked at. A crowd beyond is no picture of
/// objects, and would take long.
const CROWD: usize = 1_000_000;

/// The messages of a cluster.
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
    messages.converge();
    let mut plain = messages.probabilities();
    let mut region = Region::new(local);
    if region.by_column.iter().map(|entries| entries.len() * entries.len()).sum::<usize>() > CROWD {
        share_out(local, &mut plain);
        local.result = plain;
        return;
    }
    let mut result = vec![0.0; local.entries.len()];
    for row in 0..local.rows {
        region.grow(&messages, &plain, row);
        let range = local.starts[row]..local.starts[row + 1];
        result[range].copy_from_slice(region.solve(&messages));
    }
    share_out(local, &mut result);
    local.result = result;
}

/// Reduces the claims to each column that exceed the whole of it: each row has looked at its own surroundings.
fn share_out(local: &Local, result: &mut [f64]) {
    let mut claimed = vec![0.0; local.columns];
    for (entry, probability) in local.entries.iter().zip(&*result) {
        claimed[entry.column] += probability;
    }
    for (entry, probability) in local.entries.iter().zip(result) {
        *probability /= f64::max(claimed[entry.column], 1.0);
    }
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

    /// Sends messages until they stay.
    fn converge(&mut self) {
        for _ in 0..ROUNDS {
            self.rows.fill(0.0);
            self.columns.fill(0.0);
            for (entry, message) in self.local.entries.iter().zip(&self.to_row) {
                self.rows[entry.row] += entry.weight * message;
            }
            for (place, entry) in self.local.entries.iter().enumerate() {
                let others = (self.rows[entry.row] - entry.weight * self.to_row[place]).max(0.0);
                self.to_column[place] = entry.weight / (1.0 + others);
                self.columns[entry.column] += self.to_column[place];
            }
            let mut change = 0.0_f64;
            for (place, entry) in self.local.entries.iter().enumerate() {
                let others = (self.columns[entry.column] - self.to_column[place]).max(0.0);
                let message = 1.0 / (1.0 + others);
                change = change.max((message / self.to_row[place] - 1.0).abs());
                self.to_row[place] = message;
            }
            if change < CONVERGED {
                break;
            }
        }
    }

    /// What the messages alone say.
    fn probabilities(&self) -> Vec<f64> {
        let entries = self.local.entries.iter().zip(&self.to_row);
        entries.map(|(entry, message)| entry.weight * message / (1.0 + self.rows[entry.row])).collect()
    }
}

/// A row with those that compete with it most.
struct Region {
    /// Entries of each column.
    by_column: Vec<Vec<usize>>,
    rows: Vec<usize>,
    inside: Vec<bool>,
    /// How much each row competes with those inside, and the rows of which this is not zero.
    pull: Vec<f64>,
    touched: Vec<usize>,
    part: Local,
}

impl Region {
    fn new(local: &Local) -> Self {
        let mut by_column = vec![Vec::new(); local.columns];
        for (place, entry) in local.entries.iter().enumerate() {
            by_column[entry.column].push(place);
        }
        Region {
            by_column,
            rows: Vec::new(),
            inside: vec![false; local.rows],
            pull: vec![0.0; local.rows],
            touched: Vec::new(),
            part: Local::default(),
        }
    }

    /// Starts with one row and takes in the strongest competitors, while the assignments stay few enough to be enumerated.
    fn grow(&mut self, messages: &Messages<'_>, plain: &[f64], first: usize) {
        let local = messages.local;
        self.rows.drain(..).for_each(|row| self.inside[row] = false);
        self.touched.drain(..).for_each(|row| self.pull[row] = 0.0);
        let (mut next, mut events) = (Some(first), 1);
        while let Some(row) = next {
            let range = local.starts[row]..local.starts[row + 1];
            events *= range.clone().filter(|&place| local.is_contested(&local.entries[place])).count() + 1;
            if events > SURROUNDINGS && row != first {
                break;
            }
            self.inside[row] = true;
            self.rows.push(row);
            for place in range {
                for &other in &self.by_column[local.entries[place].column] {
                    let rival = local.entries[other].row;
                    if self.pull[rival] == 0.0 {
                        self.touched.push(rival);
                    }
                    // Never zero, so that each row is listed once.
                    self.pull[rival] += (plain[place] * plain[other]).max(f64::MIN_POSITIVE);
                }
            }
            let outside = self.touched.iter().copied().filter(|&row| !self.inside[row]);
            let outside = outside.filter(|&row| self.pull[row] >= LEAST_PULL);
            next = outside.max_by(|&a, &b| self.pull[a].total_cmp(&self.pull[b]).then(b.cmp(&a)));
        }
    }

    /// Probabilities of the entries of the first row, by the sum over the assignments of the region. What the rows outside
    /// claim of its columns is what their messages say.
    fn solve(&mut self, messages: &Messages<'_>) -> &[f64] {
        let (local, part) = (messages.local, &mut self.part);
        part.entries.clear();
        part.starts.clear();
        part.result.clear();
        part.wanted.clear();
        part.wanted.resize(local.columns, 0);
        (part.rows, part.columns) = (self.rows.len(), local.columns);
        for (number, &row) in self.rows.iter().enumerate() {
            part.starts.push(part.entries.len());
            for place in local.starts[row]..local.starts[row + 1] {
                let Entry { column, weight, .. } = local.entries[place];
                let rivals = self.by_column[column].iter();
                let claimed: f64 = rivals
                    .filter(|&&other| !self.inside[local.entries[other].row])
                    .map(|&other| messages.to_column[other])
                    .sum();
                part.wanted[column] += 1;
                part.entries.push(Entry { row: number, column, weight: weight / (1.0 + claimed), place });
            }
        }
        part.starts.push(part.entries.len());
        part.result.resize(part.entries.len(), 0.0);
        enumeration::solve(part);
        &part.result[..part.starts[1]]
    }
}
