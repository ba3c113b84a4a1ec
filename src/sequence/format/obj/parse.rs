//! One pass over the bytes of an OBJ file.

use super::cursor::Cursor;
use super::problem::ObjProblem;

/// The longest line, in bytes. A line of this length or more is refused before anything is made of it.
pub(super) const MAX_LINE: usize = 1 << 20;

/// A place (line and byte column, both from 1) and what is wrong there.
#[derive(Debug, PartialEq)]
pub(super) struct Fault {
    pub(super) line: usize,
    pub(super) column: usize,
    pub(super) problem: ObjProblem,
}

/// Takes what a file holds, in its own order.
pub(super) trait Visitor {
    fn vertex(&mut self, position: [f64; 3]);
    /// Corners are 0-based and, when the pass succeeds, in range.
    fn triangle(&mut self, corners: [u32; 3], line: usize);
}

/// What a pass over a whole file has seen.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Summary {
    pub(super) vertices: u64,
    /// Offset of the line of the first face.
    pub(super) first_face: Option<usize>,
    /// Whether a vertex follows a face.
    pub(super) vertex_after_face: bool,
    /// Whether a corner is counted from the end (a negative index).
    pub(super) relative: bool,
    /// The largest absolute index, 1-based.
    largest: u64,
}

/// Passes everything in `bytes` to `visitor`. See [`super::read`] for what is understood.
///
/// A face may come before its vertices, so indices are held against their number at the end; when one is out of range a
/// second pass finds where it stands.
pub(super) fn parse(bytes: &[u8], visitor: &mut impl Visitor) -> Result<Summary, Fault> {
    let summary = pass(bytes, u64::MAX, visitor)?;
    match summary.largest > summary.vertices {
        true => pass(bytes, summary.vertices, &mut Nobody),
        false => Ok(summary),
    }
}

struct Nobody;

impl Visitor for Nobody {
    fn vertex(&mut self, _: [f64; 3]) {}
    fn triangle(&mut self, _: [u32; 3], _: usize) {}
}

fn pass(bytes: &[u8], largest: u64, visitor: &mut impl Visitor) -> Result<Summary, Fault> {
    let mut cursor = Cursor::new(bytes);
    let mut seen = Summary::default();
    while !cursor.at_end_of_file() {
        while matches!(cursor.peek(), Some(b' ' | b'\t')) {
            cursor.advance(1);
        }
        match cursor.rest() {
            [b'v', after, ..] if ends_keyword(*after) => vertex(&mut cursor, &mut seen, visitor)?,
            [b'f', after, ..] if ends_keyword(*after) => {
                face(&mut cursor, &mut seen, largest, visitor)?
            }
            [b'v'] => return Err(cursor.fault(ObjProblem::TooFewCoordinates { found: 0 })),
            [b'f'] => return Err(cursor.fault(ObjProblem::TooFewCorners { found: 0 })),
            _ => {}
        }
        cursor.skip_line()?;
    }
    Ok(seen)
}

fn ends_keyword(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\n' | b'\\' | b'#')
}

fn vertex(
    cursor: &mut Cursor,
    seen: &mut Summary,
    visitor: &mut impl Visitor,
) -> Result<(), Fault> {
    let position = match plain_position(cursor.rest()) {
        Some((position, length)) => {
            cursor.advance(length);
            position
        }
        None => any_position(cursor, seen)?,
    };
    visitor.vertex(position);
    seen.vertices += 1;
    seen.vertex_after_face |= seen.first_face.is_some();
    Ok(())
}

/// The position on a line `v x y z`, as nearly all are, and its length; whatever is not so plain is for [`any_position`].
#[inline]
fn plain_position(rest: &[u8]) -> Option<([f64; 3], usize)> {
    let mut position = [0.0f64; 3];
    let mut at = 1;
    for coordinate in &mut position {
        let text = rest.get(at..)?.strip_prefix(b" ")?;
        let (value, length) = fast_float2::parse_partial(text).ok()?;
        *coordinate = value;
        at += 1 + length;
    }
    let ends = matches!(rest.get(at), Some(b'\n' | b'\r'));
    let finite = position.iter().all(|x| x.is_finite());
    (ends && finite).then_some((position, at))
}

/// The position on any line `v ...`, up to the end of the line.
fn any_position(cursor: &mut Cursor, seen: &Summary) -> Result<[f64; 3], Fault> {
    cursor.advance(1);
    let mut position = [0.0; 3];
    for (found, coordinate) in position.iter_mut().enumerate() {
        cursor.skip_blanks()?;
        if cursor.at_end_of_line()? {
            return Err(cursor.fault(ObjProblem::TooFewCoordinates { found }));
        }
        let (value, length) = number(cursor)?;
        if !value.is_finite() {
            return Err(not_finite(cursor, seen.vertices, found));
        }
        *coordinate = value;
        cursor.advance(length);
    }
    weight_or_colour(cursor)?;
    Ok(position)
}

