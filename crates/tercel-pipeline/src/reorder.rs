//! Scans that do not come in the order of their times, and clocks that jump.

use std::collections::VecDeque;

use crate::notice::Notice;
use crate::pipeline::rows;
use crate::turns::Look;

/// Puts scans in order: holds them back for a while, so that late ones can take their place, sets a single time far ahead aside,
/// and notices when a clock is set back.
pub(crate) struct Reorder {
    settings: Order,
    /// Waiting scans by rising time; scans of equal time in the order in which they came.
    waiting: VecDeque<Look>,
    newest: f64,
    released: f64,
    /// How many were released since the clock began.
    count: u64,
    /// The longest time between two scans so far, s.
    gap: f64,
    /// A scan far ahead of the others, until the next one says which of them is wrong.
    ahead: Option<Look>,
    /// The last scans, all of which came too late.
    behind: Vec<Look>,
}

/// How scans are put in order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Order {
    /// Scans wait until one that is so much newer has come, s; zero lets each through at once.
    pub delay: f64,
    /// A scan that is further ahead, s, must be confirmed by the next.
    pub max_jump: f64,
    /// When the clock is set back, tracking starts anew.
    pub restart: bool,
}

/// What came of a scan that was pushed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Arrival {
    /// It waits for its turn.
    Taken,
    /// It, or the one before, is left out.
    LeftOut(Notice, Look),
    /// The clock was set back, and what comes now has nothing to do with what was. So many scans and rows that were left
    /// out before are taken in after all.
    Restarted(Notice, [u64; 2]),
}

/// Late scans in a row, by which a clock that was set back is told from scans that are late.
const BEHIND: usize = 3;

/// A jump is far when it is longer than so many of the longest gaps before it.
const FAR: f64 = 20.0;

impl Reorder {
    /// Nothing has come yet.
    pub fn new(settings: Order) -> Self {
        Reorder {
            settings,
            waiting: VecDeque::new(),
            newest: f64::NEG_INFINITY,
            released: f64::NEG_INFINITY,
            count: 0,
            gap: 0.0,
            ahead: None,
            behind: Vec::new(),
        }
    }

    /// Takes in a scan.
    pub fn push(&mut self, look: Look) -> Arrival {
        let time = look.scan.time;
        let mut aside = Arrival::Taken;
        if let Some(ahead) = self.ahead.take() {
            if time < ahead.scan.time && time - self.newest < ahead.scan.time - time {
                let notice = Notice::ahead(&ahead.scan, self.newest);
                aside = Arrival::LeftOut(notice, ahead);
            } else {
                self.insert(ahead);
            }
        }
        if time < self.released {
            return self.late(look, aside);
        }
        self.behind.clear();
        if self.newest.is_finite() && time - self.newest > self.settings.max_jump.max(FAR * self.gap) {
            self.ahead = Some(look);
            return aside;
        }
        self.insert(look);
        aside
    }

    /// A scan that is too late. When no other ones come any more, it is the clock.
    fn late(&mut self, look: Look, aside: Arrival) -> Arrival {
        if aside != Arrival::Taken {
            return aside;
        }
        let rises = self.behind.last().is_none_or(|last| last.scan.time <= look.scan.time);
        if !rises {
            self.behind.clear();
        }
        let notice = Notice::late(&look.scan, self.released, self.settings.delay);
        self.behind.push(look.clone());
        let first_was_wrong = self.count == 1;
        if self.behind.len() < BEHIND || !(self.settings.restart || first_was_wrong) {
            return Arrival::LeftOut(notice, look);
        }
        let notice = Notice::set_back(&self.behind[0].scan, self.released);
        let behind = std::mem::take(&mut self.behind);
        let back = &behind[..BEHIND - 1];
        let back = [back.len() as u64, back.iter().map(|look| rows(&look.scan)).sum()];
        *self = Reorder::new(self.settings);
        behind.into_iter().for_each(|look| self.insert(look));
        Arrival::Restarted(notice, back)
    }

    fn insert(&mut self, look: Look) {
        let time = look.scan.time;
        if self.newest.is_finite() {
            self.gap = self.gap.max(time - self.newest);
        }
        self.newest = self.newest.max(time);
        let at = self.waiting.partition_point(|other| other.scan.time <= time);
        self.waiting.insert(at, look);
    }

    /// The next scan that has waited long enough and is not newer than `oldest`, before which nothing can come any more; with
    /// `all`, the next scan.
    pub fn pop(&mut self, all: bool, oldest: f64) -> Option<Look> {
        let front = self.waiting.front()?.scan.time;
        if !all && front > (self.newest - self.settings.delay).min(oldest) {
            return None;
        }
        self.released = front;
        self.count += 1;
        self.waiting.pop_front()
    }

