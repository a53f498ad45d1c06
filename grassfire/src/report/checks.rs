//! Verdicts: measured values against limits.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Report;
use crate::topology::Betti;

/// Unit of checks that count what is wrong.
pub(super) const DEFECTS: &str = "defects";

/// What a result must keep to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Largest rms distance to the proposal, voxels.
    pub distance_rms: f64,
    /// Largest 95 % distance to the proposal, voxels.
    pub distance_p95: f64,
    /// Largest relative difference of volume to the proposal, 0.02 is 2 %.
    pub volume: f64,
    /// Largest normal angle across smooth edges, degrees.
    pub g1: f64,
    /// Largest relative difference between the CAD kernel's volume and ours.
    pub volume_check: f64,
    /// Largest distance from the solid's non-design faces to the given bodies, mm.
    pub non_design: f64,
    /// Largest isolated hot spot when feeders are given, mm3.
    pub hot_spot: f64,
    /// Largest relative difference of the strain energies on the two grids of a verification.
    pub energy_error: f64,
    /// Largest sum of reactions and loads over the loads.
    pub reaction: f64,
    /// Largest relative difference to the strain energy that CalculiX finds: it prints seven digits, and its iterative solver is
    /// exact to a millionth or two.
    pub calculix: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            distance_rms: 0.5,
            distance_p95: 1.0,
            volume: 0.02,
            g1: 0.01,
            volume_check: 1e-4,
            non_design: 1e-3,
            hot_spot: 1000.0,
            energy_error: 0.05,
            reaction: 1e-3,
            calculix: 1e-5,
        }
    }
}

/// One verdict.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// Key in `report.json`, such as `solid.valid`.
    pub name: String,
    /// What must hold, in words.
    pub text: String,
    /// The measured value; absent when it could not be measured, and then the check is not met.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Largest value allowed (equality is allowed).
    pub limit: f64,
    /// Unit of both; `defects` for counts of what is wrong, empty for ratios.
    pub unit: String,
    /// The verdict.
    pub met: bool,
}

/// All checks that apply to the blocks that are present.
///
/// Counts of defects have the limit 0, so that every check reads "value <= limit".
pub fn judge(report: &Report, limits: &Limits) -> Vec<Check> {
    let mut checks = Vec::new();
    topology(report, &mut checks);
    if let Some(body) = &report.body {
        let crossings = body.self_intersections as f64;
        checks.push(check(
            "body.self_intersections",
            "Body does not cut itself",
            crossings,
            0.0,
            DEFECTS,
        ));
        let folds = body.folds as f64;
        let text = "No face of the body folds over";
        checks.push(check("body.folds", text, folds, 0.0, DEFECTS));
    }
    solid(report, limits, &mut checks);
    fidelity(report, limits, &mut checks);
    super::casting::judge(report, limits, &mut checks);
    super::verification::judge(report, limits, &mut checks);
    if let Some(block) = &report.optimize {
        let text = "Nothing of the optimized part is undercut";
        let undercut = block.undercut_volume;
        checks.push(check(
            "optimize.undercut_volume",
            text,
            undercut,
            0.0,
            "mm3",
        ));
        let text = "The optimized part is symmetric";
        checks.push(check(
            "optimize.symmetry_error",
            text,
            block.symmetry_error,
            0.0,
            "",
        ));
        let text = "The optimized part is one piece";
        let extra = block.components.saturating_sub(1) as f64;
        checks.push(check("optimize.components", text, extra, 0.0, DEFECTS));
    }
    if !report.refused.is_empty() {
        let text = "Every file asked for is written";
        let missing = report.refused.len() as f64;
        checks.push(check("files", text, missing, 0.0, DEFECTS));
    }
    checks
}

pub(super) fn check(name: &str, text: &str, value: f64, limit: f64, unit: &str) -> Check {
    let value = value.is_finite().then_some(value);
    let met = value.is_some_and(|v| v <= limit);
    Check {
        name: name.to_owned(),
        text: text.to_owned(),
        value,
        limit,
        unit: unit.to_owned(),
        met,
    }
}

