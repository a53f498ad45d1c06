//! New radii on a body: every offset is scaled by the ratio of its skeleton point's radii.

use crate::Vec3;
use crate::skeleton::Skeleton;
use crate::spline::ControlMesh;
use crate::thicken::ThickenedBody;

/// Why radii cannot be applied to a body.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EditError {
    /// Not one radius a skeleton point.
    #[error("{radii} radii for a skeleton of {points} points")]
    Count {
        /// Radii given.
        radii: usize,
        /// Points of the skeleton.
        points: usize,
    },
    /// A radius, old or new, is not a positive number.
    #[error("the radius of skeleton point {point} at ({}, {}, {}) would go from {before} to {after} mm, both must be positive", place.x, place.y, place.z)]
    Radius {
        /// Index of the skeleton point.
        point: usize,
        /// Its position, mm.
        place: Vec3,
        /// Radius before, mm.
        before: f64,
        /// Radius after, mm.
        after: f64,
    },
    /// The control points are not those of the thickened body.
    #[error("{points} control points for a body of {body}")]
    Body {
        /// Control points given.
        points: usize,
        /// Points of the thickened body.
        body: usize,
    },
    /// A control point names a skeleton point that does not exist.
    #[error("control point {point} belongs to skeleton point {source_point}, there are {points}")]
    Source {
        /// Index of the control point.
        point: usize,
        /// Skeleton point that it names.
        source_point: u32,
        /// Points of the skeleton.
        points: usize,
    },
}

impl EditError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Count { .. } | Self::Radius { .. } => {
                Some("give one positive radius a point of skeleton.ply, in its order".to_owned())
            }
            Self::Body { .. } | Self::Source { .. } => {
                Some("use the body that was thickened from this skeleton".to_owned())
            }
        }
    }
}

/// The control points of `mesh` with the offset of each from its foot on the skeleton scaled by new over old radius.
///
/// `mesh` is the thickened body itself or its fit: both have the points of `body` in the same order. `skeleton` holds the
/// radii before, `radii` those after, mm, one a skeleton point.
///
/// What is guaranteed: connectivity, and with it the topology, stays; points whose radius does not change stay to the last
/// bit; equal radii give an equal mesh. The scaling is linear, so a limit surface whose radii all change by one factor
/// changes its offsets by that factor. What is not: that the surface does not cut itself. Where neighbouring radii grow by
/// different factors or gaps close it may; give the result to [`crate::fit::fit`] with the target of [`super::grow`], which
/// untangles, or look for intersections.
///
/// # Errors
/// [`EditError`] when the three do not belong together or a radius is not positive.
pub fn apply_radii(
    mesh: &ControlMesh,
    body: &ThickenedBody,
    skeleton: &Skeleton,
    radii: &[f64],
) -> Result<ControlMesh, EditError> {
    let points = skeleton.points.len();
    if radii.len() != points || skeleton.radii.len() != points {
        let radii = radii.len().min(skeleton.radii.len());
        return Err(EditError::Count { radii, points });
    }
    let usable = |r: f64| r.is_finite() && r > 0.0;
    let pairs = skeleton.radii.iter().zip(radii);
    if let Some((point, (&before, &after))) = pairs
        .enumerate()
        .find(|(_, (before, after))| !usable(**before) || !usable(**after))
    {
        let place = skeleton.points[point];
        return Err(EditError::Radius {
            point,
            place,
            before,
            after,
        });
    }
    let count = mesh.points.len();
    if body.source.len() != count || body.foot.len() != count {
        let body = body.source.len().min(body.foot.len());
        return Err(EditError::Body {
            points: count,
            body,
        });
    }
    let mut out = mesh.clone();
    for (i, p) in out.points.iter_mut().enumerate() {
        let s = body.source[i] as usize;
        if s >= points {
            return Err(EditError::Source {
                point: i,
                source_point: body.source[i],
                points,
            });
        }
        if radii[s] != skeleton.radii[s] {
            *p = body.foot[i] + (*p - body.foot[i]) * (radii[s] / skeleton.radii[s]);
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::monitor::Monitor;
    use crate::thicken::{ThickenOptions, thicken};

    fn sheet() -> (Skeleton, ThickenedBody) {
        let mut skeleton = Skeleton::default();
        for j in 0..4 {
            for i in 0..4 {
                skeleton
                    .points
                    .push(Vec3::new(f64::from(i), f64::from(j), 0.0) * 10.0);
                skeleton.radii.push(2.0);
            }
        }
        for j in 0..3_u32 {
            for i in 0..3_u32 {
                let a = 4 * j + i;
                skeleton.quads.push([a, a + 1, a + 5, a + 4]);
            }
        }
        let body = thicken(&skeleton, &ThickenOptions::default(), &Monitor::default())
            .expect("a plain sheet");
        (skeleton, body)
    }

    #[test]
    fn scaled_radii_scale_the_thickened_body() {
        let (skeleton, body) = sheet();
        let same = apply_radii(&body.mesh, &body, &skeleton, &skeleton.radii).expect("its own");
        assert_eq!(same, body.mesh);
        let radii: Vec<f64> = skeleton.radii.iter().map(|r| 1.5 * r).collect();
        let grown = apply_radii(&body.mesh, &body, &skeleton, &radii).expect("its own");
        let mut thicker = skeleton.clone();
        thicker.radii = radii;
        let wanted = thicken(&thicker, &ThickenOptions::default(), &Monitor::default())
            .expect("a plain sheet");
        for (a, b) in grown.points.iter().zip(&wanted.mesh.points) {
            assert!((a - b).norm() < 1e-12);
        }
    }

    #[test]
    fn only_edited_points_move() {
        let (skeleton, body) = sheet();
        let mut radii = skeleton.radii.clone();
        radii[5] = 3.0;
        let grown = apply_radii(&body.mesh, &body, &skeleton, &radii).expect("its own");
        for (i, (a, b)) in grown.points.iter().zip(&body.mesh.points).enumerate() {
            assert_eq!(a != b, body.source[i] == 5);
        }
    }

    #[test]
    fn radii_that_do_not_fit_are_refused() {
        let (skeleton, body) = sheet();
        let short = apply_radii(&body.mesh, &body, &skeleton, &[1.0]);
        assert!(matches!(
            short,
            Err(EditError::Count {
                radii: 1,
                points: 16
            })
        ));
        let mut radii = skeleton.radii.clone();
        radii[7] = -1.0;
        let negative = apply_radii(&body.mesh, &body, &skeleton, &radii);
        assert!(matches!(negative, Err(EditError::Radius { point: 7, .. })));
        let other = apply_radii(&ControlMesh::default(), &body, &skeleton, &skeleton.radii);
        assert!(matches!(other, Err(EditError::Body { points: 0, .. })));
    }
}
