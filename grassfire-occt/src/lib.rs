//! Thin, safe bridge to OpenCASCADE (OCCT): the only unsafe code and the only C++ of the project.
//!
//! Every function returns [`OcctError`] instead of letting a C++ exception pass; OCCT's own messages are silenced and
//! no signal handler is installed. OCCT keeps global state, so one lock guards all calls: a [`Shape`] may be moved
//! between threads and shared, but calls run one after the other.
//!
//! Lengths are millimetres, angles radians.
//!
//! Needs OCCT 7.6 or newer; see `build.rs` for how it is found.
#![deny(unsafe_op_in_unsafe_fn)]

mod ffi;
mod step_text;

use std::fmt;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, Once};

use cxx::UniquePtr;
use ffi::bridge;
pub use ffi::bridge::Counts;

/// What OpenCASCADE (or its C++ runtime) said when an operation failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OcctError(pub String);

impl fmt::Display for OcctError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "OpenCASCADE: {}", self.0)
    }
}

impl std::error::Error for OcctError {}

impl From<cxx::Exception> for OcctError {
    fn from(e: cxx::Exception) -> Self {
        Self(e.what().trim().to_owned())
    }
}

type Result<T> = std::result::Result<T, OcctError>;

fn lock() -> MutexGuard<'static, ()> {
    static LOCK: Mutex<()> = Mutex::new(());
    static SILENCE: Once = Once::new();
    // A panic while holding the lock leaves no Rust state behind that could be broken.
    let guard = LOCK.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    SILENCE.call_once(bridge::silence);
    guard
}

/// Version of the OpenCASCADE that is linked, such as `7.6.3`.
pub fn version() -> String {
    bridge::occt_version()
}

/// A shape: solid, compound, face ... Cloning shares the geometry.
pub struct Shape(UniquePtr<bridge::Shape>);

// SAFETY: a `bridge::Shape` is a TopoDS_Shape: a handle with an atomic reference count. The geometry behind it is only
// read or changed inside calls of this crate, all of which hold the global lock.
unsafe impl Send for Shape {}
// SAFETY: as above; `&Shape` gives no access to the geometry outside the lock.
unsafe impl Sync for Shape {}

impl fmt::Debug for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Shape(..)")
    }
}

impl Drop for Shape {
    fn drop(&mut self) {
        let _guard = lock();
        self.0 = UniquePtr::null();
    }
}

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

/// Texts of a STEP file.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
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
    /// Names of the solids, in the order of [`Shape::solids`]; may be shorter.
    pub solids: Vec<String>,
    /// Names of the faces, in the order of [`Shape::faces`]; may be shorter, empty ones are skipped.
    pub faces: Vec<String>,
}

impl Shape {
    fn make(
        run: impl FnOnce() -> std::result::Result<UniquePtr<bridge::Shape>, cxx::Exception>,
    ) -> Result<Self> {
        let _guard = lock();
        let shape = run()?;
        if shape.is_null() {
            Err(OcctError("the result is empty".into()))
        } else {
            Ok(Self(shape))
        }
    }

    /// Builds solids directly: shared vertices and edges, straight exact pcurves, no sewing. A compound of solids.
    ///
    /// The caller guarantees what cannot be seen here: every edge used twice, once in each sense, and control points of
    /// edges equal to the surfaces' border rows. Lengths of the arrays and indices are checked.
    pub fn from_brep(brep: &BrepDescription) -> Result<Self> {
        check_description(brep)?;
        let solids: Vec<u32> = brep.solids.iter().map(|s| s.len() as u32).collect();
        let shells: Vec<u32> = brep
            .solids
            .iter()
            .flatten()
            .map(|s| s.len() as u32)
            .collect();
        let shell_faces: Vec<u32> = brep.solids.iter().flatten().flatten().copied().collect();
        let data = bridge::BrepData {
            vertices: &brep.vertices,
            edges: &brep.edges,
            edge_control: &brep.edge_control,
            faces: &brep.faces,
            face_control: &brep.face_control,
            uses: &brep.uses,
            use_uv: &brep.use_uv,
            solids: &solids,
            shells: &shells,
            shell_faces: &shell_faces,
        };
        Self::make(|| bridge::build_brep(&data))
    }

