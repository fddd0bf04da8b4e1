//! What the set metrics share: a cut-off and an order.

use crate::error::FilterError;

/// A cut-off `c` (m) and an order `p`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    pub(super) cutoff: f64,
    pub(super) order: f64,
}

impl Scale {
    pub(super) fn new(cutoff: f64, order: f64) -> Result<Self, FilterError> {
        FilterError::positive("cut-off", cutoff)?;
        if !(order >= 1.0 && order.is_finite()) {
            let expected = "must be finite and at least 1";
            return Err(FilterError::Parameter { parameter: "order", value: order, expected });
        }
        Ok(Scale { cutoff, order })
    }

    /// `xᵖ`
    #[inline]
    pub(super) fn power(&self, x: f64) -> f64 {
        if self.order == 1.0 {
            x
        } else if self.order == 2.0 {
            x * x
        } else {
            x.powf(self.order)
        }
    }

    /// `x^(1/p)`
    #[inline]
    pub(super) fn root(&self, x: f64) -> f64 {
        if self.order == 1.0 {
            x
        } else if self.order == 2.0 {
            x.sqrt()
        } else {
            x.powf(self.order.recip())
        }
    }

    /// `cᵖ`
    pub(super) fn highest(&self) -> f64 {
        self.power(self.cutoff)
    }

    /// `min(d, c)ᵖ`, or nothing when `distance` is not a distance.
    #[inline]
    pub(super) fn cut(&self, distance: f64) -> Result<f64, FilterError> {
        if distance >= 0.0 {
            return Ok(self.power(distance.min(self.cutoff)));
        }
        if distance.is_nan() {
            return Err(FilterError::NotFinite { what: "distance" });
        }
        let expected = "must not be negative";
        Err(FilterError::Parameter { parameter: "distance", value: distance, expected })
    }
}

/// Euclidean distance of two points.
#[inline]
pub(super) fn euclidean<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    (0..D).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum::<f64>().sqrt()
}

/// Refuses points that are not finite.
pub(super) fn finite<const D: usize>(points: &[[f64; D]]) -> Result<(), FilterError> {
    if points.iter().flatten().all(|x| x.is_finite()) {
        return Ok(());
    }
    Err(FilterError::NotFinite { what: "position" })
}
