//! From rows of detections to scans in the order of time.

use std::collections::{HashMap, HashSet, VecDeque};
use std::sync::Arc;

use super::rows::DetectionRow;
use crate::error::{DataError, Place};
use crate::options::ReadOptions;
use crate::remarks::Remarks;
use crate::table::{Detection, Observation, Scan};

/// Rows that are one scan.
struct Group {
    number: Option<u64>,
    time: f64,
    /// Places of the rows in the file.
    members: Vec<usize>,
}

/// The scans of a file, in the order of time. Rows of one scan may stand anywhere; `place` says where a row stood.
pub(super) fn scans(
    rows: Vec<(DetectionRow, usize)>,
    place: impl Fn(usize) -> Place,
    options: &ReadOptions,
    remarks: &mut Remarks,
) -> Result<Vec<Scan>, DataError> {
    let groups = groups(&rows);
    remarks.notes.extend(out_of_order(&rows, &groups));
    remarks.notes.extend(gap(&groups));
    let count = rows.len();
    let mut rows: Vec<Option<(DetectionRow, usize)>> = rows.into_iter().map(Some).collect();
    let (mut repeated, mut empty) = (0, 0);
    let mut scans = Vec::with_capacity(groups.len());
    for group in groups {
        let mut scan: Option<Scan> = None;
        let mut holds_nothing = 0;
        for (row, at) in group.members.into_iter().filter_map(|member| rows[member].take()) {
            holds_nothing += usize::from(row.detection.is_none());
            match &mut scan {
                None => scan = Some(row.start()),
                Some(scan) => {
                    if let Err(error) = row.join(scan, || place(at)) {
                        remarks.refuse(error)?;
                    }
                }
            }
        }
        // Beside detections such a row says nothing, and alone it is a scan in which nothing was seen.
        if scan.as_ref().is_some_and(|scan| !scan.detections.is_empty()) {
            empty += holds_nothing;
        }
        scans.extend(scan.map(|mut scan| {
            repeated += without_repetitions(&mut scan, options.drop_repeated);
            scan
        }));
    }
    scans.sort_by(|one, next| one.time.total_cmp(&next.time));
    remarks.leave_out("no measurement, beside detections of its scan", empty);
    if repeated > 0 && options.drop_repeated {
        remarks.leave_out("a repeated row".to_owned(), repeated);
    } else if repeated > 0 {
        remarks.notes.push(format!(
            "{repeated} of {count} rows repeat another row of their scan; tracking takes one of each, and --drop-repeated \
             leaves the others out of tables"
        ));
    }
    Ok(scans)
}

/// The scans as groups of rows, in the order of time.
fn groups(rows: &[(DetectionRow, usize)]) -> Vec<Group> {
    let mut order: Vec<usize> = (0..rows.len()).collect();
    if !rows.is_sorted_by(|(one, _), (next, _)| one.time <= next.time) {
        order.sort_by(|one, other| rows[*one].0.time.total_cmp(&rows[*other].0.time));
    }
    let mut groups: Vec<Group> = Vec::new();
    let mut open: HashMap<&Arc<str>, VecDeque<usize>> = HashMap::new();
    for at in order {
        let row = &rows[at].0;
        let recent = open.entry(&row.sensor).or_default();
        let same = |group: &Group| group.number == row.scan && (row.scan.is_some() || group.time == row.time);
        match recent.iter().rev().find(|group| same(&groups[**group])) {
            Some(group) => {
                let group = &mut groups[*group];
                group.time = row.time;
                group.members.push(at);
            }
            None => {
                // Numbers of scans may begin anew; one that was a while ago is another scan.
                const RECENT: usize = 8;
                if recent.len() == RECENT {
                    recent.pop_front();
                }
                recent.push_back(groups.len());
                groups.push(Group { number: row.scan, time: row.time, members: vec![at] });
            }
        }
    }
    for group in &mut groups {
        group.members.sort_unstable();
    }
    groups.sort_by(|one, other| one.time.total_cmp(&other.time).then(one.members[0].cmp(&other.members[0])));
    groups
}

/// Says how many rows stood behind later ones.
fn out_of_order(rows: &[(DetectionRow, usize)], groups: &[Group]) -> Option<String> {
    let mut position = vec![0; rows.len()];
    for (at, group) in groups.iter().enumerate() {
        group.members.iter().for_each(|member| position[*member] = at);
    }
    let (mut latest, mut last, mut behind) = (f64::NEG_INFINITY, 0, 0);
    for ((row, _), position) in rows.iter().zip(position) {
        // Rows of a scan with times of their own may be older than the scan of another sensor before them.
        behind += usize::from(row.time < latest && position < last);
        latest = latest.max(row.time);
        last = last.max(position);
    }
    (behind > 0).then(|| {
        format!("{behind} of {} rows stood behind later ones; the file was sorted by time", rows.len())
    })
}

/// Says when some scans lie far from all others: their times may be wrong.
fn gap(groups: &[Group]) -> Option<String> {
    const FEWEST: usize = 10;
    const FAR: f64 = 100.0;
    const HOUR: f64 = 3600.0;
    let (first, last) = (groups.first()?.time, groups.last()?.time);
    let widest = |one: &usize, other: &usize| {
        let width = |at: usize| groups[at + 1].time - groups[at].time;
        width(*one).total_cmp(&width(*other))
    };
    let at = (0..groups.len() - 1).max_by(widest)?;
    let gap = groups[at + 1].time - groups[at].time;
    let rest = last - first - gap;
    let fewer = (at + 1).min(groups.len() - at - 1);
    (groups.len() >= FEWEST && gap > HOUR && gap > FAR * rest).then(|| {
        format!(
            "{fewer} of {} scans lie {gap:.0} s apart from the others; their times may be wrong",
            groups.len()
        )
    })
}

/// Counts detections that are there already, and takes them out if that is wanted.
fn without_repetitions(scan: &mut Scan, drop: bool) -> usize {
    if scan.detections.len() < 2 {
        return 0;
    }
    let mut seen = HashSet::with_capacity(scan.detections.len());
    let mut repeated = 0;
    scan.detections.retain(|detection| {
        let news = seen.insert(key(detection));
        repeated += usize::from(!news);
        news || !drop
    });
    repeated
}

/// What makes two detections of one scan the same.
fn key(detection: &Detection) -> ([Option<u64>; 4], Option<Arc<str>>) {
    let bits = |number: f64| Some(number.to_bits());
    let measured = match detection.observation {
        Observation::Position { x, y, z } => [bits(x), bits(y), z.and_then(bits), None],
        Observation::Polar { range, bearing, range_rate, z } => {
            [range.and_then(bits), bits(bearing), range_rate.and_then(bits), Some(z.map_or(1, f64::to_bits))]
        }
    };
    (measured, detection.identity.clone())
}
