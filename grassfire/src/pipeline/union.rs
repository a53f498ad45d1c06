//! The finished part: the CAD solid united with the non-design bodies or, without OpenCASCADE, the limit surface.

use super::ReconstructOptions;
use super::bodies::Bodies;
use super::error::StageError;
#[cfg(feature = "occt")]
use super::exchange::Format;
use super::recognise;
use super::shape::Surface;
#[cfg(feature = "occt")]
use crate::Vec3;
#[cfg(feature = "occt")]
use crate::cad::{self, CadSolid, Fillet, FilletRadius, FilletRule, NonDesignResult};
#[cfg(feature = "occt")]
use crate::casting::mould::with_walls;
use crate::mesh::TriMesh;
use crate::monitor::Monitor;
#[cfg(feature = "occt")]
use crate::non_design::Flat;
#[cfg(feature = "occt")]
use crate::report::BoreBlock;
use crate::report::{FilletBlock, FlatBlock, NonDesignBlock, Report, SolidBlock};
#[cfg(not(feature = "occt"))]
use crate::spline::Crowded;
use crate::topology::Betti;

/// The finished part.
pub(super) struct Part {
    #[cfg(feature = "occt")]
    pub(super) solid: CadSolid,
    /// Its triangles; tag 0 for the fitted body, 1 + index for non-design bodies.
    pub(super) mesh: TriMesh,
    /// Volume, mm3.
    pub(super) volume: f64,
    /// Distance of its non-design faces to the input CAD, mm; none without non-design bodies.
    pub(super) non_design_max: Option<f64>,
    /// Report block; none without a CAD solid.
    pub(super) block: Option<SolidBlock>,
    /// Report entries of the non-design bodies.
    pub(super) non_design: Vec<NonDesignBlock>,
    /// Report entries of the flat faces.
    pub(super) flats: Vec<FlatBlock>,
    /// Report entries of the fillets.
    pub(super) fillets: Vec<FilletBlock>,
}

/// Chord of the part's triangles, voxels: well below what any figure of the report resolves.
#[cfg(feature = "occt")]
pub(super) const CHORD: f64 = 0.05;

impl Part {
    /// Puts the entries of solid and bodies into the report. `faces_deviation` is how far the surface moved for the sake of fewer
    /// faces, mm.
    pub(super) fn report(&self, report: &mut Report, faces_deviation: Option<f64>) {
        if self.non_design.is_empty() {
            recognise::left_out(&mut report.candidates);
        }
        report.solid = self.block.clone();
        if let Some(solid) = &mut report.solid {
            solid.faces_deviation = faces_deviation;
        }
        report.non_design.clone_from(&self.non_design);
        report.flats.clone_from(&self.flats);
        report.fillets.clone_from(&self.fillets);
    }

    /// What speaks against this part of topology `wanted`, when anything does.
    pub(super) fn problem(&self, wanted: &Betti) -> Option<String> {
        let block = self.block.as_ref()?;
        if !block.valid {
            Some("no union with the non-design bodies is valid".to_owned())
        } else if (block.bodies as i64, block.genus) != (wanted.b0, wanted.b1) {
            Some(format!(
                "the union has {} bodies and {} tunnels instead of {} and {}",
                block.bodies, block.genus, wanted.b0, wanted.b1
            ))
        } else {
            None
        }
    }
}

/// The body united with the non-design bodies, before any check.
#[cfg(feature = "occt")]
pub(super) type Joined = cad::Joined;
/// Without OpenCASCADE nothing is united.
#[cfg(not(feature = "occt"))]
pub(super) struct Joined;

/// Puts the non-design bodies to the body.
#[cfg(feature = "occt")]
pub(super) fn join(
    surface: &Surface,
    bodies: &Bodies,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Joined, StageError> {
    Ok(cad::join(
        &surface.brep,
        &bodies.solids,
        &options.cad,
        monitor,
    )?)
}

/// Without OpenCASCADE nothing is united.
#[cfg(not(feature = "occt"))]
pub(super) fn join(
    _surface: &Surface,
    _bodies: &Bodies,
    _options: &ReconstructOptions,
    _monitor: &Monitor,
) -> Result<Joined, StageError> {
    Ok(Joined)
}

#[cfg(not(feature = "occt"))]
impl Joined {
    /// There is no union.
    pub(super) fn short_edges(&self, _least: f64) -> Result<Option<Vec<Crowded>>, StageError> {
        Ok(None)
    }
}

/// What a part is made of and with, but for its non-design bodies.
#[cfg_attr(
    not(feature = "occt"),
    allow(dead_code, reason = "a limit surface needs neither kernel nor checks")
)]
pub(super) struct Union<'a> {
    /// Of the fitted body.
    pub(super) surface: &'a Surface,
    /// How often the fitted body cuts itself: such a solid is never called valid, whatever the kernel says.
    pub(super) intersections: usize,
    pub(super) voxel: f64,
    pub(super) options: &'a ReconstructOptions,
    pub(super) monitor: &'a Monitor,
}

