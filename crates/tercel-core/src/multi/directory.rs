//! Which tracks a scan of reports may concern.

use std::collections::HashMap;

use super::TrackId;
use crate::filter::Identity;

/// The tracks by what their objects are called. A report is compared with those that share its identity and with those
/// without one, and with no others: what millions of reports cost does not grow with the number of objects.
#[derive(Debug, Clone, Default)]
pub(super) struct Directory {
    named: HashMap<Identity, Vec<TrackId>>,
    /// By rising number.
    anonymous: Vec<TrackId>,
    /// When silent tracks are looked for next, s.
    sweep: Option<f64>,
}

impl Directory {
    /// Takes in a new track.
    pub fn add(&mut self, track: TrackId, identity: Option<Identity>) {
        let list = match identity {
            Some(identity) => self.named.entry(identity).or_default(),
            None => &mut self.anonymous,
        };
        if let Err(at) = list.binary_search(&track) {
            list.insert(at, track);
        }
    }

    /// Forgets a track that was called so.
    pub fn remove(&mut self, track: TrackId, identity: Option<Identity>) {
        let list = match identity {
            Some(identity) => self.named.get_mut(&identity),
            None => Some(&mut self.anonymous),
        };
        let Some(list) = list else { return };
        if let Ok(at) = list.binary_search(&track) {
            list.remove(at);
        }
        if let Some(identity) = identity.filter(|_| list.is_empty()) {
            self.named.remove(&identity);
        }
    }

    /// The tracks that are called so, and those of which nothing is known.
    pub fn candidates(&self, identity: Identity) -> impl Iterator<Item = TrackId> {
        self.named.get(&identity).into_iter().flatten().chain(&self.anonymous).copied()
    }

    /// True once in every `period` of time: silent tracks are looked for now.
    pub fn sweeps(&mut self, time: f64, period: f64) -> bool {
        let due = self.sweep.is_none_or(|due| time >= due);
        if due {
            self.sweep = Some(time + period);
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_is_compared_with_its_namesakes_and_the_nameless() {
        let mut directory = Directory::default();
        let [a, b] = [1, 2].map(Identity);
        directory.add(1, Some(a));
        directory.add(2, Some(b));
        directory.add(3, None);
        directory.add(4, Some(a));
        assert_eq!(directory.candidates(a).collect::<Vec<_>>(), [1, 4, 3]);
        directory.remove(1, Some(a));
        directory.remove(3, None);
        assert_eq!(directory.candidates(a).collect::<Vec<_>>(), [4]);
        assert_eq!(directory.candidates(b).collect::<Vec<_>>(), [2]);
    }

    #[test]
    fn silent_tracks_are_looked_for_once_in_a_while() {
        let mut directory = Directory::default();
        let swept = [0.0, 1.0, 9.0, 10.0, 11.0, 25.0].map(|time| directory.sweeps(time, 10.0));
        assert_eq!(swept, [true, false, false, true, false, true]);
    }
}
