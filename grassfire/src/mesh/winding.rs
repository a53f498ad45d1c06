//! Generalized winding number of a triangle soup.

use rayon::prelude::*;

use super::bvh::Bvh;
use crate::Vec3;

/// A node is far when the query is this many node radii away.
const FAR: f64 = 2.0;

/// The generalized winding number of the triangles of a [`Bvh`]: 1 inside, 0 outside, smooth across holes,
/// 2 where two bodies overlap. For a soup with good orientation "inside" is `> 0.5`.
///
/// 1. Every node of the tree gets the area-weighted centroid of its triangles and the first three moments of the
///    dipole density (normal times area) about it.
/// 2. A query far from a node (2 radii) uses the Taylor expansion of the dipole kernel up to second order;
///    near nodes are opened, triangles of near leaves give their exact solid angle.
///
/// The error stays below about 0.01, so compare with 0.5, not with integers. Cost O(log n) a query.
///
/// Barill, Dickson, Schmidt, Levin, Jacobson: Fast winding numbers for soups and clouds, 2018, doi:10.1145/3197517.3201337.
#[derive(Debug, Clone)]
pub struct Winding<'a> {
    bvh: &'a Bvh,
    moments: Vec<Moments>,
}

#[derive(Debug, Clone, Default)]
struct Moments {
    area: f64,
    centre: Vec3,
    radius: f64,
    /// Integral of n.
    zeroth: Vec3,
    /// Integral of (x - centre)_i n_k at `first[k][i]`.
    first: [Vec3; 3],
    /// Integral of (x - centre)_i (x - centre)_j n_k at `second[k]`, in the order xx, yy, zz, xy, yz, zx.
    second: [[f64; 6]; 3],
    /// `2 sum_i S_iji + sum_i S_iij`, the trace part of the second-order term.
    trace: Vec3,
}

impl<'a> Winding<'a> {
    /// Computes the moments of every node in O(n).
    pub fn new(bvh: &'a Bvh) -> Self {
        let mut moments = vec![Moments::default(); bvh.nodes.len()];
        // Children come after their parent.
        for index in (0..bvh.nodes.len()).rev() {
            let node = &bvh.nodes[index];
            let mut sum = if node.right == 0 {
                leaf(&bvh.corners[node.first as usize..(node.first + node.count) as usize])
            } else {
                join(&moments[index + 1], &moments[node.right as usize])
            };
            let reach = (node.hi - sum.centre)
                .abs()
                .sup(&(sum.centre - node.lo).abs());
            sum.radius = reach.norm();
            let s = &sum.second;
            let xyz = |k: usize| [s[k][0], s[k][3], s[k][5], s[k][1], s[k][4], s[k][2]];
            let (x, y, z) = (xyz(0), xyz(1), xyz(2)); // xx xy xz yy yz zz
            let contraction = Vec3::new(x[0] + y[1] + z[2], x[1] + y[3] + z[4], x[2] + y[4] + z[5]);
            let laplace = Vec3::new(x[0] + x[3] + x[5], y[0] + y[3] + y[5], z[0] + z[3] + z[5]);
            sum.trace = 2.0 * contraction + laplace;
            moments[index] = sum;
        }
        Self { bvh, moments }
    }

    /// The winding number at `q`.
    pub fn at(&self, q: &Vec3) -> f64 {
        if self.moments.is_empty() {
            return 0.0;
        }
        let mut sum = 0.0;
        let mut stack = [0u32; 72];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let index = stack[top] as usize;
            let moments = &self.moments[index];
            let r = moments.centre - q;
            if r.norm_squared() > (FAR * moments.radius).powi(2) {
                sum += moments.expansion(&r);
                continue;
            }
            let node = &self.bvh.nodes[index];
            if node.right == 0 {
                let range = node.first as usize..(node.first + node.count) as usize;
                sum += self.bvh.corners[range]
                    .iter()
                    .map(|t| solid_angle(q, t))
                    .sum::<f64>();
            } else {
                stack[top] = node.right;
                stack[top + 1] = index as u32 + 1;
                top += 2;
            }
        }
        sum / (4.0 * std::f64::consts::PI)
    }

    /// The winding numbers at many points, in parallel, in order.
    pub fn at_all(&self, points: &[Vec3]) -> Vec<f64> {
        points
            .par_iter()
            .with_min_len(256)
            .map(|q| self.at(q))
            .collect()
    }
}

impl Moments {
    /// Taylor expansion of the integral of n . x / |x|^3 about `r`, the vector from the query to the centre.
    fn expansion(&self, r: &Vec3) -> f64 {
        let inverse2 = 1.0 / r.norm_squared();
        let inverse3 = inverse2 * inverse2.sqrt();
        let inverse5 = inverse3 * inverse2;
        let trace = self.first[0].x + self.first[1].y + self.first[2].z;
        let quadratic: f64 = (0..3).map(|k| r[k] * self.first[k].dot(r)).sum();
        let products = [
            r.x * r.x,
            r.y * r.y,
            r.z * r.z,
            2.0 * r.x * r.y,
            2.0 * r.y * r.z,
            2.0 * r.z * r.x,
        ];
        let mut cubic = 0.0;
        for k in 0..3 {
            let form: f64 = self.second[k]
                .iter()
                .zip(&products)
                .map(|(s, p)| s * p)
                .sum();
            cubic += r[k] * form;
        }
        self.zeroth.dot(r) * inverse3 + trace * inverse3 - 3.0 * quadratic * inverse5
            + 0.5 * inverse5 * (15.0 * cubic * inverse2 - 3.0 * self.trace.dot(r))
    }

