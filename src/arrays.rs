//! Typed arrays under names: what stages take and give, what the wire carries and what an `.npz` holds.

use std::collections::BTreeMap;

use faer::{Mat, MatRef};
use thiserror::Error;

/// A row-major array or a text. A shape of no dimensions is a scalar.
#[derive(Clone, Debug, PartialEq)]
pub enum Array {
    F64 { shape: Vec<usize>, data: Vec<f64> },
    I64 { shape: Vec<usize>, data: Vec<i64> },
    Text(String),
}

impl Array {
    /// The points of the plane as an (n, 2) array.
    pub fn points(points: &[[f64; 2]]) -> Self {
        Self::F64 {
            shape: vec![points.len(), 2],
            data: points.as_flattened().to_vec(),
        }
    }

    /// A list of numbers.
    pub fn vector(data: &[f64]) -> Self {
        Self::F64 {
            shape: vec![data.len()],
            data: data.to_vec(),
        }
    }

    /// Positions x0 y0 z0 x1 ... as a (V, 3) array.
    pub fn vertices(positions: &[f64]) -> Self {
        Self::F64 {
            shape: vec![positions.len() / 3, 3],
            data: positions.to_vec(),
        }
    }

    /// One whole number.
    pub fn integer(value: usize) -> Self {
        Self::I64 {
            shape: Vec::new(),
            data: vec![value as i64],
        }
    }

    /// A list of whole numbers.
    pub fn integers(data: &[i64]) -> Self {
        Self::I64 {
            shape: vec![data.len()],
            data: data.to_vec(),
        }
    }

    /// A list of 0-based indices.
    pub fn indices(indices: &[usize]) -> Self {
        Self::I64 {
            shape: vec![indices.len()],
            data: indices.iter().map(|&i| i as i64).collect(),
        }
    }

    /// Triangles as an (F, 3) array of 0-based indices.
    pub fn triangles(faces: &[[u32; 3]]) -> Self {
        Self::I64 {
            shape: vec![faces.len(), 3],
            data: faces.as_flattened().iter().map(|&v| v.into()).collect(),
        }
    }

    /// A matrix whose columns become the rows of the array, so that nothing moves in memory: m x n becomes (n, m).
    pub fn columns(matrix: MatRef<'_, f64>) -> Self {
        Self::F64 {
            shape: vec![matrix.ncols(), matrix.nrows()],
            data: matrix.col_iter().flat_map(|c| c.iter().copied()).collect(),
        }
    }

    /// Its extents; none for a scalar or a text.
    pub fn shape(&self) -> &[usize] {
        match self {
            Self::F64 { shape, .. } | Self::I64 { shape, .. } => shape,
            Self::Text(_) => &[],
        }
    }

    /// f64, i64 or text.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::F64 { .. } => "f64",
            Self::I64 { .. } => "i64",
            Self::Text(_) => "text",
        }
    }

    /// What this is, for a message: `f64 [2, 3]`.
    pub fn describe(&self) -> String {
        match self {
            Self::F64 { shape, .. } | Self::I64 { shape, .. } => {
                format!("{} {shape:?}", self.kind())
            }
            Self::Text(_) => "text".into(),
        }
    }
}

/// A bundle lacks an array, or has another kind of it.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("array `{name}`: expected {expected}, found {found}")]
pub struct ArrayError {
    pub name: String,
    pub expected: String,
    pub found: String,
}

/// Arrays by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bundle(pub BTreeMap<String, Array>);

impl<const N: usize> From<[(&str, Array); N]> for Bundle {
    fn from(arrays: [(&str, Array); N]) -> Self {
        Self(
            arrays
                .into_iter()
                .map(|(name, a)| (name.into(), a))
                .collect(),
        )
    }
}

impl Bundle {
    /// The array of this name.
    pub fn get(&self, name: &str) -> Result<&Array, ArrayError> {
        self.0.get(name).ok_or_else(|| ArrayError {
            name: name.into(),
            expected: "it to be there".into(),
            found: format!("only {:?}", self.0.keys().collect::<Vec<_>>()),
        })
    }

    fn wrong(&self, name: &str, expected: &str) -> ArrayError {
        ArrayError {
            name: name.into(),
            expected: expected.into(),
            found: self.0.get(name).map_or("nothing".into(), Array::describe),
        }
    }

