//! `report.html`: one file, no outside resources, for screen (light and dark) and print.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::format::{bytes, count, number, with_unit};
use super::{Check, Picture, Report, papers};

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
                (super::results::sections(report))
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
