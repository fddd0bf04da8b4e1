//! What the keys of objects mean, and rows from objects.

use std::collections::HashMap;

use serde_json::{Map, Value};

use super::passed_over;
use crate::column::{Column, Conversion};
use crate::error::{DataError, Place, Refusal};
use crate::layout::{missing_columns, near_miss};
use crate::names::{BOTH_PLACES, GEOGRAPHIC, Meaning, Naming};
use crate::options::ReadOptions;
use crate::sheet::{Sheet, Values};
use crate::unit::Unit;

/// Keys under which lists of detections go; the first is our own.
const LISTS: [&str; 16] = [
    "detections",
    "objects",
    "targets",
    "plots",
    "points",
    "measurements",
    "reports",
    "contacts",
    "returns",
    "tracks",
    "observations",
    "aircraft",
    "vessels",
    "items",
    "dets",
    "data",
];

/// Keys of objects and arrays that hold a position.
const PLACES: [&str; 7] = ["position", "pos", "location", "point", "xy", "xyz", "geo"];

/// What a whole scan says once for all of its detections.
const SHARED: [&str; 10] = [
    "time",
    "sensor",
    "scan",
    "sensor_x",
    "sensor_y",
    "sensor_z",
    "sensor_vx",
    "sensor_vy",
    "sensor_vz",
    "detection",
];

const MEASURED: [&str; 8] = ["x", "y", "z", "latitude", "longitude", "range", "bearing", "range_rate"];

/// A stream with more strange keys than this is not worth remembering.
const REMEMBERED: usize = 256;

/// The meanings of the keys that were seen so far.
#[derive(Debug)]
pub(crate) struct Keys {
    naming: Naming,
    known: HashMap<String, Option<Meaning>>,
    /// Objects may hold a list of rows.
    lists: bool,
    list: Option<String>,
    unused: Vec<String>,
    notes: Vec<String>,
    time_unit: Option<Unit>,
}

/// A value for a column.
#[derive(Clone, Copy)]
struct Slot<'v> {
    value: &'v Value,
    conversion: Conversion,
    meaning: &'v str,
}

/// How many rows an object gave, and whether they are a whole scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Taken {
    pub rows: usize,
    pub whole: bool,
}

impl Keys {
    pub fn new(naming: Naming, lists: bool, options: &ReadOptions) -> Self {
        Keys {
            naming,
            known: HashMap::new(),
            lists,
            list: options.list.clone(),
            unused: Vec::new(),
            notes: Vec::new(),
            time_unit: None,
        }
    }

    /// From now on the keys are those of our own tables.
    pub fn describe(&mut self, naming: Naming) {
        self.naming = naming;
        self.known.clear();
    }

    /// The unit that the key of the time names.
    pub fn time_unit(&self) -> Option<Unit> {
        if self.naming.ours() { Some(Unit::Second) } else { self.time_unit }
    }

    /// What the user should know about the keys.
    pub fn notes(&self) -> Vec<String> {
        let ours = self.naming.ours();
        self.notes.iter().cloned().chain(passed_over(&self.unused).filter(|_| !ours)).collect()
    }

    /// Appends the rows of an object, all of them or none.
    pub fn take(
        &mut self,
        object: &Map<String, Value>,
        place: &Place,
        sheet: &mut Sheet,
    ) -> Result<Taken, DataError> {
        let before = sheet.len();
        let taken = self.take_all(object, place, sheet);
        if taken.is_err() {
            sheet.truncate(before);
        }
        taken
    }

    fn take_all(
        &mut self,
        object: &Map<String, Value>,
        place: &Place,
        sheet: &mut Sheet,
    ) -> Result<Taken, DataError> {
        self.learn(object, "", place)?;
        let list = self.list_of(object, place)?;
        let mut slots = vec![None; self.naming.columns().len()];
        self.fill(object, "", &mut slots, place)?;
        let Some((key, list)) = list else {
            self.check_measured(object, &slots, place)?;
            self.prefer_local(&mut slots);
            self.push(&slots, object, place, sheet)?;
            return Ok(Taken { rows: 1, whole: false });
        };
        if key != LISTS[0] {
            self.remember_note(format!("the detections are taken from the list `{key}`"));
        }
        for (slot, column) in slots.iter_mut().zip(self.naming.columns()) {
            if !SHARED.contains(&column.name.as_ref()) {
                *slot = None;
            }
        }
        for element in list {
            let Value::Object(detection) = element else {
                let problem = format!("`{key}` holds what is no object");
                return Err(DataError::Row { place: place.clone(), problem, help: "give a list of objects" });
            };
            self.learn(detection, "", place)?;
            let mut slots = slots.clone();
            self.fill(detection, "", &mut slots, place)?;
            if !self.measured(&slots).any(|value| !value.is_null()) {
                return Err(self.nowhere(detection, place, "a detection has no measurement"));
            }
            self.prefer_local(&mut slots);
            self.push(&slots, object, place, sheet)?;
        }
        if list.is_empty() {
            self.push(&slots, object, place, sheet)?;
        }
        Ok(Taken { rows: list.len().max(1), whole: true })
    }

