//! `feedspline inspect`: show what a feed table says of itself.

use super::Verdict;
use crate::args::InspectArgs;
use crate::console::Console;
use crate::engine::Engine;
use crate::failure::Failure;
use crate::summary;

/// Runs the verb.
///
/// # Errors
/// The file cannot be read or is no feed table.
pub fn execute(
    args: &InspectArgs,
    engine: &dyn Engine,
    console: &mut Console<'_>,
) -> Result<Verdict, Failure> {
    let result = engine.inspect(&args.file)?;
    console.show(&result, &summary::inspect(&result))?;
    Ok(Verdict::Holds)
}