    /// A solid of plane triangles with shared edges. The mesh must be closed, oriented and without degenerate triangles.
    pub fn from_triangles(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<Self> {
        if triangles
            .iter()
            .flatten()
            .any(|&v| v as usize >= points.len())
        {
            return Err(OcctError("a triangle names a missing point".into()));
        }
        check_finite(points.as_flattened())?;
        Self::make(|| bridge::build_faceted(points.as_flattened(), triangles.as_flattened()))
    }

    /// A cylinder from `start` along `axis`.
    pub fn cylinder(start: [f64; 3], axis: [f64; 3], radius: f64, height: f64) -> Result<Self> {
        check_finite(&[start, axis, [radius, height, 0.0]].concat())?;
        Self::make(|| bridge::make_cylinder(&start, &axis, radius, height))
    }

    /// A box with edges along the axes.
    pub fn cuboid(low: [f64; 3], high: [f64; 3]) -> Result<Self> {
        check_finite(&[low, high].concat())?;
        Self::make(|| bridge::make_box(&low, &high))
    }

    /// The closed polygon `profile` of (radius, height) pairs turned once around the axis.
    pub fn revolve(origin: [f64; 3], axis: [f64; 3], profile: &[[f64; 2]]) -> Result<Self> {
        if profile.len() < 3 || profile.iter().any(|p| p[0].is_nan() || p[0] < 0.0) {
            return Err(OcctError(
                "a profile needs three or more points at radii of zero or more".into(),
            ));
        }
        check_finite(profile.as_flattened())?;
        Self::make(|| bridge::make_revolve(&origin, &axis, profile.as_flattened()))
    }

    /// All `parts` in one compound.
    pub fn compound<'a>(parts: impl IntoIterator<Item = &'a Shape>) -> Result<Self> {
        let mut out = Self::make(bridge::make_compound)?;
        let _guard = lock();
        for part in parts {
            bridge::add_to_compound(out.0.pin_mut(), &part.0)?;
        }
        Ok(out)
    }

    /// Reads a STEP file; units become mm. Cut off files and dangling references are found before the kernel sees them.
    pub fn read_step(path: &Path) -> Result<Self> {
        let text = path_text(path)?;
        let bytes = std::fs::read(path).map_err(|e| OcctError(e.to_string()))?;
        step_text::check(&bytes).map_err(OcctError)?;
        Self::make(|| bridge::read_step(text))
    }

    /// Writes STEP AP242 in mm. Equal shapes and texts give equal files but for the time stamp.
    pub fn write_step(&self, path: &Path, texts: &StepTexts) -> Result<()> {
        let text = path_text(path)?;
        let names = bridge::StepNames {
            product: texts.product.clone(),
            author: texts.author.clone(),
            organization: texts.organization.clone(),
            system: texts.system.clone(),
            description: texts.description.clone(),
            time_stamp: texts.time_stamp.clone(),
            solids: texts.solids.clone(),
            faces: texts.faces.clone(),
        };
        let _guard = lock();
        Ok(bridge::write_step(&self.0, text, &names)?)
    }

    /// Another handle on the same geometry.
    pub fn share(&self) -> Result<Self> {
        Self::make(|| bridge::share(&self.0))
    }

    /// A moved copy.
    pub fn translated(&self, by: [f64; 3]) -> Result<Self> {
        check_finite(&by)?;
        Self::make(|| bridge::translated(&self.0, &by))
    }

    /// Merges neighbouring faces that lie on one surface, and edges on one curve.
    pub fn unified(&self) -> Result<Self> {
        Self::make(|| bridge::unified(&self.0))
    }