    /// Finds out what the keys mean that were not there before.
    fn learn(&mut self, object: &Map<String, Value>, outer: &str, place: &Place) -> Result<(), DataError> {
        for (key, value) in object {
            if let (Value::Object(inner), true) = (value, outer.is_empty() && !self.naming.ours()) {
                self.learn(inner, key, place)?;
            }
            if self.known.contains_key(joined(outer, key).as_ref()) {
                continue;
            }
            let name = joined(outer, key).into_owned();
            let meaning = self
                .meaning_of(outer, key)
                .map_err(|(problem, help)| DataError::unsettled(place.clone(), problem, help))?;
            match &meaning {
                Some(meaning) => {
                    self.time_unit = self.time_unit.or(meaning.time_unit);
                    if let Some(note) = meaning.note.clone() {
                        self.remember_note(note);
                    }
                }
                None => self.pass_over(&name, key, value, place)?,
            }
            if self.known.len() < REMEMBERED * 4 {
                self.known.insert(name, meaning);
            }
        }
        Ok(())
    }

    fn meaning_of(&self, outer: &str, key: &str) -> Result<Option<Meaning>, crate::names::Trouble> {
        match self.naming.meaning(&joined(outer, key))? {
            None if PLACES.contains(&outer) => self.naming.meaning(key),
            meaning => Ok(meaning),
        }
    }

    /// Remembers a key that means nothing; refuses one that is almost known: without it a line may look like an empty scan.
    fn pass_over(&mut self, name: &str, key: &str, value: &Value, place: &Place) -> Result<(), DataError> {
        let holds_more =
            value.is_object() || (value.is_array() && (self.is_list(key) || PLACES.contains(&key)));
        if holds_more || key == LISTS[0] || self.naming.ignores(name) {
            return Ok(());
        }
        if let Some(error) = near_miss(key, self.naming.columns(), || place.clone()) {
            return Err(error);
        }
        if self.unused.len() < REMEMBERED {
            self.unused.push(name.to_owned());
        }
        Ok(())
    }

    fn remember_note(&mut self, note: String) {
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    fn is_list(&self, key: &str) -> bool {
        match &self.list {
            Some(list) => list == key,
            None => self.lists && LISTS.contains(&key),
        }
    }

    /// The list of detections of an object, with its key.
    fn list_of<'v>(
        &self,
        object: &'v Map<String, Value>,
        place: &Place,
    ) -> Result<Option<(&'v str, &'v [Value])>, DataError> {
        if !self.lists {
            return Ok(None);
        }
        let wanted = self.list.as_deref().unwrap_or(LISTS[0]);
        let key = object.keys().find(|key| *key == wanted).or_else(|| {
            let named = |key: &&String| {
                self.is_list(key)
                    && object[*key].as_array().is_some_and(|list| list.iter().all(Value::is_object))
            };
            object.keys().find(named)
        });
        match key.map(|key| (key, &object[key])) {
            None => Ok(None),
            Some((key, Value::Array(list))) => Ok(Some((key, list))),
            Some((key, _)) => Err(DataError::Row {
                place: place.clone(),
                problem: format!("`{key}` is no list"),
                help: "give a list of objects, possibly empty",
            }),
        }
    }

