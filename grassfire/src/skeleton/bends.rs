//! Beams after coarsening: bends that they cut, and balls without a direction.

use super::complex::{Class, Complex};
use super::reference::Reference;
use crate::Vec3;

/// A bend is at least this share of the length of the edge that cuts it away from both of its ends.
const BEND_SHARE: f64 = 0.3;

/// Splits beams that cut a bend: an edge may subtend at most about 80 degrees.
pub(crate) fn bend_beams(c: &mut Complex, reference: &Reference, unit: f64) {
    for _ in 0..4 {
        let beams: Vec<[u32; 2]> = c.alive_beams().collect();
        let mut split = false;
        for [a, b] in beams {
            let ends = [a, b].map(|v| c.points[v as usize]);
            let middle = (ends[0] + ends[1]) / 2.0;
            let Some((x, r)) = reference.on_arc(&middle, Class::Beam, &ends) else {
                continue;
            };
            let (sagitta, length) = ((x - middle).norm(), c.length(a, b));
            // A node that was merged is off its arcs: the nearest place is then the end of one, beside the other end.
            let between = ends
                .iter()
                .all(|end| (x - end).norm() > BEND_SHARE * length);
            if between && length > 2.0 * unit && sagitta > 0.18 * length && sagitta < 0.6 * length {
                c.split(a, b, x, r);
                split = true;
            }
        }
        if !split {
            break;
        }
    }
    c.compact();
}

/// A component that shrank to one short beam (a ball) gets half a radius of length, so that it has a direction.
pub(crate) fn lengthen_balls(c: &mut Complex) {
    let tip = |c: &Complex, v: u32| {
        c.vertex_beams[v as usize].len() == 1 && c.vertex_triangles[v as usize].is_empty()
    };
    let beams: Vec<[u32; 2]> = c.alive_beams().collect();
    for [a, b] in beams {
        let (i, j) = (a as usize, b as usize);
        let wanted = 0.25 * (c.radii[i] + c.radii[j]);
        let d = c.points[j] - c.points[i];
        if tip(c, a) && tip(c, b) && d.norm() < wanted {
            let direction = if d.norm() > 1e-9 * wanted {
                d.normalize()
            } else {
                Vec3::x()
            };
            let centre = (c.points[i] + c.points[j]) / 2.0;
            c.points[i] = centre - direction * (wanted / 2.0);
            c.points[j] = centre + direction * (wanted / 2.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::arcs;
    use super::*;

    const NONE: [[u32; 3]; 0] = [];

    fn chain(points: Vec<Vec3>) -> Complex {
        let radii = vec![2.0; points.len()];
        let beams: Vec<[u32; 2]> = (1..points.len() as u32).map(|v| [v - 1, v]).collect();
        Complex::new(points, radii, &NONE, &beams)
    }

    fn reference(fine: Vec<Vec3>) -> Reference {
        let c = chain(fine);
        Reference::new(&c, &arcs::trace(&c), 0.05, true)
    }

    #[test]
    fn a_beam_to_a_node_beside_its_arc_was_split_four_times_at_the_end_of_the_arc() {
        let along = |x: u32| Vec3::new(f64::from(x), 0.0, 0.0);
        let reference = reference((0..9).map(along).collect());
        // Merging moved the node off the arc.
        let mut c = chain(vec![along(0), along(8), Vec3::new(12.0, 3.0, 0.0)]);
        bend_beams(&mut c, &reference, 1.0);
        assert_eq!(c.alive_beams().count(), 2);
    }

    #[test]
    fn a_beam_that_cuts_a_third_of_a_circle_is_split_on_it() {
        let at = |degrees: f64| {
            10.0 * Vec3::new(degrees.to_radians().cos(), degrees.to_radians().sin(), 0.0)
        };
        let reference = reference((0..=20).map(|k| at(6.0 * f64::from(k))).collect());
        let mut c = chain(vec![at(0.0), at(120.0)]);
        bend_beams(&mut c, &reference, 1.0);
        assert!(c.alive_beams().count() >= 2);
        assert!(c.points.iter().all(|p| (p.norm() - 10.0).abs() < 0.1));
    }
}
