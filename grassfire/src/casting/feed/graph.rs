//! The skeleton as a graph for feeding: distances to the feeders, volumes and moduli of its points.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::f64::consts::PI;

use crate::Vec3;
use crate::medial::MedialMesh;
use crate::skeleton::Skeleton;

/// What an edge is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EdgeKind {
    /// A side or a diagonal of a quad.
    Sheet,
    /// A beam.
    Beam,
    /// Through a non-design body, whose thickness is not ours: metal flows, radii are not tied.
    Link,
}

/// An edge that metal can flow along.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeedEdge {
    /// Its points.
    pub points: [u32; 2],
    /// Its length, mm.
    pub length: f64,
    /// What it is.
    pub kind: EdgeKind,
}

/// A non-design body as feeding sees it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Contact {
    /// Skeleton points that touch the body.
    pub touching: Vec<u32>,
    /// Skeleton points inside it: their radii stay.
    pub inside: Vec<u32>,
    /// Feeders (by their number) that stand on it.
    pub feeders: Vec<u32>,
}

/// The graph; one entry a skeleton point in every list but `edges`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FeedGraph {
    /// Positions, mm.
    pub points: Vec<Vec3>,
    /// Radii before, mm.
    pub radii: Vec<f64>,
    /// Edges.
    pub edges: Vec<FeedEdge>,
    /// Sheet area that belongs to a point, mm2.
    pub sheet: Vec<f64>,
    /// Beam length that belongs to a point, mm.
    pub beam: Vec<f64>,
    /// Rim length that belongs to a point, mm.
    pub rim: Vec<f64>,
    start: Vec<u32>,
    /// Neighbour and length, by point.
    neighbours: Vec<(u32, f64)>,
    /// Ends of the links, ascending.
    links: Vec<[u32; 2]>,
}

impl FeedGraph {
    /// The graph of a checked skeleton.
    ///
    /// Edges are the sides of quads, both diagonals of each quad (with sides only, distances across a sheet would be up to
    /// 41 % too long and would depend on how the quads lie; with diagonals 8 %), beams, and one link between every two pieces
    /// of the skeleton that touch the same body: the shortest straight line.
    pub fn new(skeleton: &Skeleton, contacts: &[Contact]) -> Self {
        let mut graph = Self::of_points(&skeleton.points, &skeleton.radii);
        let mut diagonals: Vec<[u32; 2]> = Vec::new();
        for quad in &skeleton.quads {
            diagonals.push(sorted(quad[0], quad[2]));
            diagonals.push(sorted(quad[1], quad[3]));
        }
        let faces = skeleton.quads.iter().map(|q| &q[..]);
        graph.add_faces(faces, diagonals);
        graph.add_beams(&skeleton.beams);
        graph.link(contacts)
    }

    /// The graph of a medial mesh: the edges of its triangles and its curves, and links as in [`FeedGraph::new`].
    pub fn of_medial(axis: &MedialMesh, contacts: &[Contact]) -> Self {
        let mut graph = Self::of_points(&axis.points, &axis.radii);
        let faces = axis.triangles.iter().map(|t| &t[..]);
        graph.add_faces(faces, Vec::new());
        graph.add_beams(&axis.edges);
        graph.link(contacts)
    }

    fn of_points(points: &[Vec3], radii: &[f64]) -> Self {
        let n = points.len();
        Self {
            points: points.to_vec(),
            radii: radii.to_vec(),
            sheet: vec![0.0; n],
            beam: vec![0.0; n],
            rim: vec![0.0; n],
            ..Self::default()
        }
    }