    /// A boolean operation between the solids of two shapes.
    ///
    /// `fuzzy` (mm) lets parts closer than that count as touching: 1e-5 is right for the solids of this project, 0 can
    /// silently lose volume. `with_common` gives the common part too, nearly for free. `interrupt` is asked now and
    /// then; true ends the operation with an error.
    pub fn boolean(
        &self,
        operation: Operation,
        tools: &Shape,
        fuzzy: f64,
        with_common: bool,
        interrupt: &(dyn Fn() -> bool + Sync),
    ) -> Result<BooleanResult> {
        let code = match operation {
            Operation::Fuse => 0,
            Operation::Cut => 1,
            Operation::Common => 2,
        };
        let guard = lock();
        let done = bridge::boolean(
            code,
            &self.0,
            &tools.0,
            fuzzy,
            with_common,
            &ffi::Interrupt(interrupt),
        )?;
        let shape = bridge::boolean_result(&done)?;
        let common = if with_common {
            Some(bridge::boolean_common(&done)?)
        } else {
            None
        };
        let warnings = bridge::boolean_warnings(&done);
        let origins = bridge::boolean_origins(&done);
        drop(guard);
        Ok(BooleanResult {
            shape: Shape(shape),
            common: common.map(Shape),
            warnings: warnings
                .lines()
                .map(|l| l.trim().to_owned())
                .filter(|l| !l.is_empty())
                .collect(),
            origins: origins.iter().map(|&code| origin(code)).collect(),
        })
    }

    /// What BRepCheck objects to; `None` when the shape is valid.
    pub fn faults(&self) -> Result<Option<String>> {
        let _guard = lock();
        let text = bridge::faults(&self.0)?;
        Ok((!text.is_empty()).then_some(text))
    }

    /// Numbers of distinct sub-shapes; collapsed edges (poles) are not counted.
    pub fn counts(&self) -> Result<Counts> {
        let _guard = lock();
        Ok(bridge::counts(&self.0)?)
    }

    /// All solids in it.
    pub fn solids(&self) -> Result<Vec<Shape>> {
        let n = self.counts()?.solids as usize;
        (0..n)
            .map(|i| Self::make(|| bridge::solid(&self.0, i)))
            .collect()
    }

    /// Volume to the relative accuracy `eps`, mm3.
    pub fn volume(&self, eps: f64) -> Result<f64> {
        let _guard = lock();
        Ok(bridge::volume(&self.0, eps)?)
    }

    /// Surface area to the relative accuracy `eps`, mm2.
    pub fn area(&self, eps: f64) -> Result<f64> {
        let _guard = lock();
        Ok(bridge::area(&self.0, eps)?)
    }

    /// Largest tolerance of any vertex, edge or face, mm.
    pub fn max_tolerance(&self) -> Result<f64> {
        let _guard = lock();
        Ok(bridge::max_tolerance(&self.0)?)
    }

    /// All faces.
    pub fn faces(&self) -> Result<Vec<Face>> {
        let _guard = lock();
        Ok(bridge::faces(&self.0)?.iter().map(face).collect())
    }

    /// All edges but collapsed ones.
    pub fn edges(&self) -> Result<Vec<Edge>> {
        let _guard = lock();
        Ok(bridge::edges(&self.0)?.iter().map(edge).collect())
    }

    /// Lower and upper corner of the box around it.
    pub fn bounds(&self) -> Result<[[f64; 3]; 2]> {
        let _guard = lock();
        match bridge::bounds(&self.0)?.as_slice() {
            &[a, b, c, d, e, f] => Ok([[a, b, c], [d, e, f]]),
            _ => Err(OcctError("the shape has no extent".into())),
        }
    }

    /// Where lines meet the faces: for each line the sorted parameters.
    pub fn line_hits(&self, lines: &[Line]) -> Result<Vec<Vec<f64>>> {
        let flat: Vec<f64> = lines
            .iter()
            .flat_map(|l| [l.point, l.direction].concat().into_iter().chain(l.range))
            .collect();
        check_finite(&flat)?;
        let _guard = lock();
        let mut out = vec![Vec::new(); lines.len()];
        for hit in bridge::line_hits(&self.0, &flat)? {
            out[hit.line as usize].push(hit.parameter);
        }
        out.iter_mut().for_each(|hits| hits.sort_by(f64::total_cmp));
        Ok(out)
    }

