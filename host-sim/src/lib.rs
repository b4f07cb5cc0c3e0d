//! Simulated drives, servos, plants and bus around the shipped firmware core.
