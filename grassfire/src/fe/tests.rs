//! Exact solutions and invariants of the voxel solver.

use nalgebra::{Matrix3, Vector3};

use super::*;
use crate::monitor::Monitor;

/// The contract's cantilever: left face clamped, unit load in -y along the edge x = L, y = 0.
fn cantilever(n: usize) -> VoxelModel {
    let dims = [n, n / 2, n / 2];
    let mut model = VoxelModel {
        dims,
        h: 1.0,
        nu: 0.3,
        ..VoxelModel::default()
    };
    for z in 0..=dims[2] {
        for y in 0..=dims[1] {
            model.fixed.extend((0..3).map(|c| ([0, y, z], c)));
        }
    }
    let share = 1.0 / (dims[2] + 1) as f64;
    model.loads = vec![
        (0..=dims[2])
            .map(|z| ([n, 0, z], [0.0, -share, 0.0]))
            .collect(),
    ];
    model
}

#[test]
fn uniform_cantilever_has_the_known_compliance() {
    let model = cantilever(48);
    let e = 1e-6 + (1.0 - 1e-6) * 0.25f64.powi(3);
    let moduli = vec![e; 48 * 24 * 24];
    let mut solver = Solver::new(model, &moduli, &SolverOptions::default()).unwrap();
    let stats = solver.solve(0, &Monitor::default()).unwrap();
    assert!(stats.iterations <= 12, "{stats:?}");
    let c = solver.compliance();
    assert!((c / 116.179277 - 1.0).abs() < 1e-5, "{c}");
    let mut energies = vec![0.0; moduli.len()];
    let voxels: Vec<u32> = (0..moduli.len() as u32).collect();
    solver.add_energies(e, &voxels, &mut energies);
    let sum: f64 = energies.iter().sum();
    assert!((sum / c - 1.0).abs() < 1e-4, "{sum} {c}");
    let reaction = solver.reactions();
    assert!(
        (reaction[1] - 1.0).abs() < 1e-4 && reaction[0].abs() < 1e-4,
        "{reaction:?}"
    );
}

#[test]
fn rigid_motions_of_an_element_need_no_forces() {
    let k = element::stiffness(0.3);
    let largest = k.iter().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
    let corner = |c: usize| [c & 1, c >> 1 & 1, c >> 2].map(|i| i as f64 - 0.5);
    for motion in 0..6 {
        let moved = |c: usize| -> [f64; 3] {
            let (axis, x) = (motion % 3, corner(c));
            let mut u = [0.0; 3];
            if motion < 3 {
                u[axis] = 1.0;
            } else {
                u[(axis + 1) % 3] = -x[(axis + 2) % 3];
                u[(axis + 2) % 3] = x[(axis + 1) % 3];
            }
            u
        };
        let u: Vec<f64> = (0..8).flat_map(moved).collect();
        for row in &k {
            let force: f64 = row.iter().zip(&u).map(|(k, u)| k * u).sum();
            assert!(force.abs() <= 1e-14 * largest, "{motion}: {force}");
        }
    }
}

#[test]
fn uniaxial_patch_is_exact() {
    // 20 x 12 x 10 voxels under unit tension; symmetry supports.
    let dims = [20, 12, 10];
    let mut model = VoxelModel {
        dims,
        h: 1.0,
        nu: 0.3,
        loads: vec![Vec::new()],
        ..VoxelModel::default()
    };
    for z in 0..=dims[2] {
        for y in 0..=dims[1] {
            for x in 0..=dims[0] {
                for (c, at) in [x, y, z].into_iter().enumerate() {
                    if at == 0 {
                        model.fixed.push(([x, y, z], c));
                    }
                }
                if x == dims[0] {
                    let half = |i: usize, n: usize| if i == 0 || i == n { 0.5 } else { 1.0 };
                    let f = half(y, dims[1]) * half(z, dims[2]);
                    model.loads[0].push(([x, y, z], [f, 0.0, 0.0]));
                }
            }
        }
    }
    let options = SolverOptions {
        tolerance: 1e-13,
        coarsest: 600,
        ..SolverOptions::default()
    };
    let mut solver = Solver::new(model, &[1.0; 20 * 12 * 10], &options).unwrap();
    solver.solve(0, &Monitor::default()).unwrap();
    for z in 0..=dims[2] {
        for y in 0..=dims[1] {
            for x in 0..=dims[0] {
                let u = solver.displacement([x, y, z]);
                let exact = [x as f64, -0.3 * y as f64, -0.3 * z as f64];
                for c in 0..3 {
                    assert!((u[c] - exact[c]).abs() < 20.0 * 1e-12, "{x} {y} {z}: {u:?}");
                }
            }
        }
    }
}