impl Union<'_> {
    /// Makes the part, and warns of what the union met with.
    pub(super) fn part(&self, joined: Joined, bodies: &Bodies) -> Result<Part, StageError> {
        let part = self.united(joined, bodies)?;
        self.tell(&part);
        Ok(part)
    }

    /// As [`Union::part`], but recognised bodies are taken away when no union with them is valid.
    #[cfg(feature = "occt")]
    pub(super) fn part_or_without_recognised(
        &self,
        joined: Joined,
        bodies: &mut Bodies,
    ) -> Result<Part, StageError> {
        let part = self.united(joined, bodies)?;
        if part.solid.valid || !bodies.recognised {
            self.tell(&part);
            return Ok(part);
        }
        self.monitor.warn(
            "cad",
            format!(
                "the {} recognised bodies could not be united and are left out: {}",
                bodies.solids.len(),
                part.solid.messages.join("; ")
            ),
        );
        bodies.forget();
        let joined = join(self.surface, bodies, self.options, self.monitor)?;
        self.part(joined, bodies)
    }

    /// Without OpenCASCADE there are no bodies to take away.
    #[cfg(not(feature = "occt"))]
    pub(super) fn part_or_without_recognised(
        &self,
        joined: Joined,
        bodies: &mut Bodies,
    ) -> Result<Part, StageError> {
        self.part(joined, bodies)
    }

    /// Warns of what the union met with.
    #[cfg(feature = "occt")]
    fn tell(&self, part: &Part) {
        for message in &part.solid.messages {
            self.monitor.warn("cad", message.clone());
        }
    }

    /// Without OpenCASCADE nothing is united.
    #[cfg(not(feature = "occt"))]
    fn tell(&self, _part: &Part) {}

    /// Makes the CAD solid from body and non-design bodies and checks it.
    #[cfg(feature = "occt")]
    fn united(&self, joined: Joined, bodies: &Bodies) -> Result<Part, StageError> {
        let Self {
            surface,
            intersections,
            voxel,
            options,
            monitor,
        } = *self;
        let mut solid = cad::finish(joined, &surface.brep, &bodies.solids, &options.cad, monitor)?;
        if intersections > 0 {
            solid.valid = false;
            monitor.warn(
                "cad",
                format!(
                    "the body cuts itself at {intersections} places, so the solid is not called valid"
                ),
            );
        }
        let (solid, flats) = self.trimmed(solid, bodies)?;
        let (solid, fillets) = self.rounded(solid, bodies)?;
        let block = SolidBlock {
            valid: solid.valid,
            bodies: solid.bodies,
            faces: solid.faces,
            volume: solid.volume,
            area: solid.area,
            genus: solid.genus,
            g1_max: surface.g1.max_angle_deg.max(solid.g1_max),
            curvature_jump: (&surface.curvature).into(),
            shortest_edge: solid.shortest_edge,
            max_tolerance: solid.max_tolerance,
            volume_check: solid.volume_check,
            faces_deviation: None,
        };
        let triangles = cad::tessellate(&solid, CHORD * voxel)?;
        let non_design_max = solid
            .non_design
            .iter()
            .map(|body| body.max_distance)
            .reduce(f64::max);
        let pieces = options.files.formats.contains(&Format::Pieces);
        let piece = |b: usize| pieces.then(|| format!("pieces/{}", cad::piece_name(b)));
        let numbered = solid.non_design.iter().enumerate();
        let non_design = numbered.map(|(b, body)| entry(body, piece(b))).collect();
        Ok(Part {
            mesh: triangles,
            volume: solid.volume,
            non_design_max,
            block: Some(block),
            non_design,
            flats,
            fillets,
            solid,
        })
    }

    /// Without OpenCASCADE the part is the limit surface of the body.
    #[cfg(not(feature = "occt"))]
    fn united(&self, _joined: Joined, _bodies: &Bodies) -> Result<Part, StageError> {
        let (surface, monitor) = (self.surface, self.monitor);
        let (kink, jump) = (surface.g1.max_angle_deg, surface.curvature.max);
        monitor.warn(
            "cad",
            format!("this build has no OpenCASCADE: body.obj, body.stl and part.stl are written (largest kink {kink:.1e} degrees, largest jump of curvature {jump:.2} 1/mm), no STEP"),
        );
        let mesh = TriMesh {
            tags: Vec::new(),
            ..surface.tessellation.mesh.clone()
        };
        Ok(Part {
            mesh,
            volume: surface.brep.volume,
            non_design_max: None,
            block: None,
            non_design: Vec::new(),
            flats: Vec::new(),
            fillets: Vec::new(),
        })
    }

    /// Gives inner edges between the fitted body and non-design bodies the fillets that are asked for, and tells of each.
    #[cfg(feature = "occt")]
    fn rounded(
        &self,
        solid: CadSolid,
        bodies: &Bodies,
    ) -> Result<(CadSolid, Vec<FilletBlock>), StageError> {
        let Self {
            voxel,
            options,
            monitor,
            ..
        } = *self;
        let round = |radius_at: &dyn Fn(&Vec3) -> f64, solid| {
            cad::round_edges(solid, radius_at, &bodies.solids, &options.cad, monitor)
        };
        let (solid, fillets) = match options.cad.fillet {
            FilletRadius::Word(FilletRule::Off) => return Ok((solid, Vec::new())),
            FilletRadius::Radius(radius) => round(&|_| radius, solid)?,
            FilletRadius::Word(FilletRule::Rule) => {
                let mesh = cad::tessellate(&solid, CHORD * voxel)?;
                let share = options.mould.rules.rounding().value;
                with_walls(&mesh, options.mould.wall_samples, |balls, _, walls| {
                    let sum = |p: &Vec3| walls.meeting(balls, p).unwrap_or(4.0 * voxel);
                    round(&|p| share * sum(p), solid)
                })?
            }
        };
        let block = |fillet: Fillet| FilletBlock {
            place: fillet.place.into(),
            length: fillet.length,
            wanted: fillet.wanted,
            radius: fillet.radius,
            reason: fillet.reason,
        };
        Ok((solid, fillets.into_iter().map(block).collect()))
    }

    /// Cuts the part plane at the flat faces that can be, and tells of each.
    #[cfg(feature = "occt")]
    fn trimmed(
        &self,
        solid: CadSolid,
        bodies: &Bodies,
    ) -> Result<(CadSolid, Vec<FlatBlock>), StageError> {
        let Self {
            voxel,
            options,
            monitor,
            ..
        } = *self;
        let flats = &bodies.flats.faces;
        let (free, height): (Vec<&Flat>, f64) = (
            flats.iter().filter(|f| f.reason.is_none()).collect(),
            options.flats.height * voxel,
        );
        let (solid, reasons) = if free.is_empty() {
            (solid, Vec::new())
        } else {
            cad::trim(solid, &free, height, &bodies.solids, &options.cad, monitor)?
        };
        let mut reasons = reasons.into_iter();
        let blocks = flats.iter().map(|flat| {
            let reason = match &flat.reason {
                None => reasons.next().flatten(),
                known => known.clone(),
            };
            FlatBlock {
                place: (flat.middle - flat.normal * flat.height(&flat.middle)).into(),
                normal: flat.normal.into(),
                area: flat.area,
                plane: reason.is_none(),
                reason,
            }
        });
        let blocks = blocks.collect();
        Ok((solid, blocks))
    }
}

#[cfg(feature = "occt")]
fn entry(body: &NonDesignResult, piece: Option<String>) -> NonDesignBlock {
    NonDesignBlock {
        name: body.name.clone(),
        source: body.source.clone(),
        faces: body.faces,
        coverage: body.coverage,
        kept: body.kept,
        bore_radii: body.bore_radii.clone(),
        bores: body.bores.iter().map(bore).collect(),
        piece,
    }
}

#[cfg(feature = "occt")]
fn bore(bore: &cad::Bore) -> BoreBlock {
    BoreBlock {
        origin: bore.origin.into(),
        axis: bore.direction.into(),
        radius: bore.radius,
        extent: bore.extent,
        cut: bore.free_extent(),
    }
}

#[cfg(all(test, feature = "occt"))]
#[path = "union_tests.rs"]
mod tests;
