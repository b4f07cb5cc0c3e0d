//! Where text goes: results to standard output, everything else to standard error.

use std::io::{ErrorKind, IsTerminal, Write};

use miette::{GraphicalReportHandler, GraphicalTheme};
use serde::Serialize;

use crate::args::Talk;
use crate::failure::Failure;
use crate::json::ErrorJson;

/// The two streams, and how much to say on them.
///
/// A closed pipe means that nobody listens any more, so it is ignored: the files have been written and the
/// exit status still tells. Any other write of a result that fails is a failure.
pub struct Console<'a> {
    out: &'a mut dyn Write,
    err: &'a mut dyn Write,
    talk: Talk,
    /// Standard output has refused a text.
    deaf: bool,
    /// Nobody reads standard output any more.
    closed: bool,
}

impl<'a> Console<'a> {
    /// A console on two streams.
    pub fn new(out: &'a mut dyn Write, err: &'a mut dyn Write, talk: Talk) -> Self {
        Console { out, err, talk, deaf: false, closed: false }
    }

    /// How much to say.
    pub fn talk(&self) -> Talk {
        self.talk
    }

    /// Shows a result: the object in JSON mode, else the text.
    ///
    /// # Errors
    /// Standard output takes no more.
    pub fn show<T: Serialize>(&mut self, object: &T, text: &str) -> Result<(), Failure> {
        if self.talk.json {
            let object = serde_json::to_string_pretty(object)
                .map_err(|e| Failure::internal(format!("the result cannot be put in JSON: {e}")))?;
            self.say(&format!("{object}\n"))
        } else if self.talk.quiet {
            Ok(())
        } else {
            self.say(text)
        }
    }

    /// Writes to standard output, down to the file behind it.
    ///
    /// # Errors
    /// Standard output takes no more.
    pub fn say(&mut self, text: &str) -> Result<(), Failure> {
        match self.out.write_all(text.as_bytes()).and_then(|()| self.out.flush()) {
            Err(error) if error.kind() != ErrorKind::BrokenPipe => {
                self.deaf = true;
                Err(Failure::internal(format!("cannot write to standard output: {error}")).with_help(
                    "Make room where standard output goes, or send it elsewhere; result files are in place.",
                ))
            }
            Err(_) => {
                self.closed = true;
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }

    /// Nobody reads standard output any more: what goes on without end may end.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// Shows a failure: a diagnostic on standard error, and in JSON mode the error object on standard output.
    pub fn fail(&mut self, failure: &Failure) {
        self.fail_in_json(failure);
        let theme = if std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none() {
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
        self.tell(&text);
    }

    /// Shows a command line that cannot be understood: `text` on standard error, and in JSON mode the error
    /// object on standard output.
    pub fn fail_usage(&mut self, failure: &Failure, text: &str) {
        self.fail_in_json(failure);
        self.tell(text);
    }

    /// In JSON mode, the error object; once standard output has refused a text, nothing.
    fn fail_in_json(&mut self, failure: &Failure) {
        if self.talk.json
            && !self.deaf
            && let Ok(object) = serde_json::to_string_pretty(&ErrorJson::from(failure))
            && let Err(failed) = self.say(&format!("{object}\n"))
        {
            self.tell(&format!("{failed}\n"));
        }
    }

    /// Says what the exit status is about on standard error.
    pub fn warn(&mut self, text: &str) {
        self.tell(text);
    }

    /// Writes to standard error; when that fails there is nobody left to tell.
    fn tell(&mut self, text: &str) {
        let _ = self.err.write_all(text.as_bytes()).and_then(|()| self.err.flush());
    }
}
