//! The list of edits in the report: the block of `report.json` and its section of `report.html`.

use std::fmt::Display;

use maud::{Markup, html};
use serde::Serialize;

use super::Report;
use super::format::{count, with_unit};
use crate::edit::Edited;

/// The list of edits.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct EditBlock {
    /// Volume of the proposal before the edits, mm3.
    pub volume_before: f64,
    /// And after them, mm3.
    pub volume_after: f64,
    /// What each did, in their order.
    pub edits: Vec<Edited>,
}

/// The section of the page, when the report has the block.
pub(super) fn section(report: &Report) -> Markup {
    let Some(block) = &report.edits else {
        return html! {};
    };
    html! {
        h2 { "Edits" }
        p {
            "The proposal had " (with_unit(block.volume_before, 5, "mm³")) " and has " (with_unit(block.volume_after, 5, "mm³"))
            " after them. Distances are measured to the edited proposal (edited.stl)."
        }
        div .scroll { table {
            thead { tr {
                th { "Edit" } th { "Kind" } th .n { "Points" } th .n { "Mean radius before" } th .n { "after" }
                th .n { "Largest change" } th .n { "Farthest way" } th .n { "Quads" } th .n { "Sheets" } th .n { "Beams" }
                th .n { "Pieces" } th .n { "Loops" } th .n { "Cavities" }
            } }
            tbody {
                @for (number, edit) in block.edits.iter().enumerate() {
                    @let (before, after) = (&edit.before, &edit.after);
                    tr {
                        td { (number) }
                        td { (edit.kind) }
                        td .n { (count(edit.points)) }
                        td .n { (with_unit(edit.mean_before, 4, "mm")) }
                        td .n { (with_unit(edit.mean_after, 4, "mm")) }
                        td .n { (with_unit(edit.largest_change, 4, "mm")) }
                        td .n { (with_unit(edit.moved, 4, "mm")) }
                        td .n { (change(before.quads, after.quads)) }
                        td .n { (change(before.sheets, after.sheets)) }
                        td .n { (change(before.beams, after.beams)) }
                        td .n { (change(before.topology.b0, after.topology.b0)) }
                        td .n { (change(before.topology.b1, after.topology.b1)) }
                        td .n { (change(before.topology.b2, after.topology.b2)) }
                    }
                }
            }
        } }
    }
}

/// A figure before and after, once when it stays.
fn change<T: PartialEq + Display>(before: T, after: T) -> String {
    if before == after {
        return after.to_string();
    }
    format!("{before} → {after}")
}
