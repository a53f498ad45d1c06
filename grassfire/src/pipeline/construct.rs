//! From the remeshed proposal to the finished part: without its non-design bodies where that works, else as a whole.

use super::bodies::Bodies;
use super::deliver::Delivery;
use super::design::Design;
use super::error::{PipelineError, StageError};
use super::feeding::{Grown, fed};
use super::fewest::fewest;
use super::record::Record;
use super::shape::{self, Base, Shape};
use super::union::{Part, Union};
use super::{ReconstructOptions, measure};
use crate::fit::{self, FitOptions};
use crate::medial::MedialAxis;
use crate::mesh::Distance;
use crate::monitor::Monitor;
use crate::remesh::Remeshed;
use crate::skeleton::{Layout, Skeleton};
use crate::topology::Betti;
use crate::voxel::VoxelGrid;

/// Times that a part is made without the bulges of flat faces that could not be cut.
const FLAT_ROUNDS: usize = 3;

/// What every way of making the part starts from.
pub(super) struct Site<'a> {
    pub(super) record: &'a mut Record,
    pub(super) remeshed: &'a Remeshed,
    /// The same at a finer voxel, which the body follows in the end and is measured against.
    pub(super) fine: Option<&'a Remeshed>,
    pub(super) bodies: &'a mut Bodies,
    /// A skeleton drawn elsewhere.
    pub(super) drawn: Option<&'a Skeleton>,
    pub(super) delivery: &'a Delivery,
    pub(super) options: &'a ReconstructOptions,
    /// The same with quads of the default size, when the user chose another: for where that gives no good body.
    pub(super) usual_sizes: Option<&'a ReconstructOptions>,
    /// These are in use.
    pub(super) size_refused: bool,
    pub(super) monitor: &'a Monitor,
    /// A part whose body cannot grow as feeding asks is given up.
    pub(super) must_grow: bool,
    /// The proposal with the growth of the body, which the part is measured against then.
    pub(super) grown: Option<Remeshed>,
    /// Layout of the skeleton's quads; [`Layout::Auto`] until a part of the regular one was given up.
    pub(super) layout: Layout,
    /// What it was at first.
    pub(super) first_layout: Layout,
    /// Why it was, if it was.
    pub(super) regular_refused: Option<String>,
    /// The options with steady limits; none when they are not wanted, or a part of them was given up.
    pub(super) steady: Option<ReconstructOptions>,
    /// Why it was, if it was.
    pub(super) steady_refused: Option<String>,
    /// The part is made of a design part that keeps the tips of its wedges.
    pub(super) wedges: bool,
}

/// The part with the stages before it.
pub(super) struct Made {
    pub(super) axis: MedialAxis,
    pub(super) shape: Shape,
    pub(super) part: Part,
    /// From the part to the proposal and back.
    pub(super) distance: Distance,
}

/// A part, or what speaks against it.
type Judged = Result<Made, String>;

impl<'a> Site<'a> {
    /// Makes the part with sections that grow towards the feeders.
    ///
    /// 1. Where no gap closes, the body is made of the proposal and then grows on its own skeleton: so it has the least metal.
    /// 2. Where that is not possible, it is made of the proposal that grew before.
    pub(super) fn build_grown(&mut self, grown: &'a Grown) -> Result<Made, PipelineError> {
        if grown.same_topology {
            self.must_grow = true;
            match self.build() {
                Err(error) if matches!(error.source, StageError::Growth { .. }) => {
                    let text = format!(
                        "{}; the proposal grows before its skeleton is made instead",
                        error.source
                    );
                    self.monitor.warn("feed", text);
                }
                made => return made,
            }
            self.must_grow = false;
        }
        self.remeshed = &grown.solid;
        self.build()
    }

    /// What the part is measured against.
    pub(super) fn proposal(&self) -> &Remeshed {
        self.grown.as_ref().or(self.fine).unwrap_or(self.remeshed)
    }

