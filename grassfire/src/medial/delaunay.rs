//! Exact Delaunay triangulation in three dimensions.

use crate::Vec3;
use crate::monitor::Monitor;

use super::MedialError;
use super::predicates::{FloatKernel, Kernel, LatticeKernel, Point, SmallLatticeKernel};
use super::spatial_order::insertion_order;

/// "No tetrahedron": the facet lies on the hull.
pub const NONE: u32 = u32::MAX;

/// Most points that the 32-bit indices of facets allow.
const MOST_POINTS: usize = 1 << 26;
/// Largest coordinate for which the exact predicates cannot overflow.
const LARGEST: f64 = 1e50;
/// Smaller coordinates count as zero, for the exact predicates could underflow.
const SMALLEST: f64 = 1e-40;

/// A tetrahedron of a [`Delaunay`] triangulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tet {
    /// Indices of the input points; seen from the last one the first three run clockwise.
    pub vertices: [u32; 4],
    /// Behind the facet opposite vertex k: four times the neighbour plus its own facet number there, or [`NONE`].
    pub mates: [u32; 4],
}

/// A Delaunay triangulation: no point lies strictly inside the sphere through any tetrahedron.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Delaunay {
    /// The tetrahedra; together they fill the convex hull of the points.
    pub tets: Vec<Tet>,
}

/// For facet k of a tetrahedron and each other vertex j: the pair (x, y) that makes (k, j, x, y) an even permutation.
const EVEN: [[[usize; 3]; 3]; 4] = [
    [[1, 2, 3], [2, 3, 1], [3, 1, 2]],
    [[0, 3, 2], [2, 0, 3], [3, 2, 0]],
    [[0, 1, 3], [1, 3, 0], [3, 0, 1]],
    [[0, 2, 1], [1, 0, 2], [2, 1, 0]],
];

/// Triangulates points with float coordinates.
///
/// Signs come from filtered, then exact predicates, so the result is a valid Delaunay triangulation
/// of exactly these coordinates; of cospherical points one of the possible triangulations is taken.
/// Duplicates are left out (the point of a group that comes first in insertion order stays).
///
/// 1. Order the points in biased randomised rounds along a Hilbert curve.
/// 2. For each point: walk to the tetrahedron that holds it; collect the tetrahedra whose sphere
///    holds it strictly; replace them by the cone from the point to their boundary.
///    Hull facets carry tetrahedra to a vertex at infinity, so points outside need no special case.
///
/// # Errors
/// [`MedialError::NotFinite`], [`MedialError::TooLarge`] and [`MedialError::TooMany`] on unusable
/// coordinates, [`MedialError::Flat`] when all points lie in one plane.
///
/// # Sources
/// A. Bowyer, The Computer Journal 24 (1981), <https://doi.org/10.1093/comjnl/24.2.162>;
/// D. F. Watson, The Computer Journal 24 (1981), <https://doi.org/10.1093/comjnl/24.2.167>;
/// O. Devillers, S. Pion, M. Teillaud, "Walking in a triangulation",
/// <https://doi.org/10.1142/S0129054102001047>.
pub fn delaunay(points: &[Vec3], monitor: &Monitor) -> Result<Delaunay, MedialError> {
    for (index, p) in points.iter().enumerate() {
        for value in p.iter().copied() {
            if !value.is_finite() {
                return Err(MedialError::NotFinite { index });
            }
            if value.abs() > LARGEST {
                return Err(MedialError::TooLarge {
                    index,
                    value,
                    limit: LARGEST,
                });
            }
        }
    }
    let flush = |x: f64| if x.abs() < SMALLEST { 0.0 } else { x };
    let points = points
        .iter()
        .map(|p| [flush(p.x), flush(p.y), flush(p.z)])
        .collect();
    triangulate(points, FloatKernel, monitor)
}

