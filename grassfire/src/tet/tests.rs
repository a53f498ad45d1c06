//! Tetrahedra against exact solutions, benchmarks and CalculiX.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::process::Command;

use super::conditions::{boundary, quadrature};
use super::*;

/// A block of `n` hexahedra, each of six tetrahedra (Kuhn), put into place by a map of the unit cube.
fn block(n: [usize; 3], place: impl Fn(Vec3) -> Vec3) -> TetMesh {
    let counts = n.map(|n| 2 * n + 1);
    let node = |[x, y, z]: [usize; 3]| ((z * counts[1] + y) * counts[0] + x) as u32;
    let mut mesh = TetMesh::default();
    for z in 0..counts[2] {
        for y in 0..counts[1] {
            for x in 0..counts[0] {
                let part = |i: usize, d: usize| i as f64 / (counts[d] - 1) as f64;
                mesh.points
                    .push(place(Vec3::new(part(x, 0), part(y, 1), part(z, 2))));
            }
        }
    }
    for cell in 0..n.iter().product() {
        let at = [cell % n[0], cell / n[0] % n[1], cell / (n[0] * n[1])];
        for order in [
            [0, 1, 2],
            [1, 2, 0],
            [2, 0, 1],
            [0, 2, 1],
            [2, 1, 0],
            [1, 0, 2],
        ] {
            let mut corners = [at.map(|i| 2 * i); 4];
            for k in 0..3 {
                corners[k + 1] = corners[k];
                corners[k + 1][order[k]] += 2;
            }
            let [p, q, r, s] = corners.map(|c| mesh.points[node(c) as usize]);
            if (q - p).cross(&(r - p)).dot(&(s - p)) < 0.0 {
                corners.swap(2, 3);
            }
            let middle =
                |[i, j]: [usize; 2]| [0, 1, 2].map(|d| (corners[i][d] + corners[j][d]) / 2);
            let middles = EDGES.map(middle);
            let all: Vec<u32> = corners.into_iter().chain(middles).map(node).collect();
            mesh.cells.push(all.try_into().expect("ten nodes"));
        }
    }
    mesh
}

/// Forces of a traction (N/mm2 as a function of place and outward normal) on the faces whose nodes all lie `on` a surface.
fn traction(
    mesh: &TetMesh,
    on: impl Fn(&Vec3) -> bool,
    pull: impl Fn(&Vec3, &Vec3) -> Vec3,
) -> Vec<(u32, Vec3)> {
    let mut sums: BTreeMap<u32, Vec3> = BTreeMap::new();
    let whole = |f: &[u32; 6]| f.iter().all(|&n| on(&mesh.points[n as usize]));
    for face in boundary(mesh).into_iter().filter(|f| whole(f)) {
        for point in quadrature(mesh, &face) {
            let force = pull(&point.place, &point.area.normalize()) * point.area.norm();
            for (&node, shape) in point.face.iter().zip(point.shape) {
                *sums.entry(node).or_default() += shape * force;
            }
        }
    }
    sums.into_iter().collect()
}

/// Holds a component of the nodes on a surface.
fn hold(mesh: &TetMesh, on: impl Fn(&Vec3) -> bool, axis: usize) -> Vec<(u32, usize)> {
    let held = (0..mesh.points.len()).filter(|&n| on(&mesh.points[n]));
    held.map(|n| (n as u32, axis)).collect()
}

fn loaded(
    fixed: Vec<Vec<(u32, usize)>>,
    forces: Vec<(u32, Vec3)>,
    young: f64,
    nu: f64,
) -> TetModel {
    let mut fixed = fixed.concat();
    fixed.sort_unstable();
    fixed.dedup();
    let name = "one".to_owned();
    TetModel {
        fixed,
        springs: Vec::new(),
        cases: vec![TetLoads {
            name,
            weight: 1.0,
            forces,
        }],
        young,
        nu,
    }
}

