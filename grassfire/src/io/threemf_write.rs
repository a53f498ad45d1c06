//! Writes 3MF: closed triangle meshes in millimetres with their names.

use std::io::{BufWriter, Cursor, Write};
use std::path::Path;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::{IoError, atomic_write};
use crate::mesh::{Solid, TriMesh};

const CONTENT_TYPES: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"><Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>
"#;
const RELATIONSHIPS: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Target="/3D/3dmodel.model" Id="rel0" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>
"#;
const CORE: &str = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";

/// A body of a 3MF file. That it is a [`Solid`] says that it is closed, oriented and manifold.
#[derive(Debug, Clone)]
pub struct ThreeMfObject {
    /// Name.
    pub name: String,
    /// Its surface, mm.
    pub solid: Solid,
}

/// Texts of a 3MF file; empty ones are left out.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ThreeMfTexts {
    /// Title.
    pub title: String,
    /// Author.
    pub designer: String,
    /// Description.
    pub description: String,
}

/// Writes a 3MF file in millimetres, atomically: one object and one build item a body. Coordinates are rounded to 1e-6 mm.
/// Equal bodies give equal files.
///
/// # Errors
/// [`IoError::Write`].
pub fn write_3mf(
    path: &Path,
    objects: &[ThreeMfObject],
    texts: &ThreeMfTexts,
) -> Result<(), IoError> {
    atomic_write(path, |out| out.write_all(&archive(objects, texts)?))
}

fn archive(objects: &[ThreeMfObject], texts: &ThreeMfTexts) -> std::io::Result<Vec<u8>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    // The time of a new entry is 1980 without the crate's clock, so that equal parts give equal bytes.
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    for (name, text) in [
        ("[Content_Types].xml", CONTENT_TYPES),
        ("_rels/.rels", RELATIONSHIPS),
    ] {
        zip.start_file(name, options)?;
        zip.write_all(text.as_bytes())?;
    }
    zip.start_file("3D/3dmodel.model", options.large_file(true))?;
    let mut xml = Writer::new(BufWriter::with_capacity(1 << 16, &mut zip));
    model(&mut xml, objects, texts)?;
    xml.into_inner().flush()?;
    Ok(zip.finish()?.into_inner())
}

fn model(
    xml: &mut Writer<impl Write>,
    objects: &[ThreeMfObject],
    texts: &ThreeMfTexts,
) -> std::io::Result<()> {
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let model = [("unit", "millimeter"), ("xml:lang", "en"), ("xmlns", CORE)];
    open(xml, "model", model)?;
    let version = concat!("grassfire ", env!("CARGO_PKG_VERSION"));
    for (name, text) in [
        ("Title", texts.title.as_str()),
        ("Designer", &texts.designer),
        ("Description", &texts.description),
        ("Application", version),
    ] {
        if !text.is_empty() {
            open(xml, "metadata", [("name", name)])?;
            xml.write_event(Event::Text(BytesText::new(&plain(text))))?;
            close(xml, "metadata")?;
        }
    }
    open(xml, "resources", [])?;
    for (k, object) in objects.iter().enumerate() {
        let (id, name) = ((k + 1).to_string(), plain(&object.name));
        let attributes = [("id", id.as_str()), ("name", &name), ("type", "model")];
        open(xml, "object", attributes)?;
        mesh(xml, object.solid.mesh())?;
        close(xml, "object")?;
    }
    close(xml, "resources")?;
    open(xml, "build", [])?;
    for k in 1..=objects.len() {
        empty(xml, "item", [("objectid", k.to_string().as_str())])?;
    }
    close(xml, "build")?;
    close(xml, "model")
}

