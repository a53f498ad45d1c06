//! Stiffness in the report: the block of `report.json` and its section of `report.html`.

use maud::{Markup, html};
use serde::Serialize;

use super::Report;
use super::checks::{Check, Limits, check};
use super::format::{count, number, with_unit};
use super::recognised::place;

/// The stiffness of the finished solid; figures of the finer grid unless said otherwise.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct VerifyBlock {
    /// How it was solved.
    pub solver: String,
    /// Voxels with material.
    pub elements: usize,
    /// Their nodes.
    pub nodes: usize,
    /// Edge of a voxel, mm.
    pub voxel: f64,
    /// Edge on the coarser grid, mm.
    pub voxel_coarse: f64,
    /// Volume by the triangles of the surface, mm3.
    pub volume: f64,
    /// The same over the design space with its non-design bodies.
    pub volume_fraction: f64,
    /// Largest displacement of all cases, mm.
    pub u_max: f64,
    /// Where, mm.
    pub u_place: [f64; 3],
    /// Half of f'u, weighted sum of the cases, mJ.
    pub strain_energy: f64,
    /// The same on the coarser grid.
    pub strain_energy_coarse: f64,
    /// Strain energy times volume, mJ mm3.
    pub cv: f64,
    /// The same after the free surface was moved evenly until the volume is `equal_volume`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cv_equal_volume: Option<f64>,
    /// The volume at which stiffness is compared, mm3: that of the proposal, else that the optimization was to reach.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub equal_volume: Option<f64>,
    /// How far the surface was moved outward for that, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub equal_volume_offset: Option<f64>,
    /// Largest von Mises stress away from fixed places and cut voxels, MPa.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stress_max: Option<f64>,
    /// Where, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stress_place: Option<[f64; 3]>,
    /// Yield strength of the material, MPa.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub yield_strength: Option<f64>,
    /// Yield strength over largest stress, less one: negative where the material yields.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub yield_margin: Option<f64>,
    /// Sum of reactions and loads over the loads, largest of the cases.
    pub reaction_error: f64,
    /// Relative difference of the strain energies on the two grids.
    pub energy_error_estimate: f64,
    /// The load cases.
    pub cases: Vec<LoadCaseBlock>,
    /// The voxels that the optimization left, under the same loads.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub proposal: Option<ProposalBlock>,
    /// The same solid on body-fitted tetrahedra.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tetrahedra: Option<TetrahedraBlock>,
}

/// The solid on body-fitted ten-node tetrahedra; figures of the finer mesh.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct TetrahedraBlock {
    /// Edge asked for, mm.
    pub size: f64,
    /// Edge of the coarser mesh, mm.
    pub size_coarse: f64,
    /// Elements.
    pub elements: usize,
    /// Their nodes.
    pub nodes: usize,
    /// Volume, mm3.
    pub volume: f64,
    /// Half of f'u, weighted sum of the cases, mJ.
    pub strain_energy: f64,
    /// The same on the coarser mesh; the energy of finer meshes is larger.
    pub strain_energy_coarse: f64,
    /// Relative difference of the two.
    pub energy_error_estimate: f64,
    /// Strain energy on the finer voxels over that on these tetrahedra.
    pub voxel_ratio: f64,
    /// Largest displacement of all cases, mm.
    pub u_max: f64,
    /// Largest von Mises stress at a Gauss point away from held nodes, MPa.
    pub stress_max: f64,
    /// Where, mm.
    pub stress_place: [f64; 3],
    /// Sum of reactions and loads over the loads, largest of the cases.
    pub reaction_error: f64,
    /// Iterations of the solver, all cases.
    pub iterations: usize,
    /// Strain energy that CalculiX finds on the same mesh, mJ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calculix_strain_energy: Option<f64>,
}

/// One load case.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct LoadCaseBlock {
    /// Name.
    pub name: String,
    /// Half of f'u, mJ.
    pub strain_energy: f64,
    /// Largest displacement, mm.
    pub u_max: f64,
    /// Where, mm.
    pub u_place: [f64; 3],
    /// Largest von Mises stress, MPa.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stress_max: Option<f64>,
    /// Sum of reactions and loads over the loads.
    pub reaction_error: f64,
    /// Iterations of the solver.
    pub iterations: usize,
}

/// The voxels that the optimization left, under the same loads, every voxel cut into eight.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ProposalBlock {
    /// Volume, mm3.
    pub volume: f64,
    /// Voxels after cutting.
    pub elements: usize,
    /// Half of f'u, weighted sum of the cases, mJ.
    pub strain_energy: f64,
    /// Largest displacement, mm.
    pub u_max: f64,
    /// Strain energy times volume, mJ mm3.
    pub cv: f64,
    /// Relative difference to the strain energy on the voxels of the optimization.
    pub energy_error_estimate: f64,
    /// Strain energy on these, mJ.
    pub strain_energy_coarse: f64,
    /// What reconstruction costs: `cv_equal_volume` of the solid over `cv` of the proposal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cv_ratio: Option<f64>,
}

