//! What a unit is worth: single units from `uom`, products and quotients of them by our own short parser.
//!
//! `uom` knows the names and factors of some thousand units, but a compound such as V/cm only where somebody listed it,
//! and spells some units in ways nobody types (µm, m/s², °). So units are looked up one by one, in the notations people
//! use, and multiplied here together with their dimensions.

use std::str::FromStr;

use uom::si::f64 as si;

use super::Kind;

/// Powers of m, kg, s, A, K, rad and B in a unit. The radian counts as a base unit so that "2 rad" is not a pure number
/// and rad/s is not Hz.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Exponents(pub [i8; 7]);

/// A unit: its worth in SI and its dimension.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unit {
    pub factor: f64,
    pub exponents: Exponents,
}

/// One quantity of `uom`: looks up the value of "1 mm".
struct Family {
    kind: Kind,
    exponents: Exponents,
    value: fn(&str) -> Option<f64>,
}

macro_rules! family {
    ($kind:ident, $quantity:ident) => {
        family!(Kind::$kind, Kind::$kind.exponents(), $quantity)
    };
    ($kind:expr, $exponents:expr, $quantity:ident) => {
        Family {
            kind: $kind,
            exponents: $exponents,
            value: |text| si::$quantity::from_str(text).ok().map(|quantity| quantity.value),
        }
    };
}

/// What single units are looked up in, in this order where a name has several meanings ("min" is a time before it is an
/// angle), after the kind that is wanted.
fn families() -> [Family; 15] {
    [
        family!(Length, Length),
        family!(Time, Time),
        family!(Mass, Mass),
        family!(Charge, ElectricCharge),
        family!(Voltage, ElectricPotential),
        family!(Frequency, Frequency),
        family!(Angle, Angle),
        family!(Temperature, ThermodynamicTemperature),
        family!(Energy, Energy),
        family!(Force, Force),
        family!(Pressure, Pressure),
        family!(MagneticField, MagneticFluxDensity),
        family!(Memory, Information),
        // Not a quantity of the case file, but a part of units such as kg/(A s²); its name is never shown.
        family!(Kind::Charge, Exponents([0, 0, 0, 1, 0, 0, 0]), ElectricCurrent),
        family!(Kind::Charge, Exponents([3, 0, 0, 0, 0, 0, 0]), Volume),
    ]
}

/// The value of `number` (already known to be one) times a single unit with an offset, such as degC.
pub(super) fn offset_temperature(number: f64, unit: &str) -> Option<f64> {
    let unit = spellings(unit).into_iter().find(|unit| unit.starts_with('°'))?;
    si::ThermodynamicTemperature::from_str(&format!("{number} {unit}")).ok().map(|t| t.value)
}

/// Looks up a unit such as "mm", "V/cm", "m/s^2" or "/s".
pub(super) fn unit(text: &str, wanted: Kind) -> Option<Unit> {
    if let Some(unit) = single(text, Some(wanted)) {
        return Some(unit);
    }
    let mut product = Unit { factor: 1.0, exponents: Exponents::default() };
    for (n, part) in text.split('/').enumerate() {
        let part = part.trim().trim_start_matches('(').trim_end_matches(')');
        if part.is_empty() || part == "1" {
            // "/s" and "1/s"; anything else with an empty part is a slip.
            if n > 0 || !text.contains('/') {
                return None;
            }
            continue;
        }
        for factor in part.split(['*', '·', '⋅', ' ']).filter(|factor| !factor.is_empty()) {
            let (base, power) = power(factor)?;
            let base = single(&base, None)?;
            let power = if n == 0 { power } else { -power };
            product.factor *= base.factor.powi(power);
            for (sum, exponent) in product.exponents.0.iter_mut().zip(base.exponents.0) {
                *sum = i8::try_from(i32::from(*sum) + i32::from(exponent) * power).ok()?;
            }
        }
    }
    Some(product)
}

/// The unit most like one that does not exist, among those in use for the wanted kind.
pub(super) fn nearest(text: &str, wanted: Kind) -> Option<String> {
    let lower = text.to_lowercase();
    crate::suggestion::nearest(text, wanted.usual_units())
        // "Volt" and "Millimeters": unit names are written small.
        .or_else(|| single(&lower, Some(wanted)).filter(|unit| unit.exponents == wanted.exponents()).map(|_| lower))
}

/// A single unit, in any of the notations people use.
fn single(text: &str, wanted: Option<Kind>) -> Option<Unit> {
    let families = families();
    let wanted_first = families.iter().filter(|f| Some(f.kind) == wanted).chain(&families);
    for family in wanted_first {
        for spelling in spellings(text) {
            if spelling.contains("°") && family.kind == Kind::Temperature {
                continue; // has an offset: not a factor
            }
            if let Some(factor) = (family.value)(&format!("1 {spelling}")) {
                return Some(Unit { factor, exponents: family.exponents });
            }
        }
    }
    prefixed(text)
}

/// Parts and multiples that `uom` leaves out.
fn prefixed(text: &str) -> Option<Unit> {
    let base = ["rad", "eV", "Da", "u"].into_iter().find(|base| text.len() > base.len() && text.ends_with(base))?;
    let factor = match text.strip_suffix(base)? {
        "n" => 1e-9,
        "u" | "µ" | "\u{3bc}" => 1e-6,
        "m" => 1e-3,
        "k" => 1e3,
        "M" => 1e6,
        "G" => 1e9,
        _ => return None,
    };
    let base = single(base, None)?;
    Some(Unit { factor: factor * base.factor, ..base })
}

/// The ways `uom` may spell what was typed.
fn spellings(text: &str) -> Vec<String> {
    let fixed = match text {
        "deg" => "°",
        "degC" | "celsius" | "Celsius" => "°C",
        "degF" => "°F",
        "u" | "amu" => "Da",
        "sec" => "s",
        "angstrom" | "Angstrom" | "\u{212b}" => "Å",
        "hour" | "hours" => "h",
        _ => "",
    };
    if !fixed.is_empty() {
        return vec![fixed.to_owned()];
    }
    let micro = |rest: &str| format!("µ{rest}");
    let mut all = vec![text.to_owned()];
    if let Some(rest) = text.strip_prefix('u').or(text.strip_prefix('\u{3bc}')) {
        all.push(micro(rest));
    }
    if text.contains("metre") {
        all.push(text.replace("metre", "meter"));
    }
    all
}

/// Splits "s^2", "s2", "s²" and "s^-1" into unit and power.
fn power(text: &str) -> Option<(String, i32)> {
    let plain: String = text
        .chars()
        .map(|c| match c {
            '⁰' => '0',
            '¹' => '1',
            '²' => '2',
            '³' => '3',
            '⁴' => '4',
            '⁵' => '5',
            '⁶' => '6',
            '⁷' => '7',
            '⁸' => '8',
            '⁹' => '9',
            '⁻' => '-',
            other => other,
        })
        .collect();
    let start = plain.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    if start == plain.len() {
        return Some((plain, 1));
    }
    let start = if plain[..start].ends_with('-') { start - 1 } else { start };
    let power = plain[start..].parse::<i32>().ok().filter(|power| (1..=9).contains(&power.abs()))?;
    let base = plain[..start].trim_end_matches("**").trim_end_matches('^');
    Some((base.to_owned(), power))
}
