//! The numbers to which filters are tuned, and those of the publication.

use nalgebra::{Matrix2, Vector2};

use super::scene::{AIRLINER, VEHICLE};

/// What filters are told of a population. Tuned on recordings of other seeds, or on the tracks for training.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settings {
    /// Semi-axes that are expected where the size is not known, m.
    pub axes: Vector2<f64>,
    /// Weight of that expectation, in points.
    pub weight: f64,
    /// Jump of the velocity in a step for random-matrix and multiplicative-error filters, m/s per axis.
    pub jump: f64,
    /// Share of the extent's weight that lasts to the next step.
    pub kept: f64,
    /// The same for the rule of Koch.
    pub kept_direct: f64,
    /// The same for the variational rule.
    pub kept_variational: f64,
    /// Degrees of freedom of the next extent, after Lan and Li.
    pub delta: f64,
    /// Turns of the variational rule.
    pub sweeps: u32,
    /// The interacting models.
    pub imm: ImmSettings,
    /// Multiplicative error, linearised.
    pub mem_ekf: ShapeSettings,
    /// Multiplicative error with particles.
    pub mem_rbpf: ShapeSettings,
    /// Number of these particles.
    pub particles: usize,
    /// Jump of the velocity for filters that know the size, m/s per axis.
    pub jump_known: f64,
    /// Whether these take the angle from the course or from the scan.
    pub course: bool,
    /// Jump of the velocity of aligned objects, m/s per axis.
    pub jump_aligned: f64,
    /// What a regression leaves open of a velocity, m/s per axis.
    pub residual: f64,
    /// Variance of its weights at first.
    pub weights: f64,
    /// The model of the learned filter.
    pub rmmnet: &'static str,
    /// The model of its form in the publication.
    pub rmmnet_paper: &'static str,
    /// The models of networks alone, relative to the centroid.
    pub lstm: &'static str,
    /// The same of the transformer.
    pub transformer: &'static str,
    /// The models of networks alone as published.
    pub lstm_paper: &'static str,
    /// The same of the transformer.
    pub transformer_paper: &'static str,
    /// What the publication says.
    pub paper: PaperSettings,
}

/// The interacting models of the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ImmSettings {
    /// Probability of keeping the mode in a step.
    pub stay: f64,
    /// Jump of the velocity of straight motion and turns, m/s per axis.
    pub jump: f64,
    /// Density of the white jerk, m²/s⁵.
    pub jerk: f64,
    /// Rate of the turns, rad/s.
    pub turn: f64,
    /// Share of the extent's weight that lasts to the next step.
    pub kept: f64,
}

/// What filters of angle and axes are told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ShapeSettings {
    /// Deviation of a semi-axis at first, as a share of it.
    pub axes: f64,
    /// Growth of the variance of an axis in a step, as a share of the first.
    pub growth: f64,
    /// Variance that the angle gathers in a step, rad².
    pub turning: f64,
}

/// The published configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PaperSettings {
    /// Acceleration, m/s² per axis.
    pub acceleration: f64,
    /// First degrees of freedom of the extent.
    pub freedom: f64,
    /// First semi-axes, whose squares are the scale matrix of the extent, m.
    pub axes: Vector2<f64>,
    /// Time over which the extent is forgotten, s.
    pub time: f64,
    /// Turns of the variational rule.
    pub sweeps: u32,
    /// Rate of the turns, rad/s.
    pub turn: f64,
    /// Variances that angle and axes gather in a step.
    pub growth: [f64; 3],
    /// Sensor noise of the multiplicative-error filter, m².
    pub noise: f64,
    /// Particles, and the variance that their angle gathers in a step, rad².
    pub particles: (usize, f64),
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;

const VEHICLE_PAPER: PaperSettings = PaperSettings {
    acceleration: 1.0,
    freedom: 7.0,
    axes: Vector2::new(10.0, 3.0),
    time: 0.5,
    sweeps: 5,
    turn: 3.0 * DEGREE,
    growth: [0.1, 1.0, 1.0],
    noise: 1.0,
    particles: (10, 0.2),
};

const AIRCRAFT_PAPER: PaperSettings = PaperSettings {
    acceleration: 5.0,
    freedom: 10.0,
    axes: Vector2::new(70.0, 60.0),
    time: 2.0,
    sweeps: 6,
    turn: DEGREE,
    growth: [1.0, 2.0, 2.0],
    noise: 20.0,
    particles: (50, 0.1),
};

