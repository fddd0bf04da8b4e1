//! What was published about these studies.

use std::collections::BTreeMap;

/// The published row of a method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PublishedRow {
    /// Name of the method here.
    pub method: &'static str,
    /// `vehicle`, `aircraft` or `vehicle-ablation`.
    pub study: &'static str,
    /// Element error of the position, m.
    pub rmse_pos: f64,
    /// Element error of the velocity, m/s.
    pub rmse_vel: f64,
    /// Intersection over union, 0 to 1.
    pub iou: f64,
    /// Squared Gaussian Wasserstein distance, m².
    pub gwd: f64,
}

const fn row(method: &'static str, study: &'static str, figures: [f64; 4]) -> PublishedRow {
    let [rmse_pos, rmse_vel, iou, gwd] = figures;
    PublishedRow { method, study, rmse_pos, rmse_vel, iou, gwd }
}

/// Tables I (`vehicle`), II (`aircraft`) and III (`vehicle-ablation`) of the RMMNet paper.
pub const PUBLISHED: [PublishedRow; 22] = [
    row("b-rmm-paper", "vehicle", [1.2891, 1.2143, 0.42173, 5.9499]),
    row("vb-rmm-paper", "vehicle", [0.6032, 5.1542, 0.60915, 2.5317]),
    row("imm-rmm-paper", "vehicle", [0.6038, 1.1618, 0.62819, 3.1245]),
    row("mem-ekf-paper", "vehicle", [1.5208, 1.0163, 0.30629, 9.1525]),
    row("mem-rbpf-paper", "vehicle", [0.6013, 0.6388, 0.48191, 8.3421]),
    row("lstm-paper", "vehicle", [32.2685, 2.4821, 0.00414, 3862.7581]),
    row("transformer-paper", "vehicle", [47.4475, 2.9012, 0.00339, 4521.3716]),
    row("rmmnet-paper", "vehicle", [0.5933, 0.5910, 0.70425, 0.9182]),
    row("b-rmm-paper", "aircraft", [12.2317, 8.8747, 0.324572, 863.9]),
    row("vb-rmm-paper", "aircraft", [7.2044, 12.4817, 0.538806, 274.3]),
    row("imm-rmm-paper", "aircraft", [9.4948, 5.5473, 0.491342, 361.2]),
    row("mem-ekf-paper", "aircraft", [20.6670, 9.2847, 0.256783, 1055.4]),
    row("mem-rbpf-paper", "aircraft", [6.3971, 21.0381, 0.523381, 292.3]),
    row("lstm-paper", "aircraft", [481.3142, 15.2947, 0.003592, 463_391.9]),
    row("transformer-paper", "aircraft", [353.9528, 10.4817, 0.009948, 250_590.8]),
    row("rmmnet-paper", "aircraft", [6.4819, 3.2714, 0.557263, 263.9]),
    row("full", "vehicle-ablation", [0.5933, 0.5910, 0.70425, 0.9182]),
    row("without-prediction", "vehicle-ablation", [0.7689, 0.9232, 0.57742, 2.0453]),
    row("without-update", "vehicle-ablation", [0.7548, 0.8341, 0.60361, 1.6239]),
    row("without-memory", "vehicle-ablation", [1.0982, 0.9543, 0.52145, 4.3981]),
    row("only-update", "vehicle-ablation", [1.2145, 1.1542, 0.43541, 5.0254]),
    row("only-prediction", "vehicle-ablation", [1.1852, 1.0253, 0.45169, 5.3157]),
];

impl PublishedRow {
    /// The row of a method in a study.
    pub fn of(method: &str, study: &str) -> Option<&'static PublishedRow> {
        PUBLISHED.iter().find(|row| row.method == method && row.study == study)
    }

    /// Its figures by the name of the metric.
    pub fn figures(&self) -> BTreeMap<String, f64> {
        let figures =
            [("rmse_pos", self.rmse_pos), ("rmse_vel", self.rmse_vel), ("iou", self.iou), ("gwd", self.gwd)];
        figures.map(|(name, figure)| (name.to_owned(), figure)).into()
    }
}
