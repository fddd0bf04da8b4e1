//! How the times of a table are to be read, which only many of its rows can tell.

use super::table::{Cell, Field, Names, Table, plain};
use super::time::{DateOrder, Moment, seconds};
use crate::error::{DataError, Refusal};

/// Reads the times of a table.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Clock {
    /// Name of the column with the times.
    pub column: String,
    order: Option<DateOrder>,
    /// Numbers are days of a spreadsheet.
    days: bool,
    pub notes: Vec<String>,
}

/// What one column of times holds.
#[derive(Debug, Default)]
struct Look {
    read: u64,
    numbers: u64,
    /// Dates that begin with the day or the month; of these, those where only one reading is a date.
    either: u64,
    day_first: u64,
    month_first: u64,
    smallest: f64,
    largest: f64,
    fractions: u64,
    /// How often the numbers fall by more than half a minute.
    falls: u64,
    last: f64,
}

impl Look {
    fn add(&mut self, moment: Moment) {
        self.read += 1;
        match moment {
            Moment::Date(_) => {}
            Moment::Either { day_first, month_first } => {
                self.either += 1;
                self.day_first += u64::from(month_first.is_none());
                self.month_first += u64::from(day_first.is_none());
            }
            Moment::Number(number) => self.add_number(number),
        }
    }

    fn add_number(&mut self, number: f64) {
        if self.numbers == 0 {
            (self.smallest, self.largest, self.last) = (number, number, number);
        }
        self.numbers += 1;
        self.fractions += u64::from(number.fract() != 0.0);
        self.falls += u64::from(self.last - number > 30.0);
        (self.smallest, self.largest) = (self.smallest.min(number), self.largest.max(number));
        self.last = number;
    }

    /// True for seconds of the minute, which AIS messages carry: 0 to 59, and 60 to 63 for "not available".
    fn is_second_of_minute(&self, name: &str) -> bool {
        let small = self.numbers > 0
            && self.numbers == self.read
            && self.fractions == 0
            && self.smallest >= 0.0
            && self.largest <= 63.0;
        // A column that is called `time` may begin at 0, but not again and again.
        small && (plain(name).contains("second") || plain(name).contains("timestamp") || self.falls > 1)
    }

    /// True for days since 1900 as spreadsheets count them, of 1970 to 2070.
    fn is_days(&self) -> bool {
        self.numbers > 1
            && self.numbers == self.read
            && self.fractions > 0
            && self.smallest > 25_569.0
            && self.largest < 62_500.0
            && self.largest - self.smallest < 400.0
    }

    fn has_order(&self) -> bool {
        self.either == 0 || self.day_first + self.month_first > 0
    }
}

/// Rows that are looked at to tell the column and the unit of the times.
const SAMPLE: u64 = 1000;

/// Looks at a table, and further until the order of its dates is known.
///
/// # Errors
/// When there is no column of times, when the only one is the second of the minute, and when day and month cannot be told
/// apart in the whole file.
pub(super) fn settle(mut table: Table, names: &Names, order: Option<DateOrder>) -> Result<Clock, DataError> {
    let fields: Vec<Field> = table.fields(names).chain(others(&table)).collect();
    let known = table.fields(names).count();
    let mut looks: Vec<Look> = fields.iter().map(|_| Look::default()).collect();
    let mut rows = 0;
    while rows < SAMPLE && advance(&mut table)? {
        rows += 1;
        for (field, look) in fields.iter().zip(&mut looks) {
            if let Some(moment) = moment(&table, field) {
                look.add(moment);
            }
        }
    }
    let usable = |(field, look): &(&Field, &Look)| look.read > 0 && !look.is_second_of_minute(&field.name);
    let plausible = |(_, look): &(&Field, &Look)| look.numbers == 0 || look.largest > 1e8;
    let pairs = || fields.iter().zip(&looks);
    let chosen = pairs().take(known).position(|pair| usable(&pair)).or_else(|| {
        pairs().skip(known).position(|pair| usable(&pair) && plausible(&pair)).map(|at| at + known)
    });
    let Some(at) = chosen else {
        return match pairs().take(known).find(|(field, look)| look.is_second_of_minute(&field.name)) {
            Some((field, _)) => Err(second_of_minute(&table, field)),
            // Without a time in any row, all rows are left out and counted.
            None if known > 0 => Ok(Clock::plain(&fields[0].name)),
            None => Err(table.missing(&[names])),
        };
    };
    let (field, look) = (&fields[at], &mut looks[at]);
    while order.is_none() && !look.has_order() && advance(&mut table)? {
        if let Some(moment @ Moment::Either { .. }) = moment(&table, field) {
            look.add(moment);
        }
    }
    Clock::of(field, look, order, at >= known).map_err(|problem| {
        let problem = format!("column `{}`: {problem}", field.name);
        let help = "say which it is: --date-order day-first or --date-order month-first";
        DataError::unsettled(table.whole(), problem, help)
    })
}

