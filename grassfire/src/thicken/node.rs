//! Vertices where several pieces meet: the ring rule and the polyhedron rule.

use std::f64::consts::{FRAC_PI_4, TAU};

use nalgebra::{Matrix3, Rotation3, SymmetricEigen};

use super::complex::{Complex, Fan, coherent_signs};
use super::{ThickenOptions, perpendicular, unit};
use crate::Vec3;

/// What a ring joins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Item {
    /// Index of a fan.
    Fan(usize),
    /// Far vertex of a beam.
    Beam(u32),
}

/// Pieces in cyclic order about an axis.
#[derive(Debug, Clone)]
pub(super) struct Ring {
    pub axis: Vec3,
    /// Counter-clockwise about the axis.
    pub items: Vec<Item>,
    /// Direction of the middle of the gap after each item, and half the gap's angle.
    pub gaps: Vec<(Vec3, f64)>,
}

/// The ring of vertex `v`, or `None` when the rule does not apply: a piece is no plain fan, a beam
/// runs along the axis, or there is nothing to join.
pub(super) fn ring(
    complex: &Complex,
    v: u32,
    fans: &[Fan],
    options: &ThickenOptions,
) -> Option<Ring> {
    let beams = &complex.beam_neighbours[v as usize];
    let nothing_to_join = match fans.len() {
        0 => beams.len() < 3,
        1 => beams.is_empty(),
        _ => false,
    };
    if nothing_to_join || fans.iter().any(|fan| !fan.plain) {
        return None;
    }
    let at = complex.at(v);
    let beam_directions: Vec<Vec3> = beams.iter().map(|&w| unit(complex.at(w) - at)).collect();
    let axis = if fans.is_empty() {
        best_axis(&beam_directions)
    } else {
        mean_normal(complex, fans)
    };
    let limit = options.axis_angle.to_radians().cos();
    if beam_directions.iter().any(|d| d.dot(&axis).abs() > limit) {
        return None;
    }
    let across = perpendicular(&axis);
    let up = axis.cross(&across);
    let angle = |d: &Vec3| d.dot(&up).atan2(d.dot(&across));
    let fan_direction = |fan: &Fan| {
        unit(
            fan.corners
                .iter()
                .map(|&(q, _)| complex.centres[q as usize] - at)
                .sum(),
        )
    };
    let mut order: Vec<(f64, Item)> = fans
        .iter()
        .enumerate()
        .map(|(i, fan)| (angle(&fan_direction(fan)), Item::Fan(i)))
        .chain(
            beams
                .iter()
                .zip(&beam_directions)
                .map(|(&w, d)| (angle(d), Item::Beam(w))),
        )
        .collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let count = order.len();
    let gaps = (0..count)
        .map(|k| {
            let turn = if k + 1 == count { TAU } else { 0.0 };
            let (from, to) = (order[k].0, order[(k + 1) % count].0 + turn);
            let middle = (from + to) / 2.0;
            (across * middle.cos() + up * middle.sin(), (to - from) / 2.0)
        })
        .collect();
    Some(Ring {
        axis,
        items: order.into_iter().map(|o| o.1).collect(),
        gaps,
    })
}

fn mean_normal(complex: &Complex, fans: &[Fan]) -> Vec3 {
    let mut sum = Vec3::zeros();
    for fan in fans {
        let signs = coherent_signs(complex, fan);
        let normals = fan
            .corners
            .iter()
            .zip(&signs)
            .map(|(&(q, _), s)| *s * complex.normals[q as usize]);
        let normal = unit(normals.sum());
        sum += if sum.dot(&normal) < 0.0 {
            -normal
        } else {
            normal
        };
    }
    unit(sum)
}

/// The direction farthest from all beams: that of least variance unless another is clearly better.
fn best_axis(directions: &[Vec3]) -> Vec3 {
    let spread: Matrix3<f64> = directions.iter().map(|d| d * d.transpose()).sum();
    let eigen = SymmetricEigen::new(spread);
    let least: Vec3 = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into();
    let score = |n: &Vec3| {
        directions
            .iter()
            .map(|d| d.dot(n).abs())
            .fold(0.0, f64::max)
            + 0.2 * crowding(directions, n)
    };
    let mut best = (score(&least) - 0.05, least);
    for candidate in hemisphere(200) {
        let s = score(&candidate);
        if s < best.0 {
            best = (s, candidate);
        }
    }
    unit(best.1)
}

