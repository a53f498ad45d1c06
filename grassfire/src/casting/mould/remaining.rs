//! What is still undercut in a finished part, without what cores make.

use super::dexels::{Dexels, dexels};
use super::repair::RepairOptions;
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::remesh::Capsule;

/// A core's place is at most so many voxels from its undercut.
const NEAR: f64 = 3.0;
/// The kernel's rounding and that of its triangles on the wall of a bore, mm.
const ROUNDING: f64 = 1e-4;

/// A gap between two intervals of material on a line.
#[derive(Debug, Clone, Copy)]
struct Gap {
    line: usize,
    range: [f64; 2],
}

/// Lines of a part along the unit vector `draw` that meet it in more than one interval, and its undercut, mm3, both without what
/// cores make: the bores and the undercuts at the places of `options`.
///
/// Exact lines through the triangles, no farther apart than the voxels of the repair. Voxels of the finished part would tell less:
/// beside the upright face of a non-design body their values waver about zero by some hundredths of a voxel, and such a line
/// seems to leave the part and come back.
pub fn remaining(part: &TriMesh, draw: &Vec3, options: &RepairOptions) -> (usize, f64) {
    let [along, beside, _] = super::dexels::axes(draw).map(|axis| {
        let places = part.points.iter().map(|p| p.dot(&axis));
        let ends = places.fold([f64::INFINITY, f64::NEG_INFINITY], |e, x| {
            [e[0].min(x), e[1].max(x)]
        });
        ends[1] - ends[0]
    });
    if part.points.is_empty() {
        return (0, 0.0);
    }
    let count = (along.max(beside) / options.cell).ceil().max(1.0);
    let dexels = dexels(part, draw, count as usize);
    let mut gaps = Vec::new();
    for line in 0..dexels.dims[0] * dexels.dims[1] {
        for pair in dexels.line(line).windows(2) {
            let range = [pair[0][1], pair[1][0]];
            gaps.push(Gap { line, range });
        }
    }
    let cored = at_places(&gaps, &dexels, &options.cores, NEAR * options.cell);
    let (mut lines, mut length) = (Vec::new(), 0.0);
    for (gap, _) in gaps.iter().zip(cored).filter(|(_, cored)| !cored) {
        let left = outside(gap, &dexels, &options.bores);
        if left > ROUNDING {
            lines.push(gap.line);
            length += left;
        }
    }
    lines.dedup();
    (lines.len(), length * dexels.pitch * dexels.pitch)
}

/// Which gaps belong to the cores at `places`: the nearest gap, and all that overlap with it from line to line.
fn at_places(gaps: &[Gap], dexels: &Dexels, places: &[Vec3], near: f64) -> Vec<bool> {
    let mut out = vec![false; gaps.len()];
    let first = |line: usize| gaps.partition_point(|g| g.line < line);
    let away = |gap: &Gap, place: &Vec3| {
        let z = place.dot(&dexels.axes[2]);
        (dexels.place(gap.line, z.clamp(gap.range[0], gap.range[1])) - place).norm()
    };
    for place in places {
        let distances = gaps.iter().map(|gap| away(gap, place));
        let nearest = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        let mut stack: Vec<usize> = nearest
            .iter()
            .filter(|n| n.1 <= near)
            .map(|n| n.0)
            .collect();
        while let Some(g) = stack.pop() {
            if std::mem::replace(&mut out[g], true) {
                continue;
            }
            let gap = gaps[g];
            for line in dexels.beside(gap.line) {
                let there = (first(line)..gaps.len()).take_while(|&h| gaps[h].line == line);
                let meets = |h: &usize| {
                    let with = gaps[*h].range;
                    gap.range[0] < with[1] && with[0] < gap.range[1]
                };
                stack.extend(there.filter(meets));
            }
        }
    }
    out
}

/// Length of a gap that lies in none of the bores, mm.
fn outside(gap: &Gap, dexels: &Dexels, bores: &[Capsule]) -> f64 {
    let foot = dexels.place(gap.line, 0.0);
    let mut inside: Vec<[f64; 2]> = bores
        .iter()
        .filter_map(|bore| within(bore, &foot, &dexels.axes[2]))
        .collect();
    inside.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let [mut from, to] = gap.range;
    let mut left = 0.0;
    for [begin, end] in inside {
        left += (begin.min(to) - from).max(0.0);
        from = from.max(end).min(to);
    }
    left + (to - from)
}

