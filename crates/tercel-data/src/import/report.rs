//! What objects say of themselves, report by report.

use std::sync::Arc;

use crate::error::DataError;
use crate::options::OnError;
use crate::remarks::Remarks;

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

/// The reports of one file, with what became of its other rows.
pub(super) struct Reports {
    reporter: Box<dyn Reporter>,
    pub remarks: Remarks,
}

impl Reports {
    pub fn new(reporter: Box<dyn Reporter>, on_error: OnError) -> Self {
        Reports { reporter, remarks: Remarks::new(on_error) }
    }

    /// The next report; at the end the notes of the file join the remarks.
    pub fn next(&mut self) -> Result<Option<Report>, DataError> {
        loop {
            match self.reporter.step() {
                Ok(Step::Report(report)) => return Ok(Some(report)),
                Ok(Step::Used) => {}
                Ok(Step::LeftOut(reason)) => self.remarks.leave_out(reason, 1),
                Ok(Step::End) => {
                    self.reporter.notes().into_iter().for_each(|note| self.remarks.note(note));
                    return Ok(None);
                }
                Err(error) => self.remarks.refuse(error)?,
            }
        }
    }
}
