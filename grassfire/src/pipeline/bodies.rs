//! The non-design bodies of a run, as solids for the union and as surfaces for measuring.

#[cfg(feature = "occt")]
use super::case_bodies;
use super::error::StageError;
use super::{ReconstructJob, ReconstructOptions};
use crate::Vec3;
#[cfg(feature = "occt")]
use crate::cad::{self, NonDesignBody};
use crate::fit::{clear_of, raised};
#[cfg(feature = "occt")]
use crate::io::{self, Input};
use crate::mesh::{Bvh, TriMesh};
use crate::monitor::Monitor;
#[cfg(feature = "occt")]
use crate::non_design::Boss;
use crate::non_design::Flats;
use crate::remesh::{Bosses, Capsule, RemeshOptions};
use crate::report::FlatBlock;
use crate::voxel::VoxelGrid;
#[cfg(feature = "occt")]
use grassfire_occt::Triangulation;

/// Chord (mm) and facet angle (radians) of the surfaces that distances are measured to.
#[cfg(feature = "occt")]
const CHORD: f64 = 0.02;
#[cfg(feature = "occt")]
const FACET: f64 = 0.2;

/// All non-design bodies.
#[derive(Default)]
pub(super) struct Bodies {
    /// Exact solids.
    #[cfg(feature = "occt")]
    pub(super) solids: Vec<NonDesignBody>,
    /// Their surfaces, one mesh for all; the tag of a triangle is the number of its body.
    pub(super) surface: TriMesh,
    /// The same with their bores filled, as cutting and fitting see them.
    pub(super) bosses: Bosses,
    /// What was recognised of the solids that are sleeves, with their numbers.
    #[cfg(feature = "occt")]
    pub(super) sleeves: Vec<(usize, Boss)>,
    /// Flat faces of the proposal that become exactly plane.
    pub(super) flats: Flats,
    /// Nobody gave them: the part may be made without them.
    #[cfg_attr(
        not(feature = "occt"),
        allow(dead_code, reason = "without OpenCASCADE there is no union")
    )]
    pub(super) recognised: bool,
}

/// Tells whether a point belongs to the non-design region, where the proposal is not the reference.
pub(super) struct Region<'a> {
    nearest: Option<Bvh>,
    bores: &'a [Capsule],
    margin: f64,
}

#[cfg(feature = "occt")]
impl Bodies {
    /// Adds bodies that were recognised.
    pub(super) fn add(&mut self, solids: Vec<NonDesignBody>) -> Result<(), StageError> {
        let first = self.solids.len();
        self.solids.extend(solids);
        self.measure(first)
    }

    /// Surfaces and bores of all bodies anew.
    pub(super) fn measure_again(&mut self) -> Result<(), StageError> {
        self.surface = TriMesh::default();
        self.bosses = Bosses::default();
        self.measure(0)
    }

    /// Surfaces and bores of the bodies from number `first` on.
    fn measure(&mut self, first: usize) -> Result<(), StageError> {
        for (number, body) in self.solids.iter().enumerate().skip(first) {
            let mesh = body
                .solid
                .tessellate(CHORD, FACET)
                .map_err(cad::CadError::from)?;
            append(&mut self.surface, &mesh, number);
            let mesh = body
                .boss
                .tessellate(CHORD, FACET)
                .map_err(cad::CadError::from)?;
            append(&mut self.bosses.surface, &mesh, number);
            self.bosses.bores.extend(body.bores.iter().map(wall));
            self.bosses.free.extend(body.bores.iter().map(kept_free));
        }
        Ok(())
    }
}

