//! The arrays of a VTK XML file in all their encodings.
//!
//! Binary data begin with a count of bytes, 32 or 64 bits wide as the file says (`header_type`). Compressed data begin
//! with several such numbers: how many blocks, bytes of a full block, bytes of the last block (0: it is full), and the
//! compressed bytes of each. In base64 the header of compressed data is encoded apart from the data.

use std::io::Read;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use roxmltree::Node;

use super::{Result, invalid, line};
use crate::import::scan::{Scalar, Scan, shown};
use crate::import::{ImportError, Position};

/// How a file stores its arrays.
pub(super) struct Storage<'a> {
    big_endian: bool,
    header: Scalar,
    compressed: bool,
    /// The appended block, without the underscore that begins it, and whether it is raw instead of base64.
    appended: Option<(&'a [u8], bool)>,
    /// Offset of the appended block in the file.
    base: usize,
}

impl<'a> Storage<'a> {
    /// From the attributes of the root element, and the tail of the file from `<AppendedData` on, which begins at this
    /// offset.
    pub(super) fn new(root: Node<'_, '_>, tail: &'a [u8], offset: usize) -> Result<Self> {
        let unexpected = |attribute: &str, found: &str, expected: &str| ImportError::Unexpected {
            at: line(root),
            expected: format!("{expected} as {attribute}"),
            found: shown(found.as_bytes()),
        };
        let big_endian = match root.attribute("byte_order") {
            Some("BigEndian") => true,
            Some("LittleEndian") | None => false,
            Some(other) => return Err(unexpected("byte_order", other, "LittleEndian or BigEndian")),
        };
        let header = match root.attribute("header_type") {
            Some("UInt32") | None => Scalar::U32,
            Some("UInt64") => Scalar::U64,
            Some(other) => return Err(unexpected("header_type", other, "UInt32 or UInt64")),
        };
        let compressed = match root.attribute("compressor") {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => {
                return Err(ImportError::Unsupported {
                    what: format!("the file is compressed by {other}"),
                    change: "save it with zlib compression, or without any",
                });
            }
        };
        let mut storage = Self { big_endian, header, compressed, appended: None, base: offset };
        if !tail.is_empty() {
            let broken = |problem: &str| ImportError::Invalid {
                at: Position::Byte(offset),
                problem: format!("{problem}: the file was cut short or damaged, export it again"),
            };
            let end = tail.iter().position(|&b| b == b'>').ok_or_else(|| broken("<AppendedData has no end"))?;
            let tag = String::from_utf8_lossy(&tail[..end]);
            let raw = match tag.split(['"', '\'']).nth(1) {
                Some("raw") => true,
                Some("base64") => false,
                _ => return Err(broken("<AppendedData> says neither encoding=\"raw\" nor encoding=\"base64\"")),
            };
            let body = &tail[end + 1..];
            let mark =
                body.iter().position(|&b| b == b'_').ok_or_else(|| broken("the appended data lack their \"_\""))?;
            storage.appended = Some((&body[mark + 1..], raw));
            storage.base = offset + end + 1 + mark + 1;
        }
        Ok(storage)
    }

    /// The `count` values of an array, as floating-point numbers.
    pub(super) fn reals(&self, array: Node<'_, '_>, count: usize) -> Result<Vec<f64>> {
        self.values(array, count, |scan, kind| scan.real(kind, "a number"))
    }

    /// The `count` values of an array of whole numbers.
    pub(super) fn integers(&self, array: Node<'_, '_>, count: usize) -> Result<Vec<i64>> {
        self.values(array, count, |scan, kind| scan.integer(kind, "a whole number"))
    }

