//! A case as the pipeline sees it: complete, checked, in SI.

mod analysis;
mod electrode;
mod foreign;
mod optimise;
mod parts;
mod settings;

use std::path::Path;

use field::Waveform;
use serde::Serialize;

pub use crate::keys::settings::{Gas, Integrator, Method, Reflection, Solver};
pub use crate::keys::study::{Goal, Optimiser, StudyKind};
pub use crate::keys::sweep::Sampling;
pub use analysis::{Analysis, Chart, ChartAxis, ChartGrains, ChartVoltages, WantedMultipole, Wish};
pub use electrode::{Drive, Electrode, ElectrodeShape, ImportedMesh, MeshFormat, Source, SourceKind};
pub use optimise::{Asked, Constraint, Optimise, Tie, Varied};
pub use parts::CaseParts;
pub use settings::{
    Drag, FieldSettings, Forces, GROUND, GrainGroup, Output, Region, Study, Sweep, SweepAxis, TableSettings,
    TraceSettings, Weighing,
};

use crate::case_source::CaseSource;
use crate::error::CaseError;

/// Everything a case file says, in SI, with every default filled in and every rule checked that can be checked without
/// building the electrodes.
///
/// Stored runs hold it as JSON (`serde_json::to_string(&case)`).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Case {
    /// What the case shows; may be empty.
    pub title: String,
    /// Electrodes, in the order of the file.
    pub electrodes: Vec<Electrode>,
    /// Fields in closed form, in the order of the file. Electrodes and sources have no names in common.
    pub sources: Vec<Source>,
    /// How exactly the field is computed.
    pub field: FieldSettings,
    /// The tabulated potential.
    pub table: TableSettings,
    /// Groups of grains.
    pub grains: Vec<GrainGroup>,
    /// What acts on them besides the field.
    pub forces: Forces,
    /// How they are traced; there, where there are grains.
    pub trace: Option<TraceSettings>,
    /// What is written.
    pub output: Output,
    /// What an analysis looks at.
    pub analysis: Analysis,
    /// What a study varies.
    pub sweep: Option<Sweep>,
    /// What a study looks at.
    pub study: Study,
}

impl Case {
    /// What each electrode, then each source, is given: a voltage, a strength, or a charge where it floats; and which float.
    pub fn given(&self) -> (Vec<Waveform>, Vec<bool>) {
        let electrodes = self.electrodes.iter().map(|e| match &e.drive {
            Drive::Voltage(waveform) => (waveform.clone(), false),
            Drive::Charge(charge) => (Waveform::constant(*charge), true),
        });
        let sources = self.sources.iter().map(|s| (s.waveform.clone(), false));
        electrodes.chain(sources).unzip()
    }

    /// Reads a case file. `sets` are changes from the command line, as `electrode.left.dc=7 V`, applied in order.
    ///
    /// # Errors
    /// The first thing that is wrong: see [`CaseError`].
    pub fn read(path: impl AsRef<Path>, sets: &[String]) -> Result<(Self, CaseSource), CaseError> {
        let source = CaseSource::read(path.as_ref(), sets)?;
        let case = crate::resolve::case(&source)?;
        Ok((case, source))
    }

    /// The same from a text at hand; `path` names it in messages, and its folder is where relative paths start.
    ///
    /// # Errors
    /// The first thing that is wrong: see [`CaseError`].
    pub fn parse(path: impl AsRef<Path>, text: &str, sets: &[String]) -> Result<(Self, CaseSource), CaseError> {
        let source = CaseSource::parse(path.as_ref(), text.to_owned(), sets)?;
        let case = crate::resolve::case(&source)?;
        Ok((case, source))
    }
}
