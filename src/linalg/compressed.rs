//! Where a sparse matrix has entries, by columns.

use faer::sparse::SymbolicSparseColMatRef;

/// Entries by columns, rows ascending.
#[derive(Debug)]
pub struct Compressed {
    pub starts: Vec<u32>,
    pub rows: Vec<u32>,
    /// Where the value of each given entry goes.
    pub slots: Vec<u32>,
}

impl Compressed {
    /// Sorts entries [row, column] by columns and then by rows; equal ones share a slot. O(n + entries).
    pub fn new(n: usize, entries: impl Iterator<Item = [u32; 2]> + Clone) -> Self {
        let given = entries.zip(0..);
        let by_rows = Buckets::new(n, given.map(|([row, column], e)| (row, [column, e])));
        let sorted = Buckets::new(n, by_rows.iter().map(|(row, [c, e])| (c, [row, e])));
        let mut starts = vec![0; n + 1];
        let mut rows = Vec::with_capacity(sorted.items.len());
        let mut slots = vec![0; sorted.items.len()];
        for column in 0..n {
            let mut before = None;
            for &[row, e] in sorted.of(column) {
                if before != Some(row) {
                    rows.push(row);
                    before = Some(row);
                }
                slots[e as usize] = rows.len() as u32 - 1;
            }
            starts[column + 1] = rows.len() as u32;
        }
        Self {
            starts,
            rows,
            slots,
        }
    }

    /// The entries [row, column], in order.
    pub fn entries(&self) -> impl Iterator<Item = [u32; 2]> + Clone {
        let columns = self.starts.windows(2).zip(0..);
        columns.flat_map(|(range, column)| {
            let rows = &self.rows[range[0] as usize..range[1] as usize];
            rows.iter().map(move |&row| [row, column])
        })
    }

    /// The same entries by rows: those of the transpose by columns. O(n + entries).
    pub fn transpose(&self) -> Self {
        let n = self.starts.len() - 1;
        let mut starts = vec![0u32; n + 1];
        for &row in &self.rows {
            starts[row as usize + 1] += 1;
        }
        for row in 0..n {
            starts[row + 1] += starts[row];
        }
        let mut next = starts.clone();
        let mut rows = vec![0; self.rows.len()];
        let mut places = vec![0; self.rows.len()];
        for (place, [row, column]) in places.iter_mut().zip(self.entries()) {
            *place = next[row as usize];
            next[row as usize] += 1;
            rows[*place as usize] = column;
        }
        let slots = self.slots.iter().map(|&slot| places[slot as usize]);
        Self {
            slots: slots.collect(),
            starts,
            rows,
        }
    }

    /// As faer reads it.
    pub fn pattern(&self, n: usize) -> SymbolicSparseColMatRef<'_, u32> {
        SymbolicSparseColMatRef::new_checked(n, n, &self.starts, None, &self.rows)
    }

    /// A value for each of the entries: the sum of those given for it.
    pub fn gather(&self, values: &[f64]) -> Vec<f64> {
        let mut gathered = vec![0.0; self.rows.len()];
        for (&slot, value) in self.slots.iter().zip(values) {
            gathered[slot as usize] += value;
        }
        gathered
    }
}

/// Items by keys below n; those of one key keep their order.
struct Buckets {
    starts: Vec<u32>,
    items: Vec<[u32; 2]>,
}

impl Buckets {
    fn new(n: usize, keyed: impl Iterator<Item = (u32, [u32; 2])> + Clone) -> Self {
        let mut starts = vec![0u32; n + 1];
        for (key, _) in keyed.clone() {
            starts[key as usize + 1] += 1;
        }
        for key in 0..n {
            starts[key + 1] += starts[key];
        }
        let mut next = starts.clone();
        let mut items = vec![[0; 2]; starts[n] as usize];
        for (key, item) in keyed {
            let place = &mut next[key as usize];
            items[*place as usize] = item;
            *place += 1;
        }
        Self { starts, items }
    }

    fn of(&self, key: usize) -> &[[u32; 2]] {
        &self.items[self.starts[key] as usize..self.starts[key + 1] as usize]
    }

    fn iter(&self) -> impl Iterator<Item = (u32, [u32; 2])> + Clone {
        let keys = 0..self.starts.len() - 1;
        keys.flat_map(|key| self.of(key).iter().map(move |&item| (key as u32, item)))
    }
}
