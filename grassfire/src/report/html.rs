//! `report.html`: one file, no outside resources, for screen (light and dark) and print.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::format::{bytes, count, number, with_unit};
use super::{
    BodyBlock, Check, DistanceBlock, InputBlock, NonDesignBlock, OptimizeBlock, Picture,
    RemeshBlock, Report, SkeletonBlock, SolidBlock, TopologyBlock, TopologyChangeEntry, papers,
};
use crate::remesh::ChangeKind;
use crate::topology::Betti;

/// Rows of a long table that are shown at once; the rest unfolds.
const SHOWN_ROWS: usize = 12;

/// The page. All text is escaped.
pub fn to_html(report: &Report, pictures: &[Picture]) -> String {
    let name = part_name(report);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (name) " \u{2013} grassfire report" }
                style { (PreEscaped(include_str!("style.css"))) }
            }
            body {
                (header(report, &name))
                (checks(&report.checks))
                (warnings(report))
                (gallery(pictures))
                @if let Some(block) = &report.optimize { (optimize(block)) }
                @if let Some(block) = &report.input { (input(report, block)) }
                @if let Some(block) = &report.remesh { (remesh(block)) }
                @if let Some(block) = &report.topology { (topology(block)) }
                @if let Some(block) = &report.skeleton { (skeleton(block)) }
                @if let Some(block) = &report.body { (body(block)) }
                @if let Some(block) = &report.solid { (solid(block)) }
                (fidelity(report))
                (non_design(&report.non_design))
                (super::editing::section(report))
                (super::verification::section(report))
                (super::repairs::section(report))
                (super::casting::sections(report))
                (super::recognised::section(report))
                (stages(report))
                (files(report))
                (citations(report))
                (footer(report))
            }
        }
    };
    page.into_string()
}

fn part_name(report: &Report) -> String {
    let path = report
        .inputs
        .first()
        .map_or("part", |input| input.path.as_str());
    path.rsplit(['/', '\\']).next().unwrap_or(path).to_owned()
}

fn header(report: &Report, name: &str) -> Markup {
    let missed = report.checks.iter().filter(|check| !check.met).count();
    let seconds: f64 = report.stages.iter().map(|stage| stage.seconds).sum();
    html! {
        header {
            h1 { (name) }
            @if report.checks.is_empty() {
                span .pill.bad { "nothing was checked" }
            } @else if missed == 0 {
                span .pill.good { "all " (report.checks.len()) " checks met" }
            } @else {
                span .pill.bad { (missed) " of " (report.checks.len()) " checks not met" }
            }
            p .soft.command { code { (report.command) } }
        }
        dl .facts {
            @if let Some(solid) = &report.solid {
                (fact("Volume", &with_unit(solid.volume, 5, "mm³")))
                (fact("CAD faces", &count(solid.faces)))
            }
            @if let Some(volume) = &report.volume {
                (fact("Volume difference", &with_unit(100.0 * volume.relative_difference, 3, "%")))
            }
            @if let Some(distance) = &report.distance {
                (fact("Distance, rms", &with_unit(distance.rms, 3, "mm")))
            }
            @if let Some(topology) = &report.topology {
                (fact("Tunnels", &count(topology.solid.b1)))
            }
            @if seconds > 0.0 {
                (fact("Time", &with_unit(seconds, 3, "s")))
            }
        }
    }
}

fn fact(name: &str, value: &str) -> Markup {
    html! { div { dt { (name) } dd { (value) } } }
}

fn checks(checks: &[Check]) -> Markup {
    if checks.is_empty() {
        return html! {};
    }
    html! {
        h2 { "Checks" }
        div .scroll { table {
            thead { tr { th { "Check" } th .n { "Measured" } th .n { "At most" } th { "Verdict" } } }
            tbody {
                @for check in checks {
                    tr {
                        td { (check.text) br; code .soft { (check.name) } }
                        td .n { (with_unit(check.value.unwrap_or(f64::NAN), 3, &check.unit)) }
                        td .n { (with_unit(check.limit, 3, &check.unit)) }
                        td { @if check.met { span .pill.good { "met" } } @else { span .pill.bad { "not met" } } }
                    }
                }
            }
        } }
    }
}

fn warnings(report: &Report) -> Markup {
    if report.warnings.is_empty() {
        return html! {};
    }
    html! {
        h2 { "Warnings" }
        ul { @for warning in &report.warnings { li { b { (warning.stage) } ": " (warning.text) } } }
    }
}

fn gallery(pictures: &[Picture]) -> Markup {
    if pictures.is_empty() {
        return html! {};
    }
    html! {
        h2 { "Pictures" }
        div .gallery {
            @for picture in pictures {
                figure {
                    img alt=(picture.title) src={ "data:image/png;base64," (STANDARD.encode(&picture.png)) };
                    figcaption { b { (picture.title) "." } " " (picture.caption) }
                }
            }
        }
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

fn stages(report: &Report) -> Markup {
    if report.stages.is_empty() {
        return html! {};
    }
    let longest = report
        .stages
        .iter()
        .map(|stage| stage.seconds)
        .fold(1e-9, f64::max);
    html! {
        h2 { "Stages" }
        div .scroll { table {
            thead { tr { th { "Stage" } th .n { "Seconds" } th { "" } th .n { "Peak memory" } } }
            tbody { @for stage in &report.stages {
                tr {
                    td { (stage.name) @if stage.cached { span .soft { " (from an earlier run)" } } }
                    td .n { (number(stage.seconds, 3)) }
                    td .time { span .bar style=(format!("width:{:.1}%", 100.0 * stage.seconds / longest)) {} }
                    td .n { (with_unit(stage.peak_memory, 3, "MB")) }
                }
            } }
        } }
    }
}

fn files(report: &Report) -> Markup {
    if report.files.is_empty() {
        return html! {};
    }
    html! {
        h2 { "Files" }
        div .scroll { table {
            thead { tr { th { "File" } th { "What it holds" } th .n { "Size" } } }
            tbody { @for file in &report.files {
                tr { td { a href=(file.path) { (file.path) } } td { (file.text) } td .n { (bytes(file.bytes)) } }
            } }
        } }
    }
}

fn citations(report: &Report) -> Markup {
    let used: Vec<_> = report
        .papers
        .iter()
        .filter_map(|key| papers::find(key))
        .collect();
    if used.is_empty() {
        return html! {};
    }
    html! {
        h2 { "Papers used" }
        ul { @for paper in used {
            li {
                (paper.citation)
                @if !paper.doi.is_empty() { " " a href={ "https://doi.org/" (paper.doi) } { "doi:" (paper.doi) } }
                span .soft { " \u{2013} " (paper.used_for) }
            }
        } }
    }
}

fn footer(report: &Report) -> Markup {
    html! {
        footer {
            "Made by grassfire " (report.version) ". Lengths in mm, areas in mm², volumes in mm³, angles in degrees. "
            "The same numbers are in report.json."
        }
    }
}

/// snake_case to words.
fn words(kind: &str) -> String {
    kind.replace('_', " ")
}
