//! What sends AIS messages: ships, and what is none.

/// A kind of station.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Station {
    /// A ship, or something else that floats and moves.
    Ship,
    Base,
    Aid,
    Aircraft,
}

impl Station {
    /// The kind that a number (MMSI) tells: 00 and a country begins that of a base station, 99 and a country that of an aid
    /// to navigation, 111 and a country that of an aircraft.
    pub fn of_number(number: &str) -> Self {
        // Programs that store numbers drop the zeros in front.
        match number.parse::<u64>() {
            Ok(2_010_000..=7_759_999) => Station::Base,
            Ok(992_010_000..=997_759_999) => Station::Aid,
            Ok(111_201_000..=111_775_999) => Station::Aircraft,
            _ => Station::Ship,
        }
    }

    /// The kind that the number of a message tells.
    pub fn of_message(message: u64) -> Self {
        match message {
            4 => Station::Base,
            9 => Station::Aircraft,
            21 => Station::Aid,
            _ => Station::Ship,
        }
    }

    /// The kind that a word tells: `Base Station`, `AtoN`, `SAR Airborne`; `Class A` and the like are ships.
    pub fn of_kind(kind: &str) -> Self {
        let begins =
            |word: &str| kind.get(..word.len()).is_some_and(|start| start.eq_ignore_ascii_case(word));
        if begins("class") || kind.len() < 3 {
            Station::Ship
        } else if begins("base") {
            Station::Base
        } else if begins("aton") || begins("aid") || begins("navaid") {
            Station::Aid
        } else if begins("sar air") || begins("sarair") || begins("airborne") {
            Station::Aircraft
        } else {
            Station::Ship
        }
    }

    /// Why its reports are left out.
    pub fn reason(self) -> Option<&'static str> {
        match self {
            Station::Ship => None,
            Station::Base => Some("a base station, which is no ship (--all-stations keeps it)"),
            Station::Aid => Some("an aid to navigation, which is no ship (--all-stations keeps it)"),
            Station::Aircraft => Some("an aircraft, which is no ship (--all-stations keeps it)"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_words_and_messages_tell_what_is_no_ship() {
        for number in ["002190017", "2190017"] {
            assert_eq!(Station::of_number(number), Station::Base);
        }
        assert_eq!(Station::of_number("992191234"), Station::Aid);
        assert_eq!(Station::of_number("111219501"), Station::Aircraft);
        for number in ["219000101", "1", "970123456", "ship"] {
            assert_eq!(Station::of_number(number), Station::Ship);
        }
        for (word, station) in [
            ("Base Station", Station::Base),
            ("AtoN", Station::Aid),
            ("SAR Airborne", Station::Aircraft),
            ("Class A", Station::Ship),
            ("A", Station::Ship),
            ("Search and Rescue Transponder", Station::Ship),
        ] {
            assert_eq!(Station::of_kind(word), station, "{word}");
        }
    }
}
