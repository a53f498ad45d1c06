//! Where an edit acts: regions, and what of a skeleton they hold.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::draft::EditedSkeleton;
use super::error::Refusal;
use super::members::{Member, beam_at, panel_at, sheet_at};
use crate::Vec3;

/// Where an edit acts. It names a place, not points, so that it can be replayed on another proposal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Region {
    /// A box along the axes, mm.
    Box {
        /// Lower corner.
        min: [f64; 3],
        /// Upper corner.
        max: [f64; 3],
    },
    /// A ball, mm.
    Sphere {
        /// Centre.
        centre: [f64; 3],
        /// Radius.
        radius: f64,
    },
    /// The sheet with a place inside its wall, mm.
    Sheet([f64; 3]),
    /// The panel with a place inside its wall, mm: the part of its sheet that is turned by less than 45 degrees against the place.
    Panel([f64; 3]),
    /// The beam with a place inside, from junction to junction, mm.
    Beam([f64; 3]),
}

/// What an edit holds of a skeleton, one flag a point, quad and beam.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Selection {
    pub(super) points: Vec<bool>,
    pub(super) quads: Vec<bool>,
    pub(super) beams: Vec<bool>,
}

impl Selection {
    /// Numbers of the points.
    pub(super) fn held(&self) -> Vec<usize> {
        (0..self.points.len()).filter(|&v| self.points[v]).collect()
    }

    /// The selection, when it has quads or beams.
    pub(super) fn with_cells(&self, draft: &EditedSkeleton) -> Result<&Self, Refusal> {
        if self.quads.contains(&true) || self.beams.contains(&true) {
            return Ok(self);
        }
        let held = self.held();
        Err(Refusal::NoCell {
            points: held.len(),
            place: held
                .first()
                .map(|&v| draft.skeleton.points[v])
                .unwrap_or_default(),
        })
    }
}

/// What `region` holds, everything when there is none.
///
/// Box and ball: the points inside, and the quads and beams with all points inside. Sheet, panel and beam: the whole member, and its
/// points. Points of non-design bodies are never held, quads and beams with nothing else neither.
pub(super) fn select(
    region: Option<&Region>,
    draft: &EditedSkeleton,
) -> Result<Selection, Refusal> {
    match region {
        Some(Region::Sheet(at)) => {
            let member = sheet_at(&draft.skeleton, &Vec3::from(*at))?;
            Ok(of_member(&member, draft))
        }
        Some(Region::Panel(at)) => {
            let member = panel_at(&draft.skeleton, &Vec3::from(*at))?;
            Ok(of_member(&member, draft))
        }
        Some(Region::Beam(at)) => {
            let member = beam_at(&draft.skeleton, &Vec3::from(*at))?;
            Ok(of_member(&member, draft))
        }
        Some(Region::Box { min, max }) => {
            let out = |p: &Vec3, d: usize| (min[d] - p[d]).max(p[d] - max[d]).max(0.0);
            within(draft, |p| Vec3::new(out(p, 0), out(p, 1), out(p, 2)).norm())
        }
        Some(Region::Sphere { centre, radius }) => {
            let centre = Vec3::from(*centre);
            within(draft, |p| ((p - centre).norm() - radius).max(0.0))
        }
        None => within(draft, |_| 0.0),
    }
}

/// Everything at distance 0.
fn within(draft: &EditedSkeleton, distance: impl Fn(&Vec3) -> f64) -> Result<Selection, Refusal> {
    let skeleton = &draft.skeleton;
    let distances: Vec<f64> = skeleton.points.iter().map(distance).collect();
    let free = (0..distances.len()).filter(|&v| !draft.kept[v]);
    let nearest = free.min_by(|&a, &b| distances[a].total_cmp(&distances[b]));
    if nearest.is_none_or(|v| distances[v] > 0.0) {
        return Err(Refusal::Nothing {
            what: "point",
            nearest: nearest.map(|v| skeleton.points[v]).unwrap_or_default(),
            distance: nearest.map_or(f64::INFINITY, |v| distances[v]),
        });
    }
    let points: Vec<bool> = (0..distances.len())
        .map(|v| distances[v] == 0.0 && !draft.kept[v])
        .collect();
    let all = |corners: &[u32]| corners.iter().all(|&v| points[v as usize]);
    Ok(Selection {
        quads: skeleton.quads.iter().map(|q| all(q)).collect(),
        beams: skeleton.beams.iter().map(|b| all(b)).collect(),
        points,
    })
}

fn of_member(member: &Member, draft: &EditedSkeleton) -> Selection {
    let skeleton = &draft.skeleton;
    let free = |corners: &[u32]| corners.iter().any(|&v| !draft.kept[v as usize]);
    let mut out = Selection {
        points: vec![false; skeleton.points.len()],
        quads: vec![false; skeleton.quads.len()],
        beams: vec![false; skeleton.beams.len()],
    };
    let mut hold = |corners: &[u32]| {
        for &v in corners.iter().filter(|&&v| !draft.kept[v as usize]) {
            out.points[v as usize] = true;
        }
    };
    for &q in member.quads.iter().filter(|&&q| free(&skeleton.quads[q])) {
        hold(&skeleton.quads[q]);
        out.quads[q] = true;
    }
    for &b in member.beams.iter().filter(|&&b| free(&skeleton.beams[b])) {
        hold(&skeleton.beams[b]);
        out.beams[b] = true;
    }
    out
}