/// Verdicts on the block when it is present.
pub(super) fn judge(report: &Report, limits: &Limits, checks: &mut Vec<Check>) {
    let Some(block) = &report.verify else {
        return;
    };
    let text = "Reactions balance the loads, relative to the loads";
    let error = block.reaction_error;
    checks.push(check(
        "verify.reaction_error",
        text,
        error,
        limits.reaction,
        "",
    ));
    let text = "Strain energy on two grids, relative difference";
    let percent = 100.0 * block.energy_error_estimate;
    let limit = 100.0 * limits.energy_error;
    checks.push(check(
        "verify.energy_error_estimate",
        text,
        percent,
        limit,
        "%",
    ));
    let Some(tets) = &block.tetrahedra else {
        return;
    };
    let text = "Strain energy on voxels and on tetrahedra, relative difference";
    let percent = 100.0 * (tets.voxel_ratio - 1.0).abs();
    checks.push(check(
        "verify.tetrahedra.voxel_ratio",
        text,
        percent,
        limit,
        "%",
    ));
    if let Some(theirs) = tets.calculix_strain_energy {
        let text = "Strain energy of CalculiX on the same tetrahedra, relative difference";
        let error = (tets.strain_energy / theirs - 1.0).abs();
        let limit = limits.calculix;
        checks.push(check(
            "verify.tetrahedra.calculix_strain_energy",
            text,
            error,
            limit,
            "",
        ));
    }
}

/// The section of the page, when the report has the block.
pub(super) fn section(report: &Report) -> Markup {
    let Some(block) = &report.verify else {
        return html! {};
    };
    let joules = |mj: f64| with_unit(mj / 1e3, 4, "J");
    let cv = |v: f64| with_unit(v / 1e6, 4, "kJ mm³");
    html! {
        h2 { "Stiffness" }
        p .soft { (block.solver) ". Linear elastic; the strain energy is half of force times displacement. Supports and loads act on the true surface." }
        dl .facts {
            div { dt { "Volume" } dd { (with_unit(block.volume, 5, "mm³")) " (" (with_unit(100.0 * block.volume_fraction, 3, "%")) " of the space)" } }
            div { dt { "Largest displacement" } dd { (with_unit(block.u_max, 4, "mm")) " at " (place(&block.u_place)) } }
            div { dt { "Strain energy" } dd { (joules(block.strain_energy)) } }
            div { dt { "Energy × volume" } dd { (cv(block.cv)) } }
            @if let (Some(equal), Some(volume)) = (block.cv_equal_volume, block.equal_volume) {
                div { dt { "The same at " (with_unit(volume, 5, "mm³")) } dd { (cv(equal)) } }
            }
            @if let (Some(stress), Some(at)) = (block.stress_max, &block.stress_place) {
                div { dt { "Largest von Mises stress" } dd { (with_unit(stress, 3, "MPa")) " at " (place(at)) } }
            }
            @if let (Some(margin), Some(strength)) = (block.yield_margin, block.yield_strength) {
                div { dt { "Margin to yield at " (with_unit(strength, 3, "MPa")) } dd { (with_unit(100.0 * margin, 3, "%")) } }
            }
            div { dt { "Voxels" } dd { (count(block.elements)) " of " (with_unit(block.voxel, 3, "mm")) } }
            div { dt { "Difference to voxels of " (with_unit(block.voxel_coarse, 3, "mm")) } dd { (with_unit(100.0 * block.energy_error_estimate, 3, "%")) } }
        }
        @if block.cases.len() > 1 {
            div .scroll { table {
                thead { tr { th { "Load case" } th .n { "Strain energy" } th .n { "Displacement" } th .n { "Stress" } } }
                tbody {
                    @for case in &block.cases {
                        tr {
                            td { (case.name) }
                            td .n { (joules(case.strain_energy)) }
                            td .n { (with_unit(case.u_max, 4, "mm")) }
                            td .n { (with_unit(case.stress_max.unwrap_or(f64::NAN), 3, "MPa")) }
                        }
                    }
                }
            } }
        }
        @if let Some(tets) = &block.tetrahedra {
            p {
                "On " (count(tets.elements)) " ten-node tetrahedra of " (with_unit(tets.size, 3, "mm")) " (a mesh of gmsh): "
                (joules(tets.strain_energy)) ", " (with_unit(tets.u_max, 4, "mm")) ", von Mises stress up to "
                (with_unit(tets.stress_max, 3, "MPa")) " at " (place(&tets.stress_place)) "; "
                (with_unit(100.0 * tets.energy_error_estimate, 3, "%")) " between meshes. The voxels have "
                (number(tets.voxel_ratio, 4)) " times this energy."
                @if let Some(theirs) = tets.calculix_strain_energy { " CalculiX finds " (with_unit(theirs / 1e3, 7, "J")) " on the same mesh." }
            }
        }
        @if let Some(other) = &block.proposal {
            p {
                "The full voxels that the optimization left: " (with_unit(other.volume, 5, "mm³")) ", "
                (with_unit(other.u_max, 4, "mm")) ", " (joules(other.strain_energy)) ", " (cv(other.cv))
                " (" (with_unit(100.0 * other.energy_error_estimate, 3, "%")) " between whole and cut voxels)."
                @if let Some(ratio) = other.cv_ratio { " At equal volume the solid has " (number(ratio, 4)) " times their energy × volume." }
            }
        }
    }
}