/// Mean semi-axes (m) of mixed sizes, and their deviation as a share of the mean.
const MIXED: (Vector2<f64>, f64) = (Vector2::new(6.0, 1.4), 0.27);

impl Settings {
    /// For vehicles with weights that were drawn until they were stable.
    pub const REJECT: Settings = Settings {
        axes: VEHICLE,
        weight: 4.0,
        jump: 8.0,
        kept: 0.02,
        kept_direct: 0.02,
        kept_variational: 0.001,
        delta: 2.0,
        sweeps: 5,
        imm: ImmSettings { stay: 0.9, jump: 8.0, jerk: 1.0, turn: 3.0 * DEGREE, kept: 0.001 },
        mem_ekf: ShapeSettings { axes: 0.03, growth: 0.0, turning: 1.0 },
        mem_rbpf: ShapeSettings { axes: 0.03, growth: 0.0, turning: 2.0 },
        particles: 10,
        jump_known: 6.0,
        course: false,
        jump_aligned: 5.0,
        residual: 1.15,
        weights: 0.25,
        rmmnet: "rmmnet-vehicle",
        rmmnet_paper: "rmmnet-vehicle-paper",
        lstm: "lstm-vehicle",
        transformer: "transformer-vehicle",
        lstm_paper: "lstm-vehicle-paper",
        transformer_paper: "transformer-vehicle-paper",
        paper: VEHICLE_PAPER,
    };

    /// For vehicles with scaled weights of either sign.
    pub const L1: Settings = Settings {
        jump: 2.5,
        kept: 0.05,
        kept_direct: 0.05,
        kept_variational: 0.003,
        imm: ImmSettings { jump: 2.5, kept: 0.003, ..Settings::REJECT.imm },
        jump_known: 1.6,
        jump_aligned: 1.6,
        residual: 1.0,
        ..Settings::REJECT
    };

    /// For vehicles whose velocity changes slowly.
    pub const SMOOTH: Settings = Settings {
        jump: 1.3,
        kept: 0.09,
        kept_direct: 0.12,
        kept_variational: 0.009,
        delta: 2.5,
        imm: ImmSettings { jump: 1.3, kept: 0.009, ..Settings::REJECT.imm },
        mem_ekf: ShapeSettings { turning: 0.6, ..Settings::REJECT.mem_ekf },
        mem_rbpf: ShapeSettings { turning: 0.6, ..Settings::REJECT.mem_rbpf },
        jump_known: 1.0,
        jump_aligned: 1.3,
        residual: 1.0,
        ..Settings::REJECT
    };

    /// For airliners.
    pub const AIRCRAFT: Settings = Settings {
        axes: AIRLINER,
        weight: 4.0,
        jump: 14.0,
        kept: 0.95,
        kept_direct: 0.95,
        kept_variational: 0.95,
        delta: 300.0,
        sweeps: 5,
        imm: ImmSettings { stay: 0.9, jump: 13.0, jerk: 0.25, turn: DEGREE, kept: 0.97 },
        mem_ekf: ShapeSettings { axes: 0.3, growth: 0.001, turning: 1e-4 },
        mem_rbpf: ShapeSettings { axes: 0.1, growth: 0.0, turning: 0.01 },
        particles: 50,
        jump_known: 15.0,
        course: true,
        jump_aligned: 15.0,
        residual: 8.5,
        weights: 0.05,
        rmmnet: "rmmnet-aircraft",
        rmmnet_paper: "rmmnet-aircraft-paper",
        lstm: "lstm-aircraft",
        transformer: "transformer-aircraft",
        lstm_paper: "lstm-aircraft-paper",
        transformer_paper: "transformer-aircraft-paper",
        paper: AIRCRAFT_PAPER,
    };

    /// For objects of the same motion, whose sizes are those of cars and lorries.
    pub fn for_mixed_sizes(self) -> Settings {
        let widened = |shape: ShapeSettings| ShapeSettings { axes: MIXED.1, ..shape };
        Settings { axes: MIXED.0, mem_ekf: widened(self.mem_ekf), mem_rbpf: widened(self.mem_rbpf), ..self }
    }

    /// The expected extent matrix, m².
    pub fn extent(&self) -> Matrix2<f64> {
        Matrix2::from_diagonal(&self.axes.component_mul(&self.axes))
    }
}
