//! Physical quantities as people write them: SI numbers, or strings such as `"2 mm"`.
//!
//! ```
//! use cases::quantity::{Kind, parse};
//! assert_eq!(parse("2 mm", &[Kind::Length]).unwrap(), (0.002, Kind::Length));
//! let error = parse("2 V", &[Kind::Length]).unwrap_err();
//! assert_eq!(error.to_string(), r#""2 V" is not a length: expected metres or a string such as "2 mm""#);
//! ```

mod kind;
mod si;
mod units;

use std::f64::consts::TAU;

pub use kind::Kind;
pub(crate) use si::{Amplitude, Any, Drag, NonNegative, Positive, Range, Si, kinds};
use units::Exponents;

/// Why a string is not the quantity that was wanted. [`QuantityError::help`] says what to change.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum QuantityError {
    /// Nothing between the quotes.
    #[error("\"{text}\" is empty: expected {expected}")]
    Empty {
        /// What was written.
        text: String,
        /// What was wanted.
        expected: String,
    },
    /// It does not begin with a number.
    #[error("\"{text}\" does not begin with a number: expected {expected}")]
    NotANumber {
        /// What was written.
        text: String,
        /// What was wanted.
        expected: String,
    },
    /// A decimal comma.
    #[error("\"{text}\" has a decimal comma")]
    DecimalComma {
        /// What was written.
        text: String,
        /// What to change.
        help: String,
    },
    /// NaN or infinite.
    #[error("\"{text}\" is not a finite number: expected {expected}")]
    NotFinite {
        /// What was written.
        text: String,
        /// What was wanted.
        expected: String,
    },
    /// Beyond the range of an `f64` in SI.
    #[error("\"{text}\" is too large: numbers end at 1.8e308")]
    TooLarge {
        /// What was written.
        text: String,
    },
    /// A number in quotes.
    #[error("\"{text}\" has no unit: expected {expected}")]
    NoUnit {
        /// What was written.
        text: String,
        /// What was wanted.
        expected: String,
        /// What to change.
        help: String,
    },
    /// A unit nobody knows.
    #[error("\"{text}\" has an unknown unit, `{unit}`: expected {expected}")]
    UnknownUnit {
        /// What was written.
        text: String,
        /// Its unit.
        unit: String,
        /// What was wanted.
        expected: String,
        /// What to change.
        help: String,
    },
    /// A unit of something else.
    #[error("\"{text}\" is not {noun}: expected {expected}")]
    WrongDimension {
        /// What was written.
        text: String,
        /// What it should have been.
        noun: String,
        /// What was wanted.
        expected: String,
        /// What it is.
        help: String,
    },
}

impl QuantityError {
    /// What to change, where more than the message itself can be said.
    pub fn help(&self) -> Option<&str> {
        match self {
            Self::DecimalComma { help, .. }
            | Self::NoUnit { help, .. }
            | Self::UnknownUnit { help, .. }
            | Self::WrongDimension { help, .. } => Some(help).filter(|help| !help.is_empty()).map(String::as_str),
            _ => None,
        }
    }
}

