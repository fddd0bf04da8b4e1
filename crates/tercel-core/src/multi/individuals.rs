//! Tracks that each stand for one object: what trackers share that keep one belief per track.

use super::directory::Directory;
use super::{Management, Scan, Status, Track, TrackId, Use, birth_weight, plane};
use crate::association::PlaceIndex;
use crate::filter::Filter;

/// Tracks with one belief and one probability of existence each, and what became of the measurements.
#[derive(Debug, Clone)]
pub(super) struct Individuals<B> {
    pub tracks: Vec<Track<B>>,
    pub uses: Vec<Use>,
    /// Rows of the tracks that the scan concerns, by rising row: all of them, or those that may have made a report.
    pub active: Vec<usize>,
    directory: Directory,
    next: TrackId,
    index: PlaceIndex,
    near: Vec<usize>,
}

impl<B> Default for Individuals<B> {
    fn default() -> Self {
        Individuals {
            tracks: Vec::new(),
            uses: Vec::new(),
            active: Vec::new(),
            directory: Directory::default(),
            next: 1,
            index: PlaceIndex::default(),
            near: Vec::new(),
        }
    }
}

impl<B: Clone> Individuals<B> {
    /// The tracks that the scan concerns.
    pub fn active(&self) -> impl Iterator<Item = &Track<B>> {
        self.active.iter().map(|&row| &self.tracks[row])
    }

    /// Forgets what was deleted in the last scan, finds the tracks that this one concerns, and moves them to its time: objects
    /// survive a second with this probability.
    pub fn predict<const N: usize, F>(
        &mut self,
        filter: &F,
        scan: &Scan<'_, F::Measurement>,
        survival: f64,
        management: &Management,
    ) where
        F: Filter<N, Belief = B> + ?Sized,
    {
        self.forget();
        self.select(filter, scan, management);
        let reach = |time: f64| survival.powf(scan.time - time);
        if self.active.len() < self.tracks.len() {
            // The few that a report concerns, each since its own last one.
            for &row in &self.active {
                let track = &mut self.tracks[row];
                track.existence *= reach(track.time);
                filter.predict(&mut track.belief, scan.time - track.time);
                track.time = scan.time;
            }
            return;
        }
        let Some(last) = self.tracks.first().map(|track| track.time) else { return };
        let common = reach(last);
        let mut beliefs: Vec<&mut B> = Vec::with_capacity(self.tracks.len());
        for track in &mut self.tracks {
            track.wait(scan.time - track.time);
            if track.time == last {
                track.existence *= common;
                beliefs.push(&mut track.belief);
            } else {
                track.existence *= reach(track.time);
                filter.predict(&mut track.belief, scan.time - track.time);
            }
            track.time = scan.time;
        }
        filter.predict_all(&mut beliefs, scan.time - last);
    }

    /// Clears what the last scan left in the tracks that it concerned.
    fn forget(&mut self) {
        let mut deleted = false;
        for &row in &self.active {
            let track = &mut self.tracks[row];
            track.measurement = None;
            if track.status == Status::Deleted {
                self.directory.remove(track.id, track.identity);
                deleted = true;
            }
        }
        if deleted {
            self.tracks.retain(|track| track.status != Status::Deleted);
        }
    }

