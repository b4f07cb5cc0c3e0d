//! One block of a part program: its words, with their columns.

use std::ops::Range;

use super::Dialect;
use super::code::{Code, GROUPS, Group, PrinterCode, group_of, printer_code};
use super::fault::{ErrorKind, Fault};

/// Largest magnitude of a number: products of a few of them stay far inside the range of f64.
const NUMBER_LIMIT: f64 = 1e12;

/// A G or M code with its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CodeWord {
    pub(super) code: Code,
    pub(super) column: u32,
    pub(super) length: u32,
}

impl CodeWord {
    /// A fault at this word.
    pub(super) fn fault(&self, kind: ErrorKind) -> Fault {
        kind.at(self.column, self.length)
    }
}

/// The words of one block. Reused from block to block.
#[derive(Clone, Debug)]
pub(super) struct Block {
    values: [f64; 26],
    columns: [u32; 26],
    lengths: [u32; 26],
    /// Letters that occur with a number.
    present: u32,
    /// Letters that occur without a number (printer dialect only).
    bare: u32,
    /// Letters that a code has used.
    used: u32,
    codes: [Option<CodeWord>; GROUPS],
    /// A printer's code; the block is skipped.
    pub(super) printer: Option<CodeWord>,
    /// The block starts with `/`.
    pub(super) deleted: bool,
    /// The last comment, without its brackets.
    pub(super) comment: Option<Range<usize>>,
    /// O and a number alone in the block: the program's number.
    pub(super) program_number: Option<f64>,
    /// Something besides comments and spaces occurs.
    pub(super) has_words: bool,
    scratch: Vec<u8>,
}

fn index(letter: u8) -> usize {
    usize::from(letter.to_ascii_uppercase().wrapping_sub(b'A')).min(25)
}

fn bit(letter: u8) -> u32 {
    1 << index(letter)
}

fn blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r')
}

impl Block {
    pub(super) fn new() -> Self {
        Self {
            values: [0.0; 26],
            columns: [0; 26],
            lengths: [0; 26],
            present: 0,
            bare: 0,
            used: 0,
            codes: [None; GROUPS],
            printer: None,
            deleted: false,
            comment: None,
            program_number: None,
            has_words: false,
            scratch: Vec::new(),
        }
    }

    /// The code of a group, if the block has one.
    pub(super) fn code(&self, group: Group) -> Option<CodeWord> {
        self.codes[group as usize]
    }

    /// Whether any G or M code occurs.
    pub(super) fn has_codes(&self) -> bool {
        self.codes.iter().any(Option::is_some)
    }

    /// The number of a word, used or not.
    pub(super) fn peek(&self, letter: u8) -> Option<f64> {
        (self.present & bit(letter) != 0).then(|| self.values[index(letter)])
    }

    /// The number of a word for the code that uses it; each word is used once.
    pub(super) fn take(&mut self, letter: u8) -> Option<f64> {
        let open = self.present & !self.used & bit(letter);
        self.used |= open;
        (open != 0).then(|| self.values[index(letter)])
    }

    /// Letters without a number, which count as used.
    pub(super) fn take_bare(&mut self, letter: u8) -> bool {
        let found = self.bare & bit(letter) != 0;
        self.bare &= !bit(letter);
        found
    }

    /// Drops a word; whether it occurred.
    pub(super) fn drop_word(&mut self, letter: u8) -> bool {
        let found = (self.present | self.bare) & bit(letter) != 0;
        self.present &= !bit(letter);
        self.bare &= !bit(letter);
        found
    }

    /// A fault at the word of `letter`.
    pub(super) fn fault(&self, letter: u8, kind: ErrorKind) -> Fault {
        kind.at(self.columns[index(letter)], self.lengths[index(letter)])
    }

    /// The first of `letters` that occurs and is not used.
    pub(super) fn first_unused(&self, letters: &[u8]) -> Option<u8> {
        let open = self.present & !self.used;
        letters
            .iter()
            .copied()
            .filter(|&l| open & bit(l) != 0)
            .min_by_key(|&letter| self.columns[index(letter)])
    }

    /// Every word must have been used.
    pub(super) fn check_all_used(&self) -> Result<(), Fault> {
        let letters: [u8; 26] = std::array::from_fn(|i| b'A' + i as u8);
        if let Some(&letter) = letters.iter().find(|&&l| self.bare & bit(l) != 0) {
            return Err(self.fault(letter, ErrorKind::MissingNumber { letter: char::from(letter) }));
        }
        if self.present & !self.used == 0 {
            return Ok(());
        }
        match self.first_unused(&letters) {
            Some(l) => Err(self.fault(l, ErrorKind::UnusedWord { letter: char::from(l) })),
            None => Ok(()),
        }
    }