/// Reads a number with a unit that measures one of `kinds` (the first is the one spoken of), in SI.
///
/// "2 mm" is the same `f64` as 0.002: factors that are powers of ten move the decimal point instead of multiplying.
///
/// # Errors
/// See [`QuantityError`].
pub fn parse(text: &str, kinds: &[Kind]) -> Result<(f64, Kind), QuantityError> {
    let wanted = kinds.first().copied().unwrap_or(Kind::Length);
    let owned = || text.to_owned();
    let expected = || expected(kinds);
    let trimmed = text.trim();
    if trimmed.is_empty() {
        return Err(QuantityError::Empty { text: owned(), expected: expected() });
    }
    let plain = trimmed.replace('\u{2212}', "-"); // the minus sign of typesetters
    let (number, unit) = split(&plain);
    if number.is_empty() {
        let word = plain.trim_start_matches(['+', '-']).to_ascii_lowercase();
        if ["nan", "inf"].iter().any(|name| word.starts_with(name)) {
            return Err(QuantityError::NotFinite { text: owned(), expected: expected() });
        }
        return Err(QuantityError::NotANumber { text: owned(), expected: expected() });
    }
    if let Some(decimals) = unit.strip_prefix(',').filter(|rest| rest.starts_with(|c: char| c.is_ascii_digit())) {
        let help = format!("write the decimal point as a point: \"{number}.{decimals}\"");
        return Err(QuantityError::DecimalComma { text: owned(), help });
    }
    if unit.is_empty() {
        let help =
            format!("write {number} without quotes for {}, or \"{number} {}\"", wanted.si(), sample_unit(wanted));
        return Err(QuantityError::NoUnit { text: owned(), expected: expected(), help });
    }
    let mantissa: f64 = number.parse().unwrap_or(f64::NAN);
    if kinds.contains(&Kind::Temperature)
        && let Some(kelvin) = units::offset_temperature(mantissa, unit)
    {
        return Ok((kelvin, Kind::Temperature));
    }
    let Some(known) = units::unit(unit, wanted) else {
        return Err(unknown_unit(text, number, unit, kinds));
    };
    let hit = kinds.iter().copied().find(|kind| kind.exponents() == known.exponents);
    let angular = Exponents([0, 0, -1, 0, 0, 1, 0]);
    let (factor, kind) = match hit {
        Some(kind) => (known.factor, kind),
        None if known.exponents == angular && kinds.contains(&Kind::Frequency) => (known.factor / TAU, Kind::Frequency),
        None => {
            let help = match Kind::of(known.exponents) {
                Some(Kind::Temperature) if unit == "C" => "write degrees Celsius as degC".to_owned(),
                Some(Kind::Charge) if unit == "C" && kinds.contains(&Kind::Temperature) => {
                    format!("C is the coulomb; degrees Celsius are degC: \"{number} degC\"")
                }
                Some(Kind::Frequency | Kind::DragRate) => format!("{unit} is a unit of frequency"),
                Some(other) => format!("{unit} is a unit of {}", other.name()),
                None => format!("{unit} measures something else"),
            };
            return Err(QuantityError::WrongDimension {
                text: owned(),
                noun: nouns(kinds),
                expected: expected(),
                help,
            });
        }
    };
    let value = scaled(number, mantissa, factor);
    if value.is_finite() { Ok((value, kind)) } else { Err(QuantityError::TooLarge { text: owned() }) }
}

/// "metres or a string such as "2 mm"".
pub(crate) fn expected(kinds: &[Kind]) -> String {
    match kinds {
        // A bare number could be either, so it is not offered.
        [Kind::DragRate, _] => "a string such as \"0.1 /s\" or \"1e-14 kg/s\"".to_owned(),
        [kind, ..] => format!("{} or a string such as \"{}\"", kind.si(), kind.example()),
        [] => "a number".to_owned(),
    }
}

/// "a length"; "a drag rate or a drag coefficient".
pub(crate) fn nouns(kinds: &[Kind]) -> String {
    crate::suggestion::list(&kinds.iter().map(|kind| kind.noun()).collect::<Vec<_>>(), "or")
}

fn unknown_unit(text: &str, number: &str, unit: &str, kinds: &[Kind]) -> QuantityError {
    let wanted = kinds.first().copied().unwrap_or(Kind::Length);
    let help = if kinds.contains(&Kind::Temperature) && matches!(unit, "degrees" | "deg C" | "c") {
        format!("did you mean \"{number} degC\"?")
    } else {
        match kinds.iter().find_map(|&kind| units::nearest(unit, kind)) {
            Some(nearest) => format!("did you mean `{nearest}`?"),
            None => format!("units of {} are written as in \"{}\"", wanted.name(), wanted.example()),
        }
    };
    QuantityError::UnknownUnit { text: text.to_owned(), unit: unit.to_owned(), expected: expected(kinds), help }
}

/// A number with a unit of whatever kind, in SI.
pub(crate) fn in_si(text: &str) -> Option<f64> {
    parse(text, &kind::KINDS).ok().map(|(value, _)| value)
}

/// The unit in a kind's example.
fn sample_unit(kind: Kind) -> &'static str {
    kind.example().split_once(' ').map_or("", |(_, unit)| unit)
}

