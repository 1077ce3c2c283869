//! Named arrays: what a writer attaches to points, cells and polylines.

use std::borrow::Cow;
use std::collections::HashSet;
use std::ops::Range;

use super::VtkError;
use super::appended::{Scalar, Sink};
use crate::Vec3;

/// Values asked for at once from a function that computes them: 512 KiB, which stays in a core's second-level cache and
/// is still worth sharing between threads inside the function. Also the most that one tuple may have.
pub(super) const BLOCK: usize = 1 << 16;

/// A named array with one tuple of values per point, per cell or per polyline.
#[derive(Debug)]
pub struct DataArray<'a> {
    /// Name shown in the viewer; unique among the arrays of the same kind. Any text without control characters.
    pub name: String,
    /// Values per tuple: 1 for scalars, 3 for vectors.
    pub components: usize,
    /// The values, tuple after tuple.
    pub values: Values<'a>,
}

/// The values of a [`DataArray`]: owned, borrowed, or computed while they are written.
#[derive(Debug)]
pub enum Values<'a> {
    /// 64-bit floats.
    F64(Cow<'a, [f64]>),
    /// 32-bit floats.
    F32(Cow<'a, [f32]>),
    /// Signed 32-bit integers.
    I32(Cow<'a, [i32]>),
    /// Unsigned 32-bit integers.
    U32(Cow<'a, [u32]>),
    /// Bytes: masks and flags.
    U8(Cow<'a, [u8]>),
    /// 64-bit floats, computed block by block.
    Computed(Computed<'a>),
}

/// Values in f64 that exist only while they are written; made by [`DataArray::computed`].
pub struct Computed<'a> {
    len: usize,
    fill: Fill<'a>,
}

type Fill<'a> = Box<dyn Fn(Range<usize>, &mut [f64]) + 'a>;

impl std::fmt::Debug for Computed<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Computed").field("len", &self.len).finish_non_exhaustive()
    }
}

macro_rules! values_from {
    ($($variant:ident($scalar:ty)),*) => { $(
        impl From<Vec<$scalar>> for Values<'_> {
            fn from(values: Vec<$scalar>) -> Self {
                Self::$variant(Cow::Owned(values))
            }
        }
        impl<'a> From<&'a [$scalar]> for Values<'a> {
            fn from(values: &'a [$scalar]) -> Self {
                Self::$variant(Cow::Borrowed(values))
            }
        }
    )* };
}
values_from!(F64(f64), F32(f32), I32(i32), U32(u32), U8(u8));

/// Runs the same expression on the slice behind every variant but `Computed`.
macro_rules! on_slice {
    ($values:expr, $slice:ident => $body:expr, $computed:ident => $other:expr) => {
        match $values {
            Values::F64($slice) => $body,
            Values::F32($slice) => $body,
            Values::I32($slice) => $body,
            Values::U32($slice) => $body,
            Values::U8($slice) => $body,
            Values::Computed($computed) => $other,
        }
    };
}

impl Values<'_> {
    /// Number of values: tuples times components.
    pub fn len(&self) -> usize {
        on_slice!(self, slice => slice.len(), computed => computed.len)
    }

    /// There are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The type's name in VTK, and its size in bytes.
    pub(super) fn scalar(&self) -> (&'static str, usize) {
        fn of<T: Scalar>(_: &[T]) -> (&'static str, usize) {
            (T::NAME, T::BYTES)
        }
        on_slice!(self, slice => of(slice), _computed => of::<f64>(&[]))
    }
}

impl<'a> DataArray<'a> {
    /// An array of numbers, one each: `DataArray::scalars("time", times)` with a vector or a slice.
    pub fn scalars(name: impl Into<String>, values: impl Into<Values<'a>>) -> Self {
        Self { name: name.into(), components: 1, values: values.into() }
    }

    /// An array of vectors, one each, copied.
    pub fn vectors(name: impl Into<String>, values: &[Vec3]) -> Self {
        Self { name: name.into(), components: 3, values: flat(values).into() }
    }