impl Bodies {
    /// The region within `margin` mm of the bodies or in one of their bores.
    pub(super) fn region(&self, margin: f64) -> Region<'_> {
        let nearest = (!self.surface.triangles.is_empty()).then(|| Bvh::new(&self.surface));
        Region {
            nearest,
            bores: &self.bosses.free,
            margin,
        }
    }

    /// The options of a remesh at a voxel, or at the default one, that keeps the free lengths of bores open.
    pub(super) fn kept_open(&self, options: &RemeshOptions, voxel: Option<f64>) -> RemeshOptions {
        let mut out = RemeshOptions {
            voxel,
            ..options.clone()
        };
        out.keep_open.extend(&self.bosses.free);
        out
    }

    /// The field that a body of the whole proposal is fitted to: it ends inside the walls of given bodies, and bulges over flat faces
    /// that are cut later. `voxel` is the one that the skeleton is made at, mm.
    pub(super) fn target(
        &self,
        field: &VoxelGrid<f32>,
        voxel: f64,
        options: &ReconstructOptions,
    ) -> VoxelGrid<f32> {
        let depth = options.non_design.clearance * voxel;
        let clear = if self.recognised {
            // They are made from the proposal's own walls, too thin for a body to end inside them.
            field.clone()
        } else {
            // A repair's draft widens the proposal's copies of them.
            let films = options.mould.leans().is_some();
            clear_of(field, &self.bosses, depth, films)
        };
        let rise = options.flats.raise * voxel;
        raised(&clear, &self.flats, rise).unwrap_or(clear)
    }

    /// Leaves recognised bodies out of a wrapped part, which follows the proposal closely anyway and whose many faces take
    /// minutes to unite, and out of one that cuts itself, which is not valid with them either.
    pub(super) fn drop_recognised(&mut self, monitor: &Monitor) {
        if self.recognised {
            monitor.warn("cad", "the body is wrapped around the part or cuts itself: recognised bores and bosses are listed, not united; give them with --non-design to have them exact".to_owned());
            self.forget();
        }
    }

    /// Whether a flat face could not be cut though it bulges.
    pub(super) fn refuses_flats(&self, blocks: &[FlatBlock]) -> bool {
        let mut both = self.flats.faces.iter().zip(blocks);
        both.any(|(flat, block)| flat.reason.is_none() && block.reason.is_some())
    }

    /// Gives up flat faces that could not be cut; whether there were some.
    pub(super) fn refuse_flats(&mut self, blocks: &[FlatBlock]) -> bool {
        let refused = self.refuses_flats(blocks);
        for (flat, block) in self.flats.faces.iter_mut().zip(blocks) {
            flat.reason.clone_from(&block.reason);
        }
        let Flats { faces, surface, .. } = &mut self.flats;
        let keep = |t: &usize| faces[surface.tags[*t] as usize].reason.is_none();
        let kept: Vec<usize> = (0..surface.triangles.len()).filter(keep).collect();
        surface.triangles = kept.iter().map(|&t| surface.triangles[t]).collect();
        surface.tags = kept.iter().map(|&t| surface.tags[t]).collect();
        refused
    }

    /// Gives up all flat faces that are left.
    pub(super) fn refuse_all_flats(&mut self, reason: &str) {
        let Flats { faces, surface, .. } = &mut self.flats;
        for flat in faces.iter_mut().filter(|flat| flat.reason.is_none()) {
            flat.reason = Some(reason.to_owned());
        }
        *surface = TriMesh::default();
    }

    /// No bodies any more; the flat faces stay.
    pub(super) fn forget(&mut self) {
        *self = Self {
            flats: std::mem::take(&mut self.flats),
            ..Self::default()
        };
    }
}

/// Bodies this many times as large as the proposal are in another unit.
const OTHER_UNIT: f64 = 5.0;

impl Bodies {
    /// Refuses bodies that are far larger than the proposal: one of the two is in another unit, and nothing would fit.
    ///
    /// # Errors
    /// [`StageError::Unit`].
    pub(super) fn check_unit(&self, proposal: Option<(Vec3, Vec3)>) -> Result<(), StageError> {
        check_unit(&self.surface, proposal)
    }
}

