//! Columns of the tracks: one row per reported track and scan. Their number depends on the state.

use std::sync::Arc;

use super::{Context, EXTENT, Group, Layout, extent_columns};
use crate::column::{Column, Kind, Limits};
use crate::error::{DataError, Place, Refusal};
use crate::metadata::Metadata;
use crate::remarks::Remarks;
use crate::sheet::{Cells, Sheet};
use crate::table::{Status, Track, Tracks};

/// Components of a state that are known by name, in the order of a state.
const COMPONENTS: [(&str, &str); 10] = [
    ("x", "m"),
    ("y", "m"),
    ("z", "m"),
    ("vx", "m/s"),
    ("vy", "m/s"),
    ("vz", "m/s"),
    ("ax", "m/s^2"),
    ("ay", "m/s^2"),
    ("az", "m/s^2"),
    ("turn_rate", "rad/s"),
];

fn unit(label: &str) -> &'static str {
    COMPONENTS.iter().find(|(name, _)| *name == label).map_or("", |(_, unit)| unit)
}

/// Unit of the covariance of two components, when both have one.
fn product(a: &str, b: &str) -> String {
    match (unit(a), unit(b)) {
        ("", _) | (_, "") => String::new(),
        (a, b) => format!("{a}*{b}"),
    }
}

/// Names of the columns of the covariance: upper triangle, row by row.
fn covariance_names(labels: &[String]) -> impl Iterator<Item = (&str, &str)> {
    labels.iter().enumerate().flat_map(|(i, a)| labels[i..].iter().map(move |b| (a.as_str(), b.as_str())))
}

/// The columns for these states and modes.
pub(crate) fn track_columns(labels: &[String], modes: &[String]) -> Vec<Column> {
    let mut columns = vec![
        Column::time(),
        Column::text("sensor"),
        Column::count("track").needed(),
        Column::text("status"),
        Column::real("existence", "", Limits::Probability),
    ];
    columns.extend(labels.iter().map(|label| Column::named(label.clone(), unit(label).to_owned()).needed()));
    columns
        .extend(covariance_names(labels).map(|(a, b)| Column::named(format!("cov_{a}_{b}"), product(a, b))));
    columns.extend(modes.iter().map(|mode| Column {
        kind: Kind::Real(Limits::Probability),
        ..Column::named(format!("mode_{mode}"), String::new())
    }));
    columns.extend(extent_columns());
    columns.push(Column::text("identity"));
    columns.push(Column::count("detection"));
    columns
}

/// Appends tracks to a sheet of [`track_columns`].
pub(crate) fn fill_tracks(
    sheet: &mut Sheet,
    rows: &[Track],
    labels: &[String],
    modes: &[String],
    file: &Arc<str>,
) -> Result<(), DataError> {
    let n = labels.len();
    let entries = n * (n + 1) / 2;
    for track in rows {
        let lengths = [track.state.len(), track.modes.len()];
        let covariance = track.covariance.len();
        if lengths != [n, modes.len()] || (covariance != entries && covariance != 0) {
            return Err(DataError::Row {
                place: sheet.place(file, sheet.len()),
                problem: format!(
                    "track {} has {} components, {covariance} covariances and {} modes; expected {n}, {entries} and {}",
                    track.track,
                    lengths[0],
                    lengths[1],
                    modes.len()
                ),
                help: "give every row the state that the labels of the table name",
            });
        }
        let mut filler = sheet.filler();
        filler.real(track.time).text(Some(&track.sensor)).count(track.track);
        filler.text(Some(&Arc::from(track.status.name()))).real(track.existence);
        filler.reals(track.state.iter().copied().map(Some));
        filler.reals((0..entries).map(|i| track.covariance.get(i).copied()));
        filler.reals(track.modes.iter().copied().map(Some));
        match track.extent {
            Some(extent) => filler.reals(extent.map(Some)),
            None => filler.reals([None; 3]),
        };
        filler.text(track.identity.as_ref()).count(track.detection);
    }
    Ok(())
}

impl Layout for Tracks {
    const TABLE: &'static str = "tracks";

    fn columns(metadata: &Metadata) -> Vec<Column> {
        track_columns(&metadata.labels, &metadata.modes)
    }

    fn widest() -> Metadata {
        let labels = COMPONENTS.iter().map(|(name, _)| (*name).to_owned()).collect();
        Metadata { labels, ..Metadata::new(Self::TABLE, None) }
    }

    /// Without a description the state is made of the components that are known by name.
    fn guess(found: &[String]) -> Metadata {
        let known = |name: &str| found.iter().any(|column| column == name);
        let mut labels: Vec<String> =
            COMPONENTS.iter().filter(|(name, _)| known(name)).map(|(name, _)| (*name).to_owned()).collect();
        // A track without a place is refused, with the message for a missing column.
        for needed in ["y", "x"] {
            if !known(needed) {
                labels.insert(0, needed.to_owned());
            }
        }
        let modes = found.iter().filter_map(|name| name.strip_prefix("mode_")).map(str::to_owned).collect();
        Metadata { labels, modes, ..Metadata::new(Self::TABLE, None) }
    }