fn solved(mesh: &TetMesh, model: &TetModel) -> TetResult {
    let options = TetOptions {
        tolerance: 1e-11,
        ..TetOptions::default()
    };
    solve(mesh, model, &options, &Monitor::default()).expect("a solution")
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}

/// A box of 6 x 2 x 3 mm whose inner nodes are moved: straight edges, but no two elements alike.
fn crooked() -> TetMesh {
    let mut mesh = block([6, 2, 3], |p| {
        let bump: f64 = p.iter().map(|x| x * (1.0 - x)).product();
        p.component_mul(&Vec3::new(6.0, 2.0, 3.0)) + Vec3::new(15.0, -7.0, 10.0) * bump
    });
    for cell in &mesh.cells {
        for (e, ends) in EDGES.into_iter().enumerate() {
            let [a, b] = ends.map(|i| mesh.points[cell[i] as usize]);
            mesh.points[cell[4 + e] as usize] = (a + b) / 2.0;
        }
    }
    mesh
}

#[test]
fn even_tension_is_exact_on_crooked_elements() {
    let mesh = crooked();
    let (young, nu, pull) = (70_000.0, 0.3, 50.0);
    let fixed = (0..3)
        .map(|d| hold(&mesh, |p| near(p[d], 0.0), d))
        .collect();
    let forces = traction(&mesh, |p| near(p.x, 6.0), |_, n| pull * n);
    let out = solved(&mesh, &loaded(fixed, forces, young, nu));
    let case = &out.cases[0];
    let strain = pull / young;
    for (p, u) in mesh.points.iter().zip(&case.displacement) {
        let exact = strain * Vec3::new(p.x, -nu * p.y, -nu * p.z);
        assert!((u - exact).norm() < 1e-9 * strain * 6.0, "{u} {exact}");
    }
    let exact = 0.5 * pull * strain * 36.0;
    assert!((case.strain_energy / exact - 1.0).abs() < 1e-10);
    assert!((case.half_work / exact - 1.0).abs() < 1e-10);
    assert!((out.volume / 36.0 - 1.0).abs() < 1e-12);
    assert!(case.reaction_error < 1e-9, "{}", case.reaction_error);
    assert!((case.stress_max / pull - 1.0).abs() < 1e-7);
}

/// Beam theory with shear; no Poisson's ratio, so that the clamp does not stiffen.
#[test]
fn cantilever_with_shear_is_right_to_one_percent() {
    let (l, b, h) = (48.0, 4.0, 8.0);
    let mesh = block([24, 2, 4], |p| p.component_mul(&Vec3::new(l, b, h)));
    let fixed = (0..3).map(|d| hold(&mesh, |p| near(p.x, 0.0), d)).collect();
    let down = Vec3::new(0.0, 0.0, -100.0 / (b * h));
    let forces = traction(&mesh, |p| near(p.x, l), |_, _| down);
    let out = solved(&mesh, &loaded(fixed, forces, 70_000.0, 0.0));
    let (e, g, i, a) = (70_000.0, 35_000.0, b * h.powi(3) / 12.0, b * h);
    let deflection = 100.0 * l.powi(3) / (3.0 * e * i) + 6.0 * 100.0 * l / (5.0 * g * a);
    let u = out.cases[0].strain_energy * 2.0 / 100.0;
    assert!((u / deflection - 1.0).abs() < 0.01, "{u} {deflection}");
}