/// 0 when the directions are evenly spread about `axis`, 1 when two coincide.
fn crowding(directions: &[Vec3], axis: &Vec3) -> f64 {
    let across = perpendicular(axis);
    let up = axis.cross(&across);
    let mut angles: Vec<f64> = directions
        .iter()
        .map(|d| d.dot(&up).atan2(d.dot(&across)))
        .collect();
    angles.sort_by(f64::total_cmp);
    let count = angles.len();
    let gap =
        |k: usize| angles[(k + 1) % count] - angles[k] + if k + 1 == count { TAU } else { 0.0 };
    let narrowest = (0..count).map(gap).fold(TAU, f64::min);
    1.0 - narrowest * count as f64 / TAU
}

/// Evenly spread directions with z > 0 (golden spiral).
fn hemisphere(count: usize) -> impl Iterator<Item = Vec3> {
    let golden = TAU * 0.618_033_988_749_894_9;
    (0..count).map(move |i| {
        let z = (i as f64 + 0.5) / count as f64;
        let r = (1.0 - z * z).sqrt();
        let turn = golden * i as f64;
        Vec3::new(r * turn.cos(), r * turn.sin(), z)
    })
}

/// A closed quad polyhedron around a beam node with one quad a beam.
#[derive(Debug, Clone)]
pub(super) struct Polyhedron {
    /// Corners relative to the node, in units of the radius.
    pub corners: Vec<Vec3>,
    /// Quads, counter-clockwise seen from outside.
    pub quads: Vec<[u32; 4]>,
    /// Quad of each beam.
    pub quad_of_beam: Vec<u32>,
}

/// A rotated cube, its sides divided n x n, n as small as gives every direction a quad of its own
/// within 40 degrees of it.
pub(super) fn polyhedron(directions: &[Vec3]) -> Polyhedron {
    let enough = 40f64.to_radians().cos();
    let least = (1..).find(|n| 6 * n * n >= directions.len()).unwrap_or(1);
    let mut best: Option<(f64, Polyhedron)> = None;
    for n in least..=least.max(3) {
        let (corners, quads) = divided_cube(n);
        let normals: Vec<Vec3> = quads
            .iter()
            .map(|q| unit(q.iter().map(|&c| corners[c as usize]).sum()))
            .collect();
        for rotation in rotations(directions) {
            let turned: Vec<Vec3> = normals.iter().map(|m| rotation * m).collect();
            let (quad_of_beam, worst, mean) = assign(directions, &turned);
            let score = worst + 0.1 * mean;
            if best.as_ref().is_none_or(|b| score > b.0 + 1e-9) {
                let corners = corners.iter().map(|c| rotation * c).collect();
                best = Some((
                    score,
                    Polyhedron {
                        corners,
                        quads: quads.clone(),
                        quad_of_beam,
                    },
                ));
            }
        }
        if best.as_ref().is_some_and(|b| b.0 > enough + 0.09) {
            break;
        }
    }
    best.map(|b| b.1).expect("at least one rotation was tried")
}

/// Rotations that put a cube axis along one direction and another near a second one, and a spread
/// of others; fewer for crowded nodes, where the assignment costs more.
fn rotations(directions: &[Vec3]) -> Vec<Rotation3<f64>> {
    let frame = |x: &Vec3, hint: &Vec3| {
        let z = x.cross(hint).try_normalize(1e-6)?;
        Some(Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[
            *x,
            z.cross(x),
            z,
        ])))
    };
    let some = directions.len().min(8);
    let mut list = Vec::new();
    for i in 0..some {
        list.extend(
            (0..some)
                .filter(|&j| j != i)
                .filter_map(|j| frame(&directions[i], &directions[j])),
        );
    }
    let spread = (2400 / directions.len().max(8)).max(8);
    for (i, x) in hemisphere(spread).enumerate() {
        let across = perpendicular(&x);
        let turn = 2.399_963 * i as f64;
        list.extend(frame(
            &x,
            &(across * turn.cos() + x.cross(&across) * turn.sin()),
        ));
    }
    list
}

