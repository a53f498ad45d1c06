//! Data arrays of VTK XML files: text, base64 and raw bytes, plain or zlib-compressed.

use std::borrow::Cow;
use std::io::Read;

use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::IoError;
use super::number::Number;
use super::source::{Source, find, quote, tokens};

/// How all arrays of a file are encoded.
#[derive(Debug, Default)]
pub(super) struct Encoding {
    pub big: bool,
    /// Lengths have 8 bytes, not 4.
    pub wide: bool,
    pub compressor: Option<String>,
}

/// The block of appended data.
#[derive(Debug, Default)]
pub(super) struct Appended<'a> {
    bytes: &'a [u8],
    base64: bool,
}

impl<'a> Appended<'a> {
    /// `rest` begins with the tag; the data begin behind the first underscore.
    pub fn find(rest: &'a [u8]) -> Self {
        let Some(end) = rest.iter().position(|&b| b == b'>') else {
            return Self::default();
        };
        let (tag, body) = rest.split_at(end + 1);
        let start = body
            .iter()
            .position(|&b| b == b'_')
            .map_or(body.len(), |at| at + 1);
        Self {
            bytes: &body[start..],
            base64: find(tag, b"base64").is_some(),
        }
    }
}

/// One array, still encoded.
#[derive(Debug)]
pub(super) struct Array<'a> {
    pub section: String,
    pub name: String,
    pub kind: String,
    pub components: usize,
    pub format: String,
    pub offset: usize,
    pub text: Cow<'a, [u8]>,
    /// Its text may still follow.
    pub open: bool,
}

impl Array<'_> {
    /// All values; text by its words, binary data by their type.
    pub fn decode(
        &self,
        src: &Source,
        encoding: &Encoding,
        appended: &Appended,
    ) -> Result<Vec<f64>, IoError> {
        let fail =
            |what: String| src.format(format!("array {}: {what}", quote(self.name.as_bytes())));
        let bytes = match self.format.as_str() {
            "ascii" => return self.decode_text().map_err(fail),
            "binary" => self.unpack(src, encoding, Coded::new(&self.text, true)),
            "appended" => {
                let data = appended.bytes.get(self.offset..).unwrap_or_default();
                self.unpack(src, encoding, Coded::new(data, appended.base64))
            }
            other => Err(format!("format {} is not known", quote(other.as_bytes()))),
        };
        let bytes = bytes.map_err(fail)?;
        self.numbers(&bytes, encoding.big).map_err(fail)
    }

    fn decode_text(&self) -> Result<Vec<f64>, String> {
        let number = |word: &[u8]| {
            super::source::parse(word).ok_or_else(|| format!("{} is not a number", quote(word)))
        };
        tokens(&self.text).map(number).collect()
    }

    /// The plain bytes.
    fn unpack(
        &self,
        src: &Source,
        encoding: &Encoding,
        mut coded: Coded,
    ) -> Result<Vec<u8>, String> {
        let width = if encoding.wide { 8 } else { 4 };
        let word = |bytes: &[u8]| {
            let mut raw = [0u8; 8];
            for (slot, &b) in raw.iter_mut().zip(bytes) {
                *slot = b;
            }
            if encoding.big {
                raw[..width].reverse();
            }
            usize::try_from(u64::from_le_bytes(raw)).unwrap_or(usize::MAX)
        };
        let cut = || "the file ends inside its data".to_owned();
        let limit = usize::try_from(src.options.max_unpacked_bytes).unwrap_or(usize::MAX);
        match encoding.compressor.as_deref() {
            None | Some("") => coded.plain(width, &word).ok_or_else(cut),
            Some("vtkZLibDataCompressor") => {
                let counts = coded.peek(3 * width).ok_or_else(cut)?;
                let blocks = word(&counts[..width]);
                if blocks == 0 {
                    return Ok(Vec::new());
                }
                let header = blocks
                    .checked_add(3)
                    .and_then(|n| n.checked_mul(width))
                    .and_then(|n| coded.take(n))
                    .ok_or_else(cut)?;
                let size = word(&counts[width..2 * width]);
                if size.checked_mul(blocks).is_none_or(|n| n > limit) {
                    return Err(format!(
                        "{blocks} blocks of {size} bytes are more than the limit of {limit} bytes"
                    ));
                }
                let packed: Vec<usize> =
                    header[3 * width..].chunks_exact(width).map(word).collect();
                let total = packed
                    .iter()
                    .try_fold(0usize, |n, &p| n.checked_add(p))
                    .ok_or_else(cut)?;
                inflate(&coded.take(total).ok_or_else(cut)?, &packed, size)
            }
            Some(other) => Err(format!(
                "compressor {} cannot be read, save with zlib or none",
                quote(other.as_bytes())
            )),
        }
    }

    fn numbers(&self, bytes: &[u8], big: bool) -> Result<Vec<f64>, String> {
        let number = match self.kind.as_str() {
            "Int8" => Number::I8,
            "UInt8" => Number::U8,
            "Int16" => Number::I16,
            "UInt16" => Number::U16,
            "Int32" => Number::I32,
            "UInt32" => Number::U32,
            "Int64" => Number::I64,
            "UInt64" => Number::U64,
            "Float32" => Number::F32,
            "Float64" => Number::F64,
            other => return Err(format!("type {} is not known", quote(other.as_bytes()))),
        };
        Ok(number.decode_all(bytes, big).collect())
    }
}

