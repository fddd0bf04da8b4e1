//! Progress of long work on a terminal.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::console::Console;

/// Work that takes less is not shown.
const PATIENCE: Duration = Duration::from_millis(500);

/// A bar or a spinner that appears when the work takes long, and vanishes with this value.
pub struct Progress {
    bar: ProgressBar,
    /// Dropping the sender tells the thread that the work is done.
    waiting: Option<(Sender<()>, JoinHandle<()>)>,
}

impl Progress {
    /// Work of a known number of steps.
    pub fn bar(console: &Console, what: &'static str, steps: usize) -> Self {
        let bar = ProgressBar::with_draw_target(Some(steps as u64), ProgressDrawTarget::hidden());
        let template = "{msg} {wide_bar} {human_pos}/{human_len} {per_sec} {eta}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Progress::begin(console, bar.with_message(what))
    }

    /// Work of unknown length.
    pub fn spinner(console: &Console, what: &'static str) -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        Progress::begin(console, bar.with_message(what))
    }

    fn begin(console: &Console, bar: ProgressBar) -> Self {
        let waiting = console.draws_progress().then(|| {
            let (sender, receiver) = channel();
            let shown = bar.clone();
            let thread = std::thread::spawn(move || {
                if receiver.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
                    shown.set_draw_target(ProgressDrawTarget::stderr());
                    shown.enable_steady_tick(Duration::from_millis(100));
                    // Nothing is ever sent: this waits for the end of the work.
                    let _ = receiver.recv();
                }
            });
            (sender, thread)
        });
        Progress { bar, waiting }
    }

    /// One step is done.
    pub fn step(&self) {
        self.bar.inc(1);
    }

    /// Steps that were done before; they do not count for the time that is left.
    #[cfg(feature = "train")]
    pub fn start_at(&self, step: usize) {
        self.bar.set_position(step as u64);
        self.bar.reset_eta();
    }

    /// Says what is being done now.
    #[cfg(feature = "train")]
    pub fn say(&self, what: String) {
        self.bar.set_message(what);
    }

    /// Prints what should stay, above the bar.
    #[cfg(feature = "train")]
    pub fn above(&self, print: impl FnOnce()) {
        self.bar.suspend(print);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some((sender, thread)) = self.waiting.take() {
            drop(sender);
            let _ = thread.join();
        }
        self.bar.finish_and_clear();
    }
}
