//! The report of a study, and its files.

use std::io::Write;
use std::path::Path;

use tercel_data::AtomicFile;

use super::table::{FAILURES, short};
use super::{Example, Experiment, Quantity, Results, Sweep};
use crate::StudyError;
use crate::report::{Chart, Report, Summary, Table};
use crate::table::{Figure, Row, StudyTable};

/// Makes a folder for results, and tries whether files can be written to it: before the work, not after it.
///
/// # Errors
/// When the folder cannot be made or written to.
pub fn probe(folder: &Path) -> Result<(), StudyError> {
    let failed = |source| StudyError::Output { path: folder.to_path_buf(), source };
    std::fs::create_dir_all(folder).map_err(failed)?;
    // Given up again at once.
    AtomicFile::create(&folder.join("study.json"))?;
    Ok(())
}

/// Takes away the tables of the study that is there and gets replaced, whose methods may be others. Other files stay.
fn remove_examples(folder: &Path) -> std::io::Result<()> {
    let Ok(text) = std::fs::read(folder.join("study.json")) else { return Ok(()) };
    let Ok(earlier) = serde_json::from_slice::<serde_json::Value>(&text) else { return Ok(()) };
    let rows = earlier["rows"].as_array().into_iter().flatten();
    let methods = rows.filter_map(|row| row["method"].as_str());
    for name in methods.chain(["truth", "detections"]) {
        match std::fs::remove_file(folder.join(format!("example_{name}.csv"))) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    Ok(())
}

impl Results {
    /// Writes to `folder` the table (`study.json`), the numbers of every run (`metrics.csv`), a report (`report.html`), and the
    /// run that it draws (`example_truth.csv`, `example_detections.csv`, `example_METHOD.csv`; those of an earlier study are
    /// taken away). Each file appears whole or not at all, the report last.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn publish(
        &self,
        experiment: &dyn Experiment,
        table: &StudyTable,
        folder: &Path,
    ) -> Result<(), StudyError> {
        let failed = |source| StudyError::Output { path: folder.to_path_buf(), source };
        std::fs::create_dir_all(folder).map_err(failed)?;
        remove_examples(folder).map_err(failed)?;
        let example = experiment.example()?;
        if let Some(example) = &example {
            tercel_data::write_truths(folder.join("example_truth.csv"), &example.truths)?;
            tercel_data::write_detections(folder.join("example_detections.csv"), &example.detections)?;
            for (method, tracks) in &example.tracks {
                tercel_data::write_tracks(folder.join(format!("example_{method}.csv")), tracks)?;
            }
        }
        tercel_data::write_metrics(folder.join("metrics.csv"), &self.metrics())?;
        let json = serde_json::to_vec_pretty(table).map_err(|error| failed(error.into()))?;
        let mut file = AtomicFile::create(&folder.join("study.json"))?;
        file.write_all(&json).map_err(failed)?;
        file.finish()?;
        Ok(self.report(experiment, table, example).write(folder.join("report.html"))?)
    }

    /// The report: figures, errors over time or over what is swept, and an example.
    pub fn report(
        &self,
        experiment: &dyn Experiment,
        table: &StudyTable,
        example: Option<Example>,
    ) -> Report {
        let plan = &self.plan;
        let options: Vec<String> =
            plan.options.iter().map(|(name, value)| format!(", {name} {value}")).collect();
        let mut report = Report::new(format!("Study {}{}", plan.study, options.concat()))
            .with_subtitle(format!(
                "Seed {}, {}{}. Intervals hold the mean with 95 % (bootstrap).",
                plan.seed,
                plan.counted_runs(),
                if plan.sweep.is_some() { " under each condition" } else { "" }
            ))
            .with(self.summary(table));
        let failures = self.failures();
        if !failures.is_empty() {
            let start = Table::new("Failed runs, which no mean contains", ["what failed"]);
            report = report.with(failures.into_iter().fold(start, |table, line| table.with_row([line])));
        }
        let shown = plan.metrics.iter().filter(|metric| metric.shown);
        if let Some(sweep) = &plan.sweep {
            for metric in shown.clone() {
                report = report.with(self.sweep_chart(table, metric, sweep));
            }
        }
        for metric in shown {
            report = report.with(self.figures(table, metric));
        }
        for (place, curve) in plan.curves.iter().enumerate() {
            let start = Chart::over(&curve.title, &curve.unit, &curve.abscissa, curve.x.clone());
            let chart = plan.methods.iter().enumerate().fold(start, |chart, (method, name)| {
                match self.cell(0, method).map(|cell| &cell.curves[place]) {
                    Some(sums) if sums.iter().any(|sum| sum.count() > 0) => {
                        let value = |mean: f64| if curve.root { mean.sqrt() } else { mean };
                        let values = sums.iter().map(|sum| sum.mean().map_or(f64::NAN, value)).collect();
                        chart.with_part(name, values).in_place(method)
                    }
                    _ => chart,
                }
            });
            report = report.with(chart);
        }
        for section in experiment.sections().into_iter().chain(experiment.conclusions(self)) {
            report = report.with(section);
        }
        match example {
            Some(example) => {
                report.with(Summary::new().with("Example", example.title, None)).with(example.picture)
            }
            None => report,
        }
    }

    /// The first metric of each method, under the first condition.
    fn summary(&self, table: &StudyTable) -> Summary {
        let Some(metric) = self.plan.metrics.first() else { return Summary::new() };
        let methods = table.rows.iter().take(self.plan.methods.len());
        methods.fold(Summary::new(), |summary, row| {
            let figure = row.metrics.get(&metric.name);
            let told = figure.filter(|figure| figure.mean.is_finite());
            let value = told.map_or("-".to_owned(), |figure| short(figure.mean));
            let at = row.at.iter().flatten().map(|(name, value)| format!(", {name} {value}"));
            let help = format!("{}{}", metric.name, at.collect::<String>());
            summary.with(&row.method, value, Some(&help))
        })
    }

    /// The table of one metric.
    fn figures(&self, table: &StudyTable, metric: &Quantity) -> Table {
        let mut columns = vec!["method".to_owned()];
        columns.extend(self.plan.sweep.as_ref().map(|sweep| sweep.name.clone()));
        columns.extend(["mean", "std", "95 % from", "95 % to", "published", FAILURES].map(str::to_owned));
        let mut made = Table::new(metric.heading(), columns);
        if self.plan.sweep.is_some() {
            made = made.folded();
        }
        for (row, cell) in table.rows.iter().zip(&self.cells) {
            let Some(figure) = row.metrics.get(&metric.name).filter(|figure| figure.mean.is_finite()) else {
                continue;
            };
            let mut cells = vec![row.method.clone()];
            cells.extend(row.at.iter().flatten().map(|(_, value)| value.to_string()));
            cells.extend([figure.mean, figure.std, figure.lo, figure.hi].map(short));
            let published = row.published.as_ref().and_then(|published| published.get(&metric.name));
            cells.push(published.map_or(String::new(), |value| short(*value)));
            cells.push(cell.failures.len().to_string());
            made = made.with_row(cells);
        }
        made
    }

    fn sweep_chart(&self, table: &StudyTable, metric: &Quantity, sweep: &Sweep) -> Chart {
        let methods = self.plan.methods.len();
        let (label, values) = sweep.abscissa();
        let start = Chart::over(&metric.name, &metric.unit, label, values);
        self.plan.methods.iter().enumerate().fold(start, |chart, (method, name)| {
            let rows: Vec<&Row> = table.rows.iter().skip(method).step_by(methods).collect();
            let column = |value: fn(&Figure) -> f64| -> Vec<f64> {
                rows.iter().map(|row| row.metrics.get(&metric.name).map_or(f64::NAN, value)).collect()
            };
            let means = column(|figure| figure.mean);
            if means.iter().all(|mean| mean.is_nan()) {
                return chart;
            }
            chart
                .with_banded_part(name, means, column(|figure| figure.lo), column(|figure| figure.hi))
                .in_place(method)
        })
    }
}
