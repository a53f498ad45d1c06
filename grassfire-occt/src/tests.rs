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
