//! What came in and was not used.

use std::borrow::Cow;

use serde_json::{Value, json};
use tercel_data::LeftOut;

use crate::console::Console;
use crate::summary::{count, counted};

/// Rows that were left out, by reason.
#[derive(Debug, Clone, Default)]
pub struct Account {
    reasons: Vec<(Cow<'static, str>, u64)>,
}

impl Account {
    /// What a reader left out.
    pub fn of(left_out: Vec<LeftOut>) -> Self {
        let mut account = Account::default();
        for LeftOut { reason, rows } in left_out {
            account.add(reason, rows as u64);
        }
        account
    }

    /// Adds rows that were left out for a reason, a sentence part: `a repeated position`.
    pub fn add(&mut self, reason: impl Into<Cow<'static, str>>, rows: u64) {
        let reason = reason.into();
        match self.reasons.iter_mut().find(|(known, _)| *known == reason) {
            _ if rows == 0 => {}
            Some((_, known)) => *known += rows,
            None => self.reasons.push((reason, rows)),
        }
    }

    /// `12 rows: a repeated position (10), a scan that came too late (2)`; nothing when all was used.
    pub fn sentence(&self) -> Option<String> {
        let rows = self.reasons.iter().map(|(_, rows)| rows).sum();
        let reasons: Vec<String> =
            self.reasons.iter().map(|(reason, rows)| format!("{reason} ({})", count(*rows))).collect();
        (rows > 0).then(|| format!("{}: {}", counted(rows, "row"), reasons.join(", ")))
    }

    /// Every reason with its rows.
    pub fn json(&self) -> Value {
        self.reasons.iter().map(|(reason, rows)| json!({"reason": reason, "rows": rows})).collect()
    }

    /// Says in one line what was left out to those who asked for no other notes: silence must not hide a loss.
    pub fn say_briefly(&self, console: &Console) {
        if let Some(sentence) = self.sentence() {
            console.brief(format_args!("left out {sentence}"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_one_reason_are_added() {
        let mut account = Account::default();
        assert_eq!(account.sentence(), None);
        account.add("a repeated position", 1200);
        account.add("a scan that came too late", 0);
        account.add("a repeated position", 34);
        account.add("a scan that came too late", 2);
        let sentence = account.sentence().unwrap();
        assert_eq!(sentence, "1,236 rows: a repeated position (1,234), a scan that came too late (2)");
        assert_eq!(account.json()[1], json!({"reason": "a scan that came too late", "rows": 2}));
    }
}
