//! Edits of radii as an ordered list that is replayed on every run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Vec3;
use crate::radii;
use crate::skeleton::Skeleton;

/// One edit of the radii of the proposal's skeleton. It names a place, not points: so it can be replayed on another proposal.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RadiusEdit {
    /// Where; everywhere when left out.
    pub within: Option<Region>,
    /// New radius, mm: half of the wall.
    pub set: Option<f64>,
    /// Factor on the radius.
    pub scale: Option<f64>,
    /// Added to the radius, mm.
    pub add: Option<f64>,
    /// Passes of smoothing over the radii there, after the change.
    pub smooth: usize,
}

/// Where an edit acts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Region {
    /// A box along the axes, mm.
    Box {
        /// Lower corner.
        min: [f64; 3],
        /// Upper corner.
        max: [f64; 3],
    },
    /// A ball, mm.
    Sphere {
        /// Centre.
        centre: [f64; 3],
        /// Radius.
        radius: f64,
    },
}

/// What an edit did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct RadiusEdited {
    /// Points of the skeleton that it held.
    pub points: usize,
    /// Mean radius there before and after, mm.
    pub mean_before: f64,
    /// The same after.
    pub mean_after: f64,
    /// Largest change of a radius, mm.
    pub largest_change: f64,
}

/// Why a list of edits was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum EditListError {
    #[error(
        "edits[{edit}] has {found} of set, scale and add; exactly one is wanted, or smooth alone"
    )]
    Kind { edit: usize, found: usize },
    #[error("edits[{edit}].{key} is {value}, {wanted} is wanted")]
    Value {
        edit: usize,
        key: &'static str,
        value: f64,
        wanted: &'static str,
    },
    #[error("edits[{edit}] holds no point of the skeleton; the nearest lies {distance:.1} mm away at ({:.1}, {:.1}, {:.1}) mm", nearest.x, nearest.y, nearest.z)]
    Nothing {
        edit: usize,
        nearest: Vec3,
        distance: f64,
    },
    #[error("edits[{edit}] leaves a radius of {radius:.3} mm at ({:.1}, {:.1}, {:.1}) mm, at least {least:.3} mm is wanted", place.x, place.y, place.z)]
    TooThin {
        edit: usize,
        radius: f64,
        least: f64,
        place: Vec3,
    },
}

impl EditListError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::Kind { .. } => "for example edits=[{\"scale\": 1.25}]",
            Self::Value { .. } => return None,
            Self::Nothing { .. } => "make its region larger, or take it out of the list",
            Self::TooThin { .. } => {
                "walls thinner than the voxels vanish: a smaller remesh.voxel allows thinner ones"
            }
        };
        Some(text.to_owned())
    }
}

impl Region {
    /// How far a point lies outside, mm.
    fn distance(&self, p: &Vec3) -> f64 {
        match self {
            Self::Box { min, max } => {
                let out = |d: usize| (min[d] - p[d]).max(p[d] - max[d]).max(0.0);
                Vec3::new(out(0), out(1), out(2)).norm()
            }
            Self::Sphere { centre, radius } => ((p - Vec3::from(*centre)).norm() - radius).max(0.0),
        }
    }
}

/// Refuses edits that mean nothing.
///
/// # Errors
/// [`EditListError::Kind`], [`EditListError::Value`].
pub fn check_edits(edits: &[RadiusEdit]) -> Result<(), EditListError> {
    for (edit, one) in edits.iter().enumerate() {
        let kinds = [("set", one.set), ("scale", one.scale), ("add", one.add)];
        let found = kinds.iter().filter(|(_, v)| v.is_some()).count();
        if found > 1 || found == 0 && one.smooth == 0 {
            return Err(EditListError::Kind { edit, found });
        }
        for (key, value) in kinds {
            let wanted = match key {
                "add" => "a length",
                _ => "a positive number",
            };
            if let Some(value) = value
                && (!value.is_finite() || key != "add" && value <= 0.0)
            {
                return Err(EditListError::Value {
                    edit,
                    key,
                    value,
                    wanted,
                });
            }
        }
    }
    Ok(())
}

/// Applies a list of edits in its order to the radii of a skeleton, mm; points that are `kept` do not change.
///
/// Radii below `least` are refused: such walls would vanish on the voxels.
///
/// # Errors
/// [`EditListError`].
pub fn edit_radii(
    skeleton: &mut Skeleton,
    kept: &[bool],
    edits: &[RadiusEdit],
    least: f64,
) -> Result<Vec<RadiusEdited>, EditListError> {
    check_edits(edits)?;
    let one = |(number, edit): (usize, &RadiusEdit)| one(skeleton, kept, number, edit, least);
    edits.iter().enumerate().map(one).collect()
}

