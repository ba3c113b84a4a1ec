//! The header of an NPY array: `{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }`, as numpy's format.py defines it.

/// The longest header text, as numpy's own `max_header_size`.
pub(super) const MAX_HEADER: usize = 10_000;

const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// What an element is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// IEEE floating point of 4 or 8 bytes.
    Float,
    /// Two's complement of 1, 2, 4 or 8 bytes.
    Signed,
    /// Unsigned of 1, 2, 4 or 8 bytes; also booleans.
    Unsigned,
    /// UTF-32, padded with zeros.
    Text,
}

/// A parsed header.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Header {
    /// The dtype as written, for messages.
    pub(super) dtype: String,
    pub(super) kind: Kind,
    /// Bytes an element.
    pub(super) width: usize,
    pub(super) big_endian: bool,
    /// First index fastest.
    pub(super) fortran: bool,
    pub(super) shape: Vec<u64>,
}

/// Why a header text is refused.
#[derive(Debug, PartialEq)]
pub(super) enum Refusal {
    Malformed(String),
    Unsupported(String),
}

/// The length of the header text, from the first bytes (at least 12) of an array, and how many of these come before the text.
pub(super) fn text_length(start: &[u8]) -> Result<(usize, usize), Refusal> {
    if !start.starts_with(MAGIC) {
        return Err(Refusal::Malformed(
            "it does not start with \\x93NUMPY".into(),
        ));
    }
    let (length, before) = match start[6] {
        1 => (u32::from(u16::from_le_bytes([start[8], start[9]])), 10),
        2 | 3 => (
            u32::from_le_bytes([start[8], start[9], start[10], start[11]]),
            12,
        ),
        version => return Err(Refusal::Unsupported(format!("NPY version {version}"))),
    };
    match length as usize <= MAX_HEADER {
        true => Ok((length as usize, before)),
        false => Err(Refusal::Malformed(format!(
            "it claims {length} bytes, expected at most {MAX_HEADER}"
        ))),
    }
}

/// Parses the header text.
pub(super) fn parse(text: &[u8]) -> Result<Header, Refusal> {
    let malformed = |what: &str| Refusal::Malformed(what.to_string());
    let text = str::from_utf8(text).map_err(|_| malformed("it is not UTF-8"))?;
    let (mut descr, mut fortran, mut shape) = (None, None, None);
    let mut rest = Reader(text);
    rest.expect("{")?;
    while !rest.eat("}") {
        let key = rest.string()?;
        rest.expect(":")?;
        match key {
            "descr" if rest.0.trim_start().starts_with(['[', '(']) => {
                return Err(Refusal::Unsupported("a structured dtype".into()));
            }
            "descr" => descr = Some(rest.string()?),
            "fortran_order" => fortran = Some(rest.boolean()?),
            "shape" => shape = Some(rest.tuple()?),
            other => return Err(malformed(&format!("unknown key '{other}'"))),
        }
        if !rest.eat(",") {
            rest.expect("}")?;
            break;
        }
    }
    let (Some(descr), Some(fortran), Some(shape)) = (descr, fortran, shape) else {
        return Err(malformed("it lacks descr, fortran_order or shape"));
    };
    let (kind, width, big_endian) =
        dtype(descr).ok_or_else(|| Refusal::Unsupported(format!("dtype '{descr}'")))?;
    Ok(Header {
        dtype: descr.to_string(),
        kind,
        width,
        big_endian,
        fortran,
        shape,
    })
}

/// Kind, bytes an element and byte order of a dtype such as `<f8`.
fn dtype(descr: &str) -> Option<(Kind, usize, bool)> {
    let (order, rest) = descr.split_at_checked(1)?;
    let (kind, size) = rest.split_at_checked(1)?;
    let big_endian = match order {
        "<" | "|" => false,
        ">" => true,
        _ => return None,
    };
    let size: usize = size.parse().ok()?;
    let (kind, width) = match (kind, size) {
        ("f", 4 | 8) => (Kind::Float, size),
        ("i", 1 | 2 | 4 | 8) => (Kind::Signed, size),
        ("u", 1 | 2 | 4 | 8) | ("b", 1) => (Kind::Unsigned, size),
        ("U", _) => (Kind::Text, size.checked_mul(4)?),
        _ => return None,
    };
    Some((kind, width, big_endian))
}

/// Reads the few Python literals that a header is made of.
struct Reader<'a>(&'a str);

impl<'a> Reader<'a> {
    fn eat(&mut self, token: &str) -> bool {
        let rest = self.0.trim_start().strip_prefix(token);
        self.0 = rest.unwrap_or(self.0);
        rest.is_some()
    }

