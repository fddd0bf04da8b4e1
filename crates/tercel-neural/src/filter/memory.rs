//! What the networks of a learned filter remember of one object.

/// The memories of recurrent layers, held in a belief, with room for a step.
///
/// A filter that fails must leave its belief as it was. So a step works on a copy of what is held, and the copy takes its
/// place only when all of the step has succeeded:
///
/// ```
/// use tercel_neural::filter::Memory;
///
/// let mut memory = Memory::new(&[0.0, 0.0], 8);
/// let (next, _scratch) = memory.stage();
/// next[0] = 1.0;
/// assert_eq!(memory.held(), [0.0, 0.0]);
/// memory.commit();
/// assert_eq!(memory.held(), [1.0, 0.0]);
/// ```
///
/// Memories are equal when they hold the same; what is left in the room for a step does not count. Copying into a memory of
/// the same sizes does not allocate.
#[derive(Debug)]
pub struct Memory {
    held: Vec<f32>,
    next: Vec<f32>,
    scratch: Vec<f32>,
}

impl Memory {
    /// A memory that holds `initial`, with `scratch` numbers of room for intermediate results.
    pub fn new(initial: &[f32], scratch: usize) -> Self {
        Memory { held: initial.to_vec(), next: initial.to_vec(), scratch: vec![0.0; scratch] }
    }

    /// What is remembered.
    pub fn held(&self) -> &[f32] {
        &self.held
    }

    /// A copy of what is remembered, to be moved on by a step, and room for intermediate results.
    pub fn stage(&mut self) -> (&mut [f32], &mut [f32]) {
        self.next.copy_from_slice(&self.held);
        (&mut self.next, &mut self.scratch)
    }

    /// Remembers the staged copy.
    pub fn commit(&mut self) {
        std::mem::swap(&mut self.held, &mut self.next);
    }

    /// Replaces what is remembered by the mean of it and of `other` under these weights, which need not be normalised.
    ///
    /// Objects are merged when they are much alike, and then so are their memories. The units of a layer lie in a bounded
    /// range that a mean cannot leave, and merging pair by pair gives the mean of all in any order, as it does for states.
    ///
    /// # Panics
    /// When the two are memories of different networks.
    pub fn merge(&mut self, weight: f64, other: &Memory, other_weight: f64) {
        assert_eq!(self.held.len(), other.held.len(), "memories of different networks");
        let share = share(weight, other_weight) as f32;
        for (ours, theirs) in self.held.iter_mut().zip(&other.held) {
            *ours += share * (theirs - *ours);
        }
    }
}

/// The share of the second of two weights. Two vanished weights carry no preference, so the first stays.
pub(crate) fn share(weight: f64, other_weight: f64) -> f64 {
    let total = weight + other_weight;
    if total > 0.0 { other_weight / total } else { 0.0 }
}

impl Clone for Memory {
    fn clone(&self) -> Self {
        Memory::new(&self.held, self.scratch.len())
    }

    fn clone_from(&mut self, source: &Self) {
        self.held.clone_from(&source.held);
        self.next.resize(source.held.len(), 0.0);
        self.scratch.resize(source.scratch.len(), 0.0);
    }
}

impl PartialEq for Memory {
    fn eq(&self, other: &Self) -> bool {
        self.held == other.held
    }
}

/// Scratch space, given out piece by piece.
pub(crate) struct Room<'a>(pub &'a mut [f32]);

impl<'a> Room<'a> {
    pub fn take(&mut self, count: usize) -> &'a mut [f32] {
        let (piece, rest) = std::mem::take(&mut self.0).split_at_mut(count);
        self.0 = rest;
        piece
    }
}

/// Writes rows that consist of a row of each part: `(values, width)`.
pub(crate) fn side_by_side(parts: &[(&[f32], usize)], rows: &mut [f32]) {
    let width: usize = parts.iter().map(|part| part.1).sum();
    for (index, row) in rows.chunks_exact_mut(width).enumerate() {
        let mut rest = row;
        for (values, width) in parts {
            let (to, after) = rest.split_at_mut(*width);
            to.copy_from_slice(&values[index * width..][..*width]);
            rest = after;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_that_is_not_committed_leaves_no_trace() {
        let mut memory = Memory::new(&[1.0, 2.0], 3);
        let before = memory.clone();
        memory.stage().0.fill(9.0);
        assert_eq!(memory, before);
        assert_eq!(memory.stage().0, [1.0, 2.0]);
    }

    #[test]
    fn memories_merge_to_their_mean_in_any_order() {
        let parts = [(0.5, [1.0, -1.0]), (0.25, [0.0, 0.5]), (1.25, [-1.0, 0.25])];
        let folded = |order: [usize; 3]| {
            let (mut weight, mut merged) = (parts[order[0]].0, Memory::new(&parts[order[0]].1, 0));
            for index in &order[1..] {
                merged.merge(weight, &Memory::new(&parts[*index].1, 0), parts[*index].0);
                weight += parts[*index].0;
            }
            merged.held().to_vec()
        };
        for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
            for (got, mean) in folded(order).iter().zip([-0.375, -0.031_25]) {
                assert!((got - mean).abs() < 1e-6);
            }
        }
        let mut same = Memory::new(&[3.0], 0);
        same.merge(0.0, &Memory::new(&[5.0], 0), 0.0);
        assert_eq!(same.held(), [3.0]);
    }

    #[test]
    fn copying_over_a_memory_of_other_sizes_gives_it_those_sizes() {
        let source = Memory::new(&[1.0, 2.0, 3.0], 7);
        let mut copy = Memory::new(&[0.0], 1);
        copy.clone_from(&source);
        assert_eq!(copy, source);
        let (next, scratch) = copy.stage();
        assert_eq!((next.len(), scratch.len()), (3, 7));
    }
}
