//! Reads structs from the tree of a case file with serde, and says exactly what is wrong where.
//!
//! Three conventions go beyond plain serde, each so that derived structs fit what people write in a case file while paths
//! survive (serde's own `tag`, `untagged` and `flatten` buffer their input and forget where it came from):
//!
//! * An enum listed in [`tag`] is read from a table of which one key (`shape`, `kind`, `model`) names the variant.
//! * An enum whose variants are called after TOML types (`string`, `number`, `table`, `list`, or `quantity` for a string or
//!   a number) is a value of one of several forms.
//! * A tuple struct of two is read from one table: the first takes the keys it knows, the second must take all others.

use std::cell::Cell;
use std::fmt;

use serde::de::value::StrDeserializer;
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Error, Expected, IntoDeserializer, MapAccess, SeqAccess, Unexpected,
    VariantAccess, Visitor,
};

use crate::key_path::Segment;
use crate::tree::{Entry, Node, Value};

/// What does not fit, and where.
#[derive(Debug)]
pub(crate) struct Fault {
    /// From the inside out, while it travels up; [`read`] turns it round.
    pub path: Vec<Segment>,
    pub what: What,
}

/// What does not fit.
#[derive(Debug)]
pub(crate) enum What {
    /// The last step of the path is a key that does not belong there.
    UnknownKey { known: Vec<&'static str>, variant: Option<Variant> },
    /// The table at the path lacks a key. `choices`: what may stand there, if that is a short list.
    MissingKey { key: String, choices: Vec<&'static str>, variant: Option<Variant> },
    /// The string at the path is none of a list.
    UnknownName { known: Vec<&'static str> },
    /// The value at the path has the wrong type.
    WrongType { expected: String },
    /// Said where it was found. `{value}` stands for the value as written.
    Said { problem: String, help: Option<String> },
}

/// Which kind of table it is, where its keys depend on that.
#[derive(Clone, Debug)]
pub(crate) struct Variant {
    /// The enum, as Rust calls it.
    pub family: &'static str,
    /// The variant's name in the case file.
    pub name: String,
}

impl Fault {
    fn new(what: What) -> Self {
        Self { path: Vec::new(), what }
    }

    fn under(mut self, segment: Segment) -> Self {
        self.path.push(segment);
        self
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{:?}", self.what)
    }
}

impl std::error::Error for Fault {}

impl Error for Fault {
    fn custom<T: fmt::Display>(message: T) -> Self {
        let message = message.to_string();
        // The first line is the problem, the rest says what to change.
        let (problem, help) = message.split_once('\n').unwrap_or((&message, ""));
        let help = Some(help.trim()).filter(|help| !help.is_empty()).map(str::to_owned);
        Self::new(What::Said { problem: problem.to_owned(), help })
    }

    fn invalid_type(_: Unexpected, expected: &dyn Expected) -> Self {
        Self::new(What::WrongType { expected: in_words(&expected.to_string()) })
    }

    fn invalid_value(_: Unexpected, expected: &dyn Expected) -> Self {
        Self::new(What::WrongType { expected: in_words(&expected.to_string()) })
    }

    fn unknown_variant(_: &str, known: &'static [&'static str]) -> Self {
        Self::new(What::UnknownName { known: known.to_vec() })
    }

    fn unknown_field(_: &str, known: &'static [&'static str]) -> Self {
        Self::new(What::UnknownKey { known: known.to_vec(), variant: None })
    }

    fn missing_field(key: &'static str) -> Self {
        Self::new(What::MissingKey { key: key.to_owned(), choices: Vec::new(), variant: None })
    }
}

/// What serde expects, in the words of a case file.
fn in_words(expected: &str) -> String {
    match expected {
        "a sequence" => "a list".to_owned(),
        "a boolean" => "true or false".to_owned(),
        "a map" => "a table".to_owned(),
        other if other.starts_with("struct ") || other.starts_with("tuple struct ") => "a table".to_owned(),
        other => other.to_owned(),
    }
}

/// Reads a value.
pub(crate) fn read<'de, T: serde::Deserialize<'de>>(node: &'de Node) -> Result<T, Fault> {
    T::deserialize(Reader { node, view: View::Whole }).map_err(|mut fault| {
        fault.path.reverse();
        fault
    })
}

/// The key that names the variant of an enum read from a table.
fn tag(family: &str) -> Option<&'static str> {
    match family {
        "ShapeKeys" => Some("shape"),
        "SourceKind" | "PlaceKeys" | "SpeedKeys" | "WaveformKeys" => Some("kind"),
        "GasDragKeys" => Some("model"),
        _ => None,
    }
}

/// The variant of a table without its tag.
fn implied(family: &str, table: &Node) -> Option<&'static str> {
    match family {
        "WaveformKeys" if table.get("drive").is_some() => Some("drive"),
        "WaveformKeys" => Some("sine"),
        _ => None,
    }
}