    /// An array that is computed while it is written: `fill(range, out)` sets the `range.len() * components` values of
    /// a range of tuples. Ranges come in order, each once (twice in the polyline writers, which sort by kind of cell).
    ///
    /// Nothing larger than a block is ever in memory, except in [`super::write_surface`] and [`super::write_points`],
    /// which need every array whole.
    pub fn computed(
        name: impl Into<String>,
        components: usize,
        tuples: usize,
        fill: impl Fn(Range<usize>, &mut [f64]) + 'a,
    ) -> Self {
        let len = tuples.saturating_mul(components);
        Self { name: name.into(), components, values: Values::Computed(Computed { len, fill: Box::new(fill) }) }
    }

    /// Checks the number of values, and that those in memory are finite.
    pub(super) fn check(&self, tuples: usize, of: &'static str) -> Result<(), VtkError> {
        check_name(&self.name, self.components)?;
        if tuples.checked_mul(self.components) != Some(self.values.len()) {
            return Err(VtkError::Length {
                array: self.name.clone(),
                found: self.values.len(),
                tuples,
                components: self.components,
                of,
            });
        }
        on_slice!(&self.values, slice => check_finite(&self.name, self.components, slice, 0), _computed => Ok(()))
    }

    /// Number of tuples, once checked.
    pub(super) fn tuples(&self) -> usize {
        self.values.len() / self.components
    }

    /// Writes each tuple as often as `repeats` says, in order.
    pub(super) fn put(&self, sink: &mut Sink, repeats: impl Fn(usize) -> usize) -> Result<(), VtkError> {
        fn put<T: Scalar>(
            sink: &mut Sink,
            values: &[T],
            components: usize,
            first: usize,
            repeats: &impl Fn(usize) -> usize,
        ) -> Result<(), VtkError> {
            for (index, tuple) in values.chunks_exact(components).enumerate() {
                for _ in 0..repeats(first + index) {
                    sink.put(tuple)?;
                }
            }
            Ok(())
        }
        on_slice!(&self.values,
            slice => put(sink, slice, self.components, 0, &repeats),
            _computed => self.blocks(|first, block| put(sink, block, self.components, first, &repeats)))
    }

    /// Writes every tuple once.
    pub(super) fn put_all(&self, sink: &mut Sink) -> Result<(), VtkError> {
        on_slice!(&self.values, slice => sink.put(slice), _computed => self.blocks(|_, block| sink.put(block)))
    }

    /// Computed values, made and checked block by block, each with the number of its first tuple; nothing for others.
    pub(super) fn blocks(&self, mut each: impl FnMut(usize, &[f64]) -> Result<(), VtkError>) -> Result<(), VtkError> {
        let Values::Computed(computed) = &self.values else { return Ok(()) };
        let tuples = self.tuples();
        let step = (BLOCK / self.components).min(tuples.max(1));
        let mut buffer = vec![0.0; step * self.components];
        for first in (0..tuples).step_by(step) {
            let range = first..tuples.min(first + step);
            let block = &mut buffer[..range.len() * self.components];
            // A value that `fill` forgets to set is then caught as not finite.
            block.fill(f64::NAN);
            (computed.fill)(range, block);
            check_finite(&self.name, self.components, block, first)?;
            each(first, block)?;
        }
        Ok(())
    }
}

/// A named array with one tuple of values in f64 per point of many polylines, computed while it is written.
pub struct PolylineArray<'a> {
    /// Name shown in the viewer; unique among the point arrays. Any text without control characters.
    pub name: String,
    /// Values per tuple: 1 for scalars, 3 for vectors.
    pub components: usize,
    fill: FillLine<'a>,
}

type FillLine<'a> = Box<dyn Fn(usize, Range<usize>, &mut [f64]) + 'a>;

impl<'a> PolylineArray<'a> {
    /// An array whose values come from `fill(line, points, out)`: it sets the `points.len() * components` values of a
    /// range of points of one polyline. Ranges come in order, each once per file.
    pub fn new(
        name: impl Into<String>,
        components: usize,
        fill: impl Fn(usize, Range<usize>, &mut [f64]) + 'a,
    ) -> Self {
        Self { name: name.into(), components, fill: Box::new(fill) }
    }

