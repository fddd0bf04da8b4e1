//! Opens reports in a real browser: what a reader sees is drawn, follows the slider, and complains of nothing.
//!
//! Needs a Chromium (`CHROMIUM`, or on the search path); without one each test says so and passes.
#![cfg(unix)]
// Helpers of tests fail like tests.
#![allow(clippy::unwrap_used, clippy::panic)]

#[path = "support/browser.rs"]
mod browser;
#[path = "support/scene.rs"]
mod scene;

use browser::Browser;
use serde_json::json;
use tercel_data::table::{Detections, Tracks};
use tercel_study::monte_carlo::{Shard, conduct};
use tercel_study::report::{Picture, Report};
use tercel_study::studies::{Choice, Study};

/// Functions that the tests call in the page. `painted` is a number that changes with the marks of the plan; `ink`
/// counts the pixels that have any.
const PROBES: &str = r#"
window.pixels = () => { const c = document.querySelector('.plan-marks');
  const copy = new OffscreenCanvas(c.width, c.height).getContext('2d', { willReadFrequently: true });
  copy.drawImage(c, 0, 0);
  return new Uint32Array(copy.getImageData(0, 0, c.width, c.height).data.buffer); };
window.painted = () => pixels().reduce((sum, pixel) => (Math.imul(sum, 31) + pixel) | 0, 7);
window.ink = () => pixels().reduce((count, pixel) => count + (pixel !== 0 ? 1 : 0), 0);
window.slider = () => document.querySelector('input.time');
window.slide = (index) => { slider().value = index; slider().dispatchEvent(new Event('input', { bubbles: true })); };
window.layer = (name) => document.querySelector(`[data-layer="${name}"]`).click();
window.middle = (found) => { found.scrollIntoView({ block: 'center' }); const box = found.getBoundingClientRect();
  return [box.x + box.width / 2, box.y + box.height / 2]; };
window.cursors = () => [...document.querySelectorAll('.chart-time')].map((line) => line.style.transform).join();
"#;

/// A browser that shows the report, unless the machine has none.
fn browse(report: &Report) -> Option<Browser> {
    let Some(program) = browser::find() else {
        println!("skipped: there is no Chromium on this machine (set CHROMIUM to its path)");
        return None;
    };
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("report.html");
    report.write(&page).unwrap();
    let mut browser = Browser::start(&program);
    browser.open(&page);
    browser.value(PROBES);
    browser.settle();
    Some(browser)
}

fn harbour() -> Report {
    scene::report("Harbour", &scene::scene(&scene::Size { boats: 4, scans: 40, clutter: 6 })).unwrap()
}

fn middle(browser: &mut Browser, selector: &str) -> (f64, f64) {
    let at = browser.value(&format!("middle(document.querySelector('{selector}'))"));
    (at[0].as_f64().unwrap(), at[1].as_f64().unwrap())
}

fn number(browser: &mut Browser, expression: &str) -> f64 {
    browser.value(expression).as_f64().unwrap()
}

