//! Casting in the report: the blocks of `report.json` and their sections of `report.html`.

use maud::{Markup, html};
use serde::Serialize;

use super::Report;
use super::checks::{Check, DEFECTS, Limits, check};
use super::format::{count, number, with_unit};
use super::recognised::place;
use crate::casting::feed::Monotony;
use crate::casting::mould::{DraftClass, Junction};

/// The feeding edit.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FeedBlock {
    /// Where feeders stand, mm.
    pub feeders: Vec<[f64; 3]>,
    /// Growth of the radius along the way to the feeder, a slope.
    pub growth: f64,
    /// The same as Heuvers' factor between the areas of touching circles.
    pub k_area: f64,
    /// Edges of the skeleton along which sections must grow.
    pub rules: usize,
    /// Of these, where they did not before the edit.
    pub violations_before: usize,
    /// Likewise of the finished body's skeleton.
    pub rules_after: usize,
    /// Of these, where they do not after the edit.
    pub violations: usize,
    /// Largest radius that is still missing, mm.
    pub shortfall: f64,
    /// Metal added to the proposal, mm3.
    pub added_volume: f64,
    /// The same as the skeleton counts it, mm3.
    pub added_volume_skeleton: f64,
    /// Metal of the part over metal poured.
    pub casting_yield: f64,
    /// Ways to the feeders on the medial axis of the proposal: where inscribed balls shrink.
    pub falling_before: Monotony,
    /// The same in the finished part.
    pub falling: Monotony,
    /// Places that need a feeder of their own, in the mode `direction`, mm.
    pub sinks: Vec<[f64; 3]>,
    /// What each feeder feeds.
    pub zones: Vec<FeederBlock>,
    /// Radii bound below what feeding asks for.
    pub infeasible: Vec<InfeasibleBlock>,
}

/// One feeder and its zone.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FeederBlock {
    /// Where it stands, mm.
    pub place: [f64; 3],
    /// Skeleton points that it feeds.
    pub points: usize,
    /// Longest way to it, mm.
    pub reach: f64,
    /// How far it feeds without growth, mm.
    pub limit: f64,
    /// Modulus of the section at its foot, mm.
    pub modulus: f64,
    /// Diameter and height that it needs, mm.
    pub diameter: f64,
    /// Diameter of its neck, mm.
    pub neck: f64,
    /// Its volume, mm3.
    pub volume: f64,
}

/// A radius that is bound below what feeding asks for.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct InfeasibleBlock {
    /// Where, mm.
    pub place: [f64; 3],
    /// Radius wanted, mm.
    pub wanted: f64,
    /// Radius allowed, mm.
    pub limit: f64,
    /// The place that asks for it, mm.
    pub origin: [f64; 3],
    /// Radius there, mm.
    pub origin_radius: f64,
}

/// Verdicts on the blocks that are present.
pub(super) fn judge(report: &Report, limits: &Limits, checks: &mut Vec<Check>) {
    if let Some(feed) = &report.feed {
        let broken = feed.violations as f64;
        let text = "Sections grow towards the feeders along every edge of the skeleton";
        checks.push(check("feed.violations", text, broken, 0.0, DEFECTS));
    }
    if let Some(block) = &report.solidify {
        let text = "Heat is conserved, relative to that of the metal";
        let drift = block.energy_drift.abs();
        checks.push(check("solidify.energy_drift", text, drift, 1e-9, ""));
        if block.feeders > 0 {
            let isolated = block.hot_spots.iter().filter(|spot| !spot.fed);
            let largest = isolated.map(|spot| spot.volume).fold(0.0, f64::max);
            let text = "Largest hot spot that no feeder reaches";
            checks.push(check(
                "solidify.hot_spots",
                text,
                largest,
                limits.hot_spot,
                "mm³",
            ));
        }
    }
}

