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
mod files;
mod step_text;
mod types;

use std::fmt;
use std::sync::{Mutex, MutexGuard, Once};

use cxx::UniquePtr;
use ffi::bridge;
pub use ffi::bridge::Counts;
pub use files::step_contents;
pub use types::{
    BooleanResult, BrepDescription, Edge, Face, FilletResult, Line, Operation, Origin,
    StepContents, StepTexts, Surface, Triangulation,
};
use types::{check_description, check_finite, edge, face, origin};

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

    /// Edges that run on smoothly from one of [`Shape::edges`]: they get one fillet together.
    pub fn fillet_contour(&self, edge: u32) -> Result<Vec<u32>> {
        let _guard = lock();
        Ok(bridge::fillet_contour(&self.0, edge)?)
    }

    /// Fillets: each a contour, by one of its edges, and a radius. The kernel gives up on many, and gives wrong solids for some: the
    /// result must be checked.
    ///
    /// The kernel works in a process of its own, a copy of this one (`fork`), for at most `seconds` of processor time: it takes hours for some
    /// fillets and cannot be asked to stop. No other call of this crate runs meanwhile, so that the copy finds the kernel at rest.
    /// `interrupt` is asked now and then; true ends it with an error.
    ///
    /// # Errors
    /// When the kernel finds no fillet, takes too long or breaks down.
    pub fn fillet(
        &self,
        contours: &[(u32, f64)],
        seconds: f64,
        interrupt: &(dyn Fn() -> bool + Sync),
    ) -> Result<FilletResult> {
        let (starts, radii): (Vec<u32>, Vec<f64>) = contours.iter().copied().unzip();
        check_finite(&radii)?;
        if radii.iter().any(|r| *r <= 0.0) {
            return Err(OcctError("the radius of a fillet must be positive".into()));
        }
        let guard = lock();
        let made = bridge::fillet(
            &self.0,
            &starts,
            &radii,
            seconds,
            &ffi::Interrupt(interrupt),
        )?;
        let shape = bridge::fillet_result(&made)?;
        let origins = bridge::fillet_origins(&made);
        drop(guard);
        Ok(FilletResult {
            shape: Shape(shape),
            origins: origins.iter().map(|o| u32::try_from(*o).ok()).collect(),
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

    /// What each face adds to the volume, mm3: the signed cone over it from a point in the middle of `known`, to the relative
    /// accuracy `eps`. The sum is the volume.
    ///
    /// Faces of `self` that are faces of `known` too (the same ones, as booleans leave what they do not touch) take their
    /// value from there.
    pub fn face_volumes(&self, eps: f64, known: Option<(&Shape, &[f64])>) -> Result<Vec<f64>> {
        let (shape, values) = known.unwrap_or((self, &[]));
        let _guard = lock();
        Ok(bridge::face_volumes(&self.0, eps, &shape.0, values)?)
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

    /// Tells for each point whether it lies strictly inside one of the solids.
    pub fn contains(&self, points: &[[f64; 3]]) -> Result<Vec<bool>> {
        check_finite(points.as_flattened())?;
        let _guard = lock();
        let inside = bridge::contains(&self.0, points.as_flattened())?;
        Ok(inside.into_iter().map(|flag| flag != 0).collect())
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
    ///
    /// # Errors
    /// When the mesher gives up on a face at this and three smaller chords.
    pub fn tessellate(&self, chord: f64, angle: f64) -> Result<Triangulation> {
        self.tessellate_finer([chord, angle], &[], [chord, angle])
    }

    /// As [`Shape::tessellate`] with chord and angle `coarse`, but the faces `fine` with `finer`.
    pub fn tessellate_finer(
        &self,
        coarse: [f64; 2],
        fine: &[u32],
        finer: [f64; 2],
    ) -> Result<Triangulation> {
        let all = [coarse, finer];
        check_finite(all.as_flattened())?;
        if all.as_flattened().iter().any(|x| *x <= 0.0) {
            return Err(OcctError("chord and angle must be positive".into()));
        }
        let faces = self.counts()?.faces;
        if fine.iter().any(|f| *f >= faces) {
            return Err(OcctError("there is no such face".into()));
        }
        let _guard = lock();
        let flat = bridge::tessellate(&self.0, coarse[0], coarse[1], fine, finer[0], finer[1])?;
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

#[cfg(test)]
mod tests;
