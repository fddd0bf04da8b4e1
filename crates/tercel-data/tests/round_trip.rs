//! What is written is read back: to the last bit, but for the estimates of tracks in CSV, which are rounded.

// The exception for tests covers only the test functions themselves, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use proptest::prelude::*;
use tercel_data::table::{Detections, Metric, Metrics, Status, Track, Tracks, Truths};
use tercel_data::{
    Format, ReadOptions, TracksWriter, read_detections_from, read_metrics_from, read_tracks_from,
    read_truths_from, write_detections_to, write_metrics_to, write_tracks_to, write_truths_to,
};

const FORMATS: [Format; 3] = [Format::Csv, Format::Parquet, Format::Ndjson];

/// `assert_eq!` holds zeros of either sign for equal; their text does not.
fn same<T: PartialEq + std::fmt::Debug>(a: &T, b: &T) -> bool {
    a == b && format!("{a:?}") == format!("{b:?}")
}

/// Half of the last of seven digits, with room for the last bit of a double.
const DIGITS: f64 = 0.5e-6 * (1.0 + 1e-9);
/// Half of the last of seven decimals.
const SHARE: f64 = 0.5e-7 * (1.0 + 1e-9);
/// Half of a tenth of a millimetre.
const LENGTH: f64 = 0.5e-4 * (1.0 + 1e-9);

/// The numbers of a row that CSV rounds, with how far each may be off.
fn rounded<'a>(row: &'a mut Track, labels: &'a [String]) -> Vec<(&'a mut f64, f64)> {
    let relative = |number: &mut f64| number.abs() * DIGITS;
    let length = |number: &mut f64| (number.abs() * DIGITS).min(LENGTH).max(number.abs() * f64::EPSILON);
    let mut numbers = vec![(&mut row.existence, SHARE)];
    numbers.extend(row.modes.iter_mut().map(|mode| (mode, SHARE)));
    numbers.extend(row.covariance.iter_mut().map(|number| {
        let off = relative(number);
        (number, off)
    }));
    numbers.extend(row.state.iter_mut().zip(labels).map(|(number, label)| {
        let off = if matches!(label.as_str(), "x" | "y") { length(number) } else { relative(number) };
        (number, off)
    }));
    numbers.extend(row.extent.iter_mut().flatten().chain(&mut row.altitude).map(|number| {
        let off = length(number);
        (number, off)
    }));
    numbers
}

/// True when the tables differ by no more than what CSV rounds.
fn nearly_same(back: &Tracks, table: &Tracks) -> bool {
    let (mut back, mut table) = (back.clone(), table.clone());
    let labels = table.labels.clone();
    for (back, row) in back.rows.iter_mut().zip(&mut table.rows) {
        let (back, row) = (rounded(back, &labels), rounded(row, &labels));
        if back.len() != row.len() {
            return false;
        }
        for ((back, _), (number, off)) in back.into_iter().zip(row) {
            if (*back - *number).abs() > off {
                return false;
            }
            (*back, *number) = (0.0, 0.0);
        }
    }
    same(&back, &table)
}

/// What a format promises for tracks.
fn kept(format: Format, back: &Tracks, table: &Tracks) -> bool {
    if format == Format::Csv { nearly_same(back, table) } else { same(back, table) }
}