/// Lame's thick-walled cylinder, a quarter of it: the error of the energy falls at least with the third power of the size.
#[test]
fn cylinder_under_pressure_converges() {
    let (inner, outer, length, pressure, e, nu) = (8.0, 16.0, 4.0, 10.0, 70_000.0, 0.3);
    let error = |n: usize| {
        let mesh = block([n, 2 * n, 1], |p| {
            let (r, angle) = (inner + (outer - inner) * p.x, FRAC_PI_2 * p.y);
            Vec3::new(r * angle.cos(), r * angle.sin(), length * p.z)
        });
        let fixed = vec![
            hold(&mesh, |p| near(p.y, 0.0), 1),
            hold(&mesh, |p| near(p.x, 0.0), 0),
            hold(&mesh, |p| near(p.z, 0.0), 2),
        ];
        let bore = |p: &Vec3| near(p.xy().norm(), inner);
        let forces = traction(&mesh, bore, |_, n| -pressure * n);
        let out = solved(&mesh, &loaded(fixed, forces, e, nu));
        let k = inner * inner / (outer * outer - inner * inner);
        let u = pressure * k / e * ((1.0 - nu) * inner + (1.0 + nu) * outer * outer / inner);
        let exact = 0.5 * pressure * u * FRAC_PI_2 * inner * length;
        (out.cases[0].strain_energy / exact - 1.0).abs()
    };
    let errors = [2, 4, 8].map(error);
    println!("relative errors of the energy at 2, 4, 8 elements across the wall: {errors:?}");
    assert!(
        errors[1] < errors[0] / 8.0 && errors[2] < errors[1] / 8.0,
        "{errors:?}"
    );
    assert!(errors[2] < 1e-4, "{errors:?}");
}

/// The quarter of an elliptic plate of NAFEMS LE1 and LE10, m and MPa: semi-axes 2 and 1 inside, 3.25 and 2.75 outside.
fn ellipse(n: [usize; 3], thickness: f64) -> TetMesh {
    block(n, |p| {
        let (c, s) = ((FRAC_PI_2 * p.y).cos(), (FRAC_PI_2 * p.y).sin());
        let inside = Vec3::new(2.0 * c, s, 0.0);
        let outside = Vec3::new(3.25 * c, 2.75 * s, 0.0);
        inside + p.x * (outside - inside) + Vec3::new(0.0, 0.0, thickness * p.z)
    })
}

fn on_outer_edge(p: &Vec3) -> bool {
    near((p.x / 3.25).powi(2) + (p.y / 2.75).powi(2), 1.0)
}

/// Stress along y at (2, 0) and a height.
fn stress_at_d(mesh: &TetMesh, out: &TetResult, z: f64) -> f64 {
    let d = Vec3::new(2.0, 0.0, z);
    let node = mesh.points.iter().position(|p| (p - d).norm() < 1e-9);
    out.cases[0].stress[node.expect("a node at D")][(1, 1)]
}

/// NAFEMS, The standard NAFEMS benchmarks, 1990: 92.7 MPa.
#[test]
fn nafems_le1_elliptic_membrane_is_right_to_two_percent() {
    let mesh = ellipse([20, 32, 1], 0.1);
    let fixed = vec![
        hold(&mesh, |p| near(p.y, 0.0), 1),
        hold(&mesh, |p| near(p.x, 0.0), 0),
        hold(&mesh, |p| near(p.z, 0.0), 2),
    ];
    let forces = traction(&mesh, on_outer_edge, |_, n| 10.0 * n);
    let out = solved(&mesh, &loaded(fixed, forces, 210e3, 0.3));
    let stress = stress_at_d(&mesh, &out, 0.0);
    println!("LE1: {stress:.2} MPa");
    assert!((stress / 92.7 - 1.0).abs() < 0.02, "{stress}");
}

/// NAFEMS, The standard NAFEMS benchmarks, 1990: -5.38 MPa.
#[test]
fn nafems_le10_thick_plate_is_right_to_two_percent() {
    let mesh = ellipse([16, 24, 4], 0.6);
    let fixed = vec![
        hold(&mesh, |p| near(p.y, 0.0), 1),
        hold(&mesh, |p| near(p.x, 0.0), 0),
        hold(&mesh, on_outer_edge, 0),
        hold(&mesh, on_outer_edge, 1),
        hold(&mesh, |p| on_outer_edge(p) && near(p.z, 0.3), 2),
    ];
    let forces = traction(&mesh, |p| near(p.z, 0.6), |_, n| -n);
    let out = solved(&mesh, &loaded(fixed, forces, 210e3, 0.3));
    let stress = stress_at_d(&mesh, &out, 0.6);
    println!("LE10: {stress:.3} MPa");
    assert!((stress / -5.38 - 1.0).abs() < 0.02, "{stress}");
}

