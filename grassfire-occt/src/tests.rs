use std::path::Path;

use super::*;

fn never() -> bool {
    false
}

#[test]
fn cylinder_volume_and_faces() -> Result<()> {
    let c = Shape::cylinder([1.0, 2.0, 3.0], [0.0, 0.0, 2.0], 2.0, 5.0)?;
    let exact = std::f64::consts::PI * 20.0;
    assert!((c.volume(1e-9)? - exact).abs() < 1e-9 * exact);
    assert_eq!(c.faults()?, None);
    let faces = c.faces()?;
    assert_eq!(faces.len(), 3);
    assert!(faces.iter().any(|f| f.surface
        == Surface::Cylinder {
            radius: 2.0,
            concave: false
        }));
    Ok(())
}

#[test]
fn boolean_traces_faces_and_common() -> Result<()> {
    let cube = Shape::cuboid([0.0; 3], [4.0; 3])?;
    let bore = Shape::cylinder([2.0, 2.0, -1.0], [0.0, 0.0, 1.0], 1.0, 6.0)?;
    let cut = cube.boolean(Operation::Cut, &bore, 1e-5, true, &never)?;
    let pi = std::f64::consts::PI;
    assert!((cut.shape.volume(1e-9)? - (64.0 - 4.0 * pi)).abs() < 1e-6);
    assert!(
        (cut.common
            .as_ref()
            .map(|c| c.volume(1e-9))
            .transpose()?
            .unwrap_or(0.0)
            - 4.0 * pi)
            .abs()
            < 1e-6
    );
    assert!(cut.warnings.is_empty());
    let before = cube.face_volumes(1e-9, None)?;
    let after = cut.shape.face_volumes(1e-9, Some((&cube, &before)))?;
    assert!((after.iter().sum::<f64>() - (64.0 - 4.0 * pi)).abs() < 1e-6);
    let faces = cut.shape.faces()?;
    let wall = faces
        .iter()
        .position(|f| matches!(f.surface, Surface::Cylinder { concave: true, .. }));
    assert!(matches!(
        wall.map(|w| cut.origins[w]),
        Some(Origin::Tool(_))
    ));
    assert_eq!(
        cut.origins
            .iter()
            .filter(|o| matches!(o, Origin::Object(_)))
            .count(),
        6
    );
    let hits = cut.shape.line_hits(&[Line {
        point: [2.0, 2.0, 0.0],
        direction: [0.0, 0.0, 1.0],
        range: [-9.0, 9.0],
    }])?;
    assert!(hits[0].is_empty());
    assert_eq!(
        cut.shape.contains(&[[0.5, 0.5, 0.5], [2.0, 2.0, 2.0]])?,
        [true, false]
    );
    Ok(())
}

#[test]
fn interrupted_boolean_is_an_error() -> Result<()> {
    let cube = Shape::cuboid([0.0; 3], [4.0; 3])?;
    let other = cube.translated([1.0, 1.0, 1.0])?;
    assert!(
        cube.boolean(Operation::Fuse, &other, 1e-5, false, &|| true)
            .is_err()
    );
    Ok(())
}

#[test]
fn triangulation_is_watertight() -> Result<()> {
    let cube = Shape::cuboid([0.0; 3], [4.0; 3])?;
    let bore = Shape::cylinder([2.0, 2.0, -1.0], [0.0, 0.0, 1.0], 1.0, 6.0)?;
    let cut = cube
        .boolean(Operation::Cut, &bore, 1e-5, false, &never)?
        .shape;
    let mesh = cut.tessellate(0.01, 0.1)?;
    let mut edges = std::collections::BTreeMap::new();
    for t in &mesh.triangles {
        for k in 0..3 {
            *edges.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
        }
    }
    assert!(
        edges
            .iter()
            .all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1))
    );
    assert_eq!(mesh, cut.tessellate(0.01, 0.1)?);
    Ok(())
}

#[test]
fn revolve_and_facets() -> Result<()> {
    let ring = Shape::revolve(
        [0.0; 3],
        [1.0, 0.0, 0.0],
        &[[3.0, 0.0], [5.0, 0.0], [5.0, 2.0], [3.0, 2.0]],
    )?;
    let exact = std::f64::consts::PI * 32.0;
    assert!((ring.volume(1e-9)? - exact).abs() < 1e-9 * exact);
    assert_eq!((ring.faults()?, ring.counts()?.faces), (None, 4));
    let p = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
    ];
    let tetra = Shape::from_triangles(&p, &[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])?;
    assert_eq!(tetra.faults()?, None);
    assert!((tetra.volume(1e-9)? - 1.0 / 6.0).abs() < 1e-12);
    Ok(())
}

#[test]
fn bad_input_is_an_error() {
    assert!(Shape::cylinder([0.0; 3], [0.0; 3], 1.0, 1.0).is_err());
    assert!(Shape::cylinder([0.0; 3], [0.0, 0.0, f64::NAN], 1.0, 1.0).is_err());
    assert!(Shape::read_step(Path::new("/nowhere/missing.step")).is_err());
    let broken = BrepDescription {
        edges: vec![0, 1, 1],
        ..BrepDescription::default()
    };
    assert!(Shape::from_brep(&broken).is_err());
}

