//! The shipped experiments give the numbers that their texts promise: each case is flown as it is shipped, or with the keys set
//! that a test names, and compared with exact trajectories, Floquet's theorem or its own field.

mod annulus;
mod crystals;
mod dust_in_air;
mod ejection;
mod flown;
mod mathieu;
mod penning;
mod planar_toy;
mod plasma;
mod ring_and_plate;
mod two_rings;
