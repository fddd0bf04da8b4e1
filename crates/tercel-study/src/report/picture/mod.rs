//! The picture of a recording: tables turned into compact columns for the page.

mod budget;
mod plots;
mod tracks;
mod truths;

use std::collections::BTreeSet;

use serde::Serialize;
use tercel_data::table::{Detections, Status, Tracks, Truths};

use self::budget::{Budget, DRAWN_TIMES, stride};
use self::plots::Plots;
use self::tracks::{TrackColumns, columns_of_tracks};
use self::truths::{TruthColumns, columns_of_truths, count_objects};
use super::chart::ChartData;
use super::number::Number;
use super::{Chart, Form, ReportError};

/// A recording in plan view: detections, tracks with their 2-sigma ellipses, and truth, with a time slider.
///
/// Times of the page count from the first scan. What has no finite time or position is not drawn; the page says
/// how much that is. Of more than 200,000 detections or 300,000 rows of tracks, an even share is drawn, and the page
/// says so; figures in tables come from all rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    start: f64,
    times: Vec<Number>,
    plots: Plots,
    modes: Vec<String>,
    tracks: Vec<TrackColumns>,
    truths: Vec<TruthColumns>,
    notes: Vec<String>,
    charts: Vec<Chart>,
    counts: Option<Chart>,
}

/// What is known about a sensor besides its scans.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SensorNote {
    /// The name in [`Scan::sensor`](tercel_data::table::Scan::sensor).
    pub sensor: String,
    /// How the page calls it; the name itself if there is no other.
    pub label: Option<String>,
    /// Where it stands in the local frame (`x, y`), m, when the scans do not say so.
    pub position: Option<[f64; 2]>,
}

/// The picture as the page reads it.
#[derive(Serialize)]
pub(super) struct PictureData<'a> {
    start: Number,
    times: &'a [Number],
    #[serde(flatten)]
    plots: &'a Plots,
    modes: &'a [String],
    tracks: &'a [TrackColumns],
    truths: &'a [TruthColumns],
    notes: &'a [String],
    charts: Vec<ChartData>,
}

impl Picture {
    /// Takes what the page needs from the tables. A last chart counts tracks and, with `truths`, objects.
    ///
    /// # Errors
    /// When the tracks have no `x` and `y`, or a state does not fit the labels.
    pub fn new(
        detections: &Detections,
        tracks: &Tracks,
        truths: Option<&Truths>,
        sensors: &[SensorNote],
    ) -> Result<Picture, ReportError> {
        let times = times_of(detections, tracks, truths);
        let start = times.first().copied().unwrap_or(0.0);
        let mut notes = Vec::new();
        let budget = Budget::of(detections, tracks, truths);
        let plots = Plots::of(detections, sensors, start, budget.detections, &mut notes);
        let reports = report_times(detections, tracks);
        let columns = columns_of_tracks(tracks, start, &reports, budget.track_rows, &mut notes)?;
        let objects = truths
            .map_or_else(Vec::new, |truths| columns_of_truths(truths, start, budget.truth_rows, &mut notes));
        let counted = if reports.is_empty() { &times } else { &reports };
        Ok(Picture {
            start,
            times: stops(&times, &mut notes).map(|time| Number::milli(time - start)).collect(),
            plots,
            modes: tracks.modes.clone(),
            tracks: columns,
            truths: objects,
            notes,
            charts: Vec::new(),
            counts: (!times.is_empty()).then(|| count_chart(counted, tracks, truths)),
        })
    }

    /// Gives a track a name, which the page shows instead of its number. A number that no track has changes nothing.
    pub fn with_track_name(mut self, track: u64, name: impl Into<String>) -> Picture {
        let name = name.into();
        for columns in self.tracks.iter_mut().filter(|columns| columns.is(track)) {
            columns.set_name(name.clone());
        }
        self
    }

    /// Leaves out the chart that counts tracks, where these are of several trackers.
    pub fn without_counts(self) -> Picture {
        Picture { counts: None, ..self }
    }

    /// Adds a chart over the time of the recording. A line marks the time of the slider, and a click moves it.
    pub fn with_chart(mut self, chart: Chart) -> Picture {
        self.charts.push(chart);
        self
    }

    pub(super) fn data(&self) -> Result<PictureData<'_>, ReportError> {
        let charts = self.charts.iter().chain(&self.counts);
        Ok(PictureData {
            start: Number::milli(self.start),
            times: &self.times,
            plots: &self.plots,
            modes: &self.modes,
            tracks: &self.tracks,
            truths: &self.truths,
            notes: &self.notes,
            charts: charts.map(|chart| chart.data(self.start)).collect::<Result<_, _>>()?,
        })
    }
}

/// The times of a recording: those of scans and tracks; those of the truth if there is nothing else.
fn times_of(detections: &Detections, tracks: &Tracks, truths: Option<&Truths>) -> Vec<f64> {
    let scans = detections.scans.iter().map(|scan| scan.time);
    let times = sorted_times(scans.chain(tracks.rows.iter().map(|row| row.time)));
    if !times.is_empty() {
        return times;
    }
    sorted_times(truths.iter().flat_map(|truths| &truths.rows).map(|row| row.time))
}

/// The times at which the slider stops: an even share when there are very many, and always the last.
fn stops<'a>(times: &'a [f64], remarks: &mut Vec<String>) -> impl Iterator<Item = f64> + 'a {
    let (stride, last) = (stride(times.len(), DRAWN_TIMES), times.len().saturating_sub(1));
    if stride > 1 {
        remarks.push(format!("The slider stops at one in {stride} of {} times.", times.len()));
    }
    times.iter().enumerate().filter(move |(i, _)| i % stride == 0 || *i == last).map(|(_, time)| *time)
}

/// The times at which a tracker told its tracks: those of the scans of sensors that it reported on, so that a scan
/// without any track counts as one.
fn report_times(detections: &Detections, tracks: &Tracks) -> Vec<f64> {
    let sensors: BTreeSet<&str> = tracks.rows.iter().map(|row| &*row.sensor).collect();
    let scans = detections.scans.iter().filter(|scan| sensors.contains(&*scan.sensor)).map(|scan| scan.time);
    sorted_times(scans.chain(tracks.rows.iter().map(|row| row.time)))
}

/// Finite times in ascending order, each once.
fn sorted_times(times: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut times: Vec<f64> = times.filter(|time| time.is_finite()).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

/// Objects and tracks over time.
fn count_chart(times: &[f64], tracks: &Tracks, truths: Option<&Truths>) -> Chart {
    let mut confirmed = vec![0.0; times.len()];
    let mut tentative = vec![0.0; times.len()];
    for row in &tracks.rows {
        let Ok(at) = times.binary_search_by(|time| time.total_cmp(&row.time)) else { continue };
        match row.status {
            Status::Confirmed | Status::Coasted => confirmed[at] += 1.0,
            Status::Tentative => tentative[at] += 1.0,
            Status::Deleted => {}
        }
    }
    let chart = Chart::over_time("Number of tracks", "", times.to_vec())
        .with_form(Form::Steps)
        .with_part("confirmed tracks", confirmed);
    // Tables often hold confirmed tracks alone.
    let any = tentative.iter().any(|count| *count > 0.0);
    let chart = if any { chart.with_part("tentative tracks", tentative) } else { chart };
    match truths {
        Some(truths) => chart.with_part("true objects", count_objects(times, truths)),
        None => chart,
    }
}
