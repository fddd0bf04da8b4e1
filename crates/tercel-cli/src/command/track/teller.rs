//! What is told while tracking goes on, at a bounded rate.

use std::collections::HashMap;
use std::mem::{Discriminant, discriminant};

use tercel_pipeline::Notice;

use crate::console::Console;

/// Prints notices: of each kind the first three, and then the tenth, the hundredth and so on, with their number.
#[derive(Debug, Default)]
pub struct Teller {
    told: HashMap<Discriminant<Notice>, u64>,
}

/// Notices of a kind that are all printed.
const FEW: u64 = 3;

impl Teller {
    /// Prints what has not been printed often enough.
    pub fn tell(&mut self, notices: Vec<Notice>, console: &Console) {
        for notice in notices {
            let told = self.told.entry(discriminant(&notice)).or_default();
            *told += 1;
            match *told {
                few if few <= FEW => say(&notice, "", console),
                many if is_power_of_ten(many) => say(&notice, &format!(" (the {many}th such)"), console),
                _ => {}
            }
        }
    }
}

fn say(notice: &Notice, count: &str, console: &Console) {
    if notice.is_warning() {
        console.warn(format_args!("{notice}{count}"));
    } else {
        console.note(format_args!("{notice}{count}"));
    }
}

fn is_power_of_ten(number: u64) -> bool {
    number >= 10 && 10_u64.pow(number.ilog10()) == number
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_hundred_and_thousand_are_powers_of_ten() {
        let powers: Vec<u64> = (0..2000).filter(|number| is_power_of_ten(*number)).collect();
        assert_eq!(powers, [10, 100, 1000]);
    }
}
