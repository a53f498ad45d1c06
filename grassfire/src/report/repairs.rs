//! The search for the best repair of undercuts in the report: its block of `report.json` and its section of `report.html`.

use maud::{Markup, html};
use serde::Serialize;

use super::Report;
use super::format::{count, number, with_unit};

/// The variants of a repair, beside each other.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RepairsBlock {
    /// Draw direction.
    pub draw: [f64; 3],
    /// Ranked by strain energy times volume; else by volume alone, because no loads were given.
    pub by_stiffness: bool,
    /// What a core counts as, mm3 of metal.
    pub core_price: f64,
    /// Undercuts for which there is a choice, largest first.
    pub rooms: Vec<RoomBlock>,
    /// What was tried, in this order.
    pub variants: Vec<VariantBlock>,
}

/// A connected undercut.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RoomBlock {
    /// A place in it, mm.
    pub place: [f64; 3],
    /// mm3.
    pub volume: f64,
    /// Material on its lesser side, mm3.
    pub lesser: f64,
}

/// One variant.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct VariantBlock {
    /// Its name, and that of its folder in `repairs`.
    pub name: String,
    /// What is done about each room: `fill`, `core`, `remove`, `turn`.
    pub ways: Vec<String>,
    /// Cores that it needs for them.
    pub cores: usize,
    /// Of the finished part, mm3.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume: Option<f64>,
    /// N mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub strain_energy: Option<f64>,
    /// Strain energy times volume, or volume, with cores as metal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cost: Option<f64>,
    /// Lines of voxels of the proposal with more than one interval; cores count as material.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lines_before: Option<usize>,
    /// The same after the repair.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lines_repaired: Option<usize>,
    /// The same of the finished part, whose upright walls waver.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lines: Option<usize>,
    /// Undercut of the finished part without cores, mm3.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub undercut: Option<f64>,
    /// The CAD kernel's verdict.
    pub valid: bool,
    /// Checks that it meets.
    pub checks_met: usize,
    /// Checks in all.
    pub checks: usize,
    /// Time of its stages.
    pub seconds: f64,
    /// Why it could not be made or proved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// It is the part.
    pub chosen: bool,
}

/// The section of the page, when the report has the block.
pub(super) fn section(report: &Report) -> Markup {
    let Some(block) = &report.repairs else {
        return html! {};
    };
    let figure =
        |value: Option<f64>, digits: usize| value.map_or_else(String::new, |v| number(v, digits));
    let lines = |value: Option<usize>| value.map_or_else(String::new, count);
    html! {
        h2 { "Repairs of undercuts" }
        p {
            (count(block.rooms.len())) " rooms that only a core makes. "
            @if block.by_stiffness { "The best variant has the least strain energy times volume" }
            @else { "Without loads the best variant has the least volume" }
            ", where a core counts as " (with_unit(block.core_price, 4, "mm³")) " of metal. Those that meet all checks go first."
        }
        div .scroll { table {
            thead { tr {
                th { "Variant" } th .n { "Volume, mm³" } th .n { "Energy, N mm" } th .n { "Cores" } th .n { "Cost" }
                th .n { "Lines before" } th .n { "repaired" } th .n { "part" } th .n { "Undercut, mm³" } th .n { "Checks" } th { "" }
            } }
            tbody {
                @for row in &block.variants {
                    tr {
                        td { (row.name) @if row.chosen { " (the part)" } }
                        td .n { (figure(row.volume, 6)) }
                        td .n { (figure(row.strain_energy, 5)) }
                        td .n { (count(row.cores)) }
                        td .n { (figure(row.cost, 5)) }
                        td .n { (lines(row.lines_before)) }
                        td .n { (lines(row.lines_repaired)) }
                        td .n { (lines(row.lines)) }
                        td .n { (figure(row.undercut, 4)) }
                        td .n { (count(row.checks_met)) " of " (count(row.checks)) }
                        td { @if let Some(error) = &row.error { (error) } @else if !row.valid { "not valid" } }
                    }
                }
            }
        } }
    }
}