/// Splits "1.5e3 V" into number and unit: the longest beginning that is a number.
pub(crate) fn split(text: &str) -> (&str, &str) {
    let bytes = text.as_bytes();
    let digits = |mut at: usize| {
        let start = at;
        while bytes.get(at).is_some_and(u8::is_ascii_digit) {
            at += 1;
        }
        (at, at - start)
    };
    let sign = usize::from(matches!(bytes.first(), Some(b'+' | b'-')));
    let (mut at, mut count) = digits(sign);
    if bytes.get(at) == Some(&b'.') {
        let (end, decimals) = digits(at + 1);
        (at, count) = (end, count + decimals);
    }
    if count == 0 {
        return ("", text);
    }
    if matches!(bytes.get(at), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(at + 1), Some(b'+' | b'-')));
        let (end, count) = digits(at + 1 + sign);
        // "10 e" and "10e" are elementary charges.
        if count > 0 {
            at = end;
        }
    }
    (&text[..at], text[at..].trim())
}

/// `number` times `factor`, correctly rounded where the factor is a power of ten.
fn scaled(number: &str, mantissa: f64, factor: f64) -> f64 {
    let power = factor.log10().round();
    let exact = format!("1e{power}").parse::<f64>().unwrap_or(f64::NAN);
    // 1e-14 is some tens of roundings: the factor of a compound unit is a product of a few.
    if (factor - exact).abs() <= 1e-14 * exact {
        let (digits, exponent) = number.split_once(['e', 'E']).unwrap_or((number, "0"));
        // An exponent that is no i32 is far beyond any f64 and gives the same zero or infinity without the shift.
        if let Ok(exponent) = exponent.parse::<i32>() {
            let shifted = i64::from(exponent) + power as i64;
            return format!("{digits}e{shifted}").parse().unwrap_or(f64::NAN);
        }
    }
    mantissa * factor
}

#[cfg(test)]
mod tests {
    use super::*;

    fn si(text: &str, kind: Kind) -> f64 {
        parse(text, &[kind]).unwrap_or_else(|error| panic!("{error}")).0
    }

    fn message(text: &str, kind: Kind) -> String {
        let error = parse(text, &[kind]).unwrap_err();
        format!("{error}\n{}", error.help().unwrap_or_default())
    }

    #[test]
    fn decimal_units_are_correctly_rounded() {
        // Bit for bit the number one would have written in SI.
        assert_eq!(si("2 mm", Kind::Length), 0.002);
        assert_eq!(si("5 um", Kind::Length), 5e-6);
        assert_eq!(si("5 µm", Kind::Length), 5e-6);
        assert_eq!(si("5 \u{3bc}m", Kind::Length), 5e-6);
        assert_eq!(si("5um", Kind::Length), 5e-6);
        assert_eq!(si("1.5 kV", Kind::Voltage), 1500.0);
        assert_eq!(si("10 fC", Kind::Charge), 1e-14);
        assert_eq!(si("-9.81 m/s^2", Kind::Acceleration), -9.81);
        assert_eq!(si("-9.81 m/s2", Kind::Acceleration), -9.81);
        assert_eq!(si("12 V/cm", Kind::ElectricField), 1200.0);
        assert_eq!(si("2.2 g/cm^3", Kind::Density), 2200.0);
        assert_eq!(si("1 bar", Kind::Pressure), 1e5);
        assert_eq!(si("1 mbar", Kind::Pressure), 100.0);
        assert_eq!(si("0.1 /s", Kind::DragRate), 0.1);
        assert_eq!(si("0.1 1/s", Kind::DragRate), 0.1);
        assert_eq!(si("0.1 s^-1", Kind::DragRate), 0.1);
        assert_eq!(si("0.1 s⁻¹", Kind::DragRate), 0.1);
        assert_eq!(si("3 mm/s", Kind::Velocity), 0.003);
        assert_eq!(si("1e3 ms", Kind::Time), 1.0);
        assert_eq!(si("20 kHz", Kind::Frequency), 2e4);
        assert_eq!(si("0.5 T", Kind::MagneticField), 0.5);
        assert_eq!(si("2 GB", Kind::Memory), 2e9);
        assert_eq!(si("1 KiB", Kind::Memory), 1024.0);
        assert_eq!(si("3 millimetres", Kind::Length), 0.003);
    }

