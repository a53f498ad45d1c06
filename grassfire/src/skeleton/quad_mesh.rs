//! Quads that can be changed locally and put back: vertex -> quad lists, edges by search around a vertex.

use super::complex::Class;
use super::edges::betti;
use super::polygons::Polygon;
use super::square::classes;
use crate::Vec3;
use crate::topology::Betti;

/// Most quads at a vertex: a change that gives more is refused.
pub(crate) const MOST_QUADS: usize = 14;

/// The quads of a whole skeleton with their sheets, and what may move.
#[derive(Debug, Clone)]
pub(crate) struct QuadMesh {
    pub points: Vec<Vec3>,
    pub radii: Vec<f64>,
    /// Where each vertex lies; [`Class::Corner`] stays in place.
    pub class: Vec<Class>,
    /// Ends of the beams at each vertex.
    pub beams: Vec<Vec<u32>>,
    pub quads: Vec<Option<[u32; 4]>>,
    pub sheet: Vec<u32>,
    /// Quads at each vertex.
    pub around: Vec<Vec<u32>>,
}

/// A local change: quads out, quads in, and vertices put somewhere.
#[derive(Debug, Clone, Default)]
pub(crate) struct Change {
    pub remove: Vec<u32>,
    pub add: Vec<[u32; 4]>,
    pub sheet: u32,
    pub place: Vec<(u32, Vec3)>,
    /// The rim loses two edges: otherwise rims and seams must come out as they went in.
    pub shortens_rim: bool,
}

/// What [`QuadMesh::apply`] did, for [`QuadMesh::undo`].
#[derive(Debug, Default)]
pub(crate) struct Undo {
    removed: Vec<(u32, [u32; 4], u32)>,
    added: Vec<u32>,
    pub moved: Vec<(u32, Vec3)>,
}

impl QuadMesh {
    /// The quads among `polygons`.
    pub fn new(
        points: &[Vec3],
        radii: &[f64],
        polygons: &[Option<Polygon>],
        beams: &[[u32; 2]],
    ) -> Self {
        let mut m = Self {
            points: points.to_vec(),
            radii: radii.to_vec(),
            class: classes(points, polygons, beams),
            beams: vec![Vec::new(); points.len()],
            quads: Vec::new(),
            sheet: Vec::new(),
            around: vec![Vec::new(); points.len()],
        };
        for &[a, b] in beams {
            m.beams[a as usize].push(b);
            m.beams[b as usize].push(a);
        }
        for p in polygons.iter().flatten() {
            if let Some(q) = p.as_quad() {
                m.put(m.quads.len() as u32, q, p.sheet);
            }
        }
        m
    }

    /// The quads with their sheets.
    pub fn polygons(&self) -> Vec<Option<Polygon>> {
        self.alive()
            .map(|(i, q)| Some(Polygon::quad(q, self.sheet[i as usize])))
            .collect()
    }

    pub fn quad(&self, i: u32) -> Option<[u32; 4]> {
        self.quads[i as usize]
    }

    pub fn add_point(&mut self, x: Vec3, r: f64, class: Class) -> u32 {
        self.points.push(x);
        self.radii.push(r);
        self.class.push(class);
        self.beams.push(Vec::new());
        self.around.push(Vec::new());
        self.points.len() as u32 - 1
    }

    /// Forgets points from `n` on, which no quad may use.
    pub fn truncate_points(&mut self, n: usize) {
        self.points.truncate(n);
        self.radii.truncate(n);
        self.class.truncate(n);
        self.beams.truncate(n);
        self.around.truncate(n);
    }

    fn drop(&mut self, i: u32) -> Option<[u32; 4]> {
        let q = self.quads[i as usize].take()?;
        for v in q {
            self.around[v as usize].retain(|&x| x != i);
        }
        Some(q)
    }

