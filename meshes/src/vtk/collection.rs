//! Frames of an animation: which file belongs to which time.

use std::io::Write;
use std::path::{Component, Path};

use super::VtkError;
use super::appended::escaped;
use super::array::unprintable;

/// Writes a ParaView collection (`.pvd`): the time of each frame, s, and its file, relative to the collection.
///
/// # Errors
/// Times that are not finite or do not increase; a file name that is empty, absolute, leads upwards or has control
/// characters; an output that fails.
pub fn write_collection<S: AsRef<str>>(out: &mut dyn Write, frames: &[(f64, S)]) -> Result<(), VtkError> {
    let mut before = f64::NEG_INFINITY;
    let mut xml = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n\
         <Collection>\n",
    );
    for (frame, (time, file)) in frames.iter().enumerate() {
        let file = file.as_ref();
        if !(time.is_finite() && *time > before) {
            return Err(VtkError::Time { frame, time: *time });
        }
        before = *time;
        let inside = Path::new(file).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        if file.is_empty() || !inside || file.chars().any(unprintable) {
            return Err(VtkError::FileName { frame, file: file.to_owned() });
        }
        xml += &format!("<DataSet timestep=\"{time:?}\" part=\"0\" file=\"{}\"/>\n", escaped(file));
    }
    xml += "</Collection>\n</VTKFile>\n";
    out.write_all(xml.as_bytes())?;
    out.flush()?;
    Ok(())
}
