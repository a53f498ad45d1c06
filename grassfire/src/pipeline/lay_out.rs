//! Medial axis and fitted body of steady limits, or of the usual ones.

use super::ReconstructOptions;
use super::construct::Site;
use super::design::Design;
use super::error::PipelineError;
use super::score::{SAME, Score};
use super::shape::{self, Base, Shape, Tried};
use crate::fit::FitOptions;
use crate::medial::{self, MedialAxis};
use crate::remesh::CutOutOptions;
use crate::skeleton::Layout;

/// A body of steady limits that is within this of the proposal on the whole is taken, voxels (rms, 95 % within twice that).
const STEADY_CLOSE: f64 = 0.25;

/// Medial axis, fitted body, and the design part that they are of when that is another one.
pub(super) type LaidOut = (MedialAxis, Shape, Option<Design>);

/// Whether a body of steady limits is taken without another try, or was cancelled; single places may be `slack` times as far off as
/// in bodies that are close.
fn taken(tried: &Tried, slack: f64) -> bool {
    match tried {
        Ok((score, shape)) => score.near(STEADY_CLOSE, slack) && shape.has_sheets(),
        Err(error) => error.is_cancelled(),
    }
}

impl Site<'_> {
    /// Medial axis and fitted body: of steady limits when that is close, on the design part or on one with its wedges, which comes with
    /// them then; else of the usual ones when that is good. What was given up is not tried again.
    pub(super) fn laid_out(&mut self, base: &Base) -> Result<LaidOut, PipelineError> {
        self.wedges = false;
        let Some(options) = self.steady.clone() else {
            let (axis, tried) = self.usual(base)?;
            return Ok((axis, tried?.1, None));
        };
        let (monitor, close) = (self.monitor, options.retry.close);
        let told = monitor.warnings().len();
        let (axis, first) = self.first(base, &options)?;
        if taken(&first, SAME) {
            return Ok((axis, first?.1, None));
        }
        // What went wrong is said once, in the reason.
        monitor.keep_warnings(told);
        // Wedges are cut off in steps of less than two voxels: what is torn is so for another reason.
        let close_else = |(score, _): &(Score, Shape)| score.close_on_the_whole(STEADY_CLOSE);
        if first.as_ref().is_ok_and(close_else) {
            if let Some(laid_out) = self.wedged(base, &options)? {
                return Ok(laid_out);
            }
            monitor.keep_warnings(told);
        }
        let (other, second) = self.usual(base)?;
        if second.as_ref().is_err_and(PipelineError::is_cancelled) {
            return Ok((other, second?.1, None));
        }
        self.steady_refused = shape::steady_refusal(&first, &second, close);
        if self.steady_refused.is_some() {
            self.steady = None;
            return Ok((other, second?.1, None));
        }
        monitor.keep_warnings(told);
        (self.layout, self.regular_refused) = (Layout::Auto, None);
        Ok((axis, first?.1, None))
    }

    /// Medial axis and fitted body of steady limits.
    fn first(
        &mut self,
        base: &Base,
        options: &ReconstructOptions,
    ) -> Result<(MedialAxis, Tried), PipelineError> {
        let axis = self.axis(base, options)?;
        let first = shape::first(self.record, &axis, base, options, self.monitor);
        Ok((axis, first))
    }

    /// The same on a design part that keeps the tips of its wedges, when that is close.
    fn wedged(
        &mut self,
        base: &Base,
        options: &ReconstructOptions,
    ) -> Result<Option<LaidOut>, PipelineError> {
        let wedge = self.options.retry.wedge;
        if base.united.is_none() || wedge.is_none() || options.cut_out.wedge.is_some() {
            return Ok(None);
        }
        let cut_out = CutOutOptions {
            wedge,
            ..options.cut_out.clone()
        };
        let Ok(design) = self.design(&cut_out)? else {
            return Ok(None);
        };
        // Most parts that are far off somewhere are so for other reasons: a third start would cost too much.
        let mut options = options.clone();
        options.fit.starts = options.fit.starts.min(FitOptions::default().starts);
        let (axis, first) = self.first(&design.base(), &options)?;
        // The usual limits are still left.
        if !taken(&first, 1.0) {
            return Ok(None);
        }
        let shape = first?.1;
        self.wedges = true;
        Ok(Some((axis, shape, Some(design))))
    }

    fn axis(
        &mut self,
        base: &Base,
        options: &ReconstructOptions,
    ) -> Result<MedialAxis, PipelineError> {
        let monitor = self.monitor;
        self.record.stage("medial", || {
            medial::medial_axis(&base.remeshed.field, &options.medial, monitor)
        })
    }

    /// Medial axis and fitted body of the usual limits; when it is not of the regular layout, that is not tried again.
    fn usual(&mut self, base: &Base) -> Result<(MedialAxis, Tried), PipelineError> {
        let (layout, drawn, options) = (self.layout, self.drawn, self.options);
        let axis = self.axis(base, options)?;
        let tried = shape::shape(
            self.record,
            &axis,
            base,
            drawn,
            layout,
            options,
            self.monitor,
        );
        let shape = tried.as_ref().ok().map(|(_, shape)| shape);
        let regular = shape.is_some_and(|shape| shape.layout == Layout::Regular);
        if layout == Layout::Auto && !regular {
            self.layout = Layout::Plain;
            self.regular_refused = shape.and_then(|shape| shape.regular_refused.clone());
        }
        Ok((axis, tried))
    }
}
