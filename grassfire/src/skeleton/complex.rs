//! A triangulated 2-complex with bare edges (beams) that can be collapsed, split and flipped in place.
//!
//! Every operation keeps the homotopy type: collapses test the link condition of Dey, Edelsbrunner, Guha and Nekhayev
//! (1999) with the bare edges included, and a free triangle that vanishes leaves its bare edge behind.

use super::edges::{EdgeTable, UnionFind, betti, edge};
use crate::Vec3;
use crate::topology::Betti;

/// Marks a removed triangle or beam.
pub(crate) const DEAD: u32 = u32::MAX;

/// Where a vertex lies; the order is the order in which vertices give way in a collapse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Class {
    Interior,
    Rim,
    Seam,
    Beam,
    Corner,
}

/// Triangles and beams over shared spheres, with vertex -> triangle and vertex -> beam lists.
#[derive(Debug, Clone, Default)]
pub(crate) struct Complex {
    pub points: Vec<Vec3>,
    pub radii: Vec<f64>,
    pub triangles: Vec<[u32; 3]>,
    /// Sheet of each triangle, as last labelled.
    pub sheet: Vec<u32>,
    pub beams: Vec<[u32; 2]>,
    pub vertex_triangles: Vec<Vec<u32>>,
    pub vertex_beams: Vec<Vec<u32>>,
}

impl Complex {
    pub fn new(
        points: Vec<Vec3>,
        radii: Vec<f64>,
        triangles: &[[u32; 3]],
        beams: &[[u32; 2]],
    ) -> Self {
        let n = points.len();
        let mut c = Self {
            points,
            radii,
            vertex_triangles: vec![Vec::new(); n],
            vertex_beams: vec![Vec::new(); n],
            ..Self::default()
        };
        for t in triangles {
            c.add_triangle(*t, 0);
        }
        for b in beams {
            c.add_beam(*b);
        }
        c
    }

    pub fn add_point(&mut self, point: Vec3, radius: f64) -> u32 {
        self.points.push(point);
        self.radii.push(radius);
        self.vertex_triangles.push(Vec::new());
        self.vertex_beams.push(Vec::new());
        self.points.len() as u32 - 1
    }

    pub fn add_triangle(&mut self, t: [u32; 3], sheet: u32) {
        let id = self.triangles.len() as u32;
        self.triangles.push(t);
        self.sheet.push(sheet);
        for v in t {
            self.vertex_triangles[v as usize].push(id);
        }
    }

    pub fn add_beam(&mut self, b: [u32; 2]) {
        let id = self.beams.len() as u32;
        self.beams.push(b);
        for v in b {
            self.vertex_beams[v as usize].push(id);
        }
    }

    pub fn remove_triangle(&mut self, id: u32) {
        for v in self.triangles[id as usize] {
            self.vertex_triangles[v as usize].retain(|&t| t != id);
        }
        self.triangles[id as usize] = [DEAD; 3];
    }

    pub fn remove_beam(&mut self, id: u32) {
        for v in self.beams[id as usize] {
            self.vertex_beams[v as usize].retain(|&b| b != id);
        }
        self.beams[id as usize] = [DEAD; 2];
    }

    #[inline]
    pub fn tri(&self, id: u32) -> [u32; 3] {
        self.triangles[id as usize]
    }

    /// Triangle ids that are alive.
    pub fn alive(&self) -> impl Iterator<Item = u32> {
        (0..self.triangles.len() as u32).filter(|&t| self.triangles[t as usize][0] != DEAD)
    }

    /// Beams that are alive.
    pub fn alive_beams(&self) -> impl Iterator<Item = [u32; 2]> {
        self.beams.iter().copied().filter(|b| b[0] != DEAD)
    }

    #[inline]
    pub fn used(&self, v: u32) -> bool {
        !self.vertex_triangles[v as usize].is_empty() || !self.vertex_beams[v as usize].is_empty()
    }