/// A plate with a bore, its faces named and painted, and a second body.
fn named(shape: &Shape) -> Result<StepTexts> {
    let bore = |f: &Face| matches!(f.surface, Surface::Cylinder { .. });
    let faces = shape.faces()?;
    let name = |f: &Face| if bore(f) { "eye: bore" } else { "organic" };
    let color = |f: &Face| {
        if bore(f) {
            [242, 142, 43]
        } else {
            [160, 170, 180]
        }
    };
    Ok(StepTexts {
        product: "Tr\u{e4}ger \\ it's".into(),
        author: "Jos\u{e9} \u{3a9}".into(),
        time_stamp: "2026-01-01T00:00:00".into(),
        solids: vec!["left".into(), "right".into()],
        faces: faces.iter().map(|f| name(f).to_owned()).collect(),
        colors: faces.iter().map(color).collect(),
        ..StepTexts::default()
    })
}

fn bored() -> Result<Shape> {
    let cube = Shape::cuboid([0.0; 3], [4.0; 3])?;
    let bore = Shape::cylinder([2.0, 2.0, -1.0], [0.0, 0.0, 1.0], 1.0, 6.0)?;
    Ok(cube
        .boolean(Operation::Cut, &bore, 1e-5, false, &never)?
        .shape
        .solids()?
        .swap_remove(0))
}

#[test]
fn step_gives_names_and_colours_back() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let path = std::env::temp_dir().join(format!("grassfire-names-{}.step", std::process::id()));
    let one = bored()?;
    let texts = named(&one)?;
    one.write_step(&path, &texts)?;
    let found = step_contents(&path)?;
    let text = std::fs::read_to_string(&path)?;
    assert!(text.is_ascii() && text.contains("AP242"), "{text}");
    assert_eq!(
        (found.products.as_slice(), found.solids.len()),
        (std::slice::from_ref(&texts.product), 1)
    );
    let sorted = |mut pairs: Vec<(String, Option<[u8; 3]>)>| {
        pairs.sort();
        pairs
    };
    let wanted = |texts: &StepTexts| {
        let colors = texts.colors.iter().map(|c| Some(*c));
        sorted(texts.faces.iter().cloned().zip(colors).collect())
    };
    let have = |found: &StepContents| {
        let pairs = found.faces.iter().cloned().zip(found.colors.clone());
        sorted(pairs.collect())
    };
    assert_eq!(have(&found), wanted(&texts));

    let two = Shape::compound([&one, &one.translated([9.0, 0.0, 0.0])?])?;
    let texts = named(&two)?;
    two.write_step(&path, &texts)?;
    let found = step_contents(&path)?;
    std::fs::remove_file(&path)?;
    assert_eq!(found.products.len(), 3);
    for name in [texts.product.as_str(), "left", "right"] {
        assert!(found.products.iter().any(|p| p == name), "{found:?}");
    }
    assert_eq!(have(&found), wanted(&texts));
    Ok(())
}

#[test]
fn brep_and_iges_come_back() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let shape = bored()?;
    let volume = shape.volume(1e-9)?;
    let path = std::env::temp_dir().join(format!("grassfire-files-{}", std::process::id()));
    let (brep, iges) = (path.with_extension("brep"), path.with_extension("igs"));
    shape.write_brep(&brep)?;
    shape.write_iges(&iges, &named(&shape)?)?;
    let (a, b) = (Shape::read_brep(&brep)?, Shape::read_iges(&iges)?);
    for file in [brep, iges] {
        std::fs::remove_file(file)?;
    }
    assert!((a.volume(1e-9)? / volume - 1.0).abs() < 1e-12);
    assert!((b.volume(1e-9)? / volume - 1.0).abs() < 1e-9);
    assert_eq!((a.counts()?.solids, b.counts()?.solids), (1, 1));
    assert!(Shape::read_brep(&path).is_err() && Shape::read_iges(&path).is_err());
    Ok(())
}

#[test]
fn a_fillet_fills_its_inner_edge() -> Result<()> {
    let foot = Shape::cuboid([0.0; 3], [40.0, 20.0, 5.0])?;
    let wall = Shape::cuboid([0.0; 3], [5.0, 20.0, 30.0])?;
    let angle = foot.boolean(Operation::Fuse, &wall, 1e-5, false, &never)?;
    let angle = angle.shape.unified()?;
    let edges = angle.edges()?;
    let inner: Vec<usize> = (0..edges.len()).filter(|&e| edges[e].concave).collect();
    assert_eq!(inner.len(), 1);
    let contour = angle.fillet_contour(inner[0] as u32)?;
    assert_eq!(contour, [inner[0] as u32]);
    let made = angle.fillet(&[(contour[0], 3.0)], 20.0, &never)?;
    let added = 9.0 * (1.0 - std::f64::consts::FRAC_PI_4) * 20.0;
    let volume = made.shape.volume(1e-9)? - angle.volume(1e-9)?;
    assert!((volume - added).abs() < 1e-6, "{volume}");
    assert_eq!(made.shape.faults()?, None);
    assert_eq!(made.origins.iter().filter(|o| o.is_none()).count(), 1);
    assert!(angle.fillet(&[(contour[0], 100.0)], 20.0, &never).is_err());
    assert!(angle.fillet(&[(999, 1.0)], 20.0, &never).is_err());
    let stopped = angle.fillet(&[(contour[0], 3.0)], 20.0, &|| true);
    assert!(stopped.is_err());
    Ok(())
}
