//! Objectives and constraints: formulas over the numbers of a row.
//!
//! The grammar is that of the crate `exmex` (`+ - * / ^`, `abs`, `sqrt`, `ln`, `exp`, `sin`, ..., `min(a, b)`, `max(a, b)`), and three
//! things beside it: names may have points in them (`capacitance.left.right`, `electrode.ring.radius`), numbers an exponent (`1e-3`) and
//! a unit (`0.1 mm`, `5 MV`). A name with other characters stands in braces.

use exmex::{Express, FlatEx};

use crate::key_path::is_name_character;
use crate::quantity::in_si;

/// Longer formulas are no work of a person, and parentheses too deep for the parser.
const LONGEST: usize = 1000;

/// A formula.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    /// As it is written.
    pub text: String,
    parsed: FlatEx<f64>,
}

impl Expression {
    /// Reads a formula.
    ///
    /// # Errors
    /// What is wrong, in a sentence.
    pub fn parse(text: &str) -> Result<Self, String> {
        if text.trim().is_empty() {
            return Err("there is no formula".to_owned());
        }
        if text.len() > LONGEST {
            return Err(format!("it is longer than {LONGEST} characters"));
        }
        let parsed = exmex::parse::<f64>(&plain(text)?).map_err(|error| error.msg().to_owned())?;
        // The crate lets some things pass that have no value, as a list.
        Ok(Self { text: text.trim().to_owned(), parsed })
    }

    /// The names in it, in alphabetical order.
    pub fn names(&self) -> &[String] {
        self.parsed.var_names()
    }

    /// Its value, with the values of its names.
    ///
    /// # Errors
    /// A name without a value, or a value that is no finite number: a sentence.
    pub fn value(&self, of: impl Fn(&str) -> Option<f64>) -> Result<f64, String> {
        let values: Vec<f64> = self
            .names()
            .iter()
            .map(|name| of(name).ok_or_else(|| format!("there is no {name} at this point")))
            .collect::<Result<_, _>>()?;
        match self.parsed.eval(&values) {
            Ok(value) if value.is_finite() => Ok(value),
            Ok(value) => Err(format!("`{}` is {value} at this point", self.text)),
            Err(error) => Err(error.msg().to_owned()),
        }
    }

    /// Its value where it has no names.
    pub fn constant(&self) -> Option<f64> {
        if self.names().is_empty() { self.value(|_| None).ok() } else { None }
    }
}

/// The formula with names in braces and numbers without exponents and units.
fn plain(text: &str) -> Result<String, String> {
    let mut plain = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let word = |of: fn(char) -> bool| rest.find(|c| !of(c)).unwrap_or(rest.len());
        if first == '{' {
            let end = rest.find('}').ok_or("a brace { is not closed")?;
            plain.push_str(&rest[..=end]);
            rest = &rest[end + 1..];
        } else if first.is_ascii_digit() || first == '.' {
            let (number, after) = crate::quantity::split(rest);
            if number.is_empty() {
                return Err(format!("`{rest}` does not begin with a number"));
            }
            let spaced = after.trim_start();
            // As in `0.1 mm`: behind a number nothing else can be a name.
            let unit = match spaced.chars().next() {
                Some(c) if c.is_alphabetic() || c == '°' => {
                    &spaced[..spaced.find(|c: char| !c.is_alphanumeric() && c != '°').unwrap_or(spaced.len())]
                }
                _ => "",
            };
            let value = if unit.is_empty() {
                number.parse().map_err(|_| format!("`{number}` is no number"))?
            } else {
                in_si(&format!("{number} {unit}")).ok_or_else(|| format!("`{unit}` behind {number} is no unit"))?
            };
            // Never with an exponent.
            plain.push_str(&format!("{value}"));
            rest = if unit.is_empty() { after } else { &spaced[unit.len()..] };
        } else if first.is_alphabetic() || first == '_' {
            // A minus is one, though names of electrodes may hold it: those stand in braces.
            let end = word(|c| is_name_character(c) && c != '-' || c == '.');
            let name = rest[..end].trim_end_matches('.');
            rest = &rest[name.len()..];
            match name {
                _ if rest.trim_start().starts_with('(') => plain.push_str(name),
                "pi" => plain.push_str(&format!("{}", std::f64::consts::PI)),
                _ => plain.push_str(&format!("{{{name}}}")),
            }
        } else if first == '-' {
            // The crate binds a sign more closely than a power; everybody else reads -x^2 as -(x^2).
            plain.push_str(match plain.trim_end().chars().last() {
                None | Some('(' | ',') => "0-",
                Some('*' | '+' | '-') => "(0-1)*",
                Some('/') => "(0-1)/",
                _ => "-",
            });
            rest = &rest[1..];
        } else {
            plain.push(first);
            rest = &rest[first.len_utf8()..];
        }
    }
    Ok(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Result<f64, String> {
        let of = |name: &str| match name {
            "A2" => Some(-4.0),
            "A4_rf" => Some(2.0),
            "electrode.ring.radius" => Some(0.02),
            "capacitance.left-cap.ring" => Some(1e-12),
            "e" | "min" => Some(7.0),
            _ => None,
        };
        Expression::parse(text)?.value(of)
    }

    #[test]
    fn formulas_have_their_values() {
        for (text, expected) in [
            ("-abs(A4_rf/A2)", -0.5),
            ("2*A4_rf^2 - A2", 12.0),
            ("-A2^2", -16.0),
            ("2 * -A4_rf^2 - -A2^2", 8.0),
            ("1 / -A4_rf^2 + max(-1, -A4_rf^2) + 2^-1", -0.75),
            ("1e-3 + 2.5E2", 250.001),
            ("electrode.ring.radius - 5 mm", 0.015),
            ("electrode.ring.radius-0.005", 0.015),
            ("2*max(A2, A4_rf) + min(A2,1)", 0.0),
            ("{capacitance.left-cap.ring} * 1e12", 1.0),
            ("e + min", 14.0),
            ("sqrt(16) * 1.5 kV / 2", 3000.0),
            ("90 deg / pi", 0.5),
            ("(A2 + 1) * (A2 - 1)", 15.0),
        ] {
            let got = value(text).unwrap_or_else(|error| panic!("{text}: {error}"));
            // Rounding of sums.
            assert!((got - expected).abs() <= 1e-13 * expected.abs().max(1.0), "{text}: {got}, not {expected}");
        }
    }

    #[test]
    fn what_is_no_formula_is_refused() {
        for text in ["", "A2 +", "(A2", "abs", "1 zz", "A2 A4_rf", "{A2", "A2 / 0", "sqrt(A2)", "A6", "sinus(A2)"] {
            assert!(value(text).is_err(), "{text}: {:?}", value(text));
        }
        assert_eq!(value("A6").unwrap_err(), "there is no A6 at this point");
        assert_eq!(Expression::parse("b*a + electrode.x.dc*a").unwrap().names(), ["a", "b", "electrode.x.dc"]);
        assert_eq!(Expression::parse("2 mm").unwrap().constant(), Some(0.002));
    }
}
