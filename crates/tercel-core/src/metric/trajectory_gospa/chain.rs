//! One object's cheapest path through the tracks.

use std::ops::Range;

/// Stands for "no track" in a path.
pub(super) const NONE: u32 = u32::MAX;

/// The track (numbered within the group) that an object takes at each step of its chain, or [`NONE`].
pub(super) type Path = Vec<u32>;

/// A track that an object comes near.
#[derive(Debug, Clone)]
pub(super) struct Near {
    pub(super) track: u32,
    /// The first step at which the track is near any object.
    pub(super) first: usize,
    /// The place of that step among the prices; the others follow it.
    pub(super) place: usize,
    /// What the object pays with the track at each step until the last at which the track is near any object.
    pub(super) costs: Vec<f64>,
}

impl Near {
    fn end(&self) -> usize {
        self.first + self.costs.len()
    }
}

/// What one object pays with each track and without one, at each step, and what a change costs.
///
/// An object may keep its first track since before, and its last one beyond, the steps at which that track is near anyone:
/// nobody else wants it then, and neither taking nor leaving it is a change.
#[derive(Debug, Clone)]
pub(super) struct Chain {
    pub(super) steps: Range<usize>,
    /// Cost of having no track.
    pub(super) alone: Vec<f64>,
    /// By their first step.
    pub(super) near: Vec<Near>,
    /// Price of taking or leaving a track.
    pub(super) change: f64,
}

/// How a path came to a track.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Entry {
    /// It was there before.
    Stayed,
    /// By a change.
    Changed,
    /// It had this track, and no other, since the beginning.
    First,
}

/// Memory of [`Chain::best`], to be used again.
#[derive(Debug, Default)]
pub(super) struct Memory {
    values: Vec<f64>,
    active: Vec<usize>,
    /// Where the entries of each track begin.
    starts: Vec<usize>,
    entries: Vec<Entry>,
    /// For each step, the place in `near` of the track that was left just before, if one was.
    left: Vec<u32>,
}

/// The cheapest way to have no track before a step, and the track that was left for it.
struct Hub {
    value: f64,
    left: u32,
}

/// The cheapest way to keep a track for good beyond its last step.
struct Kept {
    value: f64,
    place: u32,
    end: usize,
}

impl Chain {
    /// The cheapest path and its cost, prices included.
    ///
    /// A change from one track to another is the loss of one and the gain of the other, so every change passes through
    /// "no track", and a step costs time proportional to the number of tracks near anyone then.
    pub(super) fn best(&self, prices: &[f64], memory: &mut Memory) -> (f64, Path) {
        memory.begin(self);
        let (mut none, mut untouched, mut next) = (0.0, 0.0, 0);
        let mut kept = Kept { value: f64::INFINITY, place: NONE, end: 0 };
        for (k, step) in self.steps.clone().enumerate() {
            let hub = self.hub(none, memory);
            self.retire(step, k, memory, &mut kept);
            while self.near.get(next).is_some_and(|near| near.first == step) {
                memory.active.push(next);
                next += 1;
            }
            for &place in &memory.active {
                let near = &self.near[place];
                let i = step - near.first;
                let (mut value, mut entry) = match i {
                    0 => (untouched, Entry::First),
                    _ => (memory.values[place], Entry::Stayed),
                };
                if hub.value + self.change < value {
                    (value, entry) = (hub.value + self.change, Entry::Changed);
                }
                memory.entries[memory.starts[place] + i] = entry;
                memory.values[place] = value + near.costs[i] + prices[near.place + i];
            }
            memory.left.push(hub.left);
            none = hub.value + self.alone[k];
            untouched += self.alone[k];
            kept.value += self.alone[k];
        }
        self.retire(self.steps.end, self.alone.len(), memory, &mut kept);
        self.trace(none, &kept, memory)
    }

    fn hub(&self, none: f64, memory: &Memory) -> Hub {
        let mut hub = Hub { value: none, left: NONE };
        for &place in &memory.active {
            let value = memory.values[place] + self.change;
            if value < hub.value {
                hub = Hub { value, left: place as u32 };
            }
        }
        hub
    }

    /// Takes away the tracks that are near nobody any more; a path may end with one of them.
    fn retire(&self, step: usize, k: usize, memory: &mut Memory, kept: &mut Kept) {
        let Memory { active, values, .. } = memory;
        active.retain(|&place| {
            let over = self.near[place].end() == step;
            if over && values[place] < kept.value {
                *kept = Kept { value: values[place], place: place as u32, end: k };
            }
            !over
        });
    }

    fn trace(&self, none: f64, kept: &Kept, memory: &Memory) -> (f64, Path) {
        let mut path = vec![NONE; self.alone.len()];
        let (cost, mut place, end) = match kept.value < none {
            true => (kept.value, kept.place, kept.end),
            false => (none, NONE, path.len()),
        };
        for k in (0..end).rev() {
            if place == NONE {
                place = memory.left[k];
                continue;
            }
            let near = &self.near[place as usize];
            path[k] = near.track;
            match memory.entries[memory.starts[place as usize] + self.steps.start + k - near.first] {
                Entry::Stayed => {}
                Entry::Changed => place = memory.left[k],
                Entry::First => break,
            }
        }
        (cost, path)
    }

    /// Calls `each` for every step of a path, with the track, if there is one, and how often a track is taken or left then.
    pub(super) fn follow<'a>(&'a self, path: &[u32], mut each: impl FnMut(usize, Option<&'a Near>, f64)) {
        let first = path.iter().position(|track| *track != NONE).unwrap_or(0);
        let last = path.iter().rposition(|track| *track != NONE).unwrap_or(0);
        let mut before: Option<&Near> = None;
        for (k, (&track, step)) in path.iter().zip(self.steps.clone()).enumerate() {
            if before.map_or(NONE, |near| near.track) == track {
                each(k, before, 0.0);
                continue;
            }
            let now = self.near.iter().find(|near| near.track == track);
            let taken = now.is_some_and(|near| !(k == first && near.first == step));
            let left = before.is_some_and(|near| !(k > last && near.end() == step));
            each(k, now, f64::from(u8::from(taken) + u8::from(left)));
            before = now;
        }
    }

    /// What a path costs without prices.
    pub(super) fn cost(&self, path: &[u32]) -> f64 {
        let mut cost = 0.0;
        self.follow(path, |k, near, changes| {
            cost += match near {
                Some(near) => near.costs[self.steps.start + k - near.first],
                None => self.alone[k],
            };
            cost += self.change * changes;
        });
        cost
    }

    /// The places among the prices that a path uses.
    pub(super) fn uses(&self, path: &[u32]) -> Vec<usize> {
        let mut uses = Vec::new();
        self.follow(path, |k, near, _| {
            uses.extend(near.map(|near| near.place + self.steps.start + k - near.first));
        });
        uses
    }
}

impl Memory {
    fn begin(&mut self, chain: &Chain) {
        self.values.clear();
        self.values.resize(chain.near.len(), f64::INFINITY);
        self.active.clear();
        self.starts.clear();
        let mut length = 0;
        for near in &chain.near {
            self.starts.push(length);
            length += near.costs.len();
        }
        self.entries.clear();
        self.entries.resize(length, Entry::Stayed);
        self.left.clear();
    }
}
