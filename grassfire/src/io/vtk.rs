//! VTK XML files with densities: image data (`.vti`) and unstructured grids of equal boxes (`.vtu`).

use std::borrow::Cow;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::source::{Source, find, parse, quote, tokens};
use super::vtk_array::{Appended, Array, Encoding};
use super::{IoError, density, vtk_grid};
use crate::Vec3;
use crate::mesh::Repair;
use crate::voxel::VoxelGrid;

/// Names that density arrays carry in the wild, in lower case.
const NAMES: &[&str] = &["density", "densities", "rho", "xphys", "x_phys", "design"];

/// Attributes and arrays of one piece.
#[derive(Default)]
pub(super) struct Piece<'a> {
    pub extent: [i64; 6],
    pub arrays: Vec<Array<'a>>,
}

/// A file, its arrays still encoded.
#[derive(Default)]
pub(super) struct VtkFile<'a> {
    kind: String,
    pub encoding: Encoding,
    pub appended: Appended<'a>,
    extent: [i64; 6],
    origin: [f64; 3],
    spacing: [f64; 3],
    pub pieces: Vec<Piece<'a>>,
}

/// Reads the densities of a `.vti` or `.vtu` file, in cells or in points.
///
/// 1. The XML part is read; appended data, which may be raw bytes, is found by its tag. 2. The density array is chosen by name.
/// 3. Its pieces are decoded (text, base64, raw, zlib) and put into one grid.
pub(super) fn read(src: &Source, notes: &mut Vec<Repair>) -> Result<VoxelGrid<f32>, IoError> {
    let file = parse_file(src)?;
    if file.pieces.is_empty() {
        return Err(IoError::Empty {
            file: src.file(),
            what: "no piece of a grid",
        });
    }
    match file.kind.as_str() {
        "ImageData" => image(src, &file, notes),
        "UnstructuredGrid" => vtk_grid::read(src, &file, notes),
        other => Err(src.format(format!(
            "VTK type {} cannot be read (ImageData and UnstructuredGrid can)",
            quote(other.as_bytes())
        ))),
    }
}

fn parse_file<'a>(src: &Source<'a>) -> Result<VtkFile<'a>, IoError> {
    let mut file = VtkFile {
        spacing: [1.0; 3],
        ..VtkFile::default()
    };
    let (xml, rest) = src
        .bytes
        .split_at(find(src.bytes, b"<AppendedData").unwrap_or(src.bytes.len()));
    let mut reader = Reader::from_reader(xml);
    let mut section = String::new();
    loop {
        let at = reader.buffer_position() as usize;
        let event = reader.read_event().map_err(|e| {
            src.byte(
                at,
                format!("not valid XML: {}", quote(e.to_string().as_bytes())),
            )
        })?;
        match event {
            Event::Start(e) => open_tag(src, at, &e, &mut file, &mut section, true)?,
            Event::Empty(e) => open_tag(src, at, &e, &mut file, &mut section, false)?,
            Event::Text(text) => {
                let array = file
                    .pieces
                    .last_mut()
                    .and_then(|p| p.arrays.last_mut())
                    .filter(|a| a.open);
                if let Some(array) = array.filter(|a| a.text.is_empty()) {
                    array.text = text.into_inner();
                }
            }
            Event::End(e) if e.name().as_ref() == b"DataArray" => {
                if let Some(array) = file.pieces.last_mut().and_then(|p| p.arrays.last_mut()) {
                    array.open = false;
                }
            }
            Event::Eof => break,
            _ => {}
        }
    }
    file.appended = Appended::find(rest);
    Ok(file)
}

