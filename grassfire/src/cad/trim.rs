//! Cuts the finished part plane where the proposal has flat faces with sharp borders.

use std::time::Instant;

use grassfire_occt::{BooleanResult, OcctError, Operation, Origin, Shape};

use super::body::single;
use super::build::{CadSolid, FaceSource, IDENTITY, VOLUME_EPS};
use super::inspect;
use super::non_design::NonDesignBody;
use super::{CadError, CadOptions, prism};
use crate::monitor::Monitor;
use crate::non_design::Flat;

/// Cuts the part plane at `flats`, none of which has a reason to stay; gives the part and for each flat why it was not cut.
///
/// 1. The tool is a prism over the flat's outline, `height` mm high, its foot on the plane.
/// 2. The part without it must have no warning, pass BRepCheck, keep its number of solids and of tunnels, and have lost
///    exactly the volume that both had in common. Otherwise this flat stays smooth, with the reason.
/// 3. At the end the part is inspected anew; when a non-design body is not kept any more, the whole part stays as it was.
///
/// # Errors
/// [`CadError::Kernel`], [`CadError::Cancelled`].
pub fn trim(
    solid: CadSolid,
    flats: &[&Flat],
    height: f64,
    bodies: &[NonDesignBody],
    options: &CadOptions,
    monitor: &Monitor,
) -> Result<(CadSolid, Vec<Option<String>>), CadError> {
    let mut reasons = vec![None; flats.len()];
    if !solid.valid {
        reasons.fill(Some("the part is not valid without it".to_owned()));
        return Ok((solid, reasons));
    }
    let mut at = Trimmed {
        shape: solid.shape.share()?,
        sources: solid.sources.clone(),
        volume: solid.volume,
        genus: solid.genus,
        solids: solid.bodies,
    };
    for (k, flat) in flats.iter().enumerate() {
        monitor.step("cad", "cutting flat faces", k as f64 / flats.len() as f64)?;
        reasons[k] = match at.without(flat, height, k as u32, options, monitor) {
            Ok(next) => {
                at = next;
                None
            }
            Err(reason) => Some(reason),
        };
        monitor.check()?;
    }
    if reasons.iter().all(Option::is_some) {
        return Ok((solid, reasons));
    }
    let trimmed = inspect::again(&solid, at.shape, at.sources, at.volume, bodies, options)?;
    if let Some(body) = trimmed.non_design.iter().find(|body| !body.kept) {
        let text = format!("{} would not be kept exactly", body.name);
        reasons.fill(Some(text));
        return Ok((solid, reasons));
    }
    Ok((trimmed, reasons))
}

/// The part so far.
struct Trimmed {
    shape: Shape,
    sources: Vec<FaceSource>,
    volume: f64,
    genus: i64,
    solids: usize,
}

impl Trimmed {
    fn without(
        &self,
        flat: &Flat,
        height: f64,
        number: u32,
        options: &CadOptions,
        monitor: &Monitor,
    ) -> Result<Self, String> {
        let text = |e: OcctError| e.0;
        let tool = prism(&flat.outline, flat.normal * height).map_err(text)?;
        let cut = |fuzzy: f64| self.cut(&tool, fuzzy, options, monitor);
        let BooleanResult {
            shape,
            common,
            origins,
            ..
        } = cut(options.fuzzy).or_else(|_| cut(options.fuzzy_retry))?;
        let shape = single(shape).map_err(text)?;
        if let Some(fault) = shape.faults().map_err(text)? {
            return Err(format!("BRepCheck: {fault}"));
        }
        let counts = shape.counts().map_err(text)?;
        let genus = inspect::genus(&counts);
        if counts.bad_edges > 0 || counts.solids as usize != self.solids || genus != self.genus {
            return Err(format!(
                "the cut gives {} bodies and {genus} tunnels instead of {} and {}, {} open edges",
                counts.solids, self.solids, self.genus, counts.bad_edges
            ));
        }
        let removed = common
            .map_or(Ok(0.0), |c| c.volume(VOLUME_EPS))
            .map_err(text)?;
        let volume = shape.volume(VOLUME_EPS).map_err(text)?;
        let wanted = self.volume - removed;
        if (volume - wanted).abs() > IDENTITY * self.volume {
            return Err(format!(
                "the cut leaves {volume:.3} mm3 instead of {wanted:.3} mm3"
            ));
        }
        let from = |origin: &Origin| match origin {
            Origin::Object(face) => self.sources.get(*face as usize).copied(),
            _ => None,
        };
        let sources = origins
            .iter()
            .map(|origin| from(origin).unwrap_or(FaceSource::Flat(number)))
            .collect();
        Ok(Self {
            shape,
            sources,
            volume,
            ..*self
        })
    }

    fn cut(
        &self,
        tool: &Shape,
        fuzzy: f64,
        options: &CadOptions,
        monitor: &Monitor,
    ) -> Result<BooleanResult, String> {
        let start = Instant::now();
        let limit = options.boolean_seconds;
        let interrupt = move || monitor.check().is_err() || start.elapsed().as_secs_f64() > limit;
        let result = self
            .shape
            .boolean(Operation::Cut, tool, fuzzy, true, &interrupt)
            .map_err(|e| e.0)?;
        match result.warnings.first() {
            Some(first) => Err(format!("the kernel warned: {first}")),
            None => Ok(result),
        }
    }
}