/// Refuses a CAD surface that is far larger than the proposal.
pub(super) fn check_unit(
    surface: &TriMesh,
    proposal: Option<(Vec3, Vec3)>,
) -> Result<(), StageError> {
    let size = |(lo, hi): (Vec3, Vec3)| (hi - lo).norm();
    match (surface.bounds().map(size), proposal.map(size)) {
        (Some(bodies), Some(proposal)) if bodies > OTHER_UNIT * proposal => {
            Err(StageError::Unit { bodies, proposal })
        }
        _ => Ok(()),
    }
}

impl Region<'_> {
    pub(super) fn contains(&self, p: &Vec3) -> bool {
        let near = self
            .nearest
            .as_ref()
            .is_some_and(|bvh| bvh.nearest(p, self.margin).is_some());
        near || self.bores.iter().any(|bore| bore.contains(p))
    }
}

/// Reads the non-design bodies of a job.
#[cfg(feature = "occt")]
pub(super) fn read(job: &ReconstructJob, monitor: &Monitor) -> Result<Bodies, StageError> {
    let mut bodies = Bodies::default();
    let options = &job.options.non_design;
    for path in &job.non_design {
        let solids = match io::read_input(path, &job.options.read, monitor)? {
            Input::Step(path) => cad::read(&path, options, monitor)?,
            Input::Mesh { mesh, .. } => {
                let name = path
                    .file_stem()
                    .map_or_else(|| "body".into(), |stem| stem.to_string_lossy());
                cad::from_mesh(&name, &path.display().to_string(), &mesh, options, monitor)?
            }
            Input::Density { .. } => return Err(StageError::DensityBody { path: path.clone() }),
        };
        bodies.solids.extend(solids);
    }
    bodies.solids.extend(case_bodies::make(job, monitor)?);
    bodies.measure(0)?;
    Ok(bodies)
}

/// Without OpenCASCADE there is no union: a job with non-design bodies is refused; those of a project file stay as the
/// optimization made them.
#[cfg(not(feature = "occt"))]
pub(super) fn read(job: &ReconstructJob, _monitor: &Monitor) -> Result<Bodies, StageError> {
    match job.non_design.first() {
        Some(path) => Err(StageError::NoKernel { path: path.clone() }),
        None => Ok(Bodies::default()),
    }
}

#[cfg(feature = "occt")]
fn append(to: &mut TriMesh, mesh: &Triangulation, number: usize) {
    let points = mesh.points.iter().map(|p| Vec3::from(*p));
    to.append(points, mesh.triangles.iter().copied());
    to.tags.resize(to.triangles.len(), number as u32);
}

/// The wall of a bore.
#[cfg(feature = "occt")]
fn wall(bore: &cad::Bore) -> Capsule {
    let [a, b] = bore.extent.map(|t| bore.origin + t * bore.direction);
    let radius = bore.radius;
    Capsule { a, b, radius }
}

/// The length of a bore that stays free of organic material.
#[cfg(feature = "occt")]
fn kept_free(bore: &cad::Bore) -> Capsule {
    let at = |t: f64| bore.origin + t * bore.direction;
    let [a, b] = bore.free_extent().map(at);
    Capsule {
        a,
        b,
        radius: bore.radius,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bodies(size: f64) -> Bodies {
        let corner = |x: f64, y: f64| Vec3::new(x, y, 0.0) * size;
        Bodies {
            surface: TriMesh {
                points: vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0)],
                triangles: vec![[0, 1, 2]],
                tags: Vec::new(),
            },
            ..Bodies::default()
        }
    }

    #[test]
    fn bodies_in_another_unit_are_refused_with_the_factor() {
        let proposal = Some((Vec3::zeros(), Vec3::new(5.0, 2.5, 1.4)));
        assert!(bodies(4.0).check_unit(proposal).is_ok());
        assert!(Bodies::default().check_unit(proposal).is_ok());
        let error = bodies(103.0).check_unit(proposal).expect_err("in mm");
        let hint = super::super::PipelineError {
            stage: "read",
            source: error,
        }
        .hint();
        assert!(hint.is_some_and(|h| h.contains("read.scale=25.4")));
    }
}
