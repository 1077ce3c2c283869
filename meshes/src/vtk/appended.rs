//! VTK XML with appended raw data, written in one pass.
//!
//! The header names every array with its place in the data that follow, so all sizes must be known before the first
//! value is. Numbers are little-endian and each array stands behind its length in bytes as a UInt64:
//!
//! ```text
//! <VTKFile ... header_type="UInt64"> ... <DataArray ... format="appended" offset="0"/> ...
//! <AppendedData encoding="raw">
//! _[length][values][length][values]...
//! </AppendedData></VTKFile>
//! ```
//!
//! Three liberties that VTK allows would break meshio 5.3:
//!
//! * padding an offset with blanks, so the header is finished before it is written, never patched;
//! * anything but a line break between the last value and `</AppendedData>`;
//! * arrays in the order of the header. meshio walks through the data, looks up each array by its offset and overwrites
//!   that offset with another one, which now and then is the offset of an array still to come: it then finds the wrong
//!   one, the first in the header. With the data in reverse order the first in the header is always the right one.
//!
//! Source: VTK file formats, "XML file formats". Checked by `own_reader_finds_every_array` and, against the readers
//! themselves, by the samples of `examples/vtk_samples.rs`.

use std::fmt::Write as _;
use std::io::Write;

use super::{DataArray, VtkError};

/// Bytes gathered before they go to the output.
const BUFFER: usize = 1 << 18;

/// A number as VTK stores it.
pub(super) trait Scalar: Copy {
    /// The type's name in VTK.
    const NAME: &'static str;
    /// Size, bytes.
    const BYTES: usize;
    /// Writes it little-endian into `BYTES` bytes.
    fn put(self, bytes: &mut [u8]);
    /// It is neither NaN nor infinite.
    fn finite(self) -> bool;
    /// The value, for messages.
    fn to_f64(self) -> f64;
}

macro_rules! scalar {
    ($($scalar:ty, $name:literal, |$value:ident| $finite:expr;)*) => { $(
        impl Scalar for $scalar {
            const NAME: &'static str = $name;
            const BYTES: usize = size_of::<$scalar>();
            #[inline]
            fn put(self, bytes: &mut [u8]) {
                bytes.copy_from_slice(&self.to_le_bytes());
            }
            #[inline]
            fn finite(self) -> bool {
                let $value = self;
                $finite
            }
            fn to_f64(self) -> f64 {
                self as f64
            }
        }
    )* };
}
scalar! {
    f64, "Float64", |x| x.is_finite();
    f32, "Float32", |x| x.is_finite();
    i64, "Int64", |_x| true;
    i32, "Int32", |_x| true;
    u32, "UInt32", |_x| true;
    u8, "UInt8", |_x| true;
}

/// Where the values of appended arrays go.
pub(super) struct Sink<'o> {
    out: &'o mut dyn Write,
    buffer: Vec<u8>,
    used: usize,
    /// Bytes put since the file began.
    put: u64,
}

impl<'o> Sink<'o> {
    fn new(out: &'o mut dyn Write) -> Self {
        Self { out, buffer: vec![0; BUFFER], used: 0, put: 0 }
    }

    fn text(&mut self, text: &str) -> Result<(), VtkError> {
        self.put(text.as_bytes())
    }

    fn flush(&mut self) -> Result<(), VtkError> {
        self.out.write_all(&self.buffer[..self.used])?;
        self.used = 0;
        Ok(())
    }

    /// Writes values one after the other.
    #[inline]
    pub fn put<T: Scalar>(&mut self, mut values: &[T]) -> Result<(), VtkError> {
        self.put += (values.len() * T::BYTES) as u64;
        while !values.is_empty() {
            if BUFFER - self.used < T::BYTES {
                self.flush()?;
            }
            let fitting = values.len().min((BUFFER - self.used) / T::BYTES);
            let (now, later) = values.split_at(fitting);
            let end = self.used + fitting * T::BYTES;
            for (bytes, &value) in self.buffer[self.used..end].chunks_exact_mut(T::BYTES).zip(now) {
                value.put(bytes);
            }
            self.used = end;
            values = later;
        }
        Ok(())
    }

    /// Writes values as they are made.
    pub fn put_each<T: Scalar>(&mut self, values: impl IntoIterator<Item = T>) -> Result<(), VtkError> {
        values.into_iter().try_for_each(|value| self.put(&[value]))
    }
}

type Body<'a> = Box<dyn Fn(&mut Sink) -> Result<(), VtkError> + 'a>;

