//! The command itself, as a user starts it: what it says, what it writes, and what it leaves when something goes wrong.
//!
//! The whole suite takes one to two minutes on two cores; a third of that are the shipped cases in `golden`.

#[path = "../common/mod.rs"]
mod common;

mod analyse;
mod bad_run;
mod golden;
mod grids;
mod ground;
mod harness;
mod json;
mod odd;
mod optimise;
mod report;
mod resume;
mod same;
mod stopped;
mod study;