/// Where the line from `foot` along `draw` lies in the cylinder of a bore, mm.
fn within(bore: &Capsule, foot: &Vec3, draw: &Vec3) -> Option<[f64; 2]> {
    let length = (bore.b - bore.a).norm();
    let axis = (bore.b - bore.a).try_normalize(1e-12)?;
    let across = |v: &Vec3| v - axis * v.dot(&axis);
    let (start, way) = (across(&(foot - bore.a)), across(draw));
    let radius = bore.radius + ROUNDING;
    // |start + t way|^2 = radius^2
    let (a, half, c) = (
        way.norm_squared(),
        start.dot(&way),
        start.norm_squared() - radius * radius,
    );
    let mut range = if a > 1e-12 {
        let root = (half * half - a * c).sqrt();
        (!root.is_nan()).then_some([(-half - root) / a, (-half + root) / a])?
    } else {
        (c <= 0.0).then_some([f64::NEG_INFINITY, f64::INFINITY])?
    };
    let (begin, slope) = ((foot - bore.a).dot(&axis), draw.dot(&axis));
    if slope.abs() > 1e-9 {
        let ends = [0.0, length].map(|t| (t - begin) / slope);
        range = [
            range[0].max(ends[0].min(ends[1])),
            range[1].min(ends[0].max(ends[1])),
        ];
    } else if !(-ROUNDING..=length + ROUNDING).contains(&begin) {
        return None;
    }
    (range[0] < range[1]).then_some(range)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::casting::mould::Repair;
    use crate::mesh::shapes::cuboid;
    use crate::remesh::Bosses;

    fn asked(cores: Vec<Vec3>, bores: Vec<Capsule>) -> RepairOptions {
        RepairOptions {
            kind: Repair::Fill,
            fill_cost: 0.5,
            draft: 0.0,
            parting: 0.0,
            cell: 1.0,
            cores,
            cores_may_close: false,
            bores,
            walls: TriMesh::default(),
            removals: Vec::new(),
            min_gap: 0.0,
        }
    }

    /// An upright plate of 8 x 30 x 30 mm, turned by 1.7 degrees about z, with a window of 10 x 10 mm across and a groove of
    /// 20 mm and 2 x 3 mm along its foot.
    fn plate() -> TriMesh {
        let mut mesh = TriMesh::default();
        for (lo, hi) in [
            ([-4.0, -15.0, 5.0], [4.0, 15.0, 20.0]),
            ([-4.0, -15.0, -5.0], [4.0, -5.0, 5.0]),
            ([-4.0, 5.0, -5.0], [4.0, 15.0, 5.0]),
            ([-4.0, -15.0, -10.0], [2.0, 15.0, -5.0]),
            ([2.0, -15.0, -7.0], [4.0, 15.0, -5.0]),
            ([2.0, -15.0, -10.0], [4.0, -10.0, -7.0]),
            ([2.0, 10.0, -10.0], [4.0, 15.0, -7.0]),
            ([-4.0, -15.0, -15.0], [4.0, 15.0, -10.0]),
        ] {
            let part = cuboid(Vec3::from(lo), Vec3::from(hi));
            mesh.append(part.points.iter().copied(), part.triangles.iter().copied());
        }
        let (sin, cos) = 1.7_f64.to_radians().sin_cos();
        for p in &mut mesh.points {
            (p.x, p.y) = (cos * p.x - sin * p.y, sin * p.x + cos * p.y);
        }
        mesh
    }

    /// Voxels of the part had dozens of lines beside the upright faces of exact lugs that left them and came back by a hundredth
    /// of a voxel.
    #[test]
    fn upright_faces_are_no_undercut_and_a_bore_is_its_core() {
        let (part, z) = (plate(), Vec3::z());
        let (lines, volume) = remaining(&part, &z, &asked(vec![], vec![]));
        assert!((85..=115).contains(&lines), "{lines} lines");
        assert!((volume - (800.0 + 120.0)).abs() < 60.0, "{volume} mm3");
        let bore = Capsule {
            a: Vec3::new(-6.0, 0.0, 0.0),
            b: Vec3::new(6.0, 0.0, 0.0),
            radius: 7.3,
        };
        for (cores, bores) in [(vec![Vec3::zeros()], vec![]), (vec![], vec![bore])] {
            let (lines, volume) = remaining(&part, &z, &asked(cores, bores));
            assert!((volume - 120.0).abs() < 15.0, "{volume} mm3 of the groove");
            assert!((30..=50).contains(&lines), "{lines} lines of the groove");
        }
        let groove = vec![Vec3::zeros(), Vec3::new(3.0, 0.0, -8.5)];
        assert_eq!(remaining(&part, &z, &asked(groove, vec![])), (0, 0.0));
    }

    /// What stood over the rim of an eye had a rounded mouth around the bore: its lines were counted, though the bore's core makes it.
    #[test]
    fn the_rounded_mouth_of_a_bore_is_its_core() {
        let [bore, free] = [4.0, 8.0].map(|half| Capsule {
            a: Vec3::new(-half, 0.0, 0.0),
            b: Vec3::new(half, 0.0, 0.0),
            radius: 3.0,
        });
        let cored = Bosses {
            bores: vec![bore],
            free: vec![free],
            ..Bosses::default()
        };
        let cored = cored.cored();
        // A lip of 2 mm beside the eye, open from z = -4 to 4, and as much in the eye itself.
        let mut lips = TriMesh::default();
        for (from, to) in [(4.0, 6.0), (0.0, 2.0)] {
            for z in [-8.0, 4.0] {
                let lip = cuboid(Vec3::new(from, -1.0, z), Vec3::new(to, 1.0, z + 4.0));
                lips.append(lip.points.iter().copied(), lip.triangles.iter().copied());
            }
            let (lines, volume) = remaining(&lips, &Vec3::z(), &asked(vec![], cored.clone()));
            let most = if from > 0.0 { 0.0 } else { 8.0 };
            assert!((volume - most).abs() < 3.0, "{volume} mm3 on {lines} lines");
        }
    }
}
