//! Studies: a case at many points of a sweep.
//!
//! * **point**: the case with some keys at other values ([`points`]);
//! * **row**: what is reported of it, or why there is nothing to report ([`row`]);
//! * **journal**: rows as they come, so that a study that was stopped goes on where it was ([`journal`]);
//! * **expression**: an objective or a constraint over the numbers of a row ([`expression`]), which an optimiser makes as good
//!   as can be ([`search`], [`optimise`]);
//! * **shard**: one of n parts of a study, for machines that do not know of each other ([`shard`]).
//!
//! Points with the same electrodes share one solution of the field, and one table where their grains start in the same box
//! ([`work`]): voltages and grains are weights on it. Solutions are worked out one after the other, each with all threads; the
//! points on one of them in parallel.

pub mod best;
pub mod expression;
pub mod figures;
pub mod files;
pub mod front;
pub mod grid;
pub mod history;
pub mod journal;
pub mod names;
pub mod numbers;
pub mod optimise;
pub mod points;
pub mod row;
pub mod sampling;
pub mod search;
pub mod shard;
pub mod trap;
pub mod work;
