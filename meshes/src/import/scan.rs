//! Reading words and numbers from files that are text, binary, or a mixture of both.

use std::str::FromStr;

use super::{ImportError, Position};

type Result<T> = std::result::Result<T, ImportError>;

/// A number as it is stored in a binary file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// Size in a binary file, bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::I64 | Scalar::U64 | Scalar::F64 => 8,
        }
    }

    pub(super) fn is_integer(self) -> bool {
        !matches!(self, Scalar::F32 | Scalar::F64)
    }
}

/// A cursor over the bytes of a file.
///
/// Why one cursor for text and binary: Gmsh, PLY and legacy VTK files have text headers before binary numbers, and the
/// same sequence of numbers in either encoding, so that one reader with `integer` and `real` serves both. Nothing is
/// allocated here, and line numbers are counted only when an error needs one.
#[derive(Clone)]
pub(super) struct Scan<'a> {
    bytes: &'a [u8],
    /// Offset of the next byte.
    pub(super) pos: usize,
    /// Numbers are binary; places are told as byte offsets.
    pub(super) binary: bool,
    /// Binary numbers have their most significant byte first.
    pub(super) big_endian: bool,
}

impl<'a> Scan<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, pos: 0, binary: false, big_endian: false }
    }

    /// A cursor over binary numbers.
    pub(super) fn of_numbers(bytes: &'a [u8], big_endian: bool) -> Self {
        Self { bytes, pos: 0, binary: true, big_endian }
    }

    /// Where an offset is, as an author would count.
    pub(super) fn place(&self, pos: usize) -> Position {
        if self.binary {
            return Position::Byte(pos);
        }
        let before = &self.bytes[..pos.min(self.bytes.len())];
        Position::Line(1 + before.iter().filter(|&&b| b == b'\n').count())
    }

    /// Where the next byte is.
    pub(super) fn at(&self) -> Position {
        self.place(self.pos)
    }

    pub(super) fn remaining(&self) -> usize {
        self.bytes.len() - self.pos
    }

    /// All bytes from here to the end.
    pub(super) fn rest(&self) -> &'a [u8] {
        &self.bytes[self.pos..]
    }

    pub(super) fn skip_space(&mut self) {
        while self.bytes.get(self.pos).is_some_and(|b| b.is_ascii_whitespace() || *b == 0x0b) {
            self.pos += 1;
        }
    }

    /// Goes to the next word of a text, so that an error there names its line. Binary data stay untouched.
    pub(super) fn skip_space_of_text(&mut self) {
        if !self.binary {
            self.skip_space();
        }
    }

    /// The next word, over line ends, or `None` at the end of the file.
    pub(super) fn token(&mut self) -> Option<&'a [u8]> {
        self.skip_space();
        let rest = self.rest();
        let len = rest.iter().position(|b| b.is_ascii_whitespace() || *b == 0x0b).unwrap_or(rest.len());
        self.pos += len;
        (len > 0).then(|| &rest[..len])
    }

    /// The next word, left in place.
    pub(super) fn peek(&self) -> Option<&'a [u8]> {
        self.clone().token()
    }

    /// What is left of this line, without its end (any of LF, CR LF and CR), or `None` at the end of the file.
    pub(super) fn line(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest();
        if rest.is_empty() {
            return None;
        }
        let len = rest.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(rest.len());
        let end = if rest[len..].starts_with(b"\r\n") { 2 } else { usize::from(len < rest.len()) };
        self.pos += len + end;
        Some(&rest[..len])
    }

    /// The next line that is not blank, as a cursor that ends with it and tells places in the whole file.
    pub(super) fn row(&mut self) -> Scan<'a> {
        self.skip_space();
        let start = self.pos;
        let len = self.line().map_or(0, <[u8]>::len);
        Scan { bytes: &self.bytes[..start + len], pos: start, ..self.clone() }
    }

    /// The next word as text.
    pub(super) fn word(&mut self, expected: &str) -> Result<&'a str> {
        let token = self.token().ok_or_else(|| self.truncated(expected))?;
        std::str::from_utf8(token).map_err(|_| self.unexpected(token, expected))
    }

    /// A number written as text.
    pub(super) fn number<T: FromStr>(&mut self, expected: &str) -> Result<T> {
        let word = self.word(expected)?;
        word.parse().map_err(|_| self.unexpected(word.as_bytes(), expected))
    }

    /// The next `count` bytes.
    pub(super) fn take(&mut self, count: usize, expected: &str) -> Result<&'a [u8]> {
        let bytes = self.rest().get(..count).ok_or_else(|| {
            let end = Scan { pos: self.bytes.len(), ..self.clone() };
            end.truncated(expected)
        })?;
        self.pos += count;
        Ok(bytes)
    }

    /// The next number, which must be whole, as text or in this binary type.
    pub(super) fn integer(&mut self, kind: Scalar, expected: &str) -> Result<i64> {
        if !self.binary {
            return self.number(expected);
        }
        let start = self.pos;
        let bytes = self.take(kind.size(), expected)?;
        let (value, shown) = match kind {
            Scalar::F32 | Scalar::F64 => {
                let value = decode_real(bytes, kind, self.big_endian);
                (whole(value), value.to_string())
            }
            Scalar::U64 => {
                let value = decode_u64(bytes, self.big_endian);
                (i64::try_from(value).ok(), value.to_string())
            }
            _ => (Some(decode_integer(bytes, kind, self.big_endian)), String::new()),
        };
        value.ok_or_else(|| ImportError::Unexpected { at: self.place(start), expected: expected.into(), found: shown })
    }

    /// The next number, as text or in this binary type.
    pub(super) fn real(&mut self, kind: Scalar, expected: &str) -> Result<f64> {
        if !self.binary {
            return self.number(expected);
        }
        let big_endian = self.big_endian;
        Ok(decode_real(self.take(kind.size(), expected)?, kind, big_endian))
    }

    /// Checks that `count` things of at least `bytes_each` fit into what is left, so that a number from a damaged
    /// header is never believed when memory is reserved or a loop is run.
    pub(super) fn room(&self, count: i64, bytes_each: usize, what: &'static str) -> Result<usize> {
        let remaining = self.remaining();
        match usize::try_from(count) {
            Ok(count) if count.checked_mul(bytes_each).is_some_and(|needed| needed <= remaining) => Ok(count),
            Ok(count) => Err(ImportError::Count { at: self.at(), what, count: count as u64, remaining }),
            Err(_) => Err(ImportError::Unexpected {
                at: self.at(),
                expected: format!("the number of {what}"),
                found: count.to_string(),
            }),
        }
    }

    /// Jumps over the first `end` from here, for sections that are not needed.
    pub(super) fn skip_past(&mut self, end: &[u8]) -> Result<()> {
        match self.rest().windows(end.len()).position(|window| window == end) {
            Some(offset) => {
                self.pos += offset + end.len();
                Ok(())
            }
            None => {
                let tail = Scan { pos: self.bytes.len(), ..self.clone() };
                Err(tail.truncated(&String::from_utf8_lossy(end)))
            }
        }
    }

    /// The error for a file that ends here.
    pub(super) fn truncated(&self, expected: &str) -> ImportError {
        ImportError::Truncated { at: self.at(), expected: expected.into() }
    }

    /// The error for a word that was just read.
    pub(super) fn unexpected(&self, found: &[u8], expected: &str) -> ImportError {
        let at = self.place(self.pos.saturating_sub(found.len()));
        ImportError::Unexpected { at, expected: expected.into(), found: shown(found) }
    }

    /// The error for something wrong at an offset.
    pub(super) fn invalid(&self, pos: usize, problem: impl Into<String>) -> ImportError {
        ImportError::Invalid { at: self.place(pos), problem: problem.into() }
    }
}

