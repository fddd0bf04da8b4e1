//! What is said and written when tracking is over.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::{Value, json};
use tercel_data::table::Truths;
use tercel_pipeline::{Config, Summary};
use tercel_study::evaluate::Evaluation;
use tercel_study::report::{self, Chart, Form, Picture, Report, SensorNote};

use super::TrackArguments;
use super::run::Run;
use crate::account::Account;
use crate::console::Console;
use crate::failure::Failure;
use crate::output::{Target, print, print_json};
use crate::progress::Progress;
use crate::summary::{Table, count, counted, score};

/// A run that came to its end.
pub struct Outcome {
    /// The tracker and what it did.
    pub run: Run,
    /// What was really there, if it is known.
    pub truths: Option<Truths>,
    /// How the tracker was described.
    pub config: Config,
    /// Name of the configuration.
    pub configuration: String,
    /// Rows that the reader left out.
    pub left_out: Account,
    /// Lines and scans of standard input that could not be used.
    pub bad: u64,
    /// Time that reading took; nothing for a stream, which is waited for.
    pub reading: Duration,
}

impl Outcome {
    /// Scores the tracks, puts the outputs in their places and prints the summary.
    pub fn write(mut self, arguments: &TrackArguments, console: &Console) -> Result<(), Failure> {
        let Summary { late_rows, ahead_rows, ignored_rows, repeated, .. } = self.run.summary();
        self.left_out.add("a scan that came too late", late_rows);
        self.left_out.add("a time far ahead of all others", ahead_rows);
        self.left_out.add("a sensor that the configuration ignores", ignored_rows);
        self.left_out.add("a detection that repeats another of its scan", repeated);
        self.left_out.add("a line or scan that cannot be used", self.bad);
        let evaluation = match &self.truths {
            Some(truths) => {
                let times = self.run.seen.scans.iter().map(|scan| scan.time).collect();
                Some(arguments.score.evaluate(&self.run.tracks, truths, Some(times), console)?)
            }
            None => None,
        };
        let evaluation = evaluation.as_ref();
        if let Some(path) = &arguments.report {
            let _progress = Progress::spinner(console, "writing the report");
            self.report(arguments, evaluation)?.write(path)?;
        }
        self.run.finish(console)?;
        self.left_out.say_briefly(console);
        self.warn_of_nothing(console);
        if arguments.json {
            return print_json(&self.json(arguments, evaluation));
        }
        let table = self.table(arguments, evaluation).render();
        match arguments.target() {
            // Standard output has the tracks, so that the summary goes where notes go.
            Some(Target::Stdout) => console.text(&table),
            _ => print(&table)?,
        }
        Ok(())
    }

    /// No tracks are never left without a word.
    fn warn_of_nothing(&self, console: &Console) {
        const ENOUGH: u64 = 20;
        let summary = self.run.summary();
        let detections = summary.updates + summary.starts + summary.clutter;
        if summary.confirmed == 0 && detections >= ENOUGH {
            console.warn(format_args!(
                "no track is believed: {} of {} started one, {} updated one; are the speed of new objects, the deviations and the \
                 clutter density those of this sensor? Plots of an antenna that turns need scans = {{ period = SECONDS }}, reports \
                 kind = \"reports\"",
                count(summary.starts),
                counted(detections, "detection"),
                count(summary.updates)
            ));
        }
    }

    /// Names and values of the figures that need no truth.
    fn figures(&self) -> Vec<(&'static str, String)> {
        let summary = self.run.summary();
        let mut scans = format!("{} tracked, {} late", count(summary.scans), count(summary.late));
        if summary.ahead > 0 {
            scans.push_str(&format!(", {} set aside", count(summary.ahead)));
        }
        if summary.ignored > 0 {
            scans.push_str(&format!(", {} of ignored sensors", count(summary.ignored)));
        }
        if self.bad > 0 {
            scans.push_str(&format!(", {} could not be used", count(self.bad)));
        }
        let detections = summary.updates + summary.starts + summary.clutter;
        let uses = format!(
            "{}: {} updated a track, {} started one, {} clutter",
            count(detections),
            count(summary.updates),
            count(summary.starts),
            count(summary.clutter)
        );
        let mut figures = vec![("scans", scans), ("detections", uses)];
        figures.extend(self.left_out.sentence().map(|sentence| ("left out", sentence)));
        figures.extend([
            ("tracks", format!("{} confirmed", count(summary.confirmed))),
            (
                "speed",
                self.speed().map_or("-".to_owned(), |speed| match speed {
                    speed if speed < 10.0 => format!("{speed:.1} scans/s"),
                    speed => format!("{} scans/s", count(speed as u64)),
                }),
            ),
        ]);
        figures
    }

