//! Tracks that each stand for one object: what trackers share that keep one belief per track.

use super::{Management, Scan, Status, Track, TrackId, Use, birth_weight, plane};
use crate::association::PlaceIndex;
use crate::filter::Filter;

/// Tracks with one belief and one probability of existence each, and what became of the measurements.
#[derive(Debug, Clone)]
pub(super) struct Individuals<B> {
    pub tracks: Vec<Track<B>>,
    pub uses: Vec<Use>,
    next: TrackId,
    index: PlaceIndex,
    near: Vec<usize>,
}

impl<B> Default for Individuals<B> {
    fn default() -> Self {
        Individuals {
            tracks: Vec::new(),
            uses: Vec::new(),
            next: 1,
            index: PlaceIndex::default(),
            near: Vec::new(),
        }
    }
}

impl<B: Clone> Individuals<B> {
    /// Forgets what was deleted in the last scan, and moves the rest on: objects survive a second with this probability.
    pub fn predict<const N: usize, F>(&mut self, filter: &F, dt: f64, survival: f64)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        self.tracks.retain(|track| track.status != Status::Deleted);
        let survival = survival.powf(dt);
        let mut beliefs: Vec<&mut B> = Vec::with_capacity(self.tracks.len());
        for track in &mut self.tracks {
            track.existence *= survival;
            track.wait(dt);
            beliefs.push(&mut track.belief);
        }
        filter.predict_all(&mut beliefs, dt);
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
        let Individuals { tracks, index, near, .. } = self;
        let states: Vec<_> = tracks.iter().map(|track| plane(&filter.state(&track.belief))).collect();
        index.build(&states.iter().map(|state| state.map(|state| state.0)).collect::<Vec<_>>());
        for (row, state) in states.iter().enumerate() {
            let Some((centre, spread)) = state else { continue };
            index.near(centre, spread, limit, near);
            for &other in near.iter().filter(|&&other| other != row) {
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
        }
    }
}
