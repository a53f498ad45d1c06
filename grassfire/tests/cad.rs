//! CAD stage on bodies with known volumes and on the corpus.
#![cfg(feature = "occt")]

mod cad_common;

use std::f64::consts::PI;

use cad_common::{corpus, cuboid, joined, read_stl};
use grassfire::Vec3;
use grassfire::cad::FaceSource;
use grassfire::cad::{
    CadError, CadOptions, CadSolid, NonDesignBody, NonDesignOptions, Rebuilt, StepOptions,
};
use grassfire::cad::{build, from_mesh, read, round_edges, tessellate, write_step};
use grassfire::mesh::{Solid, TriMesh};
use grassfire::monitor::Monitor;
use grassfire::spline::Brep;

type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

fn block() -> Brep {
    cuboid(
        Vec3::new(-20.0, -10.0, -4.0),
        Vec3::new(20.0, 10.0, 4.0),
        false,
    )
}

/// A ring about z as a mesh with `n` facets.
fn ring_mesh(centre: Vec3, radii: [f64; 2], heights: [f64; 2], n: u32) -> TriMesh {
    let mut mesh = TriMesh::default();
    for k in 0..n {
        let (s, c) = (2.0 * PI * f64::from(k) / f64::from(n)).sin_cos();
        for (r, z) in [
            (radii[1], heights[0]),
            (radii[1], heights[1]),
            (radii[0], heights[1]),
            (radii[0], heights[0]),
        ] {
            mesh.points.push(centre + Vec3::new(r * c, r * s, z));
        }
    }
    for k in 0..n {
        let next = (k + 1) % n;
        for j in 0..4 {
            let (a, b, c, d) = (
                4 * k + j,
                4 * next + j,
                4 * next + (j + 1) % 4,
                4 * k + (j + 1) % 4,
            );
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

fn ring(x: f64) -> Result<Vec<NonDesignBody>> {
    let mesh = ring_mesh(Vec3::new(x, 0.0, 0.0), [4.0, 7.0], [-6.0, 6.0], 60);
    Ok(from_mesh(
        "eye",
        "test",
        &mesh,
        &NonDesignOptions::default(),
        &Monitor::default(),
    )?)
}

fn assemble(brep: &Brep, bodies: &[NonDesignBody]) -> Result<CadSolid> {
    Ok(build(
        brep,
        bodies,
        &CadOptions::default(),
        &Monitor::default(),
    )?)
}

#[test]
fn block_alone() -> Result {
    let solid = assemble(&block(), &[])?;
    assert!(solid.valid, "{:?}", solid.messages);
    assert_eq!((solid.bodies, solid.faces, solid.genus), (1, 6, 0));
    assert!((solid.volume - 6400.0).abs() < 1e-6 && (solid.area - 2560.0).abs() < 1e-3);
    Ok(())
}

#[test]
fn cavity_and_second_body() -> Result {
    let cavity = cuboid(Vec3::new(-2.0, -2.0, -2.0), Vec3::new(2.0, 2.0, 2.0), true);
    let apart = cuboid(Vec3::new(30.0, 0.0, 0.0), Vec3::new(32.0, 1.0, 1.0), false);
    let solid = assemble(&joined(joined(block(), &cavity), &apart), &[])?;
    assert!(solid.valid, "{:?}", solid.messages);
    assert_eq!(solid.bodies, 2);
    assert!((solid.volume - (6400.0 - 64.0 + 2.0)).abs() < 1e-6);
    let misplaced = assemble(&joined(cavity, &apart), &[]);
    assert!(misplaced.is_err());
    Ok(())
}

#[test]
fn ring_is_united_and_its_bore_is_open() -> Result {
    // Half of the eye sticks out of the block's end.
    let bodies = ring(20.0)?;
    assert!(matches!(bodies[0].rebuilt, Rebuilt::Revolution { .. }));
    let solid = assemble(&block(), &bodies)?;
    assert!(solid.valid, "{:?}", solid.messages);
    assert_eq!((solid.bodies, solid.genus), (1, 1));
    // Block without the half disc of the eye, and the whole ring.
    let exact = 6400.0 - 0.5 * PI * 49.0 * 8.0 + PI * (49.0 - 16.0) * 12.0;
    assert!(
        (solid.volume - exact).abs() < 1e-3,
        "{} instead of {exact}",
        solid.volume
    );
    let eye = &solid.non_design[0];
    assert!(
        eye.kept && eye.coverage > 0.999 && eye.max_distance < 1e-6,
        "{eye:?}"
    );
    assert!((eye.bore_radii[0] - 4.0).abs() < 1e-9);
    let mesh = Solid::try_from(tessellate(&solid, 0.02)?)?;
    assert_eq!(mesh.euler(), 0);
    assert!((mesh.volume() - exact).abs() < 2e-3 * exact);
    Ok(())
}

#[test]
fn inner_edges_around_an_eye_get_fillets() -> Result {
    // The eye stands 2 mm out of both sides of the block.
    let bodies = ring(0.0)?;
    let (options, monitor) = (CadOptions::default(), Monitor::default());
    let sharp = assemble(&block(), &bodies)?;
    let (before, faces) = (sharp.volume, sharp.faces);
    let (round, fillets) = round_edges(sharp, &|_| 1.5, &bodies, &options, &monitor)?;
    assert_eq!(fillets.len(), 2);
    assert!(fillets.iter().all(|f| f.radius == Some(1.5)), "{fillets:?}");
    // Pappus and Guldin: what a quarter circle leaves of its square, at its centre of area.
    let (section, away) = (
        2.25 * (1.0 - PI / 4.0),
        1.5 * (10.0 - 3.0 * PI) / (12.0 - 3.0 * PI),
    );
    let exact = 2.0 * 2.0 * PI * (7.0 + away) * section;
    assert!(
        (round.volume - before - exact).abs() < 1e-3,
        "{}",
        round.volume - before
    );
    assert!(round.valid && round.non_design[0].kept && round.faces > faces);
    assert!(round.sources.contains(&FaceSource::Fillet));
    // Where none can be the edges stay sharp, with a reason.
    let (same, none) = round_edges(
        assemble(&block(), &bodies)?,
        &|_| 50.0,
        &bodies,
        &options,
        &monitor,
    )?;
    assert!((same.volume - before).abs() < 1e-9);
    assert!(
        none.iter()
            .all(|f| f.radius.is_none() && f.reason.is_some())
    );
    Ok(())
}

#[test]
fn organic_material_leaves_the_bore() -> Result {
    // The whole eye lies inside the block, which is thicker than the eye is high: the bore goes on into the block.
    let thick = cuboid(
        Vec3::new(-20.0, -10.0, -9.0),
        Vec3::new(20.0, 10.0, 9.0),
        false,
    );
    let solid = assemble(&thick, &ring(0.0)?)?;
    assert!(solid.valid, "{:?}", solid.messages);
    assert!((solid.volume - (14400.0 - PI * 16.0 * 18.0)).abs() < 1e-3);
    Ok(())
}

#[test]
fn loose_body_is_told() -> Result {
    let solid = assemble(&block(), &ring(60.0)?)?;
    assert!(!solid.valid);
    assert_eq!(solid.bodies, 2);
    assert!(
        solid
            .messages
            .iter()
            .any(|m| m.contains("does not overlap")),
        "{:?}",
        solid.messages
    );
    Ok(())
}

#[test]
fn step_is_complete_and_repeatable() -> Result {
    let folder = tempfile::tempdir()?;
    let solid = assemble(&block(), &ring(20.0)?)?;
    let options = StepOptions {
        product: "bracket".into(),
        time_stamp: "2026-01-01T00:00:00".into(),
        ..StepOptions::default()
    };
    let (one, two) = (folder.path().join("a.step"), folder.path().join("b.step"));
    write_step(&solid, &one, &options)?;
    write_step(&solid, &two, &options)?;
    let text = std::fs::read_to_string(&one)?;
    assert!(
        text == std::fs::read_to_string(&two)?,
        "two files of one part differ"
    );
    assert!(text.contains("AP242") && text.contains("'bracket'") && text.contains("'eye: bore'"));
    let back = read(&one, &NonDesignOptions::default(), &Monitor::default())?;
    assert_eq!(back.len(), 1);
    assert!((back[0].volume - solid.volume).abs() < 1e-6 * solid.volume);
    assert_eq!(std::fs::read_dir(folder.path())?.count(), 2);
    Ok(())
}

#[test]
fn bad_meshes_are_errors() {
    let mut open = ring_mesh(Vec3::zeros(), [4.0, 7.0], [0.0, 5.0], 24);
    open.triangles.pop();
    let run = |mesh: &TriMesh| {
        from_mesh(
            "x",
            "test",
            mesh,
            &NonDesignOptions::default(),
            &Monitor::default(),
        )
    };
    assert!(matches!(run(&open), Err(CadError::OpenMesh { .. })));
    assert!(matches!(
        run(&TriMesh::default()),
        Err(CadError::BadMesh { .. })
    ));
    open.points[0].x = f64::NAN;
    assert!(matches!(run(&open), Err(CadError::BadMesh { .. })));
}

#[test]
fn block_with_bore_from_a_mesh() -> Result {
    // The ring's outer wall with 4 facets is a square block with a round bore.
    let mut mesh = ring_mesh(Vec3::zeros(), [4.0, 9.0], [0.0, 10.0], 64);
    for p in &mut mesh.points {
        if p.xy().norm() > 5.0 {
            let scale = 9.0 / p.x.abs().max(p.y.abs());
            (p.x, p.y) = (p.x * scale, p.y * scale);
        }
    }
    let bodies = from_mesh(
        "block",
        "test",
        &mesh,
        &NonDesignOptions::default(),
        &Monitor::default(),
    )?;
    assert!(
        matches!(bodies[0].rebuilt, Rebuilt::Prismatic { .. }),
        "{:?}",
        bodies[0].rebuilt
    );
    assert!((bodies[0].volume - (3240.0 - PI * 160.0)).abs() < 1e-6);
    assert_eq!(bodies[0].bores.len(), 1);
    Ok(())
}

#[test]
fn wishbone_non_design_bodies() -> Result {
    let Some(corpus) = corpus() else {
        println!("skipped: no corpus");
        return Ok(());
    };
    let bodies = read(
        &corpus.join("wishbone/non_design.step"),
        &NonDesignOptions::default(),
        &Monitor::default(),
    )?;
    let exact = [
        PI * (196.0 - 81.0) * 18.0,
        PI * (196.0 - 81.0) * 18.0,
        PI * (324.0 - 169.0) * 24.0,
    ];
    assert_eq!(bodies.len(), 3);
    for (body, exact) in bodies.iter().zip(exact) {
        assert!((body.volume - exact).abs() < 1e-6 * exact);
        assert!(body.bores.len() == 1 && body.bores[0].through());
    }
    Ok(())
}

#[test]
fn bracket_rings_become_hollow_cylinders() -> Result {
    let Some(corpus) = corpus() else {
        println!("skipped: no corpus");
        return Ok(());
    };
    let mesh = read_stl(&corpus.join("dev/ge_solid_domain.stl")).ok_or("unreadable")?;
    let bodies = from_mesh(
        "ring",
        "stl",
        &mesh,
        &NonDesignOptions::default(),
        &Monitor::default(),
    )?;
    let mut radii: Vec<f64> = bodies
        .iter()
        .map(|b| (b.bores[0].radius * 1e3).round() / 1e3)
        .collect();
    radii.sort_by(f64::total_cmp);
    assert_eq!(radii, [5.156, 5.156, 5.156, 5.334, 9.557, 9.557]);
    assert!(
        bodies
            .iter()
            .all(|b| matches!(b.rebuilt, Rebuilt::Revolution { residual } if residual < 1e-4))
    );
    for name in ["topadd_bracket_FIX", "topadd_bracket_LOD"] {
        let mesh =
            read_stl(&corpus.join("dev").join(name).with_extension("stl")).ok_or("unreadable")?;
        let bodies = from_mesh(
            name,
            "stl",
            &mesh,
            &NonDesignOptions::default(),
            &Monitor::default(),
        )?;
        assert!(
            bodies
                .iter()
                .all(|b| (b.volume - PI * (144.0 - 64.0) * 20.0).abs() < 1e-2)
        );
    }
    Ok(())
}

#[test]
fn bad_step_files_are_errors() {
    let Some(corpus) = corpus() else {
        println!("skipped: no corpus");
        return;
    };
    for name in [
        "36_step_truncated.step",
        "37_step_dangling_ref.step",
        "35_png_named.stl",
    ] {
        let result = read(
            &corpus.join("bad").join(name),
            &NonDesignOptions::default(),
            &Monitor::default(),
        );
        assert!(result.is_err(), "{name}");
    }
}
