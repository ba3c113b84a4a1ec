//! The triangles of a rectangular grid.

/// Splits `columns` x `rows` quads into triangles; vertex (column, row) has the index `column (rows + 1) + row`.
///
/// Seen with columns to the right and rows upwards, triangles run counter-clockwise. Diagonals alternate as on a chequerboard, so that the
/// surface prefers no direction.
pub(super) fn faces(columns: usize, rows: usize) -> Vec<[u32; 3]> {
    let mut faces = Vec::with_capacity(2 * columns * rows);
    for column in 0..columns {
        for row in 0..rows {
            let at = |c: usize, r: usize| ((column + c) * (rows + 1) + row + r) as u32;
            let quad = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
            faces.extend(split(quad, (column + row) % 2 == 0));
        }
    }
    faces
}

/// The two triangles of a quad, cut from its first to its third corner or from its second to its fourth.
pub(super) fn split([a, b, c, d]: [u32; 4], from_first: bool) -> [[u32; 3]; 2] {
    if from_first {
        [[a, b, c], [a, c, d]]
    } else {
        [[a, b, d], [b, c, d]]
    }
}