#[test]
fn everything_is_drawn_and_nothing_complains() {
    let Some(mut browser) = browse(&harbour()) else { return };
    assert!(number(&mut browser, "ink()") > 2000.0);
    assert!(number(&mut browser, "document.querySelectorAll('.plan-frame .xgrid').length") > 2.0);
    // GOSPA has three parts, the count of tracks three, the sweep three.
    assert_eq!(
        browser.value("document.querySelectorAll('.chart-plot .scatterlayer .js-line').length"),
        json!(9)
    );
    assert_eq!(browser.value("document.querySelectorAll('.tracks tbody tr').length"), json!(4));
    assert_eq!(browser.value("document.querySelectorAll('.summary > div').length"), json!(8));
    assert_eq!(browser.value("document.title"), json!("Harbour"));
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn a_metre_east_is_as_long_as_a_metre_north() {
    let Some(mut browser) = browse(&harbour()) else { return };
    let ratio = number(
        &mut browser,
        "(({ _size: s, xaxis: x, yaxis: y }) => (s.w / (x.range[1] - x.range[0])) / (s.h / (y.range[1] - y.range[0])))\
         (document.querySelector('.plan-frame')._fullLayout)",
    );
    assert!((ratio - 1.0).abs() < 1e-9, "{ratio}");
}

#[test]
fn the_slider_moves_the_plan_and_the_marks_of_the_charts() {
    let Some(mut browser) = browse(&harbour()) else { return };
    let (whole, cursors, ink) =
        (browser.value("painted()"), browser.value("cursors()"), number(&mut browser, "ink()"));
    browser.value("slide(10)");
    browser.settle();
    assert_ne!(browser.value("painted()"), whole);
    assert_ne!(browser.value("cursors()"), cursors);
    assert!(number(&mut browser, "ink()") < 0.7 * ink, "a tenth of the time shows less than the whole");
    assert_eq!(browser.value("document.querySelector('.readout').value.includes('step 11 of')"), json!(true));
    browser.value("slide(79)");
    browser.settle();
    assert_eq!(browser.value("painted()"), whole, "the same time shows the same picture");
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn keys_step_and_the_button_plays_to_the_end() {
    let Some(mut browser) = browse(&harbour()) else { return };
    browser.press("ArrowLeft", 37);
    browser.wait("slider().value === '78'");
    browser.press("Home", 36);
    browser.wait("slider().value === '0'");
    browser.press("ArrowRight", 39);
    browser.wait("slider().value === '1'");
    browser.value("slide(70)");
    browser.value("document.querySelector('.play').click()");
    browser.wait("slider().value === '79'");
    browser.wait("document.querySelector('.play').getAttribute('aria-label') === 'Play'");
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn every_layer_adds_ink_of_its_own() {
    let Some(mut browser) = browse(&harbour()) else { return };
    // Near enough for an ellipse to be larger than the mark in it.
    browser.value("document.querySelector('[data-track=\"1\"] button').click()");
    browser.settle();
    for layer in
        ["detections-0", "detections-1", "tracks", "truth", "trails", "ellipses", "velocities", "labels"]
    {
        let before = number(&mut browser, "ink()");
        browser.value(&format!("layer('{layer}')"));
        browser.settle();
        let without = number(&mut browser, "ink()");
        assert!(without < before, "without {layer}: {without}, with it: {before}");
        browser.value(&format!("layer('{layer}')"));
        browser.settle();
        assert_eq!(number(&mut browser, "ink()"), before, "{layer} comes back");
    }
    let hidden = number(&mut browser, "ink()");
    browser.value("layer('tentative')");
    browser.settle();
    assert!(number(&mut browser, "ink()") > hidden);
    assert_eq!(browser.value("document.querySelectorAll('.tracks tbody tr').length"), json!(16));
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn a_click_in_a_chart_moves_the_slider() {
    let Some(mut browser) = browse(&harbour()) else { return };
    let (x, y) = middle(&mut browser, ".charts .nsewdrag");
    browser.click(x, y);
    browser.wait("Math.abs(slider().value - 40) < 4");
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn a_click_in_the_table_brings_the_track_into_view() {
    let Some(mut browser) = browse(&harbour()) else { return };
    let range = "document.querySelector('.plan-frame')._fullLayout.xaxis.range.join()";
    let before = browser.value(range);
    let (x, y) = middle(&mut browser, "[data-track=\"2\"] button");
    browser.click(x, y);
    browser.wait("document.querySelector('[data-track=\"2\"]').classList.contains('chosen')");
    assert_ne!(browser.value(range), before);
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn the_pointer_tells_what_is_under_it() {
    let Some(mut browser) = browse(&harbour()) else { return };
    browser.value("document.querySelector('[data-track=\"1\"] button').click()");
    browser.settle();
    // Track 1 fills the plan now; somewhere on a coarse grid the pointer meets it.
    let met = browser.value(
        "(() => { const box = document.querySelector('.plan').getBoundingClientRect();
          for (let x = 0; x < box.width; x += 6) for (let y = 0; y < box.height; y += 6) {
            document.querySelector('.plan').dispatchEvent(new PointerEvent('pointermove',
              { clientX: box.x + x, clientY: box.y + y, bubbles: true }));
            const tip = document.querySelector('.plan-tip');
            if (!tip.hidden && tip.textContent.startsWith('Track 1')) return tip.textContent; }
          return null; })()",
    );
    let text = met.as_str().unwrap();
    for word in ["status", "time", "speed", "course", "existence", "mode straight", "2σ ellipse"] {
        assert!(text.contains(word), "{word} is missing in {text}");
    }
}

#[test]
fn the_plan_can_be_saved_as_a_picture() {
    let Some(mut browser) = browse(&harbour()) else { return };
    browser.value("HTMLAnchorElement.prototype.click = function () { window.saved = this.href; }; 1");
    browser.value("document.querySelector('.plan-frame .modebar-btn').click()");
    browser.wait("window.saved !== undefined");
    // A picture of that size with nothing in it takes less.
    assert!(number(&mut browser, "saved.startsWith('data:image/png') ? saved.length : 0") > 50_000.0);
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn printing_leaves_the_page_as_it_was() {
    let Some(mut browser) = browse(&harbour()) else { return };
    let (plan, width) =
        (browser.value("painted()"), browser.value("document.querySelector('.plan').clientWidth"));
    let paper = browser.call("Page.printToPDF", json!({}));
    assert!(paper["data"].as_str().unwrap().len() > 10_000);
    browser.wait(&format!("document.querySelector('.plan').clientWidth === {width}"));
    browser.settle();
    assert_eq!(browser.value("painted()"), plan);
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn names_from_the_data_stay_text() {
    let attack = "</script><script>window.broken = true</script><img src=x onerror='window.broken = true'>";
    let mut scene = scene::scene(&scene::Size { boats: 2, scans: 10, clutter: 2 });
    for row in &mut scene.truths.rows {
        row.object = attack.into();
    }
    for scan in &mut scene.detections.scans {
        scan.sensor = attack.into();
    }
    scene.tracks.modes[0] = attack.into();
    let chart = tercel_study::report::Chart::over(attack, attack, attack, vec![0.0, 1.0]);
    let chart = chart.with_part(attack, vec![1.0, 2.0]).with_part("<b>%{x}</b>", vec![1.0, 2.0]);
    let report = scene::report(attack, &scene).unwrap().with(chart);
    let Some(mut browser) = browse(&report) else { return };
    assert_eq!(browser.value("window.broken === undefined"), json!(true));
    assert_eq!(browser.value("document.title"), json!(attack));
    assert_eq!(browser.value("document.querySelectorAll('img').length"), json!(0));
    let legend = "[...document.querySelectorAll('.legendtext')].map((text) => text.textContent)";
    assert_eq!(browser.value(&format!("{legend}.includes('<b>%{{x}}</b>')")), json!(true));
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn a_study_shows_its_tables_its_curves_and_an_example_with_a_track_for_each_method() {
    let study = Study::find("atc-test").unwrap();
    let methods = Some(["measurement", "oracle"].map(str::to_owned).to_vec());
    let experiment = study.experiment(&Choice { methods, runs: Some(3), ..Choice::default() }).unwrap();
    let results = conduct(&*experiment, Shard::WHOLE, None, &|| {}).unwrap();
    let example = experiment.example().unwrap();
    let report = results.report(&*experiment, &results.table(&*experiment), example);
    let Some(mut browser) = browse(&report) else { return };
    let names = "[...document.querySelectorAll('.tracks tbody th')].map((cell) => cell.textContent)";
    assert_eq!(browser.value(names), json!(["measurement", "oracle"]));
    // One table for each metric that is shown, and the published one.
    assert_eq!(browser.value("document.querySelectorAll('details.figures').length"), json!(7));
    let first =
        "[...document.querySelectorAll('.figures tbody')].map((body) => body.rows[0].cells[0].textContent)";
    assert_eq!(
        browser.value(first),
        json!(["oracle", "measurement", "oracle", "measurement", "oracle", "oracle", "imm-paper"])
    );
    // Position and velocity over time; distance, true and told manoeuvres below the plan.
    assert_eq!(browser.value("document.querySelectorAll('.chart-figure').length"), json!(5));
    assert!(number(&mut browser, "ink()") > 500.0);
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn a_band_is_drawn_behind_its_curve_and_later_curves_are_dashed() {
    let x: Vec<f64> = (0..5).map(f64::from).collect();
    let shifted = |by: f64| x.iter().map(|x| x + by).collect::<Vec<_>>();
    let start = tercel_study::report::Chart::over("Errors", "m", "Noise, m", x.clone());
    let chart = (0..8).fold(start, |chart, part| {
        let level = f64::from(part);
        let (low, high) = (shifted(level - 0.4), shifted(level + 0.4));
        chart.with_banded_part(format!("method {part}"), shifted(level), low, high)
    });
    let Some(mut browser) = browse(&Report::new("Bands").with(chart)) else { return };
    let count = |selector: &str| format!("document.querySelectorAll('.chart-plot {selector}').length");
    assert_eq!(browser.value(&count(".fills .js-fill")), json!(8));
    assert_eq!(browser.value(&count(".legendtext")), json!(8));
    let dashed = "[...document.querySelectorAll('.chart-plot .scatterlayer .js-line')].filter((line) => parseFloat(line.style.strokeDasharray) > 0)";
    assert_eq!(browser.value(&format!("{dashed}.length")), json!(2));
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn a_report_of_nothing_opens_quietly() {
    let picture = Picture::new(&Detections::default(), &Tracks::default(), None, &[]).unwrap();
    let Some(mut browser) = browse(&Report::new("Nothing").with(picture)) else { return };
    assert_eq!(browser.value("slider().disabled"), json!(true));
    assert_eq!(
        browser.value("document.querySelector('.tracks').textContent.includes('no tracks')"),
        json!(true)
    );
    browser.press("ArrowRight", 39);
    assert_eq!(browser.complaints(), [""; 0]);
}

#[test]
fn twenty_thousand_detections_and_three_hundred_tracks_follow_the_slider() {
    let scene = scene::scene(&scene::Size { boats: 75, scans: 160, clutter: 90 });
    let count: usize = scene.detections.scans.iter().map(|scan| scan.detections.len()).sum();
    assert!(count > 20_000);
    let report = scene::report("Crowd", &scene).unwrap();
    let Some(mut browser) = browse(&report) else { return };
    browser.value("layer('tentative')");
    // The last steps of the slider, where the whole recording is in the picture.
    let took = browser.value(
        "(async () => { const took = [];
          for (let index = 300; index < 320; index += 1) {
            const before = performance.now();
            slide(index);
            await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
            took.push(performance.now() - before); }
          return took.sort((a, b) => a - b)[10]; })()",
    );
    println!("{count} detections, 300 tracks: {took} ms for a step of the slider");
    // On an idle machine it is a tenth of that; as elements of a drawing they would take longer.
    assert!(took.as_f64().unwrap() < 1000.0, "{took} ms");
}

#[test]
fn a_long_recording_opens_says_what_it_leaves_out_and_plays_to_the_end() {
    let scene = scene::scene(&scene::Size { boats: 10, scans: 11_000, clutter: 40 });
    let Some(mut browser) = browse(&scene::report("Long", &scene).unwrap()) else { return };
    let notes = "[...document.querySelectorAll('.note')].map((note) => note.textContent).join(' ')";
    let notes = browser.value(notes).as_str().unwrap().to_owned();
    for part in ["detections is drawn", "The slider stops at one in 2 of 22000 times"] {
        assert!(notes.contains(part), "{part} is missing in {notes}");
    }
    assert!(number(&mut browser, "ink()") > 2000.0);
    browser.value("slide(Number(slider().max) - 40)");
    browser.value("document.querySelector('.play').click()");
    browser.wait("slider().value === slider().max");
    assert_eq!(browser.complaints(), [""; 0]);
}
