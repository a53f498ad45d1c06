//! Which faces of a design space given as CAD the proposal still follows.

use rayon::prelude::*;

use super::{Boss, DomainOptions};
use crate::Vec3;
use crate::mesh::bvh::nearest_on_triangle;
use crate::mesh::{Bvh, TriMesh};
use crate::monitor::{Cancelled, Monitor};

/// How much of a CAD face the proposal covers.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FaceCoverage {
    /// Area, mm2.
    pub area: f64,
    /// Middle, mm.
    pub middle: Vec3,
    /// Share of the area that the proposal follows.
    pub coverage: f64,
    /// Covered enough to be a non-design face.
    pub non_design: bool,
}

/// Sample points along a face's triangles are about this far apart, tolerances.
const SPACING: f64 = 1.0;
/// Most samples a triangle's side.
const MOST: f64 = 64.0;

/// Matches every face of a design space with the proposal.
///
/// `faces` is the design space's tessellation; tags tell the CAD face of each triangle. A point of a face is covered when
/// a triangle of the proposal lies within `tolerance` mm of it and its normal is within `options.normal_angle` of the
/// face's. The share of covered area decides.
///
/// Limits: a proposal that runs parallel to a face within the tolerance cannot be told from one that lies on it.
///
/// # Errors
/// [`Cancelled`].
pub fn coverage(
    faces: &TriMesh,
    proposal: &TriMesh,
    tolerance: f64,
    options: &DomainOptions,
    monitor: &Monitor,
) -> Result<Vec<FaceCoverage>, Cancelled> {
    monitor.step("recognise", "design space", 0.0)?;
    let bvh = Bvh::new(proposal);
    let cosine = options.normal_angle.to_radians().cos();
    let shares: Vec<f64> = (0..faces.triangles.len())
        .into_par_iter()
        .map(|t| {
            monitor.check()?;
            Ok(covered(
                &faces.corners(t),
                proposal,
                &bvh,
                tolerance,
                cosine,
            ))
        })
        .collect::<Result<_, Cancelled>>()?;
    let count = faces
        .tags
        .iter()
        .map(|f| *f as usize + 1)
        .max()
        .unwrap_or(0);
    let mut out = vec![FaceCoverage::default(); count];
    for (t, share) in shares.iter().enumerate() {
        let Some(face) = faces.tags.get(t).and_then(|f| out.get_mut(*f as usize)) else {
            continue;
        };
        let ([a, b, c], area) = (faces.corners(t), faces.triangle_area(t));
        face.area += area;
        face.coverage += area * share;
        face.middle += (a + b + c) * (area / 3.0);
    }
    for face in out.iter_mut().filter(|f| f.area > 0.0) {
        face.coverage /= face.area;
        face.middle /= face.area;
        face.non_design = face.coverage >= options.min_coverage;
    }
    Ok(out)
}

/// Share of a triangle that is covered.
fn covered(corners: &[Vec3; 3], proposal: &TriMesh, bvh: &Bvh, tolerance: f64, cosine: f64) -> f64 {
    let [a, b, c] = *corners;
    let Some(normal) = (b - a).cross(&(c - a)).try_normalize(0.0) else {
        return 0.0;
    };
    let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
    let n = (longest / (SPACING * tolerance)).ceil().clamp(1.0, MOST) as usize;
    let (mut hits, mut all) = (0usize, 0usize);
    // Middles of the n * n small triangles.
    for i in 0..n {
        for j in 0..n - i {
            for up in 0..=usize::from(i + j + 1 < n) {
                let third = if up == 0 { 1.0 } else { 2.0 } / 3.0;
                let (u, v) = ((i as f64 + third) / n as f64, (j as f64 + third) / n as f64);
                let p = a + (b - a) * u + (c - a) * v;
                all += 1;
                hits += usize::from(follows(&p, &normal, proposal, bvh, tolerance, cosine));
            }
        }
    }
    hits as f64 / all as f64
}

