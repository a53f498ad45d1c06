//! Bores of a non-design body: full concave cylinders, how far they are open, and the tools that cut them again.

use grassfire_occt::{Face, Line, OcctError, Shape, Surface};
use serde::Serialize;

use super::array;
use super::primitives::across;
use crate::Vec3;

/// A cylindrical hole.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bore {
    /// Point of the axis, mm.
    pub origin: Vec3,
    /// Unit direction of the axis; its largest component is positive.
    pub direction: Vec3,
    /// Radius, mm.
    pub radius: f64,
    /// Where the wall begins and ends, mm along `direction` from `origin`.
    pub extent: [f64; 2],
    /// The ends that are open: at a closed one the hole has a bottom or gets narrower.
    pub open: [bool; 2],
    /// How far the hole is kept free beyond either end, mm. 0 at closed ends.
    pub extension: [f64; 2],
}

/// Largest difference of radius and place between a bore and a face on its wall, mm.
pub(super) const ON_WALL: f64 = 1e-6;
/// Gap that counts as "just beyond the end", as a share of the radius.
const PROBE: f64 = 1e-3;
/// Share of the radius at which lines run along the wall.
const NEAR_WALL: f64 = 0.95;

impl Bore {
    /// Open at both ends.
    pub fn through(&self) -> bool {
        self.open == [true, true]
    }

    /// Where the hole begins and ends with what is kept free beyond its open ends, mm along `direction` from `origin`.
    pub fn free_extent(&self) -> [f64; 2] {
        let [from, to] = self.extent;
        [from - self.extension[0], to + self.extension[1]]
    }

    /// Whether a face is its wall or a part of it.
    pub(crate) fn is_wall(&self, face: &Face) -> bool {
        let Surface::Cylinder {
            concave: true,
            radius,
        } = face.surface
        else {
            return false;
        };
        (self.radius - radius).abs() < ON_WALL && self.distance(face.middle.into()) < ON_WALL
    }

    /// Distance of a point to the endless cylinder, mm.
    pub fn distance(&self, p: Vec3) -> f64 {
        let from = p - self.origin;
        ((from - self.direction * from.dot(&self.direction)).norm() - self.radius).abs()
    }

    /// The hole itself, from end to end of its wall.
    pub(crate) fn plug(&self) -> Result<Shape, OcctError> {
        self.cylinder(self.extent)
    }

    /// The hole and what is kept free beyond its open ends.
    pub(crate) fn tool(&self) -> Result<Shape, OcctError> {
        self.cylinder(self.free_extent())
    }

    fn cylinder(&self, [from, to]: [f64; 2]) -> Result<Shape, OcctError> {
        Shape::cylinder(
            array(self.at(from)),
            array(self.direction),
            self.radius,
            to - from,
        )
    }

    fn at(&self, t: f64) -> Vec3 {
        self.origin + self.direction * t
    }

    /// The axis and eight lines parallel to it near the wall, over `range` along the axis.
    pub(crate) fn lines(&self, range: [f64; 2]) -> Vec<Line> {
        let [e1, e2] = across(&self.direction);
        let ring = (0..8).map(|k| {
            // Off the quarter points: a line in a seam or in a patch border is a bad witness.
            let angle = 0.3 + std::f64::consts::TAU * f64::from(k) / 8.0;
            (e1 * angle.cos() + e2 * angle.sin()) * (NEAR_WALL * self.radius)
        });
        std::iter::once(Vec3::zeros())
            .chain(ring)
            .map(|offset| Line {
                point: array(self.origin + offset),
                direction: array(self.direction),
                range,
            })
            .collect()
    }

    /// What is to be free of material: the wall's length and the extensions, a hair inside closed ends.
    pub(crate) fn free_range(&self) -> [f64; 2] {
        let hair = PROBE * self.radius;
        let [from, to] = self.free_extent();
        [from + hair, to - hair]
    }
}

