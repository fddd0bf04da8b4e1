//! Rows and columns that compete with each other.

/// Groups of rows that are linked by shared columns, with the entries of each.
#[derive(Debug, Clone, Default)]
pub(crate) struct Clusters {
    parent: Vec<usize>,
    /// First row that named each column.
    owner: Vec<Option<usize>>,
}

impl Clusters {
    /// Groups `rows` rows by the pairs `(row, column)`. Two rows with a column in common are of one group.
    pub fn build(&mut self, pairs: impl Iterator<Item = (usize, usize)>, rows: usize, columns: usize) {
        self.parent.clear();
        self.parent.extend(0..rows);
        self.owner.clear();
        self.owner.resize(columns, None);
        for (row, column) in pairs {
            match self.owner[column] {
                None => self.owner[column] = Some(row),
                Some(first) => self.join(first, row),
            }
        }
    }

    /// Makes two groups one.
    pub fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.of(a), self.of(b));
        // The smaller number leads, so that the groups do not depend on the order of the pairs.
        self.parent[a.max(b)] = a.min(b);
    }

    /// The group of a row, named by its first row.
    pub fn of(&mut self, row: usize) -> usize {
        let mut root = row;
        while self.parent[root] != root {
            root = self.parent[root];
        }
        let mut step = row;
        while self.parent[step] != root {
            step = std::mem::replace(&mut self.parent[step], root);
        }
        root
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_together_that_share_a_column_however_far_around() {
        let mut clusters = Clusters::default();
        clusters.build([(0, 1), (2, 0), (3, 1), (3, 2), (4, 2)].into_iter(), 6, 3);
        let groups: Vec<usize> = (0..6).map(|row| clusters.of(row)).collect();
        assert_eq!(groups, [0, 1, 2, 0, 0, 5]);
    }
}