    /// Finds the tracks that a scan concerns. A silent one that is given up does not exist any more when a report comes.
    fn select<const N: usize, F>(
        &mut self,
        filter: &F,
        scan: &Scan<'_, F::Measurement>,
        management: &Management,
    ) where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let Individuals { tracks, active, directory, .. } = self;
        active.clear();
        let named = |measurement| filter.identity(measurement);
        if !scan.detection.is_reports() || scan.measurements.iter().any(|report| named(report).is_none()) {
            active.extend(0..tracks.len());
        } else {
            for identity in scan.measurements.iter().filter_map(named) {
                let rows = directory.candidates(identity);
                active.extend(rows.filter_map(|id| tracks.binary_search_by_key(&id, |track| track.id).ok()));
            }
        }
        if !scan.detection.is_reports() {
            return;
        }
        if directory.sweeps(scan.time, management.sweep()) {
            active.extend((0..tracks.len()).filter(|&row| management.is_overdue(&tracks[row], scan.time)));
        }
        active.sort_unstable();
        active.dedup();
        for &row in &*active {
            if management.is_overdue(&tracks[row], scan.time) {
                tracks[row].existence = 0.0;
            }
        }
    }

    /// Notes what the objects of this scan turned out to be called.
    pub fn name<const N: usize, F>(&mut self, filter: &F)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        for &row in &self.active {
            let track = &mut self.tracks[row];
            let identity = filter.called(&track.belief);
            if identity != track.identity {
                self.directory.remove(track.id, track.identity);
                self.directory.add(track.id, identity);
                track.identity = identity;
            }
        }
    }

    /// Counts every measurement as clutter, until a track claims it.
    pub fn clear_uses(&mut self, measurements: usize) {
        self.uses.clear();
        self.uses.resize(measurements, Use::Clutter);
    }

    /// Drops tracks that have become the same as a stronger one: closer than the squared Mahalanobis distance `limit`.
    pub fn drop_doubles<const N: usize, F>(&mut self, filter: &F, limit: f64)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        if limit <= 0.0 {
            return;
        }
        let Individuals { tracks, active, index, near, .. } = self;
        let states: Vec<_> = active.iter().map(|&row| plane(&filter.state(&tracks[row].belief))).collect();
        index.build(&states.iter().map(|state| state.map(|state| state.0)).collect::<Vec<_>>());
        for (&row, state) in active.iter().zip(&states) {
            let Some((centre, spread)) = state else { continue };
            index.near(centre, spread, limit, near);
            for other in near.iter().map(|&other| active[other]).filter(|&other| other != row) {
                let (track, rival) = (&tracks[row], &tracks[other]);
                let alive = track.status != Status::Deleted && rival.status != Status::Deleted;
                let stronger = (track.confirmed, track.existence, rival.id)
                    > (rival.confirmed, rival.existence, track.id);
                if alive && stronger && filter.distance(&track.belief, &rival.belief, limit) <= limit {
                    tracks[other].status = Status::Deleted;
                }
            }
        }
    }

    /// Starts a tentative track at each measurement that no track claimed. `existence` is its probability where clutter has
    /// its background intensity and nothing else explains the measurement; `unexplained` says how far that is so.
    pub fn birth<const N: usize, F>(
        &mut self,
        filter: &F,
        scan: &Scan<'_, F::Measurement>,
        existence: f64,
        management: &Management,
        unexplained: impl Fn(usize) -> f64,
    ) where
        F: Filter<N, Belief = B> + ?Sized,
    {
        for (number, measurement) in scan.measurements.iter().enumerate() {
            let existence = birth_weight(existence, filter, scan, measurement) * unexplained(number);
            if self.uses[number] != Use::Clutter || existence < management.min_existence {
                continue;
            }
            // A measurement that cannot say where an object is starts none.
            let Ok(belief) = filter.birth(measurement) else { continue };
            let mut track = Track::new(self.next, belief, existence, number, scan.time);
            management.judge(&mut track, scan.time);
            self.uses[number] = Use::Started(track.id);
            self.next += 1;
            self.directory.add(track.id, track.identity);
            self.active.push(self.tracks.len());
            self.tracks.push(track);
        }
    }

    /// Gives up the tracks that hardly exist while there are more than `cap`; the confirmed ones last.
    pub fn drop_weakest(&mut self, cap: usize) {
        let alive = |track: &Track<B>| track.status != Status::Deleted;
        let mut order: Vec<usize> = (0..self.tracks.len()).filter(|&row| alive(&self.tracks[row])).collect();
        let surplus = order.len().saturating_sub(cap);
        if surplus == 0 {
            return;
        }
        order.sort_by(|&a, &b| {
            let (a, b) = (&self.tracks[a], &self.tracks[b]);
            a.confirmed.cmp(&b.confirmed).then(a.existence.total_cmp(&b.existence)).then(b.id.cmp(&a.id))
        });
        for &weak in &order[..surplus] {
            self.tracks[weak].status = Status::Deleted;
            if let Err(at) = self.active.binary_search(&weak) {
                self.active.insert(at, weak);
            }
        }
    }
}
