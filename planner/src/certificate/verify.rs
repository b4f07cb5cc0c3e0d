//! Proves a whole planned job against a machine, from the tables and the limits alone.
