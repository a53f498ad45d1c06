//! The foundry's sheet: what a part breaks of the rules.

use super::draft;
use super::rules::{Limit, Rules};
use super::walls::Wall;
use super::{Finding, JunctionKind, Mould};
use crate::Vec3;
use crate::mesh::TriMesh;

/// Where the extremes are that a [`Mould`] gives as numbers.
pub(super) struct Places<'a> {
    pub(super) thin: Option<&'a Wall>,
    pub(super) thick: Option<&'a Wall>,
    pub(super) steep: Option<Vec3>,
}

/// The rules that a part breaks, each with a place, a value, a limit and its source.
pub(super) fn findings(
    mould: &Mould,
    mesh: &TriMesh,
    places: &Places,
    rules: &Rules,
) -> Vec<Finding> {
    let mut out = leaving(mould, mesh, rules);
    out.extend(walls(mould, places, rules));
    out.extend(edges(mould, rules));
    out
}

/// Undercuts that are findings of their own; all are listed elsewhere.
const LISTED: usize = 10;

fn finding(rule: &str, place: Vec3, value: f64, limit: Limit) -> Finding {
    Finding {
        rule: rule.to_owned(),
        place,
        value,
        limit: limit.value,
        source: limit.source.to_owned(),
    }
}

/// Undercuts, parting, draft.
fn leaving(mould: &Mould, mesh: &TriMesh, rules: &Rules) -> Vec<Finding> {
    let mut out = Vec::new();
    let cores = rules.cores();
    if mould.undercuts.len() as f64 > cores.value {
        for undercut in mould.undercuts.iter().take(LISTED) {
            let limit = Limit {
                value: 0.0,
                ..cores
            };
            out.push(finding("undercut", undercut.place, undercut.volume, limit));
        }
    }
    let flatness = rules.flatness();
    if mould.parting_flatness > flatness.value {
        let (lo, hi) = mesh.bounds().unwrap_or_default();
        let centre = (lo + hi) / 2.0;
        let place = centre + (mould.parting - centre.dot(&mould.draw)) * mould.draw;
        out.push(finding(
            "parting_flatness",
            place,
            mould.parting_flatness,
            flatness,
        ));
    }
    let draft = rules.draft();
    if mould.min_draft < draft.value
        && let Some((place, _)) = draft::low_draft_place(mesh, &mould.draw, draft.value)
    {
        out.push(finding("min_draft", place, mould.min_draft, draft));
    }
    out
}

/// Thin walls, unequal walls, steps.
fn walls(mould: &Mould, places: &Places, rules: &Rules) -> Vec<Finding> {
    let mut out = Vec::new();
    let wall = rules.wall();
    if let Some(thin) = places.thin.filter(|thin| thin.thickness < wall.value) {
        out.push(finding("min_wall", thin.place, thin.thickness, wall));
    }
    let ratio = rules.ratio();
    if mould.wall_ratio > ratio.value {
        let place = places.thick.map_or_else(Vec3::zeros, |wall| wall.place);
        out.push(finding("wall_ratio", place, mould.wall_ratio, ratio));
    }
    let step = rules.step();
    if let Some(place) = places.steep.filter(|_| mould.transition > step.value) {
        out.push(finding("transition", place, mould.transition, step));
    }
    out
}

/// Fillets, gaps and holes, junctions.
fn edges(mould: &Mould, rules: &Rules) -> Vec<Finding> {
    let mut out = Vec::new();
    let rounding = rules.rounding();
    for edge in &mould.inner_edges.fillets {
        let limit = Limit {
            value: 2.0 * rounding.value * edge.wall,
            ..rounding
        };
        out.push(finding("fillet", edge.place, edge.value, limit));
    }
    for gap in &mould.inner_edges.gaps {
        out.push(finding("min_hole", gap.place, gap.value, rules.hole()));
    }
    let ball = rules.ball();
    for junction in mould.junctions.iter().filter(|j| j.ratio > ball.value) {
        let rule = match junction.kind {
            JunctionKind::L => "junction_l",
            JunctionKind::V => "junction_v",
            JunctionKind::T => "junction_t",
            JunctionKind::Y => "junction_y",
            JunctionKind::X => "junction_x",
        };
        out.push(finding(rule, junction.place, junction.ratio, ball));
    }
    out
}
