//! Position, tangents, twists and second derivatives of the surface at the points of the control mesh.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::ControlMesh;
use super::half_edges::{QuadTopology, next};
use crate::Vec3;

/// What all patches around a point share there.
pub(super) struct CornerData {
    /// Position at each point.
    pub position: Vec<Vec3>,
    /// Tangent along each half-edge at its origin.
    pub tangent: Vec<Vec3>,
    /// Mixed derivative of the quad of each half-edge at its origin, along the half-edge and along the one before.
    pub twist: Vec<Vec3>,
    /// Second derivative of the edge curve at the origin of each half-edge; used at extraordinary points only.
    pub bend: Vec<Vec3>,
}

/// Constants of one valence; see [`Constants::new`].
struct Constants {
    /// Cosine of the angle between neighbouring edges.
    cosine: f64,
    /// Weights of edge neighbours and diagonals in the Catmull-Clark limit tangent, times the scale.
    edge_weight: f64,
    diagonal_weight: f64,
    /// Twist of the planar configuration.
    twist: f64,
}

impl Constants {
    /// The scale makes tangents as long as those of the bicubic approximation (Loop and Schaefer) on the planar
    /// eigen-configuration of Catmull-Clark subdivision; the twist balances, by `weight`, the twist of that
    /// approximation against the curvature of the edges of the limit surface.
    fn new(valence: u32, weight: f64) -> Self {
        let n = f64::from(valence);
        let (cosine, half) = ((2.0 * PI / n).cos(), (PI / n).cos());
        let eigenvalue = (5.0 + cosine + half * (18.0 + 2.0 * cosine).sqrt()) / 16.0;
        let root = (4.0 + half * half).sqrt();
        let edge_weight = (1.0 + half / root) / n;
        let diagonal_weight = 1.0 / (n * root);
        let diagonal = 1.0 / (4.0 * eigenvalue - 1.0);
        let length = n / 2.0 * (edge_weight + diagonal_weight * 2.0 * half * diagonal);
        let scale = 3.0 * (2.0 + diagonal) / (n + 5.0) * (1.0 + cosine) / length;
        let ratio = (1.0 + cosine) / cosine;
        let curvature = 1.0 - 2.0 * eigenvalue;
        let bicubic_twist = -3.0 * cosine / (1.0 + cosine);
        let twist =
            (bicubic_twist + weight * ratio * (curvature - 2.0)) / (1.0 + weight * ratio * ratio);
        Self {
            cosine,
            edge_weight: scale * edge_weight,
            diagonal_weight: scale * diagonal_weight,
            twist,
        }
    }
}

/// Cosine of the angle between neighbouring edges at a point of valence `n`.
pub(super) fn edge_cosine(n: u32) -> f64 {
    (2.0 * PI / f64::from(n)).cos()
}

struct Ring {
    position: Vec3,
    /// Tangent, twist and bend for each half-edge of the ring.
    edges: Vec<(u32, [Vec3; 3])>,
}

/// Computes the data of all points; see [`super::patches`] for the steps.
pub(super) fn corner_data(
    mesh: &ControlMesh,
    half_edges: &QuadTopology,
    twist_weight: f64,
) -> CornerData {
    let count = half_edges.len();
    let face_points: Vec<Vec3> = (0..count)
        .into_par_iter()
        .map(|h| face_point(mesh, half_edges, h))
        .collect();
    let edge_points: Vec<Vec3> = (0..count)
        .into_par_iter()
        .map(|h| {
            (face_points[h as usize] + face_points[next(half_edges.twin[h as usize]) as usize])
                / 2.0
        })
        .collect();
    let largest = half_edges.valence.iter().copied().max().unwrap_or(0);
    let mut seen = vec![false; largest as usize + 1];
    half_edges
        .valence
        .iter()
        .for_each(|&n| seen[n as usize] = n != 4 && n > 0);
    let constants: Vec<Option<Constants>> = (0..=largest)
        .map(|n| seen[n as usize].then(|| Constants::new(n, twist_weight)))
        .collect();
    let star = Star {
        mesh,
        half_edges,
        face_points: &face_points,
        edge_points: &edge_points,
    };
    let rings: Vec<Option<Ring>> = (0..mesh.points.len() as u32)
        .into_par_iter()
        .map(|v| match half_edges.valence[v as usize] {
            0 => None,
            n => Some(match &constants[n as usize] {
                None => star.regular(v),
                Some(constants) => star.extraordinary(v, constants),
            }),
        })
        .collect();
    let zeros = || vec![Vec3::zeros(); count as usize];
    let mut data = CornerData {
        position: mesh.points.clone(),
        tangent: zeros(),
        twist: zeros(),
        bend: zeros(),
    };
    for (v, ring) in rings.into_iter().enumerate() {
        let Some(ring) = ring else { continue };
        data.position[v] = ring.position;
        for (h, [tangent, twist, bend]) in ring.edges {
            data.tangent[h as usize] = tangent;
            data.twist[h as usize] = twist;
            data.bend[h as usize] = bend;
        }
    }
    data
}

/// Bicubic face point of the corner at the origin of `h`.
fn face_point(mesh: &ControlMesh, half_edges: &QuadTopology, h: u32) -> Vec3 {
    let quad = &mesh.quads[h as usize / 4];
    let corner = |k: u32| mesh.points[quad[((h + k) & 3) as usize] as usize];
    let n = f64::from(half_edges.valence[half_edges.origin(h) as usize]);
    (corner(0) * n + (corner(1) + corner(3)) * 2.0 + corner(2)) / (n + 5.0)
}

struct Star<'a> {
    mesh: &'a ControlMesh,
    half_edges: &'a QuadTopology,
    face_points: &'a [Vec3],
    edge_points: &'a [Vec3],
}