    /// Neighbours over triangle edges and beams, sorted.
    pub fn neighbours(&self, v: u32) -> Vec<u32> {
        let mut out = Vec::with_capacity(12);
        for &t in &self.vertex_triangles[v as usize] {
            out.extend(self.tri(t).into_iter().filter(|&w| w != v));
        }
        for &b in &self.vertex_beams[v as usize] {
            let [p, q] = self.beams[b as usize];
            out.push(if p == v { q } else { p });
        }
        out.sort_unstable();
        out.dedup();
        out
    }

    /// Triangles on edge `ab`.
    pub fn on_edge(&self, a: u32, b: u32) -> Vec<u32> {
        self.vertex_triangles[a as usize]
            .iter()
            .copied()
            .filter(|&t| self.tri(t).contains(&b))
            .collect()
    }

    /// How many triangles lie on edge `ab`.
    pub fn face_count(&self, a: u32, b: u32) -> usize {
        self.vertex_triangles[a as usize]
            .iter()
            .filter(|&&t| self.tri(t).contains(&b))
            .count()
    }

    pub fn is_beam(&self, a: u32, b: u32) -> bool {
        self.vertex_beams[a as usize]
            .iter()
            .any(|&x| self.beams[x as usize].contains(&b))
    }

    pub fn connected(&self, a: u32, b: u32) -> bool {
        self.face_count(a, b) > 0 || self.is_beam(a, b)
    }

    pub fn length(&self, a: u32, b: u32) -> f64 {
        (self.points[a as usize] - self.points[b as usize]).norm()
    }

    pub fn class(&self, v: u32) -> Class {
        let triangles = &self.vertex_triangles[v as usize];
        let beams = self.vertex_beams[v as usize].len();
        if triangles.is_empty() {
            return if beams == 2 {
                Class::Beam
            } else {
                Class::Corner
            };
        }
        if beams > 0 {
            return Class::Corner;
        }
        let mut spokes: Vec<(u32, u32)> = Vec::with_capacity(2 * triangles.len());
        for (i, &t) in triangles.iter().enumerate() {
            spokes.extend(
                self.tri(t)
                    .into_iter()
                    .filter(|&w| w != v)
                    .map(|w| (w, i as u32)),
            );
        }
        spokes.sort_unstable();
        let mut fans = UnionFind::new(triangles.len());
        let (mut rim, mut seam, mut joined) = (0, 0, 0);
        for run in spokes.chunk_by(|a, b| a.0 == b.0) {
            match run.len() {
                1 => rim += 1,
                2 => {}
                _ => seam += 1,
            }
            for pair in run.windows(2) {
                if fans.find(pair[0].1) != fans.find(pair[1].1) {
                    fans.join(pair[0].1, pair[1].1);
                    joined += 1;
                }
            }
        }
        let one_fan = joined + 1 == triangles.len();
        match (seam, rim, one_fan) {
            (0, 0, true) => Class::Interior,
            (0, 2, true) => Class::Rim,
            (2, 0, true) => Class::Seam,
            _ => Class::Corner,
        }
    }

    /// The link condition: `Lk a` and `Lk b` meet in `Lk ab` only, so that contracting `ab` keeps the homotopy type.
    /// An edge that is a component of its own does not pass: contracted to a bare point it would be lost.
    pub fn link_condition(&self, a: u32, b: u32) -> bool {
        let mut opposite: Vec<u32> = Vec::with_capacity(4);
        for &t in &self.vertex_triangles[a as usize] {
            let t = self.tri(t);
            if t.contains(&b) {
                opposite.extend(t.into_iter().filter(|&w| w != a && w != b));
            }
        }
        opposite.sort_unstable();
        opposite.dedup();
        let other = self.neighbours(b);
        let mut common = self.neighbours(a);
        if common == [b] && other == [a] {
            return false;
        }
        common.retain(|w| other.binary_search(w).is_ok());
        if common != opposite {
            return false;
        }
        let far = |t: u32, v: u32| {
            let [x, y, z] = self.tri(t);
            if x == v {
                edge(y, z)
            } else if y == v {
                edge(x, z)
            } else {
                edge(x, y)
            }
        };
        let link: Vec<[u32; 2]> = self.vertex_triangles[a as usize]
            .iter()
            .map(|&t| far(t, a))
            .collect();
        !self.vertex_triangles[b as usize]
            .iter()
            .any(|&t| link.contains(&far(t, b)))
    }

