//! What can be wrong with a part program, and where.

use std::fmt;

use miette::{
    Diagnostic, LabeledSpan, MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents,
};

use super::fault::{ErrorKind, Fault};

/// Bytes of the line shown on each side of the place of an error.
const SNIPPET_REACH: usize = 100;

/// A part program is refused.
///
/// Shown as `file:line:column: what`; as a [`Diagnostic`] it carries the line it is about, a label and help.
#[derive(Debug, Clone)]
pub struct ProgramError(Box<Details>);

#[derive(Debug, Clone)]
struct Details {
    name: String,
    kind: ErrorKind,
    snippet: Option<Snippet>,
}

/// The part of one line around the place of an error.
#[derive(Debug, Clone)]
struct Snippet {
    name: String,
    text: String,
    /// Line of the file, from 1.
    line: u32,
    /// Byte of the line, from 1.
    column: u32,
    /// Bytes of the line before `text`.
    skipped: usize,
    /// The place in `text`.
    offset: usize,
    length: usize,
}

impl ProgramError {
    /// An error about the file as a whole.
    pub(super) fn of_file(name: &str, kind: ErrorKind) -> Self {
        Self(Box::new(Details { name: name.to_owned(), kind, snippet: None }))
    }

    /// An error at a place in line number `line`, whose bytes are `text`.
    pub(super) fn at(name: &str, line: u32, text: &[u8], fault: Fault) -> Self {
        let start = (fault.column as usize).min(text.len());
        let end = (start + fault.length as usize).min(text.len());
        let skipped = start.saturating_sub(SNIPPET_REACH);
        let shown_end = (end.max(start) + SNIPPET_REACH).min(text.len());
        // Control characters of a binary file stay away from the terminal.
        let plain = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
        let shown = |from: usize, to: usize| -> String {
            String::from_utf8_lossy(&text[from..to]).replace('\t', " ").chars().map(plain).collect()
        };
        let (before, marked, after) = (shown(skipped, start), shown(start, end), shown(end, shown_end));
        let snippet = Snippet {
            name: name.to_owned(),
            offset: before.len(),
            length: marked.len(),
            text: before + &marked + after.trim_end(),
            line,
            column: fault.column.saturating_add(1),
            skipped,
        };
        Self(Box::new(Details { name: name.to_owned(), kind: fault.kind, snippet: Some(snippet) }))
    }

    /// What is wrong.
    pub fn kind(&self) -> &ErrorKind {
        &self.0.kind
    }

    /// Line of the file, from 1; `None` if the error is about the file as a whole.
    pub fn line(&self) -> Option<u32> {
        self.0.snippet.as_ref().map(|s| s.line)
    }

    /// Column in the line, in bytes from 1.
    pub fn column(&self) -> Option<u32> {
        self.0.snippet.as_ref().map(|s| s.column)
    }
}

impl fmt::Display for ProgramError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Details { name, kind, snippet } = &*self.0;
        match snippet {
            Some(Snippet { line, column, .. }) => write!(f, "{name}:{line}:{column}: {kind}"),
            None => write!(f, "{name}: {kind}"),
        }
    }
}

impl std::error::Error for ProgramError {}

impl Diagnostic for ProgramError {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(self.0.kind.help()))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.0.snippet.as_ref().map(|s| s as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let snippet = self.0.snippet.as_ref()?;
        let label = LabeledSpan::new(Some("here".into()), snippet.offset, snippet.length);
        Some(Box::new(std::iter::once(label)))
    }
}

impl SourceCode for Snippet {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        context_lines_before: usize,
        context_lines_after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let inner = self.text.read_span(span, context_lines_before, context_lines_after)?;
        Ok(Box::new(MietteSpanContents::new_named(
            self.name.clone(),
            inner.data(),
            *inner.span(),
            self.line.saturating_sub(1) as usize + inner.line(),
            self.skipped + inner.column(),
            inner.line_count(),
        )))
    }
}
