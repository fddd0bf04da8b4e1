//! When a track is believed, and when it is given up.

use super::{Status, Track};

/// The rules of a track's life.
///
/// ## Which rule ends which track
/// | rule | a tentative track | a confirmed track |
/// |---|---|---|
/// | `min_existence` | ends below it; under [`Confirmation::Hits`] counting alone ends it | ends below it when an update has just left it there, or the last one left it doubtful |
/// | [`Confirmation::Hits`] | ends when it can no longer reach the number | - |
/// | `lost_existence`, if it is given | - | ends below it; the rule above does not hold then |
/// | `max_misses`, `max_coast` | ends beyond them | ends beyond them |
///
/// Without `lost_existence`, misses alone never end a confirmed track before `max_misses` or `max_coast` does, unless its last
/// update left it less likely to exist than not. If the probability of detection were constant and known, four misses in a row
/// would leave hardly a doubt that an object is gone; but objects hide behind others and sensors have bad hours. So one object in a hundred that exists is taken to be hidden, and the existence `r` of a
/// confirmed track at its last update, with survival `s` since, sinks no lower than
/// ```text
/// h r s / (h r s + 1 - r s)        h = 0.01
/// ```
/// Else an object that shows itself again after a long outage would be taken for clutter, or for a new one.
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
    /// The least probability of existence, 0 to 1: see the table above. No track starts with less, and none is confirmed.
    pub min_existence: f64,
    /// A confirmed track of less existence is deleted, 0 to 1: however it came to that, by misses as well. So the probability of
    /// detection is believed, which ends tracks sooner where it is high and false tracks are many. `None` leaves it to the misses.
    pub lost_existence: Option<f64>,
    /// A track with more misses in a row is deleted. Only scans that should have seen the track count.
    pub max_misses: u32,
    /// A track that was not updated for longer is deleted, s, even if no sensor could have seen it. `None` stands for 15 s, or
    /// for the time of `max_misses` and one more scan where that is longer: slow sensors get as many chances as fast ones. An
    /// object that reports is in any case given four times its own interval.
    pub max_coast: Option<f64>,
}

/// When a tentative track is believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Confirmation {
    /// When its probability of existence reaches this value, 0 to 1.
    Existence(f64),
    /// When this many of its last scans in view updated it. A tentative track that can no longer reach the number is deleted,
    /// and no sooner: it is judged by what its scans show.
    Hits {
        /// Updates needed, at least 1.
        hits: u32,
        /// Among this many scans, 1 to 64.
        scans: u32,
    },
}

/// Share of the objects that exist which no probability of detection accounts for: they are hidden.
const HIDDEN: f64 = 0.01;

/// How long a track may coast when nothing says so and scans are frequent, s.
const COAST: f64 = 15.0;

impl Default for Management {
    /// Confirms at an existence of 0.95. A tentative track is given up below 0.02; any track after more than five misses in a
    /// row, or after 15 s out of every view (six scans, where scans are more than 2.5 s apart).
    fn default() -> Self {
        Management {
            confirm: Confirmation::Existence(0.95),
            min_existence: 0.02,
            lost_existence: None,
            max_misses: 5,
            max_coast: None,
        }
    }
}

/// Intervals of its own for which an object that reports may be silent.
const PATIENCE: f64 = 4.0;

impl Management {
    /// The least existence of a track that coasts, at `time`: objects survive a second with the probability `survival`. Zero where
    /// existence is to say when a track ends.
    pub(super) fn least<B>(&self, track: &Track<B>, time: f64, survival: f64) -> f64 {
        if self.lost_existence.is_some() || is_doubted(track) {
            return 0.0;
        }
        let alive = track.known * survival.powf(time - track.updated);
        let hidden = HIDDEN * alive;
        hidden / (hidden + 1.0 - alive)
    }

    /// The existence below which a track ends that a measurement has just updated, or not.
    pub(super) fn limit<B>(&self, track: &Track<B>, seen: bool) -> f64 {
        let counts = matches!(self.confirm, Confirmation::Hits { .. });
        match self.lost_existence {
            Some(lost) if track.confirmed => lost,
            Some(_) | None if track.confirmed && seen => self.min_existence,
            Some(_) | None if counts || !is_doubted(track) => 0.0,
            Some(_) | None => self.min_existence,
        }
    }

    /// Sets the status of a track whose bookkeeping for the scan at `time` is done.
    pub(super) fn judge<B>(&self, track: &mut Track<B>, time: f64) {
        let seen = track.measurement.is_some();
        let give_up = track.misses > self.max_misses
            || self.is_overdue(track, time)
            || track.existence < self.limit(track, seen)
            || track.existence.is_nan()
            || track.existence <= 0.0;
        track.status = match self.confirm {
            _ if give_up => Status::Deleted,
            _ if track.confirmed => Status::Confirmed,
            Confirmation::Existence(threshold) if track.existence >= threshold => Status::Confirmed,
            Confirmation::Existence(_) => Status::Tentative,
            Confirmation::Hits { hits, scans } => self.judge_hits(track, hits, scans),
        };
        track.confirmed |= track.status == Status::Confirmed;
        if seen {
            track.known = track.existence;
        }
        if track.status == Status::Confirmed && track.misses > 0 {
            track.status = Status::Coasted;
        }
    }

    /// For how long a track may be silent, s.
    fn coast<B>(&self, track: &Track<B>) -> f64 {
        let coast = self.max_coast.unwrap_or_else(|| {
            COAST.max((f64::from(self.max_misses) + 1.0) * track.pace.max(track.interval))
        });
        if track.reports { coast.max(PATIENCE * track.interval) } else { coast }
    }

    /// How often the tracks of objects that report are looked through for silent ones, s.
    pub(super) fn sweep(&self) -> f64 {
        self.max_coast.unwrap_or(COAST) / 8.0
    }

    /// True when a track was silent for too long.
    pub(super) fn is_overdue<B>(&self, track: &Track<B>, time: f64) -> bool {
        time - track.updated > self.coast(track)
    }

    fn judge_hits<B>(&self, track: &Track<B>, hits: u32, scans: u32) -> Status {
        let doubtful = track.existence < self.min_existence;
        let window = scans.clamp(1, 64);
        let recent = (track.history & (u64::MAX >> (64 - window))).count_ones();
        let left = window.saturating_sub(track.seen);
        match () {
            () if recent >= hits && !doubtful => Status::Confirmed,
            () if recent + left < hits || doubtful && left == 0 => Status::Deleted,
            () => Status::Tentative,
        }
    }
}

/// A track that is not confirmed, or whose last update left it less likely to exist than not.
fn is_doubted<B>(track: &Track<B>) -> bool {
    !track.confirmed || track.known < 0.5
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
            max_coast: Some(100.0),
            ..Default::default()
        };
        assert_eq!(life(&rule, &[false, false]).last(), Some(&Status::Coasted));
        assert_eq!(life(&rule, &[false, false, false]).last(), Some(&Status::Deleted));
        let impatient = Management { max_coast: Some(1.5), max_misses: 9, ..rule };
        assert_eq!(life(&impatient, &[false, false]).last(), Some(&Status::Deleted));
    }
}
