//! Which column of a table is the time, and how its times are read: only many of its rows can tell.

use super::table::{Cell, Field, Names, Table, plain};
use crate::error::{DataError, Refusal};
use crate::options::{DateOrder, ReadOptions};
use crate::time::{Clock as Reader, Moment};
use crate::unit::Unit;

/// Reads the times of a table.
#[derive(Debug, Clone)]
pub(super) struct Clock {
    /// Name of the column with the times.
    pub column: String,
    pub notes: Vec<String>,
    reader: Reader,
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
            Moment::Slashed { first, second, .. } => {
                self.either += 1;
                self.day_first += u64::from(first > 12);
                self.month_first += u64::from(second > 12);
            }
            Moment::Number(number) => self.add_number(number),
            Moment::Instant(_) | Moment::Civil(_) | Moment::OfDay(_) => {}
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

    /// The order of day and month, if there are dates whose order is to be told; the error says why it cannot be.
    fn order(&self) -> Result<Option<DateOrder>, &'static str> {
        match (self.either, self.day_first, self.month_first) {
            (0, ..) => Ok(None),
            (_, 0, 0) => Err("every date in it could be read with the day or the month first"),
            (_, _, 0) => Ok(Some(DateOrder::DayFirst)),
            (_, 0, _) => Ok(Some(DateOrder::MonthFirst)),
            _ => Err("some of its dates begin with the day and some with the month"),
        }
    }
}

/// Rows that are looked at to tell the column and the unit of the times.
const SAMPLE: u64 = 1000;

/// Looks at a table, and further until the order of its dates is known.
///
/// # Errors
/// When there is no column of times, when the only one is the second of the minute, and when day and month cannot be told
/// apart in the whole file.
pub(super) fn settle(mut table: Table, names: &Names, options: &ReadOptions) -> Result<Clock, DataError> {
    let known: Vec<Field> = table.fields(names).collect();
    let fields: Vec<Field> = known.iter().cloned().chain(others(&table, &known)).collect();
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
    let Some(at) = chosen(&fields, &looks, known.len()) else {
        let mut pairs = known.iter().zip(&looks);
        return match pairs.find(|(field, look)| look.is_second_of_minute(&field.name)) {
            Some((field, _)) => Err(second_of_minute(&table, field)),
            None if known.is_empty() => Err(table.missing(&[names])),
            // Without a time in any row, all rows are left out and counted.
            None => Clock::new(&known[0], &Look::default(), None, options, &table),
        };
    };
    let (field, look) = (&fields[at], &mut looks[at]);
    if options.date_order.is_none() {
        while look.order().is_err() && advance(&mut table)? {
            if let Some(moment @ Moment::Slashed { .. }) = moment(&table, field) {
                look.add(moment);
            }
        }
    }
    let order =
        options.date_order.map_or_else(|| look.order(), |order| Ok(Some(order))).map_err(|problem| {
            let problem = format!("column `{}`: {problem}", field.name);
            let help = "say which it is: --date-order day-first or --date-order month-first";
            DataError::unsettled(table.whole(), problem, help)
        })?;
    let mut clock = Clock::new(field, look, order, options, &table)?;
    if at >= known.len() {
        clock.notes.insert(0, format!("the times are those of column `{}`", field.name));
    }
    Ok(clock)
}

/// The best column: the first with a known name that holds times, or one that sounds like times and holds dates or Unix times.
fn chosen(fields: &[Field], looks: &[Look], known: usize) -> Option<usize> {
    let usable = |at: usize| looks[at].read > 0 && !looks[at].is_second_of_minute(&fields[at].name);
    let plausible = |at: usize| looks[at].numbers == 0 || looks[at].largest > 1e8;
    let first = (0..known).find(|at| usable(*at));
    first.or_else(|| (known..fields.len()).find(|at| usable(*at) && plausible(*at)))
}

/// Columns whose names sound like times but are not known.
fn others(table: &Table, known: &[Field]) -> Vec<Field> {
    const SOUNDS: [&str; 4] = ["time", "date", "received", "utc"];
    let sounds = |name: &str| SOUNDS.iter().any(|sound| plain(name).contains(sound));
    let new = |field: &Field| known.iter().all(|known| known.name != field.name);
    table.columns().filter(|field| sounds(&field.name) && new(field)).collect()
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
        Cell::Text(text) => Moment::parse(&text),
        Cell::Number(number) => Some(Moment::Number(number)),
        Cell::Time(time) => Some(Moment::Instant(time)),
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
    fn new(
        field: &Field,
        look: &Look,
        order: Option<DateOrder>,
        options: &ReadOptions,
        table: &Table,
    ) -> Result<Self, DataError> {
        let mut notes = Vec::new();
        let mut time_unit = options.time_unit;
        if time_unit.is_none() && look.is_days() {
            time_unit = Some(Unit::Day);
            notes.push(format!("the times in column `{}` are read as days of a spreadsheet", field.name));
        }
        if let (Some(order), None) = (order, options.date_order) {
            let first = if order == DateOrder::DayFirst { "day" } else { "month" };
            notes.push(format!("the dates in column `{}` are read with the {first} first", field.name));
        }
        let options = ReadOptions { date_order: order, time_unit, ..options.clone() };
        let reader = Reader::new(&options, None, &table.whole().file)?;
        Ok(Clock { column: field.name.clone(), notes, reader })
    }

    /// The time of a row in Unix seconds.
    pub fn time(&mut self, table: &Table, field: &Field) -> Result<Option<f64>, DataError> {
        const EXPECTED: &str = "a time: Unix seconds, or a date and time such as 2016-01-12T13:02:11Z";
        let moment = match table.cell(field) {
            Cell::Nothing => return Ok(None),
            Cell::Time(time) => return Ok(Some(time)),
            Cell::Number(number) => Moment::Number(number),
            Cell::Text(text) => match Moment::parse(&text) {
                // The day of a time of day is not known.
                None | Some(Moment::OfDay(_)) => {
                    return Err(table.refuse(field, Refusal::new(format!("`{text}`"), EXPECTED)));
                }
                Some(moment) => moment,
            },
        };
        self.reader.seconds(moment, None).map(Some).map_err(|refusal| table.refuse(field, refusal))
    }
}
