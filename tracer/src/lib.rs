//! Grains in flight: ensembles, forces, integrators, how a flight ends, what is kept of it.