fn one(
    skeleton: &mut Skeleton,
    kept: &[bool],
    number: usize,
    edit: &RadiusEdit,
    least: f64,
) -> Result<RadiusEdited, EditListError> {
    let away = |p: &Vec3| edit.within.map_or(0.0, |region| region.distance(p));
    let distances: Vec<f64> = skeleton.points.iter().map(away).collect();
    let free = (0..distances.len()).filter(|&i| !kept[i]);
    let held: Vec<usize> = free.clone().filter(|&i| distances[i] == 0.0).collect();
    if held.is_empty() {
        let nearest = free.min_by(|&a, &b| distances[a].total_cmp(&distances[b]));
        return Err(EditListError::Nothing {
            edit: number,
            nearest: nearest.map(|i| skeleton.points[i]).unwrap_or_default(),
            distance: nearest.map_or(f64::INFINITY, |i| distances[i]),
        });
    }
    let before = skeleton.radii.clone();
    for &i in &held {
        let r = &mut skeleton.radii[i];
        *r = edit
            .set
            .unwrap_or(*r * edit.scale.unwrap_or(1.0) + edit.add.unwrap_or(0.0));
    }
    if edit.smooth > 0 {
        let mut smooth = skeleton.clone();
        radii::smooth(&mut smooth, edit.smooth);
        held.iter()
            .for_each(|&i| skeleton.radii[i] = smooth.radii[i]);
    }
    let after = &skeleton.radii;
    if let Some(&thin) = held.iter().find(|&&i| after[i] < least.min(before[i])) {
        return Err(EditListError::TooThin {
            edit: number,
            radius: after[thin],
            least,
            place: skeleton.points[thin],
        });
    }
    let mean = |r: &[f64]| held.iter().map(|&i| r[i]).sum::<f64>() / held.len() as f64;
    let changes = held.iter().map(|&i| (after[i] - before[i]).abs());
    Ok(RadiusEdited {
        points: held.len(),
        mean_before: mean(&before),
        mean_after: mean(after),
        largest_change: changes.fold(0.0, f64::max),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row() -> Skeleton {
        Skeleton {
            points: (0..5).map(|i| Vec3::new(f64::from(i), 0.0, 0.0)).collect(),
            radii: vec![2.0; 5],
            beams: (0..4).map(|i| [i, i + 1]).collect(),
            ..Skeleton::default()
        }
    }

    fn scale(factor: f64) -> RadiusEdit {
        RadiusEdit {
            scale: Some(factor),
            ..RadiusEdit::default()
        }
    }

    #[test]
    fn edits_act_in_their_order_and_only_where_they_are_to() {
        let mut skeleton = row();
        let ball = Region::Sphere {
            centre: [4.0, 0.0, 0.0],
            radius: 1.0,
        };
        let set = RadiusEdit {
            within: Some(ball),
            set: Some(3.0),
            ..RadiusEdit::default()
        };
        let kept = [true, false, false, false, false];
        let done = edit_radii(&mut skeleton, &kept, &[set, scale(1.5)], 0.5).expect("good edits");
        assert_eq!(skeleton.radii, [2.0, 3.0, 3.0, 4.5, 4.5]);
        assert_eq!(done[0].points, 2);
        assert_eq!((done[1].points, done[1].largest_change), (4, 1.5));
    }

    #[test]
    fn smoothing_stays_in_its_region() {
        let mut skeleton = row();
        skeleton.radii[4] = 6.0;
        let edit = RadiusEdit {
            within: Some(Region::Box {
                min: [3.5, -1.0, -1.0],
                max: [9.0, 1.0, 1.0],
            }),
            smooth: 1,
            ..RadiusEdit::default()
        };
        edit_radii(&mut skeleton, &[false; 5], &[edit], 0.5).expect("a good edit");
        assert_eq!(skeleton.radii, [2.0, 2.0, 2.0, 2.0, 4.0]);
    }

    #[test]
    fn edits_that_mean_nothing_are_refused() {
        let run = |edit: RadiusEdit| {
            edit_radii(&mut row(), &[false; 5], &[edit], 0.5).expect_err("refused")
        };
        assert!(matches!(
            run(RadiusEdit::default()),
            EditListError::Kind { found: 0, .. }
        ));
        let both = RadiusEdit {
            set: Some(1.0),
            ..scale(2.0)
        };
        assert!(matches!(run(both), EditListError::Kind { found: 2, .. }));
        assert!(matches!(run(scale(f64::NAN)), EditListError::Value { .. }));
        assert!(matches!(run(scale(0.1)), EditListError::TooThin { .. }));
        let far = RadiusEdit {
            within: Some(Region::Sphere {
                centre: [9.0, 0.0, 0.0],
                radius: 1.0,
            }),
            ..scale(2.0)
        };
        let error = run(far);
        assert!(
            matches!(error, EditListError::Nothing { distance, .. } if (distance - 4.0).abs() < 1e-12),
            "{error}"
        );
        assert!(error.hint().is_some());
    }
}
