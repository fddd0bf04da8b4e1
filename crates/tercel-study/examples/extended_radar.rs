//! Trackers of extended objects on radar recordings without truth: do they survive, and how long do tracks
//! live?
//!
//! Reads rows `recording,t_s,x_north_m,y_east_m,..` from standard input, as in the recordings of a canal
//! radar in Trondheim: `zcat ravnkloa.csv.gz | cargo run --release -p tercel-study --example extended_radar`

use std::collections::BTreeMap;
use std::io::BufRead;

use nalgebra::{Matrix2, Vector2};
use tercel_core::extended::{
    Evolution, GaussianInverseWishart, InverseWishart, RandomMatrix, Rate, Rule, Scattering,
    distance_partition,
};
use tercel_core::motion::ConstantVelocity;
use tercel_core::multi::{
    Clutter, ClutterMap, Detection, NearestNeighbour, NearestNeighbourConfig, Phd, PhdConfig, Scan, Status,
    Tracker, Use,
};

type Scans = BTreeMap<i64, Vec<Vector2<f64>>>;
type Fault = Box<dyn std::error::Error>;

/// Points closer than this are of one cell, m.
const DISTANCE: f64 = 4.0;

fn main() -> Result<(), Fault> {
    let recordings = read(std::io::stdin().lock())?;
    println!("recordings {}, scans {}", recordings.len(), recordings.values().map(Scans::len).sum::<usize>());
    let mut phd = Tally::default();
    let mut nearest = Tally::default();
    for scans in recordings.values() {
        phd.follow(Phd::<GaussianInverseWishart<4>>::new(PhdConfig::default())?, scans)?;
        nearest.follow(NearestNeighbour::new(NearestNeighbourConfig::default())?, scans)?;
    }
    for (name, tally) in [("giw-phd", phd), ("giw-nearest-neighbour", nearest)] {
        println!("{name}: {tally:?}");
    }
    Ok(())
}

fn read(input: impl BufRead) -> Result<BTreeMap<String, Scans>, Fault> {
    let mut recordings: BTreeMap<String, Scans> = BTreeMap::new();
    for (number, line) in input.lines().enumerate().skip(1) {
        let line = line?;
        let cells: Vec<&str> = line.split(',').collect();
        let [recording, time, north, east, ..] = cells[..] else {
            return Err(format!("line {}: expected recording, time, north, east", number + 1).into());
        };
        let point = Vector2::new(east.parse()?, north.parse()?);
        recordings.entry(recording.to_owned()).or_default().entry(time.parse()?).or_default().push(point);
    }
    Ok(recordings)
}

/// What became of the recordings.
#[derive(Debug, Default)]
struct Tally {
    scans: usize,
    cells: usize,
    clutter: usize,
    confirmed: usize,
    longest_s: f64,
    unsound: usize,
    refused: usize,
}

impl Tally {
    fn follow(
        &mut self,
        mut tracker: impl Tracker<Belief = GaussianInverseWishart<4>>,
        scans: &Scans,
    ) -> Result<(), Fault> {
        let size = InverseWishart::new(Matrix2::identity() * 9.0, 4.0)?;
        let filter = RandomMatrix::new(
            ConstantVelocity::new(0.2).with_speed(3.0),
            Scattering::uniform(Matrix2::identity())?,
            size,
            Evolution::forget(20.0)?,
            Rule::Distorted,
        )
        .with_rate(Rate::new(1.5, 3.0)?, 20.0)?;
        let detection = Detection::uniform(0.7)?;
        let mut map = ClutterMap::new(10.0, 1e-5, 30.0)?;
        let mut born: BTreeMap<u64, f64> = BTreeMap::new();
        for (time, points) in scans {
            let measurements = distance_partition(points, DISTANCE);
            let clutter = Clutter::Map(map.clone());
            let scan = Scan {
                time: *time as f64,
                measurements: &measurements,
                detection: &detection,
                clutter: &clutter,
            };
            self.scans += 1;
            self.cells += measurements.len();
            if tracker.step(&filter, &scan).is_err() {
                self.refused += 1;
                continue;
            }
            self.clutter += tracker.uses().iter().filter(|what| **what == Use::Clutter).count();
            let unexplained = measurements
                .iter()
                .zip(tracker.uses())
                .map(|(cell, what)| (cell.mean(), if matches!(what, Use::Updated(_)) { 0.0 } else { 1.0 }));
            map.learn(unexplained, &detection);
            for track in tracker.tracks().iter().filter(|track| track.status == Status::Confirmed) {
                let since = *born.entry(track.id).or_insert(scan.time);
                self.longest_s = self.longest_s.max(scan.time - since);
                let extent = filter.extent_of(&track.belief);
                let sound = extent.m11 > 0.0
                    && extent.determinant() > 0.0
                    && track.belief.state.mean.sum().is_finite();
                self.unsound += usize::from(!sound);
            }
        }
        self.confirmed += born.len();
        Ok(())
    }
}