/// How the part leaves its mould.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct MouldBlock {
    /// Draw direction.
    pub draw: [f64; 3],
    /// Volume of all undercuts, mm3.
    pub undercut_volume: f64,
    /// Separate undercuts.
    pub undercuts: usize,
    /// What they are, largest first.
    pub undercut_places: Vec<UndercutBlock>,
    /// Range of the parting line across its plane, mm.
    pub parting_flatness: f64,
    /// Height of the parting plane along the draw direction, mm.
    pub parting: f64,
    /// Draft of all but the exempt share of the surface, degrees.
    pub min_draft: f64,
    /// Areas by draft.
    pub draft: Vec<DraftClass>,
    /// Wall of all but the exempt share of places, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_wall: Option<f64>,
    /// Thick over thin walls.
    pub wall_ratio: f64,
    /// Change of a wall's thickness over the way along it that all but the exempt share of places have at most.
    pub transition: f64,
    /// Share of the surface that lies beside inner edges whose fillet is too small for the walls.
    pub short_fillets: f64,
    /// Junctions of walls, one of each kind.
    pub junctions: Vec<Junction>,
    /// Rules that are not met.
    pub findings: Vec<FindingBlock>,
    /// Volume of the part, or of the proposal before its skeleton was made, when its undercuts were repaired, mm3.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub repaired_volume: Option<f64>,
    /// Lines with more than one interval before the repair.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub multiple_lines_before: Option<usize>,
    /// And after it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub multiple_lines: Option<usize>,
    /// In the finished part, without what cores make.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub multiple_lines_finished: Option<usize>,
    /// What is undercut on them, mm3.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub undercut_finished: Option<f64>,
}

/// An inner edge between the fitted body and a non-design body that was to get a fillet.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FilletBlock {
    /// Middle of its longest edge, mm.
    pub place: [f64; 3],
    /// Length, mm.
    pub length: f64,
    /// Radius that was wanted, mm.
    pub wanted: f64,
    /// Radius that it has, mm; none where it stays sharp.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// Why it has none or a smaller one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// An undercut.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct UndercutBlock {
    /// Its middle, mm.
    pub place: [f64; 3],
    /// mm3.
    pub volume: f64,
    /// Lowest and highest point along the draw direction, mm.
    pub range: [f64; 2],
}

/// A rule of the foundry that is not met.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FindingBlock {
    /// Name of the rule.
    pub rule: String,
    /// Where, mm.
    pub place: [f64; 3],
    /// What was measured.
    pub value: f64,
    /// What is allowed.
    pub limit: f64,
    /// Where the limit comes from.
    pub source: String,
}

/// How the casting freezes.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SolidifyBlock {
    /// Metal.
    pub material: String,
    /// Mould.
    pub sand: String,
    /// Where their numbers come from.
    pub sources: Vec<String>,
    /// Cells of the grid.
    pub cells: usize,
    /// Edge of a cell, mm.
    pub cell: f64,
    /// Time steps.
    pub steps: usize,
    /// When the casting is solid, s.
    pub freeze_time: f64,
    /// Last-freezing places, latest first.
    pub hot_spots: Vec<HotSpotBlock>,
    /// Volume of those that no feeder reaches, mm3.
    pub isolated_volume: f64,
    /// Its shrinkage, mm3.
    pub shrinkage_volume: f64,
    /// Share of the casting that stays connected to a feeder until it freezes.
    pub directional_fraction: f64,
    /// Share of the casting below the metal's limit of Niyama's criterion.
    pub low_niyama_fraction: f64,
    /// Volume over area, mm.
    pub modulus: f64,
    /// Half thickness of a plate that freezes as late, mm.
    pub thermal_modulus: f64,
    /// Change of the heat in all over the heat of the metal.
    pub energy_drift: f64,
    /// Feeders that were given.
    pub feeders: usize,
}

/// A last-freezing place.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct HotSpotBlock {
    /// Where, mm.
    pub place: [f64; 3],
    /// Metal still open when its last way out closes, mm3.
    pub volume: f64,
    /// When feeding of it ends, s.
    pub time: f64,
    /// How much later than its last way out, s.
    pub persistence: f64,
    /// It is a feeder's.
    pub fed: bool,
    /// To the nearest feeder, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feeder_distance: Option<f64>,
}

