//! Reading a job item by item.

use std::io::{ErrorKind, Read};

use protocol::checksum::Crc32;
use serde::de::DeserializeOwned;

use super::record::{Item, are_limits};
use super::{FILE_VERSION, FeedFile, FileHeader, MAGIC, ReadError, SCHEMA_HASH, Totals};
use crate::feed::job::JobItem;
use crate::feed::pack::TableBytes;
use crate::job::machine::{MAX_AXES, OverrideRule};

/// Longest payload of a record [bytes].
pub(super) const MAX_RECORD: u32 = 256 << 20;

/// Kinds of records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Kind {
    Header = 1,
    Item = 2,
    End = 3,
}

/// Reads a job from any source; memory stays proportional to the longest record that is really there.
#[derive(Debug)]
pub struct FeedReader<R> {
    source: R,
    header: FileHeader,
    /// Number of the next record.
    record: u64,
    counted: Totals,
    totals: Option<Totals>,
    payload: Vec<u8>,
}

impl<R: Read> FeedReader<R> {
    /// Reads what comes before the items.
    ///
    /// # Errors
    /// It is no feed file of this version, or its header is damaged.
    pub fn new(mut source: R) -> Result<Self, ReadError> {
        if array(&mut source).ok_or(ReadError::Magic)?? != MAGIC {
            return Err(ReadError::Magic);
        }
        let truncated = || ReadError::Truncated { record: 0 };
        let found = u16::from_le_bytes(array(&mut source).ok_or_else(truncated)??);
        if found != FILE_VERSION {
            return Err(ReadError::Version { found, expected: FILE_VERSION });
        }
        let found = u64::from_le_bytes(array(&mut source).ok_or_else(truncated)??);
        if found != SCHEMA_HASH {
            return Err(ReadError::Schema { found, expected: SCHEMA_HASH });
        }
        let header = FileHeader {
            name: String::new(),
            tick_ns: 0,
            axes: vec![],
            override_rule: OverrideRule::default(),
        };
        let (counted, payload) = (Totals::default(), Vec::new());
        let mut reader = Self { source, header, record: 0, counted, totals: None, payload };
        reader.header = match reader.next_record()? {
            kind if kind == Kind::Header as u8 => reader.decode()?,
            found => return Err(ReadError::Kind { record: 0, found }),
        };
        check_header(&reader.header).map_err(|what| ReadError::Value { record: 0, what })?;
        reader.record = 1;
        Ok(reader)
    }

    /// The machine.
    pub fn header(&self) -> &FileHeader {
        &self.header
    }

    /// What the file holds, once the end was read.
    pub fn totals(&self) -> Option<Totals> {
        self.totals
    }

    /// The next item; `None` behind the last one.
    ///
    /// # Errors
    /// The next record is damaged or not admissible.
    pub fn next_item(&mut self) -> Result<Option<JobItem>, ReadError> {
        if self.totals.is_some() {
            return Ok(None);
        }
        let record = self.record;
        match self.next_record()? {
            kind if kind == Kind::Item as u8 => {
                let item: Item = self.decode()?;
                let number = self.counted.sections as u32;
                let (item, bytes) = item.into_job(&self.header, record, number)?;
                self.counted.count(&item, &bytes);
                self.record += 1;
                Ok(Some(item))
            }
            kind if kind == Kind::End as u8 => {
                let totals: Totals = self.decode()?;
                if totals != self.counted {
                    return Err(ReadError::Totals);
                }
                if self.source.read(&mut [0])? != 0 {
                    return Err(ReadError::LeftOver);
                }
                self.totals = Some(totals);
                Ok(None)
            }
            found => Err(ReadError::Kind { record, found }),
        }
    }

    /// All items that are left.
    ///
    /// # Errors
    /// As [`FeedReader::next_item`].
    pub fn read_all(mut self) -> Result<FeedFile, ReadError> {
        let mut items = Vec::new();
        while let Some(item) = self.next_item()? {
            items.push(item);
        }
        Ok(FeedFile { header: self.header, items, totals: self.counted })
    }

    /// Reads a record into `payload` and gives its kind.
    fn next_record(&mut self) -> Result<u8, ReadError> {
        let record = self.record;
        let truncated = || ReadError::Truncated { record };
        let head: [u8; 5] = array(&mut self.source).ok_or_else(truncated)??;
        let [kind, length @ ..] = head;
        let length = u32::from_le_bytes(length);
        if length > MAX_RECORD {
            return Err(ReadError::TooLong { record, length, most: MAX_RECORD });
        }
        self.payload.clear();
        let read = self.source.by_ref().take(u64::from(length)).read_to_end(&mut self.payload)?;
        if read < length as usize {
            return Err(truncated());
        }
        let mut crc = Crc32::new();
        crc.update(&head);
        crc.update(&self.payload);
        if array(&mut self.source).ok_or_else(truncated)?? != crc.finish().to_le_bytes() {
            return Err(ReadError::Checksum { record });
        }
        Ok(kind)
    }

    fn decode<T: DeserializeOwned>(&self) -> Result<T, ReadError> {
        match postcard::take_from_bytes(&self.payload) {
            Ok((value, [])) => Ok(value),
            _ => Err(ReadError::Malformed { record: self.record }),
        }
    }
}

/// The next N bytes; `None` at the end of the source.
fn array<const N: usize>(source: &mut impl Read) -> Option<Result<[u8; N], ReadError>> {
    let mut bytes = [0; N];
    match source.read_exact(&mut bytes) {
        Ok(()) => Some(Ok(bytes)),
        Err(e) if e.kind() == ErrorKind::UnexpectedEof => None,
        Err(e) => Some(Err(e.into())),
    }
}

pub(super) fn check_header(header: &FileHeader) -> Result<(), &'static str> {
    let fits = |good: bool, what| if good { Ok(()) } else { Err(what) };
    fits(header.tick_ns > 0, "control ticks")?;
    fits((1..=MAX_AXES).contains(&header.axes.len()), "axes")?;
    for axis in &header.axes {
        let scale = axis.counts_per_unit;
        fits(scale > 0.0 && scale.is_finite(), "counts per unit")?;
        fits(axis.travel[0] < axis.travel[1], "travels")?;
        fits(are_limits(&axis.limits) && are_limits(&axis.rapid), "limits")?;
    }
    Ok(())
}

impl Totals {
    pub(super) fn count(&mut self, item: &JobItem, bytes: &TableBytes) {
        self.items += 1;
        self.sections += u64::from(matches!(item, JobItem::Section(_)));
        self.spans += bytes.spans;
        self.geometry_spans += bytes.geometry_spans;
        self.table_bytes += bytes.total();
    }
}
