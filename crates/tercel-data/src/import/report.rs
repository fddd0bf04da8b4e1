//! What objects say of themselves, report by report, and what became of the rows that are none.

use std::borrow::Cow;
use std::sync::Arc;

use super::LeftOut;
use crate::error::DataError;
use crate::options::OnError;

/// One report of an object about itself.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Report {
    /// Unix seconds.
    pub time: f64,
    pub object: Option<Arc<str>>,
    /// WGS84, rad.
    pub latitude: f64,
    /// WGS84, rad.
    pub longitude: f64,
    /// m, where it was reported.
    pub altitude: Option<f64>,
    /// m/s over ground, and course clockwise from north, rad.
    pub motion: Option<(f64, f64)>,
}

/// What became of the next row of a file.
#[derive(Debug)]
pub(super) enum Step {
    Report(Report),
    /// Left out, with the reason.
    LeftOut(&'static str),
    /// Nothing by itself: a part of a message, or news of an object without its position.
    Used,
    /// There are no more rows.
    End,
}

/// Left out when a row says no time or no place.
pub(super) const NOWHERE: &str = "without a time or position";

/// Reads the rows of one file.
pub(super) trait Reporter {
    /// What becomes of the next row. After an error that concerns one row the next call goes on behind it.
    fn step(&mut self) -> Result<Step, DataError>;

    /// What is worth saying about the file, once all is read.
    fn notes(&self) -> Vec<String>;
}

/// What became of the rows that are not in the tables, and what is worth saying.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Account {
    pub left_out: Vec<LeftOut>,
    pub notes: Vec<String>,
}

impl Account {
    /// Counts rows that are left out.
    pub fn leave_out(&mut self, reason: impl Into<Cow<'static, str>>, rows: usize) {
        let reason = reason.into();
        if rows == 0 {
            return;
        }
        match self.left_out.iter_mut().find(|known| known.reason == reason) {
            Some(known) => known.rows += rows,
            None => self.left_out.push(LeftOut { reason, rows }),
        }
    }

    /// Adds what another one says.
    pub fn join(&mut self, other: Account) {
        for LeftOut { reason, rows } in other.left_out {
            self.leave_out(reason, rows);
        }
        other.notes.into_iter().for_each(|note| self.note(note));
    }

    pub fn note(&mut self, note: String) {
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// Counts a row that cannot be used, if such rows may be left out.
    fn excuse(&mut self, error: DataError, on_error: OnError) -> Result<(), DataError> {
        match (on_error, reason(&error)) {
            (OnError::Skip, Some(reason)) => {
                self.leave_out(reason, 1);
                Ok(())
            }
            _ => Err(error),
        }
    }
}

/// Why a row cannot be used, in words that are the same for all such rows; nothing for errors of the whole file.
fn reason(error: &DataError) -> Option<String> {
    match error {
        DataError::Value { column, expected, .. } => Some(format!("`{column}` is not {expected}")),
        DataError::Row { problem, .. } => Some(problem.clone()),
        _ => None,
    }
}

/// The reports of one file, with an account of its other rows.
pub(super) struct Reports {
    reporter: Box<dyn Reporter>,
    on_error: OnError,
    pub account: Account,
}

impl Reports {
    pub fn new(reporter: Box<dyn Reporter>, on_error: OnError) -> Self {
        Reports { reporter, on_error, account: Account::default() }
    }

    /// The next report; at the end the notes of the file join the account.
    pub fn next(&mut self) -> Result<Option<Report>, DataError> {
        loop {
            match self.reporter.step() {
                Ok(Step::Report(report)) => return Ok(Some(report)),
                Ok(Step::Used) => {}
                Ok(Step::LeftOut(reason)) => self.account.leave_out(reason, 1),
                Ok(Step::End) => {
                    self.reporter.notes().into_iter().for_each(|note| self.account.note(note));
                    return Ok(None);
                }
                Err(error) => self.account.excuse(error, self.on_error)?,
            }
        }
    }
}
