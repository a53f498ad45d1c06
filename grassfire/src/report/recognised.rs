//! Tables of what was recognised: surfaces and bosses of the proposal, faces of the design space.

use maud::{Markup, html};

use super::format::{count, number, with_unit};
use super::{CandidateBlock, DesignFaceBlock, Report};

/// Faces shown; all of them are in report.json.
const SHOWN: usize = 40;

/// Both tables; nothing when nothing was looked for.
pub(super) fn section(report: &Report) -> Markup {
    html! {
        @if !report.candidates.is_empty() { (candidates(&report.candidates)) }
        @if !report.design_space.is_empty() { (faces(&report.design_space)) }
    }
}

fn candidates(rows: &[CandidateBlock]) -> Markup {
    html! {
        h2 { "Recognised surfaces" }
        p .soft { "Found in the proposal alone. A boss is a through bore with the sleeve of material around it. "
            "With --recognise list, or with --non-design bodies, bosses are only listed." }
        div .scroll { table {
            thead { tr { th { "Kind" } th .n { "Radius" } th .n { "Outer radius" } th .n { "Length" } th .n { "Angle" }
                th .n { "Covered" } th .n { "Deviation, rms" } th { "Middle, mm" } th { "" } } }
            tbody { @for row in rows {
                tr {
                    td { (row.kind) }
                    td .n { @if let Some(mm) = row.radius { (with_unit(mm, 5, "mm")) } }
                    td .n { @if let Some(mm) = row.outer_radius { (with_unit(mm, 4, "mm")) } }
                    td .n { @if row.radius.is_some() { (with_unit(row.length, 4, "mm")) } }
                    td .n { @if row.radius.is_some() { (number(row.angle, 3)) "°" } }
                    td .n { (with_unit(100.0 * row.coverage, 3, "%")) }
                    td .n { (with_unit(row.rms, 2, "mm")) }
                    td { (place(&row.place)) }
                    td { @if row.used { span .pill.good { "united" } } @else if let Some(reason) = &row.reason { span .soft { (reason) } } }
                }
            } }
        } }
    }
}

fn faces(rows: &[DesignFaceBlock]) -> Markup {
    let area: f64 = rows.iter().map(|row| row.area).sum();
    let kept: f64 = rows
        .iter()
        .filter(|row| row.non_design)
        .map(|row| row.area)
        .sum();
    html! {
        h2 { "Faces of the design space" }
        p { (count(rows.iter().filter(|row| row.non_design).count())) " of " (count(rows.len()))
            " faces are non-design: " (with_unit(100.0 * kept / area.max(f64::MIN_POSITIVE), 3, "%")) " of the area." }
        div .scroll { table {
            thead { tr { th .n { "Face" } th { "Kind" } th .n { "Area" } th .n { "Covered" } th { "Middle, mm" } th { "" } } }
            tbody { @for row in rows.iter().take(SHOWN) {
                tr {
                    td .n { (row.face) }
                    td { (row.kind) }
                    td .n { (with_unit(row.area, 4, "mm²")) }
                    td .n { (with_unit(100.0 * row.coverage, 3, "%")) }
                    td { (place(&row.place)) }
                    td { @if row.non_design { span .pill.good { "non-design" } } }
                }
            } }
        } }
        @if rows.len() > SHOWN { p .soft { "The other " (rows.len() - SHOWN) " faces are in report.json." } }
    }
}

pub(super) fn place(at: &[f64; 3]) -> String {
    format!("({:.2}, {:.2}, {:.2})", at[0], at[1], at[2])
}