fn open_tag<'a>(
    src: &Source,
    at: usize,
    tag: &BytesStart<'a>,
    file: &mut VtkFile<'a>,
    section: &mut String,
    open: bool,
) -> Result<(), IoError> {
    let get = |key: &str| -> Result<Option<String>, IoError> {
        let found = tag
            .try_get_attribute(key)
            .map_err(|_| src.byte(at, format!("attribute `{key}` is not valid XML")))?;
        Ok(found.map(|a| String::from_utf8_lossy(&a.value).into_owned()))
    };
    match tag.name().as_ref() {
        b"VTKFile" => {
            file.kind = get("type")?.unwrap_or_default();
            file.encoding = Encoding {
                big: get("byte_order")?.as_deref() == Some("BigEndian"),
                wide: get("header_type")?.as_deref() == Some("UInt64"),
                compressor: get("compressor")?,
            };
        }
        b"ImageData" => {
            file.extent = numbers(src, at, "WholeExtent", get("WholeExtent")?)?.unwrap_or_default();
            file.origin = numbers(src, at, "Origin", get("Origin")?)?.unwrap_or_default();
            file.spacing = numbers(src, at, "Spacing", get("Spacing")?)?.unwrap_or([1.0; 3]);
            let direction: Option<[f64; 9]> = numbers(src, at, "Direction", get("Direction")?)?;
            if direction.is_some_and(|d| d != [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]) {
                return Err(src.byte(
                    at,
                    "the image is rotated (`Direction`), which cannot be read",
                ));
            }
        }
        b"Piece" => {
            let extent = numbers(src, at, "Extent", get("Extent")?)?.unwrap_or(file.extent);
            file.pieces.push(Piece {
                extent,
                arrays: Vec::new(),
            });
        }
        name @ (b"PointData" | b"CellData" | b"Points" | b"Cells") => {
            *section = String::from_utf8_lossy(name).into_owned();
        }
        b"DataArray" => {
            let Some(piece) = file.pieces.last_mut() else {
                return Ok(());
            };
            piece.arrays.push(Array {
                section: section.clone(),
                name: get("Name")?.unwrap_or_default(),
                kind: get("type")?.unwrap_or_default(),
                components: get("NumberOfComponents")?
                    .and_then(|n| n.parse().ok())
                    .unwrap_or(1),
                format: get("format")?.unwrap_or_default(),
                offset: get("offset")?.and_then(|n| n.parse().ok()).unwrap_or(0),
                text: Cow::Borrowed(b""),
                open,
            });
        }
        _ => {}
    }
    Ok(())
}

fn numbers<T: std::str::FromStr + Copy + Default, const N: usize>(
    src: &Source,
    at: usize,
    key: &str,
    text: Option<String>,
) -> Result<Option<[T; N]>, IoError> {
    let Some(text) = text else { return Ok(None) };
    let values: Option<Vec<T>> = tokens(text.as_bytes()).map(parse).collect();
    match values.and_then(|v| <[T; N]>::try_from(v).ok()) {
        Some(values) => Ok(Some(values)),
        None => Err(src.byte(
            at,
            format!("`{key}` is {}, not {N} numbers", quote(text.as_bytes())),
        )),
    }
}

impl<'a> VtkFile<'a> {
    /// Section and name of the density array, the same in all pieces.
    pub fn choose(&self, src: &Source) -> Result<(String, String), IoError> {
        let arrays = self
            .pieces
            .first()
            .map(|p| p.arrays.as_slice())
            .unwrap_or_default();
        let mut fields: Vec<&Array> = arrays
            .iter()
            .filter(|a| a.components == 1 && a.section == "CellData")
            .collect();
        fields.extend(
            arrays
                .iter()
                .filter(|a| a.components == 1 && a.section == "PointData"),
        );
        fields.retain(|a| !a.name.starts_with("vtk"));
        let wanted = src.options.field.as_deref();
        let found = match wanted {
            Some(name) => fields.iter().find(|a| a.name == name),
            None => {
                let lower: Vec<String> = fields.iter().map(|a| a.name.to_lowercase()).collect();
                let exact = NAMES.iter().find_map(|n| lower.iter().position(|l| l == n));
                let part = || {
                    NAMES
                        .iter()
                        .find_map(|n| lower.iter().position(|l| l.contains(n)))
                };
                let only = || (fields.len() == 1).then_some(0);
                exact
                    .or_else(part)
                    .or_else(only)
                    .and_then(|i| fields.get(i))
            }
        };
        match found {
            Some(array) => Ok((array.section.clone(), array.name.clone())),
            None => {
                let present: Vec<String> = fields
                    .iter()
                    .take(20)
                    .map(|a| quote(a.name.as_bytes()))
                    .collect();
                let present = if present.is_empty() {
                    "none with one component".to_owned()
                } else {
                    present.join(", ")
                };
                let wanted = wanted.map_or_else(
                    || "called density".to_owned(),
                    |name| format!("called {name:?}"),
                );
                Err(IoError::Field {
                    file: src.file(),
                    wanted,
                    present,
                })
            }
        }
    }