/// A VTK XML file in the making: its header, and what will write each array.
pub(super) struct Document<'a> {
    kind: &'static str,
    /// The header since the last array's offset.
    xml: String,
    arrays: Vec<Array<'a>>,
    /// Bytes of all arrays so far, with their lengths.
    bytes: u64,
}

struct Array<'a> {
    /// The header before this array's offset.
    xml: String,
    bytes: u64,
    body: Body<'a>,
}

impl<'a> Document<'a> {
    /// A file of this kind of data set; `attributes` belong to its element, `piece` to the only piece in it.
    pub fn new(kind: &'static str, attributes: &str, piece: &str) -> Self {
        let mut xml = String::new();
        // Version 1.0 is the first whose arrays stand behind 64-bit lengths, and the last that meshio accepts.
        let _ = write!(
            xml,
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\">\n<{kind}{attributes}>\n<Piece{piece}>\n"
        );
        Self { kind, xml, arrays: Vec::new(), bytes: 0 }
    }

    /// An element with arrays in it.
    pub fn element(
        &mut self,
        name: &str,
        arrays: impl FnOnce(&mut Self) -> Result<(), VtkError>,
    ) -> Result<(), VtkError> {
        let _ = writeln!(self.xml, "<{name}>");
        arrays(self)?;
        let _ = writeln!(self.xml, "</{name}>");
        Ok(())
    }

    /// An array of `tuples` times `components` values of type `T`, all of which `body` will write.
    ///
    /// # Errors
    /// The array is too large for its size to be written down.
    pub fn array<T: Scalar>(
        &mut self,
        name: &str,
        tuples: u64,
        components: usize,
        body: impl Fn(&mut Sink) -> Result<(), VtkError> + 'a,
    ) -> Result<(), VtkError> {
        self.untyped_array(name, (T::NAME, T::BYTES), tuples, components, Box::new(body))
    }

    /// The arrays of points or cells.
    pub fn data(&mut self, element: &str, arrays: &'a [DataArray]) -> Result<(), VtkError> {
        self.element(element, |document| {
            arrays.iter().try_for_each(|array| {
                let body = Box::new(|sink: &mut Sink| array.put_all(sink));
                document.untyped_array(
                    &array.name,
                    array.values.scalar(),
                    array.tuples() as u64,
                    array.components,
                    body,
                )
            })
        })
    }

    /// An array whose type is known at run time only.
    pub fn untyped_array(
        &mut self,
        name: &str,
        (scalar, size): (&str, usize),
        tuples: u64,
        components: usize,
        body: Body<'a>,
    ) -> Result<(), VtkError> {
        let too_large = || VtkError::TooLarge { what: format!("array `{name}` with {tuples} x {components} values") };
        let bytes = tuples
            .checked_mul(components as u64)
            .and_then(|values| values.checked_mul(size as u64))
            .ok_or_else(too_large)?;
        let _ = write!(self.xml, "<DataArray type=\"{scalar}\" Name=\"{}\"", escaped(name));
        // meshio makes a column matrix of an array that says it has one component.
        if components > 1 {
            let _ = write!(self.xml, " NumberOfComponents=\"{components}\"");
        }
        self.xml += " format=\"appended\" offset=\"";
        self.bytes = self.bytes.checked_add(8).and_then(|b| b.checked_add(bytes)).ok_or_else(too_large)?;
        self.arrays.push(Array { xml: std::mem::replace(&mut self.xml, "\"/>\n".into()), bytes, body });
        Ok(())
    }

    /// Writes the file.
    pub fn write(self, out: &mut dyn Write) -> Result<(), VtkError> {
        let mut sink = Sink::new(out);
        let mut offset = self.bytes;
        for array in &self.arrays {
            offset -= 8 + array.bytes;
            sink.text(&format!("{}{offset}", array.xml))?;
        }
        sink.text(&format!("{}</Piece>\n</{}>\n<AppendedData encoding=\"raw\">\n_", self.xml, self.kind))?;
        for Array { bytes, body, .. } in self.arrays.iter().rev() {
            sink.put(&bytes.to_le_bytes())?;
            let start = sink.put;
            body(&mut sink)?;
            debug_assert_eq!(sink.put - start, *bytes, "an array is not as long as its header says");
        }
        sink.text("\n</AppendedData>\n</VTKFile>\n")?;
        sink.flush()?;
        sink.out.flush()?;
        Ok(())
    }
}

/// Text as it may stand between quotes in XML.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&apos;"),
            other => out.push(other),
        }
    }
    out
}
