//! Tables of what the stages of an optimization and of a reconstruction gave.

use maud::{Markup, html};

use super::format::{count, number, with_unit};
use super::{
    BodyBlock, DistanceBlock, InputBlock, NonDesignBlock, OptimizeBlock, RemeshBlock, Report,
    SkeletonBlock, SolidBlock, TopologyBlock, TopologyChangeEntry,
};
use crate::remesh::ChangeKind;
use crate::topology::Betti;

/// Rows of a long table that are shown at once; the rest unfolds.
const SHOWN_ROWS: usize = 12;

/// The tables of the stages that ran, in their order.
pub(super) fn sections(report: &Report) -> Markup {
    html! {
        @if let Some(block) = &report.optimize { (optimize(block)) }
        @if let Some(block) = &report.input { (input(report, block)) }
        @if let Some(block) = &report.remesh { (remesh(block)) }
        @if let Some(block) = &report.topology { (topology(block)) }
        @if let Some(block) = &report.skeleton { (skeleton(block)) }
        @if let Some(block) = &report.body { (body(block)) }
        @if let Some(block) = &report.solid { (solid(block)) }
        (fidelity(report))
        (non_design(&report.non_design))
    }
}

/// A two-column table of names and values.
fn pairs(rows: &[(&str, String)]) -> Markup {
    html! {
        div .scroll { table .pairs { tbody {
            @for (name, value) in rows { tr { td { (name) } td .n { (value) } } }
        } } }
    }
}

fn input(report: &Report, block: &InputBlock) -> Markup {
    html! {
        h2 { "Input and repairs" }
        @for file in &report.inputs {
            p { code { (file.path) } br; span .soft { "SHA-256 " code { (file.sha256) } } }
        }
        (pairs(&[
            ("Triangles", count(block.triangles)),
            ("Volume after repair", with_unit(block.volume, 5, "mm³")),
            ("Open edges", count(block.open_edges)),
            ("Edges with more than two triangles", count(block.non_manifold_edges)),
            ("Separate pieces", count(block.components)),
        ]))
        @if block.repairs.is_empty() {
            p .soft { "Nothing had to be repaired." }
        } @else {
            div .scroll { table {
                thead { tr { th { "Repair" } th .n { "Count" } th { "What was done" } } }
                tbody { @for repair in &block.repairs {
                    tr { td { (words(&repair.kind)) } td .n { (count(repair.count)) } td { (repair.text) } }
                } }
            } }
        }
    }
}

fn optimize(block: &OptimizeBlock) -> Markup {
    let [nx, ny, nz] = block.grid;
    html! {
        h2 { "Topology optimization" }
        (pairs(&[
            ("Voxel", with_unit(block.voxel, 4, "mm")),
            ("Grid", format!("{nx} × {ny} × {nz}")),
            ("Voxels of the space", count(block.elements)),
            ("Iterations", count(block.iterations)),
            ("Ended by itself", if block.converged { "yes" } else { "no" }.to_owned()),
            ("Volume fraction", with_unit(block.volume_fraction, 4, "")),
            ("Compliance, first iteration", with_unit(block.first_compliance, 6, "N mm")),
            ("Compliance, last iteration", with_unit(block.compliance, 6, "N mm")),
            ("Grayness", with_unit(block.grayness, 3, "")),
            ("Pieces", count(block.components)),
            ("Volume of full voxels", with_unit(block.volume, 5, "mm³")),
            ("Undercut volume", with_unit(block.undercut_volume, 3, "mm³")),
            ("Time of an iteration", with_unit(block.seconds_per_iteration, 3, "s")),
            ("Iterations of the solver", with_unit(block.solver_iterations, 3, "")),
        ]))
    }
}

fn remesh(block: &RemeshBlock) -> Markup {
    let (shown, folded) = block.changes.split_at(block.changes.len().min(SHOWN_ROWS));
    html! {
        h2 { "Voxel remesh" }
        (pairs(&[
            ("Voxel", with_unit(block.voxel, 4, "mm")),
            ("Triangles", count(block.triangles)),
            ("Volume", with_unit(block.volume, 5, "mm³")),
            ("Largest distance from the input", with_unit(block.distance_max, 3, "mm")),
            ("Genus before clean-up", count(block.genus_before)),
            ("Genus after clean-up", count(block.genus_after)),
        ]))
        @if block.changes.is_empty() {
            p .soft { "The topology was not changed." }
        } @else {
            h3 { "Changes of topology (" (block.changes.len()) ")" }
            (change_table(shown))
            @if !folded.is_empty() {
                details { summary { (folded.len()) " more, smaller ones" } (change_table(folded)) }
            }
        }
    }
}

