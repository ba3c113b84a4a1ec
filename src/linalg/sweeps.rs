//! The two triangular solves with a sparse factor L, for right-hand sides that lie side by side.
//!
//! L is cut in panels of at most four neighbouring columns with one pattern of rows. A panel keeps the inverse of its triangle and then, row after
//! row, the entries below it, so that a sweep runs through memory once and straight on, and so that no division or square stands in its way.

use super::kernels::vectorised;

/// The greatest number of columns of a panel.
const WIDTH: usize = 4;

/// L, arranged for sweeps.
#[derive(Clone, Debug, Default)]
pub struct Sweeps {
    panels: Vec<Panel>,
    /// The rows below the triangle of every panel, panel after panel.
    rows: Vec<u32>,
    /// Of every panel: the inverse of its triangle, lower part, row after row; then, for each of its rows, the
    /// entries of its columns with the opposite sign.
    values: Vec<f64>,
}

/// Columns `first .. first + width` of L.
#[derive(Clone, Copy, Debug)]
struct Panel {
    first: u32,
    width: u32,
    /// How many rows below the triangle hold anything.
    below: u32,
}

/// Columns of L from `first` on with one pattern: dense, column-major, a square block of their own rows (of which only the lower triangle is read, or
/// where `packed` is all there is) over the rows of `pattern`, which ascend.
#[derive(Clone, Copy, Debug)]
pub struct Supernode<'a> {
    pub first: usize,
    pub columns: usize,
    pub pattern: &'a [u32],
    pub values: &'a [f64],
    pub packed: bool,
}

impl<'a> Supernode<'a> {
    /// Number of rows of the first column.
    fn height(&self) -> usize {
        self.columns + self.pattern.len()
    }

    /// A column from its diagonal on.
    fn column(&self, w: usize) -> &'a [f64] {
        let height = self.height();
        let above = if self.packed { triangle(w) } else { 0 };
        &self.values[w * (height + 1) - above..][..height - w]
    }
}

impl Sweeps {
    /// Forgets everything but the memory.
    pub fn clear(&mut self) {
        self.panels.clear();
        self.rows.clear();
        self.values.clear();
    }

    /// Makes room for all of these columns of L.
    pub fn reserve<'a>(&mut self, supernodes: impl Iterator<Item = Supernode<'a>>) {
        let (mut panels, mut rows, mut values) = (0, 0, 0);
        for supernode in supernodes {
            let height = supernode.height();
            for first in (0..supernode.columns).step_by(WIDTH) {
                let width = WIDTH.min(supernode.columns - first);
                let below = height - first - width;
                panels += 1;
                rows += below;
                values += width * (width + 1) / 2 + width * below;
            }
        }
        self.panels.reserve_exact(panels);
        self.rows.reserve_exact(rows);
        self.values.reserve_exact(values);
    }

    /// Appends the next columns of L. Rows that hold nothing but zeros, as relaxed supernodes have, are left out.
    pub fn push(&mut self, supernode: Supernode) {
        for first in (0..supernode.columns).step_by(WIDTH) {
            match supernode.columns - first {
                1 => self.push_panel::<1>(supernode, first),
                2 => self.push_panel::<2>(supernode, first),
                3 => self.push_panel::<3>(supernode, first),
                _ => self.push_panel::<WIDTH>(supernode, first),
            }
        }
    }

    fn push_panel<const W: usize>(&mut self, supernode: Supernode, first: usize) {
        let columns: [&[f64]; W] = std::array::from_fn(|w| supernode.column(first + w));
        self.push_triangle(columns);
        let before = self.rows.len();
        let own = (first + W..supernode.columns).map(|i| (supernode.first + i) as u32);
        let rows = own.chain(supernode.pattern.iter().copied());
        let below: [&[f64]; W] = std::array::from_fn(|w| &columns[w][W - w..]);
        for (i, row) in rows.enumerate() {
            let mut entries = [0.0; W];
            for w in 0..W {
                entries[w] = -below[w][i];
            }
            if entries != [0.0; W] {
                self.rows.push(row);
                self.values.extend(entries);
            }
        }
        self.panels.push(Panel {
            first: (supernode.first + first) as u32,
            width: W as u32,
            below: (self.rows.len() - before) as u32,
        });
    }

    /// Appends the inverse of a lower triangle, given by columns from the diagonal on.
    fn push_triangle<const W: usize>(&mut self, columns: [&[f64]; W]) {
        let mut inverse = [[0.0; W]; W];
        for i in 0..W {
            let pivot = 1.0 / columns[i][0];
            for j in 0..i {
                let known: f64 = (j..i).map(|k| columns[k][i - k] * inverse[k][j]).sum();
                inverse[i][j] = -known * pivot;
            }
            inverse[i][i] = pivot;
            self.values.extend_from_slice(&inverse[i][..=i]);
        }
    }

    /// Replaces four right-hand sides b, rows in the order of elimination, by the solutions of L L^T x = b.
    pub fn solve4(&self, x: &mut [[f64; 4]]) {
        solve_four(self, x);
    }

    /// The same for one right-hand side.
    pub fn solve1(&self, x: &mut [[f64; 1]]) {
        solve_one(self, x);
    }
}

