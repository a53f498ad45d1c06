//! The non-design bodies of a project file as exact solids.

use std::path::Path;

use grassfire_occt::{OcctError, Operation, Shape};

use super::error::StageError;
use super::{ReconstructJob, ReconstructOptions};
use crate::Vec3;
use crate::cad::{self, CadError, NonDesignBody};
use crate::case::{self, Body};
use crate::io::{self, Input, ReadOptions};
use crate::monitor::Monitor;

const STAGE: &str = "non_design";
/// Solids nearer than this count as touching, mm.
const FUZZY: f64 = 1e-6;

/// Makes the bodies of a job's project file: the union of their shapes without their cuts, one body a connected piece.
///
/// Boxes, cylinders, STEP and mesh files are exact. A body with other shapes is left out with a warning: then it is in the
/// part as the optimization made it.
///
/// # Errors
/// [`StageError::Cad`] and those of files.
pub(super) fn make(
    job: &ReconstructJob,
    monitor: &Monitor,
) -> Result<Vec<NonDesignBody>, StageError> {
    let mut out = Vec::new();
    for body in &job.bodies {
        monitor.check()?;
        let Some(solid) = solid(body, &job.folder, &job.options, monitor)? else {
            let text = format!(
                "{:?} is made of other shapes than boxes, cylinders and files in mm: it stays as the optimization made it",
                body.name
            );
            monitor.warn(STAGE, text);
            continue;
        };
        let pieces = solid.solids().map_err(CadError::from)?;
        let many = pieces.len() > 1;
        for (i, piece) in pieces.into_iter().enumerate() {
            let name = if many {
                format!("{} {}", body.name, i + 1)
            } else {
                body.name.clone()
            };
            let options = &job.options.non_design;
            out.push(cad::from_shape(
                name,
                "project file",
                piece,
                options,
                monitor,
            )?);
        }
    }
    Ok(out)
}

/// Shapes united without cuts; none when a shape cannot be made.
fn solid(
    body: &Body,
    folder: &Path,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Option<Shape>, StageError> {
    let mut whole: Option<Shape> = None;
    for shape in &body.shapes {
        let Some(pieces) = simple(shape, folder, None, options, monitor)? else {
            return Ok(None);
        };
        for piece in pieces {
            whole = Some(match whole {
                Some(whole) => boolean(&whole, Operation::Fuse, &piece)?,
                None => piece,
            });
        }
    }
    let Some(mut whole) = whole else {
        return Ok(None);
    };
    let box_ = whole.bounds().map_err(CadError::from)?;
    for shape in &body.cut {
        let Some(pieces) = simple(shape, folder, Some(box_), options, monitor)? else {
            return Ok(None);
        };
        for piece in pieces {
            whole = boolean(&whole, Operation::Cut, &piece)?;
        }
    }
    Ok(Some(whole))
}

fn boolean(a: &Shape, operation: Operation, b: &Shape) -> Result<Shape, StageError> {
    let done = a.boolean(operation, b, FUZZY, false, &|| false);
    Ok(done.map_err(CadError::from)?.shape)
}

/// The solids of one shape; none when the kernel has no such solid. An endless cylinder ends outside of `reach`.
fn simple(
    shape: &case::Shape,
    folder: &Path,
    reach: Option<[[f64; 3]; 2]>,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Option<Vec<Shape>>, StageError> {
    let kernel = |made: Result<Shape, OcctError>| -> Result<Option<Vec<Shape>>, StageError> {
        Ok(Some(vec![made.map_err(CadError::from)?]))
    };
    match shape {
        case::Shape::Box { min, max } => kernel(Shape::cuboid(*min, *max)),
        case::Shape::Cylinder {
            point,
            axis,
            radius,
            from,
            to,
        } => {
            let (point, axis) = (Vec3::from(*point), Vec3::from(*axis).normalize());
            let Some([low, high]) = beyond(&point, &axis, reach, *from, *to) else {
                return Ok(None);
            };
            let start = point + axis * low;
            kernel(Shape::cylinder(
                start.into(),
                axis.into(),
                *radius,
                high - low,
            ))
        }
        case::Shape::File { path, scale } if *scale == 1.0 => {
            file(&folder.join(path), options, monitor).map(Some)
        }
        case::Shape::File { .. } | case::Shape::Sphere { .. } | case::Shape::Extrude { .. } => {
            Ok(None)
        }
    }
}

/// Where a cylinder begins and ends along its axis; an end that is not given lies outside of `reach`.
fn beyond(
    point: &Vec3,
    axis: &Vec3,
    reach: Option<[[f64; 3]; 2]>,
    from: Option<f64>,
    to: Option<f64>,
) -> Option<[f64; 2]> {
    if let (Some(from), Some(to)) = (from, to) {
        return Some([from, to]);
    }
    let [low, high] = reach?.map(Vec3::from);
    let (middle, radius) = ((low + high) / 2.0, (high - low).norm());
    let at = (middle - point).dot(axis);
    Some([from.unwrap_or(at - radius), to.unwrap_or(at + radius)])
}

/// The solids of a STEP or mesh file.
fn file(
    path: &Path,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<Vec<Shape>, StageError> {
    let bodies = match io::read_input(path, &ReadOptions::default(), monitor)? {
        Input::Step(path) => cad::read(&path, &options.non_design, monitor)?,
        Input::Mesh { mesh, .. } => {
            let source = path.display().to_string();
            cad::from_mesh("body", &source, &mesh, &options.non_design, monitor)?
        }
        Input::Density { .. } => {
            return Err(StageError::DensityBody {
                path: path.to_owned(),
            });
        }
    };
    Ok(bodies.into_iter().map(|b| b.solid).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Shape as CaseShape;

    fn cylinder(radius: f64, ends: Option<[f64; 2]>) -> CaseShape {
        CaseShape::Cylinder {
            point: [0.0, 52.0, 3.0],
            axis: [0.0, 2.0, 0.0],
            radius,
            from: ends.map(|e| e[0]),
            to: ends.map(|e| e[1]),
        }
    }

    #[test]
    fn an_eye_is_exact_and_its_bore_is_found() {
        let eye = Body {
            name: "eye".into(),
            shapes: vec![cylinder(14.0, Some([-9.0, 9.0]))],
            cut: vec![cylinder(9.0, None)],
        };
        let ball = Body {
            name: "ball".into(),
            shapes: vec![CaseShape::Sphere {
                centre: [0.0; 3],
                radius: 5.0,
            }],
            ..Body::default()
        };
        let job = ReconstructJob {
            bodies: vec![eye, ball],
            ..ReconstructJob::default()
        };
        let monitor = Monitor::default();
        let made = make(&job, &monitor).expect("bodies");
        assert_eq!(made.len(), 1);
        let exact = std::f64::consts::PI * (14.0 * 14.0 - 81.0) * 18.0;
        assert!((made[0].volume / exact - 1.0).abs() < 1e-9);
        assert_eq!(made[0].name, "eye");
        assert_eq!(made[0].bores.len(), 1);
        assert!((made[0].bores[0].radius - 9.0).abs() < 1e-9);
        assert!(monitor.warnings().iter().any(|w| w.text.contains("ball")));
    }
}
