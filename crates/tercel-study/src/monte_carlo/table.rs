//! Results as tables.

use std::fmt::Write as _;

use rayon::prelude::*;
use tercel_data::table::{Metric, Metrics};

use super::{Experiment, Quantity, Results};
use crate::table::{Figure, Row, StudyTable};

/// Name of the metric that counts failed runs.
pub(super) const FAILURES: &str = "failures";

impl Results {
    /// The table: one row for each condition and method.
    pub fn table(&self, experiment: &dyn Experiment) -> StudyTable {
        let methods = self.plan.methods.len();
        let rows = (0..self.cells.len())
            .into_par_iter()
            .map(|index| self.row(experiment, index / methods, index % methods))
            .collect();
        StudyTable {
            study: self.plan.study.clone(),
            options: self.plan.options.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            seed: self.plan.seed,
            runs: usize::try_from(self.plan.runs).unwrap_or(usize::MAX),
            rows,
        }
    }

    fn row(&self, experiment: &dyn Experiment, condition: usize, method: usize) -> Row {
        let plan = &self.plan;
        let cell = &self.cells[condition * plan.methods.len() + method];
        let metrics = plan.metrics.par_iter().enumerate();
        let mut figures: Vec<(String, Figure)> = metrics
            .map(|(place, metric)| (metric.name.clone(), Figure::of(&cell.metric(place), plan.seed)))
            .collect();
        figures.push((FAILURES.to_owned(), Figure::of(&cell.failed(), plan.seed)));
        let name = &plan.methods[method];
        Row {
            method: name.clone(),
            at: plan.at(condition).map(|(name, value)| [(name.to_owned(), value)].into()),
            metrics: figures.into_iter().collect(),
            us_per_step: 1e6 * cell.seconds / cell.steps as f64,
            published: experiment.published(name, condition),
        }
    }

    /// The numbers of every run, in long form. The component is the condition: `bearing_deviation_deg=0.5`.
    pub fn metrics(&self) -> Metrics {
        let plan = &self.plan;
        let mut rows = Vec::new();
        for (index, cell) in self.cells.iter().enumerate() {
            let (condition, method) = (index / plan.methods.len(), index % plan.methods.len());
            let component = plan.at(condition).map(|(name, value)| format!("{name}={value}"));
            let mut push = |metric: &str, values: Vec<f64>| {
                for (run, value) in cell.runs.iter().zip(values) {
                    rows.push(Metric {
                        study: plan.study.clone(),
                        method: plan.methods[method].clone(),
                        run: run.to_string(),
                        metric: metric.to_owned(),
                        component: component.clone().unwrap_or_default(),
                        value,
                    });
                }
            };
            for (place, metric) in plan.metrics.iter().enumerate() {
                push(&metric.name, cell.metric(place));
            }
            push(FAILURES, cell.failed());
        }
        Metrics { rows }
    }

    /// What failed, a line for each method and condition with the message of the first run.
    pub fn failures(&self) -> Vec<String> {
        let plan = &self.plan;
        let line = |(index, cell): (usize, &super::Cell)| {
            let first = cell.failures.first()?;
            let (condition, method) = (index / plan.methods.len(), &plan.methods[index % plan.methods.len()]);
            let at = plan.at(condition).map(|(name, value)| format!(" at {name} = {value}"));
            let (count, all) = (cell.failures.len(), cell.runs.len());
            Some(format!(
                "{method}{} failed in {count} of {all} runs, first in run {}: {}",
                at.unwrap_or_default(),
                first.run,
                first.message
            ))
        };
        self.cells.iter().enumerate().filter_map(line).collect()
    }