    /// Makes the part.
    ///
    /// 1. Cuts the non-design bodies out of the proposal, makes the design part, unites it with them.
    /// 2. When that gives no sound body or no valid union with the proposal's topology, or there are no bodies, the
    ///    proposal is made as a whole; the body ends inside the walls of given bodies then. Recognised ones are left out
    ///    when no union with them is valid.
    /// 3. Either is tried with steady limits of the skeleton first, once (and once more with the tips of wedges beside the bodies, where
    ///    those may be what is missing), then with the regular layout of quads, once, and with the
    ///    plain one when those parts are refused.
    /// 4. Where quads of a size that the user chose give no sound body, those of the default size are tried before the proposal is made
    ///    as a whole, or after that if there are no bodies.
    /// 5. Where flat faces could not be cut plane, all is made once more without their bulge.
    pub(super) fn build(&mut self) -> Result<Made, PipelineError> {
        for _ in 0..FLAT_ROUNDS {
            let made = self.build_once()?;
            if !self.bodies.refuse_flats(&made.part.flats) {
                return Ok(made);
            }
            self.monitor.warn(
                "cad",
                "flat faces could not be cut plane: the part is made once more, smooth there",
            );
        }
        self.bodies.refuse_all_flats("cuts failed again and again");
        self.build_once()
    }

    fn build_once(&mut self) -> Result<Made, PipelineError> {
        let told = self.monitor.warnings().len();
        if self.cuts_bodies_out() {
            if let Some(made) = self.tried_without_bodies()? {
                return Ok(made);
            }
            if self.takes_usual_sizes(told)
                && let Some(made) = self.tried_without_bodies()?
            {
                return Ok(made);
            }
        }
        let problem = |tried: &(Made, Option<String>)| tried.1.clone();
        let made = self.by_layouts(Self::as_a_whole, problem)?.0;
        let sound = !made.shape.wrapped && made.shape.sound();
        if !sound && self.takes_usual_sizes(told) {
            return Ok(self.by_layouts(Self::as_a_whole, problem)?.0);
        }
        Ok(made)
    }

    fn cuts_bodies_out(&self) -> bool {
        self.options.non_design.cut_out && !self.bodies.bosses.surface.triangles.is_empty()
    }

    /// The part without its bodies; none, with the reason told, where there is none.
    fn tried_without_bodies(&mut self) -> Result<Option<Made>, PipelineError> {
        match self.without_bodies() {
            Err(error)
                if !error.is_cancelled() && !matches!(error.source, StageError::Growth { .. }) =>
            {
                self.give_up(&format!("{} failed: {}", error.stage, error.source));
                Ok(None)
            }
            tried => tried,
        }
    }

    fn give_up(&self, reason: &str) {
        self.monitor.warn(
            "cut_out",
            format!("the part was made with its non-design bodies in the skeleton, because without them {reason}"),
        );
    }

    fn without_bodies(&mut self) -> Result<Option<Made>, PipelineError> {
        let options = self.options;
        let design = match self.design(&options.cut_out)? {
            Ok(design) => design,
            Err(problem) => {
                self.give_up(&problem);
                return Ok(None);
            }
        };
        self.deliver_design(&design)?;
        let base = design.base();
        let problem = |judged: &Judged| judged.as_ref().err().cloned();
        match self.by_layouts(|site| site.united(&base, &design.cut.wanted), problem)? {
            Ok(made) => Ok(Some(made)),
            Err(problem) => {
                self.give_up(&problem);
                Ok(None)
            }
        }
    }

    /// What `make` gives with steady limits and the regular layout of quads, else with the regular layout, else with the plain one:
    /// the first that does not fail and has no problem.
    fn by_layouts<T>(
        &mut self,
        make: impl Fn(&mut Self) -> Result<T, PipelineError>,
        problem: impl Fn(&T) -> Option<String>,
    ) -> Result<T, PipelineError> {
        loop {
            let told = self.monitor.warnings().len();
            let made = make(self);
            let refused = match &made {
                Ok(made) => problem(made),
                Err(error) if error.is_cancelled() => None,
                Err(error) => Some(format!("{} failed: {}", error.stage, error.source)),
            };
            if refused.is_none() || self.layout != Layout::Auto {
                return made;
            }
            self.monitor.keep_warnings(told);
            if self.steady.take().is_some() {
                self.steady_refused = refused;
            } else {
                self.layout = Layout::Plain;
                self.regular_refused = refused;
            }
        }
    }