vectorised! {
    fn solve_four(sweeps: &Sweeps, x: &mut [[f64; 4]]) {
        forward(sweeps, x);
        backward(sweeps, x);
    }
}

vectorised! {
    fn solve_one(sweeps: &Sweeps, x: &mut [[f64; 1]]) {
        forward(sweeps, x);
        backward(sweeps, x);
    }
}

/// L y = b.
#[inline(always)]
fn forward<const N: usize>(sweeps: &Sweeps, x: &mut [[f64; N]]) {
    let (mut rows, mut values) = (&sweeps.rows[..], &sweeps.values[..]);
    for panel in &sweeps.panels {
        let (own_rows, later_rows) = rows.split_at(panel.below as usize);
        let (own_values, later_values) = values.split_at(panel.len());
        (rows, values) = (later_rows, later_values);
        let first = panel.first as usize;
        match panel.width {
            1 => subtract_panel::<1, N>(first, own_rows, own_values, x),
            2 => subtract_panel::<2, N>(first, own_rows, own_values, x),
            3 => subtract_panel::<3, N>(first, own_rows, own_values, x),
            _ => subtract_panel::<WIDTH, N>(first, own_rows, own_values, x),
        }
    }
}

/// L^T x = y.
#[inline(always)]
fn backward<const N: usize>(sweeps: &Sweeps, x: &mut [[f64; N]]) {
    let (mut rows, mut values) = (&sweeps.rows[..], &sweeps.values[..]);
    for panel in sweeps.panels.iter().rev() {
        let (earlier_rows, own_rows) = rows.split_at(rows.len() - panel.below as usize);
        let (earlier_values, own_values) = values.split_at(values.len() - panel.len());
        (rows, values) = (earlier_rows, earlier_values);
        let first = panel.first as usize;
        match panel.width {
            1 => gather_panel::<1, N>(first, own_rows, own_values, x),
            2 => gather_panel::<2, N>(first, own_rows, own_values, x),
            3 => gather_panel::<3, N>(first, own_rows, own_values, x),
            _ => gather_panel::<WIDTH, N>(first, own_rows, own_values, x),
        }
    }
}

impl Panel {
    /// How many values it has.
    #[inline(always)]
    fn len(&self) -> usize {
        let (width, below) = (self.width as usize, self.below as usize);
        triangle(width) + width * below
    }
}

/// The number of entries of a lower triangle.
#[inline(always)]
const fn triangle(width: usize) -> usize {
    width * (width + 1) / 2
}

/// Solves for the unknowns of a panel and subtracts their columns from the rows below.
#[inline(always)]
fn subtract_panel<const W: usize, const N: usize>(
    first: usize,
    rows: &[u32],
    values: &[f64],
    x: &mut [[f64; N]],
) {
    let (inverse, below) = values.split_at(triangle(W));
    let given: [[f64; N]; W] = std::array::from_fn(|w| x[first + w]);
    let mut y = [[0.0; N]; W];
    for i in 0..W {
        for j in 0..=i {
            y[i] = plus(y[i], inverse[triangle(i) + j], given[j]);
        }
    }
    x[first..first + W].copy_from_slice(&y);
    for (&row, entries) in rows.iter().zip(below.as_chunks::<W>().0) {
        let mut target = x[row as usize];
        for w in 0..W {
            target = plus(target, entries[w], y[w]);
        }
        x[row as usize] = target;
    }
}

/// Subtracts what the rows below have part in from a panel's unknowns and solves for them.
#[inline(always)]
fn gather_panel<const W: usize, const N: usize>(
    first: usize,
    rows: &[u32],
    values: &[f64],
    x: &mut [[f64; N]],
) {
    let (inverse, below) = values.split_at(triangle(W));
    let mut rest: [[f64; N]; W] = std::array::from_fn(|w| x[first + w]);
    for (&row, entries) in rows.iter().zip(below.as_chunks::<W>().0) {
        let solved = x[row as usize];
        for w in 0..W {
            rest[w] = plus(rest[w], entries[w], solved);
        }
    }
    let mut y = [[0.0; N]; W];
    for i in 0..W {
        for j in 0..=i {
            y[j] = plus(y[j], inverse[triangle(i) + j], rest[i]);
        }
    }
    x[first..first + W].copy_from_slice(&y);
}

/// y + a x.
#[inline(always)]
fn plus<const N: usize>(y: [f64; N], a: f64, x: [f64; N]) -> [f64; N] {
    std::array::from_fn(|lane| y[lane] + a * x[lane])
}
