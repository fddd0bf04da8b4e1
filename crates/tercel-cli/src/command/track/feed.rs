//! The scans of a recording, as they are read.

use std::path::Path;

use tercel_data::table::{Description, Origin, Scan, Truths};
use tercel_data::{DataError, ImportOptions, Imported, LeftOut, Recording, Source};

use crate::console::Console;
use crate::failure::Failure;
use crate::input::{ReadArguments, say_left_out};

/// A recording of which the first scans are at hand, and the others come one by one.
pub struct Feed {
    /// Where the local frame lies, if it is known.
    pub origin: Option<Origin>,
    /// What the recording is.
    pub description: Description,
    /// What was really there, if the recording brings it.
    pub truths: Option<Truths>,
    first: std::vec::IntoIter<Scan>,
    rest: Rest,
    /// Notes that were printed.
    said: usize,
}

enum Rest {
    /// All of it is in memory.
    Whole { scans: std::vec::IntoIter<Scan>, left_out: Vec<LeftOut>, notes: Vec<String> },
    /// It is read as it is asked for.
    Read(Box<Recording>),
}

/// Scans of a recording that are looked at before it is tracked.
const FIRST: usize = 20_000;

impl Feed {
    /// Opens files, or standard input, of one source. With `truths` the truth is read that lies beside the recording.
    pub fn open<P: AsRef<Path>>(
        read: &ReadArguments,
        (source, paths): (Source, &[P]),
        options: ImportOptions,
        console: &Console,
    ) -> Result<Self, Failure> {
        let mut feed = if options.truths {
            let Imported { detections, truths, left_out, notes } =
                read.import(source, paths, options, console)?;
            let scans = detections.scans.into_iter();
            Feed {
                origin: detections.origin,
                description: detections.description,
                truths,
                first: Vec::new().into_iter(),
                rest: Rest::Whole { scans, left_out, notes },
                said: 0,
            }
        } else {
            let recording = read.open(source, paths, options, console)?;
            Feed {
                origin: recording.origin(),
                description: recording.description().clone(),
                truths: None,
                first: Vec::new().into_iter(),
                rest: Rest::Read(Box::new(recording)),
                said: 0,
            }
        };
        // Reports say themselves what they are.
        let count = if feed.description.all_report() { 1 } else { FIRST };
        let first: Vec<Scan> = feed.by_ref().take(count).collect::<Result<_, DataError>>()?;
        feed.first = first.into_iter();
        feed.say_notes(console);
        Ok(feed)
    }

    /// The scans that are at hand.
    pub fn first(&self) -> &[Scan] {
        self.first.as_slice()
    }

    /// Prints the notes that were not printed before.
    fn say_notes(&mut self, console: &Console) {
        let notes = match &self.rest {
            Rest::Whole { notes, .. } => notes.clone(),
            Rest::Read(recording) => recording.notes(),
        };
        notes.iter().skip(self.said).for_each(|note| console.note(note));
        self.said = notes.len();
    }

    /// Ends the reading: prints what there is to be said, and returns what was left out.
    pub fn finish(mut self, console: &Console) -> Vec<LeftOut> {
        self.say_notes(console);
        let left_out = match self.rest {
            Rest::Whole { left_out, .. } => left_out,
            Rest::Read(recording) => recording.left_out(),
        };
        say_left_out(&left_out, console);
        left_out
    }
}

impl Iterator for Feed {
    type Item = Result<Scan, DataError>;

    fn next(&mut self) -> Option<Self::Item> {
        let Feed { first, rest, .. } = self;
        first.next().map(Ok).or_else(|| match rest {
            Rest::Whole { scans, .. } => scans.next().map(Ok),
            Rest::Read(recording) => recording.next(),
        })
    }
}