    /// The body of a design part united with the bodies.
    fn united(&mut self, base: &Base, wanted: &Betti) -> Result<Judged, PipelineError> {
        let (axis, mut shape) = self.shape(base)?;
        if !shape.sound() {
            return Ok(Err("its body cuts itself or folds over".to_owned()));
        }
        let (surface, joined) = self.joined_below(&mut shape)?;
        let union = Union {
            surface: &surface,
            intersections: 0,
            voxel: self.remeshed.field.spacing,
            options: self.options,
            monitor: self.monitor,
        };
        let bodies = &*self.bodies;
        let part = self.record.stage("cad", || union.part(joined, bodies))?;
        // Where flat faces are not plane it bulges, is made once more, and there is no use in judging it.
        let judged = !self.bodies.refuses_flats(&part.flats);
        if let Some(problem) = part.problem(wanted).filter(|_| judged) {
            return Ok(Err(problem));
        }
        let distance = self.distance(&part)?;
        if judged {
            if let Some(problem) = self.too_far(&part, &distance) {
                return Ok(Err(problem));
            }
            self.report(&axis, &shape, base.united);
        }
        Ok(Ok(Made {
            axis,
            shape,
            part,
            distance,
        }))
    }

    fn distance(&mut self, part: &Part) -> Result<Distance, PipelineError> {
        let proposal = self.grown.as_ref().or(self.fine).unwrap_or(self.remeshed);
        let (bodies, monitor) = (&*self.bodies, self.monitor);
        self.record.stage("measure", || {
            measure::distance(proposal, part, bodies, monitor)
        })
    }

    /// By how much the part misses the limits for distance and volume, when it does.
    fn too_far(&self, part: &Part, distance: &Distance) -> Option<String> {
        let (remeshed, limits) = (self.proposal(), &self.options.report.limits);
        let voxel = remeshed.field.spacing;
        let volume = measure::volume_block(remeshed, part)
            .relative_difference
            .abs();
        let misses = distance.rms > limits.distance_rms * voxel
            || distance.p95 > limits.distance_p95 * voxel
            || volume > limits.volume;
        misses.then(|| {
            format!(
                "the part is {:.2} voxels (rms) from the proposal, 95 % of it within {:.2} voxels, {:.1} % off in volume",
                distance.rms / voxel,
                distance.p95 / voxel,
                100.0 * volume
            )
        })
    }

    /// The part of the whole proposal, and what speaks against it if it is of the regular layout: else nothing better is left.
    fn as_a_whole(&mut self) -> Result<(Made, Option<String>), PipelineError> {
        let (remeshed, options, monitor) = (self.remeshed, self.options, self.monitor);
        let voxel = remeshed.field.spacing;
        let delivery = self.delivery;
        self.record
            .stage("write", || delivery.remove("design_part.stl"))?;
        let bodies = &*self.bodies;
        let (coarse, fine) = self.record.stage("fit", || {
            let target = |field: &VoxelGrid<f32>| bodies.target(field, voxel, options);
            let fine = self.fine.map(|fine| target(&fine.field));
            Ok::<_, StageError>((target(&remeshed.field), fine))
        })?;
        let base = Base {
            remeshed,
            target: &coarse,
            fine: self.fine.zip(fine.as_ref()),
            united: None,
            lost: 0.0,
        };
        let (axis, mut shape) = self.shape(&base)?;
        self.lean(&mut shape)?;
        let surface = self.surface(&shape)?;
        let intersections = shape.fitted.self_intersections.len();
        if shape.wrapped || intersections > 0 {
            self.bodies.drop_recognised(monitor);
        }
        let (surface, joined, _) = self.joined(&mut shape, surface)?;
        let union = Union {
            surface: &surface,
            intersections,
            voxel,
            options,
            monitor,
        };
        let choosy = self.layout == Layout::Auto;
        let bodies = &mut *self.bodies;
        let part = self.record.stage("cad", || {
            if choosy {
                union.part(joined, bodies)
            } else {
                union.part_or_without_recognised(joined, bodies)
            }
        })?;
        let distance = self.distance(&part)?;
        let problem = (choosy && !self.bodies.refuses_flats(&part.flats))
            .then(|| part.problem(&axis.solid))
            .and_then(|problem| problem.or_else(|| self.too_far(&part, &distance)));
        self.report(&axis, &shape, base.united);
        let made = Made {
            axis,
            shape,
            part,
            distance,
        };
        Ok((made, problem))
    }

