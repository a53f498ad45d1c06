//! The files of a part, read again: names, colours and header of STEP; BREP, IGES, 3MF, pieces.
#![cfg(feature = "occt")]

mod cad_common;
#[path = "spline/shapes.rs"]
#[allow(dead_code, reason = "only some shapes are needed here")]
mod shapes;

use std::collections::BTreeMap;
use std::path::Path;

use cad_common::cuboid;
use grassfire::Vec3;
use grassfire::cad::{
    self, Bore, CadOptions, CadSolid, FaceSource, NonDesignBody, NonDesignOptions, StepOptions,
};
use grassfire::io::{Input, ReadOptions, ThreeMfObject, ThreeMfTexts, read_input, write_3mf};
use grassfire::mesh::{Solid, TriMesh};
use grassfire::monitor::Monitor;
use grassfire::spline::{BrepOptions, PatchOptions, build_brep, patches};
use grassfire_occt::{Operation, Shape, StepContents, step_contents};

type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

/// A round tube of 64 facets along z.
fn tube(centre: Vec3, radii: [f64; 2], length: f64) -> TriMesh {
    let mut mesh = TriMesh::default();
    let half = 0.5 * length;
    for k in 0..64u32 {
        let (s, c) = (std::f64::consts::TAU * f64::from(k) / 64.0).sin_cos();
        for (r, z) in [
            (radii[1], -half),
            (radii[1], half),
            (radii[0], half),
            (radii[0], -half),
        ] {
            mesh.points.push(centre + Vec3::new(r * c, r * s, z));
        }
        let next = 4 * ((k + 1) % 64);
        for j in 0..4 {
            let (a, b) = (4 * k + j, next + j);
            let (c, d) = (next + (j + 1) % 4, 4 * k + (j + 1) % 4);
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

fn bodies(name: &str, centre: Vec3) -> Result<Vec<NonDesignBody>> {
    let mesh = tube(centre, [4.0, 7.0], 12.0);
    let options = NonDesignOptions::default();
    Ok(cad::from_mesh(
        name,
        "test",
        &mesh,
        &options,
        &Monitor::default(),
    )?)
}

/// A block of 40 x 20 x 8 mm and a tube around its end, or far away.
fn block_with_tube(x: f64) -> Result<CadSolid> {
    let block = cuboid(
        Vec3::new(-20.0, -10.0, -4.0),
        Vec3::new(20.0, 10.0, 4.0),
        false,
    );
    let tube = bodies("eye", Vec3::new(x, 0.0, 0.0))?;
    Ok(cad::build(
        &block,
        &tube,
        &CadOptions::default(),
        &Monitor::default(),
    )?)
}

/// A body of smooth blocks and a tube in it.
fn organic_with_tube() -> Result<(CadSolid, Vec<NonDesignBody>)> {
    let monitor = Monitor::default();
    let mut mesh = shapes::bracket();
    shapes::jitter(&mut mesh, 0.05, 3);
    mesh.points.iter_mut().for_each(|p| *p *= 10.0);
    let faces = patches(&mesh, &PatchOptions::default(), &monitor)?;
    let brep = build_brep(&mesh, &faces, &BrepOptions::default(), &monitor)?;
    let low = mesh.points.iter().fold(mesh.points[0], |a, p| a.inf(p));
    let high = mesh.points.iter().fold(mesh.points[0], |a, p| a.sup(p));
    let tube = bodies("eye", Vec3::new(high.x, 0.5 * (low.y + high.y), 5.0))?;
    let solid = cad::build(&brep, &tube, &CadOptions::default(), &monitor)?;
    Ok((solid, tube))
}

fn texts() -> StepOptions {
    StepOptions {
        product: "bracket".into(),
        author: "J\u{f6}rg O'Neil".into(),
        organization: "Works".into(),
        description: "left hand".into(),
        time_stamp: "2026-01-31T12:34:56".into(),
    }
}

/// How many faces have a name, and the colours that go with it.
type Painted = (usize, Vec<Option<[u8; 3]>>);

/// The faces of each name.
fn by_name(found: &StepContents) -> BTreeMap<&str, Painted> {
    let mut out = BTreeMap::<&str, Painted>::new();
    for (name, color) in found.faces.iter().zip(&found.colors) {
        let entry = out.entry(name.as_str()).or_default();
        entry.0 += 1;
        if !entry.1.contains(color) {
            entry.1.push(*color);
        }
    }
    out
}

fn written(solid: &CadSolid) -> Result<(StepContents, String, tempfile::TempDir)> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("part.step");
    cad::write_step(solid, &path, &texts())?;
    Ok((
        step_contents(&path)?,
        std::fs::read_to_string(&path)?,
        folder,
    ))
}

#[test]
fn step_names_every_face_by_its_body() -> Result {
    let solid = block_with_tube(20.0)?;
    assert!(solid.valid, "{:?}", solid.messages);
    let (found, text, _folder) = written(&solid)?;
    assert_eq!(found.products, ["bracket"]);
    assert_eq!(found.solids, ["bracket"]);
    let names = by_name(&found);
    let count =
        |wanted: fn(&FaceSource) -> bool| solid.sources.iter().filter(|s| wanted(s)).count();
    let of = |name: &str| names.get(name).map_or(0, |entry| entry.0);
    assert_eq!(of("organic"), count(|s| *s == FaceSource::Organic));
    assert_eq!(
        of("eye: bore"),
        count(|s| matches!(s, FaceSource::Bore(..)))
    );
    assert_eq!(
        of("eye: wall") + of("eye: plane"),
        count(|s| matches!(s, FaceSource::Body(_)))
    );
    assert!(of("organic") >= 5 && of("eye: bore") >= 1 && of("eye: wall") >= 1);
    assert_eq!(of("eye: plane"), 2);
    assert_eq!(found.faces.len(), solid.faces);
    let color = |name: &str| names[name].1.clone();
    assert!(
        names
            .values()
            .all(|(_, colors)| colors.len() == 1 && colors[0].is_some())
    );
    assert_eq!(color("eye: bore"), color("eye: wall"));
    assert_ne!(color("eye: bore"), color("organic"));
    for part in [
        "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING",
        "J\\X2\\00F6\\X0\\rg O''Neil",
        "'Works'",
        "'left hand'",
        "2026-01-31T12:34:56",
        "SI_UNIT(.MILLI.,.METRE.)",
    ] {
        assert!(text.contains(part), "{part}");
    }
    let claimed = text
        .split("UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(")
        .nth(1)
        .and_then(|rest| rest.split(')').next()?.parse::<f64>().ok())
        .ok_or("no uncertainty")?;
    assert!(
        (claimed / solid.max_tolerance - 1.0).abs() < 1e-6,
        "{claimed}"
    );
    Ok(())
}

#[test]
fn separate_bodies_are_named_parts_of_an_assembly() -> Result {
    let solid = block_with_tube(60.0)?;
    assert!(!solid.valid && solid.bodies == 2);
    let (found, text, folder) = written(&solid)?;
    let mut products = found.products.clone();
    products.sort();
    assert_eq!(products, ["bracket", "eye", "organic body"]);
    let names = by_name(&found);
    assert_eq!(names["organic"].0, 6);
    assert!(
        names.contains_key("eye: bore") && names.contains_key("eye: wall"),
        "{names:?}"
    );
    assert!(text.contains("NOT VALID"));
    let back = Shape::read_step(&folder.path().join("part.step"))?;
    assert_eq!(back.counts()?.solids, 2);
    assert!((back.volume(1e-9)? / solid.volume - 1.0).abs() < 1e-6);
    Ok(())
}

#[test]
fn brep_and_iges_hold_the_part() -> Result {
    let (solid, _) = organic_with_tube()?;
    let folder = tempfile::tempdir()?;
    let path = |name: &str| folder.path().join(name);
    cad::write_brep(&solid, &path("a.brep"))?;
    let brep = Shape::read_brep(&path("a.brep"))?;
    assert!((brep.volume(1e-8)? / solid.volume - 1.0).abs() < 1e-6);
    assert_eq!(brep.counts()?.faces as usize, solid.faces);
    for name in ["a.igs", "b.igs"] {
        cad::write_iges(&solid, &path(name), &texts())?;
    }
    let iges = Shape::read_iges(&path("a.igs"))?;
    assert!((iges.volume(1e-8)? / solid.volume - 1.0).abs() < 1e-4);
    assert_eq!(
        (
            iges.counts()?.solids as usize,
            iges.counts()?.faces as usize
        ),
        (solid.bodies, solid.faces)
    );
    let text = std::fs::read_to_string(path("a.igs"))?;
    assert!(text == std::fs::read_to_string(path("b.igs"))?);
    // The header goes on over lines of 72 characters.
    let header: String = text
        .lines()
        .filter(|line| line.as_bytes().get(72) == Some(&b'G'))
        .filter_map(|line| line.get(..72))
        .flat_map(|line| line.trim_end().chars())
        .collect();
    for part in [
        "7Hbracket",
        "15H20260131.123456",
        "11HJ?rg O'Neil",
        "5HWorks",
        "2HMM",
    ] {
        assert!(header.contains(part), "{part} is not in {header}");
    }
    assert!(cad::write_brep(&solid, Path::new("no/such/folder/a.brep")).is_err());
    Ok(())
}

#[test]
fn three_mf_is_closed_and_has_the_volume() -> Result {
    let (solid, _) = organic_with_tube()?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("part.3mf");
    let mut last = f64::INFINITY;
    for chord in [0.2, 0.02] {
        let mut objects = Vec::new();
        for (name, mesh) in cad::tessellate_solids(&solid, chord, &texts())? {
            let solid = Solid::try_from(mesh)?;
            objects.push(ThreeMfObject { name, solid });
        }
        assert_eq!(objects[0].name, "bracket");
        write_3mf(&path, &objects, &ThreeMfTexts::default())?;
        let read = read_input(&path, &ReadOptions::default(), &Monitor::default())?;
        let Input::Mesh { mesh, notes } = read else {
            return Err("no mesh".into());
        };
        assert!(notes.is_empty(), "{notes:?}");
        let back = Solid::try_from(mesh)?;
        let off = (back.volume() - solid.volume).abs();
        assert!(off <= chord * solid.area, "{off} mm3 at a chord of {chord}");
        assert!(off < last, "{off} mm3 at a chord of {chord}, {last} before");
        last = off;
    }
    Ok(())
}

/// The pieces and the bores give the part again.
#[test]
fn pieces_make_the_part() -> Result {
    let (solid, bodies) = organic_with_tube()?;
    let folder = tempfile::tempdir()?;
    cad::write_pieces(&solid, &bodies, folder.path(), &texts())?;
    let read = |name: &str| Shape::read_step(&folder.path().join(name));
    let never = || false;
    let mut whole = read(cad::ORGANIC_PIECE)?;
    for k in 0..bodies.len() {
        let name = cad::piece_name(k);
        assert_eq!(step_contents(&folder.path().join(&name))?.products, ["eye"]);
        whole = whole
            .boolean(Operation::Fuse, &read(&name)?, 1e-5, false, &never)?
            .shape;
    }
    let bores: Vec<&Bore> = solid.non_design.iter().flat_map(|b| &b.bores).collect();
    assert_eq!(bores.len(), 1);
    for bore in bores {
        let from = bore.extent[0] - bore.extension[0];
        let length = bore.extent[1] + bore.extension[1] - from;
        let start = bore.origin + bore.direction * from;
        let tool = Shape::cylinder(start.into(), bore.direction.into(), bore.radius, length)?;
        whole = whole
            .boolean(Operation::Cut, &tool, 1e-5, false, &never)?
            .shape;
    }
    assert!((whole.volume(1e-8)? / solid.volume - 1.0).abs() < 1e-6);
    Ok(())
}
