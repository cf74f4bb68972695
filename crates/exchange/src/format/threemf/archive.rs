//! The ZIP container of a 3MF file, written so that its one large entry can be deflated in
//! parallel.
//!
//! Format: PKWARE, .ZIP File Format Specification 6.3.10, sections 4.3 and 4.4. An entry's deflate
//! stream is a sequence of blocks that were each deflated alone and end on a byte with a sync
//! marker (RFC 1951, 3.2.4), which is one plain stream to every reader; checksums of blocks are
//! combined. The `zip` crate, which reads these files, has no way to append such blocks, hence
//! this page. Times are fixed at the format's first day and names are ASCII.

use super::super::error::{FormatError, Place};
use flate2::{Compress, Compression, Crc, FlushCompress, Status};
use std::io::{Seek, SeekFrom, Write};

const LOCAL_HEADER: u32 = 0x0403_4b50;
const CENTRAL_HEADER: u32 = 0x0201_4b50;
const END: u32 = 0x0605_4b50;
const END_ZIP64: u32 = 0x0606_4b50;
const LOCATOR_ZIP64: u32 = 0x0706_4b50;
const ZIP64_EXTRA: u16 = 0x0001;
const DEFLATED: u16 = 8;
/// 1 January 1980.
const FIRST_DAY: u16 = 0x0021;
const VERSION: u16 = 20;
const VERSION_ZIP64: u16 = 45;
/// What stands in a 32-bit field when the value is in the 64-bit record.
const ELSEWHERE: u32 = u32::MAX;

/// A block of a deflate stream.
pub(super) struct Deflated {
    bytes: Vec<u8>,
    checksum: Crc,
}

impl Deflated {
    /// Deflates a block; only the last one closes the stream.
    pub(super) fn new(text: &[u8], last: bool) -> Result<Self, FormatError> {
        // Level 1: six times as fast as level 6, for files a quarter larger.
        let mut state = Compress::new(Compression::new(1), false);
        let mut bytes = Vec::with_capacity(text.len() / 2 + 256);
        let flush = if last { FlushCompress::Finish } else { FlushCompress::Sync };
        loop {
            let taken = usize::try_from(state.total_in()).unwrap_or(usize::MAX);
            let room = bytes.capacity() - bytes.len();
            let status = state.compress_vec(&text[taken..], &mut bytes, flush).map_err(std::io::Error::other)?;
            let all_taken = state.total_in() == text.len() as u64;
            // A flush is complete when it leaves room: otherwise more may be waiting.
            let flushed = all_taken && bytes.len() < bytes.capacity() && room > 0;
            if status == Status::StreamEnd || (!last && flushed) {
                break;
            }
            bytes.reserve(text.len() / 4 + 256);
        }
        let mut checksum = Crc::new();
        checksum.update(text);
        Ok(Self { bytes, checksum })
    }
}

/// An entry of the central directory.
struct Entry {
    name: &'static str,
    checksum: u32,
    deflated_bytes: u64,
    bytes: u64,
    offset: u64,
    /// Whether its local header has room for 64-bit sizes.
    zip64: bool,
}

/// An archive under construction.
pub(super) struct Archive<'a, W> {
    sink: &'a mut W,
    /// Where the archive begins in the sink.
    base: u64,
    entries: Vec<Entry>,
    /// Checksum and deflated bytes of the open entry.
    open: (Crc, u64),
}

impl<'a, W: Write + Seek> Archive<'a, W> {
    pub(super) fn new(sink: &'a mut W) -> Result<Self, FormatError> {
        let base = sink.stream_position()?;
        Ok(Self { sink, base, entries: Vec::new(), open: (Crc::new(), 0) })
    }

    /// Writes a whole entry.
    pub(super) fn entry(&mut self, name: &'static str, content: &[u8]) -> Result<(), FormatError> {
        self.begin(name, content.len() as u64)?;
        self.append(&Deflated::new(content, true)?)?;
        self.end()
    }

