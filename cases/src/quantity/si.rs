//! The types of quantities in the structs a case file is read into.

use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use super::{Kind, expected, nouns, parse};

/// What a type of quantity measures.
pub(crate) trait Measure {
    /// One kind, or several where the unit decides.
    const KINDS: &'static [Kind];
}

/// Which values a quantity may have.
pub(crate) trait Range {
    /// For the message: "must be greater than zero". Empty: any.
    const MUST: &'static str;
    /// The same for JSON Schema.
    const BOUNDS: &'static [(&'static str, f64)];
    /// Whether strings may begin with a minus.
    const SIGNED: bool;
    /// Whether `value` is among them.
    fn contains(value: f64) -> bool;
}

macro_rules! measures {
    ($($name:ident),*) => {
        /// What is measured, as types.
        pub(crate) mod kinds {
            $(
                #[doc = concat!("See [`crate::quantity::Kind::", stringify!($name), "`].")]
                #[derive(Clone, Copy, Debug)]
                pub(crate) struct $name;
                impl super::Measure for $name {
                    const KINDS: &'static [super::Kind] = &[super::Kind::$name];
                }
            )*
        }
    };
}
measures!(
    Length,
    Time,
    Frequency,
    Mass,
    Charge,
    Voltage,
    Angle,
    Temperature,
    Velocity,
    Acceleration,
    Force,
    ElectricField,
    MagneticField,
    Pressure,
    Density,
    Memory
);

/// Any finite number.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Any;
impl Range for Any {
    const MUST: &'static str = "";
    const BOUNDS: &'static [(&'static str, f64)] = &[];
    const SIGNED: bool = true;
    fn contains(_: f64) -> bool {
        true
    }
}

/// More than zero.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AboveZero;
impl Range for AboveZero {
    const MUST: &'static str = "must be greater than zero";
    const BOUNDS: &'static [(&'static str, f64)] = &[("exclusiveMinimum", 0.0)];
    const SIGNED: bool = false;
    fn contains(value: f64) -> bool {
        value > 0.0
    }
}

/// Zero or more.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ZeroOrMore;
impl Range for ZeroOrMore {
    const MUST: &'static str = "must not be negative";
    const BOUNDS: &'static [(&'static str, f64)] = &[("minimum", 0.0)];
    const SIGNED: bool = false;
    fn contains(value: f64) -> bool {
        value >= 0.0
    }
}

/// A quantity in SI.
pub(crate) struct Si<K, R = Any> {
    /// In SI.
    pub value: f64,
    marker: PhantomData<fn() -> (K, R)>,
}

/// A quantity that must be greater than zero.
pub(crate) type Positive<K> = Si<K, AboveZero>;
/// A quantity that must not be negative.
pub(crate) type NonNegative<K> = Si<K, ZeroOrMore>;

impl<K, R> Clone for Si<K, R> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<K, R> Copy for Si<K, R> {}

/// The quantity as read: its value, and the kind its unit tells (none: a bare number).
struct Parsed {
    value: f64,
    kind: Option<Kind>,
}

/// Reads a number or a string with a unit.
struct QuantityVisitor(&'static [Kind]);

impl QuantityVisitor {
    fn refusal<E: Error>(&self) -> E {
        E::custom(format_args!("{{value}} is not {}: expected {}", nouns(self.0), expected(self.0)))
    }
}

impl<'de> Visitor<'de> for QuantityVisitor {
    type Value = Parsed;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}, as {}", nouns(self.0), expected(self.0))
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Parsed, E> {
        Ok(Parsed { value, kind: None })
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Parsed, E> {
        Ok(Parsed { value: value as f64, kind: None })
    }

    fn visit_bool<E: Error>(self, _: bool) -> Result<Parsed, E> {
        Err(self.refusal())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, _: A) -> Result<Parsed, A::Error> {
        Err(self.refusal())
    }

    fn visit_map<A: MapAccess<'de>>(self, _: A) -> Result<Parsed, A::Error> {
        Err(self.refusal())
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Parsed, E> {
        match parse(text, self.0) {
            Ok((value, kind)) => Ok(Parsed { value, kind: Some(kind) }),
            Err(error) => Err(E::custom(format_args!("{error}\n{}", error.help().unwrap_or_default()))),
        }
    }
}

impl<'de, K: Measure, R: Range> Deserialize<'de> for Si<K, R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Parsed { value, .. } = deserializer.deserialize_any(QuantityVisitor(K::KINDS))?;
        if R::contains(value) {
            Ok(Self { value, marker: PhantomData })
        } else {
            Err(D::Error::custom(format_args!("{{value}} {}", R::MUST)))
        }
    }
}

