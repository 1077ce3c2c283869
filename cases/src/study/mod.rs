//! Studies: a case at many points of a sweep.
//!
//! * **point**: the case with some keys at other values ([`points`]);
//! * **row**: what is reported of it, or why there is nothing to report ([`row`]);
//! * **journal**: rows as they come, so that a study that was stopped goes on where it was ([`journal`]);
//! * **shard**: one of n parts of a study, for machines that do not know of each other ([`shard`]).
//!
//! Points with the same electrodes share one solution of the field, and one table where their grains start in the same box
//! ([`work`]): voltages and grains are weights on it. Solutions are worked out one after the other, each with all threads; the
//! points on one of them in parallel.

pub mod figures;
pub mod files;
pub mod front;
pub mod grid;
pub mod journal;
pub mod numbers;
pub mod points;
pub mod row;
pub mod sampling;
pub mod shard;
pub mod work;
