//! Quadric error metrics: accumulation, evaluation, minimiser.
