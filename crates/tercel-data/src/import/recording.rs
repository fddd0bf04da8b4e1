//! A recording, scan by scan.

use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use super::input::Input;
use super::merge::Merged;
use super::scans::Framing;
use super::source::{Family, Kind, Source};
use super::survey::Survey;
use super::{ImportOptions, Imported, LeftOut, open_reports, tables};
use crate::error::DataError;
use crate::remarks::Remarks;
use crate::table::{Description, Origin, Scan, SensorDescription, Truths};

/// A recording, scan by scan, in the order of time.
///
/// Reports of aircraft and ships are read twice: a first look finds the origin of the local frame and how far rows are out of
/// order, and refuses what cannot be read; then scans come as they are asked for, so that memory does not grow with the
/// recording. Reports of one time are one scan. Other sources are held in memory.
///
/// ```no_run
/// use tercel_data::{ImportOptions, Recording, Source};
///
/// let mut recording = Recording::open(Source::Ais, &["monday.csv.zst", "tuesday.csv.zst"], &ImportOptions::default())?;
/// for scan in &mut recording {
///     println!("{} ships", scan?.detections.len());
/// }
/// for left_out in recording.left_out() {
///     println!("left out {} rows: {}", left_out.rows, left_out.reason);
/// }
/// # Ok::<(), tercel_data::DataError>(())
/// ```
pub struct Recording {
    origin: Option<Origin>,
    description: Description,
    content: Content,
}

enum Content {
    /// Scans that are in memory, with what is worth saying of them.
    Tables(std::vec::IntoIter<Scan>, Remarks),
    /// Reports that are read as they are asked for.
    Reports(Box<Stream>),
    /// Reports of which there are none.
    Nothing(Remarks),
}

struct Stream {
    merged: Merged,
    framing: Framing,
}

impl Recording {
    /// Opens the files of a recording; several files of reports are joined in the order of time.
    ///
    /// # Errors
    /// A [`DataError`] that says where a file is wrong, and what was expected.
    pub fn open<P: AsRef<Path>>(
        source: Source,
        paths: &[P],
        options: &ImportOptions,
    ) -> Result<Self, DataError> {
        match source.kind() {
            Kind::Reports(family) => {
                let inputs = paths.iter().map(|path| Input::file(path.as_ref())).collect();
                Recording::of_reports(source, family, inputs, options)
            }
            _ => Ok(Recording::of_tables(tables::import(source, paths, options)?)),
        }
    }

    /// A recording from a stream, which is kept in a temporary file if it is long; `name` stands for it in messages.
    ///
    /// # Errors
    /// A [`DataError`] that says where the stream is wrong, and what was expected.
    pub fn from_reader(
        source: Source,
        reader: impl Read,
        name: &str,
        options: &ImportOptions,
    ) -> Result<Self, DataError> {
        match source.kind() {
            Kind::Reports(family) => {
                Recording::of_reports(source, family, vec![Input::stream(reader, name)?], options)
            }
            _ => Ok(Recording::of_tables(tables::import_from(source, reader, name, options)?)),
        }
    }

    fn of_tables(imported: Imported) -> Self {
        let Imported { detections, left_out, notes, .. } = imported;
        let mut remarks = Remarks::default();
        notes.into_iter().for_each(|note| remarks.note(note));
        left_out.into_iter().for_each(|LeftOut { reason, rows }| remarks.leave_out(reason, rows));
        Recording {
            origin: detections.origin,
            description: detections.description,
            content: Content::Tables(detections.scans.into_iter(), remarks),
        }
    }

    fn of_reports(
        source: Source,
        family: &'static Family,
        inputs: Vec<Input>,
        options: &ImportOptions,
    ) -> Result<Self, DataError> {
        let mut survey = Survey::default();
        let mut files = Vec::new();
        let mut empty = Remarks::default();
        for input in inputs {
            let mut reports = open_reports(source, &input, options)?;
            match survey.look(&mut reports, family)? {
                Some(times) => files.push((input, times)),
                None => empty.join(reports.remarks),
            }
        }
        let name = files.first().map(|(input, _)| Arc::clone(&input.name));
        let Some((origin, name)) = options.origin.or_else(|| survey.middle()).zip(name) else {
            return Ok(Recording {
                origin: options.origin,
                description: family.description(None),
                content: Content::Nothing(empty),
            });
        };
        let mut merged = Merged::new(files, source, options);
        merged.add(empty);
        let mut framing = Framing::new(origin, family, options.keep_repeated, &name)?;
        framing.truths = options.truths.then(Vec::new);
        Ok(Recording {
            origin: Some(origin),
            description: family.description(survey.interval()),
            content: Content::Reports(Box::new(Stream { merged, framing })),
        })
    }

    /// Where the local frame lies, if it is known.
    pub fn origin(&self) -> Option<Origin> {
        self.origin
    }

    /// What the recording is, and what is known of its sensors.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Rows that are not in the scans, by reason; complete when all scans were taken.
    pub fn left_out(&self) -> Vec<LeftOut> {
        self.remarks().left_out
    }

    /// What was decided while reading and the user should know, in sentences; complete when all scans were taken.
    pub fn notes(&self) -> Vec<String> {
        self.remarks().notes
    }

    fn remarks(&self) -> Remarks {
        match &self.content {
            Content::Tables(_, remarks) | Content::Nothing(remarks) => remarks.clone(),
            Content::Reports(stream) => stream.remarks(),
        }
    }

    /// All of it in memory.
    pub(super) fn collect(mut self, options: &ImportOptions) -> Result<Imported, DataError> {
        let mut imported = Imported::default();
        for scan in &mut self {
            imported.detections.scans.push(scan?);
        }
        imported.detections.origin = self.origin;
        imported.detections.description = std::mem::take(&mut self.description);
        let Remarks { left_out, notes, .. } = self.remarks();
        let rows = match self.content {
            Content::Reports(stream) => stream.framing.truths.unwrap_or_default(),
            _ => Vec::new(),
        };
        imported.truths = options.truths.then_some(Truths { origin: self.origin, rows });
        Ok(Imported { left_out, notes, ..imported })
    }
}

impl Iterator for Recording {
    type Item = Result<Scan, DataError>;

    fn next(&mut self) -> Option<Self::Item> {
        match &mut self.content {
            Content::Tables(scans, _) => scans.next().map(Ok),
            Content::Reports(stream) => stream.scan().transpose(),
            Content::Nothing(_) => None,
        }
    }
}

impl Stream {
    fn scan(&mut self) -> Result<Option<Scan>, DataError> {
        let mut detections = Vec::new();
        while let Some(report) = self.merged.next()? {
            let time = report.time;
            detections.extend(self.framing.detection(report));
            if !detections.is_empty() && self.merged.next_time()? != Some(time) {
                return Ok(Some(self.framing.scan(time, detections)));
            }
        }
        Ok(None)
    }

    fn remarks(&self) -> Remarks {
        let mut remarks = self.merged.remarks();
        remarks.leave_out("the same report from another receiver", self.framing.repeated);
        remarks
    }
}

impl Family {
    fn description(&self, interval: Option<f64>) -> Description {
        let sensor = SensorDescription { reports: true, identity: true, interval };
        Description {
            source: Some(self.sensor.to_owned()),
            sensors: [(self.sensor.to_owned(), sensor)].into(),
        }
    }
}
