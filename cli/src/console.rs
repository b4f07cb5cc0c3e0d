//! Where text goes: results to standard output, everything else to standard error.

use std::io::Write;

use miette::{GraphicalReportHandler, GraphicalTheme};
use serde::Serialize;

use crate::args::Talk;
use crate::failure::Failure;
use crate::json::ErrorJson;

/// The two streams, and how much to say on them.
///
/// A write that fails means that nobody listens any more (a closed pipe), so it is ignored: the files have
/// been written and the exit status still tells.
pub struct Console<'a> {
    out: &'a mut dyn Write,
    err: &'a mut dyn Write,
    talk: Talk,
}

impl<'a> Console<'a> {
    /// A console on two streams.
    pub fn new(out: &'a mut dyn Write, err: &'a mut dyn Write, talk: Talk) -> Self {
        Console { out, err, talk }
    }

    /// How much to say.
    pub fn talk(&self) -> Talk {
        self.talk
    }

    /// Shows a result: the object in JSON mode, else the text.
    pub fn show<T: Serialize>(&mut self, object: &T, text: &str) {
        if self.talk.json {
            if let Ok(line) = serde_json::to_string_pretty(object) {
                let _ = writeln!(self.out, "{line}");
            }
        } else if !self.talk.quiet {
            let _ = write!(self.out, "{text}");
        }
    }

    /// Shows a failure: a diagnostic on standard error, and in JSON mode the error object on standard output.
    pub fn fail(&mut self, failure: &Failure) {
        if self.talk.json
            && let Ok(line) = serde_json::to_string_pretty(&ErrorJson::from(failure))
        {
            let _ = writeln!(self.out, "{line}");
        }
        let theme = if std::io::IsTerminal::is_terminal(&std::io::stderr()) {
            GraphicalTheme::unicode()
        } else {
            GraphicalTheme::unicode_nocolor()
        };
        let mut text = String::new();
        if GraphicalReportHandler::new_themed(theme)
            .with_width(100)
            .render_report(&mut text, failure)
            .is_err()
        {
            text = format!("error: {failure}\n");
        }
        let _ = write!(self.err, "{text}");
    }
}