fn defect(name: &str, text: &str, bad: bool) -> Check {
    check(name, text, f64::from(u8::from(bad)), 0.0, DEFECTS)
}

fn topology(report: &Report, checks: &mut Vec<Check>) {
    let Some(topology) = &report.topology else {
        return;
    };
    let differs = |other: Betti| topology.solid != other;
    checks.push(defect(
        "topology.complex",
        "Medial complex has the topology of the solid",
        differs(topology.complex),
    ));
    checks.push(defect(
        "topology.skeleton",
        "Skeleton has the topology of the solid",
        differs(topology.skeleton),
    ));
    if topology.body.is_empty() {
        return;
    }
    let chi: i64 = topology.body.iter().map(|surface| surface.chi).sum();
    let off = (chi - 2 * topology.skeleton.chi).unsigned_abs() as f64;
    checks.push(check(
        "topology.body",
        "Body surface has twice the Euler number of the skeleton",
        off,
        0.0,
        DEFECTS,
    ));
    let open = topology
        .body
        .iter()
        .filter(|surface| !surface.closed || !surface.manifold)
        .count();
    checks.push(check(
        "topology.body.closed",
        "Body surfaces are closed and manifold",
        open as f64,
        0.0,
        DEFECTS,
    ));
}

fn solid(report: &Report, limits: &Limits, checks: &mut Vec<Check>) {
    let Some(solid) = &report.solid else { return };
    checks.push(defect(
        "solid.valid",
        "Solid is valid for the CAD kernel",
        !solid.valid,
    ));
    let topology = report.topology.as_ref();
    let united = topology.and_then(|t| t.united);
    let whole = united.or(topology.map(|t| t.solid));
    let pieces = whole.map_or(1, |t| t.b0.max(1)) as f64;
    checks.push(check(
        "solid.bodies",
        "Separate bodies, no more than the proposal has",
        solid.bodies as f64,
        pieces,
        "",
    ));
    if let Some(united) = united {
        let off = (solid.genus - united.b1).unsigned_abs() as f64;
        let text = "Tunnels of the union, as many as proposal and non-design bodies have";
        checks.push(check("solid.genus", text, off, 0.0, DEFECTS));
    }
    if solid.bodies == 0 {
        checks.push(defect("solid.empty", "Solid has a body", true));
    }
    checks.push(check(
        "solid.g1_max",
        "Largest kink across smooth edges",
        solid.g1_max,
        limits.g1,
        "°",
    ));
    let volume_check = solid.volume_check.abs();
    let text = "Volume by the CAD kernel against ours, relative";
    checks.push(check(
        "solid.volume_check",
        text,
        volume_check,
        limits.volume_check,
        "",
    ));
}

fn fidelity(report: &Report, limits: &Limits, checks: &mut Vec<Check>) {
    if let Some(distance) = &report.distance {
        let voxels = |mm: f64| mm / distance.voxel;
        let rms = voxels(distance.rms);
        checks.push(check(
            "distance.rms",
            "Distance to the proposal, rms",
            rms,
            limits.distance_rms,
            "voxels",
        ));
        let p95 = voxels(distance.p95);
        checks.push(check(
            "distance.p95",
            "Distance to the proposal, 95 %",
            p95,
            limits.distance_p95,
            "voxels",
        ));
    }
    if let Some(mm) = report.distance.as_ref().and_then(|d| d.non_design_max) {
        let text = "Non-design faces against the given bodies";
        checks.push(check(
            "distance.non_design_max",
            text,
            mm,
            limits.non_design,
            "mm",
        ));
    }
    if let Some(volume) = &report.volume {
        let percent = 100.0 * volume.relative_difference.abs();
        let limit = 100.0 * limits.volume;
        checks.push(check(
            "volume.relative_difference",
            "Volume against the proposal",
            percent,
            limit,
            "%",
        ));
    }
    let lost = report.non_design.iter().filter(|body| !body.kept).count();
    if !report.non_design.is_empty() {
        checks.push(check(
            "non_design.kept",
            "Non-design bodies are in the solid as given",
            lost as f64,
            0.0,
            DEFECTS,
        ));
    }
}