    /// Opens an entry that will have at most `longest` bytes.
    pub(super) fn begin(&mut self, name: &'static str, longest: u64) -> Result<(), FormatError> {
        let offset = self.sink.stream_position()? - self.base;
        // A block that does not deflate grows by a few bytes in ten thousand.
        let zip64 = longest + longest / 256 >= u64::from(ELSEWHERE);
        let entry = Entry { name, checksum: 0, deflated_bytes: 0, bytes: 0, offset, zip64 };
        self.sink.write_all(&local_header(&entry))?;
        self.entries.push(entry);
        self.open = (Crc::new(), 0);
        Ok(())
    }

    /// Appends a block to the open entry.
    pub(super) fn append(&mut self, block: &Deflated) -> Result<(), FormatError> {
        self.sink.write_all(&block.bytes)?;
        self.open.0.combine(&block.checksum);
        self.open.1 += block.bytes.len() as u64;
        // The checksum counts in 32 bits; the sizes must not.
        if let Some(entry) = self.entries.last_mut() {
            entry.bytes += u64::from(block.checksum.amount());
        }
        Ok(())
    }

    /// Closes the entry: its header is written again, with checksum and sizes.
    pub(super) fn end(&mut self) -> Result<(), FormatError> {
        let Some(entry) = self.entries.last_mut() else { return Ok(()) };
        entry.checksum = self.open.0.sum();
        entry.deflated_bytes = self.open.1;
        let most = u64::from(ELSEWHERE) - 1;
        let largest = entry.bytes.max(entry.deflated_bytes);
        if !entry.zip64 && largest > most {
            return Err(FormatError::limit(Place::File, "entry_bytes", largest, most));
        }
        let end = self.sink.stream_position()?;
        self.sink.seek(SeekFrom::Start(self.base + entry.offset))?;
        self.sink.write_all(&local_header(entry))?;
        self.sink.seek(SeekFrom::Start(end))?;
        Ok(())
    }

    /// Writes the central directory.
    pub(super) fn finish(self) -> Result<(), FormatError> {
        let start = self.sink.stream_position()? - self.base;
        let mut directory = Vec::new();
        for entry in &self.entries {
            push_central_header(&mut directory, entry);
        }
        let size = directory.len() as u64;
        let count = self.entries.len() as u64;
        if start + size >= u64::from(ELSEWHERE) {
            push_zip64_end(&mut directory, start, size, count);
        }
        put32(&mut directory, END);
        put32(&mut directory, 0);
        // A 3MF file has a handful of entries.
        put16(&mut directory, narrow16(count));
        put16(&mut directory, narrow16(count));
        put32(&mut directory, narrow(size));
        put32(&mut directory, narrow(start));
        put16(&mut directory, 0);
        self.sink.write_all(&directory)?;
        self.sink.flush()?;
        Ok(())
    }
}

fn put16(bytes: &mut Vec<u8>, value: u16) {
    bytes.extend_from_slice(&value.to_le_bytes());
}

fn put32(bytes: &mut Vec<u8>, value: u32) {
    bytes.extend_from_slice(&value.to_le_bytes());
}

fn put64(bytes: &mut Vec<u8>, value: u64) {
    bytes.extend_from_slice(&value.to_le_bytes());
}

fn narrow(value: u64) -> u32 {
    u32::try_from(value).unwrap_or(ELSEWHERE)
}

fn narrow16(value: u64) -> u16 {
    u16::try_from(value).unwrap_or(u16::MAX)
}

/// Version, flags, method, time and date: the fields that both headers share.
fn push_common(bytes: &mut Vec<u8>, zip64: bool) {
    put16(bytes, if zip64 { VERSION_ZIP64 } else { VERSION });
    put16(bytes, 0);
    put16(bytes, DEFLATED);
    put16(bytes, 0);
    put16(bytes, FIRST_DAY);
}

fn local_header(entry: &Entry) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(64 + entry.name.len());
    put32(&mut bytes, LOCAL_HEADER);
    push_common(&mut bytes, entry.zip64);
    put32(&mut bytes, entry.checksum);
    put32(&mut bytes, if entry.zip64 { ELSEWHERE } else { narrow(entry.deflated_bytes) });
    put32(&mut bytes, if entry.zip64 { ELSEWHERE } else { narrow(entry.bytes) });
    put16(&mut bytes, narrow16(entry.name.len() as u64));
    put16(&mut bytes, if entry.zip64 { 20 } else { 0 });
    bytes.extend_from_slice(entry.name.as_bytes());
    if entry.zip64 {
        put16(&mut bytes, ZIP64_EXTRA);
        put16(&mut bytes, 16);
        put64(&mut bytes, entry.bytes);
        put64(&mut bytes, entry.deflated_bytes);
    }
    bytes
}