/// Gives every direction its own quad, best pairs first, then swaps while the worst improves.
/// Returns the quads and the worst and mean cosine.
fn assign(directions: &[Vec3], normals: &[Vec3]) -> (Vec<u32>, f64, f64) {
    let cosine = |b: usize, q: usize| directions[b].dot(&normals[q]);
    let mut pairs: Vec<(f64, usize, usize)> = (0..directions.len())
        .flat_map(|b| (0..normals.len()).map(move |q| (cosine(b, q), b, q)))
        .collect();
    pairs.sort_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2).cmp(&(y.1, y.2))));
    let mut quad_of = vec![usize::MAX; directions.len()];
    let mut taken = vec![false; normals.len()];
    for &(_, b, q) in &pairs {
        if quad_of[b] == usize::MAX && !taken[q] {
            quad_of[b] = q;
            taken[q] = true;
        }
    }
    if directions.len() <= 12 {
        for _ in 0..8 {
            let mut changed = false;
            for a in 0..directions.len() {
                for b in 0..a {
                    let (p, q) = (quad_of[a], quad_of[b]);
                    if cosine(a, q).min(cosine(b, p)) > cosine(a, p).min(cosine(b, q)) + 1e-12 {
                        quad_of.swap(a, b);
                        changed = true;
                    }
                }
            }
            if !changed {
                break;
            }
        }
    }
    let cosines: Vec<f64> = quad_of
        .iter()
        .enumerate()
        .map(|(b, &q)| cosine(b, q))
        .collect();
    let mean = cosines.iter().sum::<f64>() / cosines.len().max(1) as f64;
    let worst = cosines.iter().copied().fold(1.0, f64::min);
    (quad_of.iter().map(|&q| q as u32).collect(), worst, mean)
}

/// Cube with n x n quads a side; corners at .75 for n = 1, on the unit sphere for finer ones.
fn divided_cube(n: usize) -> (Vec<Vec3>, Vec<[u32; 4]>) {
    let side = n + 1;
    let mut index = vec![u32::MAX; side * side * side];
    let mut corners = Vec::new();
    let mut corner = |at: [usize; 3]| {
        let slot = &mut index[(at[2] * side + at[1]) * side + at[0]];
        if *slot == u32::MAX {
            *slot = corners.len() as u32;
            let even = at.map(|i| (FRAC_PI_4 * (2.0 * i as f64 / n as f64 - 1.0)).tan());
            let p = Vec3::from(even);
            corners.push(if n == 1 { 0.75 * p } else { unit(p) });
        }
        *slot
    };
    let mut quads = Vec::with_capacity(6 * n * n);
    for axis in 0..3 {
        for outer in [0, n] {
            for i in 0..n {
                for j in 0..n {
                    let mut at = |i: usize, j: usize| {
                        let mut c = [0; 3];
                        c[axis] = outer;
                        c[(axis + 1) % 3] = i;
                        c[(axis + 2) % 3] = j;
                        corner(c)
                    };
                    let quad = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                    let [a, b, c, d] = quad;
                    quads.push(if outer == 0 { [d, c, b, a] } else { quad });
                }
            }
        }
    }
    (corners, quads)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spline::catmull_clark::QuadTopology;

    #[test]
    fn divided_cubes_are_closed_and_face_outward() {
        for n in 1..5 {
            let (corners, quads) = divided_cube(n);
            let topology = QuadTopology::new(corners.len(), &quads).expect("closed");
            assert_eq!(topology.euler(), 2);
            for q in &quads {
                let [a, b, c, _] = q.map(|i| corners[i as usize]);
                assert!((b - a).cross(&(c - b)).dot(&(a + c)) > 0.0);
            }
        }
    }

    #[test]
    fn cubic_axes_get_the_plain_cube() {
        let tilt = Rotation3::from_euler_angles(0.3, 0.5, 0.7);
        let axes: Vec<Vec3> = [Vec3::x(), Vec3::y(), Vec3::z()]
            .iter()
            .flat_map(|a| [tilt * a, -(tilt * a)])
            .collect();
        let cube = polyhedron(&axes);
        assert_eq!(cube.quads.len(), 6);
        for (d, &q) in axes.iter().zip(&cube.quad_of_beam) {
            let centre: Vec3 = cube.quads[q as usize]
                .iter()
                .map(|&c| cube.corners[c as usize])
                .sum();
            assert!(unit(centre).dot(d) > 0.999_999);
        }
    }

    #[test]
    fn crowded_nodes_still_give_every_beam_its_own_quad() {
        let many: Vec<Vec3> = hemisphere(70).collect();
        let mut quads = polyhedron(&many).quad_of_beam;
        quads.sort_unstable();
        quads.dedup();
        assert_eq!(quads.len(), 70);
    }
}