/// All sections that the report has blocks for.
pub(super) fn sections(report: &Report) -> Markup {
    html! {
        @if let Some(block) = &report.feed { (feed(block)) }
        @if let Some(block) = &report.mould { (mould(block)) }
        @if !report.fillets.is_empty() { (fillets(&report.fillets)) }
        @if let Some(block) = &report.solidify { (solidify(block)) }
    }
}

fn feed(block: &FeedBlock) -> Markup {
    html! {
        h2 { "Feeding" }
        p .soft { "Sections grow towards the feeders (Heuvers' circles), with the least metal that does it. The rule comes from steel casting; whether it helps is shown by solidification." }
        dl .facts {
            div { dt { "Growth" } dd { (number(block.growth, 3)) " (area factor " (number(block.k_area, 4)) ")" } }
            div { dt { "Rules broken before" } dd { (count(block.violations_before)) " of " (count(block.rules)) } }
            div { dt { "After" } dd { (count(block.violations)) " of " (count(block.rules_after)) } }
            div { dt { "Metal added" } dd { (with_unit(block.added_volume, 4, "mm³")) } }
            div { dt { "Ways to the feeder where balls shrink, before and after" } dd { (with_unit(100.0 * block.falling_before.falling, 3, "%")) ", " (with_unit(100.0 * block.falling.falling, 3, "%")) } }
            @if block.falling.largest > 0.0 {
                div { dt { "Largest fall left" } dd { (with_unit(block.falling.largest, 2, "mm")) ", from " (place(&block.falling.between[0])) " to " (place(&block.falling.between[1])) } }
            }
            div { dt { "Casting yield" } dd { (with_unit(100.0 * block.casting_yield, 3, "%")) } }
        }
        @if !block.zones.is_empty() {
            div .scroll { table {
                thead { tr { th { "Feeder" } th .n { "Farthest point" } th .n { "Reach without growth" } th .n { "Modulus" } th .n { "Diameter and height" } th .n { "Neck" } } }
                tbody {
                    @for zone in &block.zones {
                        tr {
                            td { (place(&zone.place)) }
                            td .n { (with_unit(zone.reach, 3, "mm")) }
                            td .n { (with_unit(zone.limit, 3, "mm")) }
                            td .n { (with_unit(zone.modulus, 3, "mm")) }
                            td .n { (with_unit(zone.diameter, 3, "mm")) }
                            td .n { (with_unit(zone.neck, 3, "mm")) }
                        }
                    }
                }
            } }
        }
    }
}

fn solidify(block: &SolidifyBlock) -> Markup {
    let isolated = block.hot_spots.iter().filter(|spot| !spot.fed).count();
    html! {
        h2 { "Solidification" }
        p .soft { (block.material) " in " (block.sand) ", a thermal check: no filling, gas, graphite expansion or stress." }
        dl .facts {
            div { dt { "Solid after" } dd { (with_unit(block.freeze_time, 4, "s")) } }
            div { dt { "Isolated hot spots" } dd { (count(isolated)) } }
            div { dt { "Their volume" } dd { (with_unit(block.isolated_volume, 3, "mm³")) } }
            div { dt { "Fed until frozen" } dd { (with_unit(100.0 * block.directional_fraction, 3, "%")) } }
            div { dt { "Low Niyama" } dd { (with_unit(100.0 * block.low_niyama_fraction, 3, "%")) } }
            div { dt { "Modulus V/A, thermal" } dd { (number(block.modulus, 3)) ", " (with_unit(block.thermal_modulus, 3, "mm")) } }
            div { dt { "Cells, steps" } dd { (count(block.cells)) ", " (count(block.steps)) } }
        }
        @if !block.hot_spots.is_empty() {
            div .scroll { table {
                thead { tr { th { "Hot spot" } th .n { "Fed until" } th .n { "Later than its way out" } th .n { "Volume" } th { "" } } }
                tbody {
                    @for spot in &block.hot_spots {
                        tr {
                            td { (place(&spot.place)) }
                            td .n { (with_unit(spot.time, 4, "s")) }
                            td .n { (with_unit(spot.persistence, 3, "s")) }
                            td .n { (with_unit(spot.volume, 3, "mm³")) }
                            td { @if spot.fed { span .pill.good { "feeder" } } @else { span .pill.bad { "isolated" } } }
                        }
                    }
                }
            } }
        }
        p .soft { "Sources: " (block.sources.join("; ")) }
    }
}