/// The project's supports and loads reach the mesh, and CalculiX finds the same energy on it.
#[test]
fn calculix_finds_the_same_energy() {
    let good = r#"
units = "mm-N-MPa"
[grid]
h = 1.0
[material]
young = 70000.0
nu = 0.3
density = 2.7e-9
[design]
space = [{ box = { min = [0, 0, 0], max = [6, 2, 3] } }]
[select]
left = { plane = { point = [0, 0, 0], normal = [1, 0, 0] } }
right = { plane = { point = [6, 0, 0], normal = [1, 0, 0] } }
[[support]]
on = "left"
fix = "xyz"
[[case]]
name = "end"
loads = [{ on = "right", force = [10.0, 20.0, -100.0] }]
[[case]]
name = "twist"
gravity = [0, 9e8, 0]
loads = [{ on = "right", moment = [300.0, 0.0, 0.0] }]
[optimize]
volume_fraction = 0.5
"#;
    let slanting = "spring = { stiffness = 9000 }\n[[support]]\non = \"left\"\nroller = [3, 1, -1]";
    for support in ["fix = \"xyz\"", slanting] {
        let text = good.replace("fix = \"xyz\"", support);
        let case = Case::parse("case.toml", &text, Path::new(".")).expect("a case");
        let mesh = crooked();
        let model = model(&case, Path::new("."), &mesh, &Monitor::default()).expect("a model");
        let sum: Vec3 = model.cases[0].forces.iter().map(|(_, f)| f).sum();
        assert!((sum - Vec3::new(10.0, 20.0, -100.0)).norm() < 1e-9, "{sum}");
        let sum: Vec3 = model.cases[1].forces.iter().map(|(_, f)| f).sum();
        assert!((sum.y / (2.7e-9 * 36.0 * 9e8) - 1.0).abs() < 1e-9, "{sum}");
        let out = solved(&mesh, &model);
        for case in &out.cases {
            assert!((case.half_work / case.strain_energy - 1.0).abs() < 1e-7);
            assert!(case.reaction_error < 1e-7, "{}", case.reaction_error);
        }
        compare_with_calculix(&mesh, &model, &out);
    }
}

fn compare_with_calculix(mesh: &TetMesh, model: &TetModel, out: &TetResult) {
    let folder = tempfile::tempdir().expect("a folder");
    let deck = folder.path().join("part.inp");
    write_deck(&deck, mesh, model, "box").expect("a deck");
    let options = TetOptions::default();
    if Command::new(&options.ccx).arg("-v").output().is_err() {
        println!("skipped: no ccx (Debian: apt-get install calculix-ccx)");
        return;
    }
    let theirs = run_calculix(&deck, 2, &options, &Monitor::default()).expect("CalculiX runs");
    for (ours, theirs) in out.cases.iter().zip(&theirs.energies) {
        println!(
            "{}: {} against {theirs} N mm",
            ours.name, ours.strain_energy
        );
        assert!((ours.strain_energy / theirs - 1.0).abs() < 1e-6);
    }
}

