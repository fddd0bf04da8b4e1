//! The parts of a sentence, and of what receivers and loggers put around it.

use crate::time::Moment;

/// A sentence whose checksum is right.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sentence<'a> {
    /// When it was received, Unix seconds.
    pub time: Option<f64>,
    /// Number of sentences of the message.
    pub count: u8,
    /// Number of this one, from 1.
    pub number: u8,
    /// Number of the message, which its sentences share.
    pub sequence: u8,
    pub channel: &'a str,
    pub payload: &'a str,
}

/// Where a sentence with a message of AIS begins in a line: at `!`, two letters of the talker, and `VDM,` or `VDO,`.
pub(in crate::import) fn sentence_in(line: &str) -> Option<usize> {
    line.match_indices('!').map(|(at, _)| at).find(|at| {
        let rest = &line.as_bytes()[at + 1..];
        matches!(rest, [a, b, b'V', b'D', b'M' | b'O', b',', ..]
            if a.is_ascii_alphanumeric() && b.is_ascii_alphanumeric())
    })
}

impl<'a> Sentence<'a> {
    /// Reads a line; the error is the reason why it is left out.
    pub fn read(line: &'a str) -> Result<Self, &'static str> {
        let begin = sentence_in(line).ok_or("a line without a sentence of AIS")?;
        let (before, sentence) = (&line[..begin], &line[begin + 1..]);
        let (body, after) = sentence.split_once('*').ok_or("a sentence without a checksum")?;
        let (sum, after) = after.split_at_checked(2).ok_or("a sentence without a checksum")?;
        if !checks(body, sum) {
            return Err("a sentence whose checksum is wrong");
        }
        let mut fields = body.split(',').skip(1);
        let mut next = || fields.next().ok_or("a sentence that lacks fields");
        let (count, number, sequence) = (next()?, next()?, next()?);
        let (channel, payload) = (next()?, next()?);
        let digit = |text: &str| text.parse().map_err(|_| "a sentence that lacks fields");
        Ok(Sentence {
            time: time_before(before)?.or_else(|| time_after(after)),
            count: digit(count)?,
            number: digit(number)?,
            sequence: sequence.parse().unwrap_or(u8::MAX),
            channel,
            payload,
        })
    }
}

/// The checksum is the exclusive or of all letters, in hexadecimal digits.
fn checks(body: &str, sum: &str) -> bool {
    let own = body.bytes().fold(0, |sum, byte| sum ^ byte);
    u8::from_str_radix(sum, 16).is_ok_and(|sum| sum == own)
}

/// The time in a tag block, or in front of the sentence.
fn time_before(before: &str) -> Result<Option<f64>, &'static str> {
    let Some(start) = before.find('\\') else {
        let parts = before.split([',', ';', '\t', '|']).chain(before.split(' '));
        return Ok(std::iter::once(before).chain(parts).find_map(moment));
    };
    let block = before[start..].trim_matches('\\');
    let (fields, sum) = block.rsplit_once('*').unwrap_or((block, ""));
    if !sum.is_empty() && !checks(fields, sum.get(..2).unwrap_or(sum)) {
        return Err("a tag block whose checksum is wrong");
    }
    Ok(fields.split(',').find_map(|field| moment(field.strip_prefix("c:")?)))
}

/// The time among the fields after the checksum: the last one that is a time.
fn time_after(after: &str) -> Option<f64> {
    after.split([',', ';', '\t']).rev().find_map(moment)
}

/// A time of receipt. Smaller numbers are counters and signal strengths, and a date alone is only a part of a time.
fn moment(text: &str) -> Option<f64> {
    const EARLIEST: f64 = 3e8;
    let text = text.trim_matches([' ', ',', ';', ':', '\t', '[', ']', '(', ')', '"', '|']);
    match Moment::parse(text)? {
        Moment::Number(number) => {
            Some(if number < 1e11 { number } else { number / 1e3 }).filter(|time| *time > EARLIEST)
        }
        Moment::Instant(time) | Moment::Civil(time) if text.contains([':', 'T', '_']) => Some(time),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BARE: &str = "!AIVDM,1,1,,A,13@ne9OP1p0kA@0P6LH1hP01P000,0*68";

    #[test]
    fn the_time_may_stand_in_a_tag_block_before_or_after() {
        for line in [
            "\\s:rx1,c:1709632800*07\\!AIVDM,1,1,,A,13@ne9OP1p0kA@0P6LH1hP01P000,0*68".to_owned(),
            format!("{BARE},1709632800"),
            format!("{BARE},s28089,d-101,T08.91033,r08SSGN1,1709632800"),
            format!("1709632800 {BARE}"),
            format!("1709632800000,{BARE}"),
            format!("2024-03-05T10:00:00Z,{BARE}"),
            format!("[2024-03-05 10:00:00] {BARE}"),
            format!("2024-03-05 10:00:00,rx1,{BARE}"),
            format!("rx1 1709632800: {BARE}"),
        ] {
            let sentence = Sentence::read(&line).unwrap();
            assert_eq!(sentence.time, Some(1_709_632_800.0), "{line}");
            assert_eq!(sentence.payload, "13@ne9OP1p0kA@0P6LH1hP01P000");
        }
        assert_eq!(Sentence::read(BARE).unwrap().time, None);
    }

    #[test]
    fn what_is_damaged_is_left_out_with_the_reason() {
        for (line, reason) in [
            ("$GPGGA,1*00", "a line without a sentence of AIS"),
            ("!AIVDM,1,1,,A,13@ne9OP1p0kA@0P6LH1hP01P000,0*69", "a sentence whose checksum is wrong"),
            ("!AIVDM,1,1,,A,13@ne9OP1p0kA@", "a sentence without a checksum"),
            ("\\c:1709632801*07\\!AIVDM,1,1,,A,13,0*00", "a sentence whose checksum is wrong"),
        ] {
            assert_eq!(Sentence::read(line).unwrap_err(), reason, "{line}");
        }
        let tampered = format!("\\s:rx1,c:1709632801*07\\{BARE}");
        assert_eq!(Sentence::read(&tampered).unwrap_err(), "a tag block whose checksum is wrong");
    }
}
