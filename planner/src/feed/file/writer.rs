//! Writing a job item by item.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use protocol::checksum::Crc32;
use serde::Serialize;
use tempfile::{Builder, NamedTempFile};

use super::reader::{Kind, MAX_RECORD, check_header};
use super::record::Item;
use super::{FILE_VERSION, FileHeader, MAGIC, SCHEMA_HASH, Totals, WriteError};
use crate::feed::job::JobItem;

/// Writes a job to any sink; the file is complete after [`FeedWriter::finish`].
#[derive(Debug)]
pub struct FeedWriter<W> {
    out: W,
    header: FileHeader,
    totals: Totals,
}

impl<W: Write> FeedWriter<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// The sink refuses, or the header is not admissible.
    pub fn new(mut out: W, header: &FileHeader) -> Result<Self, WriteError> {
        check_header(header).map_err(|what| WriteError::Header { what })?;
        out.write_all(&MAGIC)?;
        out.write_all(&FILE_VERSION.to_le_bytes())?;
        out.write_all(&SCHEMA_HASH.to_le_bytes())?;
        let mut writer = Self { out, header: header.clone(), totals: Totals::default() };
        writer.record(Kind::Header, header)?;
        Ok(writer)
    }

    /// Appends an item.
    ///
    /// # Errors
    /// The sink refuses, or the item cannot be expressed.
    pub fn push(&mut self, item: &JobItem) -> Result<(), WriteError> {
        let number = self.totals.sections as u32;
        let (record, bytes) = Item::from_job(item, &self.header, self.totals.items, number)?;
        self.record(Kind::Item, &record)?;
        self.totals.count(item, &bytes);
        Ok(())
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The sink refuses.
    pub fn finish(mut self) -> Result<(W, Totals), WriteError> {
        let totals = self.totals;
        self.record(Kind::End, &totals)?;
        self.out.flush()?;
        Ok((self.out, totals))
    }

    fn record(&mut self, kind: Kind, payload: &impl Serialize) -> Result<(), WriteError> {
        let payload = postcard::to_allocvec(payload).map_err(|e| std::io::Error::other(e.to_string()))?;
        let (item, bytes) = (self.totals.items, payload.len());
        let length = u32::try_from(bytes).ok().filter(|length| *length <= MAX_RECORD);
        let length = length.ok_or(WriteError::TooLong { item, bytes, most: MAX_RECORD })?.to_le_bytes();
        let mut crc = Crc32::new();
        for part in [&[kind as u8][..], &length, &payload] {
            crc.update(part);
            self.out.write_all(part)?;
        }
        self.out.write_all(&crc.finish().to_le_bytes())?;
        Ok(())
    }
}

/// A file under a temporary name beside its own; without [`PendingFile::commit`] nothing is left of it.
#[derive(Debug)]
pub struct PendingFile {
    writer: FeedWriter<BufWriter<NamedTempFile>>,
    path: PathBuf,
}

impl PendingFile {
    /// Begins a file.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn create(path: &Path, header: &FileHeader) -> Result<Self, WriteError> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let mut builder = Builder::new();
        builder.prefix(".feed-");
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = builder.tempfile_in(folder.unwrap_or(Path::new(".")))?;
        Ok(Self { writer: FeedWriter::new(BufWriter::new(file), header)?, path: path.to_owned() })
    }

    /// Appends an item.
    ///
    /// # Errors
    /// As [`FeedWriter::push`].
    pub fn push(&mut self, item: &JobItem) -> Result<(), WriteError> {
        self.writer.push(item)
    }

    /// Ends the file and gives it its name.
    ///
    /// # Errors
    /// It cannot be written or renamed.
    pub fn commit(self) -> Result<Totals, WriteError> {
        let (out, totals) = self.writer.finish()?;
        let file = out.into_inner().map_err(std::io::IntoInnerError::into_error)?;
        file.as_file().sync_all()?;
        file.persist(&self.path).map_err(|e| e.error)?;
        Ok(totals)
    }
}