/// Triangulates points with integer coordinates: as [`delaunay`], but two to three times as fast on
/// the many cospherical points of a lattice, since plain arithmetic is exact there.
///
/// # Errors
/// As [`delaunay`]; [`MedialError::TooLarge`] when a coordinate exceeds 50 000.
pub fn delaunay_lattice(points: &[[i32; 3]], monitor: &Monitor) -> Result<Delaunay, MedialError> {
    let limit = LatticeKernel::REACH / 2.0;
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    let mut floats: Vec<Point> = Vec::with_capacity(points.len());
    for (index, p) in points.iter().enumerate() {
        let p = p.map(f64::from);
        for k in 0..3 {
            if p[k].abs() > limit {
                return Err(MedialError::TooLarge {
                    index,
                    value: p[k],
                    limit,
                });
            }
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
        floats.push(p);
    }
    if (0..3).all(|k| high[k] - low[k] <= SmallLatticeKernel::REACH) {
        triangulate(floats, SmallLatticeKernel, monitor)
    } else {
        triangulate(floats, LatticeKernel, monitor)
    }
}

fn triangulate<K: Kernel>(
    points: Vec<Point>,
    kernel: K,
    monitor: &Monitor,
) -> Result<Delaunay, MedialError> {
    if points.len() > MOST_POINTS {
        return Err(MedialError::TooMany {
            count: points.len(),
            limit: MOST_POINTS,
        });
    }
    let order = insertion_order(&points);
    let mut sorted = Vec::with_capacity(points.len() + 1);
    sorted.push([0.0; 3]);
    sorted.extend(order.iter().map(|&i| points[i as usize]));
    drop(points);
    let first = first_tet(&sorted, kernel)?;
    let mut builder = Builder::new(sorted, kernel, first);
    for p in 1..=order.len() as u32 {
        if p % 8192 == 0 {
            monitor.step("medial", "Delaunay", f64::from(p) / order.len() as f64)?;
        }
        if !first.contains(&p) {
            builder.insert(p)?;
        }
    }
    Ok(builder.finish(&order))
}

/// Four points that span space, positively oriented.
fn first_tet<K: Kernel>(points: &[Point], kernel: K) -> Result<[u32; 4], MedialError> {
    let flat = |dimension| MedialError::Flat {
        points: points.len() - 1,
        dimension,
    };
    let n = points.len();
    let a = points.get(1).ok_or(flat(0))?;
    let i = (2..n).find(|&i| points[i] != *a).ok_or(flat(0))?;
    let b = points[i];
    // Three points are collinear exactly when they are coplanar with every fourth point; three
    // points off one line through no common plane with them decide that by exact signs.
    let spans = |c: &Point| {
        (0..3).any(|k| {
            let reach = 1.0 + a[k].abs().max(b[k].abs()).max(c[k].abs());
            let mut off = *a;
            off[k] += if a[k] > 0.0 { -reach } else { reach };
            kernel.orient(a, &b, c, &off) != 0.0
        })
    };
    let j = (i + 1..n).find(|&j| spans(&points[j])).ok_or(flat(1))?;
    let c = points[j];
    let l = (j + 1..n)
        .find(|&l| kernel.orient(a, &b, &c, &points[l]) != 0.0)
        .ok_or(flat(2))?;
    let mut first = [1, i as u32, j as u32, l as u32];
    if kernel.orient(a, &b, &c, &points[l]) < 0.0 {
        first.swap(0, 1);
    }
    Ok(first)
}

/// The vertex at infinity; points start at index 1.
const GHOST: u32 = 0;
/// First vertex of an unused slot.
const DEAD: u32 = u32::MAX;
/// Cavities with more vertices than this are glued by sorting instead of by a table.
const TABLE: usize = 128;

struct Builder<K> {
    kernel: K,
    points: Vec<Point>,
    tets: Vec<Tet>,
    /// 2 s: in the cavity of insertion s; 2 s + 1: tested in insertion s and not in it.
    marks: Vec<u32>,
    insertion: u32,
    free: Vec<u32>,
    last: u32,
    random: u32,
    cavity: Vec<u32>,
    /// New tetrahedra: vertices with the new point in place, where in place, and the mate behind.
    cone: Vec<([u32; 4], u8, u32)>,
    fresh: Vec<u32>,
    /// Of each vertex: insertion and number within its cavity (`insertion * TABLE + number`).
    local: Vec<u64>,
    table: Vec<u32>,
}

impl<K: Kernel> Builder<K> {
    fn new(points: Vec<Point>, kernel: K, first: [u32; 4]) -> Self {
        let mut tets = Vec::with_capacity(points.len().saturating_mul(7) + 64);
        tets.push(Tet {
            vertices: first,
            mates: [NONE; 4],
        });
        for k in 0..4 {
            let mut vertices = first;
            vertices[k] = GHOST;
            vertices.swap((k + 1) % 4, (k + 2) % 4);
            tets.push(Tet {
                vertices,
                mates: [NONE; 4],
            });
        }
        let facet = |t: &Tet, k: usize| {
            let mut v = t.vertices;
            v[k] = DEAD;
            v.sort_unstable();
            v
        };
        for a in 0..20 {
            let wanted = facet(&tets[a / 4], a % 4);
            let mate = (0..20).find(|&b| b / 4 != a / 4 && facet(&tets[b / 4], b % 4) == wanted);
            tets[a / 4].mates[a % 4] = mate.expect("the five tetrahedra of a simplex close") as u32;
        }
        let local = vec![0; points.len()];
        Self {
            kernel,
            points,
            marks: vec![0; tets.len()],
            tets,
            insertion: 0,
            free: Vec::new(),
            last: 0,
            random: 1,
            cavity: Vec::new(),
            cone: Vec::new(),
            fresh: Vec::new(),
            local,
            table: vec![0; TABLE * TABLE],
        }
    }

    #[inline(always)]
    fn orient(&self, v: &[u32; 4]) -> f64 {
        let [a, b, c, d] = v.map(|i| &self.points[i as usize]);
        self.kernel.orient(a, b, c, d)
    }

    #[inline(always)]
    fn insphere(&self, v: &[u32; 4], p: u32) -> f64 {
        let [a, b, c, d] = v.map(|i| &self.points[i as usize]);
        self.kernel.insphere(a, b, c, d, &self.points[p as usize])
    }

    /// Does `p` lie strictly inside the sphere of `t` (of a ghost: strictly outside its hull facet)?
    #[inline(always)]
    fn conflicts(&self, t: u32, p: u32) -> bool {
        let v = self.tets[t as usize].vertices;
        match v.iter().position(|&x| x == GHOST) {
            None => self.insphere(&v, p) > 0.0,
            Some(k) => self.ghost_conflicts(t, k, p),
        }
    }

    fn ghost_conflicts(&self, t: u32, k: usize, p: u32) -> bool {
        let tet = self.tets[t as usize];
        let mut v = tet.vertices;
        v[k] = p;
        let side = self.orient(&v);
        if side != 0.0 {
            return side > 0.0;
        }
        // In the plane of the facet: the spheres of both tetrahedra at the facet cut it in the same circle.
        self.insphere(&self.tets[(tet.mates[k] >> 2) as usize].vertices, p) > 0.0
    }

    /// Remembering stochastic walk; ends in a tetrahedron that holds `p` or in a ghost that sees it.
    fn locate(&mut self, p: u32) -> Result<u32, MedialError> {
        let mut t = self.last;
        let start = self.tets[t as usize];
        if let Some(k) = start.vertices.iter().position(|&v| v == GHOST) {
            t = start.mates[k] >> 2;
        }
        let mut entered = 4;
        for _ in 0..4 * self.tets.len() + 64 {
            let tet = self.tets[t as usize];
            if tet.vertices.contains(&GHOST) {
                return Ok(t);
            }
            self.random = self
                .random
                .wrapping_mul(1_664_525)
                .wrapping_add(1_013_904_223);
            let turn = (self.random >> 30) as usize;
            let exit = (0..4).map(|j| (j + turn) & 3).find(|&k| {
                let mut v = tet.vertices;
                v[k] = p;
                k != entered && self.orient(&v) < 0.0
            });
            let Some(k) = exit else { return Ok(t) };
            t = tet.mates[k] >> 2;
            entered = (tet.mates[k] & 3) as usize;
        }
        // Cannot happen with exact predicates: a visibility walk in a Delaunay triangulation ends.
        Err(MedialError::Internal {
            what: "the walk to a point did not end",
            index: p as usize,
        })
    }

    fn insert(&mut self, p: u32) -> Result<(), MedialError> {
        let start = self.locate(p)?;
        let place = self.points[p as usize];
        if self.tets[start as usize]
            .vertices
            .iter()
            .any(|&v| v != GHOST && self.points[v as usize] == place)
        {
            return Ok(());
        }
        self.insertion += 1;
        self.collect_cavity(start, p);
        self.place_cone();
        let numbered = self.glue_by_table();
        if !numbered {
            self.glue_by_sorting();
        }
        self.last = self.fresh[0];
        Ok(())
    }

    /// Breadth-first from `start`: fills `cavity` and `cone`.
    fn collect_cavity(&mut self, start: u32, p: u32) {
        let inside = 2 * self.insertion;
        self.cavity.clear();
        self.cone.clear();
        self.marks[start as usize] = inside;
        self.cavity.push(start);
        let mut next = 0;
        while next < self.cavity.len() {
            let tet = self.tets[self.cavity[next] as usize];
            next += 1;
            for k in 0..4 {
                let mate = tet.mates[k];
                let n = mate >> 2;
                let mark = self.marks[n as usize];
                if mark == inside {
                    continue;
                }
                if mark != inside + 1 && self.conflicts(n, p) {
                    self.marks[n as usize] = inside;
                    self.cavity.push(n);
                } else {
                    self.marks[n as usize] = inside + 1;
                    let mut vertices = tet.vertices;
                    vertices[k] = p;
                    self.cone.push((vertices, k as u8, mate));
                }
            }
        }
    }

    /// Writes the new tetrahedra into the slots of the cavity and glues them to the outside.
    fn place_cone(&mut self) {
        self.fresh.clear();
        for i in 0..self.cone.len() {
            let (vertices, k, mate) = self.cone[i];
            let slot = match self.cavity.get(i).copied().or_else(|| self.free.pop()) {
                Some(slot) => slot,
                None => {
                    self.tets.push(Tet {
                        vertices,
                        mates: [NONE; 4],
                    });
                    self.marks.push(0);
                    (self.tets.len() - 1) as u32
                }
            };
            let tet = &mut self.tets[slot as usize];
            tet.vertices = vertices;
            tet.mates[usize::from(k)] = mate;
            self.tets[(mate >> 2) as usize].mates[(mate & 3) as usize] = slot << 2 | u32::from(k);
            self.fresh.push(slot);
        }
        for i in self.cone.len()..self.cavity.len() {
            self.tets[self.cavity[i] as usize].vertices[0] = DEAD;
            self.free.push(self.cavity[i]);
        }
    }

    /// Glues the new tetrahedra to each other: directed edges of the cavity boundary meet their
    /// opposites in a small table. False when the cavity has too many vertices for it.
    fn glue_by_table(&mut self) -> bool {
        let base = u64::from(self.insertion) * TABLE as u64;
        let mut count = 0;
        for i in 0..self.cone.len() {
            let (vertices, k, _) = self.cone[i];
            let k = usize::from(k);
            let mut number = [0usize; 4];
            for (j, &v) in vertices.iter().enumerate() {
                if j == k {
                    continue;
                }
                let known = self.local[v as usize];
                if known >= base {
                    number[j] = (known - base) as usize;
                } else {
                    if count == TABLE {
                        return false;
                    }
                    self.local[v as usize] = base + count as u64;
                    number[j] = count;
                    count += 1;
                }
            }
            let slot = self.fresh[i];
            for [j, x, y] in EVEN[k] {
                self.table[number[x] * TABLE + number[y]] = slot << 2 | j as u32;
            }
        }
        for i in 0..self.cone.len() {
            let (vertices, k, _) = self.cone[i];
            let number = vertices
                .map(|v| (self.local[v as usize].wrapping_sub(base) as usize) & (TABLE - 1));
            for [j, x, y] in EVEN[usize::from(k)] {
                self.tets[self.fresh[i] as usize].mates[j] =
                    self.table[number[y] * TABLE + number[x]];
            }
        }
        true
    }

    /// As [`Self::glue_by_table`] for cavities of any size.
    fn glue_by_sorting(&mut self) {
        let mut edges: Vec<(u64, u32)> = Vec::with_capacity(self.cone.len() * 3);
        for (&(v, k, _), &slot) in self.cone.iter().zip(&self.fresh) {
            for [j, x, y] in EVEN[usize::from(k)] {
                let (low, high) = (v[x].min(v[y]), v[x].max(v[y]));
                edges.push((u64::from(low) << 32 | u64::from(high), slot << 2 | j as u32));
            }
        }
        edges.sort_unstable();
        for pair in edges.chunks_exact(2) {
            let (a, b) = (pair[0].1, pair[1].1);
            self.tets[(a >> 2) as usize].mates[(a & 3) as usize] = b;
            self.tets[(b >> 2) as usize].mates[(b & 3) as usize] = a;
        }
    }

    /// Drops ghosts and unused slots and names the vertices by input index.
    fn finish(self, order: &[u32]) -> Delaunay {
        let Self {
            mut tets,
            marks: mut place,
            points,
            local,
            ..
        } = self;
        drop((points, local));
        let mut count = 0;
        for (tet, place) in tets.iter().zip(&mut place) {
            let kept = tet.vertices[0] != DEAD && !tet.vertices.contains(&GHOST);
            *place = if kept { count } else { NONE };
            count += u32::from(kept);
        }
        for t in 0..tets.len() {
            let to = place[t];
            if to == NONE {
                continue;
            }
            let Tet { vertices, mates } = tets[t];
            tets[to as usize] = Tet {
                vertices: vertices.map(|v| order[v as usize - 1]),
                mates: mates.map(|m| match place[(m >> 2) as usize] {
                    NONE => NONE,
                    n => n << 2 | m & 3,
                }),
            };
        }
        tets.truncate(count as usize);
        Delaunay { tets }
    }
}