    /// Time for reading, tracking and writing, s.
    fn seconds(&self) -> f64 {
        self.reading.as_secs_f64() + self.run.seconds()
    }

    /// Scans per second, from the file to the tracks.
    fn speed(&self) -> Option<f64> {
        let speed = self.run.summary().scans as f64 / self.seconds();
        speed.is_finite().then_some(speed)
    }

    fn table(&self, arguments: &TrackArguments, evaluation: Option<&Evaluation>) -> Table {
        let mut table = Table::default();
        for (name, value) in self.figures() {
            table.figure(name, value);
        }
        if let Some(evaluation) = evaluation {
            table.heading(arguments.score.heading(evaluation));
            table.scores(evaluation);
        }
        table
    }

    fn json(&self, arguments: &TrackArguments, evaluation: Option<&Evaluation>) -> Value {
        let summary = self.run.summary();
        let target = arguments.target();
        let path = |path: Option<&Path>| path.map(|path| path.to_string_lossy().into_owned());
        json!({
            "input": arguments.input[0].to_string_lossy(),
            "inputs": arguments.input.iter().map(|path| path.to_string_lossy()).collect::<Vec<_>>(),
            "configuration": self.configuration,
            "scans": {
                "read": self.run.scans,
                "tracked": summary.scans,
                "late": summary.late,
                "ahead": summary.ahead,
                "ignored": summary.ignored,
                "bad": self.bad,
            },
            "detections": {
                "tracked": summary.updates + summary.starts + summary.clutter,
                "updated": summary.updates,
                "started": summary.starts,
                "clutter": summary.clutter,
                "left_out": summary.late_rows + summary.ahead_rows + summary.ignored_rows + summary.repeated,
            },
            "left_out": self.left_out.json(),
            "confirmed_tracks": summary.confirmed,
            "seconds": self.seconds(),
            "reading_seconds": self.reading.as_secs_f64(),
            "scans_per_second": self.speed(),
            "scores": evaluation.map(|evaluation| arguments.score.json(evaluation)),
            "outputs": {
                "tracks": path(target.as_ref().and_then(Target::file)),
                "report": path(arguments.report.as_deref()),
            },
        })
    }

    fn report(&self, arguments: &TrackArguments, evaluation: Option<&Evaluation>) -> Result<Report, Failure> {
        let mut summary = report::Summary::new();
        for (name, value) in self.figures() {
            // A box has room for the first figure; what belongs to it stands below.
            let (first, rest) = match value.split_once(": ").or_else(|| value.split_once(", ")) {
                Some((first, rest)) => (first, Some(rest)),
                None => (value.as_str(), None),
            };
            summary = summary.with(name, first, rest);
        }
        for (name, value) in evaluation.iter().flat_map(|evaluation| &evaluation.means) {
            summary = summary.with(*name, score(name, *value), None);
        }
        let sensors: Vec<SensorNote> = self
            .config
            .sensors
            .iter()
            .map(|(name, sensor)| SensorNote {
                sensor: name.clone(),
                label: None,
                position: Some(sensor.position),
            })
            .collect();
        let mut picture = Picture::new(&self.run.seen, &self.run.tracks, self.truths.as_ref(), &sensors)?;
        if let Some(evaluation) = evaluation {
            picture = picture.with_chart(gospa(evaluation));
        }
        let name =
            |path: &PathBuf| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let title = arguments.input.iter().map(name).collect::<Vec<_>>().join(", ");
        let scans = counted(self.run.summary().scans, "scan");
        Ok(Report::new(title)
            .with_subtitle(format!("Configuration {}; {scans}", self.configuration))
            .with(summary)
            .with(picture))
    }
}

/// The parts of GOSPA over time.
fn gospa(evaluation: &Evaluation) -> Chart {
    let column = |value: fn(&tercel_study::evaluate::Instant) -> f64| -> Vec<f64> {
        evaluation.instants.iter().map(value).collect()
    };
    Chart::over_time("GOSPA", "m", column(|instant| instant.time))
        .with_form(Form::Stacked)
        .with_part("localisation", column(|instant| instant.localisation))
        .with_part("missed", column(|instant| instant.missed))
        .with_part("false", column(|instant| instant.false_alarm))
}
