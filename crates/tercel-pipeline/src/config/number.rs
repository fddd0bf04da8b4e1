//! Numbers that know their range, so that a bad one is reported with its line and column.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

/// Defines a number type with a range that is checked when it is read and stated in the schema.
macro_rules! ranged {
    ($(#[$doc:meta])* $name:ident, $inner:ty, $accepts:expr, $expected:literal, $schema:tt) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Serialize, Deserialize)]
        #[serde(try_from = "f64", into = "f64")]
        pub struct $name($inner);

        impl $name {
            /// The number.
            pub fn get(self) -> $inner {
                self.0
            }
        }

        impl TryFrom<f64> for $name {
            type Error = String;

            fn try_from(value: f64) -> Result<Self, String> {
                let accepts: fn(f64) -> bool = $accepts;
                if accepts(value) {
                    return Ok($name(value as $inner));
                }
                Err(format!("{value} is out of range: expected {}", $expected))
            }
        }

        impl From<$name> for f64 {
            fn from(number: $name) -> f64 {
                number.0 as f64
            }
        }

        impl JsonSchema for $name {
            fn inline_schema() -> bool {
                true
            }

            fn schema_name() -> Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!($schema)
            }
        }
    };
}

ranged!(
    /// A number from 0 to 1.
    Probability, f64, |x| (0.0..=1.0).contains(&x), "a probability, 0 to 1",
    { "type": "number", "minimum": 0, "maximum": 1 }
);
ranged!(
    /// A finite number above zero.
    Positive, f64, |x| x > 0.0 && x.is_finite(), "a finite number above 0",
    { "type": "number", "exclusiveMinimum": 0 }
);
ranged!(
    /// A finite number that is not negative.
    NonNegative, f64, |x| x >= 0.0 && x.is_finite(), "a finite number, 0 or more",
    { "type": "number", "minimum": 0 }
);
ranged!(
    /// A whole number from 1 to a million.
    Count, u32, |x| (1.0..=1e6).contains(&x) && x.fract() == 0.0, "a whole number, 1 to 1,000,000",
    { "type": "integer", "minimum": 1, "maximum": 1_000_000 }
);

impl Default for NonNegative {
    fn default() -> Self {
        NonNegative(0.0)
    }
}

/// A constant known to lie in its range, for defaults.
macro_rules! constant {
    ($name:ident, $inner:ty) => {
        impl $name {
            pub(super) const fn constant(value: $inner) -> Self {
                $name(value)
            }
        }
    };
}
constant!(Probability, f64);
constant!(Positive, f64);
constant!(NonNegative, f64);
constant!(Count, u32);

impl Count {
    /// A default of the library.
    pub(super) fn of(value: usize) -> Self {
        Count(value as u32)
    }
}
