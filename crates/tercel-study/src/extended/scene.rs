//! What is recorded: simulated vehicles, or aircraft on recorded tracks.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix2, Vector2, Vector4};
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tercel_sim::extended::{Heading, Ride, Scatterers, Vehicle};

use super::Recording;
use crate::StudyError;

/// Where the recordings of a study come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Scene {
    /// A population of vehicles.
    Vehicle(Vehicle),
    /// Aircraft on recorded tracks.
    Aircraft(Aircraft),
}

/// Tracks of aircraft, and where their noses point.
#[derive(Debug, Clone, PartialEq)]
pub struct Aircraft {
    tracks: Vec<Vec<Vector4<f64>>>,
    interval: f64,
    heading: Heading,
}

/// Semi-axes of a Boeing 777-300ER, m.
pub(super) const AIRLINER: Vector2<f64> = Vector2::new(36.95, 32.4);

/// Semi-axes of the published vehicle, m.
pub(super) const VEHICLE: Vector2<f64> = Vector2::new(6.0, 1.25);

impl Scene {
    /// Recording number `run`. Every scan has a point at least, as published.
    ///
    /// # Errors
    /// When there is no such track.
    pub fn record(&self, seed: u64, run: u64) -> Result<Recording, StudyError> {
        let (ride, mean, noise) = match self {
            Scene::Vehicle(vehicle) => (vehicle.ride(seed, run), 20.0, (1.0, 0.64)),
            Scene::Aircraft(aircraft) => (aircraft.ride(seed, run)?, 10.0, (25.0, 20.0)),
        };
        let noise = Matrix2::new(noise.0, 0.0, 0.0, noise.1);
        let scatterers = Scatterers::new(mean, noise)?.without_empty_scans();
        let scans = ride.observe(&scatterers, seed, run);
        Ok(Recording { ride, scatterers, scans, seed: seed ^ run })
    }

    /// Number of steps of a recording.
    pub fn steps(&self) -> usize {
        match self {
            Scene::Vehicle(vehicle) => vehicle.steps(),
            Scene::Aircraft(aircraft) => aircraft.tracks.first().map_or(0, Vec::len),
        }
    }

    /// Time between steps, s.
    pub fn interval(&self) -> f64 {
        match self {
            Scene::Vehicle(vehicle) => vehicle.interval(),
            Scene::Aircraft(aircraft) => aircraft.interval,
        }
    }
}

/// Which tracks are held back to test on: one in five.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Held {
    /// The last ones, as in the publication.
    Last,
    /// Some that are drawn from all, the same ones each time.
    Random,
}

impl Held {
    /// The tracks for tuning and training, and those to test on.
    fn parts<T>(self, mut tracks: Vec<T>) -> [Vec<T>; 2] {
        if self == Held::Random {
            tracks.shuffle(&mut ChaCha8Rng::seed_from_u64(SHUFFLE));
        }
        let test = tracks.split_off(tracks.len() * 4 / 5);
        [tracks, test]
    }
}

/// The seed by which tracks to test on are drawn.
const SHUFFLE: u64 = 20;

impl Aircraft {
    /// The tracks of a NumPy file, or of the only one in a folder: an array of `(tracks, steps, 4)` with `x,
    /// y, vx, vy`.
    ///
    /// Four fifths of the tracks are for tuning and training; here are the others. The interval is the one that fits positions and
    /// velocities, which must be differences backwards in time.
    ///
    /// # Errors
    /// When there is no such file, or its array does not fit.
    pub fn test(path: &Path, heading: Heading, held: Held) -> Result<Self, StudyError> {
        let aircraft = Aircraft::read(path, heading)?;
        let [_, tracks] = held.parts(aircraft.tracks);
        Ok(Aircraft { tracks, ..aircraft })
    }

    fn read(path: &Path, heading: Heading) -> Result<Self, StudyError> {
        let path = file_of(path)?;
        let array = tercel_data::read_npy(&path)?;
        let refused = |problem: String| StudyError::Tracks { path: path.clone(), problem };
        let [count, steps, 4] = array.shape[..] else {
            return Err(refused(format!("its shape is {:?}; expected (tracks, steps, 4)", array.shape)));
        };
        if steps < 2 || count == 0 {
            return Err(refused("it holds no track of two steps or more".to_owned()));
        }
        if let Some(place) = array.values.iter().position(|value| !value.is_finite()) {
            let (track, step) = (place / (4 * steps), place / 4 % steps);
            return Err(refused(format!("track {track}, step {step} has a number that is not finite")));
        }
        let track = |values: &[f64]| values.chunks_exact(4).map(Vector4::from_column_slice).collect();
        let tracks: Vec<Vec<Vector4<f64>>> = array.values.chunks_exact(4 * steps).map(track).collect();
        let interval = interval_of(&tracks).ok_or_else(|| {
            refused(format!("its velocities are not differences of its positions; {COLUMNS}"))
        })?;
        if !INTERVALS.contains(&interval) {
            let problem = format!("positions and velocities fit to steps of {interval:.3e} s; {COLUMNS}");
            return Err(refused(problem));
        }
        Ok(Aircraft { tracks, interval, heading })
    }

    /// The tracks for tuning and training, of which none is in the test.
    ///
    /// # Errors
    /// As [`test`](Aircraft::test).
    pub fn training(path: &Path, held: Held) -> Result<Self, StudyError> {
        let aircraft = Aircraft::read(path, Heading::Course)?;
        let [tracks, _] = held.parts(aircraft.tracks);
        Ok(Aircraft { tracks, ..aircraft })
    }