    /// Reads one line. `first` says whether a program number may stand here.
    pub(super) fn read(&mut self, line: &[u8], dialect: Dialect, first: bool) -> Result<(), Fault> {
        self.present = 0;
        self.bare = 0;
        self.used = 0;
        self.codes = [None; GROUPS];
        self.printer = None;
        self.comment = None;
        self.program_number = None;
        self.has_words = false;
        let mut at = line.iter().position(|&b| !blank(b)).unwrap_or(line.len());
        self.deleted = line.get(at) == Some(&b'/');
        if self.deleted {
            at += 1;
            // The number of a block delete switch.
            at += usize::from(line.get(at).is_some_and(|b| (b'1'..=b'9').contains(b)));
        }
        while let Some(&byte) = line.get(at) {
            match byte {
                _ if blank(byte) => at += 1,
                b'a'..=b'z' | b'A'..=b'Z' => at = self.word(line, at, dialect, first)?,
                b'(' => at = self.bracket_comment(line, at)?,
                b';' => {
                    self.comment = Some(at + 1..line.len());
                    at = line.len();
                }
                b'*' => at = checksum(line, at)?,
                b'#' => return Err(ErrorKind::Parameter.at(at as u32, 1)),
                b'[' => return Err(ErrorKind::Expression.at(at as u32, 1)),
                _ => return Err(unexpected(byte).at(at as u32, 1)),
            }
        }
        Ok(())
    }

    /// Reads the comment that opens at `at`; its end.
    fn bracket_comment(&mut self, line: &[u8], at: usize) -> Result<usize, Fault> {
        let inside = &line[at + 1..];
        match inside.iter().position(|&b| matches!(b, b'(' | b')')) {
            Some(end) if inside[end] == b')' => {
                self.comment = Some(at + 1..at + 1 + end);
                Ok(at + end + 2)
            }
            Some(nested) => Err(ErrorKind::NestedComment.at((at + 1 + nested) as u32, 1)),
            None => Err(ErrorKind::UnclosedComment.at(at as u32, (line.len() - at) as u32)),
        }
    }

    /// Reads the word that starts at `at`; its end.
    fn word(&mut self, line: &[u8], at: usize, dialect: Dialect, first: bool) -> Result<usize, Fault> {
        let letter = line[at].to_ascii_uppercase();
        let shown = char::from(letter);
        let place = |end: usize| (at as u32, (end - at).max(1) as u32);
        let program_number_fits = first && !self.has_words;
        self.has_words = true;
        if letter == b'O' && !program_number_fits {
            return Err(ErrorKind::OWord.at(at as u32, 1));
        }
        let (value, end) = match self.number(line, at + 1) {
            Ok(found) => found,
            Err(NumberFault::Malformed(end)) => {
                return Err(ErrorKind::MalformedNumber { letter: shown }.at(place(end).0, place(end).1));
            }
            Err(NumberFault::TooLarge(end)) => {
                return Err(ErrorKind::NumberTooLarge { letter: shown }.at(place(end).0, place(end).1));
            }
            Err(NumberFault::Parameter(end)) => return Err(ErrorKind::Parameter.at(end as u32, 1)),
            Err(NumberFault::Expression(end)) => return Err(ErrorKind::Expression.at(end as u32, 1)),
            Err(NumberFault::Missing) if letter == b'O' => return Err(ErrorKind::OWord.at(at as u32, 1)),
            Err(NumberFault::Missing) => {
                let twice = (self.present | self.bare) & bit(letter) != 0;
                if dialect == Dialect::Printer && !matches!(letter, b'G' | b'M') && !twice {
                    self.bare |= bit(letter);
                    (self.columns[index(letter)], self.lengths[index(letter)]) = (at as u32, 1);
                    return Ok(at + 1);
                }
                return Err(ErrorKind::MissingNumber { letter: shown }.at(at as u32, 1));
            }
        };
        let (column, length) = place(end);
        match letter {
            b'G' | b'M' => {
                let Some(code) = Code::from_word(letter, value) else {
                    return Err(ErrorKind::UnknownCode { letter: shown, number: value }.at(column, length));
                };
                return self.add_code(line, CodeWord { code, column, length }, end, dialect);
            }
            b'O' => {
                let alone = line[end..].iter().copied().find(|&b| !blank(b));
                if value < 0.0 || value.fract() != 0.0 || !matches!(alone, None | Some(b'(' | b';')) {
                    return Err(ErrorKind::OWord.at(column, length));
                }
                self.program_number = Some(value);
                return Ok(end);
            }
            b'N' if value < 0.0 => {
                return Err(ErrorKind::Negative { letter: shown, value }.at(column, length));
            }
            b'E' if dialect == Dialect::Rs274 => {
                return Err(ErrorKind::UnknownWord { letter: shown }.at(column, length));
            }
            _ => {}
        }
        if (self.present | self.bare) & bit(letter) != 0 {
            return Err(ErrorKind::RepeatedWord { letter: shown }.at(column, length));
        }
        self.present |= bit(letter);
        self.values[index(letter)] = value;
        self.columns[index(letter)] = column;
        self.lengths[index(letter)] = length;
        Ok(end)
    }