/// Finds the bores of a solid: concave cylinder faces with a common axis and radius that close to a full turn.
///
/// 1. Group the faces by axis and radius, and by touching ranges along the axis.
/// 2. A group is a bore when its angles add up to a full turn.
/// 3. An end is open when the axis and the lines along the wall leave it into free space.
pub(crate) fn find(shape: &Shape) -> Result<Vec<Bore>, OcctError> {
    let mut bores: Vec<(Bore, f64)> = Vec::new();
    for face in shape.faces()? {
        let Surface::Cylinder {
            radius,
            concave: true,
        } = face.surface
        else {
            continue;
        };
        let piece = piece(&face, radius);
        match bores.iter_mut().find(|(bore, _)| same_hole(bore, &piece)) {
            Some((bore, angle)) => {
                let t = (piece.origin - bore.origin).dot(&bore.direction);
                bore.extent[0] = bore.extent[0].min(piece.extent[0] + t);
                bore.extent[1] = bore.extent[1].max(piece.extent[1] + t);
                *angle += face.u[1] - face.u[0];
            }
            None => bores.push((piece, face.u[1] - face.u[0])),
        }
    }
    let full = |angle: f64| angle > std::f64::consts::TAU - 1e-2;
    let mut out: Vec<Bore> = bores
        .into_iter()
        .filter(|(_, angle)| full(*angle))
        .map(|(bore, _)| bore)
        .collect();
    for bore in &mut out {
        bore.open = open_ends(bore, shape)?;
    }
    Ok(out)
}

fn piece(face: &Face, radius: f64) -> Bore {
    let axis = Vec3::from(face.axis);
    let flip = axis[axis.iamax()] < 0.0;
    let extent = if flip {
        [-face.v[1], -face.v[0]]
    } else {
        face.v
    };
    Bore {
        origin: face.origin.into(),
        direction: if flip { -axis } else { axis },
        radius,
        extent,
        open: [false; 2],
        extension: [0.0; 2],
    }
}

fn same_hole(a: &Bore, b: &Bore) -> bool {
    let tolerance = 1e-5 * a.radius.max(1.0);
    let offset = b.origin - a.origin;
    let t = offset.dot(&a.direction);
    (a.radius - b.radius).abs() < tolerance
        && a.direction.cross(&b.direction).norm() < 1e-5
        && (offset - a.direction * t).norm() < tolerance
        && b.extent[0] + t < a.extent[1] + tolerance
        && b.extent[1] + t > a.extent[0] - tolerance
}

fn open_ends(bore: &Bore, shape: &Shape) -> Result<[bool; 2], OcctError> {
    let beyond = PROBE * bore.radius;
    let ends = [bore.extent[0] - beyond, bore.extent[1] + beyond];
    let mut points = Vec::new();
    for t in ends {
        let lines = bore.lines([0.0, 1.0]);
        points.extend(
            lines
                .iter()
                .map(|line| array(Vec3::from(line.point) + bore.direction * t)),
        );
    }
    let inside = shape.contains(&points)?;
    let (first, second) = inside.split_at(points.len() / 2);
    Ok([first, second].map(|end| !end.contains(&true)))
}

/// Sets the extensions of open ends to `factor` radii, less where a line along the hole meets one of `obstacles` before.
pub(crate) fn extend(bore: &mut Bore, factor: f64, obstacles: &[&Shape]) -> Result<(), OcctError> {
    let beyond = PROBE * bore.radius;
    let wanted = factor * bore.radius;
    for end in 0..2 {
        bore.extension[end] = 0.0;
        if !bore.open[end] || wanted <= beyond {
            continue;
        }
        let (t, sign) = (bore.extent[end], if end == 0 { -1.0 } else { 1.0 });
        let range = if end == 0 {
            [t - wanted, t - beyond]
        } else {
            [t + beyond, t + wanted]
        };
        let mut free = wanted;
        for obstacle in obstacles {
            let hits = obstacle.line_hits(&bore.lines(range))?;
            let nearest = hits
                .iter()
                .flatten()
                .map(|hit| (hit - t) * sign)
                .fold(f64::MAX, f64::min);
            free = free.min(0.9 * nearest);
        }
        bore.extension[end] = free;
    }
    Ok(())
}
