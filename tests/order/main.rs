//! Slopes of log error over log h or log dt.
