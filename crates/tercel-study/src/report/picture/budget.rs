//! How much of a long recording is drawn: a page has to open, and to stay quick.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use tercel_data::table::{Detections, Tracks, Truths};

/// Bytes that the tables of a picture may take on the page.
const BYTES: f64 = 11e6;

/// Bytes of a row in its columns, and of what a track or an object takes besides, with its first and last row.
const DETECTION: f64 = 48.0;
const TRACK_ROW: f64 = 80.0;
const TRACK: f64 = 400.0;
const TRUTH_ROW: f64 = 40.0;
const OBJECT: f64 = 160.0;

/// The most tracks, or objects, that are drawn.
const DRAWN_LIVES: usize = 12_000;

/// Stops of the time slider.
pub(super) const DRAWN_TIMES: usize = 20_000;

/// Rows that are drawn of each table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Budget {
    pub(super) detections: usize,
    pub(super) track_rows: usize,
    pub(super) truth_rows: usize,
}

impl Budget {
    /// Everything, if it fits. Otherwise tracks may take twice as much as each of the others, and what a table does not need
    /// is left to these.
    pub(super) fn of(detections: &Detections, tracks: &Tracks, truths: Option<&Truths>) -> Budget {
        let seen: usize = detections.scans.iter().map(|scan| scan.detections.len()).sum();
        let told = truths.map_or(0, |truths| truths.rows.len());
        let lives = tracks.rows.iter().map(|row| row.track).collect::<BTreeSet<_>>().len();
        let objects: BTreeSet<&str> =
            truths.iter().flat_map(|truths| &truths.rows).map(|row| &*row.object).collect();
        let fixed =
            [0.0, TRACK * lives.min(DRAWN_LIVES) as f64, OBJECT * objects.len().min(DRAWN_LIVES) as f64];
        let modes = 6.0 * tracks.modes.len() as f64;
        let sizes = [DETECTION, TRACK_ROW + modes, TRUTH_ROW];
        let rows = [seen, tracks.rows.len(), told];
        let needs = [0, 1, 2].map(|table| fixed[table] + sizes[table] * rows[table] as f64);
        let shares = shares(needs, [1.0, 2.0, 1.0], BYTES);
        let drawn = [0, 1, 2].map(|table| {
            let fits = shares[table] >= needs[table];
            let left = ((shares[table] - fixed[table]) / sizes[table]).max(1.0) as usize;
            if fits { rows[table].max(1) } else { left }
        });
        Budget { detections: drawn[0], track_rows: drawn[1], truth_rows: drawn[2] }
    }
}

/// Divides `total` by weight among those who need it; nobody gets more than that.
fn shares(needs: [f64; 3], weights: [f64; 3], total: f64) -> [f64; 3] {
    let mut shares = [0.0; 3];
    let (mut left, mut weight) = (total, weights.iter().sum::<f64>());
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| (needs[a] / weights[a]).total_cmp(&(needs[b] / weights[b])));
    for table in order {
        shares[table] = needs[table].min(left * weights[table] / weight);
        left -= shares[table];
        weight -= weights[table];
    }
    shares
}

/// Keeps the lives with the most rows when there are more than are drawn; of equally long ones the first.
pub(super) fn keep_longest<K: Ord, V>(
    lives: &mut BTreeMap<K, Vec<V>>,
    what: &str,
    remarks: &mut Vec<String>,
) {
    let all = lives.len();
    if all <= DRAWN_LIVES {
        return;
    }
    let mut lengths: Vec<usize> = lives.values().map(Vec::len).collect();
    let least = *lengths.select_nth_unstable(all - DRAWN_LIVES).1;
    let mut ties = DRAWN_LIVES - lives.values().filter(|life| life.len() > least).count();
    lives.retain(|_, life| match life.len().cmp(&least) {
        Ordering::Greater => true,
        Ordering::Less => false,
        Ordering::Equal => {
            let kept = ties > 0;
            ties = ties.saturating_sub(1);
            kept
        }
    });
    remarks.push(format!("The {DRAWN_LIVES} longest of {all} {what} are drawn."));
}

/// Every how many rows one is drawn, so that no more than about `limit` are.
pub(super) fn stride(rows: usize, limit: usize) -> usize {
    rows.div_ceil(limit.max(1)).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_one_table_does_not_need_is_left_to_the_others() {
        assert_eq!(shares([1.0, 2.0, 3.0], [1.0, 2.0, 1.0], 100.0), [1.0, 2.0, 3.0]);
        assert_eq!(shares([10.0, 900.0, 900.0], [1.0, 2.0, 1.0], 100.0), [10.0, 60.0, 30.0]);
        assert_eq!(shares([900.0, 10.0, 900.0], [1.0, 2.0, 1.0], 100.0), [45.0, 10.0, 45.0]);
    }

    #[test]
    fn of_too_many_lives_the_longest_are_drawn() {
        let length = |k: usize| if k < 10 { 1 } else { 1 + k % 2 };
        let mut lives: BTreeMap<usize, Vec<()>> =
            (0..2 * DRAWN_LIVES - 6).map(|k| (k, vec![(); length(k)])).collect();
        let mut remarks = Vec::new();
        keep_longest(&mut lives, "tracks", &mut remarks);
        assert_eq!(lives.len(), DRAWN_LIVES);
        assert_eq!(lives.values().filter(|life| life.len() == 2).count(), DRAWN_LIVES - 8);
        assert_eq!(remarks, [format!("The 12000 longest of {} tracks are drawn.", 2 * DRAWN_LIVES - 6)]);
    }

    #[test]
    fn every_nth_row_leaves_no_more_than_the_limit() {
        assert_eq!(
            [stride(0, 9), stride(9, 9), stride(10, 9), stride(100, 9), stride(5, 0)],
            [1, 1, 2, 12, 5]
        );
    }
}
