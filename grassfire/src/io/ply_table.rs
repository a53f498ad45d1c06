//! The elements of a PLY file as tables: text and both binary orders.

use super::IoError;
use super::number::Number;
use super::source::{Source, quote, tokens};

/// Most properties over all elements; real files have a few dozen.
const MAX_PROPERTIES: usize = 1000;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Text,
    Little,
    Big,
}

/// The type of a name in the header.
fn number(word: &[u8]) -> Option<Number> {
    Some(match word {
        b"char" | b"int8" => Number::I8,
        b"uchar" | b"uint8" => Number::U8,
        b"short" | b"int16" => Number::I16,
        b"ushort" | b"uint16" => Number::U16,
        b"int" | b"int32" => Number::I32,
        b"uint" | b"uint32" => Number::U32,
        b"float" | b"float32" => Number::F32,
        b"double" | b"float64" => Number::F64,
        _ => return None,
    })
}

#[derive(Debug)]
struct Property {
    name: String,
    kind: Number,
    /// Kind of the length of a list; `None` for one value.
    list: Option<Number>,
}

#[derive(Debug)]
struct Element {
    name: String,
    rows: usize,
    properties: Vec<Property>,
}

#[derive(Debug)]
struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
    /// Where the rows begin, in bytes and in lines.
    body: usize,
    lines: usize,
}

/// One property of all rows of an element: single values have `ends` empty.
#[derive(Debug, Default)]
pub(super) struct Column {
    pub values: Vec<f64>,
    pub ends: Vec<usize>,
}

/// The wanted columns of one element.
#[derive(Debug)]
pub(super) struct Table {
    pub name: String,
    pub rows: usize,
    pub columns: Vec<(String, Column)>,
}

impl Table {
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|(n, _)| n == name).map(|(_, c)| c)
    }

    /// The column of corner indices, under either of its two names.
    pub fn corners(&self) -> Option<&Column> {
        self.column("vertex_indices")
            .or_else(|| self.column("vertex_index"))
            .filter(|c| c.ends.len() == self.rows)
    }
}

impl Column {
    /// The lists of a list column.
    pub fn lists(&self) -> impl Iterator<Item = &[f64]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts
            .zip(&self.ends)
            .map(|(start, &end)| &self.values[start..end])
    }
}

/// Reads the columns that `keep(element, property)` asks for.
pub(super) fn read_tables(
    src: &Source,
    keep: &dyn Fn(&str, &str) -> bool,
) -> Result<Vec<Table>, IoError> {
    let header = read_header(src)?;
    let mut rest = Body {
        src,
        bytes: &src.bytes[header.body..],
        first: header.body,
        at: 0,
        line: header.lines,
    };
    let mut tables = Vec::new();
    for element in &header.elements {
        check_rows(src, &header, rest.bytes.len() - rest.at, element)?;
        let slot = |property| Slot {
            property,
            wanted: keep(&element.name, &property.name),
            column: Column::default(),
        };
        let mut slots: Vec<Slot> = element.properties.iter().map(slot).collect();
        for row in 0..element.rows {
            if row % 100_000 == 0 {
                src.monitor.check()?;
            }
            match header.encoding {
                Encoding::Text => rest.text_row(element, row, &mut slots)?,
                order => rest.binary_row(element, row, &mut slots, order == Encoding::Big)?,
            }
        }
        let wanted = slots.into_iter().filter(|slot| slot.wanted);
        tables.push(Table {
            name: element.name.clone(),
            rows: element.rows,
            columns: wanted
                .map(|slot| (slot.property.name.clone(), slot.column))
                .collect(),
        });
    }
    Ok(tables)
}

fn read_header(src: &Source) -> Result<Header, IoError> {
    let mut header = Header {
        encoding: Encoding::Text,
        elements: Vec::new(),
        body: 0,
        lines: 0,
    };
    let (mut seen_format, mut properties) = (false, 0);
    while let Some(length) = src.bytes[header.body..].iter().position(|&b| b == b'\n') {
        let line = &src.bytes[header.body..header.body + length];
        header.body += length + 1;
        header.lines += 1;
        let n = header.lines;
        let mut words = tokens(line);
        match words.next().unwrap_or_default() {
            b"end_header" if seen_format => return Ok(header),
            b"end_header" => return Err(src.line(n, "the header has no line `format`")),
            b"format" => {
                seen_format = true;
                header.encoding = match words.next().unwrap_or_default() {
                    b"ascii" => Encoding::Text,
                    b"binary_little_endian" => Encoding::Little,
                    b"binary_big_endian" => Encoding::Big,
                    other => {
                        return Err(src.line(n, format!("format {} is not known", quote(other))));
                    }
                };
            }
            b"element" => {
                let name = words.next().unwrap_or_default();
                header.elements.push(Element {
                    name: String::from_utf8_lossy(name).into_owned(),
                    rows: src.next_index(n, &mut words, "the number of rows")?,
                    properties: Vec::new(),
                });
            }
            b"property" => {
                let Some(element) = header.elements.last_mut() else {
                    return Err(src.line(n, "a property before the first element"));
                };
                element.properties.push(read_property(src, n, words)?);
                properties += 1;
            }
            b"ply" | b"comment" | b"obj_info" | b"" => {}
            other => return Err(src.line(n, format!("{} is not a PLY header line", quote(other)))),
        }
        if properties > MAX_PROPERTIES || header.elements.len() > MAX_PROPERTIES {
            return Err(src.limit(
                "the number of properties",
                properties.max(header.elements.len()),
                MAX_PROPERTIES,
            ));
        }
    }
    Err(src.line(
        header.lines + 1,
        "the file ends inside the header: `end_header` is missing",
    ))
}

