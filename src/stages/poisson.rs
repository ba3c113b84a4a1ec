//! The sparse system that shape spaces decode by, factored and solved: beside CHOLMOD (section 5; the paper's own implementation uses it).

use std::collections::BTreeMap;

use super::{Call, Stage, StageError, call};
use crate::arrays::{Array, Bundle};
use crate::linalg::sparse::{Factor, Pattern};
use crate::sequence::Sequence;
use crate::shape::poisson::system;
use crate::shape::reference::Reference;

/// Factoring before solving.
pub static STAGES: &[Stage] = &[
    Stage {
        name: "shape.poisson_factor",
        about: "order, analysis and factorisation of the Poisson equation's matrix (section 5)",
        prepare: factor,
    },
    Stage {
        name: "shape.poisson_solve",
        about: "the Poisson equation solved for three right-hand sides by a factor at hand (section 5)",
        prepare: solve,
    },
];

/// A symmetric matrix and three right-hand sides.
struct Equation {
    entries: Vec<[u32; 2]>,
    values: Vec<f64>,
    right: Vec<[f64; 3]>,
}

impl Equation {
    fn new(inputs: &Bundle) -> Result<Self, StageError> {
        let (shape, b) = inputs.f64("b", 2)?;
        if shape[1] != 3 {
            return Err(StageError::Failed(format!(
                "`b` has shape {shape:?}, expected (n, 3)"
            )));
        }
        let rows = inputs.indices("rows")?;
        let cols = inputs.indices("cols")?;
        let values = inputs.vector("values")?.to_vec();
        if rows.len() != values.len() || cols.len() != values.len() {
            return Err(StageError::Failed(format!(
                "`rows`, `cols` and `values` have {}, {} and {} numbers, expected as many of each",
                rows.len(),
                cols.len(),
                values.len()
            )));
        }
        if let Some(i) = (0..rows.len()).find(|&i| cols[i] > rows[i]) {
            return Err(StageError::Failed(format!(
                "entry {i} (0-based) is at row {}, column {}, above the diagonal; expected the lower triangle alone",
                rows[i], cols[i]
            )));
        }
        let place = |(row, column): (usize, usize)| {
            let index = |i: usize| u32::try_from(i).unwrap_or(u32::MAX);
            [index(row), index(column)]
        };
        Ok(Self {
            entries: rows.into_iter().zip(cols).map(place).collect(),
            values,
            right: b.as_chunks::<3>().0.to_vec(),
        })
    }

    fn factor(&self) -> Result<Factor, StageError> {
        let pattern = Pattern::new(self.right.len(), &self.entries);
        let factor = pattern.and_then(|pattern| pattern.factor(&self.values));
        factor.map_err(StageError::from_error)
    }

    fn solve(&self, factor: &Factor) -> Vec<[f64; 3]> {
        let mut x = self.right.clone();
        factor.solve3(&mut x, &mut Vec::new());
        x
    }
}

/// The solution that is returned is not part of the work.
fn factor(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let equation = std::rc::Rc::new(Equation::new(inputs)?);
    let given = equation.clone();
    call(
        move || given.factor(),
        move |factor| solution(&equation.solve(factor)),
    )
}

fn solve(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let equation = Equation::new(inputs)?;
    let factor = equation.factor()?;
    let mut scratch = Vec::new();
    call(
        move || {
            let mut x = equation.right.clone();
            factor.solve3(&mut x, &mut scratch);
            Ok(x)
        },
        |x| solution(x),
    )
}

fn solution(x: &[[f64; 3]]) -> Bundle {
    let (shape, data) = (vec![x.len(), 3], x.as_flattened().to_vec());
    Bundle::from([("x", Array::F64 { shape, data })])
}

/// The matrix of the first frame, and the right-hand sides whose solution is the last frame.
pub fn inputs(sequence: &Sequence) -> Result<Bundle, StageError> {
    let reference = Reference::new(sequence.connectivity().clone(), sequence.frame(0));
    let system = system(&reference.map_err(StageError::from_error)?);
    let mut matrix: BTreeMap<(usize, usize), f64> = BTreeMap::new();
    for (&[i, j], value) in system.entries.iter().zip(&system.values) {
        *matrix
            .entry((i.max(j) as usize, i.min(j) as usize))
            .or_default() += value;
    }
    let mut x = vec![[0.0; 3]; system.n];
    let last = sequence
        .frame(sequence.frame_count() - 1)
        .as_chunks::<3>()
        .0;
    for (&unknown, p) in system.unknowns.iter().zip(last) {
        if let Some(x) = x.get_mut(unknown as usize) {
            *x = *p;
        }
    }
    let mut b = vec![[0.0; 3]; system.n];
    for (&(i, j), value) in &matrix {
        for a in 0..3 {
            b[i][a] += value * x[j][a];
            if i != j {
                b[j][a] += value * x[i][a];
            }
        }
    }
    let (rows, cols): (Vec<usize>, Vec<usize>) = matrix.keys().copied().unzip();
    let values: Vec<f64> = matrix.values().copied().collect();
    let (shape, data) = (vec![system.n, 3], b.as_flattened().to_vec());
    Ok(Bundle::from([
        ("rows", Array::indices(&rows)),
        ("cols", Array::indices(&cols)),
        ("values", Array::vector(&values)),
        ("b", Array::F64 { shape, data }),
    ]))
}