/// The number that comes next and its length in bytes. Correctly rounded.
#[inline]
fn number(cursor: &Cursor) -> Result<(f64, usize), Fault> {
    let rest = cursor.rest();
    match fast_float2::parse_partial(rest) {
        Ok((_, length)) if length == rest.len() && !cursor.sees_end_of_file() => {
            Err(cursor.fault(ObjProblem::LineTooLong))
        }
        Ok((value, length)) if rest.get(length).is_none_or(|&c| ends_keyword(c)) => {
            Ok((value, length))
        }
        _ => Err(bad_number(cursor)),
    }
}

#[cold]
fn bad_number(cursor: &Cursor) -> Fault {
    let text = cursor.text();
    cursor.fault(ObjProblem::BadNumber { text })
}

#[cold]
fn not_finite(cursor: &Cursor, vertex: u64, axis: usize) -> Fault {
    cursor.fault(ObjProblem::NotFinite {
        vertex,
        axis: ['x', 'y', 'z'][axis],
        text: cursor.text(),
    })
}

/// Steps over the numbers that may follow a position: they must be numbers, or else two lines have run into one.
#[inline]
fn weight_or_colour(cursor: &mut Cursor) -> Result<(), Fault> {
    for extra in 0.. {
        cursor.skip_blanks()?;
        if cursor.at_end_of_line()? {
            break;
        }
        let (_, length) = number(cursor)?;
        if extra == 4 {
            let text = cursor.text();
            return Err(cursor.fault(ObjProblem::TooManyCoordinates { text }));
        }
        cursor.advance(length);
    }
    Ok(())
}

/// A polygon, as the fan of triangles around its first corner.
fn face(
    cursor: &mut Cursor,
    seen: &mut Summary,
    largest: u64,
    visitor: &mut impl Visitor,
) -> Result<(), Fault> {
    let line = cursor.line();
    seen.first_face.get_or_insert(cursor.line_start());
    cursor.advance(1);
    let (mut first, mut previous) = (0, 0);
    for found in 0.. {
        cursor.skip_blanks()?;
        if cursor.at_end_of_line()? {
            if found < 3 {
                return Err(cursor.fault(ObjProblem::TooFewCorners { found }));
            }
            break;
        }
        let corner = corner(cursor, seen, largest)?;
        match found {
            0 => first = corner,
            1 => {}
            _ => visitor.triangle([first, previous, corner], line),
        }
        previous = corner;
    }
    Ok(())
}

/// A corner `v`, `v/t`, `v//n` or `v/t/n`: its vertex, 0-based. What follows a slash must be an index or nothing.
#[inline]
fn corner(cursor: &mut Cursor, seen: &mut Summary, largest: u64) -> Result<u32, Fault> {
    let rest = cursor.rest();
    let negative = rest.first() == Some(&b'-');
    let (value, mut length) = digits(rest, usize::from(negative));
    let has_digits = length > usize::from(negative);
    for _ in 0..2 {
        if rest.get(length) == Some(&b'/') {
            length += 1;
            length += usize::from(rest.get(length) == Some(&b'-'));
            length = digits(rest, length).1;
        }
    }
    if !has_digits || rest.get(length).is_some_and(|&c| !ends_keyword(c)) {
        let text = cursor.text();
        return Err(cursor.fault(ObjProblem::BadCorner { text }));
    }
    if value == 0 {
        return Err(cursor.fault(ObjProblem::IndexZero));
    }
    if value > if negative { seen.vertices } else { largest } {
        return Err(out_of_range(cursor, seen, negative, largest));
    }
    cursor.advance(length);
    seen.relative |= negative;
    Ok(if negative {
        (seen.vertices - value) as u32
    } else {
        seen.largest = seen.largest.max(value);
        (value - 1) as u32
    })
}

/// The number whose digits start at `from` (`u64::MAX` when larger than that), and where they end.
#[inline]
fn digits(bytes: &[u8], from: usize) -> (u64, usize) {
    let (mut value, mut at) = (0u64, from);
    while let Some(digit) = bytes.get(at).map(|c| c.wrapping_sub(b'0'))
        && digit <= 9
    {
        value = value.saturating_mul(10).saturating_add(digit.into());
        at += 1;
    }
    (value, at)
}

#[cold]
fn out_of_range(cursor: &Cursor, seen: &Summary, negative: bool, largest: u64) -> Fault {
    let vertices = if negative { seen.vertices } else { largest };
    let text = cursor.text();
    cursor.fault(ObjProblem::IndexOutOfRange { text, vertices })
}
