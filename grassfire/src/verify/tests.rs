//! Partial volumes and loads by their invariants, solutions by exact ones.

use std::collections::BTreeMap;

use nalgebra::{Rotation3, Unit};

use super::conditions::{ActiveNodes, Conditions, Pieces, spread};
use super::*;
use crate::case::{Load, LoadPlace, Spring, forces_on};
use crate::mesh::shapes;
use crate::remesh::split_long_edges;

const SOLVER: SolverOptions = SolverOptions {
    tolerance: 1e-7,
    max_iterations: 400,
    smoother_degree: 2,
    smoother_ratio: 6.0,
    coarsest: 5000,
    max_memory: 16_000.0,
};

/// A direction along no axis and no plane of voxels.
fn oblique() -> Rotation3<f64> {
    let to = Unit::new_normalize(Vec3::new(0.23, 0.37, 1.0));
    Rotation3::rotation_between(&Vec3::z(), &to).expect("not opposite")
}

/// A tube along z from 0 to `length`, turned.
fn tube(inner: f64, outer: f64, length: f64, turn: &Rotation3<f64>) -> TriMesh {
    const N: u32 = 256;
    let mut mesh = TriMesh::default();
    // Circles of the same area as the polygon: the exact solution is about those.
    let step = std::f64::consts::TAU / f64::from(N);
    let fit = (step / step.sin()).sqrt();
    for (radius, z) in [(inner, 0.0), (outer, 0.0), (outer, length), (inner, length)] {
        for k in 0..N {
            let angle = step * f64::from(k);
            let p = Vec3::new(fit * radius * angle.cos(), fit * radius * angle.sin(), z);
            mesh.points.push(turn * p + Vec3::new(0.137, -0.291, 0.053));
        }
    }
    for ring in 0..4 {
        for k in 0..N {
            let at = |r: u32, k: u32| r % 4 * N + k % N;
            let [a, b, c, d] = [
                at(ring, k),
                at(ring, k + 1),
                at(ring + 1, k + 1),
                at(ring + 1, k),
            ];
            mesh.triangles.extend([[a, c, b], [a, d, c]]);
        }
    }
    if mesh.volume() < 0.0 {
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    mesh
}

/// A grid around a mesh, off its planes.
fn grid(mesh: &TriMesh, h: f64) -> Fractions {
    let (low, high) = mesh.bounds().unwrap();
    let origin = low - Vec3::new(1.3, 1.6, 1.2) * h;
    let dims = [0, 1, 2].map(|d| ((high[d] - origin[d]) / h).ceil() as usize + 1);
    fractions(mesh, origin, h, dims, 4).unwrap()
}

#[test]
fn volumes_are_those_of_the_triangles() {
    let box_ = shapes::cuboid(Vec3::new(-1.3, 0.2, 0.1), Vec3::new(5.1, 3.7, 2.9));
    let round = tube(2.0, 4.0, 5.0, &oblique());
    for mesh in [&box_, &round] {
        let grid = grid(mesh, 0.4);
        let ratio = grid.volume() / mesh.volume();
        assert!((ratio - 1.0).abs() < 5e-3, "{ratio}");
        assert!(grid.values.iter().all(|f| (0.0..=1.0).contains(f)));
    }
    let exact = std::f64::consts::PI * (16.0 - 4.0) * 5.0;
    assert!((round.volume() / exact - 1.0).abs() < 1e-3);
    let mut open = box_;
    open.triangles.truncate(10);
    let found = fractions(&open, Vec3::new(-2.0, -1.0, -1.0), 0.4, [20, 14, 12], 4);
    assert!(matches!(
        found,
        Err(VerifyError::Open { .. } | VerifyError::Empty)
    ));
}

#[test]
fn loads_on_the_surface_keep_force_and_moment() {
    let mesh = tube(2.0, 4.0, 5.0, &oblique());
    let grid = grid(&mesh, 0.5);
    let active = ActiveNodes::new(&grid);
    let pieces = Pieces::new(&mesh, grid.h);
    let places = pieces.all();
    let area: f64 = places.iter().map(|p| p.weight).sum();
    assert!((area / mesh.area() - 1.0).abs() < 1e-10, "{area}");
    let forces: Vec<Vec3> = places
        .iter()
        .map(|p| Vec3::new(p.place.y, 1.0, -p.place.x * p.place.z) * p.weight)
        .collect();
    let mut sums = BTreeMap::new();
    spread(&grid, &active, &places, &forces, &mut sums);
    let (mut force, mut moment, mut size) = (Vec3::zeros(), Vec3::zeros(), 0.0);
    for (p, f) in places.iter().zip(&forces) {
        force += f;
        moment += p.place.cross(f);
        size += f.norm();
    }
    for ([z, y, x], f) in &sums {
        force -= f;
        moment -= grid.node_place([*x, *y, *z]).cross(f);
    }
    assert!(force.norm() < 1e-9 * size, "{force}");
    // Pieces in slivers of which no line meets the voxel move to the other corners.
    assert!(moment.norm() < 2e-3 * size * grid.h, "{moment} {size}");
}

/// A case of a box, clamped at x = 0 and loaded at its other end.
fn box_case(size: [f64; 3], nu: f64, force: [f64; 3]) -> Case {
    let text = format!(
        r#"
units = "mm-N-MPa"
[grid]
h = {h}
[material]
young = 70000.0
nu = {nu}
[design]
space = [{{ box = {{ min = [0, 0, 0], max = {size:?} }} }}]
[select]
left = {{ plane = {{ point = [0, 0, 0], normal = [1, 0, 0] }} }}
right = {{ plane = {{ point = [{x}, 0, 0], normal = [1, 0, 0] }} }}
[[support]]
on = "left"
fix = "xyz"
[[case]]
name = "end"
loads = [{{ on = "right", force = {force:?} }}]
[optimize]
volume_fraction = 0.5
"#,
        x = size[0],
        h = size[2] / 8.0
    );
    Case::parse("case.toml", &text, Path::new(".")).unwrap()
}

/// Beam theory with shear; no Poisson's ratio, so that the clamp does not stiffen.
#[test]
fn cantilever_with_shear_is_right_to_one_percent() {
    let (l, b, height) = (48.0, 4.0, 8.0);
    let mut case = box_case([l, b, height], 0.0, [0.0, 0.0, -100.0]);
    case.verify.h = Some(1.0);
    case.verify.equal_volume = Some(l * b * height * 1.05);
    let mesh = shapes::cuboid(Vec3::zeros(), Vec3::new(l, b, height));
    let out = verify(&case, Path::new("."), &mesh, None, &Monitor::default()).unwrap();
    let (e, g) = (70_000.0, 35_000.0);
    let (i, a) = (b * height.powi(3) / 12.0, b * height);
    let deflection = 100.0 * l.powi(3) / (3.0 * e * i) + 6.0 * 100.0 * l / (5.0 * g * a);
    let u = out.fine.strain_energy * 2.0 / 100.0;
    assert!((u / deflection - 1.0).abs() < 0.01, "{u} {deflection}");
    assert!((out.fine.u_max() / deflection - 1.0).abs() < 0.015);
    assert!(
        out.fine.reaction_error() < 1e-5,
        "{}",
        out.fine.reaction_error()
    );
    let estimate = out.energy_error_estimate();
    assert!(estimate > 1e-3 && estimate < 0.05, "{estimate}");
    // More metal on all sides makes it stiffer, about with the cube of the height.
    let equal = out.equal.expect("an offset is found");
    assert!(equal.offset > 0.0 && equal.offset < 0.2, "{equal:?}");
    let ratio = equal.strain_energy / out.fine.strain_energy;
    assert!(ratio < 0.97 && ratio > 0.85, "{ratio}");
}

/// A bar that hangs on its left face under its own weight: `E u' = rho g (L - x)`.
#[test]
fn a_bar_under_its_own_weight_is_as_long_as_it_should_be() {
    let mut case = box_case([12.0, 4.0, 4.0], 0.0, [1.0, 0.0, 0.0]);
    case.case[0].loads.clear();
    case.case[0].gravity = Some([9.81e6, 0.0, 0.0]);
    case.material.density = Some(7.85e-9);
    case.check().unwrap();
    let mesh = shapes::cuboid(Vec3::zeros(), Vec3::new(12.0, 4.0, 4.0));
    let pull = 9.81e6 * 7.85e-9;
    let exact = pull * pull * 16.0 * 12f64.powi(3) / (6.0 * 70_000.0);
    let longer = pull * 144.0 / (2.0 * 70_000.0);
    // Whole voxels, and cut ones of which a third carries and weighs.
    for (h, near) in [(1.0, 6e-3), (1.5, 2e-2)] {
        case.verify.h = Some(h);
        let out = verify(&case, Path::new("."), &mesh, None, &Monitor::default()).unwrap();
        let ratio = out.fine.strain_energy / exact;
        assert!((ratio - 1.0).abs() < near, "{h}: {ratio}");
        let ratio = out.fine.u_max() / longer;
        assert!((ratio - 1.0).abs() < near, "{h}: {ratio}");
        let error = out.fine.reaction_error();
        assert!(error < 1e-5, "{h}: {error}");
    }
}

#[test]
fn a_bar_on_springs_gives_way_with_them_but_takes_its_own_energy_only() {
    let mut case = box_case([12.0, 4.0, 4.0], 0.0, [1000.0, 0.0, 0.0]);
    case.support[0].fix.clear();
    case.support[0].spring = Some(Spring {
        stiffness: 5000.0,
        along: None,
    });
    case.check().unwrap();
    let mesh = shapes::cuboid(Vec3::zeros(), Vec3::new(12.0, 4.0, 4.0));
    let exact = 0.5 * 1000.0 * 1000.0 * 12.0 / (70_000.0 * 16.0);
    case.verify.h = Some(1.0);
    let out = verify(&case, Path::new("."), &mesh, None, &Monitor::default()).unwrap();
    for found in [&out.coarse, &out.fine] {
        assert!((found.strain_energy / exact - 1.0).abs() < 1e-4);
        assert!((found.u_max() - 0.2 - 2.0 * exact / 1000.0).abs() < 1e-4);
        assert!(found.reaction_error() < 1e-5);
    }
}

/// A bar with a neck, thinned until the neck tears: the bar itself is proved all the same.
#[test]
fn a_part_that_tears_at_equal_volume_is_proved_without_that() {
    let mut case = box_case([48.0, 4.0, 8.0], 0.0, [1000.0, 0.0, 0.0]);
    case.verify.h = Some(1.0);
    case.verify.equal_volume = Some(650.0);
    let bar = shapes::cuboid(Vec3::zeros(), Vec3::new(48.0, 4.0, 8.0));
    let mut mesh = split_long_edges(&bar, 1.0);
    for p in &mut mesh.points {
        let neck = 1.0 - 0.8 * (-((p.x - 24.0) / 6.0).powi(2)).exp();
        p.y = 2.0 + neck * (p.y - 2.0);
        p.z = 4.0 + neck * (p.z - 4.0);
    }
    let monitor = Monitor::default();
    let out = verify(&case, Path::new("."), &mesh, None, &monitor).unwrap();
    assert!(out.fine.strain_energy > 0.0 && out.equal.is_none());
    let warnings = monitor.warnings();
    let told = |w: &crate::monitor::Warning| w.text.contains("no comparison at equal volume");
    assert!(warnings.iter().any(told), "{warnings:?}");
}

/// A bar under even tension, without Poisson's ratio: exact where the voxels are whole. In cut ones the stiffness is spread
/// over the voxel and the load lies on the true face, so that a little is lost.
#[test]
fn a_bar_is_exact_on_whole_voxels_and_near_on_cut_ones() {
    let mut case = box_case([12.0, 4.0, 4.0], 0.0, [1000.0, 0.0, 0.0]);
    let mesh = shapes::cuboid(Vec3::zeros(), Vec3::new(12.0, 4.0, 4.0));
    let exact = 0.5 * 1000.0 * 1000.0 * 12.0 / (70_000.0 * 16.0);
    // 4 mm are 4 and 8 voxels, or 2 2/3 and 5 1/3: there the full voxels beside the cut end under load take a tenth more.
    for (h, energy, stress) in [(1.0, 1e-5, 1e-4), (1.5, 1e-2, 0.15)] {
        case.verify.h = Some(h);
        let out = verify(&case, Path::new("."), &mesh, None, &Monitor::default()).unwrap();
        for found in [&out.coarse, &out.fine] {
            let ratio = found.strain_energy / exact;
            assert!((ratio - 1.0).abs() < energy, "{h}: {ratio}");
            let (_, most) = found.stress().expect("full voxels");
            assert!((most / 62.5 - 1.0).abs() < stress, "{h}: {most}");
        }
    }
}

/// Lame: a thick-walled cylinder with free ends under inner pressure, turned against the voxels.
#[test]
fn turned_cylinder_under_pressure_is_right() {
    let (inner, outer, length, pressure) = (8.0, 16.0, 10.0, 10.0);
    let turn = oblique();
    let mesh = tube(inner, outer, length, &turn);
    let case = box_case([1.0; 3], 0.3, [1.0, 0.0, 0.0]);
    let (e, nu) = (70_000.0, 0.3);
    let k = inner * inner / (outer * outer - inner * inner);
    let u = pressure * k / e * ((1.0 - nu) * inner + (1.0 + nu) * outer * outer / inner);
    let exact = 0.5 * pressure * u * std::f64::consts::TAU * inner * length;
    let mut ratios = Vec::new();
    for h in [2.0, 1.0] {
        let grid = grid(&mesh, h);
        let active = ActiveNodes::new(&grid);
        let pieces = Pieces::new(&mesh, h);
        let axis = turn * Vec3::z();
        let centre = Vec3::new(0.137, -0.291, 0.053);
        let radial = |p: &Vec3| {
            let r = p - centre;
            r - axis * r.dot(&axis)
        };
        let bore: Vec<LoadPlace> = pieces
            .all()
            .into_iter()
            .filter(|p| radial(&p.place).norm() < inner + 0.01)
            .collect();
        let load = Load {
            pressure: Some(pressure),
            ..Load::default()
        };
        let forces = forces_on(&bore, &load).unwrap();
        let mut sums = BTreeMap::new();
        spread(&grid, &active, &bore, &forces, &mut sums);
        let loads = sums.into_iter().map(|([z, y, x], f)| ([x, y, z], f.into()));
        let conditions = Conditions {
            fixed: held_without_force(&grid, &active),
            springs: Vec::new(),
            loads: vec![loads.collect()],
        };
        let found =
            measure::solve(&case, grid, conditions, 1e-6, &SOLVER, &Monitor::default()).unwrap();
        ratios.push(found.strain_energy / exact);
    }
    println!("energy over Lame's at 4 and 8 voxels across the wall: {ratios:?}");
    assert!((ratios[1] - 1.0).abs() < 0.05, "{ratios:?}");
    assert!(
        (ratios[1] - 1.0).abs() < (ratios[0] - 1.0).abs(),
        "{ratios:?}"
    );
}

/// Six degrees of freedom that hold a body and take no force from balanced loads.
fn held_without_force(grid: &Fractions, active: &ActiveNodes) -> Vec<([usize; 3], usize)> {
    let problem = grid.problem();
    let full =
        |n: &[usize; 3]| super::conditions::around(&problem, *n).all(|v| grid.values[v] > 0.99);
    let solid: Vec<[usize; 3]> = active.nodes.iter().copied().filter(full).collect();
    let least = |score: &dyn Fn(&[usize; 3]) -> f64| {
        *solid
            .iter()
            .min_by(|a, b| score(a).total_cmp(&score(b)))
            .expect("full voxels")
    };
    let a = least(&|n| n[0] as f64);
    let b = least(&|n| -(n[0] as f64));
    let c = least(&|n| -(n[1] as f64));
    let mut fixed = vec![(a, 0), (a, 1), (a, 2), (b, 1), (b, 2), (c, 2)];
    fixed.sort_unstable();
    fixed
}

#[test]
fn bad_options_and_parts_are_refused() {
    let mut case = box_case([12.0, 4.0, 4.0], 0.3, [1000.0, 0.0, 0.0]);
    let mesh = shapes::cuboid(Vec3::zeros(), Vec3::new(12.0, 4.0, 4.0));
    let run = |case: &Case, mesh: &TriMesh| {
        verify(case, Path::new("."), mesh, None, &Monitor::default()).expect_err("refused")
    };
    assert!(matches!(
        run(&case, &TriMesh::default()),
        VerifyError::Empty
    ));
    let far = shapes::cuboid(Vec3::repeat(100.0), Vec3::repeat(104.0));
    let error = run(&case, &far);
    assert!(matches!(error, VerifyError::NotOnPart { .. }), "{error}");
    assert!(error.hint().is_some());
    let proposal = VoxelGrid::filled(Vec3::zeros(), 1.0, [2, 2, 2], 1.0);
    let found = verify(
        &case,
        Path::new("."),
        &mesh,
        Some(&proposal),
        &Monitor::default(),
    );
    assert!(matches!(found, Err(VerifyError::Proposal { .. })));
    case.verify.h = Some(f64::NAN);
    assert!(matches!(run(&case, &mesh), VerifyError::Option { .. }));
    case.verify.h = Some(1e-4);
    let error = run(&case, &mesh);
    assert!(error.to_string().contains("MB"), "{error}");
}