fn push_central_header(bytes: &mut Vec<u8>, entry: &Entry) {
    // With 64-bit sizes all three values go to the record, whether or not each one is large.
    let zip64 = entry.zip64 || entry.offset >= u64::from(ELSEWHERE);
    put32(bytes, CENTRAL_HEADER);
    put16(bytes, if zip64 { VERSION_ZIP64 } else { VERSION });
    push_common(bytes, zip64);
    put32(bytes, entry.checksum);
    put32(bytes, if zip64 { ELSEWHERE } else { narrow(entry.deflated_bytes) });
    put32(bytes, if zip64 { ELSEWHERE } else { narrow(entry.bytes) });
    put16(bytes, narrow16(entry.name.len() as u64));
    put16(bytes, if zip64 { 28 } else { 0 });
    // No comment, first disk, no attributes.
    put16(bytes, 0);
    put16(bytes, 0);
    put16(bytes, 0);
    put32(bytes, 0);
    put32(bytes, if zip64 { ELSEWHERE } else { narrow(entry.offset) });
    bytes.extend_from_slice(entry.name.as_bytes());
    if zip64 {
        put16(bytes, ZIP64_EXTRA);
        put16(bytes, 24);
        put64(bytes, entry.bytes);
        put64(bytes, entry.deflated_bytes);
        put64(bytes, entry.offset);
    }
}

fn push_zip64_end(bytes: &mut Vec<u8>, start: u64, size: u64, count: u64) {
    put32(bytes, END_ZIP64);
    put64(bytes, 44);
    put16(bytes, VERSION_ZIP64);
    put16(bytes, VERSION_ZIP64);
    put32(bytes, 0);
    put32(bytes, 0);
    put64(bytes, count);
    put64(bytes, count);
    put64(bytes, size);
    put64(bytes, start);
    put32(bytes, LOCATOR_ZIP64);
    put32(bytes, 0);
    put64(bytes, start + size);
    put32(bytes, 1);
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::io::{Cursor, Read};

    /// The 64-bit records are used far below their size, so that a small test sees them.
    #[test]
    fn an_entry_with_64_bit_sizes_is_read_back() {
        let mut sink = Cursor::new(Vec::new());
        let mut archive = Archive::new(&mut sink).unwrap();
        archive.entry("a.txt", b"first").unwrap();
        archive.begin("b.txt", 5 << 30).unwrap();
        archive.append(&Deflated::new(b"one block, ", false).unwrap()).unwrap();
        archive.append(&Deflated::new(b"and another", true).unwrap()).unwrap();
        archive.end().unwrap();
        archive.finish().unwrap();
        let mut zip = zip::ZipArchive::new(sink).unwrap();
        let mut text = String::new();
        zip.by_name("b.txt").unwrap().read_to_string(&mut text).unwrap();
        assert_eq!(text, "one block, and another");
        text.clear();
        zip.by_name("a.txt").unwrap().read_to_string(&mut text).unwrap();
        assert_eq!(text, "first");
    }

    #[test]
    fn noise_that_does_not_deflate_is_flushed_whole() {
        let mut noise = Vec::new();
        let mut state = 1_u32;
        for _ in 0..300_000 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            noise.push((state >> 24) as u8);
        }
        let mut sink = Cursor::new(Vec::new());
        let mut archive = Archive::new(&mut sink).unwrap();
        archive.begin("noise", 600_000).unwrap();
        archive.append(&Deflated::new(&noise, false).unwrap()).unwrap();
        archive.append(&Deflated::new(&noise, true).unwrap()).unwrap();
        archive.end().unwrap();
        archive.finish().unwrap();
        let mut back = Vec::new();
        zip::ZipArchive::new(sink).unwrap().by_name("noise").unwrap().read_to_end(&mut back).unwrap();
        assert_eq!(back, [noise.clone(), noise].concat());
    }
}