    /// The same tracks with velocities that are means over seven steps, three to either side, and the positions to which they
    /// lead: without the unevenness of the recording.
    pub fn evened(mut self) -> Self {
        const SIDE: usize = 3;
        for track in &mut self.tracks {
            let old = track.clone();
            for step in 0..old.len() {
                let around = &old[step.saturating_sub(SIDE)..(step + SIDE + 1).min(old.len())];
                let velocity =
                    around.iter().map(|state| Vector2::new(state[2], state[3])).sum::<Vector2<f64>>()
                        / around.len() as f64;
                let before =
                    if step > 0 { track[step - 1].xy() + velocity * self.interval } else { old[0].xy() };
                track[step] = Vector4::new(before.x, before.y, velocity.x, velocity.y);
            }
        }
        self
    }

    /// The states `x, y, vx, vy` of each track, in m and m/s.
    pub fn tracks(&self) -> &[Vec<Vector4<f64>>] {
        &self.tracks
    }

    /// Number of tracks.
    pub fn count(&self) -> usize {
        self.tracks.len()
    }

    fn ride(&self, seed: u64, run: u64) -> Result<Ride, StudyError> {
        let track = usize::try_from(run).ok().and_then(|run| self.tracks.get(run));
        let track = track.ok_or_else(|| {
            StudyError::Option(format!(
                "there are {} tracks to test on; expected at most as many runs",
                self.count()
            ))
        })?;
        let angles = self.heading.angles(track, seed, run);
        Ok(Ride::new(self.interval, track.clone(), angles, AIRLINER)?)
    }
}

/// Times between the steps of a track, s. Outside of them the units are others.
const INTERVALS: std::ops::RangeInclusive<f64> = 0.02..=600.0;

const COLUMNS: &str = "expected x, y in m and vx, vy in m/s, of which each is the way since the step before";

/// The file itself, or the only array in a folder.
fn file_of(path: &Path) -> Result<PathBuf, StudyError> {
    if !path.is_dir() {
        return Ok(path.to_path_buf());
    }
    let failed = |source| StudyError::Folder { path: path.to_path_buf(), source };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(path).map_err(failed)? {
        let file = entry.map_err(failed)?.path();
        if file.extension().is_some_and(|extension| extension == "npy") {
            found.push(file);
        }
    }
    match <[PathBuf; 1]>::try_from(found) {
        Ok([file]) => Ok(file),
        Err(found) => {
            let problem =
                format!("it holds {} files named *.npy; name the one to read with --data", found.len());
            Err(StudyError::Tracks { path: path.to_path_buf(), problem })
        }
    }
}

/// The time that explains the positions by the velocities at the end of each step, if one does.
fn interval_of(tracks: &[Vec<Vector4<f64>>]) -> Option<f64> {
    let (mut moved, mut square, mut miss) = (0.0, 0.0, 0.0);
    let steps = || {
        tracks.iter().flat_map(|track| track.windows(2)).map(|pair| {
            let step = Vector2::new(pair[1].x - pair[0].x, pair[1].y - pair[0].y);
            (step, Vector2::new(pair[1].z, pair[1].w))
        })
    };
    for (step, velocity) in steps() {
        moved += step.dot(&velocity);
        square += velocity.norm_squared();
    }
    let interval = moved / square;
    for (step, velocity) in steps() {
        miss += (step - velocity * interval).norm_squared();
    }
    (interval > 0.0 && miss <= 0.05 * interval * moved).then_some(interval)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_track_is_to_learn_from_or_to_test_on() {
        for (held, last) in [(Held::Last, true), (Held::Random, false)] {
            let [training, test] = held.parts((0..260).collect());
            assert_eq!((training.len(), test.len()), (208, 52));
            let mut all: Vec<i32> = training.iter().chain(&test).copied().collect();
            assert_eq!(all.is_sorted(), last);
            all.sort_unstable();
            assert!(all.into_iter().eq(0..260));
            assert_eq!(held.parts((0..260).collect()), [training, test]);
        }
    }

    #[test]
    fn the_interval_is_found_and_velocities_of_something_else_are_refused() {
        let track = |lag: f64| -> Vec<Vector4<f64>> {
            let turn = |step: u32| 0.3 * f64::from(step);
            let mut place = Vector2::zeros();
            (0..50)
                .map(|step| {
                    let velocity = Vector2::new(turn(step).cos(), turn(step).sin()) * 100.0;
                    place += velocity * 4.0;
                    let told = turn(step) + lag;
                    Vector4::new(place.x, place.y, 100.0 * told.cos(), 100.0 * told.sin())
                })
                .collect()
        };
        assert!((interval_of(&[track(0.0)]).unwrap() - 4.0).abs() < 1e-9);
        assert_eq!(interval_of(&[track(2.0)]), None);
        assert_eq!(interval_of(&[vec![Vector4::zeros(); 9]]), None);
    }

    #[test]
    fn a_folder_without_an_array_says_what_is_missing() {
        let folder = tempfile::tempdir().unwrap();
        let error = Aircraft::test(folder.path(), Heading::Course, Held::Last).unwrap_err().to_string();
        assert!(error.contains("0 files named *.npy") && error.contains("--data"), "{error}");
    }
}
