//! A simulated partner that speaks 3964R, 3964 or simplified 3964R, with faults on demand.