#[test]
fn what_cannot_be_solved_is_refused() {
    let mesh = crooked();
    let fixed = (0..3)
        .map(|d| hold(&mesh, |p| near(p[d], 0.0), d))
        .collect();
    let forces = traction(&mesh, |p| near(p.x, 6.0), |_, n| *n);
    let model = loaded(fixed, forces, 1.0, 0.3);
    let mut turned = mesh.clone();
    // Corners 0 and 1 change places, and with them the middles 12 and 20, 03 and 13.
    for (a, b) in [(0, 1), (5, 6), (7, 8)] {
        turned.cells[7].swap(a, b);
    }
    let run = |mesh: &TetMesh, options: &TetOptions| {
        let found = solve(mesh, &model, options, &Monitor::default());
        found.map(|out| out.strain_energy).expect_err("refused")
    };
    let options = TetOptions::default();
    assert!(matches!(
        run(&turned, &options),
        TetError::Inverted { cell: 7, .. }
    ));
    let hasty = TetOptions {
        max_iterations: 1,
        ..options.clone()
    };
    assert!(matches!(run(&mesh, &hasty), TetError::NotConverged { .. }));
    let missing = TetOptions {
        gmsh: "no-such-gmsh".to_owned(),
        ..options.clone()
    };
    let folder = tempfile::tempdir().expect("a folder");
    let step = folder.path().join("part.step");
    std::fs::write(&step, "ISO-10303-21;").expect("a file");
    let error = mesh_step(&step, 1.0, &missing, &Monitor::default()).expect_err("refused");
    assert!(matches!(error, TetError::Program { .. }), "{error}");
    assert!(
        error
            .hint()
            .is_some_and(|h| h.contains("apt-get install gmsh"))
    );
    let stl = mesh_step(Path::new("part.stl"), 1.0, &options, &Monitor::default());
    assert!(matches!(stl, Err(TetError::NoStep { .. })));
}

#[test]
fn meshes_of_gmsh_are_read_and_broken_ones_refused() {
    let nodes: String = (1..=10)
        .map(|i| format!("{} {i} 0 {}\n", 3 * i, i * i))
        .collect();
    let text = |element: &str| {
        format!(
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n10\n{nodes}$EndNodes\n$Elements\n2\n1 15 2 0 1 3\n{element}\n$EndElements\n"
        )
    };
    let good = text("2 11 2 1 1 3 6 9 12 15 18 21 24 27 30");
    let mesh = gmsh::parse("gmsh", &good).expect("a mesh");
    assert_eq!(mesh.cells, [[0, 1, 2, 3, 4, 5, 6, 7, 9, 8]]);
    assert_eq!(mesh.points[9], Vec3::new(10.0, 0.0, 100.0));
    let short = text("2 11 2 1 1 3 6 9 12 15 18 21 24 27");
    let foreign = text("2 11 2 1 1 3 6 9 12 15 18 21 24 27 31");
    let early = &good[..good.len() - 60];
    for bad in [
        &short,
        &foreign,
        early,
        "",
        "$Nodes\nx\n",
        "$Nodes\n1\n1 a 0 0\n",
    ] {
        let error = gmsh::parse("gmsh", bad).expect_err("refused");
        assert!(matches!(error, TetError::Mesh { .. }), "{error}");
    }
}

/// The displacements of a hanging bar are quadratic, as the elements are.
#[test]
fn a_bar_under_its_own_weight_is_exact() {
    let text = r#"
units = "mm-N-MPa"
grid.h = 1.0
[material]
young = 70000.0
nu = 0.0
density = 7.85e-9
[design]
space = [{ box = { min = [0, 0, 0], max = [6, 2, 3] } }]
[select]
left = { plane = { point = [0, 0, 0], normal = [1, 0, 0] } }
[[support]]
on = "left"
fix = "xyz"
[[case]]
name = "weight"
gravity = [9.81e6, 0, 0]
"#;
    let case = Case::parse("case.toml", text, Path::new(".")).unwrap();
    let mesh = crooked();
    let model = model(&case, Path::new("."), &mesh, &Monitor::default()).unwrap();
    let out = solved(&mesh, &model);
    let pull = 9.81e6 * 7.85e-9;
    let exact = pull * pull * 6.0 * 6f64.powi(3) / (6.0 * 70_000.0);
    assert!((out.strain_energy / exact - 1.0).abs() < 1e-8);
    assert!(out.cases[0].reaction_error < 1e-8);
}
