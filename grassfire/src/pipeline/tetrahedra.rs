//! The proof of stiffness on body-fitted tetrahedra.

use std::path::Path;

use super::deliver::Delivery;
use super::error::{PipelineError, StageError};
use super::record::Record;
use crate::case::Case;
use crate::io::{self, Elements};
use crate::mesh::TriMesh;
use crate::monitor::Monitor;
use crate::report::TetrahedraBlock;
use crate::tet::{
    STAGE, TetError, TetMesh, TetResult, default_size, mesh_step, model, run_calculix, solve,
    write_deck,
};

/// Displacement and stress.
pub(super) const RESULT: &str = "tetrahedra.vtu";
/// Input of CalculiX.
pub(super) const DECK: &str = "tetrahedra.inp";

/// The coarser mesh has edges longer by this.
const COARSER: f64 = 1.5;

/// Solves the load cases of a project on tetrahedra in the STEP file of a solid, when that is asked for; `mesh` is its surface.
///
/// 1. gmsh fills the solid twice, with edges of the default size and 1.5 times as long.
/// 2. Both are solved ([`crate::tet::solve`]); the difference of their energies estimates the error.
/// 3. The finer one is written for CalculiX, which solves it too when that is asked for.
pub(super) fn prove(
    record: &mut Record,
    case: &Case,
    folder: &Path,
    step: &Path,
    mesh: &TriMesh,
    delivery: &Delivery,
    monitor: &Monitor,
) -> Result<(), PipelineError> {
    let options = &case.verify.tetrahedra;
    if !(options.enabled || options.calculix) {
        return Ok(());
    }
    let size = default_size(mesh.volume(), mesh.area(), options);
    let at = |size: f64| -> Result<(TetMesh, crate::tet::TetModel, TetResult), TetError> {
        monitor.step(STAGE, &format!("gmsh, edges of {size:.2} mm"), 0.0)?;
        let mesh = mesh_step(step, size, options, monitor)?;
        let model = model(case, folder, &mesh, monitor)?;
        let result = solve(&mesh, &model, options, monitor)?;
        Ok((mesh, model, result))
    };
    let (coarse, (mesh, model, fine)) = record.stage(STAGE, || {
        Ok::<_, TetError>((at(COARSER * size)?.2, at(size)?))
    })?;
    record.stage("write", || -> Result<(), StageError> {
        write_deck(&delivery.path(DECK), &mesh, &model, &case.title)?;
        result(delivery, &mesh, &fine)
    })?;
    let calculix = || -> Result<f64, TetError> {
        monitor.step(STAGE, "CalculiX", 0.9)?;
        let found = run_calculix(&delivery.path(DECK), model.cases.len(), options, monitor)?;
        let cases = model.cases.iter().zip(&found.energies);
        Ok(cases.map(|(case, energy)| case.weight * energy).sum())
    };
    let theirs = match options.calculix {
        true => Some(record.stage("calculix", calculix)?),
        false => None,
    };
    if let Some(block) = &mut record.report.verify {
        block.tetrahedra = Some(TetrahedraBlock {
            size,
            size_coarse: COARSER * size,
            voxel_ratio: block.strain_energy / fine.strain_energy,
            calculix_strain_energy: theirs,
            ..figures(&fine, &coarse)
        });
    }
    Ok(())
}

fn figures(fine: &TetResult, coarse: &TetResult) -> TetrahedraBlock {
    let worst = fine
        .cases
        .iter()
        .max_by(|a, b| a.stress_max.total_cmp(&b.stress_max));
    let errors = fine.cases.iter().map(|c| c.reaction_error);
    TetrahedraBlock {
        elements: fine.elements,
        nodes: fine.nodes,
        volume: fine.volume,
        strain_energy: fine.strain_energy,
        strain_energy_coarse: coarse.strain_energy,
        energy_error_estimate: (coarse.strain_energy / fine.strain_energy - 1.0).abs(),
        u_max: fine.u_max(),
        stress_max: worst.map_or(0.0, |c| c.stress_max),
        stress_place: worst.map(|c| c.stress_place).unwrap_or_default(),
        reaction_error: errors.fold(0.0, f64::max),
        iterations: fine.cases.iter().map(|c| c.iterations).sum(),
        ..TetrahedraBlock::default()
    }
}

/// Writes displacements and stresses on the nodes.
fn result(delivery: &Delivery, mesh: &TetMesh, found: &TetResult) -> Result<(), StageError> {
    let several = found.cases.len() > 1;
    let named = |what: &str, case: &str| {
        if several {
            format!("{what} {case}")
        } else {
            what.to_owned()
        }
    };
    let vectors = found.cases.iter().map(|c| {
        let moved = c.displacement.iter().map(|u| (*u).map(|v| v as f32).into());
        (named("displacement", &c.name), moved.collect())
    });
    let stresses = found
        .cases
        .iter()
        .map(|c| (named("von_mises", &c.name), c.von_mises()));
    let out = Elements {
        points: mesh.points.clone(),
        cells: mesh.cells.clone(),
        vectors: vectors.collect(),
        node_values: stresses.collect(),
        values: Vec::new(),
    };
    Ok(io::write_vtu(&delivery.path(RESULT), &out)?)
}
