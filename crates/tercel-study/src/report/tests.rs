//! What every report holds to, whatever the tables hold.

use tercel_data::table::{Detection, Detections, Observation, Scan, Status, Track, Tracks, Truth, Truths};

use super::*;

const ATTACK: &str = "</script><script>alert(1)</script><img src=x onerror=alert(1)>";

fn detections(name: &str, x: f64) -> Detections {
    let observation = Observation::Position { x, y: 2.0, z: None };
    let detection = Detection { truth: Some(name.into()), ..Detection::new(1, observation) };
    let scan = Scan::new(1.0, name, vec![detection]);
    Detections { scans: vec![scan], ..Detections::default() }
}

fn tracks(name: &str, number: f64) -> Tracks {
    let row = Track {
        time: 1.0,
        sensor: name.into(),
        track: 1,
        status: Status::Confirmed,
        existence: number,
        state: vec![number; 4],
        covariance: vec![number; 10],
        modes: vec![number],
        extent: Some([number; 3]),
        altitude: None,
        identity: None,
        detection: Some(1),
    };
    let labels = ["x", "y", "vx", "vy"].map(String::from).to_vec();
    Tracks { origin: None, labels, modes: vec![name.to_owned()], rows: vec![row] }
}

fn truths(name: &str, number: f64) -> Truths {
    let row = Truth {
        time: 1.0,
        object: name.into(),
        position: [number; 2],
        z: None,
        velocity: Some([number; 2]),
        extent: None,
    };
    Truths { origin: None, rows: vec![row] }
}

/// The data of a page, read back from its HTML.
fn data_of(page: &str) -> serde_json::Value {
    let begin = page.find("type=\"application/json\">").unwrap() + "type=\"application/json\">".len();
    let end = begin + page[begin..].find("</script>").unwrap();
    serde_json::from_str(&page[begin..end]).unwrap()
}

#[test]
fn every_combination_of_empty_tables_gives_a_page() {
    for choice in 0..8 {
        let detections = if choice & 1 == 0 { Detections::default() } else { detections("radar", 1.0) };
        let tracks = if choice & 2 == 0 { Tracks::default() } else { tracks("cv", 1.0) };
        let truths = (choice & 4 != 0).then(|| truths("boat", 1.0));
        let picture = Picture::new(&detections, &tracks, truths.as_ref(), &[]).unwrap();
        let page = Report::new("empty").with(picture).render().unwrap();
        let data = &data_of(&page)[0];
        assert_eq!(data["times"].as_array().unwrap().is_empty(), choice == 0);
        assert_eq!(data["tracks"].as_array().unwrap().len(), (choice >> 1) & 1);
        assert_eq!(data["truths"].as_array().unwrap().len(), (choice >> 2) & 1);
    }
    assert_eq!(data_of(&Report::new("nothing at all").render().unwrap()), serde_json::json!([]));
}

#[test]
fn text_of_users_is_shown_and_never_run() {
    let note = SensorNote { sensor: ATTACK.into(), label: Some(ATTACK.into()), position: None };
    let picture = Picture::new(
        &detections(ATTACK, 1.0),
        &tracks(ATTACK, 1.0),
        Some(&truths(ATTACK, 1.0)),
        std::slice::from_ref(&note),
    );
    let chart = Chart::over(ATTACK, ATTACK, ATTACK, vec![0.0]).with_part(ATTACK, vec![1.0]);
    let page = Report::new(ATTACK)
        .with_subtitle(ATTACK)
        .with(Summary::new().with(ATTACK, ATTACK, Some(ATTACK)))
        .with(Table::new(ATTACK, [ATTACK]).with_note(ATTACK).with_row([ATTACK]))
        .with(picture.unwrap().with_track_name(1, ATTACK).with_chart(chart.clone()))
        .with(chart)
        .render()
        .unwrap();
    assert!(!page.contains("<script>alert") && !page.contains("<img"));
    // Data, library and scripts of the page.
    assert_eq!(page.matches("</script>").count(), 3);
    let data = data_of(&page);
    assert_eq!(data[0]["sensors"][0]["name"], ATTACK);
    assert_eq!(data[0]["truths"][0]["name"], ATTACK);
    assert_eq!(data[0]["tracks"][0]["name"], ATTACK);
    assert_eq!(data[1]["parts"][0]["name"], ATTACK);
}

#[test]
fn numbers_that_are_not_finite_never_reach_the_page() {
    for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let picture = Picture::new(
            &detections("radar", number),
            &tracks("cv", number),
            Some(&truths("boat", number)),
            &[],
        )
        .unwrap()
        .with_chart(Chart::over_time("GOSPA", "m", vec![number]).with_part("missed", vec![number]));
        let data = data_of(&Report::new("not finite").with(picture).render().unwrap());
        assert_eq!(data[0]["tracks"][0]["x"], serde_json::json!([null]));
        assert_eq!(data[0]["tracks"][0]["peak"], serde_json::json!(null));
        assert_eq!(data[0]["truths"][0]["x"], serde_json::json!([null]));
        assert_eq!(data[0]["charts"][0]["x"], serde_json::json!([null]));
    }
}

