//! From a coarse layout of quads to quads of the wanted size: every chord is split into a whole number of strips.
//!
//! A chord is a row of quads, each side facing the opposite one; over a seam it branches into all sheets. As a quad has the same
//! count on opposite sides, any whole number a chord gives quads again, and all new vertices are regular: the layout decides
//! how many irregular ones there are.

use super::coarsen::Sizing;
use super::complex::Class;
use super::edges::{UnionFind, edge};
use super::polygons::{Polygon, edge_table};
use super::reference::Reference;
use crate::Vec3;

/// Most strips of one chord.
const MOST: usize = 16;
/// A new vertex is put onto a sheet, rim or seam that is nearer than this share of the side it is on.
const REACH: f64 = 0.5;

/// Splits the chords so that sides have about the wanted length.
///
/// 1. Sides that face each other in a quad are of one chord.
/// 2. A chord gets as many strips as its sides are too long, in the geometric mean, rounded.
/// 3. New vertices on sides go onto the fine rims, seams and sheets, those inside a quad (Coons' interpolation of its sides)
///    onto the sheets.
pub(crate) fn split_chords(
    points: &mut Vec<Vec3>,
    radii: &mut Vec<f64>,
    polygons: &mut Vec<Option<Polygon>>,
    reference: &Reference,
    wanted: &Sizing,
) {
    let sides: Vec<([u32; 2], Class)> = edge_table(polygons)
        .iter()
        .map(|(side, quads)| match quads.len() {
            1 => (side, Class::Rim),
            2 => (side, Class::Interior),
            _ => (side, Class::Seam),
        })
        .collect();
    let strips = strips(points, radii, polygons, &sides, wanted);
    let mut splitter = Splitter {
        points,
        radii,
        reference,
    };
    let rows: Vec<Vec<u32>> = sides
        .iter()
        .zip(strips)
        .map(|(&(side, class), n)| splitter.side(side, class, n))
        .collect();
    let row = |a: u32, b: u32| {
        let mut row = position(&sides, a, b).map_or(vec![a, b], |i| rows[i].clone());
        if row[0] != a {
            row.reverse();
        }
        row
    };
    for p in std::mem::take(polygons).into_iter().flatten() {
        let Some([a, b, c, d]) = p.as_quad() else {
            polygons.push(Some(p));
            continue;
        };
        let [bottom, right, top, left] = [row(a, b), row(b, c), row(d, c), row(a, d)];
        splitter.fill([&bottom, &right, &top, &left], |quad| {
            polygons.push(Some(Polygon::quad(quad, p.sheet)));
        });
    }
}

/// Where the side between two points is in the sorted list.
fn position(sides: &[([u32; 2], Class)], a: u32, b: u32) -> Option<usize> {
    sides.binary_search_by_key(&edge(a, b), |s| s.0).ok()
}

/// Into how many strips the chord of each side is split.
fn strips(
    points: &[Vec3],
    radii: &[f64],
    polygons: &[Option<Polygon>],
    sides: &[([u32; 2], Class)],
    wanted: &Sizing,
) -> Vec<usize> {
    let mut chords = UnionFind::new(sides.len());
    for [a, b, c, d] in polygons.iter().flatten().filter_map(Polygon::as_quad) {
        for [p, q, r, s] in [[a, b, c, d], [b, c, d, a]] {
            if let (Some(i), Some(j)) = (position(sides, p, q), position(sides, r, s)) {
                chords.join(i as u32, j as u32);
            }
        }
    }
    let mut sums = vec![(0.0, 0.0); sides.len()];
    for (i, ([a, b], _)) in sides.iter().enumerate() {
        let [a, b] = [*a as usize, *b as usize];
        let length = (points[a] - points[b]).norm().max(f64::MIN_POSITIVE);
        let sum = &mut sums[chords.find(i as u32) as usize];
        sum.0 += (length / wanted.at((radii[a] + radii[b]) / 2.0)).ln();
        sum.1 += 1.0;
    }
    (0..sides.len() as u32)
        .map(|i| {
            let (sum, n): (f64, f64) = sums[chords.find(i) as usize];
            ((sum / n).exp().round() as usize).clamp(1, MOST)
        })
        .collect()
}

struct Splitter<'a> {
    points: &'a mut Vec<Vec3>,
    radii: &'a mut Vec<f64>,
    reference: &'a Reference,
}