    fn expect(&mut self, token: &str) -> Result<(), Refusal> {
        match self.eat(token) {
            true => Ok(()),
            false => Err(self.unexpected(token)),
        }
    }

    fn unexpected(&self, wanted: &str) -> Refusal {
        let found: String = self.0.trim_start().chars().take(20).collect();
        Refusal::Malformed(format!(
            "expected {wanted}, found '{}'",
            found.escape_debug()
        ))
    }

    fn string(&mut self) -> Result<&'a str, Refusal> {
        for quote in ["'", "\""] {
            if self.eat(quote) {
                let (text, rest) = self
                    .0
                    .split_once(quote)
                    .ok_or_else(|| self.unexpected(quote))?;
                self.0 = rest;
                return Ok(text);
            }
        }
        Err(self.unexpected("a string"))
    }

    fn boolean(&mut self) -> Result<bool, Refusal> {
        if self.eat("True") {
            return Ok(true);
        }
        self.expect("False").map(|()| false)
    }

    fn tuple(&mut self) -> Result<Vec<u64>, Refusal> {
        self.expect("(")?;
        let mut items = Vec::new();
        while !self.eat(")") {
            items.push(self.integer()?);
            if !self.eat(",") {
                self.expect(")")?;
                break;
            }
        }
        Ok(items)
    }

    fn integer(&mut self) -> Result<u64, Refusal> {
        let text = self.0.trim_start();
        let end = text.find(|c: char| !c.is_ascii_digit());
        let (digits, rest) = text.split_at(end.unwrap_or(text.len()));
        let value = digits
            .parse()
            .map_err(|_| self.unexpected("a length below 2^64"))?;
        self.0 = rest;
        Ok(value)
    }
}

/// The bytes before the elements of a C-ordered array: as numpy writes them, padded to a multiple of 64.
pub(super) fn header(dtype: &str, shape: &[usize]) -> Vec<u8> {
    let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
    let comma = if shape.len() == 1 { "," } else { "" };
    let shape = format!("({}{comma})", lengths.join(", "));
    let text = format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}");
    let length = (10 + text.len() + 1).next_multiple_of(64) - 10;
    // Version 2 exists for texts beyond 16 bits; callers keep shapes far below (see `MAX_AXES`).
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(format!("{text:<width$}\n", width = length - 1).bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numpy_headers() {
        let text = b"{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }      \n";
        let parsed = parse(text).unwrap();
        assert_eq!((parsed.kind, parsed.width), (Kind::Float, 8));
        assert_eq!((parsed.fortran, &parsed.shape[..]), (false, &[2, 3][..]));
        let text = b"{\"shape\":(3,),'fortran_order':True,'descr':'>i4'}";
        let parsed = parse(text).unwrap();
        assert_eq!((parsed.kind, parsed.width), (Kind::Signed, 4));
        assert!(parsed.big_endian && parsed.fortran);
        assert_eq!(
            parse(b"{'descr': '<U7', 'fortran_order': False, 'shape': ()}")
                .unwrap()
                .width,
            28
        );
    }

    #[test]
    fn refusals() {
        for (text, unsupported) in [
            ("", false),
            ("{'descr': '<f8'}", false),
            ("{'descr': '<f8', 'fortran_order': 0, 'shape': ()}", false),
            (
                "{'descr': '<f8', 'fortran_order': True, 'shape': (-1,)}",
                false,
            ),
            (
                "{'descr': '<f8', 'fortran_order': True, 'shape': (18446744073709551616,)}",
                false,
            ),
            (
                "{'descr': '<f8', 'fortran_order': True, 'shape': ((((((((((",
                false,
            ),
            ("{'descr': '|O', 'fortran_order': True, 'shape': ()}", true),
            ("{'descr': '<f2', 'fortran_order': True, 'shape': ()}", true),
            (
                "{'descr': [('a', '<f8')], 'fortran_order': True, 'shape': ()}",
                true,
            ),
            ("{'descr': '<é8', 'fortran_order': True, 'shape': ()}", true),
        ] {
            let refusal = parse(text.as_bytes()).unwrap_err();
            let found = matches!(refusal, Refusal::Unsupported(_));
            assert_eq!(found, unsupported, "{text}: {refusal:?}");
        }
    }

    #[test]
    fn written_headers_parse_and_are_aligned() {
        for shape in [&[][..], &[0], &[1, 2], &[usize::MAX; 8]] {
            let bytes = header("<f8", shape);
            assert_eq!(bytes.len() % 64, 0);
            let (length, before) = text_length(&bytes).unwrap();
            assert_eq!(length + before, bytes.len());
            let parsed = parse(&bytes[before..]).unwrap();
            assert!(parsed.shape.iter().zip(shape).all(|(a, b)| *a == *b as u64));
        }
    }
}
