//! Tracks as columns.

use std::collections::BTreeMap;

use serde::Serialize;
use tercel_data::table::{Status, Track, Tracks};

use super::budget::{keep_longest, stride};
use crate::report::ReportError;
use crate::report::number::{Id, Number};

/// The rows of one track. Columns without any known value are left out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct TrackColumns {
    id: Id,
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    /// Time of the first report without the track; missing when it is there to the end.
    until: Number,
    /// Rows of the table that a detection updated, before any thinning.
    updates: usize,
    /// Highest probability of existence, before any thinning.
    peak: Number,
    /// One letter a row: `T`entative, `C`onfirmed, coasted (`K`), `D`eleted.
    status: String,
    t: Vec<Number>,
    x: Vec<Number>,
    y: Vec<Number>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    vx: Vec<Number>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    vy: Vec<Number>,
    existence: Vec<Number>,
    /// Semi-axes and orientation of the 2-sigma ellipse of the position.
    major: Vec<Number>,
    minor: Vec<Number>,
    angle: Vec<Number>,
    /// Semi-axes and orientation of the object.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    extent: Vec<Option<[Number; 3]>>,
    /// Probabilities of the modes: one column a mode.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    modes: Vec<Vec<Number>>,
    detection: Vec<Option<Id>>,
}

impl TrackColumns {
    pub(super) fn is(&self, track: u64) -> bool {
        self.id == Id(track)
    }

    pub(super) fn set_name(&mut self, name: String) {
        self.name = Some(name);
    }
}

/// Splits the table into tracks, in the order of their numbers. `reports` are the times at which tracks were told.
pub(super) fn columns_of_tracks(
    tracks: &Tracks,
    start: f64,
    reports: &[f64],
    limit: usize,
    remarks: &mut Vec<String>,
) -> Result<Vec<TrackColumns>, ReportError> {
    let mut lives: BTreeMap<u64, Vec<&Track>> = BTreeMap::new();
    for row in tracks.rows.iter().filter(|row| row.time.is_finite()) {
        lives.entry(row.track).or_default().push(row);
    }
    if lives.is_empty() {
        return Ok(Vec::new());
    }
    let layout = Layout::of(&tracks.labels)?;
    keep_longest(&mut lives, "tracks", remarks);
    let rows = tracks.rows.len();
    let stride = stride(rows, limit);
    if stride > 1 {
        remarks.push(format!("One in {stride} of {rows} rows of tracks is drawn."));
    }
    let frame = Frame { layout, modes: tracks.modes.len(), start, reports, stride };
    lives.into_iter().map(|(id, life)| columns(id, life, &frame)).collect()
}

/// What all tracks of a table share.
struct Frame<'a> {
    layout: Layout,
    modes: usize,
    start: f64,
    reports: &'a [f64],
    stride: usize,
}

fn columns(id: u64, mut life: Vec<&Track>, frame: &Frame<'_>) -> Result<TrackColumns, ReportError> {
    let (layout, start) = (&frame.layout, frame.start);
    life.sort_by(|a, b| a.time.total_cmp(&b.time));
    for row in &life {
        layout.check(row)?;
    }
    let updates = life.iter().filter(|row| row.detection.is_some()).count();
    let peak = life.iter().map(|row| row.existence).fold(f64::NAN, f64::max);
    let rows = thinned(&life, frame.stride);
    let column = |value: &dyn Fn(&Track) -> Number| rows.iter().map(|row| value(row)).collect::<Vec<_>>();
    let ellipses: Vec<Option<[f64; 3]>> = rows.iter().map(|row| layout.ellipse(row)).collect();
    let axis = |i: usize| ellipses.iter().map(|e| Number::optional(e.map(|e| e[i]))).collect();
    let velocity = |i: Option<usize>| i.map_or(Vec::new(), |i| column(&|row| Number::milli(row.state[i])));
    let extended = rows.iter().any(|row| row.extent.is_some());
    let mode = |i: usize| column(&|row| row.modes.get(i).map_or(Number::MISSING, |&p| Number::milli(p)));
    let last = life.last().map_or(f64::NAN, |row| row.time);
    let until = frame.reports.get(frame.reports.partition_point(|&time| time <= last)).copied();
    Ok(TrackColumns {
        id: Id(id),
        name: None,
        until: Number::optional(until.map(|until| until - start)),
        updates,
        peak: Number::milli(peak),
        status: rows.iter().map(|row| letter(row.status)).collect(),
        t: column(&|row| Number::milli(row.time - start)),
        x: column(&|row| Number::milli(row.state[layout.x])),
        y: column(&|row| Number::milli(row.state[layout.y])),
        vx: velocity(layout.vx),
        vy: velocity(layout.vy),
        existence: column(&|row| Number::milli(row.existence)),
        major: axis(0),
        minor: axis(1),
        angle: axis(2),
        extent: match extended {
            true => rows.iter().map(|row| row.extent.map(|extent| extent.map(Number::milli))).collect(),
            false => Vec::new(),
        },
        modes: (0..frame.modes).map(mode).collect(),
        detection: rows.iter().map(|row| row.detection.map(Id)).collect(),
    })
}