/// What is expected of a value that may have several forms, or is a table of several kinds.
fn forms(family: &str) -> &'static str {
    match family {
        "RfKeys" => {
            "the name of a drive, a table as { amplitude = \"300 V\", frequency = \"60 Hz\" }, or a list of these"
        }
        "RfEntry" => "the name of a drive or a table as { amplitude = \"300 V\", frequency = \"60 Hz\" }",
        "DragKeys" => {
            "a rate as \"0.1 /s\", a coefficient as \"1e-14 kg/s\", or a table as { model = \"stokes\", gas = \"air\" }"
        }
        "DirectionKeys" => "an axis as \"x\" or \"-z\", or three numbers [a, b, c]",
        "End" => "a number or a string with a unit",
        "SweepKeys" => "a list of values or a table as { from = \"1 V\", to = \"9 V\", steps = 5 }",
        "WaveformKeys" => "a table as { amplitude = \"300 V\", frequency = \"60 Hz\" }",
        "PlaceKeys" => "a table as { kind = \"ball\", radius = \"1 mm\" }",
        "SpeedKeys" => "a table as { kind = \"thermal\", temperature = \"300 K\" }",
        "GasDragKeys" => "a table as { model = \"stokes\", gas = \"air\", pressure = \"1 bar\" }",
        _ => "a table",
    }
}

/// Which keys of a table are read.
#[derive(Clone, Copy)]
enum View<'v> {
    /// All of them; an unknown one is an error.
    Whole,
    /// Those the struct knows, which are noted down.
    Known(&'v Cell<&'static [&'static str]>),
    /// All but those that were noted down.
    Rest(&'v Cell<&'static [&'static str]>),
}

/// A node as a deserializer.
#[derive(Clone, Copy)]
struct Reader<'de, 'v> {
    node: &'de Node,
    view: View<'v>,
}

impl<'de, 'v> Reader<'de, 'v> {
    fn whole(node: &'de Node) -> Self {
        Self { node, view: View::Whole }
    }

    /// Reads a table. `tag`: a key that has been read already, and what it said.
    fn table<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        tag: Option<(&'static str, Variant)>,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        let Value::Table(entries) = &self.node.value else {
            return Err(Fault::invalid_type(Unexpected::Map, &visitor));
        };
        let (tag_key, variant) = match tag {
            Some((key, variant)) => (Some(key), Some(variant)),
            None => (None, None),
        };
        let taken = match self.view {
            View::Whole => &[],
            View::Known(cell) => {
                cell.set(fields);
                &[]
            }
            View::Rest(cell) => cell.get(),
        };
        let wanted = |entry: &&Entry| match self.view {
            _ if Some(entry.key.as_str()) == tag_key => false,
            View::Known(_) => fields.contains(&entry.key.as_str()),
            _ => !taken.contains(&entry.key.as_str()),
        };
        let entries: Vec<&Entry> = entries.iter().filter(wanted).collect();
        let complete = |fault: Fault| match fault.what {
            What::UnknownKey { known, .. } if fault.path.len() == 1 => {
                let known =
                    taken.iter().take(1).copied().chain(tag_key).chain(taken.iter().skip(1).copied()).chain(known);
                Fault { what: What::UnknownKey { known: known.collect(), variant: variant.clone() }, path: fault.path }
            }
            What::MissingKey { key, choices, .. } if fault.path.is_empty() => {
                Fault { what: What::MissingKey { key, choices, variant: variant.clone() }, path: fault.path }
            }
            _ => fault,
        };
        visitor.visit_map(Table { entries: entries.into_iter(), value: None }).map_err(complete)
    }
}

impl<'de> Deserializer<'de> for Reader<'de, '_> {
    type Error = Fault;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match &self.node.value {
            Value::String(text) => visitor.visit_borrowed_str(text),
            Value::Integer(value) => visitor.visit_i64(*value),
            Value::Float(value) if value.is_finite() => visitor.visit_f64(*value),
            Value::Float(value) => {
                let problem = if value.is_nan() { "{value} is not a number" } else { "{value} is not a finite number" };
                let help = Some("numbers end at 1.8e308".to_owned()).filter(|_| value.is_infinite());
                Err(Fault::new(What::Said { problem: problem.to_owned(), help }))
            }
            Value::Boolean(value) => visitor.visit_bool(*value),
            Value::Date => Err(Fault::invalid_type(Unexpected::Other("date"), &visitor)),
            Value::List(entries) => visitor.visit_seq(List { entries: entries.iter().enumerate() }),
            Value::Table(_) => self.table(&[], None, visitor),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        self.table(fields, None, visitor)
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: usize,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        if !matches!(self.node.value, Value::Table(_)) {
            return Err(Fault::invalid_type(Unexpected::Map, &"a table"));
        }
        visitor.visit_seq(Both { node: self.node, known: Cell::new(&[]), part: 0 })
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        family: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        let choice = |name: &'de str, tag| Choice { reader: self, family, name, tag };
        if let Some(tag) = tag(family) {
            if !matches!(self.node.value, Value::Table(_)) {
                return Err(Fault::new(What::WrongType { expected: forms(family).to_owned() }));
            }
            let name = match self.node.get(tag).map(|node| &node.value) {
                Some(Value::String(name)) => name.as_str(),
                Some(_) => {
                    let expected = format!("one of {}", variants.join(", "));
                    return Err(Fault::new(What::WrongType { expected }).under(Segment::Key(tag.to_owned())));
                }
                None => implied(family, self.node).ok_or_else(|| {
                    Fault::new(What::MissingKey { key: tag.to_owned(), choices: variants.to_vec(), variant: None })
                })?,
            };
            return visitor.visit_enum(choice(name, Some(tag)));
        }
        let form = match &self.node.value {
            Value::String(_) => ["string", "quantity"],
            Value::Integer(_) | Value::Float(_) => ["number", "quantity"],
            Value::Table(_) => ["table", "table"],
            Value::List(_) => ["list", "list"],
            Value::Boolean(_) | Value::Date => ["none of them"; 2],
        };
        if variants.iter().all(|variant| ["string", "number", "quantity", "table", "list"].contains(variant)) {
            let form = form.into_iter().find(|form| variants.contains(form));
            let form = form.ok_or_else(|| Fault::new(What::WrongType { expected: forms(family).to_owned() }))?;
            return visitor.visit_enum(choice(form, None));
        }
        match &self.node.value {
            Value::String(name) => visitor.visit_enum(choice(name, None)),
            _ => Err(Fault::new(What::WrongType { expected: format!("one of {}", variants.join(", ")) })),
        }
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple map
        identifier ignored_any
    }
}

/// The entries of a table, one after the other.
struct Table<'de> {
    entries: std::vec::IntoIter<&'de Entry>,
    value: Option<&'de Entry>,
}

impl<'de> MapAccess<'de> for Table<'de> {
    type Error = Fault;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, Fault> {
        self.value = self.entries.next();
        let Some(entry) = self.value else { return Ok(None) };
        let key: StrDeserializer<Fault> = entry.key.as_str().into_deserializer();
        seed.deserialize(key).map(Some).map_err(|fault| fault.under(Segment::Key(entry.key.clone())))
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Fault> {
        let Some(entry) = self.value else { return Err(Fault::custom("a value was asked for before its key")) };
        seed.deserialize(Reader::whole(&entry.node)).map_err(|fault| fault.under(Segment::Key(entry.key.clone())))
    }
}

/// The entries of a list.
struct List<'de> {
    entries: std::iter::Enumerate<std::slice::Iter<'de, Node>>,
}

