//! Slopes of log error over log h or log dt, against the declared order.

mod field_of_panels;
mod steps_in_a_table;
mod table;
