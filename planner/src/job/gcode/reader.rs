//! Lines of a part program, bounded in length.

use std::io::{BufRead, Read};

use super::fault::{ErrorKind, Fault};

/// Longest line [bytes]; RS-274 allows 256, CAM comments are longer.
pub(super) const LINE_LIMIT_BYTES: usize = 64 * 1024;

const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Reads a file line by line, holding one line at a time.
#[derive(Debug)]
pub(super) struct LineReader<R> {
    inner: R,
    buffer: Vec<u8>,
    /// Bytes of the buffer before the line proper (a byte order mark).
    skipped: usize,
    line: u32,
}

impl<R: BufRead> LineReader<R> {
    pub(super) fn new(inner: R) -> Self {
        Self { inner, buffer: Vec::new(), skipped: 0, line: 0 }
    }

    /// Reads the next line; `false` at the end of the file.
    pub(super) fn advance(&mut self) -> Result<bool, Fault> {
        self.buffer.clear();
        self.skipped = 0;
        let limit = LINE_LIMIT_BYTES as u64 + 2;
        let read = (&mut self.inner).take(limit).read_until(b'\n', &mut self.buffer);
        match read {
            Err(e) => return Err(ErrorKind::Unreadable { reason: e.to_string() }.at(0, 0)),
            Ok(0) => return Ok(false),
            Ok(_) => self.line = self.line.saturating_add(1),
        }
        if self.line == 1 && self.buffer.starts_with(BYTE_ORDER_MARK) {
            self.skipped = BYTE_ORDER_MARK.len();
        }
        while self.buffer.len() > self.skipped && matches!(self.buffer.last(), Some(b'\n' | b'\r')) {
            self.buffer.pop();
        }
        if let Some(at) = self.text().iter().position(|&b| b == 0) {
            return Err(ErrorKind::Binary { byte: 0 }.at(at as u32, 1));
        }
        if self.text().len() > LINE_LIMIT_BYTES {
            return Err(
                ErrorKind::LineTooLong { limit_bytes: LINE_LIMIT_BYTES }.at(LINE_LIMIT_BYTES as u32, 1)
            );
        }
        Ok(true)
    }

    /// The line without its ending.
    pub(super) fn text(&self) -> &[u8] {
        &self.buffer[self.skipped..]
    }

    /// Number of the line, from 1; 0 before the first.
    pub(super) fn line(&self) -> u32 {
        self.line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut reader = LineReader::new(bytes);
        let mut found = Vec::new();
        while reader.advance().unwrap() {
            found.push(reader.text().to_vec());
        }
        found
    }

    #[test]
    fn every_ending_of_a_line_is_taken_off() {
        assert_eq!(lines(b"\xef\xbb\xbfG0\r\nG1\n\nG2"), [&b"G0"[..], b"G1", b"", b"G2"]);
    }

    #[test]
    fn zeros_without_end_are_refused_after_one_line() {
        let mut reader = LineReader::new(std::io::BufReader::new(std::io::repeat(0)));
        assert_eq!(reader.advance().unwrap_err().kind, ErrorKind::Binary { byte: 0 });
        assert!(reader.buffer.len() <= LINE_LIMIT_BYTES + 2);
    }

    #[test]
    fn a_line_may_be_as_long_as_the_limit_and_no_longer() {
        let text = vec![b' '; LINE_LIMIT_BYTES];
        assert_eq!(lines(&text).len(), 1);
        let mut long = LineReader::new(std::io::BufReader::new(std::io::repeat(b' ')));
        assert!(matches!(long.advance().unwrap_err().kind, ErrorKind::LineTooLong { .. }));
    }
}
