//! How much each KalmanNet counts, from its innovation.

use super::Mode;
use super::hyper::{Attention, Sign};

/// Smallest weight, so that a motion that was ruled out may come back.
const FLOOR: f64 = 1e-30;

/// What the exponential mean of the smallest normalised innovation squared begins with: its expectation when
/// one motion is right.
pub(super) const USUAL: f64 = 2.0;

impl Attention {
    /// Sets the weights after a measurement. `level` is the exponential mean of the smallest normalised
    /// innovation squared.
    pub(super) fn weigh(&self, modes: &mut [Mode], level: &mut f64) {
        let smallest = modes.iter().map(|mode| mode.evidence.nis).fold(f64::INFINITY, f64::min);
        let mut heat = 1.0;
        if let Some(share) = self.temperature {
            if smallest.is_finite() {
                *level = share * *level + (1.0 - share) * smallest;
            }
            heat = (*level / USUAL).max(1.0);
        }
        let logit = |mode: &Mode| {
            let evidence = &mode.evidence;
            let value = match self.sign {
                // The logarithm of the likelihood, of which all but the NIS is left as it is.
                Sign::Minus => evidence.log_likelihood + 0.5 * evidence.nis * (1.0 - 1.0 / heat),
                Sign::Plus => evidence.nis / heat,
            };
            value + if self.stay.is_some() { mode.weight.ln() } else { 0.0 }
        };
        let top = modes.iter().map(logit).fold(f64::NEG_INFINITY, f64::max);
        // A measurement that no motion can explain says nothing about which one it is.
        if !top.is_finite() {
            return;
        }
        let sum: f64 = modes.iter().map(|mode| (logit(mode) - top).exp()).sum();
        for mode in modes {
            mode.weight = ((logit(mode) - top).exp() / sum).max(FLOOR);
        }
    }

    /// Moves weights that go on over `dt` seconds, in which the motion may change to any other alike.
    pub(super) fn wait(&self, modes: &mut [Mode], dt: f64) {
        let (Some(stay), count) = (self.stay, modes.len() as f64) else { return };
        if modes.len() < 2 {
            return;
        }
        // Of a matrix with `stay` on its diagonal and the rest spread evenly, every mode but the uniform one
        // shrinks by this.
        let kept = ((count * stay - 1.0) / (count - 1.0)).powf(dt);
        for mode in modes {
            mode.weight = 1.0 / count + kept * (mode.weight - 1.0 / count);
        }
    }
}
