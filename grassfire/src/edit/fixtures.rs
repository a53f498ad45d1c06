//! Small skeletons for the tests of edits.

use super::draft::EditedSkeleton;
use super::list::{Edit, edit};
use super::region::Region;
use crate::Vec3;
use crate::skeleton::Skeleton;

/// The edges of an octahedron of radius 20 mm as twelve beams of three edges each, radius 2 mm.
pub(super) fn frame() -> Skeleton {
    let mut out = Skeleton::default();
    for d in 0..3 {
        for sign in [1.0, -1.0] {
            let mut p = Vec3::zeros();
            p[d] = 20.0 * sign;
            out.points.push(p);
        }
    }
    for a in 0..6_u32 {
        for b in a + 1..6 {
            if a / 2 == b / 2 {
                continue;
            }
            let [p, q] = [a, b].map(|v| out.points[v as usize]);
            let n = out.points.len() as u32;
            out.points
                .extend([p + (q - p) / 3.0, p + (q - p) * 2.0 / 3.0]);
            out.beams.extend([[a, n], [n, n + 1], [n + 1, b]]);
        }
    }
    out.radii = vec![2.0; out.points.len()];
    out
}

/// A base of 4 by 3 quads of 10 mm in the plane z = 0, and on it in the plane x = 20 a web of 2 rows; radius 2 mm.
pub(super) fn tee() -> Skeleton {
    let mut out = Skeleton::default();
    for y in 0..4_u32 {
        for x in 0..5_u32 {
            out.points
                .push(Vec3::new(f64::from(x), f64::from(y), 0.0) * 10.0);
        }
    }
    for y in 0..3 {
        for x in 0..4 {
            let a = 5 * y + x;
            out.quads.push([a, a + 1, a + 6, a + 5]);
        }
    }
    let base = |y: u32| 5 * y + 2;
    for z in 1..3_u32 {
        for y in 0..4_u32 {
            out.points
                .push(Vec3::new(2.0, f64::from(y), f64::from(z)) * 10.0);
        }
    }
    let web = |y: u32, z: u32| {
        if z == 0 {
            base(y)
        } else {
            20 + 4 * (z - 1) + y
        }
    };
    for z in 0..2 {
        for y in 0..3 {
            out.quads
                .push([web(y, z), web(y + 1, z), web(y + 1, z + 1), web(y, z + 1)]);
        }
    }
    out.radii = vec![2.0; out.points.len()];
    out
}

/// A list that must do, without kept points.
pub(super) fn run(skeleton: &Skeleton, edits: &[Edit]) -> EditedSkeleton {
    edit(skeleton, &vec![false; skeleton.points.len()], edits, 0.5).expect("good edits")
}

/// An edit within a ball, its kind yet to be said.
pub(super) fn at_ball(centre: [f64; 3], radius: f64) -> Edit {
    Edit {
        within: Some(Region::Sphere { centre, radius }),
        ..Edit::default()
    }
}
