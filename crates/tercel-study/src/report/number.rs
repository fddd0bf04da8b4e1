//! Numbers as they appear in the data of a report: short, and never anything that JSON cannot hold.

use serde::{Serialize, Serializer};

/// The largest whole number that a script reads back exactly, 2^53.
const LARGEST_EXACT: u64 = 1 << 53;

/// A number rounded to a fixed number of decimals. NaN and infinities become `null`, which no plot draws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Number(Option<f64>);

impl Number {
    /// Rounds to `decimals` digits after the point. Magnitudes that rounding would overflow stay as they are.
    pub(super) fn rounded(value: f64, decimals: i32) -> Number {
        if !value.is_finite() {
            return Number(None);
        }
        let scale = 10f64.powi(decimals);
        let scaled = value * scale;
        // Adding zero turns -0 into 0.
        Number(Some(if scaled.is_finite() { scaled.round() / scale + 0.0 } else { value }))
    }

    /// Metres, metres per second or seconds, to a thousandth.
    pub(super) fn milli(value: f64) -> Number {
        Number::rounded(value, 3)
    }

    /// A number that is not known.
    pub(super) const MISSING: Number = Number(None);

    /// An optional quantity, to a thousandth.
    pub(super) fn optional(value: Option<f64>) -> Number {
        value.map_or(Number::MISSING, Number::milli)
    }

    /// To six significant digits: for quantities of any size, such as the values of a chart.
    pub(super) fn significant(value: f64) -> Number {
        if value == 0.0 || !value.is_finite() {
            return Number::rounded(value, 0);
        }
        let decimals = 5 - value.abs().log10().floor() as i32;
        // Beyond this, a power of ten is no longer finite; such values are shown as they are.
        if decimals.abs() > 300 { Number(Some(value)) } else { Number::rounded(value, decimals) }
    }

    /// Whether a number is there.
    pub(super) fn is_known(self) -> bool {
        self.0.is_some()
    }
}

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            None => serializer.serialize_none(),
            // "12" instead of "12.0": half the size of many columns.
            Some(value) if value.fract() == 0.0 && value.abs() < LARGEST_EXACT as f64 => {
                serializer.serialize_i64(value as i64)
            }
            Some(value) => serializer.serialize_f64(value),
        }
    }
}

/// An identity. Numbers beyond 2^53 travel as text, because a script would round them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Id(pub(super) u64);

impl Serialize for Id {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0 <= LARGEST_EXACT {
            serializer.serialize_u64(self.0)
        } else {
            serializer.collect_str(&self.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn json(value: impl Serialize) -> String {
        serde_json::to_string(&value).unwrap()
    }

    #[test]
    fn numbers_are_rounded_and_short() {
        assert_eq!(json(Number::milli(12.0)), "12");
        assert_eq!(json(Number::milli(-0.0001)), "0");
        assert_eq!(json(Number::milli(1234.567_891)), "1234.568");
        assert_eq!(json(Number::significant(0.000_123_456_789)), "0.000123457");
        assert_eq!(json(Number::significant(123_456_789.0)), "123457000");
    }

    #[test]
    fn what_json_cannot_hold_is_null() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(json(Number::milli(value)), "null");
            assert_eq!(json(Number::significant(value)), "null");
        }
        assert_eq!(json(Number::optional(None)), "null");
    }

    #[test]
    fn extreme_magnitudes_survive() {
        for value in [f64::MAX, f64::MIN_POSITIVE, 5e-324, -1e300] {
            let read: f64 = serde_json::from_str(&json(Number::significant(value))).unwrap();
            assert!((read - value).abs() <= 1e-5 * value.abs(), "{value:e} became {read:e}");
        }
        assert_eq!(json(Number::milli(f64::MAX)), "1.7976931348623157e+308");
    }

    #[test]
    fn an_id_that_a_script_would_round_is_text() {
        assert_eq!(json(Id(42)), "42");
        assert_eq!(json(Id(u64::MAX)), "\"18446744073709551615\"");
    }
}
