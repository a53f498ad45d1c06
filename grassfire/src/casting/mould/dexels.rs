//! Dexels: the intervals of a solid along parallel lines.

use crate::Vec3;
use crate::mesh::TriMesh;

/// Intervals of material along lines in one direction, on a square lattice.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Dexels {
    /// Lines along the two axes across.
    pub dims: [usize; 2],
    /// Distance of lines, mm.
    pub pitch: f64,
    /// Axes: across, across, along; orthonormal.
    pub axes: [Vec3; 3],
    /// Place of the first line on the two axes across, mm.
    pub origin: [f64; 2],
    /// Where the intervals of each line begin in `intervals`, and the end.
    pub start: Vec<u32>,
    /// Lower and upper end of each, ascending, mm along the third axis.
    pub intervals: Vec<[f64; 2]>,
}

/// Where lines lie.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Lattice {
    /// Axes: across, across, along; orthonormal.
    pub axes: [Vec3; 3],
    /// Place of the first line on the two axes across, mm.
    pub origin: [f64; 2],
    /// Distance of lines, mm.
    pub pitch: f64,
    /// Lines along the two axes across.
    pub dims: [usize; 2],
}

impl Dexels {
    /// Intervals of line `line`, ascending.
    pub fn line(&self, line: usize) -> &[[f64; 2]] {
        &self.intervals[self.start[line] as usize..self.start[line + 1] as usize]
    }

    /// The point at height `z` on a line, mm.
    pub fn place(&self, line: usize, z: f64) -> Vec3 {
        let at = [line % self.dims[0], line / self.dims[0]];
        let [u, v] = [0, 1].map(|a| self.origin[a] + at[a] as f64 * self.pitch);
        u * self.axes[0] + v * self.axes[1] + z * self.axes[2]
    }

    /// Lines that share a side with `line`.
    pub fn beside(&self, line: usize) -> impl Iterator<Item = usize> {
        let [nx, ny] = self.dims;
        let (i, j) = (line % nx, line / nx);
        let near = [
            (i > 0).then(|| line - 1),
            (i + 1 < nx).then(|| line + 1),
            (j > 0).then(|| line - nx),
            (j + 1 < ny).then(|| line + nx),
        ];
        near.into_iter().flatten()
    }
}

/// Lines are shifted against the box by these shares of the pitch, so that they miss the corners of aligned parts.
const SHIFT: [f64; 2] = [0.487_231, 0.513_917];
/// Shorter intervals and gaps are rounding, mm a mm of size.
const ROUNDING: f64 = 1e-9;

/// Axes across a unit direction and the direction itself.
pub fn axes(direction: &Vec3) -> [Vec3; 3] {
    let across = crate::thicken::perpendicular(direction);
    [across, direction.cross(&across), *direction]
}

/// Cuts a closed mesh into intervals along the unit vector `direction`, with `count` lines along its longer side; see
/// [`dexels_on`].
pub fn dexels(mesh: &TriMesh, direction: &Vec3, count: usize) -> Dexels {
    let axes = axes(direction);
    let used = mesh.triangles.iter().flatten();
    let places = used.map(|&v| along(&axes, &mesh.points[v as usize]));
    let bounds = places.fold(None, |bounds: Option<(Vec3, Vec3)>, p| {
        Some(bounds.map_or((p, p), |(lo, hi)| (lo.inf(&p), hi.sup(&p))))
    });
    let Some((lo, hi)) = bounds else {
        return Dexels {
            axes,
            start: vec![0],
            ..Dexels::default()
        };
    };
    let size = hi - lo;
    let pitch = (size.x.max(size.y) / count.max(1) as f64).max(1e-12);
    let lattice = Lattice {
        axes,
        origin: [lo.x + SHIFT[0] * pitch, lo.y + SHIFT[1] * pitch],
        pitch,
        dims: [size.x, size.y].map(|s| (s / pitch).ceil().max(1.0) as usize),
    };
    dexels_on(mesh, &lattice)
}

/// Cuts a closed mesh into intervals along the lines of a lattice.
///
/// Each triangle is drawn onto the lattice; a line lies in it when it lies on the inner side of all three edges. An edge is
/// judged with its ends in a fixed order, so that its two triangles never both take or both miss a line. Along a line the
/// winding number tells what is inside: overlapping bodies count once. O(triangles + hits log hits).
pub fn dexels_on(mesh: &TriMesh, lattice: &Lattice) -> Dexels {
    let Lattice {
        axes,
        origin,
        pitch,
        dims,
    } = *lattice;
    let points: Vec<Vec3> = mesh.points.iter().map(|p| along(&axes, p)).collect();
    let mut hits: Vec<(u32, f64, i8)> = Vec::new();
    for triangle in &mesh.triangles {
        draw(triangle, &points, origin, pitch, dims, &mut hits);
    }
    let lines = dims[0] * dims[1];
    let (start, hits) = by_line(&hits, lines);
    let mut out = Dexels {
        dims,
        pitch,
        axes,
        origin,
        start: Vec::with_capacity(lines + 1),
        intervals: Vec::new(),
    };
    let size = mesh.bounds().map_or(0.0, |(lo, hi)| (hi - lo).norm());
    let least = ROUNDING * size;
    let mut on_line: Vec<(f64, i8)> = Vec::new();
    for line in 0..lines {
        out.start.push(out.intervals.len() as u32);
        on_line.clear();
        on_line.extend_from_slice(&hits[start[line] as usize..start[line + 1] as usize]);
        on_line.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        gather(&on_line, least, &mut out.intervals);
    }
    out.start.push(out.intervals.len() as u32);
    out
}