    /// The table as text: for one condition mean, deviation, interval and published figure of each metric; for a sweep the
    /// means over its values.
    pub fn text(&self, table: &StudyTable) -> String {
        let plan = &self.plan;
        let options: Vec<String> =
            plan.options.iter().map(|(name, value)| format!(", {name} {value}")).collect();
        let mut text = format!(
            "study {}{}, seed {}, {}\n",
            plan.study,
            options.concat(),
            plan.seed,
            if plan.sweep.is_some() {
                format!("{} x {}", plan.conditions(), plan.counted_runs())
            } else {
                plan.counted_runs()
            },
        );
        match &plan.sweep {
            None => self.write_full(table, &mut text),
            Some(sweep) => {
                for metric in plan.metrics.iter().filter(|metric| metric.shown) {
                    let _ = writeln!(text, "\n{} (mean) over {}", metric.heading(), sweep.label);
                    self.write_sweep(table, &metric.name, &sweep.values, &mut text);
                }
                text.push_str("\nDeviations and intervals are in the JSON form and in the report.\n");
            }
        }
        for line in self.failures() {
            let _ = writeln!(text, "{line}");
        }
        text
    }

    fn write_full(&self, table: &StudyTable, text: &mut String) {
        let metrics = || self.plan.metrics.iter().filter(|metric| metric.shown);
        let shown: Vec<&str> = metrics().map(|metric| metric.name.as_str()).collect();
        let mut lines = vec![vec!["method".to_owned()]];
        lines[0].extend(metrics().map(Quantity::heading));
        lines[0].extend([FAILURES.to_owned(), "us per step".to_owned()]);
        for (row, cell) in table.rows.iter().zip(&self.cells) {
            let figures: Vec<Option<&Figure>> = shown.iter().map(|name| row.metrics.get(*name)).collect();
            let cells = |name: &str, show: &dyn Fn(&Figure) -> String| {
                let mut line = vec![name.to_owned()];
                line.extend(figures.iter().map(|figure| match figure {
                    Some(figure) if figure.mean.is_finite() => show(figure),
                    _ => "-".to_owned(),
                }));
                line
            };
            let mut line =
                cells(&row.method, &|figure| format!("{} ± {}", short(figure.mean), short(figure.std)));
            line.extend([cell.failures.len().to_string(), format!("{:.2}", row.us_per_step)]);
            lines.push(line);
            lines.push(cells("  95 %", &|figure| format!("{} .. {}", short(figure.lo), short(figure.hi))));
            if let Some(published) = &row.published {
                let mut line = vec!["  published".to_owned()];
                let figure = |name: &&str| published.get(*name).map_or("-".to_owned(), |value| short(*value));
                line.extend(shown.iter().map(figure));
                lines.push(line);
            }
        }
        text.push_str(&columns(&lines));
    }

    fn write_sweep(&self, table: &StudyTable, metric: &str, values: &[f64], text: &mut String) {
        let mut lines = vec![vec![String::new()]];
        lines[0].extend(values.iter().map(f64::to_string));
        let methods = self.plan.methods.len();
        for (method, name) in self.plan.methods.iter().enumerate() {
            let mut line = vec![name.clone()];
            let rows = table.rows.iter().skip(method).step_by(methods);
            line.extend(rows.map(|row| match row.metrics.get(metric) {
                Some(figure) if figure.mean.is_finite() => short(figure.mean),
                _ => "-".to_owned(),
            }));
            lines.push(line);
        }
        text.push_str(&columns(&lines));
    }
}

/// A number with about four digits.
pub(super) fn short(value: f64) -> String {
    let size = value.abs();
    match () {
        () if !value.is_finite() => "-".to_owned(),
        () if size >= 1e6 => format!("{value:.3e}"),
        () if size >= 1000.0 => format!("{value:.0}"),
        () if size >= 10.0 => format!("{value:.1}"),
        () => format!("{value:.3}"),
    }
}

/// Cells in columns: the first to the left, the others to the right.
fn columns(lines: &[Vec<String>]) -> String {
    let count = lines.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| {
        lines.iter().filter_map(|line| line.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..count).map(width).collect();
    let mut text = String::new();
    for line in lines {
        for (column, cell) in line.iter().enumerate() {
            let width = widths[column];
            let _ =
                if column == 0 { write!(text, "{cell:width$}") } else { write!(text, "  {cell:>width$}") };
        }
        text.push('\n');
    }
    text
}
