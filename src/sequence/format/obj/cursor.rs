//! A place in the bytes of a text file, never further than one line's allowance ahead.

use super::parse::{Fault, MAX_LINE};
use super::problem::ObjProblem;

/// Walks over bytes line by line. A line ends with LF, CR LF or CR.
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
    line_start: usize,
    /// How far this line may reach: whoever arrives here before the end of the file is in too long a line.
    limit: usize,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";
        let at = match bytes.starts_with(BYTE_ORDER_MARK) {
            true => BYTE_ORDER_MARK.len(),
            false => 0,
        };
        let limit = bytes.len().min(at + MAX_LINE);
        Self {
            bytes,
            at,
            line: 1,
            line_start: at,
            limit,
        }
    }

    /// The number of this line, from 1.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// The offset in the file where this line starts.
    pub(super) fn line_start(&self) -> usize {
        self.line_start
    }

    pub(super) fn at_end_of_file(&self) -> bool {
        self.at == self.bytes.len()
    }

    /// Whether [`Cursor::rest`] reaches to the end of the file.
    pub(super) fn sees_end_of_file(&self) -> bool {
        self.limit == self.bytes.len()
    }

    /// What is left of this line and what follows, up to the allowance of one line.
    #[inline]
    pub(super) fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..self.limit]
    }

    #[inline]
    pub(super) fn peek(&self) -> Option<u8> {
        self.rest().first().copied()
    }

    #[inline]
    pub(super) fn advance(&mut self, count: usize) {
        self.at += count;
    }

    /// Steps over `byte` if it comes next.
    #[inline]
    pub(super) fn eat(&mut self, byte: u8) -> bool {
        let found = self.peek() == Some(byte);
        self.at += usize::from(found);
        found
    }

    /// Steps over blanks, tabs and line ends behind a `\`.
    #[inline]
    pub(super) fn skip_blanks(&mut self) -> Result<(), Fault> {
        loop {
            match self.peek() {
                Some(b' ' | b'\t') => self.at += 1,
                Some(b'\\') if self.continues() => self.next_line_after_backslash()?,
                _ => return Ok(()),
            }
        }
    }

    fn continues(&self) -> bool {
        matches!(self.rest(), [b'\\', b'\n' | b'\r', ..])
    }

    #[cold]
    fn next_line_after_backslash(&mut self) -> Result<(), Fault> {
        let fault = self.fault(ObjProblem::CutOff);
        self.at += 1;
        self.skip_line()?;
        match self.at_end_of_file() {
            true => Err(fault),
            false => Ok(()),
        }
    }

    /// Whether nothing more is said on this line: its end, the end of the file, or a comment.
    #[inline]
    pub(super) fn at_end_of_line(&self) -> Result<bool, Fault> {
        match self.peek() {
            Some(b'\n' | b'\r' | b'#') => Ok(true),
            Some(_) => Ok(false),
            None => self.refuse_long_line().map(|()| true),
        }
    }

    /// Moves to the start of the next line.
    #[inline]
    pub(super) fn skip_line(&mut self) -> Result<(), Fault> {
        let end = self.rest().iter().position(|&c| c == b'\n' || c == b'\r');
        match end {
            Some(length) => self.at += length,
            None => {
                self.at = self.limit;
                self.refuse_long_line()?;
            }
        }
        let carriage_return = self.eat(b'\r');
        // Not by `eat`: the LF of a CR LF may lie just beyond the allowance.
        let line_feed = self.bytes.get(self.at) == Some(&b'\n');
        self.at += usize::from(line_feed);
        self.line += usize::from(carriage_return || line_feed);
        self.line_start = self.at;
        self.limit = self.bytes.len().min(self.at.saturating_add(MAX_LINE));
        Ok(())
    }

    fn refuse_long_line(&self) -> Result<(), Fault> {
        match self.at == self.limit && !self.sees_end_of_file() {
            true => Err(self.fault(ObjProblem::LineTooLong)),
            false => Ok(()),
        }
    }

    /// The blank-delimited text that comes next, for a message: at most 40 bytes of it.
    pub(super) fn text(&self) -> String {
        let end = |c: &u8| matches!(c, b' ' | b'\t' | b'\r' | b'\n');
        let rest = self.rest();
        let length = rest.iter().take(40).position(end);
        let text = &rest[..length.unwrap_or(rest.len().min(40))];
        text.escape_ascii().to_string()
    }

    #[cold]
    pub(super) fn fault(&self, problem: ObjProblem) -> Fault {
        Fault {
            line: self.line,
            column: self.at - self.line_start + 1,
            problem,
        }
    }
}