impl Splitter<'_> {
    /// The ends of a side with its new vertices between them.
    fn side(&mut self, [a, b]: [u32; 2], class: Class, n: usize) -> Vec<u32> {
        let [i, j] = [a as usize, b as usize];
        let ends = [self.points[i], self.points[j]];
        let (d, dr) = (ends[1] - ends[0], self.radii[j] - self.radii[i]);
        let mut out = vec![a];
        for k in 1..n {
            let t = k as f64 / n as f64;
            let (x, r) = (self.points[i] + d * t, self.radii[i] + dr * t);
            out.push(self.add(x, r, class, REACH * d.norm(), &ends));
        }
        out.push(b);
        out
    }

    /// A new vertex, on what the class says where that is near.
    fn add(&mut self, x: Vec3, r: f64, class: Class, reach: f64, ends: &[Vec3]) -> u32 {
        let found = match class {
            Class::Interior => self.reference.on_sheet(&x, |_| true),
            _ => self.reference.on_arc(&x, class, ends),
        };
        let (x, r) = found
            .filter(|(y, _)| (y - x).norm() <= reach)
            .unwrap_or((x, r));
        self.points.push(x);
        self.radii.push(r);
        self.points.len() as u32 - 1
    }

    /// Quads between four rows: bottom and top run alike, so do left and right.
    fn fill(&mut self, [bottom, right, top, left]: [&[u32]; 4], mut put: impl FnMut([u32; 4])) {
        let (m, n) = (bottom.len() - 1, left.len() - 1);
        let mut below = bottom.to_vec();
        for j in 1..=n {
            let mut row = vec![left[j]];
            for i in 1..m {
                row.push(if j == n {
                    top[i]
                } else {
                    self.inner([bottom, right, top, left], [i, j])
                });
            }
            row.push(right[j]);
            for i in 0..m {
                put([below[i], below[i + 1], row[i + 1], row[i]]);
            }
            below = row;
        }
    }

    /// Coons' interpolation between the four rows.
    fn inner(&mut self, [bottom, right, top, left]: [&[u32]; 4], [i, j]: [usize; 2]) -> u32 {
        let (m, n) = (bottom.len() - 1, left.len() - 1);
        let (s, t) = (i as f64 / m as f64, j as f64 / n as f64);
        let p = |v: u32| self.points[v as usize];
        let between = |a: Vec3, b: Vec3, t: f64| a + (b - a) * t;
        let x = between(p(bottom[i]), p(top[i]), t) + between(p(left[j]), p(right[j]), s)
            - between(
                between(p(bottom[0]), p(bottom[m]), s),
                between(p(top[0]), p(top[m]), s),
                t,
            );
        let r = (self.radii[left[j] as usize] + self.radii[right[j] as usize]) / 2.0;
        let reach = REACH * (p(left[j]) - p(right[j])).norm();
        self.add(x, r, Class::Interior, reach, &[])
    }
}

#[cfg(test)]
mod tests {
    use super::super::arcs;
    use super::super::complex::Complex;
    use super::*;

    /// Three plates of 4 x 6 along one seam (the y axis), coarse and fine.
    fn three_plates() -> (Vec<Vec3>, Vec<Option<Polygon>>, Reference) {
        let at = |plate: u32, x: f64, y: f64| {
            let angle = f64::from(plate) * 2.1;
            Vec3::new(x * angle.cos(), y, x * angle.sin())
        };
        let grid = |n: u32, m: u32, step: f64| {
            let (mut points, mut quads) = (Vec::new(), Vec::new());
            points.extend((0..=m).map(|j| at(0, 0.0, f64::from(j) * step)));
            for plate in 0..3 {
                let first = points.len() as u32;
                points.extend((1..=n).flat_map(|i| {
                    (0..=m).map(move |j| at(plate, f64::from(i) * step, f64::from(j) * step))
                }));
                let v = |i: u32, j: u32| {
                    if i == 0 {
                        j
                    } else {
                        first + (i - 1) * (m + 1) + j
                    }
                };
                quads.extend((0..n * m).map(|k| {
                    let (i, j) = (k / m, k % m);
                    [v(i, j), v(i + 1, j), v(i + 1, j + 1), v(i, j + 1)]
                }));
            }
            (points, quads)
        };
        let (points, quads) = grid(16, 24, 0.25);
        let triangles: Vec<[u32; 3]> = quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect();
        let radii = vec![0.5; points.len()];
        let mut fine = Complex::new(points, radii, &triangles, &[]);
        let table = fine.edge_table();
        fine.label_sheets(&table);
        let reference = Reference::new(&fine, &arcs::trace(&fine), 0.05, true);
        let (points, quads) = grid(2, 2, 2.0);
        let mut points = points;
        points.iter_mut().for_each(|p| p.y *= 1.5);
        let quads = quads.iter().map(|&q| Some(Polygon::quad(q, 0))).collect();
        (points, quads, reference)
    }

    fn sizing(length: f64) -> Sizing {
        Sizing {
            factor: 0.0,
            least: length,
            most: length,
        }
    }

    #[test]
    fn sides_get_the_wanted_length_and_all_sheets_of_a_seam_the_same_rows() {
        let (mut points, mut quads, reference) = three_plates();
        let mut radii = vec![0.5; points.len()];
        split_chords(
            &mut points,
            &mut radii,
            &mut quads,
            &reference,
            &sizing(1.0),
        );
        // Sides of 2 across and 3 along the seam.
        assert_eq!(quads.len(), 3 * 4 * 6);
        assert_eq!(points.len(), radii.len());
        let table = edge_table(&quads);
        assert_eq!(table.iter().filter(|(_, q)| q.len() == 3).count(), 6);
        for (e, q) in table.iter() {
            assert!(q.len() <= 3);
            let length = (points[e[0] as usize] - points[e[1] as usize]).norm();
            assert!((length - 1.0).abs() < 0.15, "{length}");
        }
    }

    #[test]
    fn quads_that_are_short_enough_stay_as_they_are() {
        let (mut points, mut quads, reference) = three_plates();
        let (before, n) = (quads.clone(), points.len());
        let mut radii = vec![0.5; n];
        split_chords(
            &mut points,
            &mut radii,
            &mut quads,
            &reference,
            &sizing(2.4),
        );
        assert_eq!((quads, points.len()), (before, n));
    }
}