fn change_table(changes: &[TopologyChangeEntry]) -> Markup {
    html! {
        div .scroll { table {
            thead { tr { th { "Change" } th .n { "x, mm" } th .n { "y, mm" } th .n { "z, mm" } th .n { "Size, mm" } } }
            tbody { @for change in changes {
                tr {
                    td { (change_name(change.kind)) }
                    @for x in change.place { td .n { (number(x, 4)) } }
                    td .n { (number(change.size, 3)) }
                }
            } }
        } }
    }
}

fn change_name(kind: ChangeKind) -> &'static str {
    match kind {
        ChangeKind::TunnelClosed => "tunnel closed",
        ChangeKind::CavityFilled => "cavity filled",
        ChangeKind::BridgeCut => "bridge cut",
        ChangeKind::IslandDropped => "island dropped",
    }
}

fn topology(block: &TopologyBlock) -> Markup {
    let rows = [
        ("Solid (voxels)", block.solid),
        ("Medial complex", block.complex),
        ("Skeleton", block.skeleton),
    ];
    html! {
        h2 { "Topology" }
        p .soft { "Solid, complex and skeleton must agree; the closed surface of the body has twice their Euler number. Where non-design bodies were cut out before the skeleton these are the figures of what was left." }
        div .scroll { table {
            thead { tr {
                th { "Stage" } th .n { "Pieces" } th .n { "Tunnels" } th .n { "Cavities" } th .n { "Euler number" } th { "" }
            } }
            tbody {
                @for (name, betti) in rows {
                    tr { td { (name) } (betti_cells(betti)) td { (agreement(betti == block.solid)) } }
                }
                @if let Some(united) = block.united {
                    tr { td { "Union with the non-design bodies, wanted" } (betti_cells(united)) td {} }
                }
                @if !block.body.is_empty() {
                    @let chi: i64 = block.body.iter().map(|surface| surface.chi).sum();
                    tr {
                        td { "Body (" (count(block.body.len())) " closed surfaces)" }
                        td .n colspan="3" { "genus " (count(block.body.iter().map(|s| s.genus).sum::<i64>())) }
                        td .n { (count(chi)) }
                        td { (agreement(chi == 2 * block.skeleton.chi && block.body.iter().all(|s| s.closed && s.manifold))) }
                    }
                }
            }
        } }
    }
}

fn betti_cells(betti: Betti) -> Markup {
    html! { @for n in [betti.b0, betti.b1, betti.b2, betti.chi] { td .n { (count(n)) } } }
}

fn agreement(equal: bool) -> Markup {
    html! { @if equal { span .pill.good { "equal" } } @else { span .pill.bad { "differs" } } }
}

fn limits(block: &SkeletonBlock) -> &'static str {
    match (block.steady, block.wedges) {
        (true, true) => "steady, tips of wedges kept",
        (true, false) => "steady",
        (false, _) => "usual",
    }
}

fn skeleton(block: &SkeletonBlock) -> Markup {
    html! {
        h2 { "Skeleton" }
        @if let Some(why) = &block.regular_refused {
            p { "The regular layout of its quads was given up: " (why) "." }
        }
        @if let Some(why) = &block.steady_refused {
            p { "The steady limits of sheets and members were given up: " (why) "." }
        }
        (pairs(&[
            ("Layout", block.layout.clone()),
            ("Limits", limits(block).to_owned()),
            ("Voxel", with_unit(block.voxel, 3, "mm")),
            ("Quads", count(block.quads)),
            ("Beams", count(block.beams)),
            ("Sheets", count(block.sheets)),
            ("Seams", count(block.seams)),
            ("Rims", count(block.rims)),
            ("Medial spheres", count(block.spheres)),
            ("Regular inner points", with_unit(100.0 * block.regular_fraction, 3, "%")),
            ("Corner deviation from 90°, mean", with_unit(block.corner_deviation.mean, 3, "°")),
            ("Corner deviation from 90°, 95 %", with_unit(block.corner_deviation.p95, 3, "°")),
            ("Corner deviation from 90°, worst", with_unit(block.corner_deviation.max, 3, "°")),
            ("Radius, smallest", with_unit(block.radius.min, 3, "mm")),
            ("Radius, median", with_unit(block.radius.median, 3, "mm")),
            ("Radius, largest", with_unit(block.radius.max, 3, "mm")),
        ]))
    }
}

