//! When a track is believed, and when it is given up.

use super::{Status, Track};

/// The rules of a track's life.
///
/// ```
/// use tercel_core::multi::{Confirmation, Management};
///
/// let strict = Management { confirm: Confirmation::Hits { hits: 4, scans: 5 }, ..Management::default() };
/// assert_eq!(strict.max_misses, 5);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Management {
    /// When a tentative track is confirmed.
    pub confirm: Confirmation,
    /// A track with a lower probability of existence is deleted. 0 to 1.
    pub min_existence: f64,
    /// A confirmed track with more misses in a row is deleted. Only scans that should have seen the track count.
    pub max_misses: u32,
    /// A track that was not updated for longer is deleted, s, even if no sensor could have seen it; one that is updated seldom
    /// is given four times its own interval.
    pub max_coast: f64,
}

/// When a tentative track is believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Confirmation {
    /// When its probability of existence reaches this value, 0 to 1.
    Existence(f64),
    /// When this many of its last scans in view updated it. A tentative track that can no longer reach the number is deleted.
    Hits {
        /// Updates needed, at least 1.
        hits: u32,
        /// Among this many scans, 1 to 64.
        scans: u32,
    },
}

impl Default for Management {
    /// Confirms at an existence of 0.95; gives up below 0.02, after more than five misses in a row, or after 15 s.
    fn default() -> Self {
        Management {
            confirm: Confirmation::Existence(0.95),
            min_existence: 0.02,
            max_misses: 5,
            max_coast: 15.0,
        }
    }
}

/// Intervals of its own for which a track may be silent.
const PATIENCE: f64 = 4.0;

impl Management {
    /// Sets the status of a track whose bookkeeping for the scan at `time` is done.
    pub(super) fn judge<B>(&self, track: &mut Track<B>, time: f64) {
        let give_up = track.existence < self.min_existence
            || track.misses > self.max_misses
            || self.is_overdue(track, time)
            || track.existence.is_nan()
            || track.existence <= 0.0;
        track.status = match self.confirm {
            _ if give_up => Status::Deleted,
            _ if track.confirmed => Status::Confirmed,
            Confirmation::Existence(threshold) if track.existence >= threshold => Status::Confirmed,
            Confirmation::Hits { hits, scans } => Self::judge_hits(track, hits, scans),
            Confirmation::Existence(_) => Status::Tentative,
        };
        track.confirmed |= track.status == Status::Confirmed;
        if track.status == Status::Confirmed && track.misses > 0 {
            track.status = Status::Coasted;
        }
    }

    /// True when a track was silent for too long: longer than `max_coast`, and than a few times its own interval, so that an
    /// object that is seen every quarter of an hour is not given up after ten minutes.
    pub(super) fn is_overdue<B>(&self, track: &Track<B>, time: f64) -> bool {
        time - track.updated > self.max_coast.max(PATIENCE * track.interval)
    }

    fn judge_hits<B>(track: &Track<B>, hits: u32, scans: u32) -> Status {
        let window = scans.clamp(1, 64);
        let recent = (track.history & (u64::MAX >> (64 - window))).count_ones();
        let left = window.saturating_sub(track.seen);
        match () {
            () if recent >= hits => Status::Confirmed,
            () if recent + left < hits => Status::Deleted,
            () => Status::Tentative,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Status after each of these scans (hit or miss), the first of which starts the track.
    fn life(management: &Management, scans: &[bool]) -> Vec<Status> {
        let mut track = Track::new(1, (), 0.5, 0, 0.0);
        management.judge(&mut track, 0.0);
        let mut statuses = vec![track.status];
        for (time, &hit) in (1..).zip(scans) {
            if hit {
                track.hit(0, f64::from(time))
            } else {
                track.miss()
            }
            management.judge(&mut track, f64::from(time));
            statuses.push(track.status);
        }
        statuses
    }

    #[test]
    fn three_of_five_confirms_at_the_third_hit() {
        let rule = Management { confirm: Confirmation::Hits { hits: 3, scans: 5 }, ..Default::default() };
        let statuses = life(&rule, &[true, false, true, false]);
        use Status::*;
        assert_eq!(statuses, [Tentative, Tentative, Tentative, Confirmed, Coasted]);
    }

    #[test]
    fn a_tentative_track_that_cannot_be_confirmed_is_deleted() {
        let rule = Management { confirm: Confirmation::Hits { hits: 3, scans: 4 }, ..Default::default() };
        assert_eq!(life(&rule, &[false, false]).last(), Some(&Status::Deleted));
    }

    #[test]
    fn a_confirmed_track_dies_of_misses_and_of_age() {
        let rule = Management {
            confirm: Confirmation::Hits { hits: 1, scans: 1 },
            max_misses: 2,
            max_coast: 100.0,
            ..Default::default()
        };
        assert_eq!(life(&rule, &[false, false]).last(), Some(&Status::Coasted));
        assert_eq!(life(&rule, &[false, false, false]).last(), Some(&Status::Deleted));
        let impatient = Management { max_coast: 1.5, max_misses: 9, ..rule };
        assert_eq!(life(&impatient, &[false, false]).last(), Some(&Status::Deleted));
    }
}
