//! One object's cheapest path through the tracks.

/// Stands for "no track" in a path.
pub(super) const NONE: u32 = u32::MAX;

/// The track (numbered within the cluster) that an object takes at each step, or [`NONE`].
pub(super) type Path = Vec<u32>;

/// What one object gains from each track at each step, and what a change costs.
#[derive(Debug, Clone)]
pub(super) struct Chain {
    /// Tracks, with what each gives at each step.
    pub(super) gains: Vec<(u32, Vec<f64>)>,
    /// Price of taking or leaving a track.
    pub(super) change: f64,
    pub(super) steps: usize,
}

/// Prices on the use of each track at each step.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Prices {
    pub(super) values: Vec<f64>,
    steps: usize,
}

impl Prices {
    pub(super) fn new(tracks: usize, steps: usize) -> Self {
        Prices { values: vec![0.0; tracks * steps], steps }
    }

    pub(super) fn of(&self, track: u32) -> &[f64] {
        let start = track as usize * self.steps;
        &self.values[start..start + self.steps]
    }

    pub(super) fn place(&self, track: u32, step: usize) -> usize {
        track as usize * self.steps + step
    }

    pub(super) fn sum(&self) -> f64 {
        self.values.iter().sum()
    }

    /// What a path pays.
    pub(super) fn along(&self, path: &Path) -> f64 {
        let uses = path.iter().enumerate().filter(|(_, track)| **track != NONE);
        uses.map(|(step, track)| self.values[self.place(*track, step)]).sum()
    }
}

/// Memory of [`Chain::best`], to be used again.
#[derive(Debug, Default)]
pub(super) struct Memory {
    values: Vec<f64>,
    /// For each step and track, whether the path came to the track at this step.
    entered: Vec<bool>,
    /// For each step, the place in `gains` of the track that was left just before, if one was.
    left: Vec<u32>,
}

impl Chain {
    /// The cheapest path and its cost, prices included.
    ///
    /// A change from one track to another is the loss of one and the gain of the other, so every change passes through
    /// "no track", and a step costs time proportional to the number of tracks.
    pub(super) fn best(&self, prices: &Prices, memory: &mut Memory) -> (f64, Path) {
        let tracks = self.gains.len();
        memory.values.clear();
        memory.values.resize(tracks, 0.0);
        memory.entered.clear();
        memory.entered.resize(tracks * self.steps, false);
        memory.left.clear();
        let mut none = 0.0;
        for step in 0..self.steps {
            let (hub, left) = if step == 0 { (0.0, NONE) } else { self.hub(none, &memory.values) };
            let entry = if step == 0 { 0.0 } else { hub + self.change };
            memory.left.push(left);
            none = hub;
            for (place, (track, gains)) in self.gains.iter().enumerate() {
                let value = &mut memory.values[place];
                if entry < *value {
                    *value = entry;
                    memory.entered[step * tracks + place] = true;
                }
                *value += prices.of(*track)[step] - gains[step];
            }
        }
        self.trace(none, memory)
    }

    /// The cheapest way to have no track after the steps so far, and the track to leave for it.
    fn hub(&self, none: f64, values: &[f64]) -> (f64, u32) {
        let mut hub = (none, NONE);
        for (place, value) in values.iter().enumerate() {
            if value + self.change < hub.0 {
                hub = (value + self.change, place as u32);
            }
        }
        hub
    }

    fn trace(&self, none: f64, memory: &Memory) -> (f64, Path) {
        let tracks = self.gains.len();
        let (mut cost, mut place) = (none, NONE);
        for (candidate, value) in memory.values.iter().enumerate() {
            if *value < cost {
                (cost, place) = (*value, candidate as u32);
            }
        }
        let mut path = vec![NONE; self.steps];
        for step in (0..self.steps).rev() {
            if place != NONE {
                path[step] = self.gains[place as usize].0;
            }
            if place == NONE || memory.entered[step * tracks + place as usize] {
                place = memory.left[step];
            }
        }
        (cost, path)
    }

    /// What a path costs without prices.
    pub(super) fn cost(&self, path: &Path) -> f64 {
        let mut cost = 0.0;
        for (step, &track) in path.iter().enumerate() {
            if let Some((_, gains)) = self.gains.iter().find(|(own, _)| *own == track) {
                cost -= gains[step];
            }
            if step > 0 && path[step - 1] != track {
                let changes = f64::from(u8::from(track != NONE) + u8::from(path[step - 1] != NONE));
                cost += self.change * changes;
            }
        }
        cost
    }
}
