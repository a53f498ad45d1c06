//! What goes to the kernel and comes back: plain data, and the checks of what goes in.

use super::{OcctError, Result, Shape, bridge};

/// A flat boundary representation for [`Shape::from_brep`]: degree 5 everywhere, knots `0..=spans`, multiplicity 4 inside.
#[derive(Debug, Clone, Default)]
pub struct BrepDescription {
    /// Corner points, 3 numbers each.
    pub vertices: Vec<f64>,
    /// Start vertex, end vertex, spans of each edge.
    pub edges: Vec<u32>,
    /// `4 * spans + 2` control points an edge, 3 numbers each.
    pub edge_control: Vec<f64>,
    /// Spans along u, spans along v, number of edge uses of each face.
    pub faces: Vec<u32>,
    /// `(4 * u + 2) * (4 * v + 2)` control points a face, v runs fastest.
    pub face_control: Vec<f64>,
    /// Edge index and 0 / 1 (against the edge) of each use, in loop order, face after face.
    pub uses: Vec<u32>,
    /// Surface parameters at the start and the end of the edge: `u v u v` a use.
    pub use_uv: Vec<f64>,
    /// For each solid its shells (the outer one first), each a list of faces.
    pub solids: Vec<Vec<Vec<u32>>>,
}

/// A surface's type with its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Surface {
    /// Plane through `origin`.
    Plane,
    /// Cylinder with this radius about the axis.
    Cylinder {
        /// Radius, mm.
        radius: f64,
        /// The material is outside: a bore or a fillet's hollow.
        concave: bool,
    },
    /// Cone: radius at the origin and half angle.
    Cone {
        /// Radius at the origin, mm.
        radius: f64,
        /// Half angle, radians.
        half_angle: f64,
    },
    /// Sphere about `origin`.
    Sphere {
        /// Radius, mm.
        radius: f64,
    },
    /// Torus about the axis.
    Torus {
        /// Radius of the centre circle, mm.
        major: f64,
        /// Radius of the tube, mm.
        minor: f64,
    },
    /// B-spline or anything else.
    Free,
}

/// A face of a shape, in the order of [`Shape::faces`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Face {
    /// Surface type.
    pub surface: Surface,
    /// Point of the plane or of the axis, mm.
    pub origin: [f64; 3],
    /// Normal of the plane or direction of the axis.
    pub axis: [f64; 3],
    /// Range of the first surface parameter (the angle, on surfaces of revolution).
    pub u: [f64; 2],
    /// Range of the second surface parameter (along the axis, on cylinders, mm).
    pub v: [f64; 2],
    /// The surface at the middle of the parameter range, mm.
    pub middle: [f64; 3],
    /// Outward normal there.
    pub normal: [f64; 3],
    /// Area, mm2.
    pub area: f64,
}

/// An edge of a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// Length, mm.
    pub length: f64,
    /// Indices of its two faces; `None` when it has not exactly two.
    pub faces: Option<[u32; 2]>,
    /// Largest angle between the two faces' normals along the edge, radians; `None` on a seam or a free edge.
    pub angle: Option<f64>,
    /// It is an inner edge at its middle: the two faces open towards each other.
    pub concave: bool,
    /// Middle of the edge, mm.
    pub middle: [f64; 3],
}

/// Where a face of a boolean's result comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// Face of the first argument.
    Object(u32),
    /// Face of the second argument (wins where both coincide).
    Tool(u32),
    /// Not in the history.
    Unknown,
}

/// Result of [`Shape::boolean`].
#[derive(Debug)]
pub struct BooleanResult {
    /// The new shape.
    pub shape: Shape,
    /// The common part of both arguments when it was asked for.
    pub common: Option<Shape>,
    /// Warnings of OCCT, one a line; empty when there were none. Treat them as errors on solids.
    pub warnings: Vec<String>,
    /// For each face of `shape` where it comes from.
    pub origins: Vec<Origin>,
}

/// Result of [`Shape::fillet`].
#[derive(Debug)]
pub struct FilletResult {
    /// The new shape.
    pub shape: Shape,
    /// For each face of `shape` the face that it is what is left of; none for a fillet.
    pub origins: Vec<Option<u32>>,
}

/// Boolean operations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operation {
    /// Union.
    Fuse,
    /// First without second.
    Cut,
    /// Intersection.
    Common,
}

/// A line with a parameter range; the parameter is mm along the direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Point at parameter 0.
    pub point: [f64; 3],
    /// Direction (any length).
    pub direction: [f64; 3],
    /// Lower and upper bound.
    pub range: [f64; 2],
}

/// A watertight triangulation: nodes along shared edges are shared.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Triangulation {
    /// Points, mm.
    pub points: Vec<[f64; 3]>,
    /// Triangles, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Face of each triangle.
    pub faces: Vec<u32>,
}

/// Texts and colours of a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StepTexts {
    /// Product name, also the file name field of the header.
    pub product: String,
    /// Author field of the header.
    pub author: String,
    /// Organization field of the header.
    pub organization: String,
    /// Originating system field of the header.
    pub system: String,
    /// Description field of the header.
    pub description: String,
    /// Time stamp (ISO 8601); empty: now.
    pub time_stamp: String,
    /// Accuracy that the file claims, mm; 0: the shape's largest tolerance.
    pub uncertainty: f64,
    /// Names of the solids, in the order of [`Shape::solids`]; may be shorter. Several solids become an assembly of parts
    /// with these names.
    pub solids: Vec<String>,
    /// Names of the faces, in the order of [`Shape::faces`]; may be shorter, empty ones are skipped.
    pub faces: Vec<String>,
    /// Colours of the faces (red, green, blue); none at all unless there is one for every face.
    pub colors: Vec<[u8; 3]>,
}

