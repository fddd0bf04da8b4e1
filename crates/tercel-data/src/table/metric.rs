//! How good tracks are, as a table.

/// Scores, in long form.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Metrics {
    /// The rows.
    pub rows: Vec<Metric>,
}

/// One number of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Metric {
    /// Which study, or the name of the evaluated file.
    pub study: String,
    /// Which method, or the name of the configuration.
    pub method: String,
    /// Which Monte Carlo run, or which scenario.
    pub run: String,
    /// Name of the metric: `gospa`, `rmse_pos_norm`, ...
    pub metric: String,
    /// Part of the metric: a component of the state, a time, or empty for the whole.
    pub component: String,
    /// The number.
    pub value: f64,
}
