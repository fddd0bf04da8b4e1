//! What was published about these flights.

use std::collections::BTreeMap;

/// The published row of a method: mean and standard deviation over the flights of a set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PublishedFigures {
    /// Name of the method here, or the one that it would have: with the suffix `-paper`, since our defaults are others.
    pub method: &'static str,
    /// Population of the flights.
    pub set: &'static str,
    /// Mean and deviation of the element error over all components.
    pub rmse_all: (f64, f64),
    /// Mean and deviation of the element error over the positions, m.
    pub rmse_pos: (f64, f64),
    /// Mean and deviation of the element error over the velocities, m/s.
    pub rmse_vel: (f64, f64),
    /// Mean and deviation of the accuracy, percent, where the method tells manoeuvres.
    pub accuracy: Option<(f64, f64)>,
}

const fn row(
    method: &'static str,
    set: &'static str,
    figures: [(f64, f64); 3],
    accuracy: Option<(f64, f64)>,
) -> PublishedFigures {
    let [rmse_all, rmse_pos, rmse_vel] = figures;
    PublishedFigures { method, set, rmse_all, rmse_pos, rmse_vel, accuracy }
}

/// Tables 2 (`atc-validation`), 3 (`atc-test`) and 5 (`atc-hshm`) of the AttEnsKNets paper.
pub const PUBLISHED: [PublishedFigures; 15] = [
    row(
        "average-paper",
        "atc-validation",
        [(249.01, 129.34), (341.25, 184.07), (79.48, 28.77)],
        Some((33.25, 30.72)),
    ),
    row(
        "ens-knets-classification-paper",
        "atc-validation",
        [(240.57, 126.27), (330.25, 179.19), (74.71, 29.69)],
        Some((72.93, 18.43)),
    ),
    row(
        "ens-knets-correction-paper",
        "atc-validation",
        [(228.65, 105.35), (317.10, 149.11), (59.61, 20.54)],
        Some((33.25, 30.72)),
    ),
    row(
        "ens-knets-paper",
        "atc-validation",
        [(218.17, 97.72), (302.14, 138.41), (58.78, 19.70)],
        Some((74.57, 17.05)),
    ),
    row(
        "att-ens-kalmannets-paper",
        "atc-validation",
        [(206.05, 100.04), (285.30, 141.88), (55.28, 18.81)],
        Some((79.12, 17.23)),
    ),
    row(
        "imm-paper",
        "atc-test",
        [(397.92, 271.54), (505.94, 336.87), (244.75, 186.53)],
        Some((40.61, 19.70)),
    ),
    row("mnemonic-paper", "atc-test", [(507.24, 294.53), (685.85, 434.06), (157.01, 68.10)], None),
    row("deep-mtt-paper", "atc-test", [(255.59, 231.74), (356.30, 326.96), (57.53, 29.82)], None),
    row("tr-mtt-paper", "atc-test", [(251.39, 145.95), (345.63, 208.38), (72.97, 28.07)], None),
    row(
        "att-ens-kalmannets-paper",
        "atc-test",
        [(187.18, 96.93), (258.18, 137.24), (54.19, 20.86)],
        Some((81.99, 14.42)),
    ),
    row(
        "imm-paper",
        "atc-hshm",
        [(471.18, 322.29), (576.85, 391.69), (332.32, 234.81)],
        Some((46.71, 18.95)),
    ),
    row("mnemonic-paper", "atc-hshm", [(595.47, 304.13), (735.37, 482.87), (344.08, 43.30)], None),
    row("deep-mtt-paper", "atc-hshm", [(573.12, 376.52), (789.42, 433.60), (170.25, 65.88)], None),
    row("tr-mtt-paper", "atc-hshm", [(404.25, 184.67), (521.23, 271.03), (218.13, 48.38)], None),
    row(
        "att-ens-kalmannets-paper",
        "atc-hshm",
        [(328.98, 143.28), (426.41, 193.15), (175.54, 87.05)],
        Some((75.06, 15.14)),
    ),
];

impl PublishedFigures {
    /// The row of a method on a set.
    pub fn of(method: &str, set: &str) -> Option<&'static PublishedFigures> {
        PUBLISHED.iter().find(|row| row.set == set && row.method == method)
    }

    /// The means by the name of the metric.
    pub fn means(&self) -> BTreeMap<String, f64> {
        let all = [
            ("rmse_all", Some(self.rmse_all)),
            ("rmse_pos", Some(self.rmse_pos)),
            ("rmse_vel", Some(self.rmse_vel)),
            ("accuracy", self.accuracy),
        ];
        all.into_iter().filter_map(|(name, figure)| Some((name.to_owned(), figure?.0))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_element_errors_of_each_row_fit_each_other() {
        // Mean of roots against root of means: a slip of a digit would show, and so would Euclidean figures.
        for row in PUBLISHED {
            let mean = ((row.rmse_pos.0.powi(2) + row.rmse_vel.0.powi(2)) / 2.0).sqrt();
            assert!((row.rmse_all.0 / mean - 1.0).abs() < 0.04, "{row:?}: {mean}");
        }
    }

    #[test]
    fn our_defaults_are_not_the_published_methods() {
        assert_eq!(PublishedFigures::of("imm-paper", "atc-hshm").unwrap().rmse_all.0, 471.18);
        assert!(PublishedFigures::of("imm", "atc-test").is_none());
        assert!(PublishedFigures::of("att-ens-kalmannets", "atc-test").is_none());
    }
}