fn read_property<'t>(
    src: &Source,
    line: usize,
    mut words: impl Iterator<Item = &'t [u8]>,
) -> Result<Property, IoError> {
    let kind = |word: Option<&[u8]>| {
        let word = word.unwrap_or_default();
        number(word).ok_or_else(|| src.line(line, format!("{} is not a PLY type", quote(word))))
    };
    let first = words.next().unwrap_or_default();
    let (list, kind) = if first == b"list" {
        (Some(kind(words.next())?), kind(words.next())?)
    } else {
        (None, kind(Some(first))?)
    };
    let name = words
        .next()
        .ok_or_else(|| src.line(line, "the property has no name"))?;
    Ok(Property {
        name: String::from_utf8_lossy(name).into_owned(),
        kind,
        list,
    })
}

/// Refuses a number of rows that cannot fit into the bytes that are left.
fn check_rows(
    src: &Source,
    header: &Header,
    left: usize,
    element: &Element,
) -> Result<(), IoError> {
    let Element {
        name,
        rows,
        properties,
    } = element;
    let least = match header.encoding {
        Encoding::Text => 2 * properties.len(),
        _ => properties
            .iter()
            .map(|p| p.list.unwrap_or(p.kind).size())
            .sum(),
    };
    // The last line of a text may lack its end.
    if *rows > 0 && (least == 0 || rows.saturating_mul(least) > left + 1) {
        let name = quote(name.as_bytes());
        return Err(src.format(format!(
            "{rows} rows of element {name} do not fit into the {left} bytes left"
        )));
    }
    Ok(())
}

/// A property of an element whose rows are being read.
struct Slot<'a> {
    property: &'a Property,
    wanted: bool,
    column: Column,
}

/// The rows, read from front to back.
struct Body<'a> {
    src: &'a Source<'a>,
    bytes: &'a [u8],
    /// Where they begin in the file.
    first: usize,
    at: usize,
    line: usize,
}

impl<'a> Body<'a> {
    fn next_line(&mut self) -> Option<&'a [u8]> {
        while self.at < self.bytes.len() {
            let rest = &self.bytes[self.at..];
            let length = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
            self.at = (self.at + length + 1).min(self.bytes.len());
            self.line += 1;
            let line = rest[..length].trim_ascii();
            if !line.is_empty() {
                return Some(line);
            }
        }
        None
    }

    fn text_row(
        &mut self,
        element: &Element,
        row: usize,
        slots: &mut [Slot],
    ) -> Result<(), IoError> {
        let src = self.src;
        let name = || quote(element.name.as_bytes());
        let Some(line) = self.next_line() else {
            return Err(src.line(
                self.line,
                format!(
                    "the file ends at row {row} of {} of element {}",
                    element.rows,
                    name()
                ),
            ));
        };
        let mut words = tokens(line);
        for slot in slots {
            let (property, column) = (slot.property, &mut slot.column);
            let count = match property.list {
                Some(_) => src.next_index(self.line, &mut words, "the length of a list")?,
                None => 1,
            };
            for _ in 0..count {
                let Some(word) = words.next() else {
                    let what = format!("too few values for row {row} of element {}", name());
                    return Err(src.line(self.line, what));
                };
                if slot.wanted {
                    column.values.push(src.number(self.line, word)?);
                }
            }
            if slot.wanted && property.list.is_some() {
                column.ends.push(column.values.len());
            }
        }
        if words.next().is_some() {
            return Err(src.line(
                self.line,
                format!("too many values for row {row} of element {}", name()),
            ));
        }
        Ok(())
    }

    fn binary_row(
        &mut self,
        element: &Element,
        row: usize,
        slots: &mut [Slot],
        big: bool,
    ) -> Result<(), IoError> {
        let (src, first, end) = (self.src, self.first, self.first + self.bytes.len());
        let cut = || {
            let what = format!(
                "the file ends inside row {row} of {} of element {}",
                element.rows,
                quote(element.name.as_bytes())
            );
            src.byte(end, what)
        };
        for slot in slots {
            let (property, column) = (slot.property, &mut slot.column);
            let count = match property.list {
                Some(kind) => {
                    let count = kind.decode(self.take(kind.size()).ok_or_else(cut)?, big);
                    if !(count >= 0.0 && count.fract() == 0.0) {
                        return Err(src.byte(
                            first + self.at,
                            format!("{count} is not a length of a list"),
                        ));
                    }
                    count as usize
                }
                None => 1,
            };
            let size = property.kind.size();
            let data = count
                .checked_mul(size)
                .and_then(|n| self.take(n))
                .ok_or_else(cut)?;
            if slot.wanted {
                column.values.extend(property.kind.decode_all(data, big));
                if property.list.is_some() {
                    column.ends.push(column.values.len());
                }
            }
        }
        Ok(())
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let data = self.bytes.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(data)
    }
}
