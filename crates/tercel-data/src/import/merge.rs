//! Reports of several files in the order of time.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::ImportOptions;
use super::input::Input;
use super::report::{Report, Reports};
use super::source::Source;
use super::survey::Times;
use crate::error::DataError;
use crate::remarks::Remarks;

/// One file, which is open from its first report to its last.
///
/// Reports that are out of order are held back until no earlier one can come: it is known how late they are at most. So
/// memory grows with the disorder of a file, not with its length.
struct Part {
    input: Input,
    times: Times,
    reports: Option<Reports>,
    held: BinaryHeap<Held>,
    latest: f64,
    taken: u64,
    ended: bool,
}

/// A report that is held back. The earliest is the greatest; those of one time stay in the order of the file.
struct Held {
    report: Report,
    number: u64,
}

impl Ord for Held {
    fn cmp(&self, other: &Self) -> Ordering {
        let later = self.report.time.total_cmp(&other.report.time).then(self.number.cmp(&other.number));
        later.reverse()
    }
}

impl PartialOrd for Held {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Held {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Held {}

impl Part {
    /// The time of the next report, as far as it is known without opening the file.
    fn next_time(&self) -> Option<f64> {
        match &self.reports {
            None if !self.ended => Some(self.times.first),
            _ => self.held.peek().map(|held| held.report.time),
        }
    }

    /// Reads until the earliest report that is held back is the next one.
    fn fill(&mut self, remarks: &mut Remarks) -> Result<(), DataError> {
        // Differences of large times are rounded.
        const ROUNDED: f64 = 1e-3;
        let Part { times, reports: Some(reports), held, latest, taken, ended, .. } = self else {
            return Ok(());
        };
        let margin = if times.disorder == 0.0 { 0.0 } else { times.disorder + ROUNDED };
        while !*ended && held.peek().is_none_or(|held| held.report.time > *latest - margin) {
            match reports.next()? {
                Some(report) => {
                    *latest = latest.max(report.time);
                    *taken += 1;
                    held.push(Held { report, number: *taken });
                }
                None => {
                    *ended = true;
                    remarks.join(std::mem::take(&mut reports.remarks));
                }
            }
        }
        Ok(())
    }
}

/// The reports of files in the order of time.
pub(super) struct Merged {
    parts: Vec<Part>,
    source: Source,
    options: ImportOptions,
    /// What became of the rows of the files that were read to their ends.
    remarks: Remarks,
}

impl Merged {
    pub fn new(files: Vec<(Input, Times)>, source: Source, options: &ImportOptions) -> Self {
        let part = |(input, times)| Part {
            input,
            times,
            reports: None,
            held: BinaryHeap::new(),
            latest: f64::NEG_INFINITY,
            taken: 0,
            ended: false,
        };
        Merged {
            parts: files.into_iter().map(part).collect(),
            source,
            options: options.clone(),
            remarks: Remarks::default(),
        }
    }

    /// Adds what became of the rows of a file without reports.
    pub fn add(&mut self, remarks: Remarks) {
        self.remarks.join(remarks);
    }

    /// The next report.
    pub fn next(&mut self) -> Result<Option<Report>, DataError> {
        let Some(at) = self.earliest()? else { return Ok(None) };
        let part = &mut self.parts[at];
        let report = part.held.pop().map(|held| held.report);
        part.fill(&mut self.remarks)?;
        if part.ended && part.held.is_empty() {
            // A file that is read to its end is closed.
            part.reports = None;
        }
        Ok(report)
    }

    /// The time of the next report.
    pub fn next_time(&mut self) -> Result<Option<f64>, DataError> {
        Ok(self.earliest()?.and_then(|at| self.parts[at].next_time()))
    }

    /// The file that has the next report; it is opened if it is not yet.
    fn earliest(&mut self) -> Result<Option<usize>, DataError> {
        loop {
            let times = self.parts.iter().enumerate().filter_map(|(at, part)| Some((at, part.next_time()?)));
            let Some((at, _)) = times.min_by(|a, b| a.1.total_cmp(&b.1)) else { return Ok(None) };
            let part = &mut self.parts[at];
            if part.reports.is_some() {
                return Ok(Some(at));
            }
            part.reports = Some(super::open_reports(self.source, &part.input, &self.options)?);
            part.fill(&mut self.remarks)?;
        }
    }

    /// What became of the rows that are no reports, so far.
    pub fn remarks(&self) -> Remarks {
        let mut remarks = self.remarks.clone();
        let open = self.parts.iter().filter_map(|part| part.reports.as_ref());
        open.for_each(|reports| remarks.join(reports.remarks.clone()));
        remarks
    }
}