    /// Whether the point lies strictly inside one of the solids.
    pub fn contains(&self, point: [f64; 3]) -> Result<bool> {
        check_finite(&point)?;
        let _guard = lock();
        Ok(bridge::contains(&self.0, &point)?)
    }

    /// Distance of each point to the nearest face, mm.
    pub fn distances(&self, points: &[[f64; 3]]) -> Result<Vec<f64>> {
        check_finite(points.as_flattened())?;
        let _guard = lock();
        Ok(bridge::distances(&self.0, points.as_flattened())?)
    }

    /// About `per_face` points on each of the given faces, exactly on the surface and inside the trimming.
    pub fn face_samples(&self, faces: &[u32], per_face: usize) -> Result<Vec<[f64; 3]>> {
        let _guard = lock();
        let flat = bridge::face_samples(&self.0, faces, per_face)?;
        Ok(flat.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect())
    }

    /// Triangles within `chord` mm of the surfaces whose neighbours on one face differ by at most `angle`.
    ///
    /// Watertight by construction: nodes are joined along shared edges by position in the edge, not by distance.
    pub fn tessellate(&self, chord: f64, angle: f64) -> Result<Triangulation> {
        check_finite(&[chord, angle])?;
        if chord <= 0.0 || angle <= 0.0 {
            return Err(OcctError("chord and angle must be positive".into()));
        }
        let _guard = lock();
        let flat = bridge::tessellate(&self.0, chord, angle)?;
        Ok(Triangulation {
            points: flat
                .points
                .chunks_exact(3)
                .map(|p| [p[0], p[1], p[2]])
                .collect(),
            triangles: flat
                .triangles
                .chunks_exact(3)
                .map(|t| [t[0], t[1], t[2]])
                .collect(),
            faces: flat.faces,
        })
    }
}

fn origin(code: i32) -> Origin {
    match code {
        i32::MIN => Origin::Unknown,
        c if c >= 0 => Origin::Object(c as u32),
        c => Origin::Tool((-c - 1) as u32),
    }
}

fn face(info: &bridge::FaceInfo) -> Face {
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

fn edge(info: &bridge::EdgeInfo) -> Edge {
    let [a, b] = info.faces;
    Edge {
        length: info.length,
        faces: (a >= 0 && b >= 0).then_some([a as u32, b as u32]),
        angle: (!info.angle.is_nan()).then_some(info.angle),
        middle: info.middle,
    }
}

fn path_text(path: &Path) -> Result<&str> {
    path.to_str()
        .ok_or_else(|| OcctError(format!("the path {} is not valid Unicode", path.display())))
}

fn check_finite(values: &[f64]) -> Result<()> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(at) => Err(OcctError(format!("number {at} is not finite"))),
        None => Ok(()),
    }
}

