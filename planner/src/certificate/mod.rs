//! Proves a rounded feed table against its limits at every instant, with Bernstein coefficients.