    fn metadata(&self) -> Metadata {
        Metadata {
            labels: self.labels.clone(),
            modes: self.modes.clone(),
            ..Metadata::new(Self::TABLE, self.origin)
        }
    }

    fn fill(&self, sheet: &mut Sheet, file: &Arc<str>) -> Result<(), DataError> {
        fill_tracks(sheet, &self.rows, &self.labels, &self.modes, file)
    }

    fn from_sheet(
        sheet: &Sheet,
        metadata: Metadata,
        context: &Context<'_>,
        remarks: &mut Remarks,
    ) -> Result<Self, DataError> {
        let Metadata { labels, modes, origin, .. } = metadata;
        let reader = Reader::new(sheet, &labels, &modes, context);
        let mut rows = Vec::with_capacity(sheet.len());
        for row in 0..sheet.len() {
            match reader.read(row) {
                Ok(track) => rows.push(track),
                Err(error) => remarks.refuse(error)?,
            }
        }
        Ok(Tracks { origin, labels, modes, rows })
    }
}

/// The columns of a sheet of tracks.
struct Reader<'a> {
    sheet: &'a Sheet,
    file: &'a Arc<str>,
    time: Cells<'a, f64>,
    sensor: Cells<'a, Arc<str>>,
    track: Cells<'a, u64>,
    status: Cells<'a, Arc<str>>,
    existence: Cells<'a, f64>,
    state: Vec<Cells<'a, f64>>,
    covariance: Vec<Cells<'a, f64>>,
    modes: Vec<Cells<'a, f64>>,
    extent: Group<'a, 3>,
    identity: Cells<'a, Arc<str>>,
    detection: Cells<'a, u64>,
}

impl<'a> Reader<'a> {
    fn new(sheet: &'a Sheet, labels: &[String], modes: &[String], context: &Context<'a>) -> Self {
        Reader {
            sheet,
            file: context.file,
            time: sheet.reals("time"),
            sensor: sheet.texts("sensor"),
            track: sheet.counts("track"),
            status: sheet.texts("status"),
            existence: sheet.reals("existence"),
            state: labels.iter().map(|label| sheet.reals(label)).collect(),
            covariance: covariance_names(labels).map(|(a, b)| sheet.reals(&format!("cov_{a}_{b}"))).collect(),
            modes: modes.iter().map(|mode| sheet.reals(&format!("mode_{mode}"))).collect(),
            extent: Group::new(sheet, EXTENT),
            identity: sheet.texts("identity"),
            detection: sheet.counts("detection"),
        }
    }

    fn read(&self, row: usize) -> Result<Track, DataError> {
        let place = || self.sheet.place(self.file, row);
        let numbers =
            |cells: &[Cells<'_, f64>]| cells.iter().filter_map(|cells| cells.get(row)).collect::<Vec<_>>();
        let covariance = numbers(&self.covariance);
        if !covariance.is_empty() && covariance.len() != self.covariance.len() {
            return Err(incomplete(place(), "covariance", covariance.len(), self.covariance.len()));
        }
        let modes = numbers(&self.modes);
        if modes.len() != self.modes.len() {
            return Err(incomplete(place(), "mode probabilities", modes.len(), self.modes.len()));
        }
        Ok(Track {
            time: self.time.get(row).unwrap_or_default(),
            sensor: self.sensor.get(row).unwrap_or_default(),
            track: self.track.get(row).unwrap_or_default(),
            status: self.status(row)?,
            existence: self.existence.get(row).unwrap_or(1.0),
            state: numbers(&self.state),
            covariance,
            modes,
            extent: self.extent.get(row, place)?,
            identity: self.identity.get(row),
            detection: self.detection.get(row),
        })
    }

    /// Tracks of programs that report confirmed ones only have no status.
    fn status(&self, row: usize) -> Result<Status, DataError> {
        const ALL: [Status; 4] = [Status::Tentative, Status::Confirmed, Status::Coasted, Status::Deleted];
        let Some(name) = self.status.get(row) else { return Ok(Status::Confirmed) };
        ALL.into_iter().find(|status| status.name() == name.as_ref()).ok_or_else(|| {
            Refusal::new(format!("`{name}`"), "tentative, confirmed, coasted or deleted")
                .at(self.sheet.place(self.file, row), "status")
        })
    }
}

fn incomplete(place: Place, what: &str, known: usize, all: usize) -> DataError {
    DataError::Row {
        place,
        problem: format!("{known} of {all} columns of the {what} have a value"),
        help: "give all of them or none",
    }
}