    /// The decoded array of one piece.
    pub fn values(
        &self,
        src: &Source,
        piece: &Piece,
        section: &str,
        name: Option<&str>,
    ) -> Result<Vec<f64>, IoError> {
        let fits = |a: &&Array| a.section == section && name.is_none_or(|n| a.name == n);
        let array = piece.arrays.iter().find(fits);
        let array = array.ok_or_else(|| {
            src.format(format!(
                "a piece lacks the array {:?} in {section}",
                name.unwrap_or("Points")
            ))
        })?;
        array.decode(src, &self.encoding, &self.appended)
    }
}

fn image(src: &Source, file: &VtkFile, notes: &mut Vec<Repair>) -> Result<VoxelGrid<f32>, IoError> {
    let (section, name) = file.choose(src)?;
    let cells = section == "CellData";
    let dims = extent_dims(src, &file.extent, cells)?;
    let count = src.check_voxels(dims)?;
    let mut values = vec![0.0f32; count];
    for piece in &file.pieces {
        src.monitor.check()?;
        let part = extent_dims(src, &piece.extent, cells)?;
        let lower = [0, 1, 2].map(|a| {
            piece.extent[2 * a]
                .checked_sub(file.extent[2 * a])
                .and_then(|d| usize::try_from(d).ok())
        });
        let [Some(i0), Some(j0), Some(k0)] = lower else {
            return Err(src.format(format!(
                "piece {:?} lies outside of {:?}",
                piece.extent, file.extent
            )));
        };
        if i0.saturating_add(part[0]) > dims[0]
            || j0.saturating_add(part[1]) > dims[1]
            || k0.saturating_add(part[2]) > dims[2]
        {
            return Err(src.format(format!(
                "piece {:?} lies outside of {:?}",
                piece.extent, file.extent
            )));
        }
        let data = file.values(src, piece, &section, Some(&name))?;
        if data.len() != src.check_voxels(part)? {
            return Err(src.format(format!(
                "array {name:?} has {} values for {part:?} voxels",
                data.len()
            )));
        }
        for (row, line) in data.chunks_exact(part[0]).enumerate() {
            let (j, k) = (j0 + row % part[1], k0 + row / part[1]);
            let start = (k * dims[1] + j) * dims[0] + i0;
            for (slot, value) in values[start..start + part[0]].iter_mut().zip(line) {
                *slot = *value as f32;
            }
        }
    }
    let half = if cells { 0.5 } else { 0.0 };
    let origin =
        Vec3::from_fn(|a, _| file.origin[a] + (file.extent[2 * a] as f64 + half) * file.spacing[a]);
    density::cubic(src, origin, file.spacing, dims, values, notes)
}

/// Number of cells or points along each axis.
fn extent_dims(src: &Source, extent: &[i64; 6], cells: bool) -> Result<[usize; 3], IoError> {
    let mut dims = [0; 3];
    for a in 0..3 {
        let span = extent[2 * a + 1]
            .checked_sub(extent[2 * a])
            .and_then(|d| usize::try_from(d).ok());
        let span = span.ok_or_else(|| src.format(format!("extent {extent:?} is not usable")))?;
        dims[a] = span.saturating_add(usize::from(!cells));
    }
    Ok(dims)
}
