//! Names of columns without what does not matter, and the unit that stands in them.

/// A name as it stands in a file, taken apart.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Plain {
    /// Possible plain forms, with the unit that the name would hold then. The first that is known counts.
    pub readings: Vec<(String, Option<String>)>,
    /// The unit stands in brackets, so that it is one for sure.
    pub bracketed: Option<String>,
}

impl Plain {
    /// `Range (NM)`, `range_nm`, `rangeRate`, `# Timestamp`: lower case, words joined by `_`, and the unit.
    pub fn of(name: &str) -> Self {
        let (name, bracketed) = without_brackets(name.trim().trim_start_matches('#').trim());
        let mut readings: Vec<(String, Option<String>)> = Vec::new();
        for plain in [snake(name, false), snake(name, true)] {
            if readings.iter().any(|(known, _)| *known == plain) {
                continue;
            }
            let words: Vec<&str> = plain.split('_').collect();
            readings.push((plain.clone(), None));
            // The unit is one word or two: `speed_kn`, `range_rate_m_s`.
            for count in [1, 2] {
                if bracketed.is_none() && words.len() > count {
                    let (name, unit) = words.split_at(words.len() - count);
                    readings.push((name.join("_"), Some(unit.join("_"))));
                }
            }
        }
        Plain { readings, bracketed }
    }
}

/// `lat [deg]` as `lat` and `deg`.
fn without_brackets(name: &str) -> (&str, Option<String>) {
    let pair = [('(', ')'), ('[', ']'), ('{', '}')].into_iter().find_map(|(open, close)| {
        let inner = name.strip_suffix(close)?;
        let at = inner.rfind(open)?;
        Some((name[..at].trim_end(), inner[at + open.len_utf8()..].trim().to_owned()))
    });
    match pair {
        Some((name, unit)) if !name.is_empty() && !unit.is_empty() => (name, Some(unit)),
        _ => (name, None),
    }
}

/// Lower case with `_` between words; with `camel`, words may begin with a capital: `posX`.
fn snake(name: &str, camel: bool) -> String {
    let mut plain = String::new();
    let mut before = ' ';
    for c in name.chars() {
        let begins = camel && c.is_uppercase() && (before.is_lowercase() || before.is_ascii_digit());
        let joins = !c.is_alphanumeric() && c != '°' && c != 'µ';
        if (begins || joins) && !plain.is_empty() && !plain.ends_with('_') {
            plain.push('_');
        }
        if !joins {
            plain.extend(c.to_lowercase());
        }
        before = c;
    }
    plain.trim_end_matches('_').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn readings(name: &str) -> Vec<(String, Option<String>)> {
        Plain::of(name).readings
    }

    #[test]
    fn names_are_compared_without_decoration() {
        for (name, plain) in [
            ("# Timestamp", "timestamp"),
            ("Range Rate", "range_rate"),
            ("rangeRate", "range_rate"),
            ("posX", "pos_x"),
            ("MMSI", "mmsi"),
            ("BaseDateTime", "base_date_time"),
            ("Latitude (deg)", "latitude"),
        ] {
            assert!(readings(name).contains(&(plain.to_owned(), None)), "{name}: {:?}", readings(name));
        }
    }

    #[test]
    fn units_stand_in_brackets_or_at_the_end() {
        assert_eq!(Plain::of("Range (NM)").bracketed.as_deref(), Some("NM"));
        assert_eq!(Plain::of("speed [m/s]").bracketed.as_deref(), Some("m/s"));
        assert!(readings("range_nm").contains(&("range".to_owned(), Some("nm".to_owned()))));
        assert!(readings("range_rate_m_s").contains(&("range_rate".to_owned(), Some("m_s".to_owned()))));
    }
}