    /// Would moving `a` to `target` (contracting `ab`) fold or flatten a triangle?
    pub fn would_flip(&self, a: u32, b: u32, target: &Vec3, cos_min: f64, tiny: f64) -> bool {
        for &t in &self.vertex_triangles[a as usize] {
            let t = self.tri(t);
            if t.contains(&b) {
                continue;
            }
            let p = t.map(|w| self.points[w as usize]);
            let q = t.map(|w| {
                if w == a {
                    *target
                } else {
                    self.points[w as usize]
                }
            });
            let n1 = (p[1] - p[0]).cross(&(p[2] - p[0]));
            let n2 = (q[1] - q[0]).cross(&(q[2] - q[0]));
            let (l1, l2) = (n1.norm(), n2.norm());
            if l1 < tiny {
                continue;
            }
            let longest = (q[1] - q[0])
                .norm_squared()
                .max((q[2] - q[0]).norm_squared())
                .max((q[2] - q[1]).norm_squared());
            if l2 < 0.08 * longest || n1.dot(&n2) < cos_min * l1 * l2 {
                return true;
            }
        }
        false
    }

    /// Contracts `a` into `b`. Edges that lose their last triangle stay as beams.
    pub fn collapse(&mut self, a: u32, b: u32) {
        let mut sides: Vec<u32> = Vec::with_capacity(4);
        for t in self.vertex_triangles[a as usize].clone() {
            let (corners, sheet) = (self.tri(t), self.sheet[t as usize]);
            self.remove_triangle(t);
            if corners.contains(&b) {
                sides.extend(corners.into_iter().filter(|&w| w != a && w != b));
            } else {
                self.add_triangle(corners.map(|w| if w == a { b } else { w }), sheet);
            }
        }
        for x in self.vertex_beams[a as usize].clone() {
            let ends = self.beams[x as usize];
            self.remove_beam(x);
            if !ends.contains(&b) {
                self.add_beam(ends.map(|w| if w == a { b } else { w }));
            }
        }
        for w in sides {
            if !self.connected(b, w) {
                self.add_beam([b, w]);
            }
        }
    }

    /// Puts a new vertex on edge `ab`.
    pub fn split(&mut self, a: u32, b: u32, point: Vec3, radius: f64) -> u32 {
        let m = self.add_point(point, radius);
        for t in self.on_edge(a, b) {
            let (corners, sheet) = (self.tri(t), self.sheet[t as usize]);
            self.remove_triangle(t);
            self.add_triangle(corners.map(|w| if w == a { m } else { w }), sheet);
            self.add_triangle(corners.map(|w| if w == b { m } else { w }), sheet);
        }
        for x in self.vertex_beams[a as usize].clone() {
            if self.beams[x as usize].contains(&b) {
                self.remove_beam(x);
                self.add_beam([a, m]);
                self.add_beam([m, b]);
            }
        }
        m
    }

    /// [`Complex::split`] at the middle.
    pub fn split_middle(&mut self, a: u32, b: u32) -> u32 {
        let point = (self.points[a as usize] + self.points[b as usize]) / 2.0;
        let radius = (self.radii[a as usize] + self.radii[b as usize]) / 2.0;
        self.split(a, b, point, radius)
    }

