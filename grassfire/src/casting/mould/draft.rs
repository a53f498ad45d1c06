//! Draft: the angle between the surface and the draw direction.

use serde::Serialize;

use crate::Vec3;
use crate::mesh::TriMesh;

/// Area by draft.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct DraftClass {
    /// Draft up to this, degrees.
    pub below: f64,
    /// mm2.
    pub area: f64,
    /// Share of the surface.
    pub share: f64,
}

/// Draft of every triangle with its area; degenerate ones have none.
fn each(mesh: &TriMesh, draw: &Vec3) -> impl Iterator<Item = (usize, f64, f64)> {
    (0..mesh.triangles.len()).filter_map(move |t| {
        let [a, b, c] = mesh.corners(t);
        let normal = (b - a).cross(&(c - a)) / 2.0;
        let area = normal.norm();
        (area > 0.0).then(|| {
            let sine = (normal.dot(draw) / area).abs().min(1.0);
            (t, sine.asin().to_degrees(), area)
        })
    })
}

/// Share of the surface with a draft below `limit` degrees.
pub fn low_draft(mesh: &TriMesh, draw: &Vec3, limit: f64) -> f64 {
    let (mut low, mut all) = (0.0, 0.0);
    for (_, draft, area) in each(mesh, draw) {
        all += area;
        low += if draft < limit { area } else { 0.0 };
    }
    low / f64::max(all, 1e-300)
}

/// Areas with a draft below each of `limits`, which ascend.
pub fn draft_classes(mesh: &TriMesh, draw: &Vec3, limits: &[f64]) -> Vec<DraftClass> {
    let all: f64 = each(mesh, draw).map(|e| e.2).sum();
    let class = |&below: &f64| {
        let area: f64 = each(mesh, draw).filter(|e| e.1 < below).map(|e| e.2).sum();
        DraftClass {
            below,
            area,
            share: area / all.max(1e-300),
        }
    };
    limits.iter().map(class).collect()
}

/// The draft that all but `share` of the surface has, degrees: a smooth surface turns through zero at its parting line.
pub fn least_draft(mesh: &TriMesh, draw: &Vec3, share: f64) -> f64 {
    let mut all: Vec<(f64, f64)> = each(mesh, draw).map(|e| (e.1, e.2)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole: f64 = all.iter().map(|e| e.1).sum();
    let mut sum = 0.0;
    for (draft, area) in &all {
        sum += area;
        if sum > share * whole {
            return *draft;
        }
    }
    90.0
}

/// Middle and area of the largest connected-looking patch of low draft: the mean over triangles below `limit`, mm, mm2.
pub fn low_draft_place(mesh: &TriMesh, draw: &Vec3, limit: f64) -> Option<(Vec3, f64)> {
    let low = each(mesh, draw).filter(|e| e.1 < limit);
    // A mean over the whole part may lie in the air: take the largest triangle instead.
    let (t, _, area) = low.max_by(|a, b| a.2.total_cmp(&b.2))?;
    Some((mesh.corners(t).iter().sum::<Vec3>() / 3.0, area))
}
