//! Lines of a log as `candump -L` writes them: `(1.000000) can0 123#0011`, and `123##10011` for CAN FD.

use protocol::bus::Frame;

use crate::bus::Nanoseconds;

/// A line of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line<'a> {
    /// When the frame came.
    pub time: Nanoseconds,
    /// Where.
    pub interface: &'a str,
    /// Its identifier as it is written.
    pub id: &'a str,
    /// The frame; none: with an extended identifier, of an error, or a remote request.
    pub frame: Option<Frame>,
}

/// Why a line is none of a log.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected {expected}, found {found:?}")]
pub struct LineError {
    /// Column in bytes, from 1.
    pub column: u32,
    /// What should be there.
    pub expected: &'static str,
    /// What is there.
    pub found: String,
}

const TIME: &str = "a time such as (1.000000)";
const INTERFACE: &str = "the name of an interface such as can0";
const FRAME: &str = "a frame such as 123#0011 or 123##10011";
const ID: &str = "an identifier of 3 hexadecimal digits up to 7FF, or of 8";
const DATA: &str = "data as pairs of hexadecimal digits, up to 8 bytes, or up to 64 of CAN FD";
const END: &str = "nothing but R or T behind the frame";

/// Words that `candump -L -x` puts behind a frame.
const DIRECTIONS: [&str; 2] = ["R", "T"];

/// Most of a wrong word that is told.
const TOLD: usize = 40;

/// Reads a line.
///
/// # Errors
/// Something else stands where a part of it should.
pub fn line(text: &str) -> Result<Line<'_>, LineError> {
    let mut words = text.split_ascii_whitespace();
    let mut next = |expected| {
        let word = words.next().ok_or_else(|| fault(text, "", expected))?;
        Ok(word)
    };
    let (time, interface, frame) = (next(TIME)?, next(INTERFACE)?, next(FRAME)?);
    let time = seconds(time).ok_or_else(|| fault(text, time, TIME))?;
    if interface.contains('#') {
        return Err(fault(text, interface, INTERFACE));
    }
    if let Some(word) = words.find(|word| !DIRECTIONS.contains(word)) {
        return Err(fault(text, word, END));
    }
    let (id, data) = frame.split_once('#').ok_or_else(|| fault(text, frame, FRAME))?;
    let frame = content(text, id, data)?;
    Ok(Line { time, interface, id, frame })
}

/// `word` of `text` is not what was expected; an empty one is missing at the end.
fn fault(text: &str, word: &str, expected: &'static str) -> LineError {
    let at = if word.is_empty() { text.len() } else { word.as_ptr() as usize - text.as_ptr() as usize };
    let column = u32::try_from(at + 1).unwrap_or(u32::MAX);
    LineError { column, expected, found: word.chars().take(TOLD).collect() }
}

fn seconds(word: &str) -> Option<Nanoseconds> {
    let (whole, part) = word.strip_prefix('(')?.strip_suffix(')')?.split_once('.')?;
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if !digits(whole) || !digits(part) || part.len() > 9 {
        return None;
    }
    let scale = 10u64.pow(9 - part.len() as u32);
    let part = part.parse::<u64>().ok()? * scale;
    whole.parse::<u64>().ok()?.checked_mul(1_000_000_000)?.checked_add(part)
}

fn content(text: &str, id: &str, data: &str) -> Result<Option<Frame>, LineError> {
    let hexadecimal = |digits: &str| digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    let wrong_id = || fault(text, if id.is_empty() { data } else { id }, ID);
    let number = u32::from_str_radix(id, 16).ok().filter(|_| hexadecimal(id)).ok_or_else(wrong_id)?;
    let short = match id.len() {
        3 if number <= 0x7ff => u16::try_from(number).ok(),
        8 => None,
        _ => return Err(wrong_id()),
    };
    let wrong_data = || fault(text, data, DATA);
    // A remote request, with or without a length.
    if let Some(length) = data.strip_prefix(['R', 'r']) {
        return if length.len() <= 1 && hexadecimal(length) { Ok(None) } else { Err(wrong_data()) };
    }
    let (digits, most) = match data.strip_prefix('#') {
        // One digit of flags goes before the data of CAN FD.
        Some(flagged) => match flagged.split_at_checked(1) {
            Some((flags, digits)) if hexadecimal(flags) => (digits, 64),
            _ => return Err(wrong_data()),
        },
        None => (data, 8),
    };
    if !hexadecimal(digits) || digits.len() % 2 != 0 || digits.len() > 2 * most {
        return Err(wrong_data());
    }
    let pair = |at: usize| digits.get(at..at + 2).and_then(|pair| u8::from_str_radix(pair, 16).ok());
    let bytes: Option<Vec<u8>> = (0..digits.len()).step_by(2).map(pair).collect();
    let bytes = bytes.ok_or_else(wrong_data)?;
    Ok(short.and_then(|id| Frame::new(id, &bytes)))
}