impl<'de> SeqAccess<'de> for List<'de> {
    type Error = Fault;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Fault> {
        let Some((n, node)) = self.entries.next() else { return Ok(None) };
        seed.deserialize(Reader::whole(node)).map(Some).map_err(|fault| fault.under(Segment::Entry(n)))
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.entries.len())
    }
}

/// One table read as two structs.
struct Both<'de> {
    node: &'de Node,
    known: Cell<&'static [&'static str]>,
    part: usize,
}

impl<'de> SeqAccess<'de> for Both<'de> {
    type Error = Fault;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Fault> {
        self.part += 1;
        let view = match self.part {
            1 => View::Known(&self.known),
            2 => View::Rest(&self.known),
            _ => return Ok(None),
        };
        seed.deserialize(Reader { node: self.node, view }).map(Some)
    }
}

/// A variant of an enum that has been chosen.
struct Choice<'de, 'v> {
    reader: Reader<'de, 'v>,
    family: &'static str,
    name: &'de str,
    tag: Option<&'static str>,
}

impl<'de> EnumAccess<'de> for Choice<'de, '_> {
    type Error = Fault;
    type Variant = Self;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, Self), Fault> {
        let name: StrDeserializer<Fault> = self.name.into_deserializer();
        let value = seed.deserialize(name).map_err(|fault| match self.tag {
            Some(tag) => fault.under(Segment::Key(tag.to_owned())),
            None => fault,
        })?;
        Ok((value, self))
    }
}

impl<'de> VariantAccess<'de> for Choice<'de, '_> {
    type Error = Fault;

    fn unit_variant(self) -> Result<(), Fault> {
        match self.tag {
            // No further keys.
            Some(_) => self.struct_variant(&[], NoKeys),
            None => Ok(()),
        }
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Fault> {
        seed.deserialize(self.reader)
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, Fault> {
        self.reader.deserialize_any(visitor)
    }

    fn struct_variant<V: Visitor<'de>>(self, fields: &'static [&'static str], visitor: V) -> Result<V::Value, Fault> {
        let variant = Variant { family: self.family, name: self.name.to_owned() };
        self.reader.table(fields, self.tag.map(|tag| (tag, variant)), visitor)
    }
}

/// Accepts a table without keys.
struct NoKeys;

impl<'de> Visitor<'de> for NoKeys {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a table")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        match map.next_key_seed(AnyKey)? {
            None => Ok(()),
            Some(()) => Ok(()),
        }
    }
}

/// Refuses every key.
struct AnyKey;

impl<'de> DeserializeSeed<'de> for AnyKey {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, _: D) -> Result<(), D::Error> {
        Err(D::Error::unknown_field("", &[]))
    }
}