    fn values<T>(
        &self,
        array: Node<'_, '_>,
        count: usize,
        one: fn(&mut Scan<'_>, Scalar) -> Result<T>,
    ) -> Result<Vec<T>> {
        let kind = scalar(array)?;
        let name = array.attribute("Name").unwrap_or("of points");
        let wrong = |found: String| {
            invalid(array, format!("the array {name} has {found} instead of {count}: export the file again"))
        };
        match array.attribute("format") {
            Some("ascii") | None => {
                let text = text(array);
                let mut scan = Scan::new(text.as_bytes());
                let mut values = Vec::with_capacity(count.min(text.len()));
                while scan.peek().is_some() {
                    values.push(one(&mut scan, kind).map_err(|error| relocate(array, error))?);
                }
                if values.len() != count {
                    return Err(wrong(format!("{} values", values.len())));
                }
                Ok(values)
            }
            Some(format @ ("binary" | "appended")) => {
                let limit = count.checked_mul(kind.size()).ok_or_else(|| wrong("fewer values".into()))?;
                let bytes = if format == "binary" {
                    self.in_place(array, limit)
                        .map_err(|problem| invalid(array, format!("the array {name} {problem}")))?
                } else {
                    self.appended(array, limit, name)?
                };
                if bytes.len() != limit {
                    return Err(wrong(format!("{} bytes of {kind:?}", bytes.len())));
                }
                let mut scan = Scan::of_numbers(&bytes, self.big_endian);
                (0..count).map(|_| one(&mut scan, kind).map_err(|error| relocate(array, error))).collect()
            }
            Some(other) => Err(ImportError::Unexpected {
                at: line(array),
                expected: "format ascii, binary or appended".into(),
                found: shown(other.as_bytes()),
            }),
        }
    }

    /// The bytes of an array whose base64 text stands in its element; problems are told to be put after its name.
    fn in_place(&self, array: Node<'_, '_>, limit: usize) -> std::result::Result<Vec<u8>, String> {
        let text: Vec<u8> = text(array).bytes().filter(|b| !b.is_ascii_whitespace()).collect();
        self.decode(&text, false, limit)
    }

    fn appended(&self, array: Node<'_, '_>, limit: usize, name: &str) -> Result<Vec<u8>> {
        let Some((block, raw)) = self.appended else {
            return Err(invalid(
                array,
                format!("the array {name} should be in <AppendedData>, which is missing: export it again"),
            ));
        };
        let offset = super::count(array, "offset")?;
        let at = Position::Byte(self.base.saturating_add(offset));
        let broken = |problem| ImportError::Invalid { at, problem: format!("the array {name} {problem}") };
        let data =
            block.get(offset..).ok_or_else(|| broken("lies beyond the end of the file: it was cut short".into()))?;
        self.decode(data, raw, limit).map_err(broken)
    }

    /// The bytes of an array that begins here; more than `limit` are never unpacked.
    fn decode(&self, data: &[u8], raw: bool, limit: usize) -> std::result::Result<Vec<u8>, String> {
        let mut source = Source { data, raw };
        let number = self.header.size();
        if !self.compressed {
            // Most programs encode the count and the data in one stretch; where the count is padded, it stands alone.
            let start = source.clone();
            let length = self.numbers(&source.stretch(number)?)[0];
            if length > limit as u64 {
                return Err(format!("has {length} bytes instead of {limit}: export the file again"));
            }
            let length = length as usize;
            if !raw && !start.padded(number) {
                source = start;
                return Ok(source.stretch(number + length)?.split_off(number));
            }
            return source.stretch(length);
        }

        let blocks = self.numbers(&source.clone().stretch(number)?)[0];
        let lengths = usize::try_from(blocks)
            .ok()
            .and_then(|blocks| blocks.checked_add(3)?.checked_mul(number))
            .ok_or_else(|| format!("announces {blocks} blocks: the file is damaged"))?;
        if blocks == 0 {
            return Ok(Vec::new());
        }
        let header = self.numbers(&source.stretch(lengths)?);
        let total: u64 = header[3..].iter().fold(0, |sum, &length| sum.saturating_add(length));
        let packed = source.stretch(usize::try_from(total).unwrap_or(usize::MAX))?;
        let (mut out, mut rest) = (Vec::new(), &packed[..]);
        for (block, &length) in header[3..].iter().enumerate() {
            let last = block + 4 == header.len();
            let full = if last && header[2] != 0 { header[2] } else { header[1] };
            // In range: the lengths add up to those of `packed`.
            let (packed, after) = rest.split_at(length as usize);
            rest = after;
            let room = (limit - out.len()) as u64;
            if full > room {
                return Err(format!("has more than {limit} bytes: export the file again"));
            }
            let before = out.len();
            let inflated = flate2::read::ZlibDecoder::new(packed).take(full).read_to_end(&mut out);
            if inflated.is_err() || (out.len() - before) as u64 != full {
                return Err(format!("cannot be decompressed (block {block}): the file is damaged, export it again"));
            }
        }
        Ok(out)
    }

    /// The numbers of a header.
    fn numbers(&self, bytes: &[u8]) -> Vec<u64> {
        bytes
            .chunks_exact(self.header.size())
            .map(|chunk| {
                let most_significant_first: Vec<u8> =
                    if self.big_endian { chunk.into() } else { chunk.iter().rev().copied().collect() };
                most_significant_first.iter().fold(0, |sum, &byte| (sum << 8) | u64::from(byte))
            })
            .collect()
    }
}

/// Bytes to be taken, raw or through base64.
#[derive(Clone)]
struct Source<'a> {
    data: &'a [u8],
    raw: bool,
}