fn body(block: &BodyBlock) -> Markup {
    html! {
        h2 { "Body" }
        (pairs(&[
            ("Quads", count(block.quads)),
            ("Extraordinary points", count(block.extraordinary)),
            ("Faces that cut each other", count(block.self_intersections)),
        ]))
    }
}

fn solid(block: &SolidBlock) -> Markup {
    html! {
        h2 { "CAD solid" }
        (pairs(&[
            ("Valid", if block.valid { "yes" } else { "no" }.to_owned()),
            ("Bodies", count(block.bodies)),
            ("Faces", count(block.faces)),
            ("Volume", with_unit(block.volume, 6, "mm³")),
            ("Surface", with_unit(block.area, 6, "mm²")),
            ("Genus", count(block.genus)),
            ("Largest kink across smooth edges", with_unit(block.g1_max, 3, "°")),
            ("Jump of curvature, largest", with_unit(block.curvature_jump.max, 2, "1/mm")),
            ("Shortest edge", with_unit(block.shortest_edge, 3, "mm")),
            ("Largest tolerance", with_unit(block.max_tolerance, 3, "mm")),
            ("Volume by the CAD kernel against ours, relative", number(block.volume_check, 3)),
        ]))
    }
}

fn fidelity(report: &Report) -> Markup {
    let mut rows = report
        .distance
        .as_ref()
        .map(distance_rows)
        .unwrap_or_default();
    if let Some(volume) = &report.volume {
        rows.push((
            "Volume of the proposal",
            with_unit(volume.proposal, 5, "mm³"),
        ));
        rows.push(("Volume of the solid", with_unit(volume.solid, 5, "mm³")));
        rows.push((
            "Relative difference",
            with_unit(100.0 * volume.relative_difference, 3, "%"),
        ));
    }
    if rows.is_empty() {
        return html! {};
    }
    html! {
        h2 { "Distance and volume against the proposal" }
        p .soft { "Distances count from the solid to the proposal and back; non-design regions are left out." }
        (pairs(&rows))
    }
}

fn distance_rows(block: &DistanceBlock) -> Vec<(&'static str, String)> {
    let both = |mm: f64| {
        format!(
            "{} ({})",
            with_unit(mm, 3, "mm"),
            with_unit(mm / block.voxel, 3, "voxels")
        )
    };
    let mut rows = vec![
        ("Distance, rms", both(block.rms)),
        ("Distance, 95 %", both(block.p95)),
        ("Distance, largest", both(block.max)),
    ];
    if let Some(mm) = block.non_design_max {
        rows.push((
            "Non-design faces to the given bodies, largest",
            with_unit(mm, 3, "mm"),
        ));
    }
    rows
}

fn non_design(bodies: &[NonDesignBlock]) -> Markup {
    if bodies.is_empty() {
        return html! {};
    }
    html! {
        h2 { "Non-design bodies" }
        div .scroll { table {
            thead { tr { th { "Body" } th { "Source" } th .n { "Faces" } th .n { "Analytic surface" } th { "In the solid" } } }
            tbody { @for body in bodies {
                tr {
                    td { (body.name) }
                    td { code { (body.source) } }
                    td .n { (count(body.faces)) }
                    td .n { (with_unit(100.0 * body.coverage, 3, "%")) }
                    td { @if body.kept { span .pill.good { "kept" } } @else { span .pill.bad { "not kept" } } }
                }
            } }
        } }
    }
}

/// snake_case to words.
fn words(kind: &str) -> String {
    kind.replace('_', " ")
}
