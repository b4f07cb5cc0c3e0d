//! The numbers behind a report: what moves when, what limits it, and what it is compared with.