    /// An f64 array with this many dimensions: its shape and data.
    pub fn f64(&self, name: &str, rank: usize) -> Result<(&[usize], &[f64]), ArrayError> {
        match self.get(name)? {
            Array::F64 { shape, data } if shape.len() == rank => Ok((shape, data)),
            _ => Err(self.wrong(name, &format!("an f64 array of rank {rank}"))),
        }
    }

    /// A list of numbers.
    pub fn vector(&self, name: &str) -> Result<&[f64], ArrayError> {
        Ok(self.f64(name, 1)?.1)
    }

    /// A (rows, columns) array as the columns x rows matrix whose columns are the rows: no copy.
    pub fn columns(&self, name: &str) -> Result<MatRef<'_, f64>, ArrayError> {
        let (shape, data) = self.f64(name, 2)?;
        Ok(MatRef::from_column_major_slice(data, shape[1], shape[0]))
    }

    /// [`Bundle::columns`], copied.
    pub fn matrix(&self, name: &str) -> Result<Mat<f64>, ArrayError> {
        Ok(self.columns(name)?.to_owned())
    }

    /// An (n, 2) array as points.
    pub fn points(&self, name: &str) -> Result<Vec<[f64; 2]>, ArrayError> {
        match self.f64(name, 2)? {
            (&[_, 2], data) => Ok(data.as_chunks::<2>().0.to_vec()),
            _ => Err(self.wrong(name, "an f64 array of shape (n, 2)")),
        }
    }

    fn i64(&self, name: &str, rank: usize) -> Result<&[i64], ArrayError> {
        match self.get(name)? {
            Array::I64 { shape, data } if shape.len() == rank => Ok(data),
            _ => Err(self.wrong(name, &format!("an i64 array of rank {rank}"))),
        }
    }

    /// One whole number, at least 0.
    pub fn integer(&self, name: &str) -> Result<usize, ArrayError> {
        usize::try_from(self.i64(name, 0)?[0])
            .map_err(|_| self.wrong(name, "a number of at least 0"))
    }

    /// A list of whole numbers.
    pub fn integers(&self, name: &str) -> Result<&[i64], ArrayError> {
        self.i64(name, 1)
    }

    /// A list of 0-based indices.
    pub fn indices(&self, name: &str) -> Result<Vec<usize>, ArrayError> {
        let whole = self.i64(name, 1)?.iter().map(|&i| usize::try_from(i));
        whole
            .collect::<Result<_, _>>()
            .map_err(|_| self.wrong(name, "indices of at least 0"))
    }

    /// An (n, 3) i64 array as 0-based triangles.
    pub fn triangles(&self, name: &str) -> Result<Vec<[u32; 3]>, ArrayError> {
        let wrong = || self.wrong(name, "an i64 array of shape (F, 3) of 32-bit indices");
        let Array::I64 { shape, data } = self.get(name)? else {
            return Err(wrong());
        };
        if shape.len() != 2 || shape[1] != 3 {
            return Err(wrong());
        }
        let narrow: Result<Vec<u32>, _> = data.iter().map(|&i| u32::try_from(i)).collect();
        Ok(narrow.map_err(|_| wrong())?.as_chunks::<3>().0.to_vec())
    }

    /// A text.
    pub fn text(&self, name: &str) -> Result<&str, ArrayError> {
        match self.get(name)? {
            Array::Text(text) => Ok(text),
            _ => Err(self.wrong(name, "text")),
        }
    }

    /// Adds or replaces an array.
    pub fn put(&mut self, name: &str, array: Array) {
        self.0.insert(name.into(), array);
    }

    /// The first number that is NaN or infinite, as `name[index]`.
    pub fn first_not_finite(&self) -> Option<String> {
        self.first_beyond(f64::MAX)
    }

    /// The first number that is NaN or of greater magnitude than this, as `name[index]`.
    pub fn first_beyond(&self, greatest: f64) -> Option<String> {
        self.0.iter().find_map(|(name, array)| match array {
            Array::F64 { data, .. } => {
                let at = data.iter().position(|x| x.is_nan() || x.abs() > greatest)?;
                Some(format!("{name}[{at}] = {}", data[at]))
            }
            _ => None,
        })
    }
}
