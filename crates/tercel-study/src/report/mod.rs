//! Reports: one HTML file that shows what a tracker saw and made of it, and opens without a network.
//!
//! A [`Report`] is a title and a list of sections: a [`Summary`] of figures, a [`Picture`] (plan view with a time
//! slider, tracks, truth, and charts that follow the slider), free-standing [`Chart`]s and [`Table`]s.
//!
//! ```
//! use tercel_data::table::{Detections, Tracks};
//! use tercel_study::report::{Chart, Form, Picture, Report, Summary};
//!
//! let (detections, tracks) = (Detections::default(), Tracks::default());
//! let gospa = Chart::over_time("GOSPA", "m", vec![0.0, 1.0])
//!     .with_form(Form::Stacked)
//!     .with_part("localisation", vec![3.2, 3.1])
//!     .with_part("missed", vec![20.0, 0.0]);
//! let page = Report::new("Harbour, 14 May")
//!     .with(Summary::new().with("Tracks", "12", None).with("GOSPA", "9.8 m", Some("mean over scans")))
//!     .with(Picture::new(&detections, &tracks, None, &[])?.with_chart(gospa))
//!     .render()?;
//! assert!(page.starts_with("<!doctype html>"));
//! # Ok::<(), tercel_study::report::ReportError>(())
//! ```

mod chart;
mod number;
mod page;
mod picture;
mod table;

use std::io::Write;
use std::path::{Path, PathBuf};

use tercel_data::AtomicFile;

pub use chart::{Chart, Form};
pub use picture::{Picture, SensorNote};
pub use table::Table;

/// A page of figures, pictures and charts.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    title: String,
    subtitle: Option<String>,
    sections: Vec<Section>,
}

/// One part of a report.
#[derive(Debug, Clone, PartialEq)]
pub enum Section {
    /// Figures with names.
    Summary(Summary),
    /// A recording: plan view, tracks, charts over its time.
    Picture(Box<Picture>),
    /// A chart on its own: an error over a parameter, ...
    Chart(Chart),
    /// A table of figures.
    Table(Table),
}

/// Figures that a reader looks at first.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Summary {
    rows: Vec<Figure>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct Figure {
    name: String,
    value: String,
    help: Option<String>,
}

/// Why a report could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The tracks do not say where they are.
    #[error("tracks have no state component `{label}` (they have: {found}); a plan view needs `x` and `y`")]
    MissingLabel {
        /// The component that was looked for.
        label: &'static str,
        /// The components that there are.
        found: String,
    },
    /// A state is longer or shorter than the labels of its table say.
    #[error("track {track} at {time} s has {found} state components, but the table names {expected}")]
    StateLength {
        /// Number of the track.
        track: u64,
        /// Time of the row, s.
        time: f64,
        /// Components in the row.
        found: usize,
        /// Labels of the table.
        expected: usize,
    },
    /// A curve does not fit the abscissa of its chart.
    #[error("part `{part}` of chart `{chart}` has {found} values for {expected} points")]
    ChartLength {
        /// Title of the chart.
        chart: String,
        /// Name of the curve.
        part: String,
        /// Values of the curve.
        found: usize,
        /// Points of the abscissa.
        expected: usize,
    },
    /// The data could not be written as JSON.
    #[error("the data of the report could not be encoded")]
    Encode(#[from] serde_json::Error),
    /// The file could not be created or put in its place.
    #[error(transparent)]
    File(#[from] tercel_data::DataError),
    /// The file could not be written.
    #[error("cannot write the report to {path}", path = .path.display())]
    Write {
        /// Where it should have gone.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

impl Report {
    /// An empty report. Any text may stand in the title; it is shown as it is.
    pub fn new(title: impl Into<String>) -> Report {
        Report { title: title.into(), subtitle: None, sections: Vec::new() }
    }

    /// A line under the title: the source of the data, the configuration.
    pub fn with_subtitle(self, subtitle: impl Into<String>) -> Report {
        Report { subtitle: Some(subtitle.into()), ..self }
    }

    /// Adds a section below those that are there.
    pub fn with(mut self, section: impl Into<Section>) -> Report {
        self.sections.push(section.into());
        self
    }

    /// The page: one HTML file with everything inside.
    ///
    /// # Errors
    /// When a curve of a chart does not fit its abscissa.
    pub fn render(&self) -> Result<String, ReportError> {
        page::render(self)
    }

    /// Writes the page to `path`, whole or not at all: a file beside it is written first and then renamed.
    ///
    /// # Errors
    /// Those of [`Report::render`], and when the file cannot be written.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), ReportError> {
        let page = self.render()?;
        let path = path.as_ref();
        let mut file = AtomicFile::create(path)?;
        let failed = |source| ReportError::Write { path: path.to_path_buf(), source };
        file.write_all(page.as_bytes()).map_err(failed)?;
        Ok(file.finish()?)
    }
}

impl Summary {
    /// No figures yet.
    pub fn new() -> Summary {
        Summary::default()
    }

    /// Adds a figure: its name, its value as it shall read (with the unit), and a sentence that explains it.
    pub fn with(mut self, name: impl Into<String>, value: impl Into<String>, help: Option<&str>) -> Summary {
        self.rows.push(Figure { name: name.into(), value: value.into(), help: help.map(str::to_owned) });
        self
    }
}

impl From<Summary> for Section {
    fn from(summary: Summary) -> Section {
        Section::Summary(summary)
    }
}

impl From<Picture> for Section {
    fn from(picture: Picture) -> Section {
        Section::Picture(Box::new(picture))
    }
}

impl From<Table> for Section {
    fn from(table: Table) -> Section {
        Section::Table(table)
    }
}

impl From<Chart> for Section {
    fn from(chart: Chart) -> Section {
        Section::Chart(chart)
    }
}

#[cfg(test)]
mod tests;