macro_rules! round_trip {
    ($table:expr, $format:expr, $write:ident, $read:ident) => {{
        let mut bytes = Vec::new();
        $write(&mut bytes, $format, "table", $table).unwrap();
        let back = $read(bytes.as_slice(), $format, "table", &ReadOptions::default());
        back.unwrap_or_else(|error| panic!("{error}\n{}", String::from_utf8_lossy(&bytes)))
    }};
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn detections_survive_every_format(table in common::detections()) {
        for format in FORMATS {
            let back: Detections = round_trip!(&table, format, write_detections_to, read_detections_from);
            prop_assert!(same(&back, &table), "{format:?}: {back:?}");
        }
    }

    #[test]
    fn truth_survives_every_format(table in common::truths()) {
        for format in FORMATS {
            let back: Truths = round_trip!(&table, format, write_truths_to, read_truths_from);
            prop_assert!(same(&back, &table), "{format:?}: {back:?}");
        }
    }

    #[test]
    fn tracks_survive_every_format(table in common::tracks()) {
        for format in FORMATS {
            let back: Tracks = round_trip!(&table, format, write_tracks_to, read_tracks_from);
            prop_assert!(kept(format, &back, &table), "{format:?}: {back:?}");
            let again: Tracks = round_trip!(&back, format, write_tracks_to, read_tracks_from);
            prop_assert!(same(&again, &back), "what is rounded once stays the same: {format:?}: {again:?}");
        }
    }

    #[test]
    fn metrics_survive_every_format(table in common::metrics()) {
        for format in FORMATS {
            let back: Metrics = round_trip!(&table, format, write_metrics_to, read_metrics_from);
            prop_assert!(same(&back, &table), "{format:?}: {back:?}");
        }
    }

    #[test]
    fn tracks_written_in_parts_are_the_tracks_written_at_once(table in common::tracks(), part in 1_usize..4) {
        for format in FORMATS {
            let mut bytes = Vec::new();
            let head = Tracks { rows: Vec::new(), ..table.clone() };
            let mut writer = TracksWriter::to(&mut bytes, format, "tracks", &head).unwrap();
            for rows in table.rows.chunks(part) {
                writer.append(rows).unwrap();
            }
            writer.finish().unwrap();
            let back = read_tracks_from(bytes.as_slice(), format, "tracks", &ReadOptions::default()).unwrap();
            prop_assert!(kept(format, &back, &table), "{format:?}: {back:?}");
        }
    }
}

#[test]
fn csv_and_parquet_have_the_same_columns() {
    let table = Tracks {
        labels: ["x", "y", "vx", "vy"].map(str::to_owned).to_vec(),
        modes: vec!["straight".to_owned()],
        rows: vec![Track {
            time: 0.0,
            sensor: "radar".into(),
            track: 1,
            status: Status::Confirmed,
            existence: 1.0,
            state: vec![0.0; 4],
            covariance: vec![0.0; 10],
            modes: vec![1.0],
            extent: None,
            altitude: None,
            identity: None,
            detection: None,
        }],
        origin: None,
    };
    let mut csv = Vec::new();
    write_tracks_to(&mut csv, Format::Csv, "tracks", &table).unwrap();
    let csv = String::from_utf8(csv).unwrap();
    let header: Vec<&str> = csv.lines().nth(1).unwrap().split(',').collect();
    let mut parquet = Vec::new();
    write_tracks_to(&mut parquet, Format::Parquet, "tracks", &table).unwrap();
    let reader =
        parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder::try_new(bytes::Bytes::from(parquet))
            .unwrap();
    let schema = reader.schema();
    let fields: Vec<&str> = schema.fields().iter().map(|field| field.name().as_str()).collect();
    assert_eq!(fields, header);
    let pairs = reader.metadata().file_metadata().key_value_metadata().unwrap();
    let description = pairs.iter().find(|pair| pair.key == "tercel").and_then(|pair| pair.value.as_deref());
    assert_eq!(csv.lines().next().unwrap().strip_prefix("# tercel: "), description);
}

#[test]
fn a_metric_that_is_not_a_number_is_an_empty_cell() {
    let row = Metric {
        study: "s".to_owned(),
        method: "m".to_owned(),
        run: "1".to_owned(),
        metric: "rmse_pos".to_owned(),
        component: String::new(),
        value: f64::NAN,
    };
    let table = Metrics { rows: vec![row] };
    for format in FORMATS {
        let back = round_trip!(&table, format, write_metrics_to, read_metrics_from);
        assert!(back.rows[0].value.is_nan());
    }
    let mut csv = Vec::new();
    write_metrics_to(&mut csv, Format::Csv, "metrics", &table).unwrap();
    assert!(String::from_utf8(csv).unwrap().ends_with("s,m,1,rmse_pos,,\n"));
}
