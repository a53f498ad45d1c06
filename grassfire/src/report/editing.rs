//! Edits of radii in the report: the block of `report.json` and its section of `report.html`.

use maud::{Markup, html};
use serde::Serialize;

use super::Report;
use super::format::{count, with_unit};
use crate::edit::RadiusEdited;

/// The list of edits.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct EditBlock {
    /// Volume of the proposal before the edits, mm3.
    pub volume_before: f64,
    /// And after them, mm3.
    pub volume_after: f64,
    /// What each did, in their order.
    pub edits: Vec<RadiusEdited>,
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
            thead { tr { th { "Edit" } th .n { "Points" } th .n { "Mean radius before" } th .n { "after" } th .n { "Largest change" } } }
            tbody {
                @for (number, edit) in block.edits.iter().enumerate() {
                    tr {
                        td { (number) }
                        td .n { (count(edit.points)) }
                        td .n { (with_unit(edit.mean_before, 4, "mm")) }
                        td .n { (with_unit(edit.mean_after, 4, "mm")) }
                        td .n { (with_unit(edit.largest_change, 4, "mm")) }
                    }
                }
            }
        } }
    }
}
