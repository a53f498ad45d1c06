//! The STEP file as a reader sees it that shares no code with the kernel that wrote it (truck).
#![cfg(feature = "occt")]

#[path = "spline/shapes.rs"]
#[allow(dead_code, reason = "only some shapes are needed here")]
mod shapes;

use std::path::Path;

use grassfire::Vec3;
use grassfire::cad::{
    CadOptions, NonDesignBody, NonDesignOptions, StepOptions, build, from_mesh, write_step,
};
use grassfire::mesh::TriMesh;
use grassfire::monitor::Monitor;
use grassfire::spline::{
    BrepOptions, ControlMesh, FaceMode, Patch, PatchOptions, build_brep, evaluate, patches,
};
use truck_stepio::r#in::Table;
use truck_stepio::r#in::alias::{ParametricSurface, Surface};

type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Two readings of one point are nearer than this, mm.
const SAME: f64 = 1e-9;

/// The faces of the only shell of a STEP file, as truck reads them.
fn surfaces(path: &Path) -> Result<Vec<Surface>> {
    let table = Table::from_step(&std::fs::read_to_string(path)?).ok_or("truck reads nothing")?;
    let shell = table.shell.values().next().ok_or("no shell")?;
    assert_eq!(table.shell.len(), 1);
    let shell = table.to_compressed_shell(shell)?;
    Ok(shell.faces.into_iter().map(|face| face.surface).collect())
}

fn at(surface: &Surface, u: f64, v: f64) -> Vec3 {
    let p = surface.subs(u, v);
    Vec3::new(p.x, p.y, p.z)
}

/// A body of some 10 mm, its patches, and the faces of its STEP file beside the number that we count.
fn written(
    mesh: &ControlMesh,
    mode: FaceMode,
    bodies: &[NonDesignBody],
) -> Result<(Vec<Patch>, Vec<Surface>, usize)> {
    let monitor = Monitor::default();
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("part.step");
    let faces = patches(mesh, &PatchOptions::default(), &monitor)?;
    let options = BrepOptions {
        faces: mode,
        ..BrepOptions::default()
    };
    let brep = build_brep(mesh, &faces, &options, &monitor)?;
    let solid = build(&brep, bodies, &CadOptions::default(), &monitor)?;
    assert!(solid.valid, "{:?}", solid.messages);
    write_step(&solid, &path, &StepOptions::default())?;
    Ok((faces, surfaces(&path)?, solid.faces))
}

fn body() -> ControlMesh {
    let mut mesh = shapes::bracket();
    shapes::jitter(&mut mesh, 0.05, 3);
    mesh.points.iter_mut().for_each(|p| *p *= 10.0);
    mesh
}

/// Distance of the nearest of `points`.
fn nearest(points: &[Vec3], p: &Vec3) -> f64 {
    points
        .iter()
        .map(|q| (q - p).norm())
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn every_patch_evaluates_to_the_same_points() -> Result {
    let (ours, theirs, counted) = written(&body(), FaceMode::Quads, &[])?;
    assert_eq!((theirs.len(), counted), (ours.len(), ours.len()));
    const STEPS: u32 = 4;
    let parameters = || (0..=STEPS).map(|k| f64::from(k) / f64::from(STEPS));
    let grid = |f: &dyn Fn(f64, f64) -> Vec3| -> Vec<Vec3> {
        parameters()
            .flat_map(|u| parameters().map(move |v| (u, v)))
            .map(|(u, v)| f(u, v))
            .collect()
    };
    for patch in &ours {
        let wanted = grid(&|u, v| evaluate(patch, u, v).position);
        let off = |surface: &Surface| {
            let have = grid(&|u, v| at(surface, u, v));
            wanted
                .iter()
                .zip(&have)
                .map(|(a, b)| (a - b).norm())
                .fold(0.0, f64::max)
        };
        let least = theirs.iter().map(off).fold(f64::INFINITY, f64::min);
        assert!(
            least < SAME,
            "the best face of the file is {least:e} mm off"
        );
    }
    Ok(())
}

#[test]
fn every_block_holds_the_middles_of_its_patches() -> Result {
    let (ours, theirs, counted) = written(&body(), FaceMode::Exact, &[])?;
    assert_eq!(theirs.len(), counted);
    assert!(counted < ours.len());
    let middles: Vec<Vec3> = ours
        .iter()
        .map(|p| evaluate(p, 0.5, 0.5).position)
        .collect();
    let mut met = 0;
    for surface in &theirs {
        let Surface::BSplineSurface(spline) = surface else {
            return Err("a face of the body is no B-spline".into());
        };
        // Knots 0..=n with multiplicities 6, 4, .., 4, 6.
        let spans = |n: usize| (n - 8) / 4;
        let [m, n] = [
            spans(spline.uknot_vec().len()),
            spans(spline.vknot_vec().len()),
        ];
        for (i, j) in (0..m).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let p = at(surface, i as f64 + 0.5, j as f64 + 0.5);
            let off = nearest(&middles, &p);
            assert!(off < SAME, "cell {i}, {j} is {off:e} mm off");
            met += 1;
        }
    }
    assert_eq!(met, ours.len(), "cells of all blocks");
    Ok(())
}

/// A turned sleeve about z.
fn sleeve(centre: Vec3, radii: [f64; 2], half: f64) -> TriMesh {
    const FACETS: u32 = 72;
    let mut mesh = TriMesh::default();
    for k in 0..FACETS {
        let (s, c) = (std::f64::consts::TAU * f64::from(k) / f64::from(FACETS)).sin_cos();
        for (r, z) in [
            (radii[1], -half),
            (radii[1], half),
            (radii[0], half),
            (radii[0], -half),
        ] {
            mesh.points.push(centre + Vec3::new(r * c, r * s, z));
        }
        let next = (k + 1) % FACETS;
        for j in 0..4 {
            let m = (j + 1) % 4;
            let (a, b, c, d) = (4 * k + j, 4 * next + j, 4 * next + m, 4 * k + m);
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

#[test]
fn a_bore_is_a_cylinder_of_its_radius_for_others_too() -> Result {
    let centre = Vec3::new(5.0, 5.0, 5.0);
    let radii = [2.0, 6.0];
    let bodies = from_mesh(
        "eye",
        "test",
        &sleeve(centre, radii, 40.0),
        &NonDesignOptions::default(),
        &Monitor::default(),
    )?;
    let (_, theirs, counted) = written(&body(), FaceMode::Exact, &bodies)?;
    assert_eq!(theirs.len(), counted);
    let walls: Vec<f64> = theirs
        .iter()
        .filter(|s| matches!(s, Surface::ElementarySurface(_)))
        .filter_map(|s| {
            let spread = |p: Vec3| (p - centre).xy().norm();
            let all: Vec<f64> = (0..8)
                .map(|k| spread(at(s, f64::from(k), f64::from(k % 3))))
                .collect();
            all.iter()
                .all(|r| (r - all[0]).abs() < SAME)
                .then_some(all[0])
        })
        .collect();
    for radius in radii {
        assert!(
            walls.iter().any(|r| (r - radius).abs() < 1e-6),
            "no wall of {radius} mm: {walls:?}"
        );
    }
    Ok(())
}
