//! Selections of points that are no nodes: the surface of a finished part.

use std::path::Path;

use super::build::in_bodies;
use super::select::Nodes;
use super::{Case, CaseError, Selector};
use crate::Vec3;
use crate::monitor::Monitor;

/// Points that selections are made on.
pub(crate) struct Places<'a> {
    nodes: Nodes<'a>,
}

impl<'a> Places<'a> {
    /// `slack`: length that the tolerances of selections are a share of, mm; 0 asks for what lies inside.
    ///
    /// # Errors
    /// [`CaseError`] when the file of a body cannot be read.
    pub fn new(
        case: &'a Case,
        folder: &'a Path,
        places: Vec<Vec3>,
        slack: f64,
        monitor: &Monitor,
    ) -> Result<Self, CaseError> {
        let count = places.len();
        let asked = |s: &Selector| matches!(s, Selector::Body { .. });
        let bodies = if case.select.values().any(asked) {
            near_bodies(case, folder, &places, slack, monitor)?
        } else {
            vec![vec![false; count]; case.non_design.len()]
        };
        Ok(Self {
            nodes: Nodes {
                case,
                folder,
                places,
                slack,
                active: vec![true; count],
                frozen: vec![false; count],
                bodies,
            },
        })
    }

    /// Indices of the points that a selection holds, ascending.
    ///
    /// # Errors
    /// [`CaseError`] when there is no such selection or its file cannot be read.
    pub fn select(&self, name: &str, monitor: &Monitor) -> Result<Vec<usize>, CaseError> {
        let selector = self.nodes.case.find(name, "select")?;
        let found = self.nodes.select(selector, monitor)?;
        Ok((0..found.len()).filter(|&i| found[i]).collect())
    }
}

/// For every body which points lie in it or no farther than `slack` away along an axis: points of a surface that a part
/// shares with a body lie neither in nor out.
fn near_bodies(
    case: &Case,
    folder: &Path,
    places: &[Vec3],
    slack: f64,
    monitor: &Monitor,
) -> Result<Vec<Vec<bool>>, CaseError> {
    let mut out = in_bodies(case, folder, places, monitor)?;
    if slack == 0.0 {
        return Ok(out);
    }
    for (axis, sign) in (0..6).map(|i| (i / 2, if i % 2 == 0 { slack } else { -slack })) {
        let move_one = |p: &Vec3| {
            let mut p = *p;
            p[axis] += sign;
            p
        };
        let moved: Vec<Vec3> = places.iter().map(move_one).collect();
        let found = in_bodies(case, folder, &moved, monitor)?;
        for (sum, found) in out.iter_mut().zip(found) {
            sum.iter_mut().zip(found).for_each(|(s, f)| *s |= f);
        }
    }
    Ok(out)
}
