//! Weights of past velocities in the next, identified while the object is tracked.

/// A regression of the velocity on the velocities before, by recursive least squares with forgetting. Both components share
/// the weights, so it looks the same in all directions.
///
/// ## Recursion
/// ```text
/// v(k) = Σ_i w_i v(k-i) + e,    for each component: g = P r / (σ² ρ + rᵀ P r),  w ← w + g (v - rᵀ w),  P ← (P - g rᵀ P) / ρ
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Regression {
    order: usize,
    /// Velocities, the last one first: one more than the order, m/s.
    past: Vec<[f64; 2]>,
    /// How many of them there are.
    known: usize,
    weights: Vec<f64>,
    covariance: Vec<f64>,
    gain: Vec<f64>,
    missed: [f64; 2],
}

/// How weights are identified.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Identification {
    /// Number of past velocities; 0 identifies nothing.
    pub order: usize,
    /// Share of what is known that lasts to the next step.
    pub kept: f64,
    /// Variance of the weights at first.
    pub variance: f64,
    /// Deviation of the velocity that the weights leave open, in units of `change`.
    pub residual: f64,
}

impl Default for Identification {
    fn default() -> Self {
        Identification { order: 10, kept: 0.998, variance: 0.25, residual: 1.2 }
    }
}

/// Largest variance of a weight: nothing excites the velocities of an object that stands, and forgetting goes on.
const LARGEST: f64 = 1e3;

impl Regression {
    /// Nothing is known but that a velocity is like the one before.
    pub fn new(options: &Identification) -> Self {
        let order = options.order;
        let mut regression = Regression {
            order,
            past: vec![[0.0; 2]; order + 1],
            known: 0,
            weights: vec![0.0; order],
            covariance: vec![0.0; order * order],
            gain: vec![0.0; order],
            missed: [0.0; 2],
        };
        regression.begin(options);
        regression
    }

    fn begin(&mut self, options: &Identification) {
        self.weights.fill(0.0);
        self.covariance.fill(0.0);
        for i in 0..self.order {
            self.weights[i] = if i == 0 { 1.0 } else { 0.0 };
            self.covariance[i * self.order + i] = options.variance;
        }
    }

    /// Takes a velocity (m/s), and learns from it if it was measured.
    pub fn take(&mut self, options: &Identification, change: f64, velocity: [f64; 2], measured: bool) {
        if self.known == 0 {
            // Velocities before the first are believed to be like it.
            self.past.fill(velocity);
            self.known = 1;
            return;
        }
        let expected = self.expected();
        self.missed = [0, 1].map(|axis| velocity[axis] - expected[axis]);
        if measured {
            for (axis, velocity) in velocity.into_iter().enumerate() {
                self.learn(options, change, axis, velocity);
            }
        }
        self.past.rotate_right(1);
        self.past[0] = velocity;
        self.known = (self.known + 1).min(self.order + 1);
        if !self.weights.iter().chain(&self.covariance).all(|x| x.is_finite()) {
            self.begin(options);
        }
    }

    fn learn(&mut self, options: &Identification, change: f64, axis: usize, velocity: f64) {
        let order = self.order;
        for (gain, row) in self.gain.iter_mut().zip(self.covariance.chunks_exact(order.max(1))) {
            *gain = row.iter().zip(&self.past).map(|(p, v)| p * v[axis]).sum();
        }
        let pairs = || self.past.iter().take(order);
        let said: f64 = pairs().zip(&self.weights).map(|(v, w)| v[axis] * w).sum();
        let spread: f64 = pairs().zip(&self.gain).map(|(v, g)| v[axis] * g).sum();
        let kept = options.kept.sqrt();
        let noise = options.residual * change;
        let scale = 1.0 / (noise * noise * kept + spread);
        let missed = (velocity - said) * scale;
        for i in 0..order {
            self.weights[i] += self.gain[i] * missed;
            for j in 0..order {
                let p = &mut self.covariance[i * order + j];
                *p = (*p - self.gain[i] * self.gain[j] * scale) / kept;
            }
        }
        let largest = (0..order).map(|i| self.covariance[i * order + i]).fold(0.0, f64::max);
        if largest > LARGEST {
            self.covariance.iter_mut().for_each(|p| *p *= LARGEST / largest);
        }
    }

    /// The velocity that the weights expect next, m/s.
    pub fn expected(&self) -> [f64; 2] {
        if self.order == 0 {
            return self.past[0];
        }
        [0, 1].map(|axis| self.past.iter().zip(&self.weights).map(|(v, w)| v[axis] * w).sum())
    }

    /// By how much the last velocity was not the expected one, m/s.
    pub fn missed(&self) -> [f64; 2] {
        self.missed
    }

    /// The last velocities, the present one first, m/s.
    pub fn past(&self) -> &[[f64; 2]] {
        &self.past
    }

    /// Deviation of the next expected velocity for what is not known of the weights, m/s.
    pub fn deviation(&self) -> f64 {
        let order = self.order;
        let mut sum = 0.0;
        for (row, a) in self.covariance.chunks_exact(order.max(1)).zip(&self.past) {
            for (p, b) in row.iter().zip(&self.past) {
                sum += p * (a[0] * b[0] + a[1] * b[1]);
            }
        }
        (0.5 * sum.max(0.0)).sqrt()
    }

    /// The mean with another, of this share.
    pub fn merge(&mut self, other: &Regression, share: f64) {
        let mix = |ours: &mut f64, theirs: f64| *ours += share * (theirs - *ours);
        for (ours, theirs) in self.past.iter_mut().zip(&other.past) {
            (0..2).for_each(|axis| mix(&mut ours[axis], theirs[axis]));
        }
        self.weights.iter_mut().zip(&other.weights).for_each(|(ours, theirs)| mix(ours, *theirs));
        self.covariance.iter_mut().zip(&other.covariance).for_each(|(ours, theirs)| mix(ours, *theirs));
        (0..2).for_each(|axis| mix(&mut self.missed[axis], other.missed[axis]));
        self.known = self.known.max(if share > 0.0 { other.known } else { 0 });
    }
}