/// Hits in the order of their lines, and where those of each line begin, and the end.
fn by_line(hits: &[(u32, f64, i8)], lines: usize) -> (Vec<u32>, Vec<(f64, i8)>) {
    let mut start = vec![0_u32; lines + 1];
    for hit in hits {
        start[hit.0 as usize + 1] += 1;
    }
    for line in 0..lines {
        start[line + 1] += start[line];
    }
    let (mut next, mut out) = (start.clone(), vec![(0.0, 0); hits.len()]);
    for &(line, z, step) in hits {
        let at = &mut next[line as usize];
        out[*at as usize] = (z, step);
        *at += 1;
    }
    (start, out)
}

/// Coordinates of a point on three axes.
fn along(axes: &[Vec3; 3], p: &Vec3) -> Vec3 {
    Vec3::new(p.dot(&axes[0]), p.dot(&axes[1]), p.dot(&axes[2]))
}

/// Adds what lies inside along one line.
fn gather(hits: &[(f64, i8)], least: f64, intervals: &mut Vec<[f64; 2]>) {
    let first = intervals.len();
    let mut depth = 0_i32;
    let mut begin = 0.0;
    for &(z, step) in hits {
        let before = depth;
        depth += i32::from(step);
        if before <= 0 && depth > 0 {
            begin = z;
        } else if before > 0 && depth <= 0 && z - begin > least {
            match intervals[first..].last_mut() {
                Some(last) if begin - last[1] <= least => last[1] = z,
                _ => intervals.push([begin, z]),
            }
        }
    }
}

/// Twice the signed area of (a, b, p), the same up to sign for (b, a, p).
fn side(a: (u32, &Vec3), b: (u32, &Vec3), x: f64, y: f64) -> f64 {
    let (sign, a, b) = if a.0 < b.0 {
        (1.0, a.1, b.1)
    } else {
        (-1.0, b.1, a.1)
    };
    sign * ((b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x))
}

fn draw(
    triangle: &[u32; 3],
    points: &[Vec3],
    origin: [f64; 2],
    pitch: f64,
    dims: [usize; 2],
    hits: &mut Vec<(u32, f64, i8)>,
) {
    let [a, b, c] = triangle.map(|v| (v, &points[v as usize]));
    let area = (b.1 - a.1).xy().perp(&(c.1 - a.1).xy());
    if area == 0.0 || !area.is_finite() {
        return;
    }
    let (lo, hi) = (a.1.inf(b.1).inf(c.1), a.1.sup(b.1).sup(c.1));
    let range = |axis: usize| {
        let first = ((lo[axis] - origin[axis]) / pitch).ceil().max(0.0) as usize;
        let last = ((hi[axis] - origin[axis]) / pitch).floor();
        let end = if last < 0.0 {
            0
        } else {
            (last as usize + 1).min(dims[axis])
        };
        first..end
    };
    for j in range(1) {
        let y = origin[1] + j as f64 * pitch;
        for i in range(0) {
            let x = origin[0] + i as f64 * pitch;
            let (wc, wa, wb) = (side(a, b, x, y), side(b, c, x, y), side(c, a, x, y));
            let inside = if area > 0.0 {
                wa >= 0.0 && wb >= 0.0 && wc >= 0.0
            } else {
                wa < 0.0 && wb < 0.0 && wc < 0.0
            };
            let sum = wa + wb + wc;
            if inside && sum != 0.0 {
                let z = (wa * a.1.z + wb * b.1.z + wc * c.1.z) / sum;
                // Seen from below: a face that looks down begins material.
                let step = if area > 0.0 { -1 } else { 1 };
                hits.push(((j * dims[0] + i) as u32, z, step));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::cuboid;

    #[test]
    fn a_box_is_one_interval_a_line() {
        let mesh = cuboid(Vec3::new(-1.0, -2.0, -3.0), Vec3::new(4.0, 5.0, 6.0));
        for direction in [Vec3::z(), -Vec3::x(), Vec3::new(1.0, 2.0, 3.0).normalize()] {
            let found = dexels(&mesh, &direction, 64);
            let length: f64 = found.intervals.iter().map(|i| i[1] - i[0]).sum();
            let volume = length * found.pitch * found.pitch;
            assert!(
                (volume / 315.0 - 1.0).abs() < 0.02,
                "{direction:?}: {volume}"
            );
            assert!((0..found.start.len() - 1).all(|l| found.line(l).len() <= 1));
        }
    }

    #[test]
    fn overlapping_bodies_count_once() {
        let mut mesh = cuboid(Vec3::zeros(), Vec3::repeat(2.0));
        let other = cuboid(Vec3::repeat(1.0), Vec3::repeat(3.0));
        mesh.append(other.points, other.triangles);
        let found = dexels(&mesh, &Vec3::z(), 30);
        let length: f64 = found.intervals.iter().map(|i| i[1] - i[0]).sum();
        assert!((length * found.pitch.powi(2) - 15.0).abs() < 0.3);
    }
}