/// Every `stride`-th row, and besides them the first, the last and those where a track is confirmed or deleted.
fn thinned<'a>(life: &[&'a Track], stride: usize) -> Vec<&'a Track> {
    let standing = |row: &Track| match row.status {
        Status::Confirmed | Status::Coasted => Status::Confirmed,
        other => other,
    };
    let kept = |(i, _): &(usize, &&Track)| {
        let changes = |j: usize| standing(life[j]) != standing(life[j - 1]);
        let ends = *i == 0 || *i + 1 == life.len();
        ends || i % stride == 0 || changes(*i) || changes(*i + 1)
    };
    life.iter().enumerate().filter(kept).map(|(_, row)| *row).collect()
}

fn letter(status: Status) -> char {
    match status {
        Status::Tentative => 'T',
        Status::Confirmed => 'C',
        Status::Coasted => 'K',
        Status::Deleted => 'D',
    }
}

/// Where the components of the plan lie in a state.
struct Layout {
    size: usize,
    x: usize,
    y: usize,
    vx: Option<usize>,
    vy: Option<usize>,
}

impl Layout {
    fn of(labels: &[String]) -> Result<Layout, ReportError> {
        let find = |name: &str| labels.iter().position(|label| label == name);
        let need = |label: &'static str| {
            find(label).ok_or_else(|| ReportError::MissingLabel { label, found: labels.join(", ") })
        };
        Ok(Layout { size: labels.len(), x: need("x")?, y: need("y")?, vx: find("vx"), vy: find("vy") })
    }

    fn check(&self, row: &Track) -> Result<(), ReportError> {
        if row.state.len() == self.size {
            return Ok(());
        }
        let (track, time) = (row.track, row.time);
        Err(ReportError::StateLength { track, time, found: row.state.len(), expected: self.size })
    }

    /// The 2-sigma ellipse of the position, if the covariance has one: semi-axes, and the angle of the first.
    ///
    /// ```text
    /// λ = (p + q)/2 ± sqrt(((p - q)/2)² + c²),    θ = atan2(2c, p - q) / 2        for [p c; c q]
    /// ```
    fn ellipse(&self, row: &Track) -> Option<[f64; 3]> {
        let entry = |i: usize, j: usize| {
            let (i, j) = (i.min(j), i.max(j));
            row.covariance.get(i * self.size + j - i * (i + 1) / 2).copied()
        };
        let (p, q, c) = (entry(self.x, self.x)?, entry(self.y, self.y)?, entry(self.x, self.y)?);
        let (middle, spread) = ((p + q) / 2.0, ((p - q) / 2.0).hypot(c));
        let axes = [2.0 * (middle + spread).sqrt(), 2.0 * (middle - spread).max(0.0).sqrt()];
        let ellipse = [axes[0], axes[1], 0.5 * (2.0 * c).atan2(p - q)];
        ellipse.iter().all(|value| value.is_finite()).then_some(ellipse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(time: f64, status: Status) -> Track {
        Track {
            time,
            sensor: "radar".into(),
            track: 7,
            status,
            existence: 0.5,
            state: vec![1.0, 2.0, 3.0, 4.0],
            covariance: vec![4.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 1.0, 0.0, 1.0],
            modes: vec![],
            extent: None,
            altitude: None,
            identity: None,
            detection: Some(time as u64),
        }
    }

    fn table(rows: Vec<Track>) -> Tracks {
        Tracks { labels: ["x", "y", "vx", "vy"].map(String::from).to_vec(), rows, ..Tracks::default() }
    }

    #[test]
    fn the_ellipse_has_two_standard_deviations_along_its_axes() {
        let columns =
            columns_of_tracks(&table(vec![row(0.0, Status::Confirmed)]), 0.0, &[], 9, &mut vec![]).unwrap();
        let json = serde_json::to_value(&columns[0]).unwrap();
        assert_eq!((&json["major"], &json["minor"]), (&serde_json::json!([6]), &serde_json::json!([4])));
        assert_eq!(json["angle"], serde_json::json!([1.571]));
    }

    #[test]
    fn a_track_stands_until_the_first_report_without_it() {
        let rows = table(vec![row(0.0, Status::Confirmed), row(2.0, Status::Confirmed)]);
        let until = |reports: &[f64]| {
            let columns = columns_of_tracks(&rows, 0.0, reports, 9, &mut vec![]).unwrap();
            serde_json::to_value(&columns[0]).unwrap()["until"].clone()
        };
        assert_eq!(until(&[0.0, 2.0, 4.5, 6.0]), serde_json::json!(4.5));
        assert_eq!(until(&[0.0, 2.0]), serde_json::json!(null));
    }

    #[test]
    fn a_tilted_ellipse_points_along_the_larger_eigenvector() {
        let mut tilted = row(0.0, Status::Confirmed);
        tilted.covariance[..5].copy_from_slice(&[5.0, 4.0, 0.0, 0.0, 5.0]);
        let layout = Layout::of(&table(vec![]).labels).unwrap();
        let [major, minor, angle] = layout.ellipse(&tilted).unwrap();
        assert!((major - 6.0).abs() < 1e-12 && (minor - 2.0).abs() < 1e-12);
        assert!((angle - std::f64::consts::FRAC_PI_4).abs() < 1e-12);
    }

    #[test]
    fn a_broken_covariance_has_no_ellipse() {
        let layout = Layout::of(&table(vec![]).labels).unwrap();
        let mut broken = row(0.0, Status::Confirmed);
        broken.covariance[0] = f64::NAN;
        assert_eq!(layout.ellipse(&broken), None);
        broken.covariance.clear();
        assert_eq!(layout.ellipse(&broken), None);
    }

    #[test]
    fn thinning_keeps_the_ends_and_every_change_of_status() {
        let status = |k| if k < 5 { Status::Tentative } else { Status::Confirmed };
        let rows: Vec<Track> = (0..100).map(|k| row(k as f64, status(k))).collect();
        let mut remarks = Vec::new();
        let columns = columns_of_tracks(&table(rows), 0.0, &[], 10, &mut remarks).unwrap();
        let json = serde_json::to_value(&columns[0]).unwrap();
        assert_eq!(json["t"], serde_json::json!([0, 4, 5, 10, 20, 30, 40, 50, 60, 70, 80, 90, 99]));
        assert_eq!((&json["updates"], remarks.len()), (&serde_json::json!(100), 1));
    }

    #[test]
    fn a_table_without_positions_is_an_error_that_names_its_components() {
        let mut tracks = table(vec![row(0.0, Status::Confirmed)]);
        tracks.labels[1] = "height".into();
        let message = columns_of_tracks(&tracks, 0.0, &[], 9, &mut vec![]).unwrap_err().to_string();
        assert!(message.contains("`y`") && message.contains("height"), "{message}");
    }

    #[test]
    fn a_state_that_does_not_fit_the_labels_is_an_error_that_names_the_row() {
        let mut short = row(12.5, Status::Confirmed);
        short.state.pop();
        let message =
            columns_of_tracks(&table(vec![short]), 0.0, &[], 9, &mut vec![]).unwrap_err().to_string();
        assert!(message.contains("track 7 at 12.5 s"), "{message}");
    }
}
