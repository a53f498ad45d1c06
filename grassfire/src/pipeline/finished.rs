//! What is written, measured and drawn of the finished part.

use super::bodies::Bodies;
use super::construct::Made;
use super::deliver::Delivery;
use super::error::{PipelineError, StageError};
use super::record::Record;
use super::{ReconstructJob, ReconstructOptions, casting, exchange, feeding, illustrate, measure};
use crate::medial::Poles;
use crate::monitor::Monitor;
use crate::remesh::Remeshed;
use crate::report::Picture;

/// The finished part, and what it is compared with.
pub(super) struct Finished<'a> {
    pub(super) job: &'a ReconstructJob,
    /// Those of the job, with every feeder on the part.
    pub(super) options: &'a ReconstructOptions,
    /// The proposal that the part was made of.
    pub(super) original: &'a Remeshed,
    /// The same with what grew towards the feeders, which the part is measured against.
    pub(super) remeshed: &'a Remeshed,
    pub(super) bodies: &'a Bodies,
    pub(super) poles: &'a Poles,
    pub(super) made: &'a Made,
    pub(super) delivery: &'a Delivery,
}

impl Finished<'_> {
    /// Writes the part's files, and the proposal where it has changed.
    pub(super) fn write(
        &self,
        record: &mut Record,
        monitor: &Monitor,
    ) -> Result<(), PipelineError> {
        let (part, original, remeshed) = (&self.made.part, self.original, self.remeshed);
        if !std::ptr::eq(remeshed, original) || !self.options.edits.is_empty() {
            record.stage("write", || {
                self.delivery.stl("edited.stl", remeshed.solid.mesh())
            })?;
        }
        part.report(&mut record.report, self.made.shape.faces_deviation);
        let added = remeshed.solid.volume() - original.solid.volume();
        let feeders = feeding::poured(record, part.volume, added);
        record.report.refused = record.stage("write", || {
            let files = exchange::Files {
                job: self.job,
                part,
                #[cfg(feature = "occt")]
                bodies: self.bodies,
                #[cfg(feature = "occt")]
                voxel: remeshed.field.spacing,
                feeders: &feeders,
                delivery: self.delivery,
            };
            files.write(monitor)
        })?;
        Ok(())
    }

    /// Puts distance and volume into the report, whether sections grow, and how the part leaves its mould.
    pub(super) fn measure(
        &self,
        record: &mut Record,
        monitor: &Monitor,
    ) -> Result<(), PipelineError> {
        let (options, remeshed, voxel) = (self.options, self.remeshed, self.remeshed.field.spacing);
        let (part, distance) = (&self.made.part, &self.made.distance);
        measure::name_far_places(distance, voxel, monitor);
        record.report.distance = Some(measure::distance_block(distance, remeshed, part));
        record.report.volume = Some(measure::volume_block(remeshed, part));
        feeding::prove(record, self.original, &part.mesh, options, monitor)?;
        let on = (self.bodies, voxel);
        casting::mould_of(record, &part.mesh, on, &options.mould, monitor)
    }

    /// Draws every stage, and the places where a foundry would object.
    pub(super) fn draw(
        &self,
        record: &mut Record,
        monitor: &Monitor,
    ) -> Result<Vec<Picture>, PipelineError> {
        let (made, options) = (self.made, &self.options.report);
        let places = casting::sheet_places(record);
        record.stage("pictures", || {
            let stages = illustrate::Stages {
                remeshed: self.remeshed,
                poles: self.poles,
                axis: &made.axis,
                shape: &made.shape,
                part: &made.part,
                non_design: self.bodies,
            };
            let mut pictures = illustrate::pictures(&stages, options, monitor)?;
            pictures.extend(casting::sheet_pictures(&places, &made.part.mesh, options)?);
            Ok::<_, StageError>(pictures)
        })
    }
}
