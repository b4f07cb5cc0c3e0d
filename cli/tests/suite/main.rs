//! The command through its public door: verbs, files, report.

#[cfg(test)]
mod compare;
#[cfg(test)]
mod local;
#[cfg(test)]
mod moves;
#[cfg(test)]
mod points;
#[cfg(test)]
mod report;
#[cfg(test)]
mod sample;
#[cfg(test)]
mod verbs;
