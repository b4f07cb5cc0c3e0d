//! Remarks for the report: each said once, repetitions counted.

use std::collections::BTreeMap;

use super::code::Code;

/// Remarks that are made at most once per program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Once {
    Units,
    BestSpeed,
    ZeroTolerance,
    Collinearity,
    Overrides,
    Tapping,
    BlockDelete,
}

/// Longest comment that is shown [characters].
const TEXT_LIMIT: usize = 120;

/// Most comments shown as operation names.
const OPERATION_LIMIT: u32 = 1000;

/// What has been said and what is to be said.
#[derive(Clone, Debug, Default)]
pub(super) struct Notes {
    said: u32,
    /// Printer codes with their first line and how often they occurred; bounded by the number of known codes.
    skipped: BTreeMap<Code, (u32, u64)>,
    /// First line and number of blocks with extruder words.
    extruder: Option<(u32, u64)>,
    /// Blocks skipped by block delete: first line, number.
    deleted: Option<(u32, u64)>,
    /// A comment alone in its block, with its line: the name of what follows.
    operation: Option<(String, u32)>,
    operations: u32,
}

impl Notes {
    /// Whether this is the first time.
    pub(super) fn first(&mut self, once: Once) -> bool {
        let bit = 1 << once as u32;
        let first = self.said & bit == 0;
        self.said |= bit;
        first
    }

    pub(super) fn skip_code(&mut self, code: Code, line: u32) {
        self.skipped.entry(code).or_insert((line, 0)).1 += 1;
    }

    pub(super) fn skip_extruder(&mut self, line: u32) {
        self.extruder.get_or_insert((line, 0)).1 += 1;
    }

    pub(super) fn skip_block(&mut self, line: u32) {
        self.deleted.get_or_insert((line, 0)).1 += 1;
    }

    /// Keeps a comment as the name of the next operation.
    pub(super) fn name_operation(&mut self, text: String, line: u32) {
        if self.operations < OPERATION_LIMIT && !text.is_empty() {
            self.operation = Some((text, line));
        }
    }

    /// The name of the operation that starts here, once.
    pub(super) fn take_operation(&mut self) -> Option<(String, u32)> {
        let named = self.operation.take();
        self.operations += u32::from(named.is_some());
        named
    }

    /// What has been skipped in the whole program.
    pub(super) fn summary(&mut self) -> Vec<(String, u32)> {
        let codes = std::mem::take(&mut self.skipped);
        let mut lines: Vec<_> = codes
            .into_iter()
            .map(|(code, (line, count))| (format!("{code} skipped, {}", times(count)), line))
            .collect();
        let extruder = self.extruder.take().map(|(line, n)| (format!("E words skipped, {}", times(n)), line));
        let deleted =
            self.deleted.take().map(|(line, n)| (format!("blocks marked / skipped, {}", times(n)), line));
        lines.extend(extruder);
        lines.extend(deleted);
        lines
    }
}

fn times(count: u64) -> String {
    if count == 1 { "once".into() } else { format!("{count} times") }
}

/// A comment as it is shown.
pub(super) fn comment_text(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    text.trim().chars().filter(|c| !c.is_control()).take(TEXT_LIMIT).collect()
}

/// The text of a message comment, `(MSG, text)`.
pub(super) fn message(bytes: &[u8]) -> Option<&[u8]> {
    let bytes = bytes.trim_ascii();
    let (word, rest) = (bytes.get(..3)?, bytes.get(3..)?.trim_ascii_start());
    if word.eq_ignore_ascii_case(b"MSG") { rest.strip_prefix(b",") } else { None }
}