/// Lengths and indices, so that the C++ side can read without looking.
fn check_description(brep: &BrepDescription) -> Result<()> {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn never() -> bool {
        false
    }

    #[test]
    fn cylinder_volume_and_faces() -> Result<()> {
        let c = Shape::cylinder([1.0, 2.0, 3.0], [0.0, 0.0, 2.0], 2.0, 5.0)?;
        let exact = std::f64::consts::PI * 20.0;
        assert!((c.volume(1e-9)? - exact).abs() < 1e-9 * exact);
        assert_eq!(c.faults()?, None);
        let faces = c.faces()?;
        assert_eq!(faces.len(), 3);
        assert!(faces.iter().any(|f| f.surface
            == Surface::Cylinder {
                radius: 2.0,
                concave: false
            }));
        Ok(())
    }

    #[test]
    fn boolean_traces_faces_and_common() -> Result<()> {
        let cube = Shape::cuboid([0.0; 3], [4.0; 3])?;
        let bore = Shape::cylinder([2.0, 2.0, -1.0], [0.0, 0.0, 1.0], 1.0, 6.0)?;
        let cut = cube.boolean(Operation::Cut, &bore, 1e-5, true, &never)?;
        let pi = std::f64::consts::PI;
        assert!((cut.shape.volume(1e-9)? - (64.0 - 4.0 * pi)).abs() < 1e-6);
        assert!(
            (cut.common
                .as_ref()
                .map(|c| c.volume(1e-9))
                .transpose()?
                .unwrap_or(0.0)
                - 4.0 * pi)
                .abs()
                < 1e-6
        );
        assert!(cut.warnings.is_empty());
        let faces = cut.shape.faces()?;
        let wall = faces
            .iter()
            .position(|f| matches!(f.surface, Surface::Cylinder { concave: true, .. }));
        assert!(matches!(
            wall.map(|w| cut.origins[w]),
            Some(Origin::Tool(_))
        ));
        assert_eq!(
            cut.origins
                .iter()
                .filter(|o| matches!(o, Origin::Object(_)))
                .count(),
            6
        );
        let hits = cut.shape.line_hits(&[Line {
            point: [2.0, 2.0, 0.0],
            direction: [0.0, 0.0, 1.0],
            range: [-9.0, 9.0],
        }])?;
        assert!(hits[0].is_empty());
        assert!(cut.shape.contains([0.5, 0.5, 0.5])? && !cut.shape.contains([2.0, 2.0, 2.0])?);
        Ok(())
    }

    #[test]
    fn interrupted_boolean_is_an_error() -> Result<()> {
        let cube = Shape::cuboid([0.0; 3], [4.0; 3])?;
        let other = cube.translated([1.0, 1.0, 1.0])?;
        assert!(
            cube.boolean(Operation::Fuse, &other, 1e-5, false, &|| true)
                .is_err()
        );
        Ok(())
    }

    #[test]
    fn triangulation_is_watertight() -> Result<()> {
        let cube = Shape::cuboid([0.0; 3], [4.0; 3])?;
        let bore = Shape::cylinder([2.0, 2.0, -1.0], [0.0, 0.0, 1.0], 1.0, 6.0)?;
        let cut = cube
            .boolean(Operation::Cut, &bore, 1e-5, false, &never)?
            .shape;
        let mesh = cut.tessellate(0.01, 0.1)?;
        let mut edges = std::collections::BTreeMap::new();
        for t in &mesh.triangles {
            for k in 0..3 {
                *edges.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
        assert!(
            edges
                .iter()
                .all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1))
        );
        assert_eq!(mesh, cut.tessellate(0.01, 0.1)?);
        Ok(())
    }

    #[test]
    fn revolve_and_facets() -> Result<()> {
        let ring = Shape::revolve(
            [0.0; 3],
            [1.0, 0.0, 0.0],
            &[[3.0, 0.0], [5.0, 0.0], [5.0, 2.0], [3.0, 2.0]],
        )?;
        let exact = std::f64::consts::PI * 32.0;
        assert!((ring.volume(1e-9)? - exact).abs() < 1e-9 * exact);
        assert_eq!((ring.faults()?, ring.counts()?.faces), (None, 4));
        let p = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        ];
        let tetra = Shape::from_triangles(&p, &[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])?;
        assert_eq!(tetra.faults()?, None);
        assert!((tetra.volume(1e-9)? - 1.0 / 6.0).abs() < 1e-12);
        Ok(())
    }

    #[test]
    fn bad_input_is_an_error() {
        assert!(Shape::cylinder([0.0; 3], [0.0; 3], 1.0, 1.0).is_err());
        assert!(Shape::cylinder([0.0; 3], [0.0, 0.0, f64::NAN], 1.0, 1.0).is_err());
        assert!(Shape::read_step(Path::new("/nowhere/missing.step")).is_err());
        let broken = BrepDescription {
            edges: vec![0, 1, 1],
            ..BrepDescription::default()
        };
        assert!(Shape::from_brep(&broken).is_err());
    }
}
