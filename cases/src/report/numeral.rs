//! Numbers for people: as many digits as the error leaves, a unit that fits, and beside it the number as it was computed.

use crate::plots::prefix::axis_unit;

/// Digits of a number whose error is not told.
const DIGITS: i32 = 6;
/// Digits that are shown at most, however small the error.
const MOST: i32 = 10;

/// A number, or words, in a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cell {
    /// What people read.
    pub text: String,
    /// The number in the unit it was computed in, with all digits.
    pub value: Option<String>,
}

impl Cell {
    /// Words.
    pub fn words(text: impl Into<String>) -> Self {
        Self { text: text.into(), value: None }
    }

    /// A whole number.
    pub fn count(number: u64) -> Self {
        Self { text: grouped(number), value: Some(number.to_string()) }
    }

    /// A number with one digit, for errors.
    pub fn rounded(self) -> Self {
        let (number, unit) = self.text.split_once('\u{a0}').unwrap_or((&self.text, ""));
        let text = match number.parse::<f64>() {
            Ok(x) => format!("{}\u{a0}{unit}", decimal(x, 1)),
            Err(_) => self.text.clone(),
        };
        Self { text, ..self }
    }

    /// Without the error, where there is no room for it: its digits still end where the error begins.
    pub fn short(self) -> Self {
        let (number, rest) = self.text.split_once(" ± ").unwrap_or((&self.text, ""));
        let unit = rest.split_once('\u{a0}').map_or(String::new(), |(_, unit)| format!("\u{a0}{unit}"));
        Self { text: format!("{number}{unit}"), ..self }
    }
}

/// A number in a multiple of its unit with its error, as `73.9702 ± 0.0003 pF`. Units with a prefix are those of one letter or
/// two without powers: `F`, `V`, `C`, `m`, `s`, `Hz`, `J`, `eV`, `m/s`; others keep theirs and take powers of ten.
pub fn number(value: f64, error: Option<f64>, unit: &str) -> Cell {
    let error = error.filter(|error| error.is_finite());
    let largest = if value == 0.0 { error.unwrap_or(0.0) } else { value };
    let (name, factor) = match unit {
        "F" | "V" | "C" | "m" | "Hz" | "J" | "eV" | "K" | "C/m²" => {
            let of = axis_unit(std::iter::once(largest), unit, 6);
            (of.name, of.factor)
        }
        "s" | "m/s" => {
            let of = axis_unit(std::iter::once(largest), unit, 0);
            (of.name, of.factor)
        }
        other => (other.to_owned(), 1.0),
    };
    let text = with_error(value * factor, error.map(|error| error * factor));
    let unit = if name.is_empty() { String::new() } else { format!("\u{a0}{name}") };
    Cell { text: format!("{text}{unit}"), value: Some(exact(value)) }
}

/// A number without unit.
pub fn bare(value: f64) -> Cell {
    number(value, None, "")
}

/// A relative error or the like, of which one digit matters.
pub fn rough(value: f64) -> Cell {
    let text =
        if value != 0.0 && (value.abs() < 1e-2 || value.abs() >= 1e4) { power(value, 0) } else { decimal(value, 1) };
    Cell { text, value: Some(exact(value)) }
}

/// A place, in the unit of its largest coordinate.
pub fn place(point: &[f64]) -> Cell {
    let of = axis_unit(point.iter().copied(), "m", 0);
    let largest = point.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    // Rounding is no coordinate: what is 1e-9 of the others, or of a millimetre, is none.
    let shown = |x: &f64| if x.abs() < 1e-9 * largest.max(1e-3) { 0.0 } else { x * of.factor };
    let all_zero = point.iter().all(|x| shown(x) == 0.0);
    let text: Vec<String> = point.iter().map(shown).map(|x| significant(x, DIGITS)).collect();
    let unit = if all_zero { "m" } else { &of.name };
    let value: Vec<String> = point.iter().map(|x| exact(*x)).collect();
    Cell { text: format!("({})\u{a0}{unit}", text.join(", ")), value: Some(value.join(" ")) }
}

/// As JSON writes it.
pub fn exact(value: f64) -> String {
    serde_json::Number::from_f64(value).map_or(String::new(), |number| number.to_string())
}