fn follows(
    p: &Vec3,
    normal: &Vec3,
    proposal: &TriMesh,
    bvh: &Bvh,
    tolerance: f64,
    cosine: f64,
) -> bool {
    let alike = |t: u32| {
        let [a, b, c] = proposal.corners(t as usize);
        let cross = (b - a).cross(&(c - a));
        cross.dot(normal) >= cosine * cross.norm() && cross != Vec3::zeros()
    };
    let Some(hit) = bvh.nearest(p, tolerance) else {
        return false;
    };
    if alike(hit.triangle) {
        return true;
    }
    // Beside an edge the nearest triangle may belong to the other side of it.
    let reach = Vec3::repeat(tolerance);
    let mut found = false;
    bvh.for_each_in_box(&(p - reach), &(p + reach), |t| {
        found = found
            || alike(t)
                && (nearest_on_triangle(p, &proposal.corners(t as usize)) - p).norm() <= tolerance;
    });
    found
}

/// Bosses whose bore wall is a covered face of the design space take radius and axis from there.
///
/// `bores` are the design space's cylindrical holes: origin, direction, radius. Gives the bosses that lie on one.
pub fn sleeves(bosses: &[Boss], bores: &[(Vec3, Vec3, f64)], tolerance: f64) -> Vec<Boss> {
    let on = |boss: &Boss, (origin, direction, radius): &(Vec3, Vec3, f64)| {
        let middle = boss.origin + boss.direction * ((boss.extent[0] + boss.extent[1]) / 2.0);
        let from = middle - origin;
        boss.direction.dot(direction).abs() > 0.999
            && (from - direction * from.dot(direction)).norm() <= tolerance
            && (boss.radius - radius).abs() <= tolerance
    };
    let mut out = Vec::new();
    for boss in bosses {
        if let Some((origin, direction, radius)) = bores.iter().find(|bore| on(boss, bore)) {
            let mut exact = boss.clone();
            let shift = (boss.origin - origin).dot(direction);
            let sign = boss.direction.dot(direction).signum();
            (exact.origin, exact.direction, exact.radius) = (*origin, *direction, *radius);
            exact.outer_radius += radius - boss.radius;
            exact.extent = boss.extent.map(|t| shift + sign * t);
            exact.extent.sort_by(f64::total_cmp);
            exact.residual = 0.0;
            out.push(exact);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    /// A cuboid from 0 to `size`, tags are the six faces.
    fn cuboid(size: Vec3) -> TriMesh {
        TriMesh {
            tags: (0..12).map(|t| t / 2).collect(),
            ..shapes::cuboid(Vec3::zeros(), size)
        }
    }

    fn run(proposal: &TriMesh) -> Vec<FaceCoverage> {
        let space = cuboid(Vec3::new(20.0, 10.0, 5.0));
        coverage(
            &space,
            proposal,
            0.5,
            &DomainOptions::default(),
            &Monitor::default(),
        )
        .expect("not cancelled")
    }

    #[test]
    fn its_own_faces_are_all_covered() {
        let same = cuboid(Vec3::new(20.0, 10.0, 5.0));
        assert!(same.volume() > 0.0);
        let faces = run(&same);
        assert_eq!(faces.len(), 6);
        assert!(faces.iter().all(|f| f.non_design && f.coverage > 0.999));
        assert!((faces.iter().map(|f| f.area).sum::<f64>() - 700.0).abs() < 1e-9);
    }

    #[test]
    fn a_face_that_moved_is_not_covered() {
        let faces = run(&cuboid(Vec3::new(20.0, 10.0, 3.0)));
        let top: Vec<bool> = faces.iter().map(|f| f.non_design).collect();
        // The top moved by 2 mm; the four sides are 60 % covered, the bottom is still there.
        assert_eq!(top, [true, false, false, false, false, false]);
    }

    #[test]
    fn a_face_turned_inside_out_is_not_covered() {
        let mut inside_out = cuboid(Vec3::new(20.0, 10.0, 5.0));
        inside_out.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        assert!(run(&inside_out).iter().all(|f| f.coverage == 0.0));
        assert!(run(&TriMesh::default()).iter().all(|f| !f.non_design));
    }
}
