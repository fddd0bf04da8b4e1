//! How long errors take to fall back after a jump of the motion.

/// Scans that make up the level before a jump.
const BEFORE: usize = 10;

/// What is still the level: a fifth more.
const WITHIN: f64 = 1.2;

/// How many scans after the jump at scan `jump` a curve is back at its level before it (the mean of the ten scans up to the
/// jump), within 20 %, looking no further than scan `end`. Zero when it never leaves; `None` when it does not come back.
///
/// ```
/// use tercel_study::clutter::recovery;
///
/// let mut error = vec![10.0; 20];
/// error.extend([25.0, 30.0, 13.0, 11.0, 10.0]);
/// assert_eq!(recovery(&error, 19, 25), Some(4));
/// ```
pub fn recovery(curve: &[f64], jump: usize, end: usize) -> Option<usize> {
    let before = curve.get((jump + 1).saturating_sub(BEFORE)..=jump)?;
    let level = before.iter().sum::<f64>() / before.len() as f64;
    let after = curve.get(jump + 1..end.min(curve.len()))?;
    let last = after.iter().rposition(|value| *value > WITHIN * level).map_or(0, |place| place + 1);
    (last < after.len()).then_some(if last == 0 { 0 } else { last + 1 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_that_stays_needs_no_time_and_one_that_never_returns_has_none() {
        assert_eq!(recovery(&[10.0; 40], 19, 40), Some(0));
        let mut worse = vec![10.0; 20];
        worse.extend([13.0; 20]);
        assert_eq!(recovery(&worse, 19, 40), None);
        assert_eq!(recovery(&[], 19, 40), None);
    }
}