/// Names and colours in a STEP file.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct StepContents {
    /// Names of the products: the assembly, if there is one, and the parts.
    pub products: Vec<String>,
    /// Names of the solids.
    pub solids: Vec<String>,
    /// Names of the faces, solid by solid; empty where a face has none.
    pub faces: Vec<String>,
    /// Colour of each face, its own or that of its solid.
    pub colors: Vec<Option<[u8; 3]>>,
}

impl StepTexts {
    /// As the C++ side takes them, every text after `encode`.
    pub(crate) fn bridge(&self, tolerance: f64, encode: fn(&str) -> String) -> bridge::StepNames {
        let all = |texts: &[String]| texts.iter().map(|t| encode(t)).collect();
        bridge::StepNames {
            product: encode(&self.product),
            author: encode(&self.author),
            organization: encode(&self.organization),
            system: encode(&self.system),
            description: encode(&self.description),
            time_stamp: encode(&self.time_stamp),
            uncertainty: if self.uncertainty > 0.0 {
                self.uncertainty
            } else {
                tolerance
            },
            solids: all(&self.solids),
            faces: all(&self.faces),
            colors: self
                .colors
                .iter()
                .map(|&[r, g, b]| u32::from_be_bytes([0, r, g, b]))
                .collect(),
        }
    }
}

pub(crate) fn contents(found: bridge::StepContents) -> StepContents {
    let rgb = |code: &i64| {
        let [_, r, g, b] = u32::try_from(*code).ok()?.to_be_bytes();
        Some([r, g, b])
    };
    StepContents {
        products: found.products,
        solids: found.solids,
        faces: found.faces,
        colors: found.colors.iter().map(rgb).collect(),
    }
}

pub(crate) fn origin(code: i32) -> Origin {
    match code {
        i32::MIN => Origin::Unknown,
        c if c >= 0 => Origin::Object(c as u32),
        c => Origin::Tool((-c - 1) as u32),
    }
}

pub(crate) fn face(info: &bridge::FaceInfo) -> Face {
    let surface = match info.kind {
        0 => Surface::Plane,
        1 => Surface::Cylinder {
            radius: info.radius,
            concave: info.concave,
        },
        2 => Surface::Cone {
            radius: info.radius,
            half_angle: info.minor,
        },
        3 => Surface::Sphere {
            radius: info.radius,
        },
        4 => Surface::Torus {
            major: info.radius,
            minor: info.minor,
        },
        _ => Surface::Free,
    };
    Face {
        surface,
        origin: info.origin,
        axis: info.axis,
        u: [info.u0, info.u1],
        v: [info.v0, info.v1],
        middle: info.middle,
        normal: info.normal,
        area: info.area,
    }
}

pub(crate) fn edge(info: &bridge::EdgeInfo) -> Edge {
    let [a, b] = info.faces;
    Edge {
        length: info.length,
        faces: (a >= 0 && b >= 0).then_some([a as u32, b as u32]),
        angle: (!info.angle.is_nan()).then_some(info.angle),
        concave: info.concave,
        middle: info.middle,
    }
}

pub(crate) fn check_finite(values: &[f64]) -> Result<()> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(at) => Err(OcctError(format!("number {at} is not finite"))),
        None => Ok(()),
    }
}

/// Lengths and indices, so that the C++ side can read without looking.
pub(crate) fn check_description(brep: &BrepDescription) -> Result<()> {
    let fail = |what: &str| Err(OcctError(format!("B-rep description: {what}")));
    let vertices = brep.vertices.len() / 3;
    let edges = brep.edges.chunks_exact(3);
    let faces = brep.faces.chunks_exact(3);
    if !brep.vertices.len().is_multiple_of(3)
        || !edges.remainder().is_empty()
        || !faces.remainder().is_empty()
    {
        return fail("an array has a broken length");
    }
    if edges
        .clone()
        .any(|e| e[0] as usize >= vertices || e[1] as usize >= vertices || e[2] == 0)
    {
        return fail("an edge names a missing vertex or has no span");
    }
    if faces.clone().any(|f| f[0] == 0 || f[1] == 0) {
        return fail("a face has no span");
    }
    let edge_control: usize = edges.clone().map(|e| 4 * e[2] as usize + 2).sum();
    let face_control: usize = faces
        .clone()
        .map(|f| (4 * f[0] as usize + 2) * (4 * f[1] as usize + 2))
        .sum();
    let uses: usize = faces.clone().map(|f| f[2] as usize).sum();
    if brep.edge_control.len() != 3 * edge_control || brep.face_control.len() != 3 * face_control {
        return fail("the number of control points does not fit the spans");
    }
    if brep.uses.len() != 2 * uses || brep.use_uv.len() != 4 * uses {
        return fail("the number of edge uses does not fit the faces");
    }
    if brep
        .uses
        .chunks_exact(2)
        .any(|u| u[0] as usize >= edges.len())
    {
        return fail("a use names a missing edge");
    }
    if brep
        .solids
        .iter()
        .flatten()
        .flatten()
        .any(|&f| f as usize >= faces.len())
    {
        return fail("a shell names a missing face");
    }
    [
        &brep.vertices,
        &brep.edge_control,
        &brep.face_control,
        &brep.use_uv,
    ]
    .into_iter()
    .try_for_each(|v| check_finite(v))
}