impl Star<'_> {
    fn position(&self, v: u32) -> Vec3 {
        let sum: Vec3 = self
            .half_edges
            .ring(v)
            .map(|h| self.face_points[h as usize])
            .sum();
        sum / f64::from(self.half_edges.valence[v as usize])
    }

    /// Bicubic B-spline data.
    fn regular(&self, v: u32) -> Ring {
        let position = self.position(v);
        let edges = self.half_edges.ring(v).map(|h| {
            let edge = self.edge_points[h as usize];
            let other = self.edge_points[self.half_edges.rotate(h) as usize];
            let twist = (position - edge - other + self.face_points[h as usize]) * 9.0;
            (h, [(edge - position) * 3.0, twist, Vec3::zeros()])
        });
        Ring {
            position,
            edges: edges.collect(),
        }
    }

    /// Tangents in the limit tangent plane; twists and edge curvatures as the pull-back of one quadratic form, so that
    /// the derivative of the G1 condition holds along every edge.
    fn extraordinary(&self, v: u32, constants: &Constants) -> Ring {
        let position = self.position(v);
        let ring: Vec<u32> = self.half_edges.ring(v).collect();
        let n = ring.len();
        let step = 2.0 * PI / n as f64;
        let [x, y] = self.tangent_plane(v, &ring, constants);
        let tangents: Vec<Vec3> = (0..n)
            .map(|i| x * (step * i as f64).cos() + y * (step * i as f64).sin())
            .collect();
        // Parts proportional to the tangents.
        let twists: Vec<Vec3> = (0..n)
            .map(|i| (tangents[i] + tangents[(i + 1) % n]) * constants.twist)
            .collect();
        let bends: Vec<Vec3> = (0..n)
            .map(|i| tangents[i] * self.edge_curvature(ring[i], constants))
            .collect();
        // The quadratic form A (u.w) + B cos(a + b) + C sin(a + b) for directions of angle a and b: least squares against
        // the bicubic data. Its normal matrix is diagonal for every valence but 4.
        let mut form = [Vec3::zeros(); 3];
        let angle_sum = |i: usize, k: usize| step * (2 * i + k) as f64;
        for (i, &h) in ring.iter().enumerate() {
            let outward = self.face_points[h as usize] - position;
            let twist = outward * 9.0 - (tangents[i] + tangents[(i + 1) % n]) * 3.0 - twists[i];
            let far = self.edge_points[self.half_edges.twin[h as usize] as usize];
            let bend = (far - position) * 6.0 - tangents[i] * 4.0 - bends[i];
            form[0] += twist * constants.cosine + bend;
            form[1] += twist * angle_sum(i, 1).cos() + bend * angle_sum(i, 0).cos();
            form[2] += twist * angle_sum(i, 1).sin() + bend * angle_sum(i, 0).sin();
        }
        form[0] /= n as f64 * (1.0 + constants.cosine * constants.cosine);
        form[1] /= n as f64;
        form[2] /= n as f64;
        let edges = (0..n).map(|i| {
            let (a, b) = (angle_sum(i, 0), angle_sum(i, 1));
            let twist =
                twists[i] + form[0] * constants.cosine + form[1] * b.cos() + form[2] * b.sin();
            let bend = bends[i] + form[0] + form[1] * a.cos() + form[2] * a.sin();
            (ring[i], [tangents[i], twist, bend])
        });
        Ring {
            position,
            edges: edges.collect(),
        }
    }

    /// Two vectors that span the limit tangent plane: the tangent of edge i is `x cos(2 pi i/n) + y sin(2 pi i/n)`.
    fn tangent_plane(&self, v: u32, ring: &[u32], constants: &Constants) -> [Vec3; 2] {
        let centre = self.mesh.points[v as usize];
        let step = 2.0 * PI / ring.len() as f64;
        let mut plane = [Vec3::zeros(); 2];
        for (j, &h) in ring.iter().enumerate() {
            let quad = &self.mesh.quads[h as usize / 4];
            let corner = |k: u32| self.mesh.points[quad[((h + k) & 3) as usize] as usize] - centre;
            let (edge, diagonal) = (
                corner(1) * constants.edge_weight,
                corner(2) * constants.diagonal_weight,
            );
            let (a, b) = (step * j as f64, step * (j as f64 + 0.5));
            plane[0] += edge * a.cos() + diagonal * b.cos();
            plane[1] += edge * a.sin() + diagonal * b.sin();
        }
        plane
    }

    /// Factor of the tangent in the second derivative of edge `h`; it depends on the other end, whose G1 condition
    /// shares the scalar function of the edge.
    fn edge_curvature(&self, h: u32, constants: &Constants) -> f64 {
        let c = constants.cosine;
        let slope = match self.half_edges.valence[self.half_edges.head(h) as usize] {
            4 => -4.0 * c,
            n => -2.0 * c - 2.0 * edge_cosine(n),
        };
        (1.0 + c) * constants.twist / c - slope / (2.0 * c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_agree_with_the_published_prototype() {
        for (n, scale, twist) in [
            (3, 0.66779, 2.72774),
            (5, 1.11268, -0.52902),
            (6, 1.12840, -0.79552),
            (10, 0.96395, -1.14111),
        ] {
            let constants = Constants::new(n, 0.3);
            let valence = f64::from(n);
            let half = (PI / valence).cos();
            let plain = (1.0 + half / (4.0 + half * half).sqrt()) / valence;
            assert!(
                (constants.edge_weight / plain - scale).abs() < 6e-6,
                "scale of valence {n}"
            );
            assert!(
                (constants.twist - twist).abs() < 6e-6,
                "twist of valence {n}"
            );
        }
    }
}
