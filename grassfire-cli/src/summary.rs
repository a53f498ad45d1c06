//! The short summary at the end of a run.

use std::fmt::Write;
use std::path::Path;

use grassfire::report::Report;

/// A word and what is said of it.
type Line = (&'static str, String);

/// Sizes, verdicts and where the files lie.
pub fn text(report: &Report, output: &Path) -> String {
    let mut lines = proposal(report);
    lines.extend(part(report));
    lines.extend(stiffness(report));
    lines.extend(casting(report));
    lines.extend(verdicts(report));
    if !report.stages.is_empty() {
        let seconds: f64 = report.stages.iter().map(|stage| stage.seconds).sum();
        let memory = report
            .stages
            .iter()
            .map(|stage| stage.peak_memory)
            .fold(0.0, f64::max);
        lines.push(("time", format!("{seconds:.1} s, {memory:.0} MB")));
    }
    for name in [
        "density.vti",
        "result.vtu",
        "part.step",
        "solidification.vti",
        "repaired.stl",
        "report.html",
    ] {
        if report.files.iter().any(|file| file.path == name) {
            lines.push(("written", output.join(name).display().to_string()));
        }
    }
    lines.iter().fold(String::new(), |mut text, (name, value)| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{name:>9}  {value}");
        text
    })
}

/// The optimization and the proposal.
fn proposal(report: &Report) -> Vec<Line> {
    let mut lines = Vec::new();
    if let Some(block) = &report.optimize {
        let end = if block.converged {
            ""
        } else {
            ", at the limit"
        };
        lines.push((
            "optimize",
            format!(
                "{} voxels, {} iterations{end}, compliance {:.6} N mm from {:.6}, grayness {:.3}",
                block.elements,
                block.iterations,
                block.compliance,
                block.first_compliance,
                block.grayness
            ),
        ));
    }
    if let Some(block) = &report.remesh {
        let topology = match block.changes.len() {
            0 => String::new(),
            n => format!(
                ", {n} pinholes and the like removed (genus {} -> {})",
                block.genus_before, block.genus_after
            ),
        };
        lines.push((
            "proposal",
            format!(
                "{:.0} mm3, voxel {:.3} mm{topology}",
                block.volume, block.voxel
            ),
        ));
    }
    lines
}

/// The reconstruction.
fn part(report: &Report) -> Vec<Line> {
    let mut lines = Vec::new();
    if let Some(block) = &report.skeleton {
        lines.push((
            "skeleton",
            format!(
                "{} quads, {} beams, {} sheets",
                block.quads, block.beams, block.sheets
            ),
        ));
    }
    if let Some(block) = &report.solid {
        let difference = match &report.volume {
            Some(volume) => format!(" ({:+.2} %)", 100.0 * volume.relative_difference),
            None => String::new(),
        };
        let bodies = if block.bodies == 1 {
            "1 body".to_owned()
        } else {
            format!("{} bodies", block.bodies)
        };
        let verdict = if block.valid { "valid" } else { "NOT VALID" };
        let sizes = format!(
            "{bodies}, {} faces, genus {}, {:.0} mm3",
            block.faces, block.genus, block.volume
        );
        lines.push(("solid", format!("{verdict}, {sizes}{difference}")));
    }
    if let Some(block) = &report.distance {
        let voxels = |mm: f64| mm / block.voxel;
        let (rms, p95) = (voxels(block.rms), voxels(block.p95));
        lines.push((
            "distance",
            format!(
                "rms {rms:.2} voxels, 95 % within {p95:.2} voxels ({:.3} mm)",
                block.p95
            ),
        ));
    }
    lines
}

/// How many checks are met, and which are not.
fn verdicts(report: &Report) -> Vec<Line> {
    let mut lines = Vec::new();
    if !report.checks.is_empty() {
        let met = report.checks.iter().filter(|check| check.met).count();
        lines.push(("checks", format!("{met} of {} met", report.checks.len())));
    }
    for check in report.checks.iter().filter(|check| !check.met) {
        let value = check
            .value
            .map_or_else(|| "not measured".to_owned(), |v| format!("{v:.4}"));
        let unit = if check.unit.is_empty() {
            String::new()
        } else {
            format!(" {}", check.unit)
        };
        lines.push((
            "not met",
            format!(
                "{}: {value}{unit}, at most {}{unit} ({})",
                check.text, check.limit, check.name
            ),
        ));
    }
    lines
}

/// A number with so many decimals, and with more where three significant digits need them.
fn number(value: f64, decimals: usize) -> String {
    let needed = match value.abs().log10() {
        size if size.is_finite() => (2.0 - size.floor()).clamp(0.0, 12.0) as usize,
        _ => 0,
    };
    format!("{value:.*}", decimals.max(needed))
}

