//! Simulated flights as files.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use tercel_sim::air_traffic::AirTraffic;

use super::{Recording, tables};
use crate::StudyError;

/// Which flights are written, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// The population.
    pub population: AirTraffic,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Number of flights.
    pub runs: u64,
    /// Probability that the radar detects the aircraft in a scan; 1 is every scan. The first scan always has it.
    pub detection: f64,
    /// Ending of the files, which tells their format: `parquet`, `csv`, `ndjson`.
    pub ending: &'static str,
}

impl Simulation {
    /// Writes the detections and the truth of every flight to `folder`: `detections_00017.parquet` and `truth_00017.parquet` for
    /// flight 17, which is the same whatever the number of flights. Each file appears whole or not at all.
    ///
    /// The detections are polar, with the accuracy that the flight's radar states. `progress` is called after each flight.
    ///
    /// # Errors
    /// When the probability is none, or a file cannot be written.
    pub fn write(&self, folder: &Path, progress: &(dyn Fn() + Sync)) -> Result<(), StudyError> {
        let failed = |source| StudyError::Output { path: folder.to_path_buf(), source };
        // A number that is no probability is found before anything is written.
        self.recording(0)?;
        std::fs::create_dir_all(folder).map_err(failed)?;
        (0..self.runs).into_par_iter().try_for_each(|run| {
            let recording = self.recording(run)?;
            tercel_data::write_truths(self.file(folder, "truth", run), &tables::truths(&recording))?;
            let detections = tables::detections(&recording);
            tercel_data::write_detections(self.file(folder, "detections", run), &detections)?;
            progress();
            Ok(())
        })
    }

    /// Flight number `run` with what the radar sees of it.
    ///
    /// # Errors
    /// When the detection probability is none.
    pub fn recording(&self, run: u64) -> Result<Recording, StudyError> {
        let flight = self.population.flight(self.seed, run);
        let radar = flight.radar().with_detection(self.detection)?;
        Ok(Recording::with_radar(flight, radar, self.seed, run))
    }

    fn file(&self, folder: &Path, table: &str, run: u64) -> PathBuf {
        folder.join(format!("{table}_{run:05}.{}", self.ending))
    }
}

#[cfg(test)]
mod tests {
    use tercel_data::{ReadOptions, read_detections, read_truths};

    use super::*;

    #[test]
    fn files_give_back_the_flights_and_a_flight_does_not_depend_on_their_number() {
        let simulation = |runs| Simulation {
            population: AirTraffic::test().with_steps(30).unwrap(),
            seed: 3,
            runs,
            detection: 0.7,
            ending: "parquet",
        };
        let folder = tempfile::tempdir().unwrap();
        simulation(3).write(folder.path(), &|| {}).unwrap();
        assert_eq!(folder.path().read_dir().unwrap().count(), 6);
        let recording = simulation(100).recording(2).unwrap();
        let path = |table: &str| folder.path().join(format!("{table}_00002.parquet"));
        let read = read_detections(path("detections"), &ReadOptions::default()).unwrap();
        assert_eq!(read, tables::detections(&recording));
        assert!(read.scans.iter().any(|scan| scan.detections.is_empty()), "a miss is a scan");
        let read = read_truths(path("truth"), &ReadOptions::default()).unwrap();
        assert_eq!(read, tables::truths(&recording));
    }

    #[test]
    fn a_number_that_is_no_probability_is_refused_before_anything_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let simulation =
            Simulation { population: AirTraffic::test(), seed: 1, runs: 1, detection: 1.1, ending: "csv" };
        let error = simulation.write(folder.path(), &|| {}).unwrap_err().to_string();
        assert!(error.contains("detection probability is 1.1"), "{error}");
        assert_eq!(folder.path().read_dir().unwrap().count(), 0);
    }
}