    #[test]
    fn other_units_have_their_published_values() {
        let close = |text, kind, value: f64| {
            let found = si(text, kind);
            assert!((found - value).abs() <= 1e-15 * value.abs(), "{text}: {found} is not {value}"); // round-off
        };
        close("30 deg", Kind::Angle, std::f64::consts::FRAC_PI_6);
        close("30°", Kind::Angle, std::f64::consts::FRAC_PI_6);
        close("1 rad/s", Kind::Frequency, 1.0 / TAU);
        close("10 e", Kind::Charge, 1.602_176_634e-18);
        close("10e", Kind::Charge, 1.602_176_634e-18);
        close("1 eV", Kind::Energy, 1.602_176_634e-19);
        close("40 u", Kind::Mass, 40.0 * 1.660_539_066_60e-27);
        close("300 K", Kind::Temperature, 300.0);
        close("27 degC", Kind::Temperature, 300.15);
        close("27 °C", Kind::Temperature, 300.15);
        close("1 atm", Kind::Pressure, 101_325.0);
        close("2 min", Kind::Time, 120.0);
        close("1 in", Kind::Length, 0.0254);
        close("1 N/C", Kind::ElectricField, 1.0);
        close("1 mrad", Kind::Angle, 1e-3);
        close("1 keV", Kind::Energy, 1.602_176_634e-16);
        close("1 kg/(A s^2)", Kind::MagneticField, 1.0);
    }

    #[test]
    fn a_drag_is_a_rate_or_a_coefficient() {
        let drag = [Kind::DragRate, Kind::DragCoefficient];
        assert_eq!(parse("0.1 /s", &drag).unwrap(), (0.1, Kind::DragRate));
        assert_eq!(parse("1/s", &drag).unwrap(), (1.0, Kind::DragRate));
        assert_eq!(parse("1e-14 kg/s", &drag).unwrap(), (1e-14, Kind::DragCoefficient));
    }

    #[test]
    fn every_suggestion_and_every_example_can_be_read() {
        for kind in kind::KINDS {
            for unit in kind.usual_units() {
                let (_, found) = parse(&format!("1 {unit}"), &[kind]).unwrap_or_else(|error| panic!("{error}"));
                assert_eq!(found, kind);
            }
            assert_eq!(parse(kind.example(), &[kind]).map(|(_, kind)| kind), Ok(kind));
        }
    }

    #[test]
    fn messages_say_what_to_change() {
        let length = |text| message(text, Kind::Length);
        assert!(length("2 V").starts_with("\"2 V\" is not a length: expected metres or a string such as \"2 mm\""));
        assert!(length("2 V").contains("V is a unit of voltage"));
        assert!(length("2 mmm").contains("did you mean `mm`?"));
        assert!(length("2 MM").contains("did you mean `mm`?"), "{}", length("2 MM"));
        assert!(message("2 KV", Kind::Voltage).contains("did you mean `kV`?"));
        assert!(message("2 hz", Kind::Frequency).contains("did you mean `Hz`?"));
        assert!(message("27 C", Kind::Temperature).contains("\"27 degC\""));
        assert!(length("").contains("is empty"));
        assert!(length("1,5 mm").contains("\"1.5 mm\""));
        assert!(length("2").contains("has no unit"));
        assert!(length("nan m").contains("not a finite number"));
        assert!(length("-inf m").contains("not a finite number"));
        assert!(length("1e999 m").contains("too large"));
        assert!(length("1e99999999999 m").contains("too large"));
        assert!(length("two mm").contains("does not begin with a number"));
        assert!(length("2 mm mm").contains("is not a length"));
        assert!(length("2 mm, about").contains("unknown unit"));
        assert!(length("2 m/").contains("unknown unit"));
        assert!(length("2 m//s").contains("unknown unit"));
        assert!(length("2 m^99").contains("unknown unit"));
    }
}