#[test]
fn tracks_and_objects_are_counted_at_every_time() {
    let picture =
        Picture::new(&detections("radar", 1.0), &tracks("cv", 1.0), Some(&truths("boat", 1.0)), &[]).unwrap();
    let data = data_of(&Report::new("counts").with(picture).render().unwrap());
    let parts = &data[0]["charts"][0]["parts"];
    assert_eq!(parts[0]["y"], serde_json::json!([1]));
    // No track is tentative, so that there is no curve of them.
    assert_eq!(parts[1]["name"], "true objects");
    assert_eq!(parts[1]["y"], serde_json::json!([1]));
}

#[test]
fn a_table_has_a_cell_for_every_column() {
    let table = Table::new("Errors", ["a", "b"]).with_row(["1"]).with_row(["2", "3", "4"]);
    let page = Report::new("table").with(table.clone()).render().unwrap();
    assert!(page.contains("<tr><td>1</td><td></td></tr>\n<tr><td>2</td><td>3</td></tr>"));
    assert!(page.contains("<details class=\"figures\" open>"));
    let folded = Report::new("table").with(table.folded()).render().unwrap();
    assert!(folded.contains("<details class=\"figures\">"));
}

#[test]
fn a_written_report_is_whole_and_leaves_nothing_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.html");
    std::fs::write(&path, "an older report").unwrap();
    let report = Report::new("written");
    report.write(&path).unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), report.render().unwrap());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_path_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let error = Report::new("lost").write(folder.path().join("missing/report.html")).unwrap_err();
    assert!(error.to_string().contains("missing"), "{error}");
}

/// Twenty objects at a time over many scans, each with a track and four false detections beside it.
fn long(scans: usize) -> (Detections, Tracks, Truths) {
    let (mut seen, mut told, mut known) = (Detections::default(), tracks("cv", 1.0), Truths::default());
    let (row, plot) = (told.rows.remove(0), detections("radar", 1.0).scans.remove(0).detections.remove(0));
    let truth = truths("boat", 1.0).rows.remove(0);
    for scan in 0..scans {
        let time = scan as f64;
        let place =
            |k: usize| [1000.0 * (0.01 * time + k as f64).sin(), 1000.0 * (0.013 * time + k as f64).cos()];
        let plots = (0..100).map(|k| {
            let [x, y] = place(k);
            Detection {
                id: (100 * scan + k) as u64,
                observation: Observation::Position { x, y, z: None },
                ..plot.clone()
            }
        });
        let detections = plots.collect();
        seen.scans.push(Scan { position: Some([1.5, 2.5, 0.0]), ..Scan::new(time, "radar", detections) });
        for k in 0..20 {
            let ([x, y], life) = (place(k), (scan + 10 * k) / 200);
            let number = (20 * life + k) as u64;
            told.rows.push(Track {
                time,
                track: number,
                state: vec![x, y, 1.234, 5.678],
                detection: Some((100 * scan + k) as u64),
                ..row.clone()
            });
            known.rows.push(Truth {
                time,
                object: format!("boat {number}").into(),
                position: [x, y],
                ..truth.clone()
            });
        }
    }
    (seen, told, known)
}

#[test]
fn a_long_recording_stays_a_small_page_that_says_what_it_leaves_out() {
    let (seen, told, known) = long(20_000);
    let page = |seen: &Detections, told: &Tracks, known: &Truths| {
        let time: Vec<f64> = seen.scans.iter().map(|scan| scan.time).collect();
        let gospa = Chart::over_time("GOSPA", "m", time.clone())
            .with_part("missed", time.iter().map(|t| t.sin()).collect());
        let picture = Picture::new(seen, told, Some(known), &[]).unwrap().with_chart(gospa);
        Report::new("long").with(picture).render().unwrap()
    };
    let long_page = page(&seen, &told, &known);
    assert!(long_page.len() < 15_000_000, "{} bytes", long_page.len());
    let notes = data_of(&long_page)[0]["notes"].to_string();
    for note in [
        "of 2000000 detections is drawn",
        "of 400000 rows of tracks is drawn",
        "of 400000 rows of the truth is drawn",
    ] {
        assert!(notes.contains(note), "{note} is missing in {notes}");
    }
    let (seen, told, known) = long(100);
    let short_page = data_of(&page(&seen, &told, &known));
    assert_eq!(short_page[0]["notes"], serde_json::json!([]));
    assert_eq!(short_page[0]["detections"]["id"].as_array().unwrap().len(), 10_000);
    assert_eq!(short_page[0]["times"].as_array().unwrap().len(), 100);
}