fn fillets(blocks: &[FilletBlock]) -> Markup {
    let whole: f64 = blocks.iter().map(|one| one.length).sum();
    let rounded = blocks.iter().filter(|one| one.radius.is_some());
    let rounded: f64 = rounded.map(|one| one.length).sum();
    html! {
        h2 { "Fillets" }
        p .soft { "Inner edges between the fitted body and non-design bodies: " (with_unit(rounded, 3, "mm")) " of " (with_unit(whole, 3, "mm")) " have fillets." }
        div .scroll { table {
            thead { tr { th { "Place" } th .n { "Length" } th .n { "Wanted" } th .n { "Radius" } th { "Why not" } } }
            tbody {
                @for one in blocks {
                    tr {
                        td { (place(&one.place)) }
                        td .n { (with_unit(one.length, 3, "mm")) }
                        td .n { (with_unit(one.wanted, 2, "mm")) }
                        td .n { @match one.radius { Some(radius) => (with_unit(radius, 2, "mm")), None => "sharp" } }
                        td { (one.reason.as_deref().unwrap_or_default()) }
                    }
                }
            }
        } }
    }
}

fn mould(block: &MouldBlock) -> Markup {
    html! {
        h2 { "Mould" }
        p .soft { "Two halves that open along " (place(&block.draw)) "; the findings are the foundry's to weigh, not checks of this program." }
        dl .facts {
            div { dt { "Undercuts" } dd { (count(block.undercuts)) } }
            div { dt { "Their volume" } dd { (with_unit(block.undercut_volume, 4, "mm³")) } }
            div { dt { "Parting line leaves its plane by" } dd { (with_unit(block.parting_flatness, 3, "mm")) } }
            div { dt { "Least draft" } dd { (with_unit(block.min_draft, 3, "°")) } }
            @if let Some(wall) = block.min_wall { div { dt { "Least wall" } dd { (with_unit(wall, 3, "mm")) } } }
            div { dt { "Thick to thin walls" } dd { (number(block.wall_ratio, 3)) } }
            div { dt { "Change of thickness over the way" } dd { (number(block.transition, 2)) } }
            div { dt { "Surface beside inner edges with too small a fillet" } dd { (with_unit(100.0 * block.short_fillets, 3, "%")) } }
            @for junction in &block.junctions {
                div { dt { "Ball over wall, " (count(junction.places)) " places of kind " (format!("{:?}", junction.kind)) } dd { (number(junction.ratio, 3)) " at " (place(&junction.place.into())) } }
            }
            @if let Some(volume) = block.repaired_volume { div { dt { "Volume when repaired" } dd { (with_unit(volume, 5, "mm³")) } } }
            @if let (Some(before), Some(after)) = (block.multiple_lines_before, block.multiple_lines) { div { dt { "Lines with hidden gaps, before and after the repair" } dd { (count(before)) ", " (count(after)) } } }
            @if let Some(left) = block.multiple_lines_finished { div { dt { "Such lines in the finished part, without those of cores" } dd { (count(left)) } } }
        }
        @if !block.findings.is_empty() {
            div .scroll { table {
                thead { tr { th .n { "No." } th { "Finding" } th { "Place" } th .n { "Value" } th .n { "Limit" } th { "Source" } } }
                tbody {
                    @for (at, finding) in block.findings.iter().enumerate() {
                        tr {
                            td .n { (count(at + 1)) }
                            td { (finding.rule) }
                            td { (place(&finding.place)) }
                            td .n { (number(finding.value, 4)) }
                            td .n { (number(finding.limit, 4)) }
                            td { (finding.source) }
                        }
                    }
                }
            } }
        }
    }
}