/// Verification.
fn stiffness(report: &Report) -> Vec<Line> {
    let Some(block) = &report.verify else {
        return Vec::new();
    };
    let mut text = format!(
        "{:.0} mm3, u_max {} mm, U {} J ({:.1} % between grids), c*v {} kJ mm3",
        block.volume,
        number(block.u_max, 3),
        number(block.strain_energy / 1e3, 3),
        100.0 * block.energy_error_estimate,
        number(block.cv / 1e6, 1)
    );
    if let (Some(cv), Some(volume)) = (block.cv_equal_volume, block.equal_volume) {
        let _ = write!(text, ", {} at {volume:.0} mm3", number(cv / 1e6, 1));
    }
    let mut lines = vec![("stiffness", text)];
    if let Some(proposal) = &block.proposal {
        let mut text = format!(
            "voxels of {:.0} mm3, u_max {} mm, U {} J ({:.1} % between grids), c*v {} kJ mm3",
            proposal.volume,
            number(proposal.u_max, 3),
            number(proposal.strain_energy / 1e3, 3),
            100.0 * proposal.energy_error_estimate,
            number(proposal.cv / 1e6, 1)
        );
        if let Some(ratio) = proposal.cv_ratio {
            let _ = write!(text, "; at this volume the solid has {ratio:.3} times that");
        }
        lines.push(("optimized", text));
    }
    if let Some(tets) = &block.tetrahedra {
        let mut text = format!(
            "{} ten-node elements of {:.2} mm, u_max {} mm, U {} J ({:.1} % between meshes); the voxels have {:.4} times that",
            tets.elements,
            tets.size,
            number(tets.u_max, 3),
            number(tets.strain_energy / 1e3, 3),
            100.0 * tets.energy_error_estimate,
            tets.voxel_ratio
        );
        if let Some(theirs) = tets.calculix_strain_energy {
            let _ = write!(text, ", CalculiX {:.7}", theirs / tets.strain_energy);
        }
        lines.push(("tets", text));
    }
    if let (Some(stress), Some(p)) = (block.stress_max, block.stress_place) {
        let margin = match block.yield_margin {
            Some(margin) => format!(", margin to yield {:+.0} %", 100.0 * margin),
            None => String::new(),
        };
        let text = format!(
            "von Mises up to {stress:.0} MPa at ({:.1}, {:.1}, {:.1}) mm{margin}",
            p[0], p[1], p[2]
        );
        lines.push(("stress", text));
    }
    lines
}

/// Feeding and solidification.
fn casting(report: &Report) -> Vec<Line> {
    let mut lines = Vec::new();
    if let Some(block) = &report.feed {
        let text = format!(
            "growth {}, {} of {} rules broken before, {} of {} after, {:+.0} mm3",
            block.growth,
            block.violations_before,
            block.rules,
            block.violations,
            block.rules_after,
            block.added_volume
        );
        lines.push(("feeding", text));
    }
    if let Some(block) = &report.repairs {
        let chosen = block.variants.iter().find(|v| v.chosen);
        let text = format!(
            "{} rooms, {} variants, best {} ({})",
            block.rooms.len(),
            block.variants.len(),
            chosen.map_or("none", |v| v.name.as_str()),
            if block.by_stiffness {
                "energy times volume"
            } else {
                "volume only: no loads"
            }
        );
        lines.push(("repairs", text));
    }
    if let Some(block) = &report.mould {
        let text = format!(
            "{} undercuts of {:.0} mm3 along ({:.3}, {:.3}, {:.3}), parting within {:.2} mm, {} findings",
            block.undercuts,
            block.undercut_volume,
            block.draw[0],
            block.draw[1],
            block.draw[2],
            block.parting_flatness,
            block.findings.len()
        );
        lines.push(("mould", text));
    }
    if let Some(block) = &report.solidify {
        let isolated = block.hot_spots.iter().filter(|spot| !spot.fed).count();
        let text = format!(
            "{} solid after {:.0} s, {isolated} isolated hot spots of {:.0} mm3, {:.0} % fed until frozen",
            block.material,
            block.freeze_time,
            block.isolated_volume,
            100.0 * block.directional_fraction
        );
        lines.push(("freezing", text));
    }
    lines
}

#[cfg(test)]
mod tests {
    use grassfire::report::{FileEntry, Limits, SolidBlock, VolumeBlock, judge};

    use super::*;

    #[test]
    fn small_numbers_do_not_become_zero() {
        let found =
            [(8.0786, 3), (0.004_12, 3), (0.0, 1), (-0.000_28, 1)].map(|(v, d)| number(v, d));
        assert_eq!(found, ["8.079", "0.00412", "0.0", "-0.000280"]);
    }

    #[test]
    fn reads_well() {
        let mut report = Report {
            solid: Some(SolidBlock {
                valid: true,
                bodies: 1,
                faces: 104,
                volume: 62_012.4,
                genus: 7,
                ..SolidBlock::default()
            }),
            volume: Some(VolumeBlock {
                proposal: 60_000.0,
                solid: 62_012.4,
                relative_difference: 0.033_54,
            }),
            files: vec![FileEntry {
                path: "part.step".to_owned(),
                ..FileEntry::default()
            }],
            ..Report::default()
        };
        report.checks = judge(&report, &Limits::default());
        insta::assert_snapshot!(text(&report, Path::new("out")), @r"
            solid  valid, 1 body, 104 faces, genus 7, 62012 mm3 (+3.35 %)
           checks  4 of 5 met
          not met  Volume against the proposal: 3.3540 %, at most 2 % (volume.relative_difference)
          written  out/part.step
        ");
    }
}