/// Unpacks zlib blocks of at most `size` plain bytes each.
fn inflate(data: &[u8], packed: &[usize], size: usize) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    let mut at = 0;
    for (block, &length) in packed.iter().enumerate() {
        let start = out.len();
        let mut decoder =
            flate2::read::ZlibDecoder::new(&data[at..at + length]).take(size as u64 + 1);
        decoder
            .read_to_end(&mut out)
            .map_err(|e| format!("compressed block {block} is damaged: {e}"))?;
        if out.len() - start > size {
            return Err(format!(
                "compressed block {block} holds more than the {size} bytes it claims"
            ));
        }
        at += length;
    }
    Ok(out)
}

/// Raw bytes, or base64 text that is decoded piece by piece.
struct Coded<'a> {
    data: &'a [u8],
    base64: bool,
}

impl<'a> Coded<'a> {
    fn new(data: &'a [u8], base64: bool) -> Self {
        Self { data, base64 }
    }

    /// A length and as many bytes. In base64 both are one stream or two; two when the length ends in padding.
    fn plain(&mut self, width: usize, word: &dyn Fn(&[u8]) -> usize) -> Option<Vec<u8>> {
        if !self.base64 {
            let count = word(&self.take(width)?);
            return self.take(count);
        }
        let (text, after) = self.characters(width)?;
        let count = word(decode(&text)?.get(..width)?);
        if text.contains(&b'=') {
            self.data = &self.data[after..];
            return self.take(count);
        }
        let mut both = self.take(count.checked_add(width)?)?;
        both.drain(..width);
        Some(both)
    }

    /// `count` bytes without moving on.
    fn peek(&self, count: usize) -> Option<Vec<u8>> {
        Coded {
            data: self.data,
            base64: self.base64,
        }
        .take(count)
    }

    /// `count` bytes that were encoded as one stream.
    fn take(&mut self, count: usize) -> Option<Vec<u8>> {
        if self.base64 {
            let (text, after) = self.characters(count)?;
            self.data = &self.data[after..];
            let mut bytes = decode(&text)?;
            bytes.truncate(count);
            (bytes.len() == count).then_some(bytes)
        } else {
            let bytes = self.data.get(..count)?;
            self.data = &self.data[count..];
            Some(bytes.to_vec())
        }
    }

    /// The base64 characters of `count` bytes without white space, and where they end.
    fn characters(&self, count: usize) -> Option<(Vec<u8>, usize)> {
        let need = count.div_ceil(3).checked_mul(4)?;
        // Checked before memory is asked for.
        if need > self.data.len() {
            return None;
        }
        let mut text = Vec::with_capacity(need);
        for (at, &b) in self.data.iter().enumerate() {
            if text.len() == need {
                return Some((text, at));
            }
            if !b.is_ascii_whitespace() {
                text.push(b);
            }
        }
        (text.len() == need).then_some((text, self.data.len()))
    }
}

fn decode(text: &[u8]) -> Option<Vec<u8>> {
    let config = GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true);
    GeneralPurpose::new(&base64::alphabet::STANDARD, config)
        .decode(text)
        .ok()
}