/// JSON Schema of a number, or a string of a number and a unit.
///
/// The pattern demands a number and something after it. It leaves out which units exist: compounds are endless.
fn schema<R: Range>(kinds: &[Kind]) -> Schema {
    // A temperature above zero may be written below zero: "-20 degC".
    let signed = R::SIGNED || kinds.contains(&Kind::Temperature);
    let sign = if signed { "[-+\u{2212}]?" } else { "[+]?" };
    let number = r"([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?";
    let unit = r"(\s*[^\s0-9,.+-]|\s+1\s*/).*";
    let names: Vec<&str> = kinds.iter().map(|kind| kind.name()).collect();
    let examples: Vec<&str> = kinds.iter().map(|kind| kind.example()).collect();
    let mut schema = json_schema!({
        "type": ["number", "string"],
        "title": format!("{}: {}", crate::suggestion::list(&names, "or"), expected(kinds)),
        "pattern": format!(r"^\s*{sign}{number}{unit}$"),
        "examples": examples,
    });
    for (bound, value) in R::BOUNDS {
        schema.insert((*bound).to_owned(), (*value).into());
    }
    schema
}

impl<K: Measure, R: Range> JsonSchema for Si<K, R> {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Quantity".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        schema::<R>(K::KINDS)
    }
}

/// The amplitude of a waveform: what it drives decides whether it must be a voltage, a field or a charge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Amplitude {
    /// In SI.
    pub value: f64,
    /// What its unit measures; none for a bare number.
    pub kind: Option<Kind>,
}

impl Amplitude {
    const KINDS: &'static [Kind] = &[Kind::Voltage, Kind::ElectricField, Kind::Charge];
}

impl<'de> Deserialize<'de> for Amplitude {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Parsed { value, kind } = deserializer.deserialize_any(QuantityVisitor(Self::KINDS))?;
        Ok(Self { value, kind })
    }
}

impl JsonSchema for Amplitude {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Amplitude".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        schema::<Any>(Self::KINDS)
    }
}

/// A drag as a rate (1/s) or a coefficient (kg/s). A bare number could be either, so only zero may stand without a unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drag {
    /// In SI.
    pub value: f64,
    /// [`Kind::DragRate`] or [`Kind::DragCoefficient`].
    pub kind: Kind,
}

impl Drag {
    const KINDS: &'static [Kind] = &[Kind::DragRate, Kind::DragCoefficient];
}

impl<'de> Deserialize<'de> for Drag {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match deserializer.deserialize_any(QuantityVisitor(Self::KINDS))? {
            Parsed { value, .. } if value < 0.0 => {
                Err(D::Error::custom("{value} must not be negative: a drag opposes the motion"))
            }
            Parsed { value, kind: Some(kind) } => Ok(Self { value, kind }),
            Parsed { value: 0.0, kind: None } => Ok(Self { value: 0.0, kind: Kind::DragRate }),
            Parsed { value, kind: None } => {
                let help = format!(
                    "a drag is a rate, \"{value} /s\" (force = -rate * mass * velocity), \
                     or a coefficient, \"{value} kg/s\" (force = -coefficient * velocity)"
                );
                Err(D::Error::custom(format_args!("{{value}} has no unit: expected {}\n{help}", expected(Self::KINDS))))
            }
        }
    }
}

impl JsonSchema for Drag {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Drag".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let mut schema = schema::<ZeroOrMore>(Self::KINDS);
        schema.insert("maximum".to_owned(), 0.into());
        schema
    }
}
