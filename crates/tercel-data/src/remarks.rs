//! What a reader has to say beside the table.

use std::borrow::Cow;

use crate::error::DataError;
use crate::import::LeftOut;
use crate::options::OnError;

/// Decisions and losses on the way from a file to a table.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Remarks {
    /// What was decided and the user should know, in sentences.
    pub notes: Vec<String>,
    /// Rows that are not in the table, by reason.
    pub left_out: Vec<LeftOut>,
    on_error: OnError,
}

impl Remarks {
    pub fn new(on_error: OnError) -> Self {
        Remarks { on_error, ..Remarks::default() }
    }

    /// Counts a row that cannot be used, or hands its error back.
    pub fn refuse(&mut self, error: DataError) -> Result<(), DataError> {
        match error.reason().filter(|_| self.on_error == OnError::Skip) {
            Some(reason) => {
                self.leave_out(reason, 1);
                Ok(())
            }
            None => Err(with_way_out(error)),
        }
    }

    /// Counts rows that are left out.
    pub fn leave_out(&mut self, reason: impl Into<Cow<'static, str>>, rows: usize) {
        /// A file with more kinds of faults than this is no table; the rest is counted together.
        const REASONS: usize = 32;
        if rows == 0 {
            return;
        }
        let reason = reason.into();
        let full = self.left_out.len() >= REASONS;
        let reason = if full && !self.left_out.iter().any(|left| left.reason == reason) {
            "other faults".into()
        } else {
            reason
        };
        match self.left_out.iter_mut().find(|left| left.reason == reason) {
            Some(left) => left.rows += rows,
            None => self.left_out.push(LeftOut { reason, rows }),
        }
    }

    /// Says something once.
    pub fn note(&mut self, note: String) {
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// Adds what another reader has to say.
    pub fn join(&mut self, other: Remarks) {
        for LeftOut { reason, rows } in other.left_out {
            self.leave_out(reason, rows);
        }
        other.notes.into_iter().for_each(|note| self.note(note));
    }
}

/// An error of one row, with what can be done where nothing better is known.
fn with_way_out(mut error: DataError) -> DataError {
    if let DataError::Value { help: help @ None, .. } = &mut error {
        *help = Some("correct it, or leave such rows out and count them: --on-error skip".into());
    }
    error
}
