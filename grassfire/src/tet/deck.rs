//! CalculiX: decks, runs, and what they say.

use std::io::Write;
use std::ops::Range;
use std::path::Path;

use super::gmsh::find;
use super::{TetError, TetMesh, TetModel, TetOptions, program};
use crate::io::{IoError, atomic_write};
use crate::monitor::Monitor;

/// Digits of a number: CalculiX reads twenty characters.
const DIGITS: usize = 12;
/// Length of a spring, mm: CalculiX turns the springs of a step by the displacements of the last one.
const FAR: f64 = 1e5;
/// Stiffness across a spring, as a share of that along it.
const ROUNDING: f64 = 1e-12;
/// From so many nodes on its direct solver takes minutes and gigabytes.
const DIRECT: usize = 50_000;

/// What CalculiX says of the load cases.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CalculixResult {
    /// Total internal energy of every case, N mm.
    pub energies: Vec<f64>,
}

/// Writes a mesh and its load cases as a CalculiX input file: C3D10, one static step a case, totals of energy and volume printed,
/// displacements and stresses for its viewer.
///
/// # Errors
/// [`IoError::Write`].
pub fn write_deck(
    path: &Path,
    mesh: &TetMesh,
    model: &TetModel,
    title: &str,
) -> Result<(), IoError> {
    let solver = match mesh.points.len() {
        ..DIRECT => "SPOOLES",
        _ => "ITERATIVE CHOLESKY",
    };
    atomic_write(path, |out| {
        let line = title.replace(['\n', '\r'], " ");
        writeln!(
            out,
            "** {line}\n** Units: mm, N, MPa, t, s\n*NODE, NSET=NALL"
        )?;
        for (i, p) in mesh.points.iter().enumerate() {
            writeln!(
                out,
                "{}, {:.DIGITS$e}, {:.DIGITS$e}, {:.DIGITS$e}",
                i + 1,
                p.x,
                p.y,
                p.z
            )?;
        }
        writeln!(out, "*ELEMENT, TYPE=C3D10, ELSET=EALL")?;
        for (i, cell) in mesh.cells.iter().enumerate() {
            write!(out, "{}", i + 1)?;
            cell.iter().try_for_each(|n| write!(out, ", {}", n + 1))?;
            writeln!(out)?;
        }
        writeln!(
            out,
            "*MATERIAL, NAME=PART\n*ELASTIC\n{:e}, {}",
            model.young, model.nu
        )?;
        writeln!(out, "*SOLID SECTION, ELSET=EALL, MATERIAL=PART")?;
        let grounds = write_springs(out, mesh, model)?;
        writeln!(out, "*BOUNDARY")?;
        for (node, axis) in &model.fixed {
            writeln!(out, "{}, {}, {}", node + 1, axis + 1, axis + 1)?;
        }
        for ground in grounds {
            writeln!(out, "{ground}, 1, 3")?;
        }
        model.cases.iter().try_for_each(|case| {
            writeln!(out, "** {}", case.name.replace(['\n', '\r'], " "))?;
            writeln!(out, "*STEP\n*STATIC, SOLVER={solver}\n*CLOAD, OP=NEW")?;
            for (node, force) in &case.forces {
                for d in 0..3 {
                    writeln!(out, "{}, {}, {:.DIGITS$e}", node + 1, d + 1, force[d])?;
                }
            }
            writeln!(out, "*EL PRINT, ELSET=EALL, TOTALS=ONLY\nELSE, EVOL")?;
            writeln!(out, "*NODE FILE\nU\n*EL FILE\nS\n*END STEP")
        })
    })
}

/// Writes a spring to a node of its own for every direction in which a node is held by springs; returns those nodes' numbers.
fn write_springs(
    out: &mut dyn Write,
    mesh: &TetMesh,
    model: &TetModel,
) -> std::io::Result<Range<usize>> {
    let first = mesh.points.len() + 1;
    let (mut ground, mut element) = (first, mesh.cells.len() + 1);
    for (node, stiffness) in &model.springs {
        let eigen = stiffness.symmetric_eigen();
        let most = eigen.eigenvalues.amax();
        for (k, direction) in eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter())
        {
            if *k <= ROUNDING * most {
                continue;
            }
            let p = mesh.points[*node as usize] + FAR * direction;
            let [x, y, z]: [f64; 3] = p.into();
            writeln!(
                out,
                "*NODE\n{ground}, {x:.DIGITS$e}, {y:.DIGITS$e}, {z:.DIGITS$e}"
            )?;
            writeln!(out, "*ELEMENT, TYPE=SPRINGA, ELSET=SPRING{element}")?;
            writeln!(out, "{element}, {}, {ground}", node + 1)?;
            writeln!(out, "*SPRING, ELSET=SPRING{element}\n\n{k:.DIGITS$e}")?;
            ground += 1;
            element += 1;
        }
    }
    Ok(first..ground)
}

/// Runs CalculiX on a deck of `cases` load cases and reads the energies.
///
/// # Errors
/// [`TetError::Program`] when it is not there, [`TetError::ProgramFailed`], [`TetError::NoEnergy`].
pub fn run_calculix(
    deck: &Path,
    cases: usize,
    options: &TetOptions,
    monitor: &Monitor,
) -> Result<CalculixResult, TetError> {
    let refused = |reason: std::io::Error| TetError::Program {
        program: options.ccx.clone(),
        reason: reason.to_string(),
    };
    let folder = tempfile::tempdir().map_err(refused)?;
    std::fs::copy(deck, folder.path().join("part.inp")).map_err(refused)?;
    let program = find(&options.ccx);
    program::run(
        &program,
        &["-i", "part"],
        folder.path(),
        "ccx.log",
        options.patience,
        monitor,
    )?;
    let path = folder.path().join("part.dat");
    let bytes = crate::io::read_file(&path, 1 << 30)?;
    let energies = energies(&String::from_utf8_lossy(&bytes));
    if energies.len() < cases {
        return Err(TetError::NoEnergy {
            case: energies.len(),
            path,
        });
    }
    Ok(CalculixResult { energies })
}

/// The number below every line about the total internal energy.
fn energies(text: &str) -> Vec<f64> {
    let mut lines = text.lines();
    let mut out = Vec::new();
    while let Some(line) = lines.next() {
        if line.contains("total internal energy") {
            let value = lines.by_ref().find(|l| !l.trim().is_empty());
            out.extend(value.and_then(|l| l.trim().parse::<f64>().ok()));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energies_are_read_from_calculix_totals() {
        let text = "\n total internal energy for set EALL and time  0.1000000E+01\n\n        1.296917E+03\n\n total volume for set EALL and time  0.1000000E+01\n\n        4.773807E+05\n";
        assert_eq!(energies(text), [1296.917]);
    }
}