/// Columns whose names sound like times but are not known.
fn others(table: &Table) -> Vec<Field> {
    const SOUNDS: [&str; 4] = ["time", "date", "received", "utc"];
    let sounds = |name: &str| SOUNDS.iter().any(|sound| plain(name).contains(sound));
    table.columns().filter(|field| sounds(&field.name)).collect()
}

/// Goes on to the next row, past those that cannot be read: they are refused or counted later.
fn advance(table: &mut Table) -> Result<bool, DataError> {
    loop {
        match table.advance() {
            Err(DataError::Row { .. }) => {}
            other => return other,
        }
    }
}

fn moment(table: &Table, field: &Field) -> Option<Moment> {
    match table.cell(field) {
        Cell::Nothing => None,
        Cell::Text(text) => Moment::read(&text),
        Cell::Number(number) => Some(Moment::Number(number)),
        Cell::Time(time) => Some(Moment::Date(time)),
    }
}

fn second_of_minute(table: &Table, field: &Field) -> DataError {
    DataError::unsettled(
        table.whole(),
        format!(
            "column `{}` is the second of the minute, 0 to 59, and no other column is a time",
            field.name
        ),
        "write the file with the time at which each report was received, in a column `time`",
    )
}

impl Clock {
    fn plain(column: &str) -> Self {
        Clock { column: column.to_owned(), order: None, days: false, notes: Vec::new() }
    }

    fn of(field: &Field, look: &Look, order: Option<DateOrder>, other: bool) -> Result<Self, String> {
        let mut clock = Clock { order, ..Clock::plain(&field.name) };
        if other {
            clock.notes.push(format!("the times are those of column `{}`", field.name));
        }
        if look.is_days() {
            clock.days = true;
            clock
                .notes
                .push(format!("the times in column `{}` are read as days of a spreadsheet", field.name));
        }
        if order.is_none() && look.either > 0 {
            clock.order = match (look.day_first, look.month_first) {
                (0, 0) => {
                    return Err("every date in it could be read with the day or the month first".to_owned());
                }
                (_, 0) => Some(DateOrder::DayFirst),
                (0, _) => Some(DateOrder::MonthFirst),
                _ => return Err("some of its dates begin with the day and some with the month".to_owned()),
            };
            let first = if clock.order == Some(DateOrder::DayFirst) { "day" } else { "month" };
            clock.notes.push(format!("the dates in column `{}` are read with the {first} first", field.name));
        }
        Ok(clock)
    }

    /// The time of a row in Unix seconds.
    pub fn time(&self, table: &Table, field: &Field) -> Result<Option<f64>, DataError> {
        let read = match table.cell(field) {
            Cell::Nothing => return Ok(None),
            Cell::Time(time) => Some(time),
            Cell::Number(number) => Some(self.of_number(number)),
            Cell::Text(text) => match Moment::read(&text) {
                Some(Moment::Date(time)) => Some(time),
                Some(Moment::Number(number)) => Some(self.of_number(number)),
                Some(Moment::Either { month_first, .. }) if self.order == Some(DateOrder::MonthFirst) => {
                    month_first
                }
                Some(Moment::Either { day_first, .. }) => day_first,
                None => None,
            },
        };
        read.map(Some).ok_or_else(|| {
            let text = table.text(field).unwrap_or_default();
            table.refuse(field, Refusal::new(format!("`{text}`"), self.expected()))
        })
    }

    fn of_number(&self, number: f64) -> f64 {
        /// 1 January 1970 in days of a spreadsheet.
        const EPOCH: f64 = 25_569.0;
        if self.days { (number - EPOCH) * 86_400.0 } else { seconds(number) }
    }

    fn expected(&self) -> &'static str {
        match self.order {
            None => "a time: Unix seconds, or a date and time such as 2016-01-12T13:02:11Z",
            Some(DateOrder::DayFirst) => "a date and time with the day first, such as 31/12/2019 23:59:58",
            Some(DateOrder::MonthFirst) => {
                "a date and time with the month first, such as 12/31/2019 23:59:58"
            }
        }
    }
}