/// Bytes of a file as they may be shown in a message: short, printable, quoted.
pub(super) fn shown(bytes: &[u8]) -> String {
    const SHOWN: usize = 32; // enough to find it, short enough for one line
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(SHOWN)]);
    format!("\"{}{}\"", text.escape_debug(), if bytes.len() > SHOWN { "..." } else { "" })
}

/// A floating-point number that is a whole number, exactly.
pub(super) fn whole(value: f64) -> Option<i64> {
    const EXACT: f64 = 9007199254740992.0; // 2^53: beyond it not every integer is an f64
    (value.fract() == 0.0 && value.abs() <= EXACT).then_some(value as i64)
}

/// The bytes of a number of at most eight bytes, least significant first, the rest zero.
fn little(bytes: &[u8], big_endian: bool) -> [u8; 8] {
    let mut word = [0; 8];
    for (i, &byte) in bytes.iter().take(8).enumerate() {
        word[if big_endian { bytes.len().min(8) - 1 - i } else { i }] = byte;
    }
    word
}

fn decode_u64(bytes: &[u8], big_endian: bool) -> u64 {
    u64::from_le_bytes(little(bytes, big_endian))
}

/// A stored integer; `U64` beyond `i64` wraps, which `Scan::integer` excludes.
fn decode_integer(bytes: &[u8], kind: Scalar, big_endian: bool) -> i64 {
    let word = decode_u64(bytes, big_endian);
    match kind {
        Scalar::I8 => i64::from(word as i8),
        Scalar::I16 => i64::from(word as i16),
        Scalar::I32 => i64::from(word as i32),
        _ => word as i64,
    }
}