#[test]
fn voxels_without_stiffness_change_nothing_and_take_no_memory() {
    // An L of 16 x 12 x 4 voxels with a hole, alone and somewhere in a grid five times as large.
    let solve = |dims: [usize; 3], at: [usize; 3]| {
        let mut moduli = vec![0.0; dims.iter().product()];
        for z in 0..4 {
            for y in 0..12 {
                for x in 0..16 {
                    let arm = x < 5 || y < 4;
                    let hole = (1..3).contains(&x) && (6..8).contains(&y);
                    if arm && !hole {
                        let v = ((at[2] + z) * dims[1] + at[1] + y) * dims[0] + at[0] + x;
                        moduli[v] = 1.0 + (x + y + z) as f64 / 10.0;
                    }
                }
            }
        }
        let node = |x: usize, y: usize, z: usize| [at[0] + x, at[1] + y, at[2] + z];
        let mut model = VoxelModel {
            dims,
            h: 0.5,
            nu: 0.3,
            ..VoxelModel::default()
        };
        for z in 0..=4 {
            for x in 0..=5 {
                model.fixed.extend((0..3).map(|c| (node(x, 12, z), c)));
            }
            model.loads.push(vec![(node(16, 2, z), [0.1, -1.0, 0.3])]);
        }
        let options = SolverOptions {
            tolerance: 1e-12,
            coarsest: 300,
            ..SolverOptions::default()
        };
        let mut solver = Solver::new(model, &moduli, &options).unwrap();
        let mut out = Vec::new();
        for case in 0..5 {
            solver.solve(case, &Monitor::default()).unwrap();
            let mut energies = vec![0.0; moduli.len()];
            let voxels: Vec<u32> = (0..moduli.len() as u32).collect();
            solver.add_energies(2.0, &voxels, &mut energies);
            let all: f64 = energies.iter().zip(&moduli).map(|(u, e)| u * e).sum();
            out.extend([solver.compliance(), all]);
            out.extend(solver.displacement(node(16, 4, 0)));
        }
        (out, solver.stored_nodes())
    };
    let (alone, nodes) = solve([16, 12, 4], [0, 0, 0]);
    let (inside, stored) = solve([40, 37, 21], [17, 19, 9]);
    for (a, b) in alone.iter().zip(&inside) {
        assert!((a - b).abs() < 1e-9 * a.abs().max(1.0), "{a} {b}");
    }
    for energies in alone.chunks(5) {
        assert!(
            (energies[1] / energies[0] - 2.0).abs() < 1e-9,
            "{energies:?}"
        );
    }
    assert_eq!(nodes, stored);
    assert!(nodes < 17 * 13 * 5);
}

#[test]
fn a_load_where_no_material_is_has_its_own_error() {
    let mut model = cantilever(8);
    model.loads[0][0].0 = [8, 4, 4];
    let mut moduli = vec![1.0; 8 * 4 * 4];
    moduli[8 * 4 * 4 - 1] = 0.0;
    let error = Solver::new(model, &moduli, &SolverOptions::default())
        .err()
        .unwrap();
    assert!(matches!(error, FeError::LoadOnVoid { .. }), "{error}");
}

#[test]
fn contrast_does_not_matter() {
    // A frame of struts in a void of 1e-9.
    let model = cantilever(32);
    let dims = model.dims;
    let mut moduli = vec![1e-9; dims.iter().product()];
    for (i, e) in moduli.iter_mut().enumerate() {
        let (y, z) = (i / dims[0] % dims[1], i / (dims[0] * dims[1]));
        let x = i % dims[0];
        let wall = |a: usize, n: usize| a < 3 || a + 3 >= n;
        if (wall(y, dims[1]) && wall(z, dims[2]))
            || x % 8 < 3 && (wall(y, dims[1]) || wall(z, dims[2]))
        {
            *e = 1.0;
        }
    }
    let mut solver = Solver::new(model, &moduli, &SolverOptions::default()).unwrap();
    let stats = solver.solve(0, &Monitor::default()).unwrap();
    assert!(stats.iterations <= 30, "{stats:?}");
}

#[test]
fn supports_that_leave_a_motion_free_are_named() {
    let at = |x, y, z, c| ([x, y, z], c);
    assert_eq!(free_modes(&[], &[]), RIGID_MODES);
    let hinge = [
        at(0, 0, 0, 0),
        at(0, 0, 0, 1),
        at(0, 0, 0, 2),
        at(0, 0, 9, 0),
        at(0, 0, 9, 1),
        at(0, 0, 9, 2),
    ];
    assert_eq!(free_modes(&hinge, &[]), ["rotation about z"]);
    let mut held = hinge.to_vec();
    held.push(at(5, 0, 0, 1));
    assert_eq!(free_modes(&held, &[]), Vec::<&str>::new());
}