    /// An array of numbers: the value at a point is `value(line, point)`.
    pub fn scalars(name: impl Into<String>, value: impl Fn(usize, usize) -> f64 + 'a) -> Self {
        Self::new(name, 1, move |line, points, out| {
            for (point, slot) in points.zip(out) {
                *slot = value(line, point);
            }
        })
    }

    /// An array of vectors: the value at a point is `value(line, point)`.
    pub fn vectors(name: impl Into<String>, value: impl Fn(usize, usize) -> Vec3 + 'a) -> Self {
        Self::new(name, 3, move |line, points, out| {
            for (point, slot) in points.zip(out.chunks_exact_mut(3)) {
                slot.copy_from_slice(value(line, point).as_slice());
            }
        })
    }

    /// Writes the values of all polylines.
    pub(super) fn put_all(&self, sink: &mut Sink, lengths: &[usize]) -> Result<(), VtkError> {
        let longest = lengths.iter().copied().max().unwrap_or(0);
        let step = (BLOCK / self.components).min(longest.max(1));
        let mut buffer = vec![0.0; step * self.components];
        for (line, &length) in lengths.iter().enumerate() {
            for first in (0..length).step_by(step) {
                let range = first..length.min(first + step);
                let block = &mut buffer[..range.len() * self.components];
                // A value that `fill` forgets to set is then caught as not finite.
                block.fill(f64::NAN);
                (self.fill)(line, range, block);
                check_finite(&self.name, self.components, block, first).map_err(|error| match error {
                    VtkError::NonFinite { array, index, component, value } => {
                        VtkError::NonFiniteOnLine { array, line, point: index, component, value }
                    }
                    other => other,
                })?;
                sink.put(block)?;
            }
        }
        Ok(())
    }
}

/// Vectors as x, y, z, x, y, z...
pub(super) fn flat(vectors: &[Vec3]) -> Vec<f64> {
    vectors.iter().flat_map(|v| [v.x, v.y, v.z]).collect()
}

/// Checks every array of one kind, and that no two share a name: readers keep only the last of them.
pub(super) fn check_all(arrays: &[DataArray], tuples: usize, of: &'static str) -> Result<(), VtkError> {
    arrays.iter().try_for_each(|array| array.check(tuples, of))?;
    check_unique(arrays.iter().map(|array| array.name.as_str()))
}

/// Checks that no name appears twice.
pub(super) fn check_unique<'n>(names: impl Iterator<Item = &'n str>) -> Result<(), VtkError> {
    let mut seen = HashSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(VtkError::Name { name: name.to_owned(), reason: "is taken by another array" });
        }
    }
    Ok(())
}

/// Checks what can be wrong with an array whatever its values.
pub(super) fn check_name(name: &str, components: usize) -> Result<(), VtkError> {
    let reason = if name.is_empty() {
        "is empty"
    } else if name.chars().any(unprintable) {
        "has control characters"
    } else if !(1..=BLOCK).contains(&components) {
        return Err(VtkError::Components { array: name.to_owned(), components });
    } else {
        return Ok(());
    };
    Err(VtkError::Name { name: name.to_owned(), reason })
}

/// Characters that XML forbids, or that its readers turn into blanks.
pub(super) fn unprintable(c: char) -> bool {
    c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}')
}

/// Checks values that start with tuple `first`.
pub(super) fn check_finite<T: Scalar>(
    name: &str,
    components: usize,
    values: &[T],
    first: usize,
) -> Result<(), VtkError> {
    // Without a branch in the loop, so that it runs at the speed of memory.
    if values.iter().fold(true, |all, value| all & value.finite()) {
        return Ok(());
    }
    match values.iter().position(|value| !value.finite()) {
        None => Ok(()),
        Some(at) => Err(VtkError::NonFinite {
            array: name.to_owned(),
            index: first + at / components,
            component: at % components,
            value: values[at].to_f64(),
        }),
    }
}
