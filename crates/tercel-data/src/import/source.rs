//! The sources of recordings, and their names.

use crate::format::Format;

/// Where a recording comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// The table of detections as CSV.
    Csv,
    /// The table of detections as Parquet.
    Parquet,
    /// The table of detections as NDJSON.
    Ndjson,
    /// The Autoferry benchmark: radar, lidar and cameras of a small ferry, with GNSS truth.
    Autoferry,
    /// Positions that aircraft broadcast, in any of the forms below and as a table of another program: CSV, Parquet, JSON.
    Adsb,
    /// Positions that ships broadcast, as sentences and as a table of another program: CSV, Parquet, JSON.
    Ais,
    /// Positions of ships in sentences of AIS receivers: `!AIVDM`.
    Nmea,
    /// Positions of aircraft in messages of a BaseStation feed: `MSG,3,...`.
    Sbs,
    /// Positions of aircraft in `aircraft.json` of readsb or dump1090, one poll or one on each line.
    AircraftJson,
    /// Positions of aircraft in answers of the OpenSky Network: `{"time": ..., "states": [...]}`.
    #[serde(rename = "opensky")]
    OpenSky,
}

/// What reads a source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    Table(Format),
    Autoferry,
    /// Reports of objects about themselves.
    Reports(&'static Family),
}

/// Objects that report their positions.
#[derive(Debug, PartialEq)]
pub(super) struct Family {
    /// Name of the sensor, and of the source in the description of a recording.
    pub sensor: &'static str,
    /// Two reports of one object within a second are the same, heard by two receivers, if they are at most so far apart, m:
    /// as far as receivers round.
    pub rounding: f64,
}

/// Ships send every two seconds at most.
const SHIPS: Family = Family { sensor: "ais", rounding: 2.0 };

/// Aircraft send twice a second, also when they stand.
const AIRCRAFT: Family = Family { sensor: "adsb", rounding: 0.0 };

/// All sources, in the order in which help texts list them.
const SOURCES: [(Source, &str, Kind); 10] = [
    (Source::Csv, "csv", Kind::Table(Format::Csv)),
    (Source::Parquet, "parquet", Kind::Table(Format::Parquet)),
    (Source::Ndjson, "ndjson", Kind::Table(Format::Ndjson)),
    (Source::Autoferry, "autoferry", Kind::Autoferry),
    (Source::Adsb, "adsb", Kind::Reports(&AIRCRAFT)),
    (Source::Ais, "ais", Kind::Reports(&SHIPS)),
    (Source::Nmea, "nmea", Kind::Reports(&SHIPS)),
    (Source::Sbs, "sbs", Kind::Reports(&AIRCRAFT)),
    (Source::AircraftJson, "aircraft-json", Kind::Reports(&AIRCRAFT)),
    (Source::OpenSky, "opensky", Kind::Reports(&AIRCRAFT)),
];

/// Their names, for messages.
pub(super) const NAMES: &str =
    "csv, parquet, ndjson, autoferry, adsb, ais, nmea, sbs, aircraft-json and opensky";

impl Source {
    /// Every source, in the order in which help texts list them.
    pub const ALL: [Source; SOURCES.len()] = {
        let mut all = [Source::Csv; SOURCES.len()];
        let mut at = 0;
        while at < SOURCES.len() {
            all[at] = SOURCES[at].0;
            at += 1;
        }
        all
    };

    fn entry(self) -> &'static (Source, &'static str, Kind) {
        // A test holds the list to the order of the variants.
        &SOURCES[self as usize]
    }

    /// The name used on the command line.
    pub fn name(self) -> &'static str {
        self.entry().1
    }

    /// The source of the family to which this one belongs, whose configuration fits: `adsb` or `ais` for every form of their
    /// reports, and the source itself for others.
    pub fn family(self) -> Source {
        match self.kind() {
            Kind::Reports(family) if *family == SHIPS => Source::Ais,
            Kind::Reports(_) => Source::Adsb,
            _ => self,
        }
    }

    pub(super) fn kind(self) -> Kind {
        self.entry().2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_source_has_its_place_in_the_list_and_its_name_in_the_message() {
        for source in Source::ALL {
            assert_eq!(source.entry().0, source);
            assert!(NAMES.split([',', ' ']).any(|name| name == source.name()), "{}", source.name());
            let json = serde_json::to_string(&source).unwrap();
            assert_eq!(json, format!("\"{}\"", source.name()));
        }
    }

    #[test]
    fn forms_of_reports_belong_to_a_family() {
        assert_eq!(Source::Nmea.family(), Source::Ais);
        assert_eq!(Source::Sbs.family(), Source::Adsb);
        assert_eq!(Source::Csv.family(), Source::Csv);
    }
}
