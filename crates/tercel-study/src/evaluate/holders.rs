//! Which track each object has.

use std::cmp::Reverse;

use super::picture::Picture;

/// Which track each object had last.
pub(super) struct Holders {
    last: Vec<Option<usize>>,
    when: Vec<usize>,
    instants: usize,
}

impl Holders {
    pub(super) fn new(objects: usize) -> Self {
        Holders { last: vec![None; objects], when: vec![0; objects], instants: 0 }
    }

    /// Joins objects and tracks at the next time; returns the number of switches and of joined objects.
    pub(super) fn assign(&mut self, picture: &Picture) -> (usize, usize) {
        self.instants += 1;
        let joined = self.join(picture);
        let mut switches = 0;
        let pairs = joined.iter().enumerate().filter_map(|(object, track)| Some((object, (*track)?)));
        for (object, track) in pairs {
            let (id, track) = (picture.object_ids[object], picture.track_ids[track]);
            switches += usize::from(self.last[id].is_some_and(|last| last != track));
            self.last[id] = Some(track);
            self.when[id] = self.instants;
        }
        (switches, joined.iter().flatten().count())
    }

    /// The track of each object: the one that it had, objects that held theirs last first; then the nearest pairs.
    fn join(&self, picture: &Picture) -> Vec<Option<usize>> {
        let mut free: Vec<bool> = vec![true; picture.track_ids.len()];
        let mut joined: Vec<Option<usize>> = vec![None; picture.object_ids.len()];
        let mut order: Vec<usize> = (0..joined.len()).collect();
        order.sort_by_key(|&object| Reverse(self.when[picture.object_ids[object]]));
        for object in order {
            let held = self.last[picture.object_ids[object]];
            let track = held.and_then(|id| picture.track_ids.binary_search(&id).ok());
            let near =
                |track: usize| picture.near.binary_search_by_key(&(object, track), |pair| (pair.0, pair.1));
            if let Some(track) = track.filter(|&track| free[track] && near(track).is_ok()) {
                joined[object] = Some(track);
                free[track] = false;
            }
        }
        let open = picture.near.iter().filter(|pair| joined[pair.0].is_none() && free[pair.1]);
        let mut open: Vec<&(usize, usize, f64)> = open.collect();
        open.sort_by(|a, b| a.2.total_cmp(&b.2).then((a.0, a.1).cmp(&(b.0, b.1))));
        for &(object, track, _) in open {
            if joined[object].is_none() && free[track] {
                joined[object] = Some(track);
                free[track] = false;
            }
        }
        joined
    }
}