fn with_error(value: f64, error: Option<f64>) -> String {
    match error {
        Some(error) if error > 0.0 => {
            let size = value.abs().max(error);
            // As many decimals as the error has with one digit, of all digits at most so many.
            let shown = (-exponent(error) + exponent(size) + 1).clamp(1, MOST);
            let number = if value == 0.0 {
                "0".to_owned()
            } else {
                significant(value, shown - exponent(size) + exponent(value))
            };
            let error = if (1e-3..1e4).contains(&error) { decimal(error, 1) } else { power(error, 0) };
            format!("{number} ± {error}")
        }
        _ => trimmed(&significant(value, DIGITS)),
    }
}

/// Without zeros at the end of its decimals, which no error asks for.
fn trimmed(text: &str) -> String {
    let (mantissa, power) = text.split_at(text.find('·').unwrap_or(text.len()));
    let mantissa = if mantissa.contains('.') { mantissa.trim_end_matches('0').trim_end_matches('.') } else { mantissa };
    format!("{mantissa}{power}")
}

/// With so many digits; powers of ten where it is very large or small.
fn significant(value: f64, digits: i32) -> String {
    let digits = digits.max(1);
    if value == 0.0 {
        return "0".to_owned();
    }
    if (1e-3..1e6).contains(&value.abs()) {
        return decimal(value, digits);
    }
    power(value, digits - 1)
}

/// Of ten; 0 for zero.
fn exponent(value: f64) -> i32 {
    if value == 0.0 || !value.is_finite() { 0 } else { value.abs().log10().floor() as i32 }
}

/// So many digits without a power of ten: zeros stand for those before the point that are not shown.
fn decimal(value: f64, digits: i32) -> String {
    let decimals = digits - 1 - exponent(value);
    let step = 10_f64.powi(-decimals);
    let rounded = if decimals < 0 { (value / step).round() * step } else { value };
    format!("{rounded:.*}", decimals.max(0) as usize).replace('-', "\u{2212}")
}

/// `1.5·10⁻⁷`.
fn power(value: f64, decimals: i32) -> String {
    let text = format!("{value:.*e}", decimals.max(0) as usize);
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = exponent.chars().map(|c| c.to_digit(10).map_or('⁻', |d| RAISED[d as usize]));
    format!("{}·10{}", mantissa.replace('-', "\u{2212}"), raised.collect::<String>())
}

/// With thin spaces between thousands.
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) && digits.len() > 4 {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(value: f64, error: Option<f64>, unit: &str) -> String {
        number(value, error, unit).text.replace('\u{a0}', " ")
    }

    #[test]
    fn digits_end_where_the_error_begins() {
        assert_eq!(text(73.970158e-12, Some(3e-16), "F"), "73.9702 ± 3·10⁻⁴ pF");
        assert_eq!(text(73.970158e-12, Some(2e-14), "F"), "73.97 ± 0.02 pF");
        assert_eq!(text(-0.123456, Some(0.02), ""), "\u{2212}0.12 ± 0.02");
        assert_eq!(text(1.0, Some(3.0), ""), "1 ± 3");
        assert_eq!(text(0.0, Some(1e-9), "m"), "0 ± 1 nm");
        assert_eq!(text(1.0 / 3.0, Some(1e-300), ""), "0.3333333333 ± 1·10⁻³⁰⁰");
        assert_eq!(text(0.2891, Some(0.0101), "Hz"), "290 ± 10 mHz");
        assert_eq!(text(2.5e-3, None, "V/m²"), "0.0025 V/m²");
        assert_eq!(text(2.5e-7, None, "V/m²"), "2.5·10⁻⁷ V/m²");
        assert_eq!(text(100.0, None, "V"), "100 V");
        assert_eq!(number(743.2e-9, None, "m").rounded().text, "700\u{a0}nm");
        assert_eq!(number(1.5, Some(0.1), "Hz").short().text, "1.5\u{a0}Hz");
        assert_eq!(number(0.1 + 0.2, None, "").value.as_deref(), Some("0.30000000000000004"));
    }

    #[test]
    fn places_and_counts() {
        assert_eq!(place(&[1e-3, -2.5e-3, 1e-17]).text, "(1.00000, \u{2212}2.50000, 0)\u{a0}mm");
        assert_eq!(place(&[1e-15, 0.0, 0.0]).text, "(0, 0, 0)\u{a0}m");
        assert_eq!([grouped(999), grouped(1234), grouped(1234567)], ["999", "1234", "1\u{202f}234\u{202f}567"]);
        assert_eq!([rough(3.4e-7).text, rough(0.25).text, rough(0.0).text], ["3·10⁻⁷", "0.2", "0"]);
    }
}
