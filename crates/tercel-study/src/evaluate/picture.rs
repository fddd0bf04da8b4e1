//! Who was where, time by time.

use tercel_core::metric::{NearIndex, Trajectory, Walk};

use crate::timeline::{Reach, Rule, Timeline};

/// The lives of all objects, or of all tracks, over the times of an evaluation.
pub(super) struct Lives {
    /// The unbroken pieces of each.
    pub(super) pieces: Vec<Trajectory<2>>,
    /// Whose piece each is, as the number of the line.
    owners: Vec<usize>,
}

impl Lives {
    pub(super) fn of<'a>(
        lines: impl Iterator<Item = &'a Timeline>,
        times: &[f64],
        rule: Rule,
        reach: Reach,
    ) -> Self {
        let mut lives = Lives { pieces: Vec::new(), owners: Vec::new() };
        for (owner, line) in lines.enumerate() {
            lives.pieces.extend(line.pieces(times, rule, reach));
            lives.owners.resize(lives.pieces.len(), owner);
        }
        lives
    }

    pub(super) fn walk(&self) -> Walk<'_, 2> {
        Walk::new(&self.pieces)
    }

    /// Owners, rising, and places of the pieces that a walk finds at a step. The pieces are sorted by their owners.
    pub(super) fn at(&self, walk: &mut Walk<'_, 2>, step: usize) -> Here {
        let (pieces, places) = walk.at(step);
        Here { owners: pieces.into_iter().map(|piece| self.owners[piece]).collect(), places }
    }
}

/// Whoever is there at one time.
pub(super) struct Here {
    owners: Vec<usize>,
    places: Vec<[f64; 2]>,
}

/// Objects and tracks at one time, and who is near whom.
pub(super) struct Picture {
    /// Numbers of the objects that were there, rising.
    pub(super) object_ids: Vec<usize>,
    /// Numbers of the tracks that were there, rising.
    pub(super) track_ids: Vec<usize>,
    /// Object, track and distance of the pairs closer than the cut-off, by object and track.
    pub(super) near: Vec<(usize, usize, f64)>,
    /// How each track stands to the objects.
    pub(super) standing: Vec<Standing>,
}

/// How near a track is to any object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Standing {
    /// Closer than the cut-off to one.
    Close,
    /// In the neighbourhood of one.
    Near,
    /// Far from all.
    Far,
}

impl Picture {
    pub(super) fn new(objects: Here, tracks: Here, cutoff: f64, neighbourhood: f64) -> Self {
        let index = NearIndex::new(&objects.places);
        let (mut near, mut standing) = (Vec::new(), Vec::with_capacity(tracks.places.len()));
        for (track, place) in tracks.places.iter().enumerate() {
            let before = near.len();
            let close = index.within(place, cutoff).filter(|(_, distance)| *distance < cutoff);
            near.extend(close.map(|(object, distance)| (object, track, distance)));
            standing.push(match () {
                () if near.len() > before => Standing::Close,
                () if index.within(place, neighbourhood).next().is_some() => Standing::Near,
                () => Standing::Far,
            });
        }
        near.sort_unstable_by_key(|&(object, track, _)| (object, track));
        Picture { object_ids: objects.owners, track_ids: tracks.owners, near, standing }
    }

    /// How many tracks stand so.
    pub(super) fn count(&self, standing: Standing) -> usize {
        self.standing.iter().filter(|one| **one == standing).count()
    }

    /// The distance of an object from its nearest track, for the objects that have one closer than the cut-off.
    pub(super) fn nearest_track(&self) -> impl Iterator<Item = f64> {
        let distance =
            |pairs: &[(usize, usize, f64)]| pairs.iter().map(|pair| pair.2).fold(f64::INFINITY, f64::min);
        self.near.chunk_by(|a, b| a.0 == b.0).map(distance)
    }
}