    fn put(&mut self, i: u32, q: [u32; 4], sheet: u32) {
        if i as usize == self.quads.len() {
            self.quads.push(None);
            self.sheet.push(0);
        }
        self.quads[i as usize] = Some(q);
        self.sheet[i as usize] = sheet;
        for v in q {
            self.around[v as usize].push(i);
        }
    }

    /// Applies a change; new quads take the places of the old ones.
    pub fn apply(&mut self, change: &Change) -> Undo {
        let mut undo = Undo::default();
        for &i in &change.remove {
            let sheet = self.sheet[i as usize];
            if let Some(q) = self.drop(i) {
                undo.removed.push((i, q, sheet));
            }
        }
        for (k, &q) in change.add.iter().enumerate() {
            let i = change
                .remove
                .get(k)
                .copied()
                .unwrap_or(self.quads.len() as u32);
            self.put(i, q, change.sheet);
            undo.added.push(i);
        }
        for &(v, x) in &change.place {
            undo.moved.push((v, self.points[v as usize]));
            self.points[v as usize] = x;
        }
        undo
    }

    pub fn undo(&mut self, undo: Undo) {
        for (v, x) in undo.moved.into_iter().rev() {
            self.points[v as usize] = x;
        }
        for i in undo.added {
            self.drop(i);
        }
        for (i, q, sheet) in undo.removed {
            self.put(i, q, sheet);
        }
        while self.quads.last() == Some(&None) {
            self.quads.pop();
            self.sheet.pop();
        }
    }

    /// Quads on edge `ab`.
    pub fn on_edge(&self, a: u32, b: u32) -> impl Iterator<Item = u32> {
        self.around[a as usize].iter().copied().filter(move |&i| {
            self.quads[i as usize]
                .and_then(|q| spokes(&q, a))
                .is_some_and(|s| s.contains(&b))
        })
    }

    /// Are `a` and `b` joined by the side of a quad or by a beam?
    pub fn linked(&self, a: u32, b: u32) -> bool {
        self.beams[a as usize].contains(&b) || self.on_edge(a, b).next().is_some()
    }

    pub fn alive(&self) -> impl Iterator<Item = (u32, [u32; 4])> {
        self.quads
            .iter()
            .enumerate()
            .filter_map(|(i, q)| q.map(|q| (i as u32, q)))
    }

    /// Ends of the rim edges at `v`.
    pub fn rim_ends(&self, v: u32) -> Vec<u32> {
        let mut ends = self.spoke_ends(v);
        ends.sort_unstable();
        ends.chunk_by(|a, b| a == b)
            .filter(|run| run.len() == 1)
            .map(|run| run[0])
            .collect()
    }

    /// The far end of every side at `v`, once a quad.
    pub fn spoke_ends(&self, v: u32) -> Vec<u32> {
        self.around[v as usize]
            .iter()
            .filter_map(|&i| spokes(&self.quads[i as usize]?, v))
            .flatten()
            .collect()
    }

    /// Two quads over the same four points.
    pub fn has_twins(&self) -> bool {
        let mut keys: Vec<[u32; 4]> = self
            .alive()
            .map(|(_, mut q)| {
                q.sort_unstable();
                q
            })
            .collect();
        keys.sort_unstable();
        keys.windows(2).any(|w| w[0] == w[1])
    }

    pub fn betti(&self) -> Betti {
        let quads: Vec<[u32; 4]> = self.alive().map(|(_, q)| q).collect();
        let beams: Vec<[u32; 2]> = (0..self.points.len() as u32)
            .flat_map(|v| self.beams[v as usize].iter().map(move |&w| [v, w]))
            .filter(|b| b[0] < b[1])
            .collect();
        betti(self.points.len(), &quads, &beams)
    }
}

/// Neighbours of `v` in a quad.
pub(crate) fn spokes(q: &[u32; 4], v: u32) -> Option<[u32; 2]> {
    let k = q.iter().position(|&w| w == v)?;
    Some([q[(k + 3) % 4], q[(k + 1) % 4]])
}