    /// Sides of faces with their areas and rims, and further edges across them.
    fn add_faces<'a>(&mut self, faces: impl Iterator<Item = &'a [u32]>, diagonals: Vec<[u32; 2]>) {
        let mut sides: Vec<[u32; 2]> = Vec::new();
        for face in faces {
            let at = |k: usize| self.points[face[k] as usize];
            let pieces =
                (2..face.len()).map(|k| (at(k - 1) - at(0)).cross(&(at(k) - at(0))).norm());
            let share = pieces.sum::<f64>() / 2.0 / face.len() as f64;
            for (k, &v) in face.iter().enumerate() {
                self.sheet[v as usize] += share;
                sides.push(sorted(v, face[(k + 1) % face.len()]));
            }
        }
        sides.sort_unstable();
        for group in sides.chunk_by(|x, y| x == y) {
            let length = self.length(group[0]);
            if group.len() == 1 {
                for v in group[0] {
                    self.rim[v as usize] += length / 2.0;
                }
            }
        }
        sides.extend(diagonals);
        self.add(sides, EdgeKind::Sheet);
    }

    fn add_beams(&mut self, beams: &[[u32; 2]]) {
        for &beam in beams {
            let length = self.length(beam);
            for v in beam {
                self.beam[v as usize] += length / 2.0;
            }
        }
        let beams = beams.iter().map(|b| sorted(b[0], b[1])).collect();
        self.add(beams, EdgeKind::Beam);
    }

    fn link(mut self, contacts: &[Contact]) -> Self {
        self.index();
        let pieces = self.pieces();
        for contact in contacts {
            let links = self.shortest_links(&contact.touching, &pieces);
            self.links.extend(&links);
            self.add(links, EdgeKind::Link);
        }
        self.links.sort_unstable();
        self.index();
        self
    }

    /// Number of the connected piece of every point.
    fn pieces(&self) -> Vec<u32> {
        let mut piece = vec![u32::MAX; self.points.len()];
        let mut stack = Vec::new();
        for start in 0..self.points.len() as u32 {
            stack.push(start);
            while let Some(v) = stack.pop() {
                if piece[v as usize] == u32::MAX {
                    piece[v as usize] = start;
                    stack.extend(self.neighbours(v).iter().map(|n| n.0));
                }
            }
        }
        piece
    }

    /// The shortest link between every two pieces among points that touch one body.
    fn shortest_links(&self, touching: &[u32], piece: &[u32]) -> Vec<[u32; 2]> {
        let mut best: BTreeMap<[u32; 2], (f64, [u32; 2])> = BTreeMap::new();
        for (i, &a) in touching.iter().enumerate() {
            for &b in &touching[i + 1..] {
                let key = sorted(piece[a as usize], piece[b as usize]);
                if key[0] == key[1] {
                    continue;
                }
                let length = self.length([a, b]);
                let least = best.entry(key).or_insert((f64::INFINITY, [a, b]));
                if length < least.0 {
                    *least = (length, sorted(a, b));
                }
            }
        }
        best.into_values().map(|(_, edge)| edge).collect()
    }

    fn length(&self, edge: [u32; 2]) -> f64 {
        (self.points[edge[0] as usize] - self.points[edge[1] as usize]).norm()
    }

    fn add(&mut self, mut edges: Vec<[u32; 2]>, kind: EdgeKind) {
        edges.sort_unstable();
        edges.dedup();
        edges.retain(|e| e[0] != e[1]);
        let edges = edges.into_iter().map(|points| FeedEdge {
            points,
            length: self.length(points),
            kind,
        });
        self.edges.extend(edges.collect::<Vec<_>>());
    }

    fn index(&mut self) {
        let mut both: Vec<(u32, u32, f64)> = Vec::with_capacity(2 * self.edges.len());
        for edge in &self.edges {
            let [a, b] = edge.points;
            both.push((a, b, edge.length));
            both.push((b, a, edge.length));
        }
        both.sort_by(|x, y| (x.0, x.1).cmp(&(y.0, y.1)).then(x.2.total_cmp(&y.2)));
        self.start = vec![0; self.points.len() + 1];
        for &(a, ..) in &both {
            self.start[a as usize + 1] += 1;
        }
        for v in 0..self.points.len() {
            self.start[v + 1] += self.start[v];
        }
        self.neighbours = both.into_iter().map(|(_, b, l)| (b, l)).collect();
    }

    /// Neighbours of `v` and the lengths of the edges to them.
    pub fn neighbours(&self, v: u32) -> &[(u32, f64)] {
        &self.neighbours[self.start[v as usize] as usize..self.start[v as usize + 1] as usize]
    }

    /// Whether metal flows from `v` to its neighbour `w` through a non-design body.
    pub fn is_link(&self, v: u32, w: u32) -> bool {
        self.links.binary_search(&sorted(v, w)).is_ok()
    }

    /// Metal around point `v` when its radius is `r`, mm3: sheets `2 r A`, beams `pi r^2 L`, rims a half cylinder.
    pub fn volume_at(&self, v: usize, r: f64) -> f64 {
        2.0 * r * self.sheet[v] + PI * r * r * (self.beam[v] + self.rim[v] / 2.0)
    }

    /// Metal around all points, mm3.
    pub fn volume(&self, radii: &[f64]) -> f64 {
        let each = radii.iter().enumerate();
        each.map(|(v, &r)| self.volume_at(v, r)).sum()
    }

    /// Modulus over radius of every point: 1 in a plate, 1/2 in a bar, 1/3 in a ball; volume over cooling area of the
    /// metal around the point.
    pub fn shape_factors(&self) -> Vec<f64> {
        let each = self.radii.iter().enumerate();
        each.map(|(v, &r)| {
            let round = self.beam[v] + self.rim[v] / 2.0;
            let cooling = 2.0 * self.sheet[v] + 2.0 * PI * r * round;
            if cooling > 0.0 {
                (self.volume_at(v, r) / (r * cooling)).clamp(1.0 / 3.0, 1.0)
            } else {
                1.0 / 3.0
            }
        })
        .collect()
    }
}

