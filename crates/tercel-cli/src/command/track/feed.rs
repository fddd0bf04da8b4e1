//! The scans of a recording, as they are read.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use tercel_data::table::{Description, Origin, Scan, Truths};
use tercel_data::{DataError, ImportOptions, Imported, LeftOut, Recording, Source};

use crate::console::Console;
use crate::failure::Failure;
use crate::input::{ReadArguments, say_left_out};
use crate::progress::Progress;

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
    Whole { scans: std::vec::IntoIter<Scan>, left_out: Vec<LeftOut> },
    /// It is read while what was read is tracked.
    Read(Reader),
}

/// A recording that is read by a thread of its own, a little ahead.
struct Reader {
    scans: std::vec::IntoIter<Result<Scan, DataError>>,
    messages: Receiver<Message>,
    end: (Vec<LeftOut>, Vec<String>),
}

/// What the thread that reads hands over.
enum Message {
    /// The recording is open.
    Opened(Result<Head, DataError>),
    /// The next scans.
    Scans(Vec<Result<Scan, DataError>>),
    /// What was left out, and all notes, when there are no more scans.
    End(Vec<LeftOut>, Vec<String>),
}

/// What a recording says before its first scan.
struct Head {
    origin: Option<Origin>,
    description: Description,
    notes: Vec<String>,
}

/// Scans that are handed over together, and messages that may wait.
const BATCH: (usize, usize) = (256, 16);

impl Reader {
    /// Opens a recording on a thread of its own.
    fn open(
        open: impl FnOnce() -> Result<Recording, DataError> + Send + 'static,
    ) -> Result<(Self, Head), DataError> {
        let (sender, messages) = sync_channel(BATCH.1);
        std::thread::spawn(move || read(open(), &sender));
        let reader = Reader { scans: Vec::new().into_iter(), messages, end: (Vec::new(), Vec::new()) };
        match reader.messages.recv() {
            Ok(Message::Opened(head)) => head.map(|head| (reader, head)),
            _ => Ok((reader, Head { origin: None, description: Description::default(), notes: Vec::new() })),
        }
    }

    fn next(&mut self) -> Option<Result<Scan, DataError>> {
        loop {
            if let Some(scan) = self.scans.next() {
                return Some(scan);
            }
            match self.messages.recv().ok()? {
                Message::Scans(scans) => self.scans = scans.into_iter(),
                Message::End(left_out, notes) => self.end = (left_out, notes),
                Message::Opened(_) => {}
            }
        }
    }
}

/// Hands over a recording until it ends, or until nobody asks for it any more.
fn read(recording: Result<Recording, DataError>, sender: &SyncSender<Message>) {
    let mut recording = match recording {
        Ok(recording) => recording,
        Err(error) => return drop(sender.send(Message::Opened(Err(error)))),
    };
    let head = Head {
        origin: recording.origin(),
        description: recording.description().clone(),
        notes: recording.notes(),
    };
    let mut wanted = sender.send(Message::Opened(Ok(head))).is_ok();
    while wanted {
        let scans: Vec<_> = recording.by_ref().take(BATCH.0).collect();
        if scans.is_empty() {
            break;
        }
        wanted = sender.send(Message::Scans(scans)).is_ok();
    }
    drop(sender.send(Message::End(recording.left_out(), recording.notes())));
}

/// Scans of a recording that are looked at before it is tracked.
const FIRST: usize = 20_000;

impl Feed {
    /// Opens files, or standard input, of one source. With `truths` the truth is read that lies beside the recording.
    pub fn open(
        read: &ReadArguments,
        (source, paths): (Source, &[PathBuf]),
        options: ImportOptions,
        console: &Console,
    ) -> Result<Self, Failure> {
        let notes;
        let mut feed = if options.truths {
            let imported = read.import(source, paths, options, console)?;
            notes = imported.notes;
            let Imported { detections, truths, left_out, .. } = imported;
            let scans = detections.scans.into_iter();
            Feed {
                origin: detections.origin,
                description: detections.description,
                truths,
                first: Vec::new().into_iter(),
                rest: Rest::Whole { scans, left_out },
                said: 0,
            }
        } else {
            let _progress = Progress::spinner(console, "reading");
            let (reader, head) = Reader::open(read.opener(source, paths, options))?;
            notes = head.notes;
            Feed {
                origin: head.origin,
                description: head.description,
                truths: None,
                first: Vec::new().into_iter(),
                rest: Rest::Read(reader),
                said: 0,
            }
        };
        // Reports say themselves what they are.
        let count = if feed.description.all_report() { 1 } else { FIRST };
        let first: Vec<Scan> = feed.by_ref().take(count).collect::<Result<_, DataError>>()?;
        feed.first = first.into_iter();
        notes.iter().for_each(|note| console.note(note));
        feed.said = notes.len();
        Ok(feed)
    }

    /// The scans that are at hand.
    pub fn first(&self) -> &[Scan] {
        self.first.as_slice()
    }

    /// Ends the reading: prints what there is to be said, and returns what was left out.
    pub fn finish(self, console: &Console) -> Vec<LeftOut> {
        let (left_out, notes) = match self.rest {
            Rest::Whole { left_out, .. } => (left_out, Vec::new()),
            Rest::Read(reader) => reader.end,
        };
        notes.iter().skip(self.said).for_each(|note| console.note(note));
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
            Rest::Read(reader) => reader.next(),
        })
    }
}
