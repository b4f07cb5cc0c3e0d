//! What went wrong, where, and what to do about it.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{Diagnostic, LabeledSpan, SourceCode};

use crate::{EXIT_BAD_INPUT, EXIT_FAILED};

/// Whose fault it is; chooses the exit status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blame {
    /// The input or the command line: exit status 2.
    Input,
    /// The surroundings or this program: exit status 1.
    Internal,
}

/// A failure of a verb.
#[derive(Clone, Debug)]
pub struct Failure {
    /// Whose fault it is.
    pub blame: Blame,
    /// What is wrong, with the value and the limit.
    pub message: String,
    /// What to do about it.
    pub help: Option<String>,
    /// The file it was found in.
    pub file: Option<PathBuf>,
    /// The place in that file.
    pub place: Option<Place>,
    /// The error behind it, which can quote the file.
    quote: Option<Arc<dyn Diagnostic + Send + Sync>>,
}

/// A place in an input file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Line, from 1.
    pub line: u32,
    /// Column in bytes, from 1.
    pub column: u32,
}

impl Failure {
    /// Bad input that has no place in a file.
    pub fn input(message: impl Into<String>) -> Self {
        Failure {
            blame: Blame::Input,
            message: message.into(),
            help: None,
            file: None,
            place: None,
            quote: None,
        }
    }

    /// A failure that is not the input's fault.
    pub fn internal(message: impl Into<String>) -> Self {
        Failure { blame: Blame::Internal, ..Failure::input(message) }
    }

    /// A file that cannot be read: the user's to mend.
    pub fn unreadable(path: &Path, error: &std::io::Error) -> Self {
        Failure::input(format!("cannot read the file: {error}"))
            .in_file(path)
            .with_help("Check the name and the permissions; the input has to be a file, not a folder.")
    }

    /// A file that cannot be written.
    pub fn unwritable(path: &Path, error: &std::io::Error) -> Self {
        Failure::input(format!("cannot write here: {error}"))
            .in_file(path)
            .with_help("Choose another folder with --out.")
    }

    /// Adds what to do about it.
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Adds the file.
    pub fn in_file(mut self, path: &Path) -> Self {
        self.file = Some(path.to_path_buf());
        self
    }

    /// Adds the file and the place in it.
    pub fn at(mut self, path: &Path, line: u32, column: u32) -> Self {
        self.place = Some(Place { line, column });
        self.in_file(path)
    }

    /// Takes over the quoted source, the labels, and the help if there is none yet, of the error behind it.
    pub fn quoting(mut self, error: impl Diagnostic + Send + Sync + 'static) -> Self {
        self.help = self.help.or_else(|| error.help().map(|help| help.to_string()));
        self.quote = Some(Arc::new(error));
        self
    }

    /// The exit status that tells of it.
    pub fn exit_status(&self) -> u8 {
        match self.blame {
            Blame::Input => EXIT_BAD_INPUT,
            Blame::Internal => EXIT_FAILED,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}:", file.display())?;
            if let Some(place) = &self.place {
                write!(f, "{}:{}:", place.line, place.column)?;
            }
            f.write_str(" ")?;
        }
        f.write_str(&self.message)
    }
}

impl std::error::Error for Failure {}

impl Diagnostic for Failure {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.quote.as_ref()?.source_code()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.quote.as_ref()?.labels()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use miette::{GraphicalReportHandler, GraphicalTheme, NamedSource};

    fn render(failure: &Failure) -> String {
        let mut text = String::new();
        GraphicalReportHandler::new_themed(GraphicalTheme::none()).render_report(&mut text, failure).unwrap();
        text
    }

    /// An error of the planner's kind.
    #[derive(Debug, thiserror::Error, Diagnostic)]
    #[error("part.ngc:1:9: feed is zero")]
    #[diagnostic(help("Program a feed above zero."))]
    struct ZeroFeed {
        #[source_code]
        text: NamedSource<String>,
        #[label("here")]
        at: (usize, usize),
    }

    #[test]
    fn diagnostic_names_file_line_column_and_help_and_quotes_the_source() {
        let text = NamedSource::new("part.ngc", "G1 X10. F0\n".to_string());
        let failure = Failure::input("feed is zero")
            .at(Path::new("part.ngc"), 1, 9)
            .quoting(ZeroFeed { text, at: (8, 2) });
        let text = render(&failure);
        for part in ["part.ngc:1:9: feed is zero", "G1 X10. F0", "here", "Program a feed above zero."] {
            assert!(text.contains(part), "{part} in {text}");
        }
        assert_eq!(text.matches("feed is zero").count(), 1, "{text}");
    }

    #[test]
    fn own_help_goes_first() {
        let text = NamedSource::new("part.ngc", "G1\n".to_string());
        let failure = Failure::input("no").with_help("do this").quoting(ZeroFeed { text, at: (0, 1) });
        assert_eq!(failure.help.as_deref(), Some("do this"));
    }

    #[test]
    fn exit_status_follows_the_blame() {
        assert_eq!(Failure::input("x").exit_status(), 2);
        assert_eq!(Failure::internal("x").exit_status(), 1);
    }
}