impl Source<'_> {
    /// How many characters encode so many bytes.
    fn characters(length: usize) -> usize {
        length.div_ceil(3).saturating_mul(4)
    }

    /// The code of the next `length` bytes ends with padding.
    fn padded(&self, length: usize) -> bool {
        self.data.get(Self::characters(length).saturating_sub(1)) == Some(&b'=')
    }

    /// The next `length` bytes, which are encoded by themselves or begin what is.
    fn stretch(&mut self, length: usize) -> std::result::Result<Vec<u8>, String> {
        let size = if self.raw { length } else { Self::characters(length) };
        let Some((data, rest)) = self.data.split_at_checked(size) else {
            return Err(format!(
                "needs {size} bytes of the file, {} are left: it was cut short or is damaged",
                self.data.len()
            ));
        };
        self.data = rest;
        if self.raw {
            return Ok(data.into());
        }
        let mut bytes =
            STANDARD.decode(data).map_err(|error| format!("is no valid base64 ({error}): export the file again"))?;
        if bytes.len() < length {
            return Err(format!("has {} bytes instead of {length}: export the file again", bytes.len()));
        }
        bytes.truncate(length);
        Ok(bytes)
    }
}

/// The type of the numbers of an array.
fn scalar(array: Node<'_, '_>) -> Result<Scalar> {
    let name = array.attribute("type").unwrap_or_default();
    Ok(match name {
        "Int8" => Scalar::I8,
        "UInt8" => Scalar::U8,
        "Int16" => Scalar::I16,
        "UInt16" => Scalar::U16,
        "Int32" => Scalar::I32,
        "UInt32" => Scalar::U32,
        "Int64" => Scalar::I64,
        "UInt64" => Scalar::U64,
        "Float32" => Scalar::F32,
        "Float64" => Scalar::F64,
        _ => {
            let expected = "a type such as Float64".into();
            return Err(ImportError::Unexpected { at: line(array), expected, found: shown(name.as_bytes()) });
        }
    })
}

/// The text of an array; remarks in elements of their own may stand beside it.
fn text<'a>(array: Node<'a, '_>) -> &'a str {
    let mut texts = array.children().filter(Node::is_text).filter_map(|node| node.text());
    texts.find(|text| !text.trim().is_empty()).unwrap_or_default()
}

/// An error inside an array, told with the line on which the array begins.
fn relocate(array: Node<'_, '_>, error: ImportError) -> ImportError {
    match error {
        ImportError::Unexpected { at: Position::Line(inside), expected, found } => {
            let Position::Line(begin) = line(array) else {
                return ImportError::Unexpected { at: line(array), expected, found };
            };
            ImportError::Unexpected { at: Position::Line(begin + inside - 1), expected, found }
        }
        ImportError::Unexpected { expected, found, .. } => ImportError::Unexpected { at: line(array), expected, found },
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn storage(compressed: bool, header: Scalar) -> Storage<'static> {
        Storage { big_endian: false, header, compressed, appended: None, base: 0 }
    }

    /// Count and data, encoded in one stretch or apart.
    #[test]
    fn base64_with_the_count_inside_or_apart() {
        let data: Vec<u8> = (0..20).collect();
        for header in [Scalar::U32, Scalar::U64] {
            let count = &20_u64.to_le_bytes()[..header.size()];
            let together = STANDARD.encode([count, &data].concat());
            let apart = STANDARD.encode(count) + &STANDARD.encode(&data);
            for text in [together, apart] {
                assert_eq!(storage(false, header).decode(text.as_bytes(), false, 20), Ok(data.clone()));
                assert!(storage(false, header).decode(text.as_bytes(), false, 19).is_err());
                assert!(storage(false, header).decode(&text.as_bytes()[..text.len() - 4], false, 20).is_err());
            }
        }
    }

    /// Three blocks, the last one shorter or full (which is written as 0).
    #[test]
    fn compressed_blocks() {
        use std::io::Write;
        for length in [25_usize, 30] {
            let data: Vec<u8> = (0..length as u8).collect();
            let blocks: Vec<Vec<u8>> = data
                .chunks(10)
                .map(|chunk| {
                    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
                    encoder.write_all(chunk).unwrap();
                    encoder.finish().unwrap()
                })
                .collect();
            let header = [3, 10, (length % 10) as u32].into_iter().chain(blocks.iter().map(|block| block.len() as u32));
            let header: Vec<u8> = header.flat_map(u32::to_le_bytes).collect();
            let storage = storage(true, Scalar::U32);
            let raw = [&header[..], &blocks.concat()].concat();
            assert_eq!(storage.decode(&raw, true, length), Ok(data.clone()));
            let text = STANDARD.encode(&header) + &STANDARD.encode(blocks.concat());
            assert_eq!(storage.decode(text.as_bytes(), false, length), Ok(data.clone()));
            assert!(storage.decode(text.as_bytes(), false, length - 1).is_err());
            // A header that announces far more than there is.
            for field in 0..6 {
                let mut lying = raw.clone();
                lying[4 * field..4 * field + 4].copy_from_slice(&u32::MAX.to_le_bytes());
                assert!(storage.decode(&lying, true, length).is_err(), "field {field}");
            }
        }
    }
}
