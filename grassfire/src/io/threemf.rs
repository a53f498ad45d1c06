//! 3MF: triangle meshes in XML inside a zip archive.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Cursor, Read};

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::IoError;
use super::source::{Source, parse, quote, tokens};
use crate::Vec3;
use crate::mesh::{Repair, RepairKind, TriMesh};

/// Deepest nesting of components.
const MAX_DEPTH: usize = 16;
/// Most placements of components, so that a few lines cannot multiply into billions.
const MAX_PLACEMENTS: usize = 100_000;
/// Most files in the archive; real ones have a dozen.
const MAX_FILES: usize = 10_000;

/// Part of the archive and id in it.
type Key = (String, u64);

#[derive(Default)]
struct Object {
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    components: Vec<(Key, Transform)>,
    /// Support structures and the like, which are no part of the solid.
    auxiliary: bool,
    /// Millimetres per unit.
    unit: f64,
}

#[derive(Default)]
struct Package {
    objects: BTreeMap<Key, Object>,
    build: Vec<(Key, Transform)>,
    triangles: usize,
}

/// Rows of the 4 x 3 matrix that a point (x y z 1) is multiplied by from the left.
#[derive(Debug, Clone, Copy)]
struct Transform([f64; 12]);

impl Transform {
    const IDENTITY: Self = Self([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);

    fn apply(&self, p: &Vec3) -> Vec3 {
        let m = &self.0;
        Vec3::from_fn(|a, _| p.x * m[a] + p.y * m[3 + a] + p.z * m[6 + a] + m[9 + a])
    }

    /// First `self`, then `outer`.
    fn then(&self, outer: &Self) -> Self {
        let row = |r: usize| Vec3::new(self.0[3 * r], self.0[3 * r + 1], self.0[3 * r + 2]);
        let origin = outer.apply(&Vec3::zeros());
        let rows = [
            outer.apply(&row(0)) - origin,
            outer.apply(&row(1)) - origin,
            outer.apply(&row(2)) - origin,
            outer.apply(&row(3)),
        ];
        let mut m = [0.0; 12];
        for (slot, value) in m.iter_mut().zip(rows.iter().flat_map(|r| r.iter())) {
            *slot = *value;
        }
        Self(m)
    }

    fn mirrors(&self) -> bool {
        let m = &self.0;
        let row = |r: usize| Vec3::new(m[3 * r], m[3 * r + 1], m[3 * r + 2]);
        row(0).cross(&row(1)).dot(&row(2)) < 0.0
    }
}

/// Reads all build items, each with its own tag.
pub(super) fn read(src: &Source, notes: &mut Vec<Repair>) -> Result<TriMesh, IoError> {
    let package = read_package(src)?;
    let mut out = Assembly {
        mesh: TriMesh::default(),
        placements: 0,
        skipped: 0,
    };
    for (item, (key, transform)) in package.build.iter().enumerate() {
        out.place(src, &package, key, transform, item as u32, 0)?;
    }
    if package.build.is_empty() {
        // No build section that names an object: every object with triangles is meant.
        let keys: Vec<&Key> = package
            .objects
            .iter()
            .filter(|(_, o)| !o.triangles.is_empty())
            .map(|(k, _)| k)
            .collect();
        for (item, key) in keys.into_iter().enumerate() {
            out.place(src, &package, key, &Transform::IDENTITY, item as u32, 0)?;
        }
    }
    if out.skipped > 0 {
        let text = format!("{} support or helper objects ignored", out.skipped);
        notes.push(Repair::new(RepairKind::Skipped, out.skipped, text));
    }
    Ok(out.mesh)
}

struct Assembly {
    mesh: TriMesh,
    placements: usize,
    skipped: usize,
}

impl Assembly {
    fn place(
        &mut self,
        src: &Source,
        package: &Package,
        key: &Key,
        transform: &Transform,
        tag: u32,
        depth: usize,
    ) -> Result<(), IoError> {
        self.placements += 1;
        if depth > MAX_DEPTH {
            return Err(src.limit("the nesting of components", depth, MAX_DEPTH));
        }
        if self.placements > MAX_PLACEMENTS {
            return Err(src.limit("the number of components", self.placements, MAX_PLACEMENTS));
        }
        src.monitor.check()?;
        let Some(object) = package.objects.get(key) else {
            return Err(src.format(format!(
                "object {} of part {} does not exist",
                key.1,
                quote(key.0.as_bytes())
            )));
        };
        if object.auxiliary {
            self.skipped += 1;
            return Ok(());
        }
        let first = self.mesh.points.len();
        src.check_triangles(self.mesh.triangles.len() + object.triangles.len())?;
        // A triangle has three corners: so many points cannot be in use, and the indices stay within 32 bits.
        if first + object.points.len() > (u32::MAX / 2) as usize {
            return Err(src.limit(
                "the number of points",
                first + object.points.len(),
                (u32::MAX / 2) as usize,
            ));
        }
        self.mesh.points.extend(
            object
                .points
                .iter()
                .map(|p| transform.apply(p) * object.unit),
        );
        let shift = first as u32;
        let mirrors = transform.mirrors();
        for &[a, b, c] in &object.triangles {
            let [a, b, c] = if mirrors { [a, c, b] } else { [a, b, c] };
            self.mesh.triangles.push([a + shift, b + shift, c + shift]);
        }
        self.mesh.tags.resize(self.mesh.triangles.len(), tag);
        for (child, local) in &object.components {
            self.place(src, package, child, &local.then(transform), tag, depth + 1)?;
        }
        Ok(())
    }
}

fn read_package(src: &Source) -> Result<Package, IoError> {
    let bad_zip = |e: zip::result::ZipError| {
        src.format(format!(
            "not a valid zip archive: {}",
            quote(e.to_string().as_bytes())
        ))
    };
    let mut archive = zip::ZipArchive::new(Cursor::new(src.bytes)).map_err(bad_zip)?;
    if archive.len() > MAX_FILES {
        return Err(src.limit(
            "the number of files in the archive",
            archive.len(),
            MAX_FILES,
        ));
    }
    let mut names: Vec<String> = archive
        .file_names()
        .filter_map(Result::ok)
        .filter(|n| n.to_lowercase().ends_with(".model"))
        .map(std::borrow::Cow::into_owned)
        .collect();
    names.sort_unstable();
    if names.is_empty() {
        let found = "the archive holds no .model file".to_owned();
        return Err(IoError::NotA {
            file: src.file(),
            expected: "a 3MF file",
            found,
        });
    }
    let mut package = Package::default();
    let mut left = src.options.max_unpacked_bytes;
    for name in names {
        src.monitor.check()?;
        let entry = archive.by_name(&name).map_err(bad_zip)?;
        let mut limited = BufReader::new(entry.take(left));
        read_model(src, &name, &mut limited, &mut package)?;
        left = limited.get_ref().limit();
        if left == 0 {
            let limit = src.options.max_unpacked_bytes;
            return Err(IoError::Limit {
                file: src.file(),
                what: "the unpacked size in bytes".into(),
                value: limit,
                limit,
            });
        }
    }
    Ok(package)
}

/// State while one model part is read.
struct Part<'a> {
    src: &'a Source<'a>,
    name: &'a str,
    unit: f64,
    /// Object that is open.
    object: Option<(u64, Object)>,
}