#[test]
fn too_large_a_grid_is_refused_before_it_is_allocated() {
    let model = VoxelModel {
        dims: [4000, 4000, 4000],
        h: 1.0,
        ..cantilever(8)
    };
    let error = Solver::new(model, &[], &SolverOptions::default())
        .err()
        .unwrap();
    assert!(matches!(error, FeError::Memory { .. }), "{error}");
    assert!(error.hint().is_some());
}

#[test]
fn pieces_share_faces() {
    let mut solid = vec![false; 27];
    solid[0] = true;
    solid[1] = true;
    solid[13] = true;
    let (labels, pieces) = components([3; 3], &solid);
    assert_eq!(pieces.len(), 2);
    assert_eq!((pieces[0].size, pieces[1].size, labels[13]), (2, 1, 1));
}

/// A bar of 40 x 8 x 8 voxels that springs hold at its left face, `stiffness` on each of its 81 nodes, pulled at the other.
fn sprung(stiffness: impl Fn([usize; 3]) -> Matrix3<f64>, pull: [f64; 3]) -> VoxelModel {
    let mut model = VoxelModel {
        dims: [40, 8, 8],
        h: 0.5,
        nu: 0.0,
        loads: vec![Vec::new()],
        ..VoxelModel::default()
    };
    for (y, z) in (0..81).map(|i| (i % 9, i / 9)) {
        let half = |i: usize| if i == 0 || i == 8 { 0.5 } else { 1.0 };
        let share = half(y) * half(z) / 64.0;
        model.loads[0].push(([40, y, z], pull.map(|f| f * share)));
        let at = [0, y, z];
        model.springs.push((at, share * stiffness(at)));
    }
    model
}

fn solved(model: VoxelModel, tolerance: f64) -> (Solver, SolveStats) {
    let options = SolverOptions {
        tolerance,
        coarsest: 600,
        ..SolverOptions::default()
    };
    let mut solver = Solver::new(model, &[1.0; 40 * 64], &options).unwrap();
    let stats = solver.solve(0, &Monitor::default()).unwrap();
    (solver, stats)
}

#[test]
fn a_bar_on_springs_moves_by_their_give_and_its_own() {
    // 20 mm long, 16 mm2, E = 1: it gives way by 20 / 16, the springs by 1 / 0.05.
    let model = sprung(|_| Matrix3::identity() * 0.05, [1.0, 0.0, 0.0]);
    assert!(free_modes(&model.fixed, &model.springs).is_empty());
    let (solver, stats) = solved(model, 1e-10);
    assert!(stats.iterations <= 30, "{stats:?}");
    let u = solver.displacement([40, 3, 5]);
    assert!((u[0] - 21.25).abs() < 1e-6 && u[1].abs() < 1e-6, "{u:?}");
    assert!((solver.spring_energy() - 10.0).abs() < 1e-6);
    assert!((solver.compliance() - 21.25).abs() < 1e-6);
    let reactions = solver.reactions();
    assert!((reactions[0] + 1.0).abs() < 1e-6, "{reactions:?}");
}

#[test]
fn stiff_springs_along_a_slanting_normal_do_not_slow_the_solver_down() {
    // The left face slides on a slanting plane; one of its nodes is fixed across.
    let n = Vector3::new(2.0, 1.0, -0.5).normalize();
    let mut model = sprung(|_| 1e4 * n * n.transpose(), [0.3, -1.0, 0.2]);
    let slides = free_modes(&model.fixed, &model.springs);
    assert_eq!(slides.len(), 3, "{slides:?}");
    model.fixed = vec![([0, 4, 4], 1), ([0, 4, 4], 2), ([0, 8, 4], 2)];
    assert!(free_modes(&model.fixed, &model.springs).is_empty());
    let (solver, stats) = solved(model, 1e-8);
    assert!(stats.iterations <= 40, "{stats:?}");
    for (y, z) in (0..81).map(|i| (i % 9, i / 9)) {
        let u = Vector3::from(solver.displacement([0, y, z]));
        let end = Vector3::from(solver.displacement([40, y, z]));
        assert!(u.dot(&n).abs() < 0.02 * end.norm(), "{u} {end}");
    }
}

#[test]
fn a_part_on_springs_far_softer_than_itself_converges() {
    // The springs give way a million times as much as the bar: single precision alone cannot tell them from nothing.
    for (soft, along) in [(1e-6, [1.0, 0.0, 0.0]), (1e-6, [0.0, 0.3, -1.0])] {
        let model = sprung(|_| Matrix3::identity() * soft, along);
        let (solver, stats) = solved(model, 1e-6);
        assert!(stats.iterations <= 40, "{stats:?}");
        let reactions = solver.reactions();
        for (found, load) in reactions.iter().zip(along) {
            assert!((found + load).abs() < 1e-4, "{reactions:?}");
        }
    }
}
