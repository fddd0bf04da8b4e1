//! What is seen of a training while it runs.

use std::time::{Duration, Instant};

use tercel_train::trainer::Progress as Event;

use crate::console::Console;
use crate::progress::Progress;

/// Shows batches on a bar, and epochs as notes.
pub struct Observer<'a> {
    console: &'a Console,
    epochs: usize,
    /// Appears with the first batch, which says how many there are.
    bar: Option<Progress>,
    validation: Option<f64>,
    started: Instant,
    /// Epochs that were done before.
    first: usize,
}

impl<'a> Observer<'a> {
    /// Nothing has happened yet.
    pub fn new(console: &'a Console, epochs: usize) -> Self {
        Observer { console, epochs, bar: None, validation: None, started: Instant::now(), first: 0 }
    }

    /// Shows what the trainer says.
    pub fn take(&mut self, event: Event<'_>) {
        match event {
            Event::Batch { epoch, done, batches, loss, rate } => {
                let bar = self.bar.get_or_insert_with(|| {
                    self.first = epoch;
                    let bar = Progress::bar(self.console, "training", self.epochs * batches);
                    bar.start_at(epoch * batches);
                    bar
                });
                bar.step();
                let validation = self.validation.map(|loss| format!(" validation {loss:.4}"));
                let validation = validation.unwrap_or_default();
                bar.say(format!(
                    "epoch {}/{} batch {done}/{batches} loss {loss:.4}{validation} rate {rate:.1e}",
                    epoch + 1,
                    self.epochs
                ));
            }
            Event::Epoch { row, best } => {
                self.validation = row.validation;
                let line = self.line(row, best);
                match &self.bar {
                    Some(bar) => bar.above(|| self.console.note(line)),
                    None => self.console.note(line),
                }
            }
        }
    }

    fn line(&self, row: &tercel_train::trainer::Row, best: bool) -> String {
        let loss = |loss: Option<f64>| loss.map_or("not finite".to_owned(), |loss| format!("{loss:.6}"));
        let skipped = match row.skipped {
            0 => String::new(),
            count => format!(", {count} updates skipped: not finite"),
        };
        let done = row.epoch + 1;
        let each = self.started.elapsed().as_secs_f64() / (done.saturating_sub(self.first)).max(1) as f64;
        let left = Duration::from_secs_f64(each * self.epochs.saturating_sub(done) as f64);
        format!(
            "epoch {done}/{}: loss {}, validation {}{}, rate {:.1e}{skipped}, {:.1} s; {} left",
            self.epochs,
            loss(row.loss),
            loss(row.validation),
            if best { " (best)" } else { "" },
            row.rate,
            row.seconds,
            indicatif::HumanDuration(left),
        )
    }
}
