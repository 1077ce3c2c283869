//! The kinds of quantity a case file holds.

use super::units::Exponents;

/// What a number in the case file measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// m.
    Length,
    /// s.
    Time,
    /// Hz.
    Frequency,
    /// kg.
    Mass,
    /// C.
    Charge,
    /// V.
    Voltage,
    /// rad.
    Angle,
    /// K.
    Temperature,
    /// m/s.
    Velocity,
    /// m/s².
    Acceleration,
    /// N.
    Force,
    /// V/m.
    ElectricField,
    /// T.
    MagneticField,
    /// Pa.
    Pressure,
    /// kg/m³.
    Density,
    /// J.
    Energy,
    /// 1/s, of a drag.
    DragRate,
    /// kg/s, of a drag.
    DragCoefficient,
    /// Bytes.
    Memory,
}

/// Every kind, in the order in which a unit's meaning is looked for.
pub(super) const KINDS: [Kind; 19] = [
    Kind::Length,
    Kind::Time,
    Kind::Frequency,
    Kind::Mass,
    Kind::Charge,
    Kind::Voltage,
    Kind::Angle,
    Kind::Temperature,
    Kind::Velocity,
    Kind::Acceleration,
    Kind::Force,
    Kind::ElectricField,
    Kind::MagneticField,
    Kind::Pressure,
    Kind::Density,
    Kind::Energy,
    Kind::DragRate,
    Kind::DragCoefficient,
    Kind::Memory,
];

impl Kind {
    /// Its name without an article, as in "mm is a unit of length".
    pub fn name(self) -> &'static str {
        self.words().0
    }

    /// Its name with an article: "a length".
    pub fn noun(self) -> String {
        let name = self.name();
        match name.chars().next() {
            Some('a' | 'e' | 'i' | 'o' | 'u') => format!("an {name}"),
            _ if self == Self::Memory => "an amount of memory".to_owned(),
            _ => format!("a {name}"),
        }
    }

    /// The SI unit in words: "metres".
    pub fn si(self) -> &'static str {
        self.words().1
    }

    /// How one would write it with a unit: "2 mm".
    pub fn example(self) -> &'static str {
        self.words().2
    }

    /// Units in use for it, to suggest from.
    pub(super) fn usual_units(self) -> &'static [&'static str] {
        match self {
            Self::Length => &["m", "cm", "mm", "um", "nm", "km", "in"],
            Self::Time => &["s", "ms", "us", "ns", "min", "h", "d"],
            Self::Frequency => &["Hz", "kHz", "MHz", "GHz", "mHz", "rad/s"],
            Self::Mass => &["kg", "g", "mg", "ug", "ng", "pg", "fg", "u"],
            Self::Charge => &["C", "mC", "uC", "nC", "pC", "fC", "aC", "e"],
            Self::Voltage => &["V", "kV", "mV", "uV", "MV"],
            Self::Angle => &["deg", "rad", "mrad"],
            Self::Temperature => &["K", "mK", "uK", "degC"],
            Self::Velocity => &["m/s", "cm/s", "mm/s", "um/s", "km/s"],
            Self::Acceleration => &["m/s^2", "cm/s^2", "mm/s^2"],
            Self::Force => &["N", "mN", "uN", "nN", "pN", "fN", "aN"],
            Self::ElectricField => &["V/m", "kV/m", "V/cm", "V/mm", "kV/cm"],
            Self::MagneticField => &["T", "mT", "uT", "nT", "G"],
            Self::Pressure => &["Pa", "kPa", "hPa", "mPa", "bar", "mbar", "atm", "Torr", "mTorr"],
            Self::Density => &["kg/m^3", "g/cm^3"],
            Self::Energy => &["J", "mJ", "eV", "keV", "MeV", "meV"],
            Self::DragRate => &["/s", "1/s", "/ms"],
            Self::DragCoefficient => &["kg/s", "g/s", "ng/s"],
            Self::Memory => &["B", "kB", "MB", "GB", "TB", "KiB", "MiB", "GiB"],
        }
    }

    /// Powers of the base units.
    pub(super) fn exponents(self) -> Exponents {
        // m, kg, s, A, K, rad, B
        Exponents(match self {
            Self::Length => [1, 0, 0, 0, 0, 0, 0],
            Self::Time => [0, 0, 1, 0, 0, 0, 0],
            Self::Frequency | Self::DragRate => [0, 0, -1, 0, 0, 0, 0],
            Self::Mass => [0, 1, 0, 0, 0, 0, 0],
            Self::Charge => [0, 0, 1, 1, 0, 0, 0],
            Self::Voltage => [2, 1, -3, -1, 0, 0, 0],
            Self::Angle => [0, 0, 0, 0, 0, 1, 0],
            Self::Temperature => [0, 0, 0, 0, 1, 0, 0],
            Self::Velocity => [1, 0, -1, 0, 0, 0, 0],
            Self::Acceleration => [1, 0, -2, 0, 0, 0, 0],
            Self::Force => [1, 1, -2, 0, 0, 0, 0],
            Self::ElectricField => [1, 1, -3, -1, 0, 0, 0],
            Self::MagneticField => [0, 1, -2, -1, 0, 0, 0],
            Self::Pressure => [-1, 1, -2, 0, 0, 0, 0],
            Self::Density => [-3, 1, 0, 0, 0, 0, 0],
            Self::Energy => [2, 1, -2, 0, 0, 0, 0],
            Self::DragCoefficient => [0, 1, -1, 0, 0, 0, 0],
            Self::Memory => [0, 0, 0, 0, 0, 0, 1],
        })
    }

    /// The kind a unit of these base units measures.
    pub(super) fn of(exponents: Exponents) -> Option<Kind> {
        KINDS.into_iter().find(|kind| kind.exponents() == exponents)
    }

    /// Name, SI unit, example.
    fn words(self) -> (&'static str, &'static str, &'static str) {
        match self {
            Self::Length => ("length", "metres", "2 mm"),
            Self::Time => ("time", "seconds", "10 ms"),
            Self::Frequency => ("frequency", "hertz", "60 Hz"),
            Self::Mass => ("mass", "kilograms", "1e-13 kg"),
            Self::Charge => ("charge", "coulombs", "10 fC"),
            Self::Voltage => ("voltage", "volts", "1.5 kV"),
            Self::Angle => ("angle", "radians", "30 deg"),
            Self::Temperature => ("temperature", "kelvin", "300 K"),
            Self::Velocity => ("velocity", "metres per second", "3 mm/s"),
            Self::Acceleration => ("acceleration", "metres per second squared", "-9.81 m/s^2"),
            Self::Force => ("force", "newtons", "1 fN"),
            Self::ElectricField => ("electric field", "volts per metre", "12 V/cm"),
            Self::MagneticField => ("magnetic field", "tesla", "0.5 T"),
            Self::Pressure => ("pressure", "pascals", "1 mbar"),
            Self::Density => ("density", "kilograms per cubic metre", "2.2 g/cm^3"),
            Self::Energy => ("energy", "joules", "1 eV"),
            Self::DragRate => ("drag rate", "per second", "0.1 /s"),
            Self::DragCoefficient => ("drag coefficient", "kilograms per second", "1e-14 kg/s"),
            Self::Memory => ("memory", "bytes", "2 GB"),
        }
    }
}