    /// Files a code under its group; the end of what has been read.
    fn add_code(
        &mut self,
        line: &[u8],
        word: CodeWord,
        end: usize,
        dialect: Dialect,
    ) -> Result<usize, Fault> {
        let Some(group) = group_of(word.code) else {
            return match (printer_code(word.code), dialect) {
                (Some(_), _) if self.printer.is_some() || self.has_codes() => {
                    Err(word.fault(ErrorKind::PrinterCodeShares { code: word.code }))
                }
                (Some(kind), Dialect::Printer) => {
                    self.printer = Some(word);
                    Ok(if kind == PrinterCode::SkipText { line.len() } else { end })
                }
                (Some(_), Dialect::Rs274) => Err(word.fault(ErrorKind::PrinterCode { code: word.code })),
                (None, _) => Err(word.fault(ErrorKind::UnsupportedCode { code: word.code })),
            };
        };
        if let Some(printer) = self.printer {
            return Err(printer.fault(ErrorKind::PrinterCodeShares { code: printer.code }));
        }
        match &mut self.codes[group as usize] {
            Some(first) => Err(word.fault(ErrorKind::ModalConflict { first: first.code, second: word.code })),
            free => {
                *free = Some(word);
                Ok(end)
            }
        }
    }

    /// Reads a number, spaces inside it allowed (RS-274/NGC 3.3.2.1); its end.
    fn number(&mut self, line: &[u8], from: usize) -> Result<(f64, usize), NumberFault> {
        let mut at = from;
        while line.get(at).copied().is_some_and(blank) {
            at += 1;
        }
        let start = at;
        let (mut end, mut gaps) = (start, false);
        while let Some(&byte) = line.get(at) {
            match byte {
                b'0'..=b'9' | b'.' | b'+' | b'-' => {
                    gaps |= end != at;
                    at += 1;
                    end = at;
                }
                _ if blank(byte) => at += 1,
                _ => break,
            }
        }
        if end == start {
            return Err(match line.get(at) {
                Some(b'#') => NumberFault::Parameter(at),
                Some(b'[') => NumberFault::Expression(at),
                _ => NumberFault::Missing,
            });
        }
        let digits = if gaps {
            self.scratch.clear();
            self.scratch.extend(line[start..end].iter().copied().filter(|&b| !blank(b)));
            &self.scratch
        } else {
            &line[start..end]
        };
        // Signs and points in wrong places are refused by the conversion.
        let value = std::str::from_utf8(digits).ok().and_then(|text| text.parse::<f64>().ok());
        match value {
            Some(value) if value.abs() <= NUMBER_LIMIT => Ok((value, end)),
            Some(_) => Err(NumberFault::TooLarge(end)),
            None => Err(NumberFault::Malformed(end)),
        }
    }
}

enum NumberFault {
    Missing,
    Malformed(usize),
    TooLarge(usize),
    Parameter(usize),
    Expression(usize),
}

fn unexpected(byte: u8) -> ErrorKind {
    match byte {
        b'!'..=b'~' => ErrorKind::UnexpectedCharacter { character: char::from(byte) },
        _ => ErrorKind::Binary { byte },
    }
}

/// Checks `*` and a number against the exclusive or of the bytes before it; only a comment may follow.
fn checksum(line: &[u8], at: usize) -> Result<usize, Fault> {
    let digits = line[at + 1..].iter().take_while(|b| b.is_ascii_digit()).count();
    let end = at + 1 + digits;
    let found = std::str::from_utf8(&line[at + 1..end]).ok().and_then(|text| text.parse::<u8>().ok());
    let tail_ok = matches!(line[end..].iter().copied().find(|&b| !blank(b)), None | Some(b'(' | b';'));
    let place = (at as u32, (end - at) as u32);
    let Some(found) = found.filter(|_| tail_ok) else {
        return Err(ErrorKind::MalformedChecksum.at(place.0, place.1));
    };
    let computed = line[..at].iter().fold(0, |sum, &b| sum ^ b);
    if found == computed {
        Ok(end)
    } else {
        Err(ErrorKind::Checksum { found, computed }.at(place.0, place.1))
    }
}

#[cfg(test)]
mod tests;
