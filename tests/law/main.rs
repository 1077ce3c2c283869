//! Laws: reciprocity, superposition, rotation, thread count.

mod threads;
