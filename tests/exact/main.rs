//! Against closed forms and reference values of twelve digits and more.

mod capacitance;
mod composite;
mod grounded_plane;
mod panel_integrals;
mod paul_trap;
mod sphere_in_field;
mod table;
