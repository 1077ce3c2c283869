//! What can go wrong while a VTK file is written.

/// Why a VTK file could not be written.
///
/// All but `Io`, and `NonFinite` or `NonFiniteOnLine` in computed arrays, are found before the first byte is written.
#[derive(Debug, thiserror::Error)]
pub enum VtkError {
    /// The output refused bytes.
    #[error("the output cannot be written: {0}")]
    Io(#[from] std::io::Error),

    /// vtkio refused the data.
    #[error("vtkio cannot encode this: {0}")]
    Encoding(String),

    /// An array does not hold one tuple per point, cell or polyline.
    #[error(
        "array `{array}` has {found} values, but {tuples} {of} of {components} components need {}",
        *.tuples as u128 * *.components as u128
    )]
    Length {
        /// Name of the array.
        array: String,
        /// Number of values in it.
        found: usize,
        /// Number of tuples it should have.
        tuples: usize,
        /// Values per tuple.
        components: usize,
        /// What the tuples belong to: `points`, `cells`, `polylines`.
        of: &'static str,
    },

    /// A value is NaN or infinite.
    #[error("array `{array}` is {value} at index {index}, component {component}; only finite values are written")]
    NonFinite {
        /// Name of the array (`Points` for coordinates).
        array: String,
        /// Number of the tuple, from 0.
        index: usize,
        /// Component of the tuple, from 0.
        component: usize,
        /// The value.
        value: f64,
    },

    /// A value on a polyline is NaN or infinite, or was left unset by the function that computes the array.
    #[error(
        "array `{array}` is {value} on polyline {line} at its point {point}, component {component}; only finite values \
         are written"
    )]
    NonFiniteOnLine {
        /// Name of the array (`Points` for coordinates).
        array: String,
        /// Number of the polyline, from 0.
        line: usize,
        /// Number of the point on that polyline, from 0.
        point: usize,
        /// Component of the tuple, from 0.
        component: usize,
        /// The value.
        value: f64,
    },

    /// An array has a name that readers would lose or misread.
    #[error("an array cannot be named {name:?}: the name {reason}")]
    Name {
        /// The name.
        name: String,
        /// What is wrong with it.
        reason: &'static str,
    },

    /// An array has no components, or more than anybody means.
    #[error("array `{array}` has {components} components; it needs between 1 and {}", super::array::BLOCK)]
    Components {
        /// Name of the array.
        array: String,
        /// Values per tuple.
        components: usize,
    },

    /// A triangle names a vertex that is not there.
    #[error("panel {panel} has vertex {vertex}, but the surface has only {vertices} vertices")]
    Vertex {
        /// Number of the panel, from 0.
        panel: usize,
        /// The vertex it asks for.
        vertex: u32,
        /// Number of vertices of the surface.
        vertices: usize,
    },

    /// A polyline without points.
    #[error("polyline {line} has no points; leave it out, or give it the point where it starts")]
    EmptyLine {
        /// Number of the polyline, from 0.
        line: usize,
    },

    /// A lattice that VTK cannot describe.
    #[error("the lattice's {key} is {value} along {axis}; it must be {expected}")]
    Lattice {
        /// `number of points`, `origin` or `spacing`.
        key: &'static str,
        /// x, y or z.
        axis: char,
        /// What was given.
        value: f64,
        /// What would do.
        expected: &'static str,
    },

    /// More data than the format can count.
    #[error("{what}: more than the file format can count")]
    TooLarge {
        /// Of what there is too much.
        what: String,
    },

    /// Times of a collection that do not increase.
    #[error("frame {frame} is at time {time}; times must be finite and increase from frame to frame")]
    Time {
        /// Number of the entry, from 0.
        frame: usize,
        /// Its time.
        time: f64,
    },

    /// A file of a collection that is not named relative to the collection.
    #[error(
        "frame {frame} names the file {file:?}; give a name relative to the collection, without control characters"
    )]
    FileName {
        /// Number of the entry, from 0.
        frame: usize,
        /// The name.
        file: String,
    },
}
