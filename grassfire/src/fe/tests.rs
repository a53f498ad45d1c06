//! Exact solutions and invariants of the voxel solver.

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
    let c = solver.compliance(0);
    assert!((c / 116.179277 - 1.0).abs() < 1e-5, "{c}");
    let sum: f64 = solver.energies(0).iter().map(|v| v * e).sum();
    assert!((sum / c - 1.0).abs() < 1e-4, "{sum} {c}");
    let reaction = solver.reactions(0);
    assert!(
        (reaction[1] - 1.0).abs() < 1e-4 && reaction[0].abs() < 1e-4,
        "{reaction:?}"
    );
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
                let u = solver.displacement(0, [x, y, z]);
                let exact = [x as f64, -0.3 * y as f64, -0.3 * z as f64];
                for c in 0..3 {
                    assert!((u[c] - exact[c]).abs() < 20.0 * 1e-12, "{x} {y} {z}: {u:?}");
                }
            }
        }
    }
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
    assert_eq!(free_modes(&[]), RIGID_MODES);
    let hinge = [
        at(0, 0, 0, 0),
        at(0, 0, 0, 1),
        at(0, 0, 0, 2),
        at(0, 0, 9, 0),
        at(0, 0, 9, 1),
        at(0, 0, 9, 2),
    ];
    assert_eq!(free_modes(&hinge), ["rotation about z"]);
    let mut held = hinge.to_vec();
    held.push(at(5, 0, 0, 1));
    assert_eq!(free_modes(&held), Vec::<&str>::new());
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
