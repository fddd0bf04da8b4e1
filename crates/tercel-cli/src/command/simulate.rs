//! `tercel simulate`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::PossibleValuesParser;
use tercel_study::air_traffic::{AirTraffic, POPULATIONS, Simulation};

use crate::console::Console;
use crate::failure::Failure;
use crate::progress::Progress;
use crate::summary::counted;

/// Simulate flights: detections and truth as tables.
///
/// Writes detections_00000.parquet and truth_00000.parquet for the first flight, and so on. Detections have range and bearing,
/// with the accuracy that the radar states. Flight 17 of a seed is the same whatever the number of flights.
#[derive(Debug, Args)]
#[command(after_long_help = AFTER)]
pub struct SimulateArguments {
    /// Which flights.
    #[arg(value_name = "SCENARIO", value_parser = PossibleValuesParser::new(POPULATIONS))]
    scenario: String,
    /// Seed of the random numbers.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Number of flights.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1 << 32))]
    runs: u64,
    /// Probability that the radar detects the aircraft in a scan; the first scan always has it.
    #[arg(long, value_name = "P", default_value_t = 1.0, value_parser = probability, allow_negative_numbers = true)]
    detection: f64,
    /// Format of the tables.
    #[arg(long, value_enum, default_value_t, value_name = "FORMAT")]
    format: TableFormat,
    /// Folder for the tables; it is made if it is not there.
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
}

/// A format of tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
enum TableFormat {
    /// Small, and quick to read.
    #[default]
    Parquet,
    /// Text with commas.
    Csv,
    /// A JSON object a line.
    Ndjson,
}

const AFTER: &str = "\
Scenarios: one aircraft flies straight and turns, seen by a radar, a scan a second
  atc-train       200 steps, 1 to 4 manoeuvres, turns to 10 degrees/s
  atc-validation  200 steps, 1 to 5 manoeuvres, turns to 10 degrees/s
  atc-test        200 steps, 1 to 6 manoeuvres, turns to 12 degrees/s
  atc-hshm        400 steps, 4 to 8 manoeuvres, turns to 20 degrees/s, 400 to 600 m/s

Examples:
  tercel simulate atc-test --seed 1 --runs 10 -o flights
  tercel simulate atc-hshm --runs 100 --detection 0.8 --format csv -o flights
  tercel config init --preset air-traffic -o air-traffic.toml
  tercel track flights/detections_00000.parquet --config air-traffic.toml -o tracks.parquet
  tercel evaluate tracks.parquet --truth flights/truth_00000.parquet --cutoff 5000";

fn probability(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number| (0.0..=1.0).contains(number));
    number.ok_or_else(|| "expected a probability, 0 to 1".to_owned())
}

impl SimulateArguments {
    /// Writes the tables.
    pub fn run(&self, console: &Console) -> Result<(), Failure> {
        let population = AirTraffic::named(&self.scenario)
            .ok_or_else(|| Failure::usage(format!("there is no scenario `{}`", self.scenario)))?;
        let ending = match self.format {
            TableFormat::Parquet => "parquet",
            TableFormat::Csv => "csv",
            TableFormat::Ndjson => "ndjson",
        };
        let (seed, runs, detection) = (self.seed, self.runs, self.detection);
        let steps = usize::try_from(runs).unwrap_or(usize::MAX);
        let progress = Progress::bar(console, "simulating", steps);
        Simulation { population, seed, runs, detection, ending }.write(&self.output, &|| progress.step())?;
        drop(progress);
        console.note(format!("{} in {}", counted(runs, "flight"), self.output.display()));
        Ok(())
    }
}
