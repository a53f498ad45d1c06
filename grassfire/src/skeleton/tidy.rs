//! Clean-up of the quads: doublets, diagonal collapse and edge rotation, as long as the valences come nearer to ideal;
//! a rotation that changes nothing is taken where it makes way for one of these.
//!
//! Ideal is four quads inside a sheet, and on rims and seams the sheet's opening angle over 90 degrees.

use super::edges::{EdgeTable, betti, edge};
use super::polygons::{Polygon, angle, edge_table, quad_quality};
use super::reference::Reference;
use crate::Vec3;
use crate::monitor::{Cancelled, Monitor};

/// Operations between two topology checks; a batch that changes the Betti numbers is undone.
const BATCH: usize = 16;
const MAX_BATCHES: usize = 60;
/// Most detours tried.
const MAX_TRIALS: usize = 4000;

/// The quads of a skeleton while they are being improved.
pub(crate) struct Tidy<'a> {
    pub points: &'a mut Vec<Vec3>,
    pub radii: &'a mut Vec<f64>,
    pub quads: Vec<Option<Polygon>>,
    pub beams: Vec<[u32; 2]>,
    pub reference: &'a Reference,
}

struct Tables {
    edges: EdgeTable,
    around: Vec<Vec<u32>>,
}

#[derive(Debug, Clone)]
enum Operation {
    Doublet {
        keep: u32,
        drop: u32,
        vertex: u32,
        opposite: u32,
    },
    Collapse {
        quad: u32,
        from: u32,
        into: u32,
    },
    Rotate {
        first: u32,
        second: u32,
        quads: [[u32; 4]; 2],
    },
}

