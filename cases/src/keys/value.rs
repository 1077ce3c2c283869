//! Small values that many keys share: numbers within bounds, lists of fixed length, directions.

use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::{Deserializer, Error, IgnoredAny, SeqAccess, Visitor};

use crate::quantity::{Range, Si};

/// A pure number.
#[derive(Clone, Copy)]
pub(crate) struct Number<R = crate::quantity::Any> {
    pub value: f64,
    marker: PhantomData<fn() -> R>,
}

/// More than zero, less than one.
#[derive(Clone, Copy)]
pub(crate) struct BetweenZeroAndOne;
impl Range for BetweenZeroAndOne {
    const MUST: &'static str = "must lie between 0 and 1";
    const BOUNDS: &'static [(&'static str, f64)] = &[("exclusiveMinimum", 0.0), ("exclusiveMaximum", 1.0)];
    const SIGNED: bool = false;
    fn contains(value: f64) -> bool {
        value > 0.0 && value < 1.0
    }
}

/// A fraction: an accuracy, a duty.
pub(crate) type Fraction = Number<BetweenZeroAndOne>;

struct NumberVisitor;

impl Visitor<'_> for NumberVisitor {
    type Value = f64;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a number without a unit")
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<f64, E> {
        Ok(value)
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<f64, E> {
        Ok(value as f64)
    }
}

impl<'de, R: Range> Deserialize<'de> for Number<R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = deserializer.deserialize_any(NumberVisitor)?;
        if R::contains(value) {
            Ok(Self { value, marker: PhantomData })
        } else {
            Err(D::Error::custom(format_args!("{{value}} {}", R::MUST)))
        }
    }
}

impl<R: Range> JsonSchema for Number<R> {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Number".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let mut schema = json_schema!({ "type": "number" });
        for (bound, value) in R::BOUNDS {
            schema.insert((*bound).to_owned(), (*value).into());
        }
        schema
    }
}

/// A whole number of at least `LEAST`.
#[derive(Clone, Copy)]
pub(crate) struct Whole<const LEAST: u64>(pub u64);

impl<const LEAST: u64> Whole<LEAST> {
    /// As a count.
    pub fn count(self) -> usize {
        usize::try_from(self.0).unwrap_or(usize::MAX)
    }
}

/// A number of things.
pub(crate) type Count = Whole<1>;

struct WholeVisitor(u64);

impl Visitor<'_> for WholeVisitor {
    type Value = u64;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "a whole number, {} or more", self.0)
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<u64, E> {
        match u64::try_from(value) {
            Ok(value) if value >= self.0 => Ok(value),
            _ => Err(E::custom(format_args!("{{value}} is too small: expected a whole number, {} or more", self.0))),
        }
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<u64, E> {
        // 1e5 is a float in TOML and a fine count; up to 2^53 every whole float is exact.
        if value.fract() == 0.0 && value.abs() <= 9_007_199_254_740_992.0 {
            self.visit_i64(value as i64)
        } else {
            Err(E::custom(format_args!("{{value}} is not a whole number")))
        }
    }
}

impl<'de, const LEAST: u64> Deserialize<'de> for Whole<LEAST> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(WholeVisitor(LEAST)).map(Self)
    }
}

impl<const LEAST: u64> JsonSchema for Whole<LEAST> {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Whole".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "integer", "minimum": LEAST })
    }
}

/// A list of exactly `N` values.
#[derive(Clone, Copy)]
pub(crate) struct Tuple<T, const N: usize>(pub [T; N]);

/// Three components in x, y, z.
pub(crate) type Vector<K> = Tuple<Si<K>, 3>;

impl<K> Vector<K> {
    /// In SI.
    pub fn si(&self) -> meshes::Vec3 {
        meshes::Vec3::from(self.0.map(|component| component.value))
    }
}

struct TupleVisitor<T, const N: usize>(PhantomData<T>);

impl<'de, T: Deserialize<'de>, const N: usize> Visitor<'de> for TupleVisitor<T, N> {
    type Value = Tuple<T, N>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match N {
            2 => "a list of two, [a, b]",
            _ => "a list of three, [x, y, z]",
        })
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Tuple<T, N>, A::Error> {
        let mut values = Vec::with_capacity(N);
        while values.len() < N
            && let Some(value) = list.next_element::<T>()?
        {
            values.push(value);
        }
        let mut count = values.len();
        while list.next_element::<IgnoredAny>()?.is_some() {
            count += 1;
        }
        match <[T; N]>::try_from(values) {
            Ok(values) if count == N => Ok(Tuple(values)),
            _ => {
                let entries = if count == 1 { "1 entry".to_owned() } else { format!("{count} entries") };
                let expected: &dyn serde::de::Expected = &TupleVisitor::<T, N>(PhantomData);
                Err(A::Error::custom(format_args!("{{value}} has {entries}: expected {expected}")))
            }
        }
    }
}

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for Tuple<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(TupleVisitor(PhantomData))
    }
}

impl<T: JsonSchema, const N: usize> JsonSchema for Tuple<T, N> {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Tuple".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let items = generator.subschema_for::<T>();
        json_schema!({ "type": "array", "items": items, "minItems": N, "maxItems": N })
    }
}

/// A direction: an axis by name, or three numbers of any length.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(untagged)]
pub(crate) enum DirectionKeys {
    /// "x", "-y", ...
    String(AxisName),
    /// `[a, b, c]`.
    List(Tuple<Number, 3>),
}

/// An axis of coordinates.
#[derive(Clone, Copy, Deserialize, JsonSchema)]
pub(crate) enum AxisName {
    #[serde(rename = "x")]
    X,
    #[serde(rename = "y")]
    Y,
    #[serde(rename = "z")]
    Z,
    #[serde(rename = "-x")]
    MinusX,
    #[serde(rename = "-y")]
    MinusY,
    #[serde(rename = "-z")]
    MinusZ,
}

impl DirectionKeys {
    /// The vector, its largest component of length one: then no square of it overflows.
    pub fn vector(&self) -> meshes::Vec3 {
        use meshes::Vec3;
        match self {
            Self::String(AxisName::X) => Vec3::x(),
            Self::String(AxisName::Y) => Vec3::y(),
            Self::String(AxisName::Z) => Vec3::z(),
            Self::String(AxisName::MinusX) => -Vec3::x(),
            Self::String(AxisName::MinusY) => -Vec3::y(),
            Self::String(AxisName::MinusZ) => -Vec3::z(),
            Self::List(Tuple(components)) => {
                let vector = Vec3::from(components.map(|component| component.value));
                let largest = vector.amax();
                if largest > 0.0 { vector / largest } else { vector }
            }
        }
    }
}
