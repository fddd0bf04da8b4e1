//! Scans that do not come in the order of their times.

use std::collections::VecDeque;

use tercel_data::table::Scan;

/// Holds scans back for a while, so that late ones can take their place.
pub(crate) struct Reorder {
    delay: f64,
    /// Waiting scans by rising time; scans of equal time in the order in which they came.
    waiting: VecDeque<Scan>,
    newest: f64,
    released: f64,
}

impl Reorder {
    /// Scans wait until one that is `delay` seconds newer has come; zero lets each through at once.
    pub fn new(delay: f64) -> Self {
        Reorder { delay, waiting: VecDeque::new(), newest: f64::NEG_INFINITY, released: f64::NEG_INFINITY }
    }

    /// Takes in a scan. Returns it if it comes too late: something newer has been released.
    pub fn push(&mut self, scan: Scan) -> Option<Scan> {
        if scan.time < self.released {
            return Some(scan);
        }
        self.newest = self.newest.max(scan.time);
        let at = self.waiting.partition_point(|other| other.time <= scan.time);
        self.waiting.insert(at, scan);
        None
    }

    /// The next scan that has waited long enough; with `all`, the next scan.
    pub fn pop(&mut self, all: bool) -> Option<Scan> {
        let ready = all || self.waiting.front()?.time <= self.newest - self.delay;
        let scan = if ready { self.waiting.pop_front() } else { None }?;
        self.released = scan.time;
        Some(scan)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(time: f64) -> Scan {
        Scan::new(time, "radar", Vec::new())
    }

    fn released(delay: f64, times: &[f64]) -> (Vec<f64>, usize) {
        let mut reorder = Reorder::new(delay);
        let (mut out, mut late) = (Vec::new(), 0);
        for &time in times {
            late += usize::from(reorder.push(scan(time)).is_some());
            out.extend(std::iter::from_fn(|| reorder.pop(false)).map(|scan| scan.time));
        }
        out.extend(std::iter::from_fn(|| reorder.pop(true)).map(|scan| scan.time));
        (out, late)
    }

    #[test]
    fn without_delay_late_scans_are_refused() {
        assert_eq!(released(0.0, &[1.0, 3.0, 2.0, 3.0, 4.0]), (vec![1.0, 3.0, 3.0, 4.0], 1));
    }

    #[test]
    fn within_the_delay_late_scans_take_their_place() {
        assert_eq!(released(2.0, &[1.0, 3.0, 2.0, 5.0, 1.5, 6.0]), (vec![1.0, 2.0, 3.0, 5.0, 6.0], 1));
    }
}