    /// All edges, sorted, beams included.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        let mut out: Vec<[u32; 2]> = Vec::with_capacity(3 * self.triangles.len());
        for t in self.alive() {
            let [a, b, c] = self.tri(t);
            out.extend([edge(a, b), edge(b, c), edge(c, a)]);
        }
        out.extend(self.alive_beams().map(|[a, b]| edge(a, b)));
        out.sort_unstable();
        out.dedup();
        out
    }

    /// Vertices in use, ascending.
    pub fn vertices(&self) -> Vec<u32> {
        (0..self.points.len() as u32)
            .filter(|&v| self.used(v))
            .collect()
    }

    /// Edge table of the alive triangles.
    pub fn edge_table(&self) -> EdgeTable {
        EdgeTable::new(self.alive().map(|t| (t, &self.triangles[t as usize][..])))
    }

    /// Labels the triangles by sheet (joined over edges with two triangles); returns the number of sheets.
    pub fn label_sheets(&mut self, table: &EdgeTable) -> usize {
        let mut sets = UnionFind::new(self.triangles.len());
        for (_, f) in table.iter() {
            if let [a, b] = f {
                sets.join(*a, *b);
            }
        }
        let mut label = vec![DEAD; self.triangles.len()];
        let mut count = 0;
        for t in 0..self.triangles.len() as u32 {
            if self.triangles[t as usize][0] == DEAD {
                continue;
            }
            let root = sets.find(t) as usize;
            if label[root] == DEAD {
                label[root] = count;
                count += 1;
            }
            self.sheet[t as usize] = label[root];
        }
        count as usize
    }

    pub fn betti(&self) -> Betti {
        let faces: Vec<[u32; 3]> = self.alive().map(|t| self.tri(t)).collect();
        let beams: Vec<[u32; 2]> = self.alive_beams().collect();
        betti(self.points.len(), &faces, &beams)
    }

    /// Drops removed triangles, beams and unused points; keeps the order of the rest.
    pub fn compact(&mut self) {
        let mut new = vec![DEAD; self.points.len()];
        let vertices = self.vertices();
        for (i, &v) in vertices.iter().enumerate() {
            new[v as usize] = i as u32;
        }
        let ids: Vec<u32> = self.alive().collect();
        let triangles: Vec<[u32; 3]> = ids
            .iter()
            .map(|&t| self.tri(t).map(|v| new[v as usize]))
            .collect();
        let sheet = ids.iter().map(|&t| self.sheet[t as usize]).collect();
        let beams: Vec<[u32; 2]> = self
            .alive_beams()
            .map(|b| b.map(|v| new[v as usize]))
            .collect();
        let points = vertices.iter().map(|&v| self.points[v as usize]).collect();
        let radii = vertices.iter().map(|&v| self.radii[v as usize]).collect();
        *self = Self::new(points, radii, &triangles, &beams);
        self.sheet = sheet;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strip() -> Complex {
        let points = (0..6)
            .map(|i| Vec3::new((i / 2) as f64, (i % 2) as f64, 0.0))
            .collect();
        Complex::new(
            points,
            vec![1.0; 6],
            &[[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]],
            &[],
        )
    }

    #[test]
    fn free_triangle_leaves_its_bare_edge() {
        let mut c = Complex::new(vec![Vec3::zeros(); 3], vec![1.0; 3], &[[0, 1, 2]], &[]);
        c.collapse(0, 1);
        assert_eq!(c.alive().count(), 0);
        assert_eq!(c.alive_beams().collect::<Vec<_>>(), vec![[1, 2]]);
    }

    #[test]
    fn classes_of_a_strip_with_a_beam() {
        let mut c = strip();
        assert_eq!(c.class(2), Class::Rim);
        let m = c.add_point(Vec3::new(3.0, 0.0, 0.0), 1.0);
        c.add_beam([4, m]);
        assert_eq!(c.class(4), Class::Corner);
        assert_eq!(c.class(m), Class::Corner);
    }

    #[test]
    fn link_condition_refuses_to_close_a_loop() {
        let none: [[u32; 3]; 0] = [];
        let c = Complex::new(
            vec![Vec3::zeros(); 3],
            vec![1.0; 3],
            &none,
            &[[0, 1], [1, 2], [2, 0]],
        );
        assert!(!c.link_condition(0, 1));
        assert!(strip().link_condition(0, 1));
    }

    #[test]
    fn split_and_collapse_keep_the_betti_numbers() {
        let mut c = strip();
        let before = c.betti();
        let m = c.split_middle(2, 3);
        assert_eq!(c.betti(), before);
        assert!(c.link_condition(m, 2));
        c.collapse(m, 2);
        assert_eq!(c.betti(), before);
        c.compact();
        assert_eq!(c.points.len(), 6);
    }
}