    /// Puts the values of an object where their columns are.
    fn fill<'v>(
        &self,
        object: &'v Map<String, Value>,
        outer: &str,
        slots: &mut [Option<Slot<'v>>],
        place: &Place,
    ) -> Result<(), DataError> {
        let mut ranks = vec![None; slots.len()];
        for (key, value) in object {
            let Some(meaning) = self.known.get(joined(outer, key).as_ref()).and_then(Option::as_ref) else {
                if outer.is_empty() && !self.naming.ours() {
                    self.fill_nested(key, value, slots, place)?;
                }
                continue;
            };
            let before = ranks[meaning.column]
                .filter(|_| slots[meaning.column].is_some_and(|slot: Slot<'_>| !slot.value.is_null()));
            match before {
                Some((rank, other)) if !value.is_null() && meaning.clashes(rank) => {
                    let (problem, help) = self.naming.twice(other, key, meaning.column);
                    return Err(DataError::unsettled(place.clone(), problem, help));
                }
                Some((rank, _)) if value.is_null() || meaning.rank() >= rank => {}
                _ => {
                    ranks[meaning.column] = Some((meaning.rank(), key.as_str()));
                    slots[meaning.column] =
                        Some(Slot { value, conversion: meaning.conversion, meaning: key });
                }
            }
        }
        Ok(())
    }

    /// `{"position": {"x": 1, "y": 2}}` and `{"position": [1, 2]}`.
    fn fill_nested<'v>(
        &self,
        key: &'v str,
        value: &'v Value,
        slots: &mut [Option<Slot<'v>>],
        place: &Place,
    ) -> Result<(), DataError> {
        match value {
            Value::Object(inner) => self.fill(inner, key, slots, place),
            Value::Array(numbers)
                if PLACES.contains(&key) && key != "geo" && numbers.iter().all(Value::is_number) =>
            {
                for (name, number) in ["x", "y", "z"].iter().zip(numbers) {
                    if let Some(at) = self.naming.columns().iter().position(|column| column.name == *name) {
                        slots[at] = Some(Slot { value: number, conversion: Conversion::NONE, meaning: key });
                    }
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn measured<'v>(&self, slots: &[Option<Slot<'v>>]) -> impl Iterator<Item = &'v Value> {
        let columns = self.naming.columns().iter().zip(slots);
        columns
            .filter(|(column, _)| MEASURED.contains(&column.name.as_ref()))
            .filter_map(|(_, slot)| slot.map(|slot| slot.value))
    }

    /// Forgets a position on the Earth beside one in the local frame or a bearing.
    fn prefer_local(&mut self, slots: &mut [Option<Slot<'_>>]) {
        let columns = self.naming.columns();
        let at = |name: &str| columns.iter().position(|column| column.name == name);
        let known = |name: &str| {
            at(name).and_then(|at| slots.get(at).copied().flatten()).is_some_and(|slot| !slot.value.is_null())
        };
        let both = known("latitude") && ((known("x") && known("y")) || known("bearing"));
        if both {
            for at in GEOGRAPHIC.iter().filter_map(|name| at(name)).collect::<Vec<_>>() {
                slots[at] = None;
            }
            self.remember_note(BOTH_PLACES.to_owned());
        }
    }

    /// Refuses an object that seems to say more than that nothing was seen.
    fn check_measured(
        &self,
        object: &Map<String, Value>,
        slots: &[Option<Slot<'_>>],
        place: &Place,
    ) -> Result<(), DataError> {
        if !self.lists || self.naming.ours() || self.measured(slots).next().is_some() {
            return Ok(());
        }
        let says_more = object.keys().any(|key| match self.known.get(key).and_then(Option::as_ref) {
            Some(meaning) => !SHARED.contains(&self.naming.columns()[meaning.column].name.as_ref()),
            None => !self.naming.ignores(key),
        });
        if says_more { Err(self.nowhere(object, place, "no key holds a position")) } else { Ok(()) }
    }

    fn nowhere(&self, object: &Map<String, Value>, place: &Place, problem: &str) -> DataError {
        let names = |object: &Map<String, Value>| {
            object.keys().map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", ")
        };
        let list = object
            .iter()
            .find(|(_, value)| value.as_array().is_some_and(|list| list.iter().any(Value::is_object)));
        let help = match list {
            Some((key, _)) => format!("`{key}` holds a list of objects: --list {key}"),
            None => "say which keys hold it: --column x=KEY --column y=KEY \
                     (or range and bearing, latitude and longitude)"
                .to_owned(),
        };
        DataError::unsettled(place.clone(), format!("{problem}; the keys are {}", names(object)), help)
    }

    /// Appends a row.
    fn push(
        &self,
        slots: &[Option<Slot<'_>>],
        object: &Map<String, Value>,
        place: &Place,
        sheet: &mut Sheet,
    ) -> Result<(), DataError> {
        let Sheet { columns, values, spots } = sheet;
        for ((column, values), slot) in columns.iter().zip(values).zip(slots) {
            if slot.is_none() && column.needed && !self.naming.ours() {
                let keys: Vec<String> = object.keys().cloned().collect();
                return Err(missing_columns(place, &[&column.name], &keys));
            }
            let (value, conversion) =
                slot.map_or((&Value::Null, Conversion::NONE), |slot| (slot.value, slot.conversion));
            push_value(values, value, column, conversion).map_err(|refusal| {
                refusal.at(place.clone(), slot.map_or(&column.name, |slot| slot.meaning))
            })?;
        }
        spots.push(place.spot);
        Ok(())
    }
}

fn joined<'k>(outer: &str, key: &'k str) -> std::borrow::Cow<'k, str> {
    if outer.is_empty() { key.into() } else { format!("{outer}_{key}").into() }
}

fn push_value(
    values: &mut Values,
    value: &Value,
    column: &Column,
    conversion: Conversion,
) -> Result<(), Refusal> {
    match value {
        Value::Null => values.push_null(column),
        // Numbers that JSON has no way to write come as text.
        Value::String(text) => values.push_text(text, column, conversion),
        Value::Number(number) => match (number.as_u64(), number.as_f64()) {
            (Some(count), _) => values.push_count(count, column, conversion),
            (_, Some(real)) => values.push_number(real, column, conversion),
            _ => Err(Refusal::new(number, column.expected())),
        },
        other => Err(Refusal::new(other, column.expected())),
    }
}