/// Distance of every point to its nearest seed along the graph, and which seed that is.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Distances {
    /// mm; infinite where no seed is reached.
    pub distance: Vec<f64>,
    /// Next point on the way to the seed; itself at a seed and where none is reached.
    pub parent: Vec<u32>,
    /// Number of the feeder, `u32::MAX` where none is reached.
    pub feeder: Vec<u32>,
}

/// A point where the distance to a feeder begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seed {
    /// The point.
    pub point: u32,
    /// Its distance to the feeder, mm.
    pub distance: f64,
    /// Number of the feeder.
    pub feeder: u32,
}

#[derive(PartialEq)]
struct Entry(f64, u32);

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0).then(self.1.cmp(&other.1))
    }
}

/// Shortest distances from several seeds (Dijkstra), O(E log V). Ties go to the lower point.
pub fn distances(graph: &FeedGraph, seeds: &[Seed]) -> Distances {
    let n = graph.points.len();
    let mut out = Distances {
        distance: vec![f64::INFINITY; n],
        parent: (0..n as u32).collect(),
        feeder: vec![u32::MAX; n],
    };
    let mut queue = BinaryHeap::new();
    for seed in seeds {
        let v = seed.point as usize;
        if seed.distance < out.distance[v] {
            out.distance[v] = seed.distance;
            out.feeder[v] = seed.feeder;
            queue.push(Reverse(Entry(seed.distance, seed.point)));
        }
    }
    while let Some(Reverse(Entry(d, v))) = queue.pop() {
        if d > out.distance[v as usize] {
            continue;
        }
        for &(w, length) in graph.neighbours(v) {
            let far = d + length;
            let to = w as usize;
            if far < out.distance[to] {
                out.distance[to] = far;
                out.parent[to] = v;
                out.feeder[to] = out.feeder[v as usize];
                queue.push(Reverse(Entry(far, w)));
            }
        }
    }
    out
}

fn sorted(a: u32, b: u32) -> [u32; 2] {
    if a < b { [a, b] } else { [b, a] }
}