    /// Medial axis, skeleton and fitted body, each written as it is made.
    fn shape(&mut self, base: &Base) -> Result<(MedialAxis, Shape), PipelineError> {
        let (options, monitor, delivery) = (self.options, self.monitor, self.delivery);
        let (axis, shape, wedged) = self.laid_out(base)?;
        if let Some(design) = &wedged {
            self.deliver_design(design)?;
        }
        let base = &wedged.as_ref().map_or(*base, Design::base);
        self.record.stage("write", || delivery.medial(&axis.mesh))?;
        let shape = self.settled(shape, base)?;
        let shape = self.fed(shape, base)?;
        let voxel = base.remeshed.field.spacing;
        let shape = fewest(self.record, shape, voxel, options, monitor)?;
        self.record
            .stage("write", || delivery.skeleton(&shape.skeleton.skeleton))?;
        Ok((axis, shape))
    }

    /// The shape with its body on the fine proposal, if there is one.
    fn settled(&mut self, shape: Shape, base: &Base) -> Result<Shape, PipelineError> {
        let (options, monitor) = (&self.options.fit, self.monitor);
        let Some((_, target)) = base.fine.filter(|_| shape.sound()) else {
            return Ok(shape);
        };
        self.record.stage("fit", || {
            let options = FitOptions {
                volume: options.volume.or_else(|| base.fine_volume()),
                ..*options
            };
            let fitted = fit::settled(
                &shape.fitted,
                &shape.skeleton.skeleton,
                target,
                &options,
                monitor,
            )?;
            Ok::<_, StageError>(Shape { fitted, ..shape })
        })
    }

    /// The shape with sections that grow towards the feeders, as far as its body can follow.
    fn fed(&mut self, shape: Shape, base: &Base) -> Result<Shape, PipelineError> {
        let (whole, options) = (self.remeshed, self.options);
        let first = self.must_grow || self.drawn.is_some();
        let (shape, followed) = fed(self.record, shape, base, whole, self.bodies, options, first)?;
        self.grown = match followed {
            Ok(grown) => grown,
            Err(source) if self.must_grow => {
                return Err(PipelineError {
                    stage: "feed",
                    source,
                });
            }
            Err(why) => {
                self.monitor.warn("feed", why.to_string());
                None
            }
        };
        Ok(shape)
    }

    pub(super) fn surface(&mut self, shape: &Shape) -> Result<shape::Surface, PipelineError> {
        let (options, monitor) = (self.options, self.monitor);
        let voxel = self.remeshed.field.spacing;
        let surface = self.record.stage("spline", || {
            shape::surface(&shape.fitted.mesh, voxel, options, monitor)
        })?;
        self.deliver_surface(shape, &surface)?;
        Ok(surface)
    }

    /// Writes the control mesh and its surface.
    pub(super) fn deliver_surface(
        &mut self,
        shape: &Shape,
        surface: &shape::Surface,
    ) -> Result<(), PipelineError> {
        let delivery = self.delivery;
        self.record.stage("write", || {
            delivery.body(&shape.fitted.mesh)?;
            delivery.stl("body.stl", &surface.tessellation.mesh)
        })
    }

    fn report(&mut self, axis: &MedialAxis, shape: &Shape, united: Option<Betti>) {
        let report = &mut self.record.report;
        report.topology = Some(measure::topology_block(axis, shape, united));
        let layout = match self.drawn {
            Some(_) => "drawn",
            None => shape.layout.name(),
        };
        let mut block = measure::skeleton_block(axis, shape, layout);
        block.regular_refused.clone_from(&self.regular_refused);
        block.steady = self.steady.is_some();
        block.wedges = self.wedges;
        block.size_refused = self.size_refused;
        block.voxel = self.remeshed.field.spacing;
        block.steady_refused.clone_from(&self.steady_refused);
        report.skeleton = Some(block);
        report.body = Some(measure::body_block(shape));
    }
}
