//! What went wrong, where, and what to do about it.

use std::fmt;
use std::path::{Path, PathBuf};

use miette::{
    Diagnostic, LabeledSpan, MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents,
};

use crate::{EXIT_BAD_INPUT, EXIT_FAILED};

/// Longest piece of an input line that a diagnostic quotes [bytes].
const QUOTE: usize = 160;

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
    pub place: Option<Box<Place>>,
}

/// A place in an input file.
#[derive(Clone, Debug)]
pub struct Place {
    /// Line, from 1.
    pub line: u32,
    /// Column in bytes, from 1.
    pub column: u32,
    excerpt: Excerpt,
}

impl Place {
    /// The place `line:column`, `width` bytes wide, and the text of that line.
    ///
    /// Long lines are cut around the column, and bytes that are no text are replaced, so that any input at
    /// all can be quoted.
    pub fn new(line: u32, column: u32, width: usize, text: &[u8]) -> Self {
        let at = (column.max(1) as usize - 1).min(text.len());
        let from = at.saturating_sub(QUOTE / 2);
        let until = (from + QUOTE).min(text.len());
        let show = |bytes: &[u8]| -> String {
            String::from_utf8_lossy(bytes)
                .chars()
                .map(|c| if c.is_control() { '\u{fffd}' } else { c })
                .collect()
        };
        let (before, after) = (show(&text[from..at]), show(&text[at..until]));
        let marked = show(&text[at..(at + width).min(until)]).len();
        let text = format!("{before}{after}\n");
        let excerpt = Excerpt { name: String::new(), line, text, offset: before.len(), width: marked.max(1) };
        Place { line, column, excerpt }
    }
}

impl Failure {
    /// Bad input that has no place in a file.
    pub fn input(message: impl Into<String>) -> Self {
        Failure { blame: Blame::Input, message: message.into(), help: None, file: None, place: None }
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
        if let Some(place) = &mut self.place {
            place.excerpt.name = path.display().to_string();
        }
        self.file = Some(path.to_path_buf());
        self
    }

    /// Adds the file and the place in it.
    pub fn at(mut self, path: &Path, place: Place) -> Self {
        self.place = Some(Box::new(place));
        self.in_file(path)
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
        self.place.as_ref().map(|place| &place.excerpt as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let excerpt = &self.place.as_ref()?.excerpt;
        let span = LabeledSpan::new(Some("here".into()), excerpt.offset, excerpt.width);
        Some(Box::new(std::iter::once(span)))
    }
}

/// One line of a file that is not kept in memory.
#[derive(Clone, Debug)]
struct Excerpt {
    name: String,
    line: u32,
    text: String,
    offset: usize,
    width: usize,
}

impl SourceCode for Excerpt {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        before: usize,
        after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let inner = self.text.read_span(span, before, after)?;
        let line = self.line.max(1) as usize - 1 + inner.line();
        let contents = MietteSpanContents::new_named(
            self.name.clone(),
            inner.data(),
            *inner.span(),
            line,
            inner.column(),
            inner.line_count(),
        );
        Ok(Box::new(contents))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use miette::{GraphicalReportHandler, GraphicalTheme};

    fn render(failure: &Failure) -> String {
        let mut text = String::new();
        GraphicalReportHandler::new_themed(GraphicalTheme::none()).render_report(&mut text, failure).unwrap();
        text
    }

    #[test]
    fn diagnostic_names_file_line_column_and_help() {
        let failure = Failure::input("feed is zero")
            .at(Path::new("part.ngc"), Place::new(207, 9, 2, b"G1 X10. F0"))
            .with_help("Program a feed above zero.");
        let text = render(&failure);
        assert!(text.contains("part.ngc:207:9: feed is zero"), "{text}");
        assert!(text.contains("part.ngc:207:9]"), "{text}");
        assert!(text.contains("G1 X10. F0"), "{text}");
        assert!(text.contains("Program a feed above zero."), "{text}");
    }

    #[test]
    fn any_bytes_and_any_column_can_be_quoted() {
        let long = vec![0u8; 5000];
        for (column, text) in [(1, &b""[..]), (0, b"X"), (4000, &long), (u32::MAX, b"\xff\xfe\x1b[31m")] {
            let failure =
                Failure::input("no").at(Path::new("x"), Place::new(3, column, usize::MAX / 4, text));
            let shown = render(&failure);
            assert!(!shown.contains('\u{1b}') && shown.len() < 3000, "{shown}");
        }
    }

    #[test]
    fn exit_status_follows_the_blame() {
        assert_eq!(Failure::input("x").exit_status(), 2);
        assert_eq!(Failure::internal("x").exit_status(), 1);
    }
}