fn read_model(
    src: &Source,
    name: &str,
    input: &mut dyn BufRead,
    package: &mut Package,
) -> Result<(), IoError> {
    let mut reader = Reader::from_reader(input);
    let mut part = Part {
        src,
        name,
        unit: 1.0,
        object: None,
    };
    let mut buffer = Vec::new();
    let mut events = 0usize;
    loop {
        buffer.clear();
        events += 1;
        if events.is_multiple_of(100_000) {
            src.monitor.check()?;
        }
        let at = reader.buffer_position();
        let event = reader.read_event_into(&mut buffer);
        let event = event.map_err(|e| {
            src.format(format!(
                "{}, byte {at}: {}",
                quote(name.as_bytes()),
                quote(e.to_string().as_bytes())
            ))
        })?;
        match event {
            Event::Start(tag) => part.open(&tag, at, package)?,
            Event::Empty(tag) => {
                part.open(&tag, at, package)?;
                part.close(tag.local_name().as_ref(), package)?;
            }
            Event::End(tag) => part.close(tag.local_name().as_ref(), package)?,
            Event::Eof => return Ok(()),
            _ => {}
        }
    }
}

impl Part<'_> {
    fn fail(&self, at: u64, what: impl std::fmt::Display) -> IoError {
        self.src.format(format!(
            "{}, byte {at}: {what}",
            quote(self.name.as_bytes())
        ))
    }

    fn attribute(&self, tag: &BytesStart, key: &[u8]) -> Option<Vec<u8>> {
        // Damaged attributes count as missing; required ones are reported by name.
        let found = tag
            .attributes()
            .filter_map(Result::ok)
            .find(|a| a.key.local_name().as_ref() == key)?;
        Some(found.value.into_owned())
    }

    fn required<T: std::str::FromStr>(
        &self,
        tag: &BytesStart,
        at: u64,
        key: &str,
    ) -> Result<T, IoError> {
        let value = self
            .attribute(tag, key.as_bytes())
            .ok_or_else(|| self.fail(at, format!("attribute `{key}` is missing")))?;
        parse(value.trim_ascii())
            .ok_or_else(|| self.fail(at, format!("`{key}` is {}", quote(&value))))
    }

    /// The object that a component or build item refers to, and how it is placed.
    fn reference(&self, tag: &BytesStart, at: u64) -> Result<(Key, Transform), IoError> {
        let id = self.required(tag, at, "objectid")?;
        let part = match self.attribute(tag, b"path") {
            Some(path) => String::from_utf8_lossy(&path)
                .trim_start_matches('/')
                .to_owned(),
            None => self.name.to_owned(),
        };
        let transform = match self.attribute(tag, b"transform") {
            Some(text) => {
                let values: Option<Vec<f64>> = tokens(&text).map(parse).collect();
                let matrix = values
                    .and_then(|v| <[f64; 12]>::try_from(v).ok())
                    .filter(|m| m.iter().all(|x| x.is_finite()));
                Transform(matrix.ok_or_else(|| {
                    self.fail(at, format!("transform {} is not 12 numbers", quote(&text)))
                })?)
            }
            None => Transform::IDENTITY,
        };
        Ok(((part, id), transform))
    }

    fn open(&mut self, tag: &BytesStart, at: u64, package: &mut Package) -> Result<(), IoError> {
        match tag.local_name().as_ref() {
            b"model" => {
                self.unit = match self.attribute(tag, b"unit").as_deref() {
                    None | Some(b"millimeter") => 1.0,
                    Some(b"micron") => 1e-3,
                    Some(b"centimeter") => 10.0,
                    Some(b"inch") => 25.4,
                    Some(b"foot") => 304.8,
                    Some(b"meter") => 1000.0,
                    Some(other) => {
                        return Err(self.fail(at, format!("unit {} is not known", quote(other))));
                    }
                };
            }
            b"object" => {
                let id = self.required(tag, at, "id")?;
                let auxiliary = matches!(
                    self.attribute(tag, b"type").as_deref(),
                    Some(b"support" | b"other")
                );
                self.object = Some((
                    id,
                    Object {
                        auxiliary,
                        unit: self.unit,
                        ..Object::default()
                    },
                ));
            }
            b"vertex" => {
                let p = Vec3::new(
                    self.required(tag, at, "x")?,
                    self.required(tag, at, "y")?,
                    self.required(tag, at, "z")?,
                );
                if let Some((_, object)) = &mut self.object {
                    object.points.push(p);
                }
            }
            b"triangle" => self.triangle(tag, at, package)?,
            b"component" => {
                let reference = self.reference(tag, at)?;
                if let Some((_, object)) = &mut self.object {
                    object.components.push(reference);
                }
            }
            b"item" => package.build.push(self.reference(tag, at)?),
            _ => {}
        }
        Ok(())
    }

    fn triangle(
        &mut self,
        tag: &BytesStart,
        at: u64,
        package: &mut Package,
    ) -> Result<(), IoError> {
        let corners: [u32; 3] = [
            self.required(tag, at, "v1")?,
            self.required(tag, at, "v2")?,
            self.required(tag, at, "v3")?,
        ];
        package.triangles += 1;
        self.src.check_triangles(package.triangles)?;
        let Some((id, object)) = &mut self.object else {
            return Ok(());
        };
        let count = object.points.len();
        if let Some(corner) = corners.iter().find(|&&c| c as usize >= count) {
            let what = format!(
                "triangle {} of object {id} names point {corner}, there are {count}",
                object.triangles.len()
            );
            return Err(self.fail(at, what));
        }
        object.triangles.push(corners);
        Ok(())
    }

    fn close(&mut self, tag: &[u8], package: &mut Package) -> Result<(), IoError> {
        if tag == b"object"
            && let Some((id, object)) = self.object.take()
            && package
                .objects
                .insert((self.name.to_owned(), id), object)
                .is_some()
        {
            return Err(self.src.format(format!(
                "object {id} is defined twice in {}",
                quote(self.name.as_bytes())
            )));
        }
        Ok(())
    }
}