    /// Detections that wait.
    pub fn held(&self) -> usize {
        self.waiting.iter().chain(&self.ahead).map(|look| look.scan.detections.len()).sum()
    }

    /// The scan far ahead that no other one confirmed, at the end.
    pub fn finish(&mut self) -> Option<(Notice, Look)> {
        let ahead = self.ahead.take()?;
        Some((Notice::ahead(&ahead.scan, self.newest), ahead))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tercel_data::table::Scan;

    /// Times that come out, how many are left out, and how often it starts anew.
    fn ordered(settings: Order, times: &[f64]) -> (Vec<f64>, usize, usize) {
        let mut reorder = Reorder::new(settings);
        let (mut out, mut left_out, mut restarts) = (Vec::new(), 0, 0);
        for &time in times {
            match reorder.push(Scan::new(time, "radar", Vec::new()).into()) {
                Arrival::Taken => {}
                Arrival::LeftOut(..) => left_out += 1,
                Arrival::Restarted(_, back) => {
                    left_out -= back[0] as usize;
                    restarts += 1;
                }
            }
            out.extend(std::iter::from_fn(|| reorder.pop(false, f64::INFINITY)).map(|look| look.scan.time));
        }
        left_out += usize::from(reorder.finish().is_some());
        out.extend(std::iter::from_fn(|| reorder.pop(true, f64::INFINITY)).map(|look| look.scan.time));
        (out, left_out, restarts)
    }

    const PLAIN: Order = Order { delay: 0.0, max_jump: 3600.0, restart: false };

    #[test]
    fn without_delay_late_scans_are_left_out() {
        assert_eq!(ordered(PLAIN, &[1.0, 3.0, 2.0, 3.0, 4.0]), (vec![1.0, 3.0, 3.0, 4.0], 1, 0));
    }

    #[test]
    fn within_the_delay_late_scans_take_their_place() {
        let order = Order { delay: 2.0, ..PLAIN };
        let times = [1.0, 3.0, 2.0, 5.0, 1.5, 6.0];
        assert_eq!(ordered(order, &times), (vec![1.0, 2.0, 3.0, 5.0, 6.0], 1, 0));
    }

    #[test]
    fn one_time_far_ahead_is_set_aside() {
        let times = [1.0, 2.0, 4e9, 3.0, 4.0];
        assert_eq!(ordered(PLAIN, &times), (vec![1.0, 2.0, 3.0, 4.0], 1, 0));
        assert_eq!(ordered(PLAIN, &[1.0, 2.0, 4e9]), (vec![1.0, 2.0], 1, 0));
    }

    #[test]
    fn a_pause_that_others_confirm_is_a_pause() {
        let times = [1.0, 2.0, 9000.0, 9001.0, 9002.0];
        assert_eq!(ordered(PLAIN, &times), (times.to_vec(), 0, 0));
    }

    #[test]
    fn what_comes_once_in_two_hours_is_not_far_ahead() {
        let times: Vec<f64> = (0..6).map(|i| f64::from(i) * 7200.0).collect();
        assert_eq!(ordered(PLAIN, &times), (times, 0, 0));
    }

    #[test]
    fn a_clock_that_is_set_back_starts_anew_where_that_is_wanted() {
        let times = [1000.0, 1001.0, 0.0, 1.0, 2.0, 3.0];
        assert_eq!(ordered(PLAIN, &times), (vec![1000.0, 1001.0], 4, 0));
        let order = Order { restart: true, ..PLAIN };
        assert_eq!(ordered(order, &times), (vec![1000.0, 1001.0, 0.0, 1.0, 2.0, 3.0], 0, 1));
    }

    #[test]
    fn a_first_time_that_no_other_one_confirms_was_wrong() {
        let times = [4e9, 1.0, 2.0, 3.0, 4.0];
        assert_eq!(ordered(PLAIN, &times), (vec![4e9, 1.0, 2.0, 3.0, 4.0], 0, 1));
    }

    #[test]
    fn nothing_passes_what_is_still_open() {
        let mut reorder = Reorder::new(PLAIN);
        for time in [1.0, 2.0, 3.0] {
            reorder.push(Scan::new(time, "radar", Vec::new()).into());
        }
        let times: Vec<f64> =
            std::iter::from_fn(|| reorder.pop(false, 2.0)).map(|look| look.scan.time).collect();
        assert_eq!(times, [1.0, 2.0]);
    }
}
