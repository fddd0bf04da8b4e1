//! Columns of the tracks: one row per reported track and scan. Their number depends on the state.

use std::sync::Arc;

use super::{Context, EXTENT, Group, Layout, extent_columns};
use crate::column::{Column, Kind, Limits, Written};
use crate::earth::Navigator;
use crate::error::{DataError, Place, Refusal};
use crate::metadata::Metadata;
use crate::remarks::Remarks;
use crate::sheet::{Cells, Sheet};
use crate::table::{Origin, Status, Track, Tracks};

/// Degrees, since that is how people and other programs hold them. Seven decimals are 1 cm.
const LATITUDE: Column = Column::real("latitude", "deg", Limits::Finite).written(Written::Decimals(7));
const LONGITUDE: Column = Column::real("longitude", "deg", Limits::Finite).written(Written::Decimals(7));
const ALTITUDE: Column = Column::real("altitude", "m", Limits::Finite).written(LENGTH);
const SPEED: Column = Column::real("speed", "m/s", Limits::NotNegative).written(Written::Decimals(3));
const COURSE: Column = Column::real("course", "deg", Limits::Finite).written(Written::Decimals(2));

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

/// Rounding of what is estimated: far below what any covariance of it says, and at most 0.05 mm for lengths.
const LENGTH: Written = Written::Digits { digits: 7, decimals: 4 };
const NUMBER: Written = Written::Digits { digits: 7, decimals: 0 };
const SHARE: Written = Written::Decimals(7);

/// Columns before the state.
const HEAD: usize = 5;

/// A component of the state; of one that is not known by name, nobody can say which digits matter.
fn component(label: &str) -> Column {
    let unit = unit(label);
    let written = match unit {
        "m" => LENGTH,
        "" => Written::Exactly,
        _ => NUMBER,
    };
    Column::named(label.to_owned(), unit.to_owned()).written(written).needed()
}

/// How rows of tracks lie in columns.
pub(crate) struct TrackColumns {
    labels: Vec<String>,
    modes: Vec<String>,
    navigator: Navigator,
    /// Whether there may be an altitude beside the state, which has no height of its own.
    beside: bool,
}

impl TrackColumns {
    /// For states with these components, in a frame at this origin.
    pub fn new(origin: Option<Origin>, labels: &[String], modes: &[String]) -> Self {
        TrackColumns {
            labels: labels.to_vec(),
            modes: modes.to_vec(),
            navigator: Navigator::new(origin, labels),
            beside: origin.is_some() && !labels.iter().any(|label| label == "z" || label == "altitude"),
        }
    }

    /// The columns that are read.
    fn columns(&self) -> Vec<Column> {
        let head: [Column; HEAD] = [
            Column::time(),
            Column::text("sensor"),
            Column::count("track").needed(),
            Column::text("status"),
            Column::real("existence", "", Limits::Probability).written(SHARE),
        ];
        let mut columns = Vec::from(head);
        columns.extend(self.labels.iter().map(|label| component(label)));
        columns.extend(self.beside.then_some(ALTITUDE));
        columns.push(Column::text("identity"));
        columns.extend(
            covariance_names(&self.labels)
                .map(|(a, b)| Column::named(format!("cov_{a}_{b}"), product(a, b)).written(NUMBER)),
        );
        columns.extend(self.modes.iter().map(|mode| Column {
            kind: Kind::Real(Limits::Probability),
            written: SHARE,
            ..Column::named(format!("mode_{mode}"), String::new())
        }));
        columns.extend(extent_columns().map(|column| column.written(LENGTH)));
        columns.push(Column::count("detection"));
        columns
    }

    /// The columns that follow from the others: written for people, passed over by readers. A component of the state that has
    /// the name of one takes its place.
    fn derived(&self) -> Vec<Column> {
        let mut columns = Vec::new();
        if self.navigator.knows_the_earth() {
            columns.extend([LATITUDE, LONGITUDE]);
            columns.extend((!self.beside).then_some(ALTITUDE));
        }
        if self.navigator.knows_speeds() {
            columns.extend([SPEED, COURSE]);
        }
        columns.retain(|column| self.labels.iter().all(|label| *label != column.name));
        columns
    }

    /// The columns that are written: the derived ones follow the state.
    pub fn written(&self) -> Vec<Column> {
        let mut columns = self.columns();
        let at = HEAD + self.labels.len();
        columns.splice(at..at, self.derived());
        columns
    }

    /// Appends rows to a sheet of [`TrackColumns::written`].
    pub fn fill(&self, sheet: &mut Sheet, rows: &[Track], file: &Arc<str>) -> Result<(), DataError> {
        let n = self.labels.len();
        let entries = n * (n + 1) / 2;
        let derived = self.derived();
        for track in rows {
            self.check(track, || sheet.place(file, sheet.len()))?;
            let fix = self.navigator.fix(track);
            let [latitude, longitude] = fix.position.map_or([None; 2], |place| place.map(Some));
            let mut filler = sheet.filler();
            filler.real(track.time).text(Some(&track.sensor)).count(track.track);
            filler.text(Some(&Arc::from(track.status.name()))).real(track.existence);
            filler.reals(track.state.iter().copied().map(Some));
            filler.reals(derived.iter().map(|column| match column.name.as_ref() {
                "latitude" => latitude,
                "longitude" => longitude,
                "altitude" => fix.altitude,
                "speed" => fix.speed,
                _ => fix.course,
            }));
            filler.reals(self.beside.then_some(track.altitude)).text(track.identity.as_ref());
            filler.reals((0..entries).map(|i| track.covariance.get(i).copied()));
            filler.reals(track.modes.iter().copied().map(Some));
            match track.extent {
                Some(extent) => filler.reals(extent.map(Some)),
                None => filler.reals([None; 3]),
            };
            filler.count(track.detection);
        }
        Ok(())
    }

    /// Refuses a row whose state is not the one that the labels name.
    pub fn check(&self, track: &Track, place: impl FnOnce() -> Place) -> Result<(), DataError> {
        let (n, modes) = (self.labels.len(), self.modes.len());
        let entries = n * (n + 1) / 2;
        let lengths = [track.state.len(), track.modes.len()];
        let covariance = track.covariance.len();
        if lengths == [n, modes] && (covariance == entries || covariance == 0) {
            return Ok(());
        }
        Err(DataError::Row {
            place: place(),
            problem: format!(
                "track {} has {} components, {covariance} covariances and {} modes; expected {n}, {entries} and {modes}",
                track.track, lengths[0], lengths[1],
            ),
            help: "give every row the state that the labels of the table name",
        })
    }
}

impl Layout for Tracks {
    const TABLE: &'static str = "tracks";

    fn columns(metadata: &Metadata) -> Vec<Column> {
        TrackColumns::new(metadata.origin, &metadata.labels, &metadata.modes).columns()
    }

    fn written(metadata: &Metadata) -> Vec<Column> {
        TrackColumns::new(metadata.origin, &metadata.labels, &metadata.modes).written()
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
        TrackColumns::new(self.origin, &self.labels, &self.modes).fill(sheet, &self.rows, file)
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
    altitude: Cells<'a, f64>,
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
            altitude: sheet.reals("altitude"),
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
            altitude: self.altitude.get(row),
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
