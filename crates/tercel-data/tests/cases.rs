//! Files as people bring them come in whole, or are refused with what helps.

// The exception for tests covers only the test functions themselves, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::path::PathBuf;

use tercel_data::{Format, ImportOptions, Imported, ReadOptions, Source, import, read_detections_from};

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(name)
}

fn import_as(source: Source, name: &str) -> Imported {
    import(source, &[path(name)], &ImportOptions::default()).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn sizes(imported: &Imported) -> Vec<usize> {
    imported.detections.scans.iter().map(|scan| scan.detections.len()).collect()
}

#[test]
fn tabs_separate_cells() {
    assert_eq!(sizes(&import_as(Source::recognise(path("xy_tab.tsv")).unwrap(), "xy_tab.tsv")), [2; 20]);
}

#[test]
fn utf_16_is_read() {
    assert_eq!(sizes(&import_as(Source::Csv, "xy_utf16.csv")), [2; 20]);
}

#[test]
fn a_file_without_header_is_called_so_and_read_with_names_for_its_columns() {
    let read = |columns: Option<&str>| {
        let columns = columns.map(|names| names.split(',').map(str::to_owned).collect());
        let options =
            ImportOptions { read: ReadOptions { columns, ..ReadOptions::default() }, ..Default::default() };
        import(Source::Csv, &[path("xy_no_header.csv")], &options)
    };
    let error = read(None).unwrap_err();
    assert!(error.to_string().contains("there is no header"), "{error}");
    assert!(error.help().unwrap().contains("--columns time,sensor,x,y"), "{:?}", error.help());
    assert_eq!(sizes(&read(Some("time,sensor,x,y")).unwrap()), [2; 20]);
}

#[test]
fn quotes_that_are_never_closed_swallow_no_rows() {
    let imported = import_as(Source::Ais, "dma_stray_quotes.csv");
    assert_eq!(sizes(&imported).iter().sum::<usize>(), 48);
    assert!(imported.notes[0].contains("2 rows have a quote that is never closed"), "{:?}", imported.notes);
}

#[test]
fn zstd_is_told_from_the_content() {
    assert_eq!(sizes(&import_as(Source::Ais, "marinecadastre_2025.csv.zst")).iter().sum::<usize>(), 48);
}

#[test]
fn every_dialect_says_the_same() {
    let read = |text: &str| {
        read_detections_from(text.as_bytes(), Format::Csv, "xy.csv", &ReadOptions::default()).unwrap()
    };
    let plain = read("time,sensor,x,y\n0.5,radar,1.5,-2\n1.5,radar,3,4.25\n");
    for text in [
        "time;sensor;x;y\r\n0,5;radar;1,5;-2\r\n1,5;radar;3;4,25\r\n",
        "sep=;\r\ntime;sensor;x;y\r\n0.5;radar;1.5;-2\r\n1.5;radar;3;4.25\r\n",
        "time\tsensor\tx\ty\n0.5\tradar\t1.5\t-2\n\n1.5\tradar\t3\t4.25",
        "time|sensor|x|y\n0.5|radar|1.5|-2\n# a remark\n1.5|radar|3|4.25\n",
        "  time   sensor  x     y\n   0.5    radar  1.5  -2\n   1.5    radar  3     4.25\n",
        "# made by hand\n# time sensor x y\n0.5 radar 1.5 -2\n1.5 radar 3 4.25\n",
        "\"time\",\"sensor\",\"x\",\"y\"\n\"0.5\",\"radar\",\"1.5\",\"-2\"\n\"1.5\",\"radar\",\"3\",\"4.25\"\n",
        "time,sensor,x,y,\n0.5,radar,1.5,-2,\n1.5,radar,3,4.25,\n",
    ] {
        assert_eq!(read(text), plain, "{text}");
    }
}

#[test]
fn every_compression_says_the_same() {
    let plain = import_as(Source::Csv, "xy_tab.tsv").detections;
    for name in ["xy_tab.tsv.gz", "xy_tab.tsv.xz", "xy_tab.tsv.zst", "xy_tab.zip"] {
        let bytes = std::fs::read(path(&format!("compressed/{name}"))).unwrap();
        // The name says nothing here, and a pipe may be slow.
        let read = |bytes: &[u8]| read_detections_from(bytes, Format::Csv, "stream", &ReadOptions::default());
        assert_eq!(read(&bytes).unwrap(), plain, "{name}");
        assert!(read(&bytes[..bytes.len() - 30]).is_err(), "{name} cut short");
    }
}
