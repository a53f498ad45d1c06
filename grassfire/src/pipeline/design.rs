//! The design part: what is made into a body when non-design bodies are cut out.

use super::construct::Site;
use super::error::PipelineError;
use super::follow::same_topology;
use super::shape::Base;
use crate::fit::raised;
use crate::remesh::{CutOutOptions, DesignPart, Remeshed, cut_out};
use crate::voxel::VoxelGrid;

/// A design part.
pub(super) struct Design {
    pub(super) cut: DesignPart,
    /// Its field with the bulges of flat faces that are cut later, where there are any.
    raised: Option<VoxelGrid<f32>>,
    /// Both of the fine proposal, when there is one and the same is left of it.
    fine: Option<(Remeshed, Option<VoxelGrid<f32>>)>,
}

impl Design {
    pub(super) fn base(&self) -> Base<'_> {
        let part = &self.cut.part;
        Base {
            remeshed: part,
            target: self.raised.as_ref().unwrap_or(&part.field),
            fine: self.fine.as_ref().map(|(part, raised)| {
                let target = raised.as_ref().unwrap_or(&part.field);
                (part, target)
            }),
            united: Some(self.cut.wanted),
            lost: self.cut.lost,
        }
    }
}

impl Site<'_> {
    /// The proposal without its non-design bodies, or what speaks against it.
    pub(super) fn design(
        &mut self,
        options: &CutOutOptions,
    ) -> Result<Result<Design, String>, PipelineError> {
        let (remeshed, monitor) = (self.remeshed, self.monitor);
        let bosses = &self.bodies.bosses;
        let design = self
            .record
            .stage("cut_out", || cut_out(remeshed, bosses, options, monitor))?;
        let Some(cut) = design else {
            return Ok(Err("nothing is left of the part".to_owned()));
        };
        let (united, wanted) = (cut.united, cut.wanted);
        if united != wanted {
            return Ok(Err(format!(
                "the union would have {} pieces and {} tunnels instead of {} and {}",
                united.b0, united.b1, wanted.b0, wanted.b1
            )));
        }
        let fine = match self.fine {
            Some(fine) => self
                .record
                .stage("cut_out", || cut_out(fine, bosses, options, monitor))?,
            None => None,
        };
        let fine = fine.filter(|fine| same_topology(&fine.part, &cut.part));
        let rise = self.options.flats.raise * remeshed.field.spacing;
        let raised = |part: &Remeshed| raised(&part.field, &self.bodies.flats, rise);
        let fine = fine.map(|cut| {
            let raised = raised(&cut.part);
            (cut.part, raised)
        });
        Ok(Ok(Design {
            raised: raised(&cut.part),
            cut,
            fine,
        }))
    }

    pub(super) fn deliver_design(&mut self, design: &Design) -> Result<(), PipelineError> {
        let delivery = self.delivery;
        self.record.stage("write", || {
            delivery.stl("design_part.stl", design.cut.part.solid.mesh())
        })
    }
}
