//! Numbers as short as their precision allows.

use std::io::Write;

use super::write_number;
use crate::column::Written;

/// Writes a number with the precision of its column. What is rounded once stays the same when it is rounded again.
pub(crate) fn write_rounded(number: f64, written: Written, text: &mut Vec<u8>) -> std::io::Result<()> {
    /// Above it the digits before the point say all, and below its inverse zeros would.
    const PLAIN: std::ops::Range<f64> = 1e-5..1e15;
    let magnitude = number.abs();
    let plain = PLAIN.contains(&magnitude);
    let decimals = match written {
        Written::Decimals(decimals) if magnitude < PLAIN.end => decimals,
        Written::Digits { digits, decimals } if plain => {
            let before = magnitude.log10().floor() as i64 + 1;
            decimals.max(usize::try_from(digits as i64 - before).unwrap_or(0))
        }
        Written::Digits { digits, .. } if magnitude.is_normal() && magnitude < PLAIN.start => {
            return write_power(number, digits, text);
        }
        _ => return write_number(number, text),
    };
    let start = text.len();
    write!(text, "{number:.decimals$}")?;
    if decimals > 0 {
        trim(text, start);
    }
    if &text[start..] == b"-0" {
        text.remove(start);
    }
    Ok(())
}

/// Writes a number with its power of ten.
fn write_power(number: f64, digits: usize, text: &mut Vec<u8>) -> std::io::Result<()> {
    let start = text.len();
    write!(text, "{number:.*e}", digits.saturating_sub(1))?;
    let power = text[start..].iter().position(|byte| *byte == b'e').map_or(text.len(), |at| start + at);
    let tail = text.split_off(power);
    if digits > 1 {
        trim(text, start);
    }
    text.extend(tail);
    Ok(())
}

/// Removes zeros at the end of the decimals that begin after `start`.
fn trim(text: &mut Vec<u8>, start: usize) {
    let zeros = text[start..].iter().rev().take_while(|byte| **byte == b'0').count();
    text.truncate(text.len() - zeros);
    if text.last() == Some(&b'.') {
        text.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rounded(number: f64, written: Written) -> String {
        let mut text = b"1,".to_vec();
        write_rounded(number, written, &mut text).unwrap();
        String::from_utf8(text.split_off(2)).unwrap()
    }

    #[test]
    fn digits_count_from_the_first_that_is_not_zero() {
        let seven = Written::Digits { digits: 7, decimals: 0 };
        for (number, text) in [
            (12.345_678_91, "12.34568"),
            (0.001_234_567_89, "0.001234568"),
            (1.0 / 3.0 * 1e-9, "3.333333e-10"),
            (2e-9, "2e-9"),
            (123_456_789.4, "123456789"),
            (9.999_999_96, "10"),
            (-0.25, "-0.25"),
            (100.0, "100"),
            (0.0, "0"),
            (1.234e22, "1.234e22"),
            (1e-310, "1e-310"),
        ] {
            assert_eq!(rounded(number, seven), text);
        }
        assert_eq!(rounded(123_456.789_012, Written::Digits { digits: 7, decimals: 4 }), "123456.789");
    }

    #[test]
    fn decimals_count_from_the_point() {
        for (number, text) in
            [(12.345_678_951, "12.345679"), (0.000_000_4, "0"), (-0.000_000_4, "0"), (1e300, "1e300")]
        {
            assert_eq!(rounded(number, Written::Decimals(6)), text);
        }
        assert_eq!(rounded(1200.0, Written::Decimals(0)), "1200");
    }

    #[test]
    fn what_is_written_exactly_keeps_its_bits() {
        assert_eq!(rounded(0.1 + 0.2, Written::Exactly), "0.30000000000000004");
    }
}