    /// Moves the centre of expansion; `self.trace` and `self.radius` are left for the caller.
    fn about(&self, centre: &Vec3) -> ([Vec3; 3], [[f64; 6]; 3]) {
        let d = self.centre - centre;
        let mut first = self.first;
        let mut second = self.second;
        for k in 0..3 {
            let (m, n) = (self.first[k], self.zeroth[k]);
            for (slot, (i, j)) in PAIRS.into_iter().enumerate() {
                second[k][slot] += d[i] * m[j] + m[i] * d[j] + d[i] * d[j] * n;
            }
            first[k] += d * n;
        }
        (first, second)
    }
}

const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)];

fn leaf(triangles: &[[Vec3; 3]]) -> Moments {
    let mut out = Moments::default();
    let mut plain = Vec3::zeros();
    for [a, b, c] in triangles {
        let area = (b - a).cross(&(c - a)).norm() / 2.0;
        out.area += area;
        out.centre += (a + b + c) / 3.0 * area;
        plain += (a + b + c) / 3.0;
    }
    out.centre = if out.area > 0.0 {
        out.centre / out.area
    } else {
        plain / triangles.len().max(1) as f64
    };
    for [a, b, c] in triangles {
        let normal = (b - a).cross(&(c - a)) / 2.0;
        let corners = [a - out.centre, b - out.centre, c - out.centre];
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        out.zeroth += normal;
        for k in 0..3 {
            out.first[k] += middle * normal[k];
            for (slot, (i, j)) in PAIRS.into_iter().enumerate() {
                // Exact second moment of a triangle.
                let sum: f64 = corners.iter().map(|v| v[i] * v[j]).sum();
                out.second[k][slot] += (sum + 9.0 * middle[i] * middle[j]) / 12.0 * normal[k];
            }
        }
    }
    out
}

fn join(a: &Moments, b: &Moments) -> Moments {
    let area = a.area + b.area;
    let centre = if area > 0.0 {
        (a.centre * a.area + b.centre * b.area) / area
    } else {
        (a.centre + b.centre) / 2.0
    };
    let (mut first, mut second) = a.about(&centre);
    let (first_b, second_b) = b.about(&centre);
    for k in 0..3 {
        first[k] += first_b[k];
        for slot in 0..6 {
            second[k][slot] += second_b[k][slot];
        }
    }
    Moments {
        area,
        centre,
        zeroth: a.zeroth + b.zeroth,
        first,
        second,
        ..Moments::default()
    }
}

/// Signed solid angle of a triangle seen from `q` (van Oosterom and Strackee 1983, doi:10.1109/TBME.1983.325207).
fn solid_angle(q: &Vec3, triangle: &[Vec3; 3]) -> f64 {
    let [a, b, c] = triangle.map(|v| v - q);
    let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
    let numerator = a.dot(&b.cross(&c));
    let denominator = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
    if numerator == 0.0 && denominator <= 0.0 {
        0.0
    } else {
        2.0 * numerator.atan2(denominator)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;

    /// A sphere of radius 1 as a latitude-longitude mesh.
    fn sphere(n: u32) -> TriMesh {
        let mut points = Vec::new();
        let mut triangles = Vec::new();
        for i in 0..=n {
            for j in 0..2 * n {
                let (u, v) = (
                    std::f64::consts::PI * f64::from(i) / f64::from(n),
                    std::f64::consts::PI * f64::from(j) / f64::from(n),
                );
                points.push(Vec3::new(u.sin() * v.cos(), u.sin() * v.sin(), u.cos()));
            }
        }
        for i in 0..n {
            for j in 0..2 * n {
                let k = (j + 1) % (2 * n);
                let at = |i: u32, j: u32| i * 2 * n + j;
                triangles.push([at(i, j), at(i + 1, j), at(i + 1, k)]);
                triangles.push([at(i, j), at(i + 1, k), at(i, k)]);
            }
        }
        TriMesh {
            points,
            triangles,
            tags: vec![],
        }
    }

    #[test]
    fn one_inside_zero_outside_and_close_to_the_direct_sum() {
        let mesh = sphere(24);
        let bvh = Bvh::new(&mesh);
        let winding = Winding::new(&bvh);
        let queries: Vec<Vec3> = (0..200)
            .map(|i| {
                Vec3::new(
                    (f64::from(i) * 0.37).sin(),
                    (f64::from(i) * 0.61).cos(),
                    (f64::from(i) * 0.23).sin(),
                ) * 1.3
            })
            .collect();
        for (q, w) in queries.iter().zip(winding.at_all(&queries)) {
            let direct: f64 = (0..mesh.triangles.len())
                .map(|t| solid_angle(q, &mesh.corners(t)))
                .sum::<f64>()
                / (4.0 * std::f64::consts::PI);
            assert!((w - direct).abs() < 1e-2, "{w} {direct}");
            if (q.norm() - 1.0).abs() > 0.02 {
                assert_eq!(w > 0.5, q.norm() < 1.0);
            }
        }
    }

    #[test]
    fn a_hole_does_not_leak() {
        let mut mesh = sphere(24);
        mesh.triangles.drain(300..340);
        let bvh = Bvh::new(&mesh);
        let winding = Winding::new(&bvh);
        assert!(winding.at(&Vec3::zeros()) > 0.9);
        assert!(winding.at(&Vec3::new(0.0, 0.0, 3.0)).abs() < 0.05);
    }

    #[test]
    fn nothing_has_no_winding() {
        let bvh = Bvh::new(&TriMesh::default());
        assert_eq!(Winding::new(&bvh).at(&Vec3::zeros()), 0.0);
    }
}