fn mesh(xml: &mut Writer<impl Write>, mesh: &TriMesh) -> std::io::Result<()> {
    open(xml, "mesh", [])?;
    open(xml, "vertices", [])?;
    for p in &mesh.points {
        let [x, y, z] = [p.x, p.y, p.z].map(|c| format!("{c:.6}"));
        empty(xml, "vertex", [("x", x.as_str()), ("y", &y), ("z", &z)])?;
    }
    close(xml, "vertices")?;
    open(xml, "triangles", [])?;
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| v.to_string());
        let corners = [("v1", a.as_str()), ("v2", &b), ("v3", &c)];
        empty(xml, "triangle", corners)?;
    }
    close(xml, "triangles")?;
    close(xml, "mesh")
}

/// What XML can hold.
fn plain(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).collect()
}

fn open<const N: usize>(
    xml: &mut Writer<impl Write>,
    name: &str,
    attributes: [(&str, &str); N],
) -> std::io::Result<()> {
    xml.write_event(Event::Start(
        BytesStart::new(name).with_attributes(attributes),
    ))
}

fn empty<const N: usize>(
    xml: &mut Writer<impl Write>,
    name: &str,
    attributes: [(&str, &str); N],
) -> std::io::Result<()> {
    xml.write_event(Event::Empty(
        BytesStart::new(name).with_attributes(attributes),
    ))
}

fn close(xml: &mut Writer<impl Write>, name: &str) -> std::io::Result<()> {
    xml.write_event(Event::End(BytesEnd::new(name)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::io::{Input, ReadOptions, read_input};
    use crate::monitor::Monitor;

    fn tetrahedron(at: f64) -> TriMesh {
        let corner = |x: f64, y: f64, z: f64| Vec3::new(at + x, y, z);
        TriMesh {
            points: vec![
                corner(0.0, 0.0, 0.0),
                corner(1.0 / 3.0, 0.0, 0.0),
                corner(0.0, 1.0, 0.0),
                corner(0.0, 0.0, 1.5),
            ],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
            tags: Vec::new(),
        }
    }

    #[test]
    fn comes_back_closed_with_its_names_and_unit() {
        let folder = tempfile::tempdir().unwrap();
        let (one, two) = (folder.path().join("a.3mf"), folder.path().join("b.3mf"));
        let objects: Vec<ThreeMfObject> = [("body <1> & \"co\"", 0.0), ("boss 2", 5.0)]
            .map(|(name, at)| ThreeMfObject {
                name: name.to_owned(),
                solid: Solid::try_from(tetrahedron(at)).unwrap(),
            })
            .into();
        let texts = ThreeMfTexts {
            title: "bracket".into(),
            designer: "J\u{f6}rg".into(),
            description: String::new(),
        };
        write_3mf(&one, &objects, &texts).unwrap();
        write_3mf(&two, &objects, &texts).unwrap();
        assert!(std::fs::read(&one).unwrap() == std::fs::read(&two).unwrap());
        let read = read_input(&one, &ReadOptions::default(), &Monitor::default()).unwrap();
        let Input::Mesh { mesh, .. } = read else {
            panic!("no mesh")
        };
        assert_eq!((mesh.points.len(), mesh.triangles.len()), (8, 8));
        assert_eq!(mesh.tags.last(), Some(&1));
        let solid = Solid::try_from(mesh).unwrap();
        assert!((solid.volume() - 2.0 / 12.0).abs() < 1e-6);
        let mut archive = zip::ZipArchive::new(std::fs::File::open(&one).unwrap()).unwrap();
        let mut text = String::new();
        let mut file = archive.by_name("3D/3dmodel.model").unwrap();
        std::io::Read::read_to_string(&mut file, &mut text).unwrap();
        for part in [
            "unit=\"millimeter\"",
            "name=\"body &lt;1&gt; &amp; &quot;co&quot;\"",
            "name=\"boss 2\"",
            "J\u{f6}rg",
        ] {
            assert!(text.contains(part), "{part} is not in {text}");
        }
        assert!(!text.contains("Description"));
    }

    #[test]
    fn an_open_mesh_is_no_body() {
        let mut mesh = tetrahedron(0.0);
        mesh.triangles.pop();
        assert!(Solid::try_from(mesh).is_err());
    }
}
