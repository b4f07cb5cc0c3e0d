//! `feedspline verify`: prove a feed table from the file and the limits it carries.

use super::Verdict;
use crate::args::VerifyArgs;
use crate::console::Console;
use crate::engine::Engine;
use crate::failure::Failure;
use crate::progress::Progress;
use crate::summary;

/// Runs the verb.
///
/// # Errors
/// The file cannot be read or is no feed table.
pub fn execute(
    args: &VerifyArgs,
    engine: &dyn Engine,
    console: &mut Console<'_>,
) -> Result<Verdict, Failure> {
    let mut progress = Progress::new(console.talk());
    let result = engine.verify(&args.file, &mut progress)?;
    drop(progress);
    console.show(&result, &summary::verify(&result))?;
    Ok(Verdict::of(result.certificate.holds))
}