/// A stored number of any type.
fn decode_real(bytes: &[u8], kind: Scalar, big_endian: bool) -> f64 {
    match kind {
        Scalar::F32 => f64::from(f32::from_bits(decode_u64(bytes, big_endian) as u32)),
        Scalar::F64 => f64::from_bits(decode_u64(bytes, big_endian)),
        Scalar::U64 => decode_u64(bytes, big_endian) as f64,
        _ => decode_integer(bytes, kind, big_endian) as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_numbers_and_lines() {
        let mut scan = Scan::new(b"a 12\r\n rest of it\rlast 1e3 x");
        assert_eq!(scan.token(), Some(&b"a"[..]));
        assert_eq!(scan.number::<i64>("count"), Ok(12));
        assert_eq!(scan.line(), Some(&b""[..]));
        assert_eq!(scan.line(), Some(&b" rest of it"[..]));
        assert_eq!(scan.token(), Some(&b"last"[..]));
        assert_eq!(scan.real(Scalar::F64, "x"), Ok(1000.0));
        let error = scan.number::<f64>("the y coordinate").unwrap_err();
        assert_eq!(error.to_string(), "line 2: expected the y coordinate, found \"x\"");
        assert_eq!((scan.token(), scan.line()), (None, None));
    }

    #[test]
    fn binary_numbers_of_either_byte_order() {
        for big_endian in [false, true] {
            let order = |mut bytes: Vec<u8>| {
                if big_endian {
                    bytes.reverse();
                }
                bytes
            };
            let bytes: Vec<u8> = [
                order((-2_i8).to_le_bytes().into()),
                order((-300_i16).to_le_bytes().into()),
                order((-70_000_i32).to_le_bytes().into()),
                order(4_000_000_000_u32.to_le_bytes().into()),
                order((-5_i64).to_le_bytes().into()),
                order(0.1_f64.to_le_bytes().into()),
                order(3.0_f32.to_le_bytes().into()),
                order(u64::MAX.to_le_bytes().into()),
            ]
            .concat();
            let mut scan = Scan::of_numbers(&bytes, big_endian);
            assert_eq!(scan.integer(Scalar::I8, "n"), Ok(-2));
            assert_eq!(scan.integer(Scalar::I16, "n"), Ok(-300));
            assert_eq!(scan.integer(Scalar::I32, "n"), Ok(-70_000));
            assert_eq!(scan.integer(Scalar::U32, "n"), Ok(4_000_000_000));
            assert_eq!(scan.integer(Scalar::I64, "n"), Ok(-5));
            assert_eq!(scan.real(Scalar::F64, "x"), Ok(0.1));
            assert_eq!(scan.integer(Scalar::F32, "n"), Ok(3));
            assert!(scan.integer(Scalar::U64, "n").is_err());
            let error = scan.take(1, "more").unwrap_err();
            assert_eq!(error, ImportError::Truncated { at: Position::Byte(bytes.len()), expected: "more".into() });
        }
    }

    #[test]
    fn a_lying_count_is_caught() {
        let scan = Scan::new(b"0123456789");
        assert_eq!(scan.room(2, 5, "nodes"), Ok(2));
        assert!(scan.room(3, 5, "nodes").is_err());
        assert!(scan.room(-1, 5, "nodes").is_err());
        assert!(scan.room(i64::MAX, usize::MAX, "nodes").is_err());
    }
}