impl Tidy<'_> {
    /// Runs the clean-up; returns the number of operations.
    pub fn run(&mut self, monitor: &Monitor) -> Result<usize, Cancelled> {
        let tables = self.tables();
        let mut fixed = self.fixed(&tables);
        let ideal = self.ideal(&tables, &fixed);
        self.relax(&fixed, 3);
        let mut total = 0;
        let mut trials = MAX_TRIALS;
        for _ in 0..MAX_BATCHES {
            monitor.check()?;
            let saved = (
                self.quads.clone(),
                self.beams.clone(),
                self.points.clone(),
                self.radii.clone(),
            );
            let topology = self.betti();
            let mut done = 0;
            while done < BATCH {
                let tables = self.tables();
                let next = match self.best(&tables, &fixed, &ideal) {
                    Some(operation) => Some(vec![operation]),
                    None => self.detour(&tables, &fixed, &ideal, &mut trials),
                };
                let Some(operations) = next else { break };
                for operation in operations {
                    let tables = self.tables();
                    self.apply(operation, &tables);
                    fixed = self.fixed(&self.tables());
                    self.relax(&fixed, 2);
                }
                done += 1;
            }
            if self.betti() != topology {
                (self.quads, self.beams, *self.points, *self.radii) = saved;
                break;
            }
            total += done;
            if done < BATCH {
                break;
            }
        }
        self.relax(&fixed, 8);
        Ok(total)
    }

    fn betti(&self) -> crate::topology::Betti {
        let list: Vec<Polygon> = self.quads.iter().flatten().copied().collect();
        betti(self.points.len(), &list, &self.beams)
    }

    fn tables(&self) -> Tables {
        let mut around = vec![Vec::new(); self.points.len()];
        for (i, q) in self.quads.iter().enumerate() {
            for &v in q.iter().flat_map(|q| q.corners()) {
                around[v as usize].push(i as u32);
            }
        }
        Tables {
            edges: edge_table(&self.quads),
            around,
        }
    }

    /// Vertices on rims, seams and beams: they stay.
    fn fixed(&self, tables: &Tables) -> Vec<bool> {
        let mut fixed = vec![false; self.points.len()];
        for (e, _) in tables.edges.iter().filter(|(_, f)| f.len() != 2) {
            fixed[e[0] as usize] = true;
            fixed[e[1] as usize] = true;
        }
        for b in &self.beams {
            fixed[b[0] as usize] = true;
            fixed[b[1] as usize] = true;
        }
        fixed
    }

    fn ideal(&self, tables: &Tables, fixed: &[bool]) -> Vec<i64> {
        (0..self.points.len())
            .map(|v| {
                let mut sheets: Vec<u32> =
                    tables.around[v].iter().map(|&i| self.sheet(i)).collect();
                sheets.sort_unstable();
                sheets.dedup();
                if !fixed[v] || sheets.is_empty() {
                    return 4;
                }
                let opening: f64 = tables.around[v]
                    .iter()
                    .map(|&i| self.corner_angle(i, v as u32))
                    .sum();
                ((opening / sheets.len() as f64 / 90.0).round() as i64).max(1)
            })
            .collect()
    }

    fn sheet(&self, quad: u32) -> u32 {
        self.quads[quad as usize].map_or(0, |q| q.sheet)
    }

    fn corner_angle(&self, quad: u32, v: u32) -> f64 {
        let Some(q) = self.quads[quad as usize].and_then(|q| q.as_quad()) else {
            return 0.0;
        };
        let Some(k) = q.iter().position(|&w| w == v) else {
            return 0.0;
        };
        let x = |w: u32| self.points[w as usize];
        angle(&(x(q[(k + 3) % 4]) - x(v)), &(x(q[(k + 1) % 4]) - x(v)))
    }

    /// Laplace on the inner vertices, put back onto the fine sheets.
    fn relax(&mut self, fixed: &[bool], rounds: usize) {
        let tables = self.tables();
        let mut around: Vec<Vec<u32>> = vec![Vec::new(); self.points.len()];
        for e in &tables.edges.edges {
            around[e[0] as usize].push(e[1]);
            around[e[1] as usize].push(e[0]);
        }
        for _ in 0..rounds {
            for v in 0..self.points.len() {
                if fixed[v] || around[v].is_empty() {
                    continue;
                }
                let mean = around[v]
                    .iter()
                    .map(|&w| self.points[w as usize])
                    .sum::<Vec3>()
                    / around[v].len() as f64;
                let x = self.points[v] * 0.4 + mean * 0.6;
                if let Some((x, r)) = self.reference.on_sheet(&x, |_| true) {
                    self.points[v] = x;
                    self.radii[v] = r;
                }
            }
        }
    }

    fn best(&self, tables: &Tables, fixed: &[bool], ideal: &[i64]) -> Option<Operation> {
        if let Some(doublet) = self.doublet(tables, fixed) {
            return Some(doublet);
        }
        let all: Vec<u32> = (0..self.quads.len() as u32).collect();
        let gaining = self.operations(&all, tables, fixed, ideal);
        gaining
            .into_iter()
            .filter(|(gain, _)| *gain < 0)
            .min_by_key(|(gain, _)| *gain)
            .map(|(_, operation)| operation)
    }

    /// Collapses and rotations of the given quads, with their gains.
    fn operations(
        &self,
        quads: &[u32],
        tables: &Tables,
        fixed: &[bool],
        ideal: &[i64],
    ) -> Vec<(i64, Operation)> {
        let mut found = Vec::new();
        let mut edges = Vec::new();
        for &i in quads {
            let Some(q) = self.quads[i as usize].and_then(|q| q.as_quad()) else {
                continue;
            };
            found.extend((0..2).filter_map(|k| self.collapse(i, k, tables, fixed, ideal)));
            edges.extend((0..4).map(|k| edge(q[k], q[(k + 1) % 4])));
        }
        edges.sort_unstable();
        edges.dedup();
        for e in edges {
            if let [i, j] = *tables.edges.at(e[0], e[1]) {
                let turns = 0..2;
                found.extend(
                    turns.filter_map(|turn| self.rotate(e, i, j, turn, tables, fixed, ideal)),
                );
            }
        }
        found
    }

    /// A rotation that gains nothing but makes way for an operation nearby that does.
    fn detour(
        &mut self,
        tables: &Tables,
        fixed: &[bool],
        ideal: &[i64],
        trials: &mut usize,
    ) -> Option<Vec<Operation>> {
        let all: Vec<u32> = (0..self.quads.len() as u32).collect();
        let mut level = self.operations(&all, tables, fixed, ideal);
        level.retain(|(gain, operation)| {
            *gain == 0 && matches!(operation, Operation::Rotate { .. })
        });
        for (_, operation) in level {
            *trials = trials.checked_sub(1)?;
            let Operation::Rotate { quads, .. } = &operation else {
                continue;
            };
            let mut near: Vec<u32> = quads
                .iter()
                .flatten()
                .flat_map(|&v| tables.around[v as usize].iter().copied())
                .collect();
            near.sort_unstable();
            near.dedup();
            let saved = self.quads.clone();
            self.apply(operation.clone(), tables);
            let turned = self.tables();
            let after = self.operations(&near, &turned, fixed, ideal);
            self.quads = saved;
            let best = after.into_iter().min_by_key(|(gain, _)| *gain);
            if let Some((_, second)) = best.filter(|(gain, _)| *gain < 0) {
                return Some(vec![operation, second]);
            }
        }
        None
    }

    /// Quads of `v` in `sheet`.
    fn valence(&self, tables: &Tables, v: u32, sheet: u32) -> i64 {
        tables.around[v as usize]
            .iter()
            .filter(|&&i| self.sheet(i) == sheet)
            .count() as i64
    }

    fn doublet(&self, tables: &Tables, fixed: &[bool]) -> Option<Operation> {
        for v in 0..self.points.len() as u32 {
            let [i, j] = tables.around[v as usize][..] else {
                continue;
            };
            if fixed[v as usize] && !self.only_foot(tables, v) {
                continue;
            }
            let a = self.quads[i as usize]?.as_quad()?;
            let b = self.quads[j as usize]?.as_quad()?;
            let l = b.iter().position(|&w| w == v)?;
            let opposite = b[(l + 2) % 4];
            if !a.contains(&opposite) && !self.beams_to(v).any(|w| self.linked(tables, w, opposite))
            {
                return Some(Operation::Doublet {
                    keep: i,
                    drop: j,
                    vertex: v,
                    opposite,
                });
            }
        }
        None
    }

    /// A beam foot inside a sheet: nothing but the beam holds it, so it may slide to a neighbouring vertex.
    fn only_foot(&self, tables: &Tables, v: u32) -> bool {
        let Some(q) = tables.around[v as usize]
            .first()
            .and_then(|&i| self.quads[i as usize])
        else {
            return false;
        };
        tables.around[v as usize].len() == 2
            && q.corners()
                .iter()
                .filter(|&&w| tables.edges.at(v, w).len() == 2)
                .count()
                == 2
    }

    fn beams_to(&self, v: u32) -> impl Iterator<Item = u32> {
        self.beams
            .iter()
            .filter(move |b| b.contains(&v))
            .map(move |b| if b[0] == v { b[1] } else { b[0] })
    }

    fn linked(&self, tables: &Tables, a: u32, b: u32) -> bool {
        a == b
            || !tables.edges.at(a, b).is_empty()
            || self.beams.iter().any(|x| x.contains(&a) && x.contains(&b))
    }

    fn collapse(
        &self,
        i: u32,
        k: usize,
        tables: &Tables,
        fixed: &[bool],
        ideal: &[i64],
    ) -> Option<(i64, Operation)> {
        let q = self.quads[i as usize]?.as_quad()?;
        let (mut u, mut w, x, y) = (q[k], q[k + 2], q[k + 1], q[(k + 3) % 4]);
        if fixed[u as usize] {
            (u, w) = (w, u);
        }
        if fixed[u as usize] {
            return None;
        }
        let sheet = self.sheet(i);
        let n = |v: u32| self.valence(tables, v, sheet);
        let least = |v: u32| if fixed[v as usize] { 1 } else { 3 };
        if n(x) <= least(x) || n(y) <= least(y) {
            return None;
        }
        let shared = |&r: &u32| r != i && tables.around[w as usize].contains(&r);
        if tables.around[u as usize].iter().any(shared) {
            return None;
        }
        // A common neighbour outside the quad would fold two edges into one.
        for &r in &tables.around[u as usize] {
            let p = self.quads[r as usize]?;
            let folds = |&v: &u32| {
                !q.contains(&v)
                    && !tables.edges.at(u, v).is_empty()
                    && !tables.edges.at(w, v).is_empty()
            };
            if p.corners().iter().any(folds) {
                return None;
            }
        }
        let cost = |v: u32, n: i64| (n - ideal[v as usize]).pow(2);
        let gain = cost(w, n(u) + n(w) - 2) + cost(x, n(x) - 1) + cost(y, n(y) - 1)
            - cost(u, n(u))
            - cost(w, n(w))
            - cost(x, n(x))
            - cost(y, n(y));
        Some((
            gain,
            Operation::Collapse {
                quad: i,
                from: u,
                into: w,
            },
        ))
    }

    #[allow(clippy::too_many_arguments)]
    fn rotate(
        &self,
        e: [u32; 2],
        i: u32,
        j: u32,
        turn: usize,
        tables: &Tables,
        fixed: &[bool],
        ideal: &[i64],
    ) -> Option<(i64, Operation)> {
        let a = self.quads[i as usize]?.as_quad()?;
        let mut b = self.quads[j as usize]?.as_quad()?;
        let k = (0..4).find(|&k| edge(a[k], a[(k + 1) % 4]) == e)?;
        let (p, q, c, d) = (a[k], a[(k + 1) % 4], a[(k + 2) % 4], a[(k + 3) % 4]);
        let mut m = b.iter().position(|&v| v == q)?;
        if b[(m + 1) % 4] != p {
            b.reverse();
            m = b.iter().position(|&v| v == q)?;
        }
        let (s, t) = (b[(m + 2) % 4], b[(m + 3) % 4]);
        let hexagon = [p, s, t, q, c, d];
        if (0..6).any(|x| hexagon[x + 1..].contains(&hexagon[x])) {
            return None;
        }
        let sheet = self.sheet(i);
        let n = |v: u32| self.valence(tables, v, sheet);
        let least = |v: u32| if fixed[v as usize] { 2 } else { 4 };
        if n(p) < least(p) || n(q) < least(q) {
            return None;
        }
        let (g, h, quads) = if turn == 0 {
            (d, t, [[d, p, s, t], [d, t, q, c]])
        } else {
            (s, c, [[s, c, d, p], [s, t, q, c]])
        };
        if !tables.edges.at(g, h).is_empty() {
            return None;
        }
        let change = |v: u32, by: i64| {
            (n(v) + by - ideal[v as usize]).pow(2) - (n(v) - ideal[v as usize]).pow(2)
        };
        let gain = change(p, -1) + change(q, -1) + change(g, 1) + change(h, 1);
        let good = quads.iter().all(|q| quad_quality(self.points, q) > 0.15);
        good.then_some((
            gain,
            Operation::Rotate {
                first: i,
                second: j,
                quads,
            },
        ))
    }

    fn apply(&mut self, operation: Operation, tables: &Tables) {
        let renamed = |q: &Polygon, from: u32, to: u32| {
            q.as_quad()
                .map(|v| Polygon::quad(v.map(|w| if w == from { to } else { w }), q.sheet))
        };
        match operation {
            Operation::Doublet {
                keep,
                drop,
                vertex,
                opposite,
            } => {
                self.quads[keep as usize] =
                    self.quads[keep as usize].and_then(|q| renamed(&q, vertex, opposite));
                self.quads[drop as usize] = None;
                for end in self
                    .beams
                    .iter_mut()
                    .flatten()
                    .filter(|end| **end == vertex)
                {
                    *end = opposite;
                }
            }
            Operation::Collapse { quad, from, into } => {
                self.quads[quad as usize] = None;
                for &i in &tables.around[from as usize] {
                    self.quads[i as usize] =
                        self.quads[i as usize].and_then(|q| renamed(&q, from, into));
                }
            }
            Operation::Rotate {
                first,
                second,
                quads,
            } => {
                let sheet = self.sheet(first);
                self.quads[first as usize] = Some(Polygon::quad(quads[0], sheet));
                self.quads[second as usize] = Some(Polygon::quad(quads[1], sheet));
            }
        }
    }
}
